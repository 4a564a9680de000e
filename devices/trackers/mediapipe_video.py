"""MediaPipe's pose landmarker following one person from picture to picture.

In this mode the library looks for a person only when it has lost the last one, and steadies the landmarks:
31 instead of 48 ms of computing a picture of 640 x 480, and 0.3 instead of 1.1 pixels of trembling from one
picture to the next (rendered people that sway, with camera noise).
"""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from core.anchors.skeleton import PoseLandmarks
from core.errors import WorkError
from devices.trackers.mediapipe_pose import landmarks_of, quiet, start_landmarker

_USUAL_STEP_S: Final = 1 / 15


class MediaPipeFollower:
    """33 body landmarks in successive pictures. Each follower keeps its own memory of the person.

    Parameters
    ----------
    model : Path, optional
        A ``.task`` bundle; by default the one that is shipped.

    Raises
    ------
    InputError, WorkError
        As `MediaPipeTracker`.
    """

    name: Final = "MediaPipe Pose, following"

    def __init__(self, model: Path | None = None) -> None:
        self._lock = threading.Lock()
        self._landmarker: Any | None = None
        self._warm = False
        self._clock = _RisingClock()
        self._picture, self._landmarker, said = start_landmarker("VIDEO", model)
        try:
            self.follow(np.zeros((64, 64, 3), np.uint8), 0.0)
        except (RuntimeError, ValueError, OSError) as error:
            self.close()
            raise WorkError(f"{said}: {error}") from error

    def follow(self, rgb: NDArray[np.uint8], time_s: float) -> PoseLandmarks | None:
        """Landmarks in the next picture, or None if nobody is seen.

        Parameters
        ----------
        rgb : ndarray (h, w, 3) uint8
        time_s : float
            Of the picture. The library wants rising times: a picture from the past (a recording that begins
            again) counts as the next one.

        Raises
        ------
        WorkError
            If it has been closed.
        """
        with self._lock:
            if self._landmarker is None:
                raise WorkError("The skeleton tracker has been closed.")
            image = self._picture(rgb)
            stamp_ms = self._clock.next_ms(time_s)
            with contextlib.nullcontext() if self._warm else quiet():
                found = self._landmarker.detect_for_video(image, stamp_ms).pose_landmarks
            self._warm = self._warm or bool(found)
        return landmarks_of(found, rgb.shape[1], rgb.shape[0])

    def close(self) -> None:
        """Release the native part. It must happen before the interpreter ends."""
        with self._lock:
            landmarker, self._landmarker = self._landmarker, None
        if landmarker is not None:
            landmarker.close()


class _RisingClock:
    """Milliseconds that always rise, whatever the source's clock does."""

    def __init__(self) -> None:
        self._offset_s = 0.0
        self._last_s = 0.0
        self._last_ms = 0

    def next_ms(self, time_s: float) -> int:
        if time_s < self._last_s:
            self._offset_s += self._last_s - time_s + _USUAL_STEP_S
        self._last_s = time_s
        self._last_ms = max(self._last_ms + 1, round(1000 * (time_s + self._offset_s)))
        return self._last_ms
