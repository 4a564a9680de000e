"""Dermoscopic images of one lesion: thumbnails, a button to attach, and a place to drop files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QSize, Qt, Signal, Slot
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QIcon, QPixmap
from PySide6.QtWidgets import QFileDialog, QFrame, QHBoxLayout, QLabel, QPushButton, QToolButton, QWidget

from app.theme import icon, palette, style_class

_SIDE = 52
IMAGE_FILTER = "Images (*.jpg *.jpeg *.png *.tif *.tiff);;All files (*)"


@dataclass(frozen=True)
class Thumbnail:
    """A small picture of a stored image.

    Attributes
    ----------
    image_id : int
    png : bytes
    caption : str
        For example ``Visit 1, 12 Jan 2026``.
    current : bool
        Whether it was taken in this visit (an earlier one is shown for comparison).
    """

    image_id: int
    png: bytes
    caption: str
    current: bool


class DermoscopyStrip(QFrame):
    """A row of thumbnails with an attach button; image files may be dropped on it.

    Signals
    -------
    files_chosen(list of Path)
    image_clicked(int)
        Id of the image.
    """

    files_chosen = Signal(list)
    image_clicked = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("dermoscopy_strip")
        style_class(self, "panel")
        self.setAcceptDrops(True)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(6, 6, 6, 6)
        self._row.setSpacing(8)
        self._thumbs: list[QToolButton] = []
        self._empty = QLabel("Drop a dermoscopic image here")
        style_class(self._empty, "caption")
        self._empty.setWordWrap(True)
        self.attach = QPushButton(icon("dermoscopy", palette.SECONDARY), " Attach")
        self.attach.setObjectName("attach_dermoscopy")
        self.attach.setToolTip("Attach dermoscopic images from files")
        self.attach.clicked.connect(self._ask)
        self._row.addWidget(self._empty, 1)
        self._row.addWidget(self.attach, 0, Qt.AlignmentFlag.AlignVCenter)
        self.setFixedHeight(_SIDE + 14)

    def set_thumbnails(self, thumbnails: Sequence[Thumbnail]) -> None:
        """Show these images (the newest four), first visit first."""
        for button in self._thumbs:
            self._row.removeWidget(button)
            button.hide()
            button.deleteLater()
        self._thumbs = []
        for position, thumb in enumerate(list(thumbnails)[-4:]):
            pixmap = QPixmap()
            pixmap.loadFromData(thumb.png)
            button = QToolButton()
            button.setObjectName(f"dermoscopy_{thumb.image_id}")
            button.setIcon(
                QIcon(
                    pixmap.scaled(
                        _SIDE,
                        _SIDE,
                        Qt.AspectRatioMode.KeepAspectRatioByExpanding,
                        Qt.TransformationMode.SmoothTransformation,
                    ).copy(0, 0, _SIDE, _SIDE)
                )
            )
            button.setIconSize(QSize(_SIDE - 6, _SIDE - 6))
            line = palette.ACCENT if thumb.current else palette.BORDER_STRONG
            button.setStyleSheet(
                f"QToolButton {{ padding: 0; border: 2px solid {line}; border-radius: 6px;"
                f" min-width: {_SIDE - 4}px; max-width: {_SIDE - 4}px;"
                f" min-height: {_SIDE - 4}px; max-height: {_SIDE - 4}px; }}"
                f"QToolButton:hover, QToolButton:focus {{ border-color: {palette.ACCENT_HOVER}; }}"
            )
            button.setToolTip(f"{thumb.caption}. Click to look at it closely.")
            button.clicked.connect(lambda _=False, i=thumb.image_id: self.image_clicked.emit(i))
            self._row.insertWidget(position, button)
            self._thumbs.append(button)
        self._empty.setText(
            "Drop a dermoscopic image here" if not thumbnails else _count(thumbnails, self._room())
        )

    def _room(self) -> int:
        return 4

    @Slot()
    def _ask(self) -> None:
        names, _ = QFileDialog.getOpenFileNames(self, "Attach dermoscopic images", "", IMAGE_FILTER)
        if names:
            self.files_chosen.emit([Path(name) for name in names])

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:  # noqa: D102
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:  # noqa: D102
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        if paths:
            event.acceptProposedAction()
            self.files_chosen.emit(paths)


def _count(thumbnails: Sequence[Thumbnail], shown: int) -> str:
    hidden = len(thumbnails) - shown
    return f"and {hidden} more" if hidden > 0 else ""
