"""MediaPipe's pose landmarker (Tasks API) as a skeleton tracker.

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
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from core.anchors.names import LANDMARK_NAMES
from core.anchors.skeleton import PoseLandmarks
from core.errors import InputError, WorkError
from resources import resource_path

_log = logging.getLogger(__name__)

MODEL: Final = "pose_landmarker_full.task"

_NO_NETWORK: Final = {"https_proxy": "none://disabled", "http_proxy": "none://disabled", "no_proxy": ""}
"""A proxy scheme that libcurl refuses before it opens any connection."""


class MediaPipeTracker:
    """33 body landmarks by MediaPipe Pose (full model), on this computer, about 50 ms a picture.

    Parameters
    ----------
    model : Path, optional
        A ``.task`` bundle; by default the one that is shipped.

    Raises
    ------
    InputError
        If the model cannot be read.
    WorkError
        If the library is missing or refuses to start.
    """

    name: Final = "MediaPipe Pose"

    def __init__(self, model: Path | None = None) -> None:
        self._lock = threading.Lock()
        self._landmarker: Any | None = None
        self._warm = False
        with quiet():
            self._picture, self._landmarker, said = start_landmarker("IMAGE", model)
            try:
                self.detect(np.zeros((64, 64, 3), np.uint8))
            except (RuntimeError, ValueError, OSError) as error:
                self.close()
                raise WorkError(f"{said}: {error}") from error

    def detect(self, rgb: NDArray[np.uint8]) -> PoseLandmarks | None:
        """Landmarks of the most prominent person, or None.

        Parameters
        ----------
        rgb : ndarray (h, w, 3) uint8

        Raises
        ------
        WorkError
            If the tracker has been closed.
        """
        with self._lock:
            if self._landmarker is None:
                raise WorkError("The skeleton tracker has been closed.")
            image = self._picture(rgb)
            # the native code has something to say when it sees its first person, then never again
            with contextlib.nullcontext() if self._warm else quiet():
                found = self._landmarker.detect(image).pose_landmarks
            self._warm = self._warm or bool(found)
        return landmarks_of(found, rgb.shape[1], rgb.shape[0])

    def close(self) -> None:
        """Release the native part. It must happen before the interpreter ends."""
        with self._lock:
            landmarker, self._landmarker = self._landmarker, None
        if landmarker is not None:
            landmarker.close()


def start_landmarker(mode: str, model: Path | None = None) -> tuple[Callable[..., Any], Any, str]:
    """Load the library and a pose model.

    Parameters
    ----------
    mode : {"IMAGE", "VIDEO"}
        Single pictures, or successive pictures of one person.
    model : Path, optional

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
    path = resource_path("models", MODEL) if model is None else model
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: the pose model cannot be read ({error.strerror}).") from error
    said = f"The skeleton tracker could not start with {path.name}"
    with quiet():
        _forbid_network()
        try:
            import mediapipe
            from mediapipe.tasks.python import BaseOptions, vision
        except ImportError as error:
            raise WorkError(
                "The skeleton tracker's library (mediapipe) is not installed.", "Run 'make setup' again."
            ) from error
        options = vision.PoseLandmarkerOptions(
            base_options=BaseOptions(model_asset_buffer=data),
            running_mode=vision.RunningMode[mode],
            num_poses=1,
        )
        try:
            landmarker = vision.PoseLandmarker.create_from_options(options)
        except (RuntimeError, ValueError, OSError) as error:
            raise WorkError(f"{said}: {error}") from error

    def picture(rgb: NDArray[np.uint8]) -> Any:
        if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8:
            raise ValueError("a tracker needs an RGB picture of 8 bits")
        return mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=np.ascontiguousarray(rgb))

    return picture, landmarker, said


def landmarks_of(found: Any, width: int, height: int) -> PoseLandmarks | None:
    """The first person of the library's answer, in pixels."""
    if not found:
        return None
    points = found[0]
    if len(points) != len(LANDMARK_NAMES):
        raise WorkError(f"The pose model gives {len(points)} landmarks instead of {len(LANDMARK_NAMES)}.")
    # normalised 0..1 runs over pixel edges; pixel centres are at integer coordinates here
    pixels = np.array([(p.x * width - 0.5, p.y * height - 0.5) for p in points])
    return PoseLandmarks(pixels, np.array([float(p.visibility or 0.0) for p in points]))


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
