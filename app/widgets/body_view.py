"""The patient's body in 3D with numbered lesions.

Public API of `BodyView` (a QWidget; the OpenGL part is built when it is first shown and the libraries are
    loaded)
-------------------------------------------------------------------------------------------------------------
``set_surface(vertices (n,3), triangles (m,3), colors (n,3) uint8 | None)``   metres, depth-camera frame (x
    right, y down,
    z forward); keeps the markers. ``clear()`` removes everything.
``set_lesions(list[BodyLesion])``  numbered markers, drawn 6 mm above the skin; hidden while the body is in
    front of them
``set_selected(id | None)``, ``selected()``    highlight without emitting
``set_placing(bool)``   a click on the skin emits ``placed(x, y, z)`` (metres, depth-camera frame)
``set_view("front" | "back" | "left" | "right")``, ``turn_to(id)`` (look at a lesion from above the skin)
``display_position(id) -> QPoint | None``   where a visible marker is in ``canvas()``, for tests
``canvas() -> QWidget | None``              the OpenGL widget (receives mouse events), None until ``ready``
``close_view()``                            frees the OpenGL resources; called by the view itself when its
    window closes
Signals: ``lesion_clicked(str id)``, ``lesion_activated(str id)``, ``placed(float, float, float)``,
    ``background_clicked()``,
``ready()``.
Mouse: left drag turns, right or middle drag (or Shift) moves, the wheel zooms. `surface_colors` takes
    colours from the photo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PySide6.QtCore import QPoint, QSize, Qt, Signal, Slot
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QPushButton,
    QStackedLayout,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.theme import icon, palette, set_state, style_class
from app.widgets.body_backend import body_backend

if TYPE_CHECKING:
    from app.widgets.body_scene import BodyScene
    from core.capture.rgbd import RgbdCapture

VIEWS = ("front", "back", "left", "right")


@dataclass(frozen=True)
class BodyLesion:
    """A lesion on the body.

    Attributes
    ----------
    id, label, state
        As in `app.widgets.markers.Marker`.
    point_m : tuple of 3 floats
        On the skin, metres, depth-camera frame.
    """

    id: str
    label: str
    point_m: tuple[float, float, float]
    state: str = "marked"


def surface_colors(capture: RgbdCapture, vertices: ArrayLike) -> NDArray[np.uint8] | None:
    """Colour (n, 3) uint8 of surface vertices (n, 3) from the capture's photo; None without a photo."""
    if capture.color is None:
        return None
    pixels = capture.rig.project_to_picture(vertices)
    height, width = capture.color.shape[:2]
    inside = np.isfinite(pixels).all(1)
    u = np.clip(np.round(np.where(inside, pixels[:, 0], 0)), 0, width - 1).astype(int)
    v = np.clip(np.round(np.where(inside, pixels[:, 1], 0)), 0, height - 1).astype(int)
    return np.ascontiguousarray(capture.color[v, u])


