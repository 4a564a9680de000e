"""One picture file of a still camera: complete or not, its pixels, and when its shutter opened.

The pixels are taken as the sensor delivered them: the EXIF orientation is not applied. A calibration belongs
to the sensor; a picture that is turned because the camera felt itself upright would fall off it.
"""

from __future__ import annotations

import io
import math
import warnings
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image

from devices.auxiliary.camera import MOST_PIXELS

SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff")
_FORMATS = ("JPEG", "PNG", "TIFF")
_MODES = ("RGB", "RGBA", "RGBX", "L", "LA", "P", "CMYK", "YCbCr")
_MOST_BYTES = 250_000_000
_FULL_FRAME_DIAGONAL_MM = 43.267


class Unusable(Exception):
    """This file is no picture that can be used, and why; it may be one that is still being written."""


@dataclass(frozen=True, eq=False)
class PictureFile:
    """A decoded picture.

    Attributes
    ----------
    rgb : ndarray (h, w, 3) uint8
        In the sensor's own orientation.
    exposed_at : float or None
        The camera's own clock at the exposure, seconds since 1970 as that clock has it; None unless the file
        tells it to a fraction of a second.
    focal_px : float or None
        From the 35 mm equivalent focal length.
    model, serial : str
        Of the camera body; empty if the file does not tell.
    turned : bool
        True if the file asks viewers to turn the picture, which was not done.
    """

    rgb: NDArray[np.uint8]
    exposed_at: float | None
    focal_px: float | None
    model: str
    serial: str
    turned: bool


def read_picture(path: Path) -> PictureFile:
    """Read a JPEG, PNG or TIFF file of at most 24 megapixels.

    Raises
    ------
    Unusable
        If it is cut off, damaged, foreign or too large.
    """
    try:
        if not path.is_file():  # a pipe would be waited for
            raise Unusable("not a file")
        if path.stat().st_size > _MOST_BYTES:
            raise Unusable("the file is too large")
        data = path.read_bytes()
    except OSError as error:
        raise Unusable(f"not readable ({error.strerror})") from error
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            image = Image.open(io.BytesIO(data), formats=_FORMATS)
            width, height = image.size
            if width * height > MOST_PIXELS:
                raise Unusable(f"{width} x {height} pixels are more than 24 megapixels")
            if image.mode not in _MODES:
                raise Unusable("not 8 bits per colour; set the camera's program to 8-bit files")
            rgb = np.ascontiguousarray(np.asarray(image.convert("RGB")), dtype=np.uint8)
            exif = image.getexif()
            details = exif.get_ifd(ExifTags.IFD.Exif)
        except Unusable:
            raise
        except Exception as error:
            raise Unusable("damaged, cut off or not a picture") from error
    base = ExifTags.Base
    return PictureFile(
        rgb,
        _exposed_at(details),
        _focal_px(details.get(base.FocalLengthIn35mmFilm), width, height),
        " ".join(f"{exif.get(base.Make, '')} {exif.get(base.Model, '')}".split()),
        str(details.get(base.BodySerialNumber, "")).strip("\0 "),
        exif.get(base.Orientation, 1) not in (0, 1),
    )


def _exposed_at(details: dict[int, object]) -> float | None:
    """DateTimeOriginal with its fraction of a second; the zone does not matter, only differences are used."""
    base = ExifTags.Base
    date, fraction = details.get(base.DateTimeOriginal), details.get(base.SubsecTimeOriginal)
    digits = str(fraction or "").strip("\0 ")
    if not isinstance(date, str) or not digits.isdecimal():
        return None
    try:
        moment = datetime.strptime(date.strip("\0 "), "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
    except ValueError:
        return None
    return moment.timestamp() + float(f"0.{digits}")


def _focal_px(equivalent_mm: object, width: int, height: int) -> float | None:
    try:
        millimetres = float(equivalent_mm)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return None
    if not 8.0 <= millimetres <= 400.0:
        return None
    return millimetres / _FULL_FRAME_DIAGONAL_MM * math.hypot(width, height)
