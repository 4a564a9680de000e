"""The first thing seen: painted on Qt alone while the clinic's records are opened in the background."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QFrame, QLabel, QProgressBar, QPushButton, QVBoxLayout, QWidget

from app.tasks import TaskFailure, describe_failure
from app.theme import icon_pixmap, palette, style_class

SIZE = (1440, 900)


class StartWindow(QWidget):
    """Opens the records in a thread of its own and says so; if they cannot be opened, says why.

    Parameters
    ----------
    open_records : callable
        Called once in the thread; what it returns goes to `opened`.

    Signals
    -------
    opened(object)
        The records, in the GUI thread.
    failed()
        They cannot be opened; the window stays and says what to do. The error is in `error`.
    """

    opened = Signal(object)
    failed = Signal()
    _done = Signal(object)

    def __init__(self, open_records: Callable[[], Any]) -> None:
        super().__init__()
        self.setObjectName("start_window")
        self.setWindowTitle("GeoDerm")
        style_class(self, "page")
        self.resize(*SIZE)
        self.error: Exception | None = None
        self._open_records = open_records
        self._records: Any = None
        logo = QLabel()
        logo.setPixmap(icon_pixmap("geoderm", 44, palette.ACCENT))
        self.title = QLabel("GeoDerm")
        style_class(self.title, "title")
        self.text = QLabel("Opening the clinic's records")
        self.text.setObjectName("start_text")
        self.text.setWordWrap(True)
        style_class(self.text, "secondary")
        self.bar = QProgressBar()
        self.bar.setRange(0, 0)
        self.bar.setTextVisible(False)
        self.close_button = QPushButton("Close")
        self.close_button.setObjectName("start_close")
        style_class(self.close_button, "primary")
        self.close_button.clicked.connect(self.close)
        self.close_button.hide()
        card = QFrame()
        card.setFixedWidth(420)
        style_class(card, "card")
        inside = QVBoxLayout(card)
        inside.setContentsMargins(32, 32, 32, 32)
        inside.setSpacing(16)
        for widget in (logo, self.title, self.text, self.bar, self.close_button):
            inside.addWidget(widget)
        QVBoxLayout(self).addWidget(card, 0, Qt.AlignmentFlag.AlignCenter)
        self._done.connect(self._on_done, Qt.ConnectionType.QueuedConnection)
        self._thread = threading.Thread(target=self._open, name="records", daemon=True)

    def begin(self) -> None:
        """Show the window and start opening."""
        self.show()
        self._thread.start()

    def abandon(self) -> Any:
        """Wait for the thread; return what it opened and nobody took (the window closed early), or None."""
        if self._thread.ident is not None:
            self._thread.join()
        records, self._records = self._records, None
        return records

    def _open(self) -> None:
        try:
            self._records = self._open_records()
        except Exception as error:  # noqa: BLE001 - the border of a thread: nothing may get lost here
            self._done.emit(error)
        else:
            self._done.emit(None)

    @Slot(object)
    def _on_done(self, error: Exception | None) -> None:
        self._thread.join()
        if error is None:
            records, self._records = self._records, None
            if records is not None:
                self.opened.emit(records)
            return
        self.error = error
        self._tell(describe_failure(error))
        self.failed.emit()

    def _tell(self, failure: TaskFailure) -> None:
        self.title.setText("GeoDerm cannot start")
        message = "The records could not be opened." if failure.is_bug else failure.message
        self.text.setText(f"{message} {failure.advice}".strip())
        style_class(self.text, "strong")
        self.bar.hide()
        self.close_button.show()
        self.close_button.setFocus()
