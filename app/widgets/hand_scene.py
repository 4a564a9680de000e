"""The OpenGL part of the hand's 3D view. Importing this module needs the 3D libraries (`BodyBackend`)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from PySide6.QtWidgets import QWidget

from app.widgets.body_scene import BodyScene
from app.widgets.hand_colors import point_color
from app.widgets.hand_mesh import HandMesh
from core.hand.names import BONES

_FIRST_DISTANCE_M = 0.52
_START = np.array([0.25, -0.3, -1.0])
_POINT_PX, _ANCHOR_PX = 11.0, 7.0
_SURE = 0.5


class HandScene(BodyScene):
    """Skin, points and bones of one hand; mouse and keys are those of the body's scene."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._actors: list[Any] = []
        self._bare = True
        self.renders = 0

    def show_hand(self, mesh: HandMesh | None, *, skin: bool, points: bool) -> None:
        """Draw another frame; the eye keeps its direction and follows the hand."""
        for actor in self._actors:
            self.remove_actor(actor, render=False)
        self._actors = []
        if mesh is None or not (len(mesh.vertices) or np.isfinite(mesh.points_m).any()):
            self.update()
            return
        if skin and len(mesh.triangles):
            self._add_skin(mesh)
        if points:
            self._add_bones(mesh)
            self._add_points(mesh)
        known = mesh.vertices if len(mesh.vertices) else mesh.points_m[np.isfinite(mesh.points_m[:, 0])]
        self._center = np.median(np.asarray(known, float), axis=0)
        if self._bare:
            self._bare = False
            self.look_again()
        else:
            moved = self._center - np.array(self.camera.focal_point)
            self.camera.position = tuple(np.array(self.camera.position) + moved)
            self.camera.focal_point = tuple(self._center)
            self._camera_moved()

    def look_again(self) -> None:
        """From the camera's side, a little from above, the whole hand."""
        self._look(self._center, _START / np.linalg.norm(_START), _FIRST_DISTANCE_M)

    def _add_skin(self, mesh: HandMesh) -> None:
        faces = np.column_stack([np.full(len(mesh.triangles), 3, np.int64), mesh.triangles]).ravel()
        skin = pv.PolyData(mesh.vertices, faces)
        skin["rgb"] = mesh.colors
        skin.point_data["Normals"] = mesh.normals
        self._actors.append(self._add(skin, photo=True))

    def _add_bones(self, mesh: HandMesh) -> None:
        told = np.isfinite(mesh.points_m[:, 0])
        bones = [(a, b) for a, b in BONES if told[a] and told[b]]
        if not bones:
            return
        places = np.array([mesh.points_m[k] for bone in bones for k in bone])
        lines = np.column_stack(
            [np.full(len(bones), 2), 2 * np.arange(len(bones)), 2 * np.arange(len(bones)) + 1]
        )
        drawn = pv.PolyData(places, lines=lines.ravel())
        drawn.cell_data["rgb"] = np.array([_rgb(a) for a, _ in bones], np.uint8)
        self._actors.append(self._flat(drawn, line_width=4.0))

    def _add_points(self, mesh: HandMesh) -> None:
        told = np.flatnonzero(np.isfinite(mesh.points_m[:, 0]))
        for sure in (True, False):
            chosen = [k for k in told if (mesh.confidence[k] >= _SURE) == sure]
            if not chosen:
                continue
            cloud = pv.PolyData(mesh.points_m[chosen])
            paler = 0 if sure else 1
            cloud["rgb"] = np.array(
                [(np.array(_rgb(k)) * (2 - paler) + 255 * paler) / 2 for k in chosen]
            ).astype(np.uint8)
            size = _POINT_PX if sure else 0.7 * _POINT_PX
            self._actors.append(self._flat(cloud, point_size=size, render_points_as_spheres=True))
        anchors = mesh.anchors_m[np.isfinite(mesh.anchors_m).all(axis=1)]
        if len(anchors):
            cloud = pv.PolyData(anchors * (1.0 - 0.003 / np.linalg.norm(anchors, axis=1, keepdims=True)))
            cloud["rgb"] = np.tile(np.array((63, 190, 200), np.uint8), (len(anchors), 1))
            self._actors.append(self._flat(cloud, point_size=_ANCHOR_PX, render_points_as_spheres=False))

    def _flat(self, mesh: pv.PolyData, **how: Any) -> Any:
        return self.add_mesh(
            mesh,
            scalars="rgb",
            rgb=True,
            lighting=bool(how.get("render_points_as_spheres")),
            show_scalar_bar=False,
            reset_camera=False,
            render=False,
            pickable=False,
            **how,
        )

    def paintGL(self) -> None:
        """Count what is drawn; see `BodyScene` for the rest."""
        self.renders += 1
        super().paintGL()

    def close_scene(self) -> None:
        """Free everything of VTK, once."""
        if not getattr(self, "_closed", False):
            for actor in self._actors:
                self.remove_actor(actor, render=False)
            self._actors = []
        super().close_scene()


def _rgb(point: int) -> tuple[int, int, int]:
    color = point_color(point)
    return color.red(), color.green(), color.blue()
