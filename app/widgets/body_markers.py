"""Lesion markers in the 3D view: the same ring and badge as on the photo, always facing the eye."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QImage
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkImageData, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkPolyDataMapper2D, vtkTexture, vtkTexturedActor2D

from app.widgets.markers import MARKER_REACH, marker_image

if TYPE_CHECKING:
    from app.widgets.body_view import BodyLesion


class MarkerActors:
    """The marker actors of one renderer."""

    def __init__(self, renderer: Any) -> None:
        self._renderer = renderer
        self._actors: list[vtkTexturedActor2D] = []
        self.anchors: list[NDArray[np.float64]] = []
        self.visible: list[bool] = []

    def clear(self) -> None:
        """Remove every marker."""
        for actor in self._actors:
            self._renderer.RemoveViewProp(actor)
        self._actors, self.anchors, self.visible = [], [], []

    def show(
        self,
        lesions: Sequence[BodyLesion],
        selected: str | None,
        anchors: Sequence[NDArray[np.float64]],
        ratio: float,
    ) -> None:
        """Replace the markers; the selected one is drawn last, above the others."""
        self.clear()
        self.anchors = list(anchors)
        self.visible = [True] * len(lesions)
        for lesion, anchor in zip(lesions, anchors, strict=True):
            image = marker_image(lesion.label, lesion.state, selected=lesion.id == selected, ratio=ratio)
            self._actors.append(_actor(image, anchor))
        order = sorted(range(len(lesions)), key=lambda i: lesions[i].id == selected)
        for layer, index in enumerate(order):
            self._actors[index].SetLayerNumber(layer)
            self._renderer.AddViewProp(self._actors[index])

    def set_visible(self, visible: Sequence[bool]) -> None:
        """Hide the markers that the body is in front of."""
        self.visible = list(visible)
        for actor, on in zip(self._actors, visible, strict=True):
            actor.SetVisibility(on)


def _texture(image: QImage) -> vtkTexture:
    width, height = image.width(), image.height()
    pixels = np.frombuffer(image.constBits(), np.uint8).reshape(height, image.bytesPerLine())[:, : 4 * width]
    flipped = np.ascontiguousarray(pixels.reshape(height, width, 4)[::-1])
    data = vtkImageData()
    data.SetDimensions(width, height, 1)
    data.GetPointData().SetScalars(numpy_to_vtk(flipped.reshape(-1, 4), deep=True))
    texture = vtkTexture()
    texture.SetInputData(data)
    texture.SetColorModeToDirectScalars()
    return texture


def _actor(image: QImage, anchor: NDArray[np.float64]) -> vtkTexturedActor2D:
    half_w, half_h = image.width() / 2, image.height() / 2
    points, polys, coordinates = vtkPoints(), vtkCellArray(), vtkFloatArray()
    coordinates.SetNumberOfComponents(2)
    for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        points.InsertNextPoint(x * half_w, y * half_h, 0)
        coordinates.InsertNextTuple2((x + 1) / 2, (y + 1) / 2)
    polys.InsertNextCell(4, (0, 1, 2, 3))
    quad = vtkPolyData()
    quad.SetPoints(points)
    quad.SetPolys(polys)
    quad.GetPointData().SetTCoords(coordinates)
    mapper = vtkPolyDataMapper2D()
    mapper.SetInputData(quad)
    actor = vtkTexturedActor2D()
    actor.SetMapper(mapper)
    actor.SetTexture(_texture(image))
    place = actor.GetPositionCoordinate()
    place.SetCoordinateSystemToWorld()
    place.SetValue(*(float(v) for v in anchor))
    actor.PickableOff()
    return actor


__all__ = ["MARKER_REACH", "MarkerActors"]
