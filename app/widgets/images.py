"""NumPy pictures to Qt pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QColorSpace, QImage

from core.errors import InputError


def to_qimage(rgb: NDArray[np.uint8]) -> QImage:
    """A QImage of its own memory from RGB (h, w, 3), RGBA (h, w, 4) or grey (h, w), uint8."""
    array = np.ascontiguousarray(rgb, dtype=np.uint8)
    height, width = array.shape[:2]
    formats = {2: QImage.Format.Format_Grayscale8}
    if array.ndim == 3:
        formats = {
            3: QImage.Format.Format_RGB888 if array.shape[2] == 3 else QImage.Format.Format_RGBA8888,
        }
    return QImage(array.data, width, height, array.strides[0], formats[array.ndim]).copy()


def image_from_bytes(data: bytes) -> QImage:
    """Decode an image file; an embedded colour profile is converted to sRGB.

    Raises
    ------
    InputError
        If the bytes are not an image.
    """
    image = QImage.fromData(data)
    if image.isNull():
        raise InputError("This file is not an image GeoDerm can read.", "Choose a JPEG, PNG or TIFF picture.")
    space = image.colorSpace()
    if space.isValid() and space != QColorSpace(QColorSpace.NamedColorSpace.SRgb):
        image.convertToColorSpace(QColorSpace(QColorSpace.NamedColorSpace.SRgb))
    return image