class BodyView(QWidget):
    """See the module's documentation."""

    lesion_clicked = Signal(str)
    lesion_activated = Signal(str)
    placed = Signal(float, float, float)
    background_clicked = Signal()
    ready = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._scene: BodyScene | None = None
        self._closed = False
        self._building = False
        self._surface: tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.uint8] | None] | None = None
        self._lesions: list[BodyLesion] = []
        self._selected: str | None = None
        self._placing = False
        self._placeholder = QLabel("Preparing the 3D view")
        self._placeholder.setAlignment(Qt.AlignmentFlag.AlignCenter)
        style_class(self._placeholder, "secondary")
        self._holder = QWidget()
        self._stack = QStackedLayout(self._holder)
        self._stack.setContentsMargins(0, 0, 0, 0)
        self._stack.addWidget(self._placeholder)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(8)
        column.addWidget(self._holder, 1)
        column.addLayout(self._buttons())
        self.setMinimumSize(220, 240)
        body_backend().loaded.connect(self._build)

    def _buttons(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        row.addStretch(1)
        for name in VIEWS:
            button = QPushButton(name.capitalize())
            button.setObjectName(f"body_view_{name}")
            style_class(button, "segment")
            set_state(button, "first", "true" if name == VIEWS[0] else "false")
            set_state(button, "last", "true" if name == VIEWS[-1] else "false")
            button.clicked.connect(lambda _=False, n=name: self.set_view(n))
            row.addWidget(button)
        row.addSpacing(8)
        for name, symbol, tip, factor in (
            ("body_zoom_in", "zoom-in", "Zoom in", 1.25),
            ("body_zoom_out", "zoom-out", "Zoom out", 0.8),
        ):
            tool = QToolButton()
            tool.setObjectName(name)
            tool.setIcon(icon(symbol, palette.SECONDARY))
            tool.setIconSize(QSize(20, 20))
            tool.setToolTip(tip)
            style_class(tool, "icon")
            tool.clicked.connect(lambda _=False, f=factor: self._zoom(f))
            row.addWidget(tool)
        row.addStretch(1)
        return row

    # --- contents -----------------------------------------------------------------------------------------

    def set_surface(
        self, vertices: ArrayLike, triangles: ArrayLike, colors: NDArray[np.uint8] | None = None
    ) -> None:
        """Show a surface: vertices (n, 3) metres, depth-camera frame; triangles (m, 3); colours (n, 3)."""
        self._surface = (np.asarray(vertices, float), np.asarray(triangles, np.int32), colors)
        if self._scene is not None:
            self._scene.set_surface(*self._surface)

    def set_lesions(self, lesions: Sequence[BodyLesion]) -> None:
        """Show exactly these lesions."""
        self._lesions = list(lesions)
        if self._selected not in {lesion.id for lesion in lesions}:
            self._selected = None
        self._show_lesions()

    def lesions(self) -> list[BodyLesion]:
        """The lesions shown."""
        return list(self._lesions)

    def clear(self) -> None:
        """Show nothing."""
        self._surface, self._lesions, self._selected = None, [], None
        if self._scene is not None:
            self._scene.remove_surface()
            self._show_lesions()

    def set_selected(self, lesion_id: str | None) -> None:
        """Highlight a lesion without emitting."""
        known = {lesion.id for lesion in self._lesions}
        self._selected = lesion_id if lesion_id in known else None
        self._show_lesions()

    def selected(self) -> str | None:
        """Id of the highlighted lesion."""
        return self._selected

    def set_placing(self, on: bool) -> None:
        """Whether a click on the skin emits ``placed``."""
        self._placing = on
        if self._scene is not None:
            self._scene.setCursor(Qt.CursorShape.CrossCursor if on else Qt.CursorShape.ArrowCursor)

    def _show_lesions(self) -> None:
        if self._scene is not None:
            self._scene.set_lesions(self._lesions, self._selected)

    # --- view ---------------------------------------------------------------------------------------------

    def set_view(self, name: str) -> None:
        """Look at the whole body from a side, as the patient stands: front, back, left, right."""
        if self._scene is not None:
            self._scene.look_from(name)

    def turn_to(self, lesion_id: str) -> None:
        """Look straight at a lesion."""
        if self._scene is not None:
            self._scene.turn_to(lesion_id)

    def _zoom(self, factor: float) -> None:
        if self._scene is not None:
            self._scene.zoom(factor)

    def canvas(self) -> QWidget | None:
        """The widget that receives the mouse, once the view is ready."""
        return self._scene

    def display_position(self, lesion_id: str) -> QPoint | None:
        """Where a visible marker is in `canvas`; None if it is hidden or unknown."""
        return self._scene.marker_position(lesion_id) if self._scene is not None else None

    # --- life ---------------------------------------------------------------------------------------------

    @Slot()
    def _build(self) -> None:
        if self._closed or self._building or self._scene is not None:
            return
        if not body_backend().ready or not self.isVisible():
            return
        from app.widgets.body_scene import BodyScene

        self._building = True  # a first OpenGL child makes Qt show the window anew, and this view with it
        scene = BodyScene()
        scene.setObjectName("body_canvas")
        scene.lesion_clicked.connect(self._on_clicked)
        scene.lesion_activated.connect(self.lesion_activated)
        scene.skin_clicked.connect(self._on_skin)
        scene.background_clicked.connect(self.background_clicked)
        self._stack.addWidget(scene)
        self._stack.setCurrentWidget(scene)
        self._scene = scene
        self._building = False
        self.set_placing(self._placing)
        if self._surface is not None:
            scene.set_surface(*self._surface)
        self._show_lesions()
        self.ready.emit()

    @Slot(str)
    def _on_clicked(self, lesion_id: str) -> None:
        self.set_selected(lesion_id)
        self.lesion_clicked.emit(lesion_id)

    @Slot(float, float, float)
    def _on_skin(self, x: float, y: float, z: float) -> None:
        if self._placing:
            self.placed.emit(x, y, z)
        else:
            self.background_clicked.emit()

    def showEvent(self, event: QShowEvent) -> None:  # noqa: D102
        super().showEvent(event)
        if body_backend().ready:
            self._build()
        else:
            body_backend().load()

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: D102
        super().hideEvent(event)
        if self.window().isHidden() and self.window().testAttribute(Qt.WidgetAttribute.WA_DeleteOnClose):
            self.close_view()

    def close_view(self) -> None:
        """Free the OpenGL resources. The view stays blank afterwards; calling twice is harmless."""
        self._closed = True
        if self._scene is not None:
            scene, self._scene = self._scene, None
            scene.close_scene()
            self._stack.removeWidget(scene)
            scene.deleteLater()
