"""Pictures shown in a visit: the photo, the depth as relief, the joints drawn over it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPen

from app.theme import palette
from app.widgets.images import to_qimage

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.records import CaptureRecord, ClinicStore

_NEAR_M, _FAR_M = 0.6, 4.0
_USUAL_UNIT_M = 0.001


def depth_picture(depth_m: NDArray[np.float32] | NDArray[np.float64]) -> NDArray[np.uint8]:
    """A quiet grey picture (h, w, 3) of a depth image: near is light, unmeasured is dark."""
    depth = np.asarray(depth_m, dtype=float)
    near = np.clip((_FAR_M - depth) / (_FAR_M - _NEAR_M), 0.0, 1.0)
    grey = np.where(depth > 0, 40 + 200 * near, 20).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def capture_picture(analysed: AnalysedCapture) -> NDArray[np.uint8]:
    """The picture lesions are marked on: the photo, or a relief of the depth."""
    if analysed.capture.color is not None:
        return analysed.capture.color
    from core.anchors import shade_depth

    scan = analysed.scan
    return shade_depth(scan.fused.depth_m, scan.mask.mask, analysed.capture.rig.depth)


def stored_picture(store: ClinicStore, record: CaptureRecord) -> QImage:
    """The picture of a stored capture without analysing it: the photo, else the first depth frame."""
    photo = store.captures.color_picture(record.id)
    if photo is not None:
        return to_qimage(photo)
    return to_qimage(depth_picture(store.captures.depth_picture(record.id) * _USUAL_UNIT_M))


def joints_picture(analysed: AnalysedCapture) -> QImage:
    """The picture with the found joints and bones; a joint that is only guessed is drawn amber and hollow."""
    from core.anchors import BONES, VISIBLE

    image = to_qimage(capture_picture(analysed)).convertToFormat(QImage.Format.Format_RGB32)
    unit = max(image.width(), image.height()) / 640.0
    joints = analysed.skeleton.joints
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    for a, b in BONES:
        if a in joints and b in joints and min(joints[a].visibility, joints[b].visibility) >= VISIBLE:
            ends = QPointF(*joints[a].pixel), QPointF(*joints[b].pixel)
            painter.setPen(_pen("#FFFFFF", 3.4 * unit, 170))
            painter.drawLine(*ends)
            painter.setPen(_pen(palette.ACCENT, 1.8 * unit))
            painter.drawLine(*ends)
    for joint in joints.values():
        seen = joint.visibility >= VISIBLE
        color = palette.ACCENT if seen else palette.AMBER
        painter.setPen(_pen("#FFFFFF" if seen else color, 1.2 * unit))
        painter.setBrush(QColor(color) if seen else Qt.BrushStyle.NoBrush)
        painter.drawEllipse(QPointF(*joint.pixel), 3.2 * unit, 3.2 * unit)
    painter.end()
    return image


def _pen(color: str, width: float, alpha: int = 255) -> QPen:
    value = QColor(color)
    value.setAlpha(alpha)
    return QPen(value, width, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap)
