"""Step 3: lesions on the photo, on the 3D body and in the table; one selection for all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QSignalBlocker, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QImage
from PySide6.QtWidgets import (
    QButtonGroup,
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QPushButton,
    QScrollArea,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.theme import icon, palette, set_state, style_class
from app.widgets.body_view import BodyLesion, BodyView, surface_colors
from app.widgets.markers import Marker
from app.widgets.photo_view import PhotoView
from app.windows.visit.lesion_details import LesionDetails
from app.windows.visit.lesion_list import LesionLine, LesionList
from app.windows.visit.pieces import framed, offer_captures, segment
from app.windows.visit.side_panel import SidePanel
from app.windows.visit.spots_panel import SpotsPanel

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture

_BODY_MARGIN = 1.12
_CLOSE = 4.0
_LIST_MIN_HEIGHT = 132
"""Head and two rows: the selected lesion is always in sight."""

PANES = (("photo", "Photo"), ("body", "Photo and 3D body"), ("compare", "Previous visit"))


class LesionScreen(QWidget):
    """Shows what it is told; every act is a signal.

    Signals
    -------
    selected(str)
        A lesion was clicked in any view.
    placed(float, float)
        The photo or the body was clicked where there is no lesion, in picture pixels, while placing.
    moved(str, float, float)
        A marker was dragged.
    delete_requested(str)
    capture_chosen(int)
        Another side of the body is to be shown.
    confirm_all(), accept_unseen(), refine(), mark_new(bool), primary_clicked()
    spots_toggled(bool)
        The list of spots seen in one visit only is to be shown, or hidden.
    show_earlier_capture(int)
        A capture of an earlier visit is to be shown beside.
    pane_changed(str)
    """

    selected = Signal(str)
    placed = Signal(float, float)
    moved = Signal(str, float, float)
    delete_requested = Signal(str)
    capture_chosen = Signal(int)
    confirm_all = Signal()
    accept_unseen = Signal()
    refine = Signal()
    spots_toggled = Signal(bool)
    show_earlier_capture = Signal(int)
    mark_new = Signal(bool)
    primary_clicked = Signal()
    pane_changed = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("lesion_screen")
        self._analysed: AnalysedCapture | None = None
        self._framed = False
        self._framing = False
        self._details_on = self._spots_on = False
        self._body_shown: AnalysedCapture | None = None
        self.photo = PhotoView()
        self.photo.setObjectName("lesion_photo")
        self.body = BodyView()
        self.body.setObjectName("lesion_body")
        self.previous = PhotoView()
        self.previous.setObjectName("previous_photo")
        self.list = LesionList("lesion_list")
        self.details = LesionDetails()
        self.panel = SidePanel("lesions")
        self.panel.primary.clicked.connect(self.primary_clicked)
        self.count = QLabel()
        self.count.setObjectName("lesion_count")
        style_class(self.count, "caption")
        self.progress = QProgressBar()
        self.progress.setObjectName("lesion_progress")
        self.progress.setTextVisible(False)
        self.progress.setFixedHeight(6)
        self.confirm_all_button = QPushButton(icon("check", palette.SECONDARY), " Confirm confident")
        self.confirm_all_button.setObjectName("confirm_all")
        self.unseen_button = QPushButton(icon("eye-off", palette.SECONDARY), " Agree: not in view")
        self.unseen_button.setObjectName("accept_unseen")
        self.refine_button = QPushButton(
            icon("refresh", palette.SECONDARY), " Use confirmed lesions to refine the others"
        )
        self.refine_button.setObjectName("refine_lesions")
        self.refine_button.setToolTip("Looks again for the lesions that wait, held by those you decided on.")
        self.spots_button = QPushButton(icon("search", palette.SECONDARY), " Spots only in one visit")
        self.spots_button.setObjectName("show_spots")
        self.spots_button.setCheckable(True)
        self.spots = SpotsPanel()
        self.new_button = QPushButton(icon("plus", palette.SECONDARY), " Mark new lesion")
        self.new_button.setObjectName("mark_new_lesion")
        self.new_button.setCheckable(True)
        self.hint = QLabel("Click a lesion in the list or on the photo to see its details.")
        self.hint.setObjectName("lesion_hint")
        self.hint.setWordWrap(True)
        style_class(self.hint, "caption")
        self._captures = QButtonGroup(self)
        self._capture_row = QHBoxLayout()
        self._capture_row.setSpacing(0)
        self._panes = QButtonGroup(self)
        self._build()
        self._connect()
        self.set_pane("photo")
        self.refine_button.hide()
        self.spots_button.hide()
        self.show_spots(False)

    # --- building ------------------------------------------------------------------------------------

    def _build(self) -> None:
        tools = QHBoxLayout()
        tools.setSpacing(8)
        tools.addLayout(self._capture_row)
        tools.addWidget(self.new_button)
        tools.addStretch(1)
        for name, symbol, tip, act in (
            ("photo_fit", "fit", "Show the whole photo (0)", self.photo.fit),
            ("photo_zoom_in", "zoom-in", "Zoom in (+)", lambda: self.photo.zoom_by(1.5)),
            ("photo_zoom_out", "zoom-out", "Zoom out (-)", lambda: self.photo.zoom_by(1 / 1.5)),
        ):
            button = QToolButton()
            button.setObjectName(name)
            button.setIcon(icon(symbol, palette.SECONDARY))
            button.setToolTip(tip)
            style_class(button, "icon")
            button.clicked.connect(lambda _=False, a=act: a())
            tools.addWidget(button)
        segments = QHBoxLayout()
        segments.setSpacing(0)
        for i, (key, text) in enumerate(PANES):
            button = segment(text, f"pane_{key}", first=i == 0, last=i == len(PANES) - 1)
            self._panes.addButton(button, i)
            segments.addWidget(button)
        tools.addSpacing(8)
        tools.addLayout(segments)
        self._photo_frame, self.photo_caption = framed(self.photo, "lesion_photo_caption")
        self._body_frame, self.body_caption = framed(self.body, "lesion_body_caption", dark=False)
        self._previous_frame, self.previous_caption = framed(self.previous, "previous_photo_caption")
        pictures = QHBoxLayout()
        pictures.setSpacing(16)
        pictures.addWidget(self._previous_frame, 1)
        pictures.addWidget(self._photo_frame, 1)
        pictures.addWidget(self._body_frame, 1)
        left = QVBoxLayout()
        left.setSpacing(8)
        left.addLayout(tools)
        left.addLayout(pictures, 1)
        bulk = QHBoxLayout()
        bulk.setSpacing(8)
        bulk.addWidget(self.confirm_all_button, 1)
        bulk.addWidget(self.unseen_button, 1)
        body = self.panel.body
        body.setSpacing(8)
        body.addWidget(self.progress)
        body.addWidget(self.count)
        self.list.setMinimumHeight(_LIST_MIN_HEIGHT)
        # The form scrolls where the window is low: nothing in it may be squeezed over its neighbour.
        self.details_area = QScrollArea()
        self.details_area.setObjectName("lesion_details_area")
        self.details_area.setWidgetResizable(True)
        self.details_area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.details_area.setWidget(self.details)
        body.addWidget(self.list, 2)
        body.addLayout(bulk)
        body.addWidget(self.refine_button)
        body.addWidget(self.spots_button)
        body.addWidget(self.spots, 4)
        body.addWidget(self.hint)
        body.addWidget(self.details_area, 3)
        row = QHBoxLayout(self)
        row.setContentsMargins(24, 16, 24, 24)
        row.setSpacing(16)
        row.addLayout(left, 1)
        row.addWidget(self.panel)

    def _connect(self) -> None:
        self.photo.viewport().installEventFilter(self)
        self.photo.view_changed.connect(self._on_view_changed)
        self.photo.marker_clicked.connect(self._on_photo_clicked)
        self.photo.placed.connect(self.placed)
        self.photo.marker_moved.connect(self.moved)
        self.photo.delete_requested.connect(self.delete_requested)
        self.previous.marker_clicked.connect(self._on_previous_clicked)
        self.body.lesion_clicked.connect(self._on_clicked)
        self.body.placed.connect(self._on_body_placed)
        self.list.lesion_clicked.connect(self._on_list_clicked)
        self.list.lesion_activated.connect(self.center_on)
        self.confirm_all_button.clicked.connect(self.confirm_all)
        self.unseen_button.clicked.connect(self.accept_unseen)
        self.refine_button.clicked.connect(self.refine)
        self.spots_button.toggled.connect(self.spots_toggled)
        self.new_button.toggled.connect(self.mark_new)
        self._panes.idClicked.connect(lambda i: self.set_pane(PANES[i][0]))
        self._captures.idClicked.connect(self.capture_chosen)

    # --- panes ---------------------------------------------------------------------------------------

    @property
    def pane(self) -> str:
        """Which pictures are shown: photo, body or compare."""
        return PANES[max(self._panes.checkedId(), 0)][0]

    def set_pane(self, pane: str) -> None:
        """Show the photo alone, with the body, or with the previous visit's photo."""
        index = [key for key, _ in PANES].index(pane)
        self._panes.button(index).setChecked(True)
        self._previous_frame.setVisible(pane == "compare")
        self._body_frame.setVisible(pane == "body")
        self._show_body()
        QTimer.singleShot(0, self, self.frame_body)
        self.pane_changed.emit(pane)

    def set_compare_available(self, on: bool) -> None:
        """Whether there is a previous visit to show."""
        self._panes.button(2).setVisible(on)
        last = self._panes.button(2 if on else 1)
        for i in range(3):
            set_state(self._panes.button(i), "last", "true" if self._panes.button(i) is last else "false")

    # --- contents ------------------------------------------------------------------------------------

    def set_captures(self, views: Mapping[str, int], shown: int | None) -> None:
        """Offer the captures of this visit; with one alone there is nothing to choose."""
        offer_captures(self._captures, self._capture_row, "capture", views, shown)

    def show_capture(
        self, picture: NDArray | QImage | None, analysed: AnalysedCapture | None, caption: str
    ) -> None:
        """Show the picture of a capture of this visit; the body as soon as it is analysed."""
        self.photo.set_image(picture)
        self.photo_caption.setText(caption)
        self._analysed = analysed
        self._show_body()
        QTimer.singleShot(0, self, self.frame_body)

    def _show_body(self) -> None:
        if self.pane != "body" or self._analysed is self._body_shown:
            return
        self._body_shown = self._analysed
        if self._analysed is None:
            self.body.clear()
            return
        surface = self._analysed.scan.surface
        self.body.set_surface(
            surface.vertices, surface.triangles, surface_colors(self._analysed.capture, surface.vertices)
        )

    def frame_body(self) -> None:
        """Fill the photo's view with the body instead of the whole room."""
        if self._analysed is None:
            self.photo.fit()
            return
        self._framing = True
        pixels = self._analysed.scan.vertex_picture_pixels
        low, high = np.nanmin(pixels, axis=0), np.nanmax(pixels, axis=0)
        width, height = self.photo.image_size
        view = self.photo.viewport().size()
        fitted = min(view.width() / max(width, 1), view.height() / max(height, 1))
        span = np.maximum((high - low) * _BODY_MARGIN, 1.0)
        wanted = min(view.width() / span[0], view.height() / span[1])
        middle = (low + high) / 2
        self.photo.center_on(float(middle[0]), float(middle[1]), max(wanted / fitted, 1.0))
        self._framing = False
        self._framed = True

    def show_previous(self, markers: Sequence[Marker], caption: str) -> None:
        """Show the lesions on the photo of the previous visit."""
        self.previous.set_markers(markers)
        self.previous_caption.setText(caption)

    def show_lesions(
        self,
        lines: Sequence[LesionLine],
        markers: Sequence[Marker],
        on_body: Sequence[BodyLesion],
        selected: str | None,
    ) -> None:
        """Show the lesions in the table, on the photo and on the body."""
        self.list.set_lines(lines)
        self.photo.set_markers(markers)
        self.body.set_lesions(list(on_body))
        self.show_selected(selected)

    def show_selected(self, lesion_id: str | None) -> None:
        """Select a lesion in every view."""
        self.list.set_selected(lesion_id)
        self.photo.set_selected(lesion_id)
        self.body.set_selected(lesion_id)
        self.previous.set_selected(lesion_id)

    def show_details(self, on: bool) -> None:
        """Whether a lesion is selected whose details are shown."""
        self._details_on = on
        self.details_area.setVisible(on and not self._spots_on)
        self.hint.setVisible(not on and not self._spots_on)

    def show_spots(self, on: bool) -> None:
        """Whether the spots seen in one visit only take the place of the details."""
        self._spots_on = on
        with QSignalBlocker(self.spots_button):
            self.spots_button.setChecked(on)
        self.spots.setVisible(on)
        self.show_details(self._details_on)

    def show_placing(self, on: bool, *, new: bool) -> None:
        """Whether a click places a lesion, and whether a new one."""
        self.photo.set_placing(on)
        self.body.set_placing(on)
        with QSignalBlocker(self.new_button):
            self.new_button.setChecked(new)

    def center_on(self, lesion_id: str, zoom: float = _CLOSE) -> None:
        """Bring a lesion to the middle of the photo and in front on the body."""
        self.photo.center_on_marker(lesion_id, zoom)
        self.previous.center_on_marker(lesion_id, zoom)
        if self.pane == "body":
            self.body.turn_to(lesion_id)

    @Slot(str)
    def _on_clicked(self, lesion_id: str) -> None:
        self.selected.emit(lesion_id)

    @Slot(str)
    def _on_photo_clicked(self, lesion_id: str) -> None:
        self.selected.emit(lesion_id)
        if self.pane == "compare":
            self.previous.center_on_marker(lesion_id, _CLOSE)

    @Slot(str)
    def _on_previous_clicked(self, lesion_id: str) -> None:
        self.selected.emit(lesion_id)
        self.photo.center_on_marker(lesion_id, _CLOSE)

    @Slot()
    def _on_view_changed(self) -> None:
        if not self._framing:
            self._framed = False

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: D102
        if event.type() == QEvent.Type.Resize and self._framed:
            QTimer.singleShot(0, self, self.frame_body)
        return super().eventFilter(watched, event)

    @Slot(str)
    def _on_list_clicked(self, lesion_id: str) -> None:
        self.selected.emit(lesion_id)
        if self.pane == "compare":
            self.center_on(lesion_id)
            return
        marker = next((m for m in self.photo.markers() if m.id == lesion_id), None)
        if marker is not None and not self.photo.viewport().rect().contains(
            self.photo.viewport_position(marker.x, marker.y)
        ):
            self.photo.center_on(marker.x, marker.y)
        if self.pane == "body":
            self.body.turn_to(lesion_id)

    @Slot(float, float, float)
    def _on_body_placed(self, x: float, y: float, z: float) -> None:
        if self._analysed is not None:
            u, v = self._analysed.capture.rig.project_to_picture([[x, y, z]])[0]
            self.placed.emit(float(u), float(v))
