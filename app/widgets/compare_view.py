"""Two pictures of the same thing: side by side with one zoom, laid over each other, or flickering.

Public API
----------
``CompareView()``: ``set_pictures(left, right, left_caption, right_caption)`` (QImage, ndarray or None),
    ``set_mode("side" | "overlay" | "flicker")``, ``mode``, ``left``, ``right`` (`PhotoView`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QSize, Qt, QTimer, Slot
from PySide6.QtGui import QHideEvent, QImage, QShowEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QSlider, QVBoxLayout, QWidget

from app.theme import icon, palette, set_state, style_class
from app.widgets.photo_view import PhotoView

Picture = QImage | NDArray[np.uint8] | None

MODES = (
    ("side", "Side by side", "compare"),
    ("overlay", "Overlay", "layers"),
    ("flicker", "Flicker", "flicker"),
)
FLICKER_MS = 600


class CompareView(QWidget):
    """See the module's documentation."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("compare_view")
        self.mode = "side"
        self._pictures: tuple[Picture, Picture] = (None, None)
        self._following = False
        self.left, self._left_frame, self._left_caption = self._pane("compare_left")
        self.right, self._right_frame, self._right_caption = self._pane("compare_right")
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setObjectName("compare_slider")
        self.slider.setRange(0, 100)
        self.slider.setValue(50)
        self.slider.setToolTip("From the earlier to the later picture")
        self.slider.valueChanged.connect(self._on_slider)
        self._timer = QTimer(self, interval=FLICKER_MS)
        self._timer.timeout.connect(self._flick)
        self._buttons = {key: self._button(key, text, symbol) for key, text, symbol in MODES}
        self._build()
        self.left.view_changed.connect(lambda: self._follow(self.left, self.right))
        self.right.view_changed.connect(lambda: self._follow(self.right, self.left))
        self.set_mode("side")

    def _pane(self, name: str) -> tuple[PhotoView, QFrame, QLabel]:
        view = PhotoView()
        view.setObjectName(name)
        caption = QLabel()
        caption.setObjectName(f"{name}_caption")
        style_class(caption, "strong")
        photo = QFrame()
        style_class(photo, "photo")
        inside = QVBoxLayout(photo)
        inside.setContentsMargins(1, 1, 1, 1)
        inside.addWidget(view)
        frame = QFrame()
        column = QVBoxLayout(frame)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(8)
        column.addWidget(caption)
        column.addWidget(photo, 1)
        return view, frame, caption

    def _button(self, key: str, text: str, symbol: str) -> QPushButton:
        button = QPushButton(icon(symbol, palette.TEXT), f" {text}")
        button.setObjectName(f"compare_{key}")
        button.setCheckable(True)
        button.setIconSize(QSize(18, 18))
        style_class(button, "segment")
        set_state(button, "first", "true" if key == MODES[0][0] else "false")
        set_state(button, "last", "true" if key == MODES[-1][0] else "false")
        button.clicked.connect(lambda _=False: self.set_mode(key))
        return button

    def _build(self) -> None:
        tools = QHBoxLayout()
        tools.setSpacing(0)
        for button in self._buttons.values():
            tools.addWidget(button)
        tools.addSpacing(24)
        tools.addWidget(self.slider, 1)
        tools.addStretch(1)
        panes = QHBoxLayout()
        panes.setSpacing(16)
        panes.addWidget(self._left_frame, 1)
        panes.addWidget(self._right_frame, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(12)
        column.addLayout(tools)
        column.addLayout(panes, 1)

    def set_pictures(self, left: Picture, right: Picture, left_caption: str, right_caption: str) -> None:
        """Show a pair, the earlier picture left."""
        self._pictures = (left, right)
        self._left_caption.setText(left_caption)
        self._right_caption.setText(right_caption)
        self.left.set_image(left)
        self.right.set_image(right)
        self.set_mode(self.mode if left is not None and right is not None else "side")
        for key, button in self._buttons.items():
            button.setEnabled(key == "side" or (left is not None and right is not None))
        QTimer.singleShot(0, self.left.fit)
        QTimer.singleShot(0, self.right.fit)

    def set_mode(self, mode: str) -> None:
        """Change how the pair is shown."""
        self.mode = mode
        for key, button in self._buttons.items():
            button.setChecked(key == mode)
        self._right_frame.setVisible(mode == "side")
        self.slider.setVisible(mode == "overlay")
        self._timer.stop()
        if mode == "side":
            self.left.set_ghost_image(None)
            return
        self.left.set_ghost_image(self._pictures[1], self.slider.value() / 100)
        if mode == "flicker":
            self._shown_later = False
            self.left.set_ghost_opacity(0.0)
            if self.isVisible():
                self._timer.start()

    @Slot(int)
    def _on_slider(self, value: int) -> None:
        self.left.set_ghost_opacity(value / 100)

    @Slot()
    def _flick(self) -> None:
        self._shown_later = not self._shown_later
        self.left.set_ghost_opacity(1.0 if self._shown_later else 0.0)

    def _follow(self, leader: PhotoView, follower: PhotoView) -> None:
        if not self._following and self.mode == "side":
            self._following = True
            follower.set_view_state(leader.view_state())
            self._following = False

    def showEvent(self, event: QShowEvent) -> None:  # noqa: D102
        super().showEvent(event)
        if self.mode == "flicker":
            self._timer.start()

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: D102
        self._timer.stop()
        super().hideEvent(event)
