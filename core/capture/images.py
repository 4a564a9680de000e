"""Reading and writing the image files of a capture: a damaged or foreign file is never half-read."""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from core.capture.fields import read_bytes
from core.errors import InputError

_MAX_IMAGE_BYTES = 500_000_000
_COLOR_FORMATS = ("PNG", "JPEG", "TIFF")
_COLOR_MODES = ("RGB", "RGBA", "RGBX", "L", "LA", "P", "CMYK", "YCbCr")

# What Pillow's decoders raise on damaged data.
_DECODE_ERRORS = (
    UnidentifiedImageError,
    Image.DecompressionBombError,
    OSError,
    ValueError,
    SyntaxError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    OverflowError,
    ZeroDivisionError,
    NotImplementedError,
    RuntimeError,
    EOFError,
    MemoryError,
    struct.error,
    zlib.error,
)


def read_depth_png(path: Path, size: tuple[int, int], field: str) -> NDArray[np.uint16]:
    """A 16-bit grey PNG as (height, width) array.

    Parameters
    ----------
    size : (width, height)
        What the intrinsics say; another size is refused before any pixel is decoded.
    field : str
        Where the file is named, for messages.
    """
    image = _decode(path, ("PNG",), size, field, ("I;16", "I;16B", "I;16L", "I"))
    return np.ascontiguousarray(np.asarray(image), dtype=np.uint16)


def read_color_image(path: Path, size: tuple[int, int], field: str) -> NDArray[np.uint8]:
    """A PNG, JPEG or TIFF as (height, width, 3) RGB."""
    image = _decode(path, _COLOR_FORMATS, size, field, _COLOR_MODES)
    return np.ascontiguousarray(np.asarray(image.convert("RGB")), dtype=np.uint8)


def png_bytes(pixels: NDArray[np.uint16] | NDArray[np.uint8]) -> bytes:
    """A lossless PNG of a 16-bit grey or 8-bit RGB image, compressed for speed."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(buffer, "PNG", compress_level=2)
    return buffer.getvalue()


def _decode(
    path: Path, formats: tuple[str, ...], size: tuple[int, int], field: str, modes: tuple[str, ...]
) -> Image.Image:
    data = read_bytes(path, _MAX_IMAGE_BYTES)
    kinds = " or ".join(formats)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            image = Image.open(io.BytesIO(data), formats=formats)
        except _DECODE_ERRORS as error:
            raise InputError(
                f"{path}: {field} is not a readable {kinds} image.", "Export the capture again."
            ) from error
        if image.size != size:
            raise InputError(
                f"{path}: {field} is {image.size[0]} x {image.size[1]} pixels, but its intrinsics say "
                f"{size[0]} x {size[1]}.",
                "Use the calibration of this image size.",
            )
        if image.mode not in modes:
            depth = modes[0] == "I;16"
            wanted = "a 16-bit grey image" if depth else "an 8-bit colour image"
            advice = (
                "Save depth without conversion to 8 bit or colour." if depth else "Convert it to 8-bit RGB."
            )
            raise InputError(
                f"{path}: {field} must be {wanted}, but has pixels of type {image.mode}.", advice
            )
        try:
            image.load()
        except _DECODE_ERRORS as error:
            raise InputError(
                f"{path}: {field} is damaged or truncated ({error}).", "Copy or export the file again."
            ) from error
    return image
