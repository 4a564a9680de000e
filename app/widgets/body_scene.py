"""The OpenGL part of the body view: one render per painted frame, a light mesh while it turns.

Importing this module loads VTK (seconds): only `app.widgets.body_backend` and `BodyView` do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PySide6.QtCore import QPoint, QPointF, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QKeyEvent, QMouseEvent, QResizeEvent, QWheelEvent
from PySide6.QtWidgets import QApplication, QWidget
from pyvistaqt import QtInteractor
from vtkmodules.vtkCommonCore import mutable
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkStaticCellLocator
from vtkmodules.vtkFiltersCore import vtkQuadricDecimation

from app.theme import palette
from app.widgets.body_markers import MarkerActors

if TYPE_CHECKING:
    from app.widgets.body_view import BodyLesion

FloatArray = NDArray[np.float64]

LIFT_M = 0.006
"""How far above the skin a marker is anchored, so that the skin's own noise does not hide it."""

_LIGHT_TRIANGLES = 20_000
_SKIN = (214, 196, 184)
_VIEW_ANGLE_DEG = 28.0
_DIRECTIONS = {
    "front": (0.0, 0.0, -1.0),
    "back": (0.0, 0.0, 1.0),
    "left": (1.0, 0.0, 0.0),
    "right": (-1.0, 0.0, 0.0),
}
"""From the body to the eye, in the depth-camera frame (y down, z away): the patient's own left is at +x."""


