"""Small parts of the visit's screens: a row of choices, a framed picture with its caption."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtWidgets import QButtonGroup, QFrame, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from app.theme import set_state, style_class


def segment(text: str, name: str, *, first: bool, last: bool) -> QPushButton:
    """One button of a row of which one is chosen."""
    button = QPushButton(text)
    button.setObjectName(name)
    button.setCheckable(True)
    style_class(button, "segment")
    set_state(button, "first", "true" if first else "false")
    set_state(button, "last", "true" if last else "false")
    return button


def offer_captures(
    group: QButtonGroup, row: QHBoxLayout, prefix: str, views: Mapping[str, int], shown: int | None
) -> None:
    """Put one button per capture into a row; with one capture alone there is nothing to choose."""
    offered = views if len(views) > 1 else {}
    if [(b.text(), group.id(b)) for b in group.buttons()] == [
        (v.capitalize(), i) for v, i in offered.items()
    ]:
        for button in group.buttons():
            button.setChecked(group.id(button) == shown)
        return
    for button in group.buttons():
        group.removeButton(button)
        row.removeWidget(button)
        button.hide()
        button.deleteLater()
    for i, (view, capture_id) in enumerate(offered.items()):
        button = segment(view.capitalize(), f"{prefix}_{view}", first=i == 0, last=i == len(offered) - 1)
        button.setChecked(capture_id == shown)
        group.addButton(button, capture_id)
        row.addWidget(button)


def framed(view: QWidget, caption_name: str, *, dark: bool = True) -> tuple[QWidget, QLabel]:
    """A picture in a frame with a caption below."""
    holder = QWidget()
    frame = QFrame()
    style_class(frame, "photo" if dark else "card")
    inside = QVBoxLayout(frame)
    inside.setContentsMargins(1, 1, 1, 1 if dark else 8)
    inside.addWidget(view)
    caption = QLabel()
    caption.setObjectName(caption_name)
    style_class(caption, "caption")
    column = QVBoxLayout(holder)
    column.setContentsMargins(0, 0, 0, 0)
    column.setSpacing(4)
    column.addWidget(frame, 1)
    column.addWidget(caption)
    return holder, caption
