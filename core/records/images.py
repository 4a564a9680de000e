"""Images that people bring along: checked, measured, shown; their bytes are never changed."""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from core.errors import InputError

if TYPE_CHECKING:
    from PIL.Image import Image

LARGEST_BYTES: Final = 200 * 1024 * 1024
LARGEST_PIXELS: Final = 150_000_000
SMALLEST_SIDE: Final = 16
MEDIA_TYPES: Final = {"JPEG": "image/jpeg", "MPO": "image/jpeg", "PNG": "image/png", "TIFF": "image/tiff"}
_TURNS: Final = {
    2: "FLIP_LEFT_RIGHT",
    3: "ROTATE_180",
    4: "FLIP_TOP_BOTTOM",
    5: "TRANSPOSE",
    6: "ROTATE_270",
    7: "TRANSVERSE",
    8: "ROTATE_90",
}
_ADVICE = "Choose a JPEG, PNG or TIFF picture, or export it again from the camera's program."


@dataclass(frozen=True)
class ImageFacts:
    """What an image file is, as it will be seen (after its orientation mark is obeyed)."""

    media_type: str
    width: int
    height: int


_BROKEN = (
    # what the readers of Pillow raise for broken files, besides its own errors (which are OSError)
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    LookupError,
    EOFError,
    ArithmeticError,
    AttributeError,
    RuntimeError,
    MemoryError,
    struct.error,
    zlib.error,
)


def _decoded(data: bytes, draft_side: int | None = None) -> tuple[Image, str]:
    """The whole image inside ``data`` with every pixel decoded, and the name of its format.

    Every way in which the file can be bad is an `InputError`.
    """
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(data), formats=["JPEG", "PNG", "TIFF"])
            width, height = image.size
            file_format = str(image.format)
            if draft_side is not None and file_format in ("JPEG", "MPO"):
                image.draft("RGB", (draft_side, draft_side))  # decodes at a fraction of the size
            if width * height <= LARGEST_PIXELS:
                image.load()
    except Image.DecompressionBombError:
        raise InputError("The picture is too large to be a photograph.", _ADVICE) from None
    except _BROKEN:
        raise InputError("The file is not a readable picture.", _ADVICE) from None
    if width * height > LARGEST_PIXELS:
        raise InputError("The picture is too large to be a photograph.", _ADVICE)
    return image, file_format


def check_image(data: bytes) -> ImageFacts:
    """Check that bytes are a whole JPEG, PNG or TIFF image of a sensible size.

    Every pixel is decoded once, so a truncated file does not pass.

    Raises
    ------
    InputError
        If the bytes are not an image, are cut short, or decode to an absurd size.
    """
    if not data:
        raise InputError("The picture file is empty.", _ADVICE)
    if len(data) > LARGEST_BYTES:
        raise InputError("The picture file is larger than 200 MB.", _ADVICE)
    image, file_format = _decoded(data)
    width, height = image.size
    if min(width, height) < SMALLEST_SIDE:
        raise InputError(f"The picture is only {width} x {height} pixels.", _ADVICE)
    if _orientation(image) in (5, 6, 7, 8):
        width, height = height, width
    return ImageFacts(MEDIA_TYPES[file_format], width, height)


def _orientation(image: Image) -> int:
    """The EXIF orientation mark; 1 (upright) where there is none or it cannot be read."""
    try:
        return int(image.getexif().get(0x0112, 1))
    except _BROKEN:
        return 1


def shown_image(data: bytes, longest_side: int | None = None) -> Image:
    """The image as it should look: upright, sRGB, 8 bits, at most ``longest_side`` pixels.

    Returns
    -------
    PIL.Image.Image
        In mode RGB.
    """
    from PIL import Image

    image, _ = _decoded(data, longest_side)
    turn = _TURNS.get(_orientation(image))
    if turn is not None:
        image = image.transpose(Image.Transpose[turn])
    picture = _to_srgb(_eight_bits(image), image.info.get("icc_profile"))
    if longest_side is not None:
        picture.thumbnail((longest_side, longest_side), Image.Resampling.LANCZOS, reducing_gap=3.0)
    return picture


def thumbnail_png(data: bytes, longest_side: int) -> bytes:
    """A small PNG of an image as it should look."""
    out = io.BytesIO()
    shown_image(data, longest_side).save(out, "PNG", compress_level=1)
    return out.getvalue()


def _eight_bits(image: Image) -> Image:
    import numpy as np
    from PIL import Image

    if image.mode.startswith("I") or image.mode == "F":
        values = np.asarray(image, dtype=float)
        top = 65535.0 if image.mode.startswith("I") and values.max(initial=0.0) > 255 else 255.0
        if image.mode == "F" and values.max(initial=0.0) <= 1.0:
            top = 1.0
        return Image.fromarray((np.clip(values / top, 0, 1) * 255).astype(np.uint8))
    if image.has_transparency_data:
        image = image.convert("RGBA")
        ground = Image.new("RGBA", image.size, "white")
        return Image.alpha_composite(ground, image).convert("RGB")
    return image


def _to_srgb(image: Image, profile: bytes | None) -> Image:
    from PIL import ImageCms

    if profile and image.mode in ("RGB", "L", "CMYK"):
        try:
            source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
            converted = ImageCms.profileToProfile(
                image, source, ImageCms.createProfile("sRGB"), outputMode="RGB"
            )
        except (ImageCms.PyCMSError, OSError, ValueError):
            converted = None  # a broken profile: the pixels are shown as they are
        if converted is not None:
            return converted
    return image.convert("RGB")