class BodyScene(QtInteractor):
    """The canvas of a `BodyView`; it knows nothing of lesions but where they are."""

    lesion_clicked = Signal(str)
    lesion_activated = Signal(str)
    skin_clicked = Signal(float, float, float)
    background_clicked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, auto_update=False, multi_samples=0)
        self.set_background(palette.BACKGROUND)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.NoContextMenu)
        self._full: Any = None
        self._light: Any = None
        self._locator: vtkStaticCellLocator | None = None
        self._vertices: FloatArray = np.zeros((0, 3))
        self._normals: FloatArray = np.zeros((0, 3))
        self._center = np.zeros(3)
        self._markers = MarkerActors(self.renderer)
        self._lesions: list[BodyLesion] = []
        self._press: QPointF | None = None
        self._last = QPointF()
        self._dragging = False
        self._calm = QTimer(self, singleShot=True, interval=180)
        self._calm.timeout.connect(self._show_full)
        self.camera.view_angle = _VIEW_ANGLE_DEG

    # --- contents -----------------------------------------------------------------------------------------

    def set_surface(
        self, vertices: FloatArray, triangles: NDArray[np.int32], colors: NDArray[np.uint8] | None
    ) -> None:
        """Replace the body; the camera looks at its front."""
        self.remove_surface()
        if not len(vertices) or not len(triangles):
            return
        faces = np.column_stack([np.full(len(triangles), 3, np.int64), triangles]).ravel()
        mesh = pv.PolyData(np.ascontiguousarray(vertices), faces)
        mesh["rgb"] = colors if colors is not None else np.tile(np.array(_SKIN, np.uint8), (len(vertices), 1))
        mesh = mesh.compute_normals(
            cell_normals=False, split_vertices=False, consistent_normals=False, auto_orient_normals=False
        )
        self._vertices = vertices
        self._normals = self._outward(mesh)
        mesh.point_data["Normals"] = self._normals.astype(np.float32)
        self._full = self._add(mesh, photo=colors is not None)
        light = _decimated(mesh, vertices)
        self._light = self._add(light, photo=colors is not None) if light is not None else None
        if self._light is not None:
            self._light.SetVisibility(False)
        self._locator = vtkStaticCellLocator()
        self._locator.SetDataSet(light if light is not None else mesh)
        self._locator.BuildLocator()
        low, high = vertices.min(0), vertices.max(0)
        self._center = (low + high) / 2
        self.look_from("front")

    def _outward(self, mesh: pv.PolyData) -> FloatArray:
        """Normals away from the body: toward the camera, or out of a closed mesh."""
        normals = np.asarray(mesh.point_data["Normals"], float)
        along_ray = float(np.median(np.einsum("ij,ij->i", normals, self._vertices)))
        if mesh.n_open_edges == 0:
            middle = self._vertices.mean(0)
            along_ray = -float(np.median(np.einsum("ij,ij->i", normals, self._vertices - middle)))
        return -normals if along_ray > 0 else normals

    def _add(self, mesh: pv.PolyData, *, photo: bool) -> Any:
        actor = self.add_mesh(
            mesh,
            scalars="rgb",
            rgb=True,
            smooth_shading=True,
            split_sharp_edges=False,
            show_scalar_bar=False,
            reset_camera=False,
            render=False,
            pickable=False,
            ambient=0.62 if photo else 0.35,
            diffuse=0.45 if photo else 0.75,
            specular=0.0,
        )
        actor.prop.interpolation = "phong" if not photo else "gouraud"
        return actor

    def remove_surface(self) -> None:
        """Show no body."""
        for actor in (self._full, self._light):
            if actor is not None:
                self.remove_actor(actor, render=False)
        self._full = self._light = self._locator = None
        self._vertices = self._normals = np.zeros((0, 3))
        self.update()

    def set_lesions(self, lesions: Sequence[BodyLesion], selected: str | None) -> None:
        """Replace the markers."""
        self._lesions = list(lesions)
        self._markers.show(self._lesions, selected, [self._lifted(x.point_m) for x in lesions], self._ratio)
        self._place_markers()
        self.update()

    @property
    def _ratio(self) -> float:
        return float(self.devicePixelRatioF())

    def _normal_at(self, point: FloatArray) -> FloatArray:
        if not len(self._vertices):
            return np.array([0.0, 0.0, -1.0])
        nearest = int(np.argmin(((self._vertices - point) ** 2).sum(1)))
        n = self._normals[nearest]
        length = float(np.linalg.norm(n))
        return n / length if length > 0 else np.array([0.0, 0.0, -1.0])

    def _lifted(self, point: Sequence[float]) -> FloatArray:
        p = np.asarray(point, float)
        return np.asarray(p + LIFT_M * self._normal_at(p))

    # --- camera -------------------------------------------------------------------------------------------

    def look_from(self, name: str) -> None:
        """The whole body from one side."""
        self._look(self._center, np.array(_DIRECTIONS[name]), self._fit_distance(np.array(_DIRECTIONS[name])))

    def turn_to(self, lesion_id: str) -> None:
        """Look at a lesion along its normal, kept level enough to stay upright."""
        for lesion in self._lesions:
            if lesion.id == lesion_id:
                point = np.asarray(lesion.point_m, float)
                direction = self._normal_at(point)
                direction[1] = np.clip(direction[1], -0.6, 0.6)
                direction /= np.linalg.norm(direction)
                self._look(point, direction, 0.45 * self._fit_distance(direction))

    def _fit_distance(self, direction: FloatArray) -> float:
        if not len(self._vertices):
            return 3.0
        half = (self._vertices.max(0) - self._vertices.min(0)) / 2
        side = np.cross(direction, [0.0, -1.0, 0.0])
        tan = math.tan(math.radians(_VIEW_ANGLE_DEG / 2))
        aspect = max(self.width(), 1) / max(self.height(), 1)
        need = max(half[1], float(np.abs(side) @ half) / aspect)
        return float(1.06 * need / tan + np.abs(direction) @ half)

    def _look(self, focus: FloatArray, direction: FloatArray, distance: float) -> None:
        self.camera.focal_point = tuple(focus)
        self.camera.position = tuple(focus + direction * distance)
        self.camera.up = (0.0, -1.0, 0.0)
        self._camera_moved()

    def _camera_moved(self) -> None:
        self.renderer.ResetCameraClippingRange()
        self._place_markers()
        self.update()

    def zoom(self, factor: float) -> None:
        """Move toward the point looked at."""
        focus, eye = np.array(self.camera.focal_point), np.array(self.camera.position)
        distance = float(np.clip(np.linalg.norm(eye - focus) / factor, 0.15, 12.0))
        direction = (eye - focus) / np.linalg.norm(eye - focus)
        self._look(focus, direction, distance)

    def _turn(self, dx: float, dy: float) -> None:
        focus, eye = np.array(self.camera.focal_point), np.array(self.camera.position)
        offset = eye - focus
        distance = float(np.linalg.norm(offset))
        azimuth = math.atan2(offset[0], -offset[2]) - dx * 0.008
        elevation = math.asin(float(np.clip(-offset[1] / distance, -1, 1))) + dy * 0.008
        elevation = float(np.clip(elevation, -1.35, 1.35))
        direction = np.array(
            [
                math.cos(elevation) * math.sin(azimuth),
                -math.sin(elevation),
                -math.cos(elevation) * math.cos(azimuth),
            ]
        )
        self._look(focus, direction, distance)

    def _pan(self, dx: float, dy: float) -> None:
        focus, eye = np.array(self.camera.focal_point), np.array(self.camera.position)
        forward = focus - eye
        distance = float(np.linalg.norm(forward))
        right = np.cross(forward / distance, [0.0, -1.0, 0.0])
        right /= np.linalg.norm(right)
        up = np.cross(right, forward / distance)
        metres = 2 * distance * math.tan(math.radians(_VIEW_ANGLE_DEG / 2)) / max(self.height(), 1)
        self._look(focus + (-dx * right + dy * up) * metres, -forward / distance, distance)

    # --- markers and picking ------------------------------------------------------------------------------

    def _display(self, point: FloatArray) -> QPointF:
        renderer = self.renderer
        renderer.SetWorldPoint(*point, 1.0)
        renderer.WorldToDisplay()
        x, y, _ = renderer.GetDisplayPoint()
        return QPointF(x / self._ratio, self.height() - y / self._ratio)

    def _hidden(self, point: FloatArray) -> bool:
        if self._locator is None:
            return False
        eye = np.array(self.camera.position)
        end = point + (eye - point) * 1e-3
        return bool(
            self._locator.IntersectWithLine(
                eye, end, 1e-6, mutable(0.0), [0.0] * 3, [0.0] * 3, mutable(0), mutable(0)
            )
        )

    def _place_markers(self) -> None:
        self._markers.set_visible(
            [not self._hidden(anchor + 0.006 * self._toward_eye(anchor)) for anchor in self._markers.anchors]
        )

    def _toward_eye(self, point: FloatArray) -> FloatArray:
        v = np.array(self.camera.position) - point
        return np.asarray(v / max(float(np.linalg.norm(v)), 1e-9))

    def marker_position(self, lesion_id: str) -> QPoint | None:
        """Where a visible marker is in this widget."""
        for lesion, anchor, visible in zip(
            self._lesions, self._markers.anchors, self._markers.visible, strict=True
        ):
            if lesion.id == lesion_id and visible:
                return self._display(anchor).toPoint()
        return None

    def _lesion_at(self, position: QPointF) -> str | None:
        best: tuple[float, str] | None = None
        for lesion, anchor, visible in zip(
            self._lesions, self._markers.anchors, self._markers.visible, strict=True
        ):
            if not visible:
                continue
            offset = position - self._display(anchor)
            distance = min(math.hypot(offset.x(), offset.y()), math.hypot(offset.x() - 17, offset.y() + 17))
            if distance <= 17 and (best is None or distance < best[0]):
                best = (distance, lesion.id)
        return best[1] if best else None

    def _skin_at(self, position: QPointF) -> FloatArray | None:
        if self._locator is None:
            return None
        renderer = self.renderer
        ends = []
        for depth in (0.0, 1.0):
            renderer.SetDisplayPoint(
                position.x() * self._ratio, (self.height() - position.y()) * self._ratio, depth
            )
            renderer.DisplayToWorld()
            world = np.array(renderer.GetWorldPoint())
            ends.append(world[:3] / world[3])
        hit = [0.0] * 3
        found = self._locator.IntersectWithLine(
            ends[0], ends[1], 1e-6, mutable(0.0), hit, [0.0] * 3, mutable(0), mutable(0)
        )
        return np.array(hit) if found else None

    # --- mouse --------------------------------------------------------------------------------------------

    def render(self) -> None:
        """Schedule one paint instead of drawing now."""
        if not getattr(self, "_closed", True):
            self._rendered = True
            self.update()

    @Slot()
    def _show_full(self) -> None:
        self._use_light(False)

    def _use_light(self, light: bool) -> None:
        if self._light is not None and self._full is not None:
            self._light.SetVisibility(light)
            self._full.SetVisibility(not light)
            self.update()

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        self._press = self._last = event.position()
        self._dragging = False
        self.setFocus()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        position = event.position()
        if self._press is None:
            over = self._lesion_at(position) is not None
            if over != (self.cursor().shape() == Qt.CursorShape.PointingHandCursor):
                self.setCursor(Qt.CursorShape.PointingHandCursor if over else Qt.CursorShape.ArrowCursor)
            return
        if not self._dragging:
            if (position - self._press).manhattanLength() < QApplication.startDragDistance() / 2:
                return
            self._dragging = True
            self._use_light(True)
        delta, self._last = position - self._last, position
        shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        if event.buttons() & Qt.MouseButton.LeftButton and not shift:
            self._turn(delta.x(), delta.y())
        else:
            self._pan(delta.x(), delta.y())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        clicked = self._press is not None and not self._dragging
        self._press = None
        if self._dragging:
            self._dragging = False
            self._use_light(False)
        elif clicked and event.button() == Qt.MouseButton.LeftButton:
            self._click(event.position())

    def _click(self, position: QPointF) -> None:
        lesion_id = self._lesion_at(position)
        if lesion_id is not None:
            self.lesion_clicked.emit(lesion_id)
            return
        skin = self._skin_at(position)
        if skin is not None:
            self.skin_clicked.emit(*(float(v) for v in skin))
        else:
            self.background_clicked.emit()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        lesion_id = self._lesion_at(event.position())
        if lesion_id is not None:
            self.lesion_activated.emit(lesion_id)

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: D102
        self._use_light(True)
        self._calm.start()
        self.zoom(1.15 ** (event.angleDelta().y() / 120.0))
        event.accept()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102
        turns = {
            Qt.Key.Key_Left: (30, 0),
            Qt.Key.Key_Right: (-30, 0),
            Qt.Key.Key_Up: (0, 20),
            Qt.Key.Key_Down: (0, -20),
        }
        if event.key() in turns:
            self._turn(*turns[Qt.Key(event.key())])
        elif event.key() in (Qt.Key.Key_Plus, Qt.Key.Key_Equal):
            self.zoom(1.2)
        elif event.key() == Qt.Key.Key_Minus:
            self.zoom(1 / 1.2)
        else:
            event.ignore()

    def keyReleaseEvent(self, event: QKeyEvent) -> None:  # noqa: D102
        event.ignore()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102
        super().resizeEvent(event)
        self._place_markers()

    def close_scene(self) -> None:
        """Free everything of VTK, once."""
        if getattr(self, "_closed", False):
            return
        self._calm.stop()
        self._markers.clear()
        self.remove_surface()
        self.close()


def _decimated(mesh: pv.PolyData, vertices: FloatArray) -> pv.PolyData | None:
    """A mesh light enough to follow the mouse on software OpenGL; None if ``mesh`` already is."""
    if mesh.n_cells <= 1.5 * _LIGHT_TRIANGLES:
        return None
    bare = vtkPolyData()
    bare.CopyStructure(mesh)
    reduce = vtkQuadricDecimation()
    reduce.SetInputData(bare)
    reduce.SetTargetReduction(1 - _LIGHT_TRIANGLES / mesh.n_cells)
    reduce.Update()
    light = pv.wrap(reduce.GetOutput())
    from scipy.spatial import cKDTree

    nearest = cKDTree(vertices).query(light.points)[1]
    light["rgb"] = np.asarray(mesh["rgb"])[nearest]
    light.point_data["Normals"] = np.asarray(mesh.point_data["Normals"])[nearest]
    return light
