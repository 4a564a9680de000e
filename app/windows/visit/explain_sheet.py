"""How a proposed place came about: bands, votes, the biggest cluster and the geodesic paths as pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from PySide6.QtWidgets import QButtonGroup, QFrame, QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from app.theme import style_class
from app.widgets.photo_view import PhotoView
from app.widgets.sheet import Sheet
from app.windows.visit.pieces import segment
from app.windows.visit.side_panel import wrapped

_TEXT = (
    "Distances along the skin to the joints start the search and check its answer: each joint marks a band "
    "of skin at the distance measured at the previous visit, and the place should lie where the bands meet."
)


def show_explanation(
    parent: QWidget,
    number: int,
    pictures: Mapping[str, NDArray[np.uint8]],
    anchors: Sequence[tuple[str, float]] = (),
) -> Sheet:
    """Open the sheet with one tab per picture.

    Parameters
    ----------
    pictures : mapping of str to ndarray (h, w, 3)
        RGB by the tab's title.
    anchors : sequence of (str, float)
        Anchors used, with the spread of each in metres.
    """
    content = QWidget()
    stack = QStackedWidget()
    tabs = QHBoxLayout()
    tabs.setSpacing(0)
    group = QButtonGroup(content)
    for i, (title, picture) in enumerate(pictures.items()):
        button = segment(title, f"explain_tab_{i}", first=i == 0, last=i == len(pictures) - 1)
        button.setChecked(i == 0)
        group.addButton(button, i)
        tabs.addWidget(button)
        view = PhotoView()
        view.setObjectName(f"explain_picture_{i}")
        view.set_image(picture)
        stack.addWidget(view)
    tabs.addStretch(1)
    group.idClicked.connect(stack.setCurrentIndex)
    frame = QFrame()
    style_class(frame, "photo")
    inside = QVBoxLayout(frame)
    inside.setContentsMargins(1, 1, 1, 1)
    inside.addWidget(stack)
    column = QVBoxLayout(content)
    column.setContentsMargins(0, 0, 0, 0)
    column.setSpacing(12)
    column.addLayout(tabs)
    column.addWidget(frame, 1)
    sheet = Sheet(parent, f"Lesion {number}: how the place was found", "explain_sheet", width=None)
    sheet.body.addWidget(wrapped(_TEXT, "secondary", "explain_sheet_text"))
    sheet.body.addWidget(content, 1)
    if anchors:
        sheet.body.addWidget(wrapped(anchors_text(anchors), "caption", "explain_anchors"))
    return sheet.open()


def anchors_text(anchors: Sequence[tuple[str, float]]) -> str:
    """Every anchor with how far its place may be off, for example ``left hand ±12 mm``."""
    parts = (f"{name.replace('_', ' ')} ±{max(1, round(1000 * spread))} mm" for name, spread in anchors)
    return f"Joints used, with the spread of each: {', '.join(parts)}."
