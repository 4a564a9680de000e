"""MediaPipe's pose landmarker (Tasks API) as a skeleton tracker.

The library is loaded with the first tracker, not with this module.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from core.anchors.names import LANDMARK_NAMES
from core.anchors.skeleton import PoseLandmarks
from core.errors import WorkError
from devices.trackers.mediapipe_library import LandmarkerKind, open_landmarker, quiet

__all__ = ["MODEL", "MediaPipeTracker", "landmarks_of", "quiet", "start_landmarker"]

MODEL: Final = "pose_landmarker_full.task"


def _create(vision: Any, base: Any, mode: Any) -> Any:
    options = vision.PoseLandmarkerOptions(base_options=base, running_mode=mode, num_poses=1)
    return vision.PoseLandmarker.create_from_options(options)


_POSE: Final = LandmarkerKind(MODEL, "skeleton tracker", "pose model", _create)


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
    """Load the library and a pose model; see `devices.trackers.mediapipe_library.open_landmarker`."""
    return open_landmarker(_POSE, mode, model)


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
