"""The dermoscopic images of a lesion: this visit beside the previous one, zoomed and moved together."""

from __future__ import annotations

from PySide6.QtCore import QSize, QTimer, Signal, Slot
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from app.theme import icon, palette, style_class
from app.widgets.images import image_from_bytes
from app.widgets.photo_view import PhotoView
from app.widgets.sheet import Sheet
from app.windows.visit.side_panel import wrapped
from app.workflows.session import VisitSession
from app.workflows.wording import when
from core.records import DermoscopicImage


def show_dermoscopy(parent: QWidget, session: VisitSession, lesion_id: int, image_id: int) -> Sheet:
    """Open the sheet: the image clicked, beside the newest image of another visit if there is one."""
    images = session.snapshot.dermoscopy.get(lesion_id, ())
    chosen = next(i for i in images if i.id == image_id)
    others = [i for i in images if i.visit_id != chosen.visit_id]
    pair = sorted((others[-1], chosen), key=lambda i: i.id) if others else [chosen]
    lesion = next(x for x in session.snapshot.lesions if x.id == lesion_id)
    content = _Images(session, pair)
    text = (
        "Both images move and zoom together."
        if len(pair) == 2
        else "There is no image of another visit to compare with."
    )
    sheet = Sheet(parent, f"Lesion {lesion.number}: dermoscopy", "dermoscopy_sheet", width=None)
    sheet.body.addWidget(wrapped(text, "secondary", "dermoscopy_sheet_text"))
    sheet.body.addWidget(content, 1)
    content.removed.connect(sheet.close_sheet)
    return sheet.open()


class _Images(QWidget):
    removed = Signal()

    def __init__(self, session: VisitSession, images: list[DermoscopicImage]) -> None:
        super().__init__()
        self._session = session
        self._views: list[PhotoView] = []
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(16)
        for image in images:
            row.addLayout(self._column(image), 1)
        QTimer.singleShot(0, self._tie)

    @Slot()
    def _tie(self) -> None:
        """Once laid out: both fitted, then moved and zoomed together."""
        for view in self._views:
            view.fit()
        if len(self._views) == 2:
            a, b = self._views
            a.view_changed.connect(lambda: b.set_view_state(a.view_state()))
            b.view_changed.connect(lambda: a.set_view_state(b.view_state()))

    def _column(self, image: DermoscopicImage) -> QVBoxLayout:
        session = self._session
        visits = {v.id: v for v in (*session.snapshot.earlier, session.snapshot.visit)}
        view = PhotoView()
        view.setObjectName(f"dermoscopy_view_{len(self._views)}")
        view.set_image(image_from_bytes(session.store.dermoscopy.data(image.id)))
        self._views.append(view)
        frame = QFrame()
        style_class(frame, "photo")
        inside = QVBoxLayout(frame)
        inside.setContentsMargins(1, 1, 1, 1)
        inside.addWidget(view)
        caption = QLabel(f"Visit {visits[image.visit_id].number}, {when(image.added_at)}")
        style_class(caption, "strong")
        caption.setMinimumHeight(42)
        below = QHBoxLayout()
        below.addWidget(caption, 1)
        if image.visit_id == session.visit_id and session.snapshot.visit.is_open:
            remove = QPushButton(icon("trash", palette.SECONDARY), " Remove image")
            remove.setObjectName("remove_dermoscopy")
            remove.setIconSize(QSize(18, 18))
            remove.clicked.connect(lambda _=False, i=image.id: self._remove(i))
            below.addWidget(remove)
        column = QVBoxLayout()
        column.setSpacing(8)
        column.addWidget(frame, 1)
        column.addLayout(below)
        return column

    @Slot(int)
    def _remove(self, image_id: int) -> None:
        self._session.detach_dermoscopy(image_id)
        self.removed.emit()
