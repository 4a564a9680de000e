"""Pictures cut from captures for the page: the view of a capture, the body in it, a lesion up close."""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.rgbd import RgbdCapture
from core.errors import WorkError
from core.exchange.fonts import picture_font
from core.records.records import Pixel, Point

if TYPE_CHECKING:
    from PIL.Image import Image

ACCENT = (15, 110, 119)
"""The application's teal, #0F6E77."""

_OUTSIDE = (236, 240, 241)

Region = tuple[float, float, float, float]
"""Left, top, right, bottom in picture pixels."""


@dataclass(frozen=True)
class Crop:
    """A lesion up close.

    Attributes
    ----------
    jpeg : bytes
        A square picture with a ring around the lesion.
    width_mm : float or None
        What the picture spans at the lesion's distance, if the distance is known.
    """

    jpeg: bytes
    width_mm: float | None


def shaded_depth(depth: NDArray[np.uint16], unit_m: float, camera: PinholeCamera) -> NDArray[np.uint8]:
    """A grey relief (h, w, 3) of a depth frame, lit from the camera, for captures without colour."""
    z = cv2.medianBlur(depth, 5).astype(np.float32) * unit_m
    known = z > 0
    filled = np.where(known, z, np.float32(np.median(z[known]) if known.any() else 1.0))
    smooth = cv2.bilateralFilter(filled.astype(np.float32), 7, 0.03, 3.0)
    slope_x = np.gradient(smooth, axis=1) * camera.fx / smooth
    slope_y = np.gradient(smooth, axis=0) * camera.fy / smooth
    light = 1.0 / np.sqrt(1.0 + slope_x**2 + slope_y**2)
    grey = np.where(known, 60 + 185 * light, 238).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def body_region(capture: RgbdCapture) -> Region | None:
    """Where the body is in the picture of a capture, with a small margin; None if no body is found."""
    from core.surface.segmentation import segment_body

    camera = capture.rig.depth
    depth = capture.depth_frames[0] * capture.depth_unit_m
    try:
        mask = segment_body(depth, camera).mask
    except WorkError:
        return None
    v, u = np.nonzero(mask)
    points = camera.rays(np.stack([u, v], axis=-1)) * depth[v, u, None]
    pixels = capture.rig.project_to_picture(points)
    pixels = pixels[np.isfinite(pixels).all(axis=1)]
    if not len(pixels):
        return None
    picture = capture.rig.picture_camera
    left, top = np.clip(pixels.min(axis=0), 0, None)
    right, bottom = np.minimum(pixels.max(axis=0), (picture.width, picture.height))
    if right - left < 1 or bottom - top < 1:
        return None
    region = (float(left), float(top), float(right), float(bottom))
    return padded(region, 0.04, (picture.width, picture.height))


def padded(region: Region, share: float, size: tuple[int, int]) -> Region:
    """A region with a margin on each side, kept inside the picture."""
    left, top, right, bottom = region
    pad = share * max(right - left, bottom - top)
    return (
        max(0.0, left - pad),
        max(0.0, top - pad),
        min(float(size[0]), right + pad),
        min(float(size[1]), bottom + pad),
    )


def lesion_crop(
    picture: NDArray[np.uint8],
    pixel: Pixel,
    *,
    mm_per_pixel: float | None,
    span_mm: float = 140.0,
    side: int = 480,
) -> Crop:
    """A square cut of the picture, the lesion ringed in its middle, with a scale bar if scale is known."""
    from PIL import Image

    height, width = picture.shape[:2]
    span = span_mm / mm_per_pixel if mm_per_pixel else width / 12.0 * span_mm / 140.0
    span = float(np.clip(span, 24.0, min(width, height)))
    scale = side / span
    shift = np.array([(side - 1) / 2 - scale * pixel[0], (side - 1) / 2 - scale * pixel[1]])
    cut = cv2.warpAffine(
        picture,
        np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]]),
        (side, side),
        flags=cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=_OUTSIDE,
    )
    painted = Image.alpha_composite(Image.fromarray(cut).convert("RGBA"), _ring(side)).convert("RGB")
    width_mm = None if mm_per_pixel is None else span * mm_per_pixel
    if width_mm is not None:
        _draw_scale(painted, width_mm)
    return Crop(jpeg_bytes(painted), width_mm)


def scale_at(camera: PinholeCamera, point_in_camera_m: Point) -> float | None:
    """Millimetres of skin facing the camera per pixel at a point of the picture camera's frame."""
    z = point_in_camera_m[2]
    return 1000.0 * z / camera.fx if z > 0 else None


def jpeg_bytes(image: Image, quality: int = 90) -> bytes:
    """The picture as JPEG."""
    out = io.BytesIO()
    image.convert("RGB").save(out, "JPEG", quality=quality, optimize=True)
    return out.getvalue()


@lru_cache(maxsize=8)
def _ring(side: int) -> Image:
    """A smooth ring around the middle of a square, drawn three times larger and reduced."""
    from PIL import Image as PilImage
    from PIL import ImageDraw

    fine = side * 3
    ring = PilImage.new("RGBA", (fine, fine), (255, 255, 255, 0))
    draw = ImageDraw.Draw(ring)
    centre, radius = fine / 2, fine * 0.105
    for grow, colour, line in ((0.0, (255, 255, 255, 255), 0.020), (-0.0045, (*ACCENT, 255), 0.011)):
        r = radius + fine * grow
        draw.ellipse(
            (centre - r, centre - r, centre + r, centre + r), outline=colour, width=round(fine * line)
        )
    return ring.resize((side, side), PilImage.Resampling.LANCZOS)


def _draw_scale(image: Image, width_mm: float) -> None:
    from PIL import ImageDraw

    length_mm = next((mm for mm in (200, 100, 50, 20, 10, 5, 2) if mm < 0.3 * width_mm), 1)
    side = image.width
    length = length_mm / width_mm * side
    margin, thick = side * 0.04, max(2, round(side * 0.011))
    y = side - margin - thick
    draw = ImageDraw.Draw(image)
    box = (side - margin - length, y, side - margin, y + thick)
    draw.rectangle((box[0] - 2, box[1] - 2, box[2] + 2, box[3] + 2), fill=(30, 42, 46))
    draw.rectangle(box, fill="white")
    draw.text(
        ((box[0] + box[2]) / 2, y - side * 0.014),
        f"{length_mm} mm",
        font=picture_font(round(side * 0.048)),
        fill="white",
        anchor="mb",
        stroke_width=max(1, side // 200),
        stroke_fill=(30, 42, 46),
    )
