"""Correcting joints by hand: drag a joint on the photo to where it is.

Public API of `JointEditor` (a row of buttons; the joints appear on the photo it is given)
-------------------------------------------------------------------------------------------
``set_capture(analysed | None)``   what can be corrected; what came of an own correction keeps the history
``set_editing(bool)``, ``editing`` the button "Correct joints" does the same
``undo()``, ``reset()``            also buttons; Ctrl+Z on the photo undoes
``skeleton``                       as it is now

Signals: ``corrected(Skeleton)`` after every release, undo and reset; ``editing_changed(bool)``: on True the
plain picture is shown with the joints over it, on False whoever owns the photo shows it as usual.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QEvent, QObject, QPointF, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QKeyEvent, QKeySequence, QMouseEvent
from PySide6.QtWidgets import QApplication, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from app.theme import icon, palette, style_class
from app.widgets.photo_view import PhotoView
from app.windows.visit.joint_marks import LEFT_COLOR, RIGHT_COLOR, JointMarks
from app.windows.visit.pictures import capture_picture
from core.errors import GeodermError

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture, JointPlacer, Skeleton

_HINT = (
    "Drag a joint to where it is in the picture. The patient's own "
    f"<b style='color:{LEFT_COLOR}'>left is teal</b>, "
    f"<b style='color:{RIGHT_COLOR}'>right is violet</b>."
)


class JointEditor(QWidget):
    """See the module's documentation.

    Parameters
    ----------
    photo : PhotoView
        Shows the capture's picture in full resolution.
    name : str
        Prefix of the object names.
    """

    corrected = Signal(object)
    editing_changed = Signal(bool)

    def __init__(self, photo: PhotoView, name: str = "joints", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(f"{name}_editor")
        self._photo = photo
        self._marks = JointMarks(photo)
        self._analysed: AnalysedCapture | None = None
        self._placer: JointPlacer | None = None
        self._history: list[Skeleton] = []
        self._dragged: str | None = None
        self._press = QPointF()
        self._moving = False
        self.toggle = _button("Correct joints", "edit", f"{name}_correct")
        self.toggle.setCheckable(True)
        self.toggle.toggled.connect(self._on_toggled)
        self.undo_button = _button("Undo", "undo", f"{name}_undo")
        self.undo_button.clicked.connect(self.undo)
        self.reset_button = _button("Reset", "refresh", f"{name}_reset")
        self.reset_button.setToolTip("Put all joints back where they were found")
        self.reset_button.clicked.connect(self.reset)
        self.hint = QLabel()
        self.hint.setObjectName(f"{name}_hint")
        self.hint.setWordWrap(True)
        style_class(self.hint, "caption")
        row = QHBoxLayout()
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(8)
        for button in (self.toggle, self.undo_button, self.reset_button):
            row.addWidget(button)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        column.addLayout(row)
        column.addWidget(self.hint)
        photo.viewport().installEventFilter(self)
        photo.installEventFilter(self)
        self._refresh()

    # --- what is corrected ---------------------------------------------------------------------------

    def set_capture(self, analysed: AnalysedCapture | None) -> None:
        """Offer another capture for correction, or none. The same capture analysed anew keeps the history."""
        same = analysed is not None and self._analysed is not None and analysed.scan is self._analysed.scan
        self._analysed = analysed
        if not same:
            self.set_editing(False)
            self._placer = None
            self._history = [] if analysed is None else [analysed.skeleton]
        self._refresh()

    @property
    def skeleton(self) -> Skeleton | None:
        """The joints as they are now."""
        return self._history[-1] if self._history else None

    @property
    def editing(self) -> bool:
        """Whether joints can be dragged."""
        return self.toggle.isChecked()

    def set_editing(self, on: bool) -> None:
        """Switch the correction on or off."""
        self.toggle.setChecked(on and self._analysed is not None)

    @property
    def hovered(self) -> str | None:
        """The joint under the mouse, whose name is shown."""
        return self._marks.hovered

    def joint_position(self, name: str) -> QPointF:
        """Where a joint is in the photo's viewport, for tests and demonstrations."""
        return QPointF(self._marks.position(name))

    def undo(self) -> None:
        """Take the last correction back."""
        if self.editing and len(self._history) > 1:
            self._history.pop()
            self._tell()

    def reset(self) -> None:
        """Take all corrections back."""
        if self.editing and len(self._history) > 1:
            self._history = self._history[:1]
            self._tell()

    def _tell(self) -> None:
        self._refresh()
        self.corrected.emit(self.skeleton)

    def _on_toggled(self, on: bool) -> None:
        analysed = self._analysed
        if on and analysed is None:
            with QSignalBlocker(self.toggle):
                self.toggle.setChecked(False)
            return
        if on and analysed is not None:
            from core.anchors import JointPlacer

            if self._placer is None:
                self._placer = JointPlacer(analysed.capture.rig, analysed.scan.surface)
            self._photo.set_image(capture_picture(analysed))
        else:
            self._end_drag()
            self._photo.viewport().unsetCursor()
        self._refresh()
        self.editing_changed.emit(on)

    def _refresh(self, complaint: str = "") -> None:
        skeleton = self.skeleton
        self.toggle.setEnabled(skeleton is not None)
        self.toggle.setText(" Done" if self.editing else " Correct joints")
        self.toggle.setIcon(icon("check" if self.editing else "edit", palette.SECONDARY))
        for button in (self.undo_button, self.reset_button):
            button.setVisible(self.editing)
            button.setEnabled(len(self._history) > 1)
        self.hint.setText(complaint or _HINT)
        self.hint.setVisible(self.editing)
        if self.editing and skeleton is not None:
            self._marks.show(skeleton)
        else:
            self._marks.clear()

    # --- mouse and keys ------------------------------------------------------------------------------

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: D102
        if not self.editing:
            return False
        if isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress:
            return self._on_key(event)
        if isinstance(event, QMouseEvent):
            kind = event.type()
            if kind == QEvent.Type.MouseButtonPress:
                return self._on_press(event)
            if kind == QEvent.Type.MouseMove:
                return self._on_move(event)
            if kind == QEvent.Type.MouseButtonRelease:
                return self._on_release(event)
        elif event.type() == QEvent.Type.Leave:
            self._marks.hover(None)
        return False

    def _on_key(self, event: QKeyEvent) -> bool:
        if event.matches(QKeySequence.StandardKey.Undo):
            self.undo()
            return True
        if event.key() == Qt.Key.Key_Escape and self._dragged is not None:
            self._end_drag()
            self._refresh()
            return True
        return False

    def _on_press(self, event: QMouseEvent) -> bool:
        if event.button() != Qt.MouseButton.LeftButton:
            return False
        self._dragged = self._marks.at(event.position().toPoint())
        self._press, self._moving = event.position(), False
        self._photo.setFocus()
        return self._dragged is not None

    def _on_move(self, event: QMouseEvent) -> bool:
        if self._dragged is None:
            if event.buttons() == Qt.MouseButton.NoButton:
                name = self._marks.at(event.position().toPoint())
                self._marks.hover(name)
                if name is not None:
                    self._photo.viewport().setCursor(Qt.CursorShape.PointingHandCursor)
                    return True
                self._photo.viewport().setCursor(Qt.CursorShape.OpenHandCursor)
            return False
        far = (event.position() - self._press).manhattanLength() >= QApplication.startDragDistance() // 2
        self._moving = self._moving or far
        if self._moving:
            self._photo.viewport().setCursor(Qt.CursorShape.SizeAllCursor)
            self._marks.drag(self._dragged, *self._place(event))
        return True

    def _on_release(self, event: QMouseEvent) -> bool:
        name, moving = self._dragged, self._moving
        if name is None or event.button() != Qt.MouseButton.LeftButton:
            return False
        self._end_drag()
        skeleton = self.skeleton
        if moving and self._placer is not None and skeleton is not None:
            try:
                placed = self._placer.place(skeleton, name, np.array(self._place(event)))
            except GeodermError as error:
                self._refresh(f"{error.message} {error.advice}".strip())
                return True
            self._history.append(placed)
            self._tell()
        return True

    def _place(self, event: QMouseEvent) -> tuple[float, float]:
        """Image pixel under the mouse."""
        return self._photo.image_position(event.position())

    def _end_drag(self) -> None:
        self._dragged, self._moving = None, False
        self._photo.viewport().setCursor(Qt.CursorShape.OpenHandCursor)


def _button(text: str, symbol: str, name: str) -> QPushButton:
    button = QPushButton(icon(symbol, palette.SECONDARY), f" {text}")
    button.setObjectName(name)
    style_class(button, "quiet")
    return button
