"""The dermoscopic images of one lesion over the visits, two at a time."""

from __future__ import annotations

from PySide6.QtGui import QImage
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QWidget

from app.context import AppContext
from app.theme import style_class
from app.widgets.compare_view import CompareView
from app.widgets.images import image_from_bytes
from app.widgets.sheet import Sheet
from core.records import DermoscopicImage, Lesion


class CompareSheet(Sheet):
    """Fills the window: choose two images, look at them together.

    Parameters
    ----------
    parent : QWidget
    context : AppContext
    lesion : Lesion
    """

    def __init__(self, parent: QWidget, context: AppContext, lesion: Lesion) -> None:
        site = f", {lesion.site.name}" if lesion.site else ""
        super().__init__(parent, f"Lesion {lesion.number}{site}: dermoscopy", "compare_sheet", width=None)
        self._context = context
        numbers = {v.id: v.number for v in context.store.visits.list(lesion.patient_id)}
        self._images = context.store.dermoscopy.for_lesion(lesion.id)
        self._titles = [
            f"Visit {numbers[i.visit_id]}, {i.added_at.astimezone():%d %b %Y}" for i in self._images
        ]
        self.earlier = self._chooser("compare_earlier")
        self.later = self._chooser("compare_later")
        self.view = CompareView()
        row = QHBoxLayout()
        row.setSpacing(12)
        for label, box in (("Compare", self.earlier), ("with", self.later)):
            text = QLabel(label)
            style_class(text, "secondary")
            row.addWidget(text)
            row.addWidget(box)
        row.addStretch(1)
        if len(self._images) > 1:
            self.body.addLayout(row)
        self.body.addWidget(self.view, 1)
        last = len(self._images) - 1
        self.earlier.setCurrentIndex(max(last - 1, 0))
        self.later.setCurrentIndex(last)
        for box in (self.earlier, self.later):
            box.currentIndexChanged.connect(self._show)
        self._show()

    def _chooser(self, name: str) -> QComboBox:
        box = QComboBox()
        box.setObjectName(name)
        box.setMinimumWidth(220)
        box.addItems(self._titles)
        return box

    def _picture(self, image: DermoscopicImage) -> QImage:
        return image_from_bytes(self._context.store.dermoscopy.data(image.id))

    def _show(self) -> None:
        a, b = self.earlier.currentIndex(), self.later.currentIndex()
        if len(self._images) == 1:
            self.view.set_pictures(
                self._picture(self._images[0]), None, self._titles[0], "No image of another visit"
            )
            return
        self.view.set_pictures(
            self._picture(self._images[a]), self._picture(self._images[b]), self._titles[a], self._titles[b]
        )
