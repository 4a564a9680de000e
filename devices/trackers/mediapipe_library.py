"""MediaPipe's Tasks library as every tracker of this package needs it: quiet, and without the network.

The library is loaded with the first tracker, not with this module. Two of its habits are unfit for a clinic
and are switched off here: it writes to standard error from native code, and it reports its use to its maker
over the network.
"""

from __future__ import annotations

import contextlib
import logging
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError, WorkError
from resources import resource_path

_log = logging.getLogger(__name__)

_NO_NETWORK: Final = {"https_proxy": "none://disabled", "http_proxy": "none://disabled", "no_proxy": ""}
"""A proxy scheme that libcurl refuses before it opens any connection."""


@dataclass(frozen=True)
class LandmarkerKind:
    """One of the library's landmarkers.

    Attributes
    ----------
    model : str
        File among the shipped models.
    tracker, what : str
        Words for messages: "skeleton tracker", "pose model".
    create : callable
        Makes the landmarker from the library's ``vision`` module, base options and running mode.
    """

    model: str
    tracker: str
    what: str
    create: Callable[[Any, Any, Any], Any]


def open_landmarker(
    kind: LandmarkerKind, mode: str, model: Path | None = None
) -> tuple[Callable[..., Any], Any, str]:
    """Load the library and a model.

    Parameters
    ----------
    kind : LandmarkerKind
    mode : {"IMAGE", "VIDEO"}
        Single pictures, or successive pictures of one person.
    model : Path, optional
        A ``.task`` bundle; by default the one that is shipped.

    Returns
    -------
    tuple
        What makes the library's picture of an RGB array, the landmarker, and how to begin the message if it
        fails with its first picture.

    Raises
    ------
    InputError
        If the model cannot be read.
    WorkError
        If the library is missing or refuses to start.
    """
    path = resource_path("models", kind.model) if model is None else model
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: the {kind.what} cannot be read ({error.strerror}).") from error
    said = f"The {kind.tracker} could not start with {path.name}"
    with quiet():
        _forbid_network()
        try:
            import mediapipe
            from mediapipe.tasks.python import BaseOptions, vision
        except ImportError as error:
            raise WorkError(
                f"The {kind.tracker}'s library (mediapipe) is not installed.", "Run 'make setup' again."
            ) from error
        try:
            landmarker = kind.create(vision, BaseOptions(model_asset_buffer=data), vision.RunningMode[mode])
        except (RuntimeError, ValueError, OSError) as error:
            raise WorkError(f"{said}: {error}") from error

    def picture(rgb: NDArray[np.uint8]) -> Any:
        if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8:
            raise ValueError("a tracker needs an RGB picture of 8 bits")
        return mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=np.ascontiguousarray(rgb))

    return picture, landmarker, said


def _forbid_network() -> None:
    """Keep the library's usage reports in this computer.

    The native library posts statistics through its own libcurl and offers no switch. `os.putenv` changes the
    C environment that libcurl reads and leaves `os.environ` alone, so that Python code is not affected.
    """
    for name, value in _NO_NETWORK.items():
        os.putenv(name, value)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Send what native code writes to standard error to the log (level debug) instead."""
    try:
        sys.stderr.flush()
        kept = os.dup(2)
    except (OSError, AttributeError):  # a windowed program may have no standard error at all
        yield
        return
    with tempfile.TemporaryFile() as sink:
        os.dup2(sink.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            sink.seek(0)
            for line in sink.read().decode("utf-8", "replace").splitlines():
                _log.debug("%s", line)
