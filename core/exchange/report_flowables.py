"""Pieces of a page that reportlab does not have: the body map, pictures with captions, numbered discs."""

from __future__ import annotations

import io
from typing import Any

from PIL import Image as PilImage
from reportlab.lib.units import mm
from reportlab.lib.utils import ImageReader
from reportlab.pdfbase.pdfmetrics import stringWidth
from reportlab.platypus import Flowable

from core.exchange.body_map import BodyMapLayout, layout_body_map, leader_end
from core.exchange.fonts import BOLD
from core.exchange.pictures import jpeg_bytes
from core.exchange.report_data import BodyView
from core.exchange.report_style import GREY, LINE, PALE, TEAL, words

_PRINT_DPI = 220


class NumberDisc(Flowable):  # type: ignore[misc]
    """A lesion's number in a filled disc."""

    def __init__(self, number: int, radius: float = 2.9 * mm, *, filled: bool = True) -> None:
        super().__init__()
        self.number, self.radius, self.filled = number, radius, filled
        self.width = self.height = 2 * radius

    def draw(self) -> None:
        """Paint it."""
        draw_number(self.canv, self.number, self.radius, self.radius, self.radius, filled=self.filled)


def draw_number(canvas: Any, number: int, x: float, y: float, radius: float, *, filled: bool) -> None:
    """A disc with a number at (x, y)."""
    canvas.saveState()
    canvas.setStrokeColor(TEAL)
    canvas.setFillColor(TEAL if filled else "white")
    canvas.setLineWidth(0.13 * radius)
    canvas.circle(x, y, radius * 0.95, stroke=1, fill=1)
    text = str(number)
    font_size = radius * (1.12 if len(text) < 3 else 0.86)
    canvas.setFillColor("white" if filled else TEAL)
    canvas.setFont(BOLD, font_size)
    canvas.drawString(x - stringWidth(text, BOLD, font_size) / 2, y - font_size * 0.355, text)
    canvas.restoreState()


class BodyMap(Flowable):  # type: ignore[misc]
    """A body view with its numbered lesions, lines and numbers drawn as vectors."""

    def __init__(self, view: BodyView, width: float, height: float) -> None:
        super().__init__()
        self.view = view
        self.layout: BodyMapLayout = layout_body_map(
            (view.picture.shape[1], view.picture.shape[0]),
            view.marks,
            box=(width, height),
            label_radius=2.35 * mm,
            region=view.region,
        )
        self.width, self.height = self.layout.size

    def draw(self) -> None:
        """Paint it."""
        canvas, layout = self.canv, self.layout
        x0, y0, x1, y1 = layout.photo
        canvas.drawImage(self._photo(), x0, self.height - y1, x1 - x0, y1 - y0)
        canvas.setStrokeColor(LINE)
        canvas.setLineWidth(0.5)
        canvas.rect(x0, self.height - y1, x1 - x0, y1 - y0, stroke=1, fill=0)
        r = layout.label_radius
        for colour, thickness in (("white", 1.5), (TEAL, 0.7)):
            canvas.setStrokeColor(colour)
            canvas.setLineWidth(thickness)
            for place in layout.labels:
                end = leader_end(place, r)
                canvas.line(place.mark[0], self.height - place.mark[1], end[0], self.height - end[1])
        for place in layout.labels:
            mark = layout.marks[place.index]
            canvas.setStrokeColor("white")
            canvas.setLineWidth(0.9)
            canvas.setFillColor(TEAL)
            canvas.circle(place.mark[0], self.height - place.mark[1], 1.9, stroke=1, fill=1)
            if not mark.settled:
                canvas.setFillColor("white")
                canvas.circle(place.mark[0], self.height - place.mark[1], 0.9, stroke=0, fill=1)
            draw_number(
                canvas, mark.number, place.label[0], self.height - place.label[1], r, filled=mark.settled
            )

    def _photo(self) -> Any:
        x0, _, x1, _ = self.layout.photo
        left, top, right, bottom = self.layout.region
        target = min(right - left, (x1 - x0) / 72 * _PRINT_DPI)
        size = (max(1, round(target)), max(1, round(target * (bottom - top) / (right - left))))
        photo = PilImage.fromarray(self.view.picture).resize(
            size, PilImage.Resampling.LANCZOS, box=self.layout.region
        )
        return ImageReader(io.BytesIO(jpeg_bytes(photo, 88)))


class PictureBox(Flowable):  # type: ignore[misc]
    """A square picture with a caption; without a picture, a quiet box that says what is missing."""

    caption_gap = 1.2 * mm

    def __init__(self, side: float, caption: str, *, jpeg: bytes | None, missing: str = "") -> None:
        super().__init__()
        self.side, self.jpeg = side, jpeg
        self.caption = words(caption, "caption")
        self.missing = words(missing, "caption")
        _, self.caption_height = self.caption.wrap(side, 1000)
        self.width, self.height = side, side + self.caption_gap + self.caption_height

    def draw(self) -> None:
        """Paint it."""
        canvas, side = self.canv, self.side
        bottom = self.height - side
        if self.jpeg is None:
            canvas.setFillColor(PALE)
            canvas.setStrokeColor(LINE)
            canvas.setLineWidth(0.6)
            canvas.setDash(2, 2)
            canvas.roundRect(0, bottom, side, side, 2, stroke=1, fill=1)
            canvas.setDash()
            canvas.setFillColor(GREY)
            _, height = self.missing.wrap(side - 5 * mm, side)
            self.missing.drawOn(canvas, 2.5 * mm, bottom + (side - height) / 2)
        else:
            image = ImageReader(io.BytesIO(self.jpeg))
            width, height = image.getSize()
            scale = side / max(width, height)
            w, h = width * scale, height * scale
            if w < side - 0.5 or h < side - 0.5:
                canvas.setFillColor(PALE)
                canvas.rect(0, bottom, side, side, stroke=0, fill=1)
            canvas.drawImage(image, (side - w) / 2, bottom + (side - h) / 2, w, h)
            canvas.setStrokeColor(LINE)
            canvas.setLineWidth(0.5)
            canvas.rect(0, bottom, side, side, stroke=1, fill=0)
        self.caption.drawOn(canvas, 0, bottom - self.caption_gap - self.caption_height)


class PictureRow(Flowable):  # type: ignore[misc]
    """Up to four picture boxes side by side, in two pairs with a wider gap between them."""

    def __init__(self, boxes: list[PictureBox], gap: float, pair_gap: float) -> None:
        super().__init__()
        self.boxes, self.gap, self.pair_gap = boxes, gap, pair_gap
        self.height = max(box.height for box in boxes)
        self.width = sum(box.width for box in boxes)

    def draw(self) -> None:
        """Paint it."""
        x = 0.0
        for i, box in enumerate(self.boxes):
            box.drawOn(self.canv, x, self.height - box.height)
            x += box.width + (self.pair_gap if i % 2 else self.gap)
