"""The newest body of a patient with its lesions: the photo, or the 3D body built from the capture."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QStackedWidget, QVBoxLayout, QWidget

from app.context import AppContext
from app.tasks import Task
from app.theme import set_state, style_class
from app.widgets.body_view import BodyLesion, BodyView, surface_colors
from app.widgets.markers import Marker
from app.widgets.photo_view import PhotoView
from app.widgets.status import EmptyState
from app.windows.patient_model import PatientModel
from app.windows.visit.pictures import stored_picture
from app.workflows.wording import when
from core.progress import Progress

if TYPE_CHECKING:
    from core.records import CaptureRecord

PANES = (("photo", "Photo"), ("body", "3D body"))


class PatientBody(QWidget):
    """See the module's documentation.

    Signals
    -------
    lesion_clicked(str), lesion_activated(str)
    failed(object)
        The 3D body could not be built: a `TaskFailure`.

    Attributes
    ----------
    switch : QWidget
        The choice between photo and 3D body, to be placed beside a heading.
    """

    lesion_clicked = Signal(str)
    lesion_activated = Signal(str)
    failed = Signal(object)

    def __init__(self, context: AppContext, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._context = context
        self._model: PatientModel | None = None
        self._selected: str | None = None
        self._capture_id: int | None = None
        self._body_of: int | None = None
        self._body_task: Task | None = None
        self.photo = PhotoView()
        self.photo.setObjectName("patient_photo")
        self.body = BodyView()
        self.body.setObjectName("patient_body")
        for view in (self.photo.marker_clicked, self.body.lesion_clicked):
            view.connect(self.lesion_clicked)
        for view in (self.photo.marker_activated, self.body.lesion_activated):
            view.connect(self.lesion_activated)
        self.switch = self._switch()
        self._build()

    def _switch(self) -> QWidget:
        self._buttons: dict[str, QPushButton] = {}
        switch = QWidget()
        row = QHBoxLayout(switch)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        for key, text in PANES:
            button = QPushButton(text)
            button.setObjectName(f"patient_pane_{key}")
            button.setCheckable(True)
            style_class(button, "segment")
            set_state(button, "first", "true" if key == PANES[0][0] else "false")
            set_state(button, "last", "true" if key == PANES[-1][0] else "false")
            button.clicked.connect(partial(self.show_pane, key))
            self._buttons[key] = button
            row.addWidget(button)
        return switch

    def _build(self) -> None:
        photo = QFrame()
        style_class(photo, "photo")
        inside = QVBoxLayout(photo)
        inside.setContentsMargins(1, 1, 1, 1)
        inside.addWidget(self.photo)
        self.no_picture = EmptyState("body", "No body capture yet", "It is taken in the first visit.")
        self.panes = QStackedWidget()
        for pane in (photo, self.body, self.no_picture):
            self.panes.addWidget(pane)
        self.caption = QLabel()
        self.caption.setObjectName("patient_picture_caption")
        style_class(self.caption, "caption")
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(8)
        column.addWidget(self.panes, 1)
        column.addWidget(self.caption)

    def forget(self) -> None:
        """Another patient comes: the picture shown is nobody's any more."""
        self._capture_id = None

    def show_model(self, model: PatientModel, selected: str | None) -> None:
        """Show the newest capture of a patient, the front view if there is one."""
        self._model, self._selected = model, selected
        record = _shown_record(model)
        for button in self._buttons.values():
            button.setEnabled(record is not None)
        if record is None:
            self._capture_id = None
            self.panes.setCurrentWidget(self.no_picture)
            self.caption.clear()
            return
        store = self._context.store
        placed = model.on_capture(store, record.id)
        if record.id != self._capture_id:
            self._capture_id = record.id
            self.photo.set_image(stored_picture(store, record))
            self.photo.fit()
        self.photo.set_markers(
            [
                Marker(
                    str(s.lesion.id), str(s.lesion.number), *o.pixel, s.tone, movable=False, tooltip=s.status
                )
                for s, o in placed
                if o.pixel is not None
            ]
        )
        self.body.set_lesions(
            [
                BodyLesion(str(s.lesion.id), str(s.lesion.number), o.point_m, s.tone)
                for s, o in placed
                if o.point_m is not None
            ]
        )
        self.set_selected(selected)
        self.caption.setText(f"{record.view.capitalize()} view, {when(record.taken_at)}")
        self.show_pane("body" if self.panes.currentWidget() is self.body else "photo")

    def set_selected(self, lesion_id: str | None) -> None:
        """Select a lesion on the photo and on the body."""
        self._selected = lesion_id
        self.photo.set_selected(lesion_id)
        self.body.set_selected(lesion_id)

    def show_pane(self, key: str, *_: object) -> None:
        """Show the photo or the 3D body."""
        for name, button in self._buttons.items():
            button.setChecked(name == key)
        self.panes.setCurrentWidget(self.body if key == "body" else self.panes.widget(0))
        if key == "body" and self._capture_id is not None and self._body_of != self._capture_id:
            self._load_body(self._capture_id)

    def _load_body(self, capture_id: int) -> None:
        self._body_of = capture_id
        self.body.clear()
        store = self._context.store

        def work(progress: Progress) -> Any:
            from core.surface import scan_body

            capture = store.captures.load(capture_id)
            scan = scan_body(capture, progress=progress)
            return (
                scan.surface.vertices,
                scan.surface.triangles,
                surface_colors(capture, scan.surface.vertices),
            )

        def done(surface: Any) -> None:
            if self._body_of == capture_id and self._model is not None:
                self.body.set_surface(*surface)
                self.show_model(self._model, self._selected)

        task = self._context.tasks.start("Building the 3D body", work)
        task.finished.connect(done)
        task.failed.connect(self.failed)
        self._body_task = task


def _shown_record(model: PatientModel) -> CaptureRecord | None:
    views = model.views
    return next((r for r in views if r.view == "front"), views[0] if views else None)
