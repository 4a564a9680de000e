"""The body map: a photo with numbered lesions, the numbers in the margins, leader lines between."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.exchange.fonts import picture_font
from core.exchange.label_layout import LabelPlace, place_labels
from core.exchange.pictures import ACCENT, Region
from core.records.records import Pixel


@dataclass(frozen=True)
class BodyMapMark:
    """A lesion on the picture.

    Attributes
    ----------
    number : int
        What is printed.
    pixel : (float, float)
        Where it is in the picture.
    settled : bool
        True if a person marked, confirmed or corrected the place; drawn full, otherwise hollow.
    """

    number: int
    pixel: Pixel
    settled: bool = True


@dataclass(frozen=True)
class BodyMapLayout:
    """A body map ready to be painted, in units of the page or picture, y downward.

    Attributes
    ----------
    size : (float, float)
        Width and height of the whole map.
    photo : Region
        Where the photo lies on the map.
    region : Region
        Which part of the picture is shown there.
    marks : tuple of BodyMapMark
    labels : tuple of LabelPlace
        ``index`` refers to `marks`.
    label_radius : float
    """

    size: tuple[float, float]
    photo: Region
    region: Region
    marks: tuple[BodyMapMark, ...]
    labels: tuple[LabelPlace, ...]
    label_radius: float


def layout_body_map(
    picture_size: tuple[int, int],
    marks: Sequence[BodyMapMark],
    *,
    box: tuple[float, float],
    label_radius: float,
    region: Region | None = None,
) -> BodyMapLayout:
    """Fit photo, marks and labels into ``box`` (width, height); the height may come out smaller.

    Parameters
    ----------
    picture_size : (int, int)
    marks : sequence of BodyMapMark
    box : (float, float)
    label_radius : float
        Radius of a numbered label, in the units of ``box``.
    region : Region, optional
        The part of the picture to show; it grows to hold every mark. Default: the whole picture.
    """
    width, height = picture_size
    for mark in marks:
        if not (-0.5 <= mark.pixel[0] <= width - 0.5 and -0.5 <= mark.pixel[1] <= height - 0.5):
            raise InputError(f"Lesion {mark.number} lies outside the picture.")
    left, top, right, bottom = region or (0.0, 0.0, float(width), float(height))
    for mark in marks:
        u, v = mark.pixel[0] + 0.5, mark.pixel[1] + 0.5
        left, right = min(left, max(0.0, u - 20)), max(right, min(width, u + 20))
        top, bottom = min(top, max(0.0, v - 20)), max(bottom, min(height, v + 20))
    margin = 3.4 * label_radius if marks else 0.0
    scale = min((box[0] - 2 * margin) / (right - left), box[1] / (bottom - top))
    photo_width, photo_height = scale * (right - left), scale * (bottom - top)
    x0 = (box[0] - photo_width) / 2
    photo = (x0, 0.0, x0 + photo_width, photo_height)
    places = place_labels(
        np.array([(x0 + (m.pixel[0] + 0.5 - left) * scale, (m.pixel[1] + 0.5 - top) * scale) for m in marks]),
        left_x=x0 - margin + 1.2 * label_radius,
        right_x=x0 + photo_width + margin - 1.2 * label_radius,
        top=1.1 * label_radius,
        bottom=photo_height - 1.1 * label_radius,
        gap=2.25 * label_radius,
    )
    radius = _fitting_radius(places, label_radius)
    return BodyMapLayout(
        (box[0], photo_height), photo, (left, top, right, bottom), tuple(marks), tuple(places), radius
    )


def _fitting_radius(places: Sequence[LabelPlace], wanted: float) -> float:
    """The label radius, smaller if a column is so full that labels would touch."""
    for side in (True, False):
        ys = sorted(p.label[1] for p in places if p.on_left == side)
        if len(ys) > 1:
            wanted = min(wanted, float(np.diff(ys).min()) / 2.1)
    return wanted


def leader_end(place: LabelPlace, radius: float) -> tuple[float, float]:
    """Where the leader line meets the edge of the label."""
    dx, dy = place.mark[0] - place.label[0], place.mark[1] - place.label[1]
    length = max(float(np.hypot(dx, dy)), 1e-9)
    return place.label[0] + dx / length * radius, place.label[1] + dy / length * radius


def render_body_map(
    picture: NDArray[np.uint8],
    marks: Sequence[BodyMapMark],
    *,
    size: tuple[int, int] = (1400, 1400),
    region: Region | None = None,
) -> bytes:
    """The body map as a PNG at most ``size`` large.

    Parameters
    ----------
    picture : ndarray (h, w, 3) uint8
        RGB.
    marks : sequence of BodyMapMark
    size : (int, int)
    region : Region, optional
        The part of the picture to show; it grows to hold every mark.
    """
    from PIL import Image, ImageDraw

    fine = 2  # drawn larger and reduced: smooth lines
    radius = max(11.0, min(size) / 75) * fine
    layout = layout_body_map(
        (picture.shape[1], picture.shape[0]),
        marks,
        box=(size[0] * fine, size[1] * fine),
        label_radius=radius,
        region=region,
    )
    canvas = Image.new("RGB", (round(layout.size[0]), round(layout.size[1])), "white")
    x0, y0, x1, y1 = (round(v) for v in layout.photo)
    photo = Image.fromarray(picture).resize(
        (max(1, x1 - x0), max(1, y1 - y0)), Image.Resampling.BICUBIC, box=layout.region
    )
    canvas.paste(photo, (x0, y0))
    draw = ImageDraw.Draw(canvas)
    r = layout.label_radius
    for place in layout.labels:
        end = leader_end(place, r)
        draw.line([place.mark, end], fill="white", width=max(3, round(r * 0.22)))
        draw.line([place.mark, end], fill=ACCENT, width=max(2, round(r * 0.11)))
    font = picture_font(max(8, round(r * 0.95)))
    for place in layout.labels:
        mark = layout.marks[place.index]
        dot = r * 0.3
        _disc(draw, place.mark, dot * 1.45, "white")
        _disc(draw, place.mark, dot, ACCENT if mark.settled else "white", ACCENT, round(r * 0.12))
        fill, ink = (ACCENT, "white") if mark.settled else ("white", ACCENT)
        _disc(draw, place.label, r, fill, ACCENT, max(2, round(r * 0.1)))
        draw.text(place.label, str(mark.number), font=font, fill=ink, anchor="mm")
    out = io.BytesIO()
    canvas.resize((canvas.width // fine, canvas.height // fine), Image.Resampling.LANCZOS).save(out, "PNG")
    return out.getvalue()


def _disc(
    draw: object,
    centre: tuple[float, float],
    radius: float,
    fill: object,
    outline: object = None,
    width: int = 1,
) -> None:
    box = (centre[0] - radius, centre[1] - radius, centre[0] + radius, centre[1] + radius)
    draw.ellipse(box, fill=fill, outline=outline, width=width)  # type: ignore[attr-defined]
