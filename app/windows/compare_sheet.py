"""The dermoscopic images of one lesion over the visits, two at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QSize
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QPushButton, QWidget

from app.theme import icon, palette, style_class
from app.widgets.compare_view import CompareView
from app.widgets.images import image_from_bytes
from app.widgets.sheet import Sheet
from core.records import ClinicStore, DermoscopicImage, Lesion

ALONE = "No image of another visit"


class CompareSheet(Sheet):
    """Fills the window: choose two images, look at them together.

    Parameters
    ----------
    parent : QWidget
    store : ClinicStore
    lesion : Lesion
    chosen : int or None
        Id of the image to begin with, beside the newest one of another visit; the newest two without it.
    remove : callable or None
        Takes away an image of ``removable_visit``, by id; offered for such images alone.
    removable_visit : int or None
        The open visit.
    """

    def __init__(
        self,
        parent: QWidget,
        store: ClinicStore,
        lesion: Lesion,
        *,
        chosen: int | None = None,
        remove: Callable[[int], object] | None = None,
        removable_visit: int | None = None,
    ) -> None:
        site = f", {lesion.site.name}" if lesion.site else ""
        super().__init__(parent, f"Lesion {lesion.number}{site}: dermoscopy", "compare_sheet", width=None)
        self._store, self._remove, self._removable = store, remove, removable_visit
        numbers = {v.id: v.number for v in store.visits.list(lesion.patient_id)}
        self._images = store.dermoscopy.for_lesion(lesion.id)
        self._titles = [
            f"Visit {numbers[i.visit_id]}, {i.added_at.astimezone():%d %b %Y}" for i in self._images
        ]
        self.earlier = self._chooser("compare_earlier")
        self.later = self._chooser("compare_later")
        self.view = CompareView()
        self.remove_button = QPushButton(icon("trash", palette.SECONDARY), "")
        self.remove_button.setObjectName("remove_dermoscopy")
        self.remove_button.setIconSize(QSize(18, 18))
        self.remove_button.clicked.connect(self._remove_shown)
        row = QHBoxLayout()
        row.setSpacing(12)
        for label, box in (("Compare", self.earlier), ("with", self.later)):
            text = QLabel(label)
            style_class(text, "secondary")
            text.setVisible(len(self._images) > 1)
            box.setVisible(len(self._images) > 1)
            row.addWidget(text)
            row.addWidget(box)
        row.addStretch(1)
        row.addWidget(self.remove_button)
        self.body.addLayout(row)
        self.body.addWidget(self.view, 1)
        earlier, later = pair_of(self._images, chosen)
        self.earlier.setCurrentIndex(earlier)
        self.later.setCurrentIndex(later)
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
        return image_from_bytes(self._store.dermoscopy.data(image.id))

    def _show(self) -> None:
        a, b = self.earlier.currentIndex(), self.later.currentIndex()
        if len(self._images) == 1:
            self.view.set_pictures(self._picture(self._images[0]), None, self._titles[0], ALONE)
        else:
            self.view.set_pictures(
                self._picture(self._images[a]),
                self._picture(self._images[b]),
                self._titles[a],
                self._titles[b],
            )
        shown = self._removable_shown()
        self.remove_button.setVisible(shown is not None)
        if shown is not None:
            self.remove_button.setText(f" Remove image of {self._titles[self._images.index(shown)]}")

    def _removable_shown(self) -> DermoscopicImage | None:
        """The image of the open visit that is shown, the later one first."""
        if self._remove is None:
            return None
        shown = (self._images[box.currentIndex()] for box in (self.later, self.earlier))
        return next((i for i in shown if i.visit_id == self._removable), None)

    def _remove_shown(self) -> None:
        image = self._removable_shown()
        if image is not None and self._remove is not None:
            self.close_sheet()
            self._remove(image.id)


def pair_of(images: Sequence[DermoscopicImage], chosen: int | None) -> tuple[int, int]:
    """Indices of the two images to begin with, the earlier one first."""
    last = len(images) - 1
    if chosen is None:
        return max(last - 1, 0), last
    at = next(k for k, image in enumerate(images) if image.id == chosen)
    others = [k for k, image in enumerate(images) if image.visit_id != images[at].visit_id]
    other = others[-1] if others else max(at - 1, 0) if at else min(1, last)
    return min(at, other), max(at, other)
