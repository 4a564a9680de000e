"""What the live service tells: pictures to paint, and how the camera is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from PySide6.QtGui import QImage

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Kind = Literal["idle", "streaming", "stalled", "gone"]


@dataclass(frozen=True)
class LiveStatus:
    """How the camera is.

    Attributes
    ----------
    kind : {"idle", "streaming", "stalled", "gone"}
        "idle": no camera, or nobody looks.
    message, advice : str
        For the banner; empty while all is well.
    """

    kind: Kind
    message: str = ""
    advice: str = ""


@dataclass(frozen=True, eq=False)
class Shown:
    """One picture, ready to be painted as it is.

    Attributes
    ----------
    image : QImage
        In the size that was asked for; uses the memory of `pixels`.
    pixels : ndarray (h, w, 4) uint8
    source_size : (int, int)
        Width and height of the camera's picture, in whose pixels joints and outlines are given.
    number : int
    time_s : float
    """

    image: QImage
    pixels: NDArray[np.uint8]
    source_size: tuple[int, int]
    number: int
    time_s: float
