"""The hand in 3D: skin, points, bones; turns with the mouse and follows the hand.

Public API of `HandView` (the OpenGL part is built when it is first shown and the libraries are loaded)
-------------------------------------------------------------------------------------------------------
``show_hand(HandMesh | None)``   another frame; drawn at most `MOST_PER_S` times a second, the newest wins
``set_layers(skin=, points=)``   what is drawn
``look_again()``, ``zoom(factor)``
``canvas() -> QWidget | None``   the OpenGL widget, None until ``ready``
``close_view()``                 frees the OpenGL resources
Signal: ``ready()``. Mouse: left drag turns, right or middle drag moves, the wheel zooms; arrows, + and -.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final

from PySide6.QtCore import Qt, QTimer, Signal, Slot
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QLabel, QStackedLayout, QWidget

from app.theme import style_class
from app.widgets.body_backend import body_backend
from app.widgets.hand_mesh import HandMesh

if TYPE_CHECKING:
    from app.widgets.hand_scene import HandScene

MOST_PER_S: Final = 8.0


class HandView(QWidget):
    """See the module's documentation."""

    ready = Signal()

    def __init__(self, object_name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(object_name)
        self.setAccessibleName("The hand in 3D")
        self._scene: HandScene | None = None
        self._closed = self._building = False
        self._mesh: HandMesh | None = None
        self._layers = {"skin": True, "points": True}
        self._drawn_s = 0.0
        waiting = QLabel("Preparing the 3D view")
        waiting.setAlignment(Qt.AlignmentFlag.AlignCenter)
        style_class(waiting, "secondary")
        self._stack = QStackedLayout(self)
        self._stack.setContentsMargins(0, 0, 0, 0)
        self._stack.addWidget(waiting)
        self._later = QTimer(self, singleShot=True)
        self._later.timeout.connect(self._draw)
        self.setMinimumSize(200, 140)
        body_backend().loaded.connect(self._build)

    # --- contents ----------------------------------------------------------------------------------------

    def show_hand(self, mesh: HandMesh | None) -> None:
        """Another frame."""
        self._mesh = mesh
        if self._scene is None or self._later.isActive():
            return
        spare_s = self._drawn_s + 1.0 / MOST_PER_S - time.monotonic()
        self._later.start(max(0, round(1000 * spare_s)))

    def set_layers(self, **layers: bool) -> None:
        """Which of skin, points are drawn."""
        self._layers |= layers
        self.show_hand(self._mesh)

    @property
    def mesh(self) -> HandMesh | None:
        """What is shown, or will be in a moment."""
        return self._mesh

    @Slot()
    def _draw(self) -> None:
        if self._scene is not None:
            self._drawn_s = time.monotonic()
            self._scene.show_hand(self._mesh, **self._layers)

    def look_again(self) -> None:
        """Back to the first view."""
        if self._scene is not None:
            self._scene.look_again()

    def zoom(self, factor: float) -> None:
        """Nearer or farther."""
        if self._scene is not None:
            self._scene.zoom(factor)

    def canvas(self) -> HandScene | None:
        """The widget that receives the mouse."""
        return self._scene

    # --- life --------------------------------------------------------------------------------------------

    @Slot()
    def _build(self) -> None:
        if self._closed or self._building or self._scene is not None:
            return
        if not body_backend().ready or not self.isVisible():
            return
        from app.widgets.hand_scene import HandScene

        self._building = True  # a first OpenGL child makes Qt show the window anew, and this view with it
        scene = HandScene()
        scene.setObjectName("hand_canvas")
        scene.setAccessibleName("The hand in 3D: arrows turn, + and - zoom")
        self._stack.addWidget(scene)
        self._stack.setCurrentWidget(scene)
        self._scene = scene
        self._building = False
        self._draw()
        self.ready.emit()

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
        """Free the OpenGL resources; calling twice is harmless."""
        self._closed = True
        self._later.stop()
        if self._scene is not None:
            scene, self._scene = self._scene, None
            scene.close_scene()
            self._stack.removeWidget(scene)
            scene.deleteLater()
