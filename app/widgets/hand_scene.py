"""The OpenGL part of the hand's 3D view. Importing this module needs the 3D libraries (`BodyBackend`)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PySide6.QtWidgets import QWidget
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from app.widgets.body_scene import BodyScene
from app.widgets.hand_colors import point_color
from app.widgets.hand_mesh import HandMesh
from core.hand.names import BONES

_FIRST_DISTANCE_M = 0.62
_START = np.array([0.25, -0.3, -1.0])
_POINT_PX, _ANCHOR_PX = 11.0, 7.0
_SURE = 0.5
_ANCHOR_RGB = (63, 190, 200)
_LIFT = 0.004


class _Layer:
    """One kind of thing that is drawn: made once, given other data for every frame."""

    def __init__(self, scene: HandScene, *, on_points: bool = True, light: float = 0.0) -> None:
        self._mapper: Any = vtkPolyDataMapper()
        self._mapper.SetColorModeToDirectScalars()
        if on_points:
            self._mapper.SetScalarModeToUsePointData()
        else:
            self._mapper.SetScalarModeToUseCellData()
        self._on_points = on_points
        self.actor: Any = vtkActor()
        self.actor.SetMapper(self._mapper)
        self.actor.PickableOff()
        look = self.actor.GetProperty()
        look.SetAmbient(1.0 - light)
        look.SetDiffuse(light)
        look.SetSpecular(0.0)
        look.SetInterpolationToGouraud()
        self.actor.VisibilityOff()
        scene.renderer.AddActor(self.actor)

    def show(self, mesh: pv.PolyData | None, colors: NDArray[np.uint8] | None = None) -> None:
        """Draw a mesh, or nothing."""
        self.actor.SetVisibility(mesh is not None)
        if mesh is None:
            return
        data = mesh.point_data if self._on_points else mesh.cell_data
        data["rgb"] = colors
        data.active_scalars_name = "rgb"
        self._mapper.SetInputData(mesh)


class HandScene(BodyScene):
    """Skin, points and bones of one hand; mouse and keys are those of the body's scene."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._hand_skin = _Layer(self, light=0.45)
        self._hand_bones = _Layer(self, on_points=False)
        self._hand_points = _Layer(self)
        self._hand_doubtful = _Layer(self)
        self._hand_anchors = _Layer(self)
        self._hand_bones.actor.GetProperty().SetLineWidth(4.0)
        for layer, size in (
            (self._hand_points, _POINT_PX),
            (self._hand_doubtful, 0.7 * _POINT_PX),
            (self._hand_anchors, _ANCHOR_PX),
        ):
            layer.actor.GetProperty().SetPointSize(size * self._ratio)
            if layer is not self._hand_anchors:
                layer.actor.GetProperty().SetRenderPointsAsSpheres(True)
        self._bare = True
        self.renders = 0

    def show_hand(self, mesh: HandMesh | None, *, skin: bool, points: bool) -> None:
        """Draw another frame; the eye keeps its direction and follows the hand."""
        if mesh is None or not (len(mesh.vertices) or np.isfinite(mesh.points_m).any()):
            for layer in self._all_layers():
                layer.show(None)
            self.update()
            return
        self._show_skin(mesh if skin else None)
        self._show_bones(mesh if points else None)
        self._show_points(mesh if points else None)
        known = mesh.vertices if len(mesh.vertices) else mesh.points_m[np.isfinite(mesh.points_m[:, 0])]
        anchors = mesh.anchors_m[np.isfinite(mesh.anchors_m).all(axis=1)]
        middle = anchors if len(anchors) else known
        self._center = np.asarray(middle, float).mean(axis=0)
        if self._bare:
            self._bare = False
            self.look_again()
        else:
            moved = self._center - np.array(self.camera.focal_point)
            self.camera.position = tuple(np.array(self.camera.position) + moved)
            self.camera.focal_point = tuple(self._center)
            self._camera_moved()

    def _all_layers(self) -> tuple[_Layer, ...]:
        return (
            self._hand_skin,
            self._hand_bones,
            self._hand_points,
            self._hand_doubtful,
            self._hand_anchors,
        )

    def look_again(self) -> None:
        """From the camera's side, a little from above, the whole hand."""
        self._look(self._center, _START / np.linalg.norm(_START), _FIRST_DISTANCE_M)

    def _show_skin(self, mesh: HandMesh | None) -> None:
        if mesh is None or not len(mesh.triangles):
            self._hand_skin.show(None)
            return
        skin = pv.PolyData(mesh.vertices, mesh.faces)
        skin.point_data.active_normals = mesh.normals
        self._hand_skin.show(skin, mesh.colors)

    def _show_bones(self, mesh: HandMesh | None) -> None:
        told = np.zeros(15, bool) if mesh is None else np.isfinite(mesh.points_m[:, 0])
        bones = [(a, b) for a, b in BONES if told[a] and told[b]]
        if mesh is None or not bones:
            self._hand_bones.show(None)
            return
        places = np.array([mesh.points_m[k] for bone in bones for k in bone])
        count = np.arange(len(bones))
        lines = np.column_stack([np.full(len(bones), 2), 2 * count, 2 * count + 1])
        self._hand_bones.show(
            pv.PolyData(places, lines=lines.ravel()), np.array([_rgb(a) for a, _ in bones], np.uint8)
        )

    def _show_points(self, mesh: HandMesh | None) -> None:
        if mesh is None:
            for layer in (self._hand_points, self._hand_doubtful, self._hand_anchors):
                layer.show(None)
            return
        told = np.isfinite(mesh.points_m[:, 0])
        for layer, chosen, paler in (
            (self._hand_points, told & (mesh.confidence >= _SURE), 0.0),
            (self._hand_doubtful, told & (mesh.confidence < _SURE), 0.5),
        ):
            which = [int(k) for k in np.flatnonzero(chosen)]
            colors = np.array([_rgb(k) for k in which], float).reshape(-1, 3)
            shown = (colors + paler * (255.0 - colors)).astype(np.uint8)
            layer.show(pv.PolyData(mesh.points_m[which]) if which else None, shown)
        anchors = mesh.anchors_m[np.isfinite(mesh.anchors_m).all(axis=1)]
        if not len(anchors):
            self._hand_anchors.show(None)
            return
        lifted = anchors * (1.0 - _LIFT / np.linalg.norm(anchors, axis=1, keepdims=True))
        colors = np.tile(np.array(_ANCHOR_RGB, np.uint8), (len(anchors), 1))
        self._hand_anchors.show(pv.PolyData(lifted), colors)

    def paintGL(self) -> None:
        """Count what is drawn; see `BodyScene` for the rest."""
        self.renders += 1
        super().paintGL()  # type: ignore[no-untyped-call]

    def close_scene(self) -> None:
        """Free everything of VTK, once."""
        if not getattr(self, "_closed", False):
            for layer in self._all_layers():
                self.renderer.RemoveActor(layer.actor)
        super().close_scene()


def _rgb(point: int) -> tuple[int, int, int]:
    color = point_color(point)
    return color.red(), color.green(), color.blue()
