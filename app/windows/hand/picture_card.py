"""The picture with what is drawn on it, and the switches for that."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import Qt, Slot
from PySide6.QtWidgets import QCheckBox, QFrame, QHBoxLayout, QLabel, QStackedWidget, QVBoxLayout, QWidget

from app.theme import palette, style_class
from app.widgets.hand_picture import HandPicture
from app.windows.hand.parts import tool
from app.windows.hand.ticks import Tick
from app.workflows.hand_rows import HandShot

_LAYERS = (("points", "Points"), ("bones", "Bones"), ("marker", "Marker"), ("names", "Names"))
_SPAN_M = 0.30
"""What the view holds when it shows the hand alone: fingertips to wrist, and some room."""


class PictureCard(QFrame):
    """See the module's documentation."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        style_class(self, "card")
        self.picture = HandPicture("hand_picture")
        self.notice = QLabel("Choose a camera, or open a recorded sequence.")
        self.notice.setObjectName("hand_notice")
        self.notice.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.notice.setWordWrap(True)
        self.notice.setStyleSheet(
            f"background: {palette.PHOTO_BACKGROUND}; color: {palette.BORDER_STRONG}; font-size: 17px;"
        )
        self.stack = QStackedWidget()
        self.stack.addWidget(self.notice)
        self.stack.addWidget(self.picture)
        self._tick: Tick | None = None
        self._zoomed: HandShot | None = None
        self.layers: dict[str, QCheckBox] = {}
        row = QHBoxLayout()
        row.setContentsMargins(8, 0, 2, 0)
        row.setSpacing(16)
        for key, text in _LAYERS:
            box = QCheckBox(text)
            box.setObjectName(f"hand_layer_{key}")
            box.setChecked(key != "names")
            box.toggled.connect(self._layers_changed)
            row.addWidget(box)
            self.layers[key] = box
        row.addStretch(1)
        for name, symbol, tip, slot in (
            ("hand_zoom_out", "zoom-out", "Smaller (-)", lambda: self.picture.zoom_by(0.8)),
            ("hand_zoom_in", "zoom-in", "Larger (+)", lambda: self.picture.zoom_by(1.25)),
            ("hand_zoom_fit", "fit", "The whole picture (0)", self.picture.fit),
            ("hand_zoom_hand", "target", "The hand alone (H)", self.zoom_to_hand),
        ):
            row.addWidget(tool(name, symbol, tip, slot))
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 2)
        column.setSpacing(2)
        column.addWidget(self.stack, 1)
        column.addLayout(row)

    def show_tick(self, tick: Tick, *, labelling: bool) -> None:
        """Another frame."""
        self._tick = tick
        self.stack.setCurrentWidget(self.picture)
        self.picture.show_frame(tick.image)
        self.picture.show_answer(
            None if labelling else tick.answer,
            tick.anchors_px,
            kind=tick.anchors_kind,
            seen=tick.anchors_seen,
        )
        if labelling and tick.skin is not None and self._zoomed is not tick.shot:
            self._zoomed = tick.shot
            self.zoom_to_hand()

    def zoom_to_hand(self) -> None:
        """Fill the view with the hand, if its anchors were found."""
        tick = self._tick
        if tick is None:
            return
        known = np.isfinite(tick.anchors_px).all(axis=1)
        if not known.any():
            return
        u, v = tick.anchors_px[known].mean(axis=0)
        camera = tick.shot.rig.picture_camera
        answer = tick.answer
        anchors = answer.anchors_m if answer is not None else tick.skin.anchors_m if tick.skin else None
        distance_m = 0.7 if anchors is None else float(np.nanmean(anchors[:, 2]))
        height = self.picture.image_size[1]
        self.picture.center_on(float(u), float(v), max(height * distance_m / (_SPAN_M * camera.fy), 1.0))

    def say(self, text: str) -> None:
        """There is no picture; say why."""
        self._tick = None
        self.picture.show_frame(None)
        self.picture.show_answer(None)
        self.notice.setText(text)
        self.stack.setCurrentWidget(self.notice)

    def set_labelling(self, on: bool) -> None:
        """While training, points are always drawn."""
        self.layers["points"].setEnabled(not on)
        if not on and self._zoomed is not None:
            self._zoomed = None
            self.picture.fit()

    @Slot()
    def _layers_changed(self) -> None:
        self.picture.set_layers(**{key: box.isChecked() for key, box in self.layers.items()})
