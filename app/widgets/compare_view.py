"""Two photos of the same thing, of two days: side by side with one zoom, laid over each other, or flickering.

Public API of `CompareView`
---------------------------
``set_pair(left, right, left_title, right_title, left_mm_per_pixel=None, right_mm_per_pixel=None)``
``set_mode("side" | "overlay" | "flicker")``, ``mode()``
``left``, ``right``  the two `PhotoView`; buttons ``compare_side``, ``compare_overlay``, ``compare_flicker``, ``compare_fit``,
slider ``compare_opacity``. Where both scales are known, equal lengths look equal.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QSize, Qt, QTimer, Slot
from PySide6.QtGui import QHideEvent, QImage
from PySide6.QtWidgets import (
    QButtonGroup,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSlider,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.theme import icon, palette, set_state, style_class
from app.widgets.photo_view import PhotoView, ViewState

MODES = (("side", "Side by side", "compare"), ("overlay", "Overlay", "layers"), ("flicker", "Flicker", "flicker"))
FLICKER_MS = 600

Picture = QImage | NDArray[np.uint8] | None


class CompareView(QWidget):
    """See the module's documentation."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.left, self.right = PhotoView(), PhotoView()
        self.left.setObjectName("compare_left")
        self.right.setObjectName("compare_right")
        self._titles = QLabel(), QLabel()
        self._scales: tuple[float | None, float | None] = (None, None)
        self._pictures: tuple[Picture, Picture] = (None, None)
        self._mode = "side"
        self._columns: list[QWidget] = []
        row = QHBoxLayout()
        row.setSpacing(16)
        for view, title in zip((self.left, self.right), self._titles, strict=True):
            style_class(title, "strong")
            column = QWidget()
            box = QVBoxLayout(column)
            box.setContentsMargins(0, 0, 0, 0)
            box.setSpacing(8)
            box.addWidget(title)
            frame = QFrame()
            style_class(frame, "photo")
            inner = QVBoxLayout(frame)
            inner.setContentsMargins(1, 1, 1, 1)
            inner.addWidget(view)
            box.addWidget(frame, 1)
            self._columns.append(column)
            row.addWidget(column, 1)
        self.left.view_changed.connect(self._follow_left)
        self.right.view_changed.connect(self._follow_right)
        self._timer = QTimer(self, interval=FLICKER_MS)
        self._timer.timeout.connect(self._flick)
        self._flick_on = False
        column_layout = QVBoxLayout(self)
        column_layout.setContentsMargins(0, 0, 0, 0)
        column_layout.setSpacing(12)
        column_layout.addLayout(row, 1)
        column_layout.addLayout(self._controls())
        self.set_mode("side")

    def _controls(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(0)
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        for number, (mode, text, symbol) in enumerate(MODES):
            button = QPushButton(icon(symbol, palette.SECONDARY), text)
            button.setObjectName(f"compare_{mode}")
            button.setCheckable(True)
            button.setIconSize(QSize(18, 18))
            style_class(button, "segment")
            set_state(button, "first", "true" if number == 0 else "false")
            set_state(button, "last", "true" if number == len(MODES) - 1 else "false")
            button.clicked.connect(lambda _=False, m=mode: self.set_mode(m))
            self._group.addButton(button)
            self._buttons[mode] = button
            row.addWidget(button)
        row.addSpacing(16)
        self._before = QLabel("Earlier")
        self._after = QLabel("Later")
        self._slider = QSlider(Qt.Orientation.Horizontal)
        self._slider.setObjectName("compare_opacity")
        self._slider.setRange(0, 100)
        self._slider.setValue(50)
        self._slider.setFixedWidth(240)
        self._slider.valueChanged.connect(self._on_slider)
        for label in (self._before, self._after):
            style_class(label, "secondary")
        for widget in (self._before, self._slider, self._after):
            row.addWidget(widget)
            row.addSpacing(8)
        row.addStretch(1)
        for name, symbol, tip, action in (
            ("compare_zoom_in", "zoom-in", "Zoom in (+)", lambda: self.left.zoom_by(1.25)),
            ("compare_zoom_out", "zoom-out", "Zoom out (-)", lambda: self.left.zoom_by(0.8)),
            ("compare_fit", "fit", "Show the whole pictures (0)", self.fit),
        ):
            tool = QToolButton()
            tool.setObjectName(name)
            tool.setIcon(icon(symbol, palette.SECONDARY))
            tool.setIconSize(QSize(20, 20))
            tool.setToolTip(tip)
            style_class(tool, "icon")
            tool.clicked.connect(lambda _=False, a=action: a())
            row.addWidget(tool)
        return row

    def set_pair(
        self,
        left: Picture,
        right: Picture,
        left_title: str = "",
        right_title: str = "",
        left_mm_per_pixel: float | None = None,
        right_mm_per_pixel: float | None = None,
    ) -> None:
        """Show two pictures; the scales are known or None."""
        self._pictures = (left, right)
        self._scales = (left_mm_per_pixel, right_mm_per_pixel)
        for view, picture, scale in zip((self.left, self.right), self._pictures, self._scales, strict=True):
            view.set_image(picture)
            view.set_scale_mm(scale)
            view.fit()
        for label, text in zip(self._titles, (left_title, right_title), strict=True):
            label.setText(text)
        self.set_mode(self._mode)

    def mode(self) -> str:
        """How the pictures are shown."""
        return self._mode

    def set_mode(self, mode: str) -> None:
        """Show them side by side, laid over each other, or in turn."""
        self._mode = mode
        self._buttons[mode].setChecked(True)
        side = mode == "side"
        self._columns[1].setVisible(side)
        for widget in (self._before, self._slider, self._after):
            widget.setVisible(mode == "overlay")
        self._timer.stop()
        self.left.set_ghost_image(None if side else self._pictures[1], self._slider.value() / 100)
        if mode == "flicker":
            self._flick_on = False
            self._flick()
            self._timer.start()

    @Slot()
    def fit(self) -> None:
        """Show both whole pictures."""
        self.left.fit()
        self.right.fit()

    @Slot(int)
    def _on_slider(self, value: int) -> None:
        self.left.set_ghost_opacity(value / 100)

    @Slot()
    def _flick(self) -> None:
        self._flick_on = not self._flick_on
        self.left.set_ghost_opacity(1.0 if self._flick_on else 0.0)

    @Slot()
    def _follow_left(self) -> None:
        self.right.set_view_state(self._matched(self.left, self.right, 0))

    @Slot()
    def _follow_right(self) -> None:
        self.left.set_view_state(self._matched(self.right, self.left, 1))

    def _matched(self, source: PhotoView, target: PhotoView, index: int) -> ViewState:
        """The view of ``target`` that shows what ``source`` shows; equal millimetres where both are known."""
        state = source.view_state()
        mine, other = self._scales[index], self._scales[1 - index]
        if not mine or not other:
            return state
        ratio = target.fitted_scale() / source.fitted_scale()
        return ViewState(state.zoom * (other / mine) / ratio, state.x, state.y)

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: D102
        self._timer.stop()
        super().hideEvent(event)
