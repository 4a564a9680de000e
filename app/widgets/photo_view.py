"""A photo with numbered lesion markers: zoom around the cursor, pan, click to place, drag to correct.

Public API of `PhotoView`
-------------------------
``set_image(QImage | ndarray | None)``, ``image_size``, ``set_markers(list[Marker])``, ``markers()``
``set_selected(id | None)``, ``selected()``              selection does not emit; clicks do
``set_placing(bool, over_markers=False)``                a click on the photo emits ``placed``
``set_movable(bool)``                                    markers may be dragged (ghost of the proposed place)
``fit()``, ``zoom_by(factor)``, ``center_on(x, y, zoom=None)``, ``center_on_marker(id)``
``set_scale_mm(mm_per_pixel | None)``                    draws a scale bar
``set_ghost_image(QImage | ndarray | None, opacity)``    a second picture laid over the first
``viewport_position(x, y) -> QPoint``                    where an image pixel is, for tests:
    ``QTest.mouseClick(view.viewport(), ...)``
``view_state()`` / ``set_view_state(state)``             zoom and centre, relative to the picture (for
    synchronised views)

Signals: ``marker_clicked(str id)``, ``marker_activated(str id)`` (double click or Enter), ``marker_moved(str
    id,
float x, float y)``, ``placed(float x, float y)``, ``background_clicked()``, ``delete_requested(str id)``,
``hovered(str id or "")``, ``view_changed()``.

Keys: + and - zoom, 0 fits, arrows pan, N and P go to the next and previous marker, Delete asks to remove,
Esc ends a drag.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPoint, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPixmap,
    QResizeEvent,
    QTransform,
    QWheelEvent,
)
from PySide6.QtWidgets import QApplication, QGraphicsPixmapItem, QGraphicsScene, QGraphicsView, QWidget

from app.theme import palette
from app.widgets.images import to_qimage
from app.widgets.markers import Marker
from app.widgets.photo_items import MarkerItem, draw_scale_bar

_MAX_ZOOM = 40.0
_MIN_ZOOM = 0.5
_STEP = 1.25


@dataclass(frozen=True)
class ViewState:
    """Zoom relative to the fitted picture, and the centre as a share of its width and height."""

    zoom: float
    x: float
    y: float


class PhotoView(QGraphicsView):
    """See the module's documentation."""

    marker_clicked = Signal(str)
    marker_activated = Signal(str)
    marker_moved = Signal(str, float, float)
    placed = Signal(float, float)
    background_clicked = Signal()
    delete_requested = Signal(str)
    hovered = Signal(str)
    view_changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._scene = QGraphicsScene(self)
        self.setScene(self._scene)
        self._picture = QGraphicsPixmapItem()
        self._picture.setTransformationMode(Qt.TransformationMode.SmoothTransformation)
        self._ghost = QGraphicsPixmapItem()
        self._ghost.setTransformationMode(Qt.TransformationMode.SmoothTransformation)
        self._ghost.setZValue(1)
        self._scene.addItem(self._picture)
        self._scene.addItem(self._ghost)
        self._items: dict[str, MarkerItem] = {}
        self._selected: str | None = None
        self._hovered = ""
        self._placing = self._over_markers = False
        self._movable = False
        self._mm_per_pixel: float | None = None
        self._fitted = True
        self._press: QPoint | None = None
        self._press_id: str | None = None
        self._panning = False
        self._dragging = False
        self._quiet = False
        self.setRenderHint(QPainter.RenderHint.Antialiasing)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setTransformationAnchor(QGraphicsView.ViewportAnchor.NoAnchor)
        self.setResizeAnchor(QGraphicsView.ViewportAnchor.NoAnchor)
        self.setBackgroundBrush(QColor(palette.PHOTO_BACKGROUND))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setMinimumSize(160, 120)
        self._update_cursor()

    # --- contents -----------------------------------------------------------------------------------------

    def set_image(self, image: QImage | NDArray[np.uint8] | None) -> None:
        """Show another picture (None for none), fitted; the markers stay."""
        pixmap = _pixmap(image)
        same = pixmap.size() == self._picture.pixmap().size()
        self._picture.setPixmap(pixmap)
        width, height = pixmap.width(), pixmap.height()
        margin = 4.0 * max(width, height, 1)
        self.setSceneRect(QRectF(-margin, -margin, width + 2 * margin, height + 2 * margin))
        if not same or self._fitted:
            self.fit()

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height of the picture in pixels; zeros without one."""
        return self._picture.pixmap().width(), self._picture.pixmap().height()

    def set_ghost_image(self, image: QImage | NDArray[np.uint8] | None, opacity: float = 0.5) -> None:
        """Lay a second picture over the first, stretched to its size."""
        pixmap = _pixmap(image)
        self._ghost.setPixmap(pixmap)
        self._ghost.setOpacity(opacity)
        width, height = self.image_size
        if not pixmap.isNull() and width:
            self._ghost.setTransform(QTransform.fromScale(width / pixmap.width(), height / pixmap.height()))

    def set_ghost_opacity(self, opacity: float) -> None:
        """How much of the second picture shows, 0..1."""
        self._ghost.setOpacity(opacity)

    def set_markers(self, markers: Sequence[Marker]) -> None:
        """Show exactly these markers; the selection is kept if it is among them."""
        for name in set(self._items) - {marker.id for marker in markers}:
            self._scene.removeItem(self._items.pop(name))
        for marker in markers:
            item = self._items.get(marker.id)
            if item is None:
                item = self._items[marker.id] = MarkerItem(marker)
                self._scene.addItem(item)
            else:
                item.set_marker(marker)
            item.set_selected(marker.id == self._selected)
        if self._selected is not None and self._selected not in self._items:
            self._selected = None

    def markers(self) -> list[Marker]:
        """The markers shown."""
        return [item.marker for item in self._items.values()]

    def set_selected(self, marker_id: str | None) -> None:
        """Highlight a marker without emitting; unknown ids select nothing."""
        self._selected = marker_id if marker_id in self._items else None
        for name, item in self._items.items():
            item.set_selected(name == self._selected)

    def selected(self) -> str | None:
        """Id of the highlighted marker."""
        return self._selected

    def set_placing(self, on: bool, *, over_markers: bool = False) -> None:
        """Whether a click on the photo emits ``placed``; also one on a marker, if so wished."""
        self._placing, self._over_markers = on, on and over_markers
        self._update_cursor()

    def set_movable(self, on: bool) -> None:
        """Whether markers may be dragged."""
        self._movable = on

    def set_scale_mm(self, mm_per_pixel: float | None) -> None:
        """Draw a scale bar for pictures whose scale is known."""
        self._mm_per_pixel = mm_per_pixel
        self.viewport().update()

    # --- view ---------------------------------------------------------------------------------------------

    def _scale(self) -> float:
        return self.transform().m11()

    def _fit_scale(self, viewport: QSize | None = None) -> float:
        width, height = self.image_size
        if not width:
            return 1.0
        size = viewport or self.viewport().size()
        return max(min((size.width() - 2) / width, (size.height() - 2) / height), 1e-6)

    def fit(self) -> None:
        """Show the whole picture."""
        width, height = self.image_size
        self._fitted = True
        self._set_view(self._fit_scale(), QPointF(width / 2, height / 2))

    def _set_view(self, scale: float, center: QPointF) -> None:
        self.setTransform(QTransform.fromScale(scale, scale))
        self.centerOn(center)
        if not self._quiet:
            self.view_changed.emit()

    def _center(self, viewport: QSize | None = None) -> QPointF:
        size = viewport or self.viewport().size()
        a = self.mapToScene(QPoint(0, 0))
        return a + QPointF(size.width() / 2, size.height() / 2) / self._scale()

    def zoom_by(self, factor: float, around: QPointF | None = None) -> None:
        """Zoom; ``around`` is a viewport position that stays where it is (default: the middle)."""
        if not self.image_size[0]:
            return
        fit = self._fit_scale()
        old = self._scale()
        new = min(max(old * factor, fit * _MIN_ZOOM), fit * _MAX_ZOOM)
        middle = QPointF(self.viewport().width() / 2, self.viewport().height() / 2)
        anchor = (around if around is not None else middle) - middle
        center = self._center() + anchor / old - anchor / new
        self._fitted = False
        self._set_view(new, center)

    def center_on(self, x: float, y: float, zoom: float | None = None) -> None:
        """Bring an image pixel to the middle; ``zoom`` is relative to the fitted picture."""
        self._fitted = False
        self._set_view(self._fit_scale() * zoom if zoom else self._scale(), QPointF(x, y))

    def center_on_marker(self, marker_id: str, zoom: float | None = None) -> None:
        """Bring a marker to the middle."""
        item = self._items.get(marker_id)
        if item is not None:
            self.center_on(item.marker.x, item.marker.y, zoom)

    def viewport_position(self, x: float, y: float) -> QPoint:
        """Where an image pixel is in the viewport."""
        return self.viewportTransform().map(QPointF(x + 0.5, y + 0.5)).toPoint()

    def image_position(self, position: QPoint | QPointF) -> tuple[float, float]:
        """Image pixel (centres at integers) under a viewport position."""
        inverse, _ = self.viewportTransform().inverted()
        p = inverse.map(QPointF(position))
        return p.x() - 0.5, p.y() - 0.5

    def view_state(self) -> ViewState:
        """Zoom and centre, relative to the picture."""
        return self._state_in(self.viewport().size())

    def _state_in(self, viewport: QSize) -> ViewState:
        width, height = self.image_size
        c = self._center(viewport)
        zoom = self._scale() / self._fit_scale(viewport)
        return ViewState(zoom, c.x() / max(width, 1), c.y() / max(height, 1))

    def set_view_state(self, state: ViewState) -> None:
        """Take over zoom and centre of another view, without emitting ``view_changed``."""
        width, height = self.image_size
        self._quiet = True
        self._fitted = False
        self._set_view(self._fit_scale() * state.zoom, QPointF(state.x * width, state.y * height))
        self._quiet = False

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102
        known = not self._fitted and not event.oldSize().isEmpty()
        kept = self._state_in(event.oldSize()) if known else None
        super().resizeEvent(event)
        if self._fitted:
            self.fit()
        elif kept is not None:
            self.set_view_state(kept)

    def drawForeground(self, painter: QPainter, rect: QRectF | QRectF) -> None:  # noqa: D102
        super().drawForeground(painter, rect)
        if self._mm_per_pixel and self.image_size[0]:
            painter.save()
            painter.resetTransform()
            draw_scale_bar(painter, self.viewport().rect(), self._scale() / self._mm_per_pixel)
            painter.restore()

    # --- mouse and keys -----------------------------------------------------------------------------------

    def marker_at(self, position: QPoint) -> str | None:
        """Id of the marker under a viewport position, the nearest one if several are."""
        best: tuple[float, str] | None = None
        if self._over_markers:
            return None
        for name, item in self._items.items():
            offset = QPointF(position) - QPointF(self.viewport_position(item.marker.x, item.marker.y))
            distance = item.distance(offset)
            if distance is not None and (best is None or distance < best[0]):
                best = (distance, name)
        return best[1] if best else None

    def _on_image(self, x: float, y: float) -> bool:
        width, height = self.image_size
        return -0.5 <= x < width - 0.5 and -0.5 <= y < height - 0.5

    def _update_cursor(self) -> None:
        shape = Qt.CursorShape.CrossCursor if self._placing else Qt.CursorShape.OpenHandCursor
        if self._panning:
            shape = Qt.CursorShape.ClosedHandCursor
        elif self._dragging:
            shape = Qt.CursorShape.SizeAllCursor
        elif self._hovered:
            shape = Qt.CursorShape.PointingHandCursor
        self.viewport().setCursor(shape)

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        if event.button() not in (Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton):
            return
        self._press = event.position().toPoint()
        self._press_id = None
        if event.button() == Qt.MouseButton.LeftButton:
            self._press_id = self.marker_at(self._press)
            if self._press_id is not None:
                self.set_selected(self._press_id)
                self.marker_clicked.emit(self._press_id)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        position = event.position().toPoint()
        if self._press is None:
            self._hover(self.marker_at(position) or "")
            return
        if not (self._panning or self._dragging):
            if (position - self._press).manhattanLength() < QApplication.startDragDistance() // 2:
                return
            item = self._items.get(self._press_id) if self._press_id else None
            self._dragging = item is not None and self._movable and item.marker.movable
            self._panning = not self._dragging
            self._update_cursor()
        if self._dragging and self._press_id in self._items:
            self._items[self._press_id].drag_to(*self.image_position(position))
        elif self._panning:
            delta = QPointF(position - self._press)
            self._press = position
            self._fitted = False
            self._set_view(self._scale(), self._center() - delta / self._scale())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        if self._press is None:
            return
        was_dragging, was_panning, marker_id = self._dragging, self._panning, self._press_id
        self._press, self._press_id, self._dragging, self._panning = None, None, False, False
        self._update_cursor()
        x, y = self.image_position(event.position())
        if was_dragging and marker_id in self._items:
            item = self._items[marker_id]
            item.end_drag()
            if self._on_image(x, y):
                ghost = item.marker.ghost or (item.marker.x, item.marker.y)
                item.set_marker(replace(item.marker, x=x, y=y, ghost=ghost))
                self.marker_moved.emit(marker_id, x, y)
        elif not was_panning and marker_id is None and event.button() == Qt.MouseButton.LeftButton:
            if self._placing and self._on_image(x, y):
                self.placed.emit(x, y)
            else:
                self.background_clicked.emit()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        marker_id = self.marker_at(event.position().toPoint())
        if marker_id is not None:
            self.marker_activated.emit(marker_id)
        else:
            self.mousePressEvent(event)

    def leaveEvent(self, event: QEvent) -> None:  # noqa: D102
        self._hover("")
        super().leaveEvent(event)

    def _hover(self, marker_id: str) -> None:
        if marker_id == self._hovered:
            return
        for name in (self._hovered, marker_id):
            if name in self._items:
                self._items[name].set_hovered(name == marker_id)
        self._hovered = marker_id
        self.viewport().setToolTip(self._items[marker_id].marker.tooltip if marker_id else "")
        self._update_cursor()
        self.hovered.emit(marker_id)

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: D102
        self.zoom_by(_STEP ** (event.angleDelta().y() / 120.0), event.position())
        event.accept()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102
        key = event.key()
        pans = {
            Qt.Key.Key_Left: QPointF(-48, 0),
            Qt.Key.Key_Right: QPointF(48, 0),
            Qt.Key.Key_Up: QPointF(0, -48),
            Qt.Key.Key_Down: QPointF(0, 48),
        }
        if key in (Qt.Key.Key_Plus, Qt.Key.Key_Equal):
            self.zoom_by(_STEP)
        elif key == Qt.Key.Key_Minus:
            self.zoom_by(1 / _STEP)
        elif key == Qt.Key.Key_0:
            self.fit()
        elif key in pans:
            self._fitted = False
            self._set_view(self._scale(), self._center() + pans[key] / self._scale())
        elif key in (Qt.Key.Key_N, Qt.Key.Key_P) and self._items:
            self._step_selection(1 if key == Qt.Key.Key_N else -1)
        elif key in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and self._selected:
            self.marker_activated.emit(self._selected)
        elif key in (Qt.Key.Key_Delete, Qt.Key.Key_Backspace) and self._selected:
            self.delete_requested.emit(self._selected)
        elif key == Qt.Key.Key_Escape and self._dragging and self._press_id in self._items:
            self._items[self._press_id].end_drag()
            self._press, self._dragging = None, False
            self._update_cursor()
        else:
            super().keyPressEvent(event)

    def _step_selection(self, step: int) -> None:
        names = list(self._items)
        at = names.index(self._selected) + step if self._selected in names else (0 if step > 0 else -1)
        name = names[at % len(names)]
        self.set_selected(name)
        self.marker_clicked.emit(name)
        marker = self._items[name].marker
        if not self.viewport().rect().contains(self.viewport_position(marker.x, marker.y)):
            self.center_on(marker.x, marker.y)


def _pixmap(image: QImage | NDArray[np.uint8] | None) -> QPixmap:
    if image is None:
        return QPixmap()
    return QPixmap.fromImage(image if isinstance(image, QImage) else to_qimage(image))
