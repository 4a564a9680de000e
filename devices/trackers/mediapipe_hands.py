"""MediaPipe's hand landmarker (Tasks API): 21 landmarks of a hand, on this computer.

Two forms of one thing. `MediaPipeHands` looks at every picture for itself. `HandFollower` follows a hand from
picture to picture: it looks for a palm only where it has lost the hand, and costs less than half.
"""

from __future__ import annotations

import atexit
import contextlib
import threading
import weakref
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from core.errors import WorkError
from core.hand.landmarks import LANDMARKS, HandLandmarks
from devices.trackers.mediapipe_library import LandmarkerKind, open_landmarker, quiet

MODEL: Final = "hand_landmarker_full.task"

_STEP_MS: Final = 33
_SIDES: Final[dict[str, Literal["L", "R"]]] = {"Left": "L", "Right": "R"}

_open: Final[weakref.WeakSet[MediaPipeHands]] = weakref.WeakSet()
_open_lock: Final = threading.Lock()


def _create(vision: Any, base: Any, mode: Any) -> Any:
    options = vision.HandLandmarkerOptions(base_options=base, running_mode=mode, num_hands=1)
    return vision.HandLandmarker.create_from_options(options)


_HAND: Final = LandmarkerKind(MODEL, "hand detector", "hand model", _create)


class MediaPipeHands:
    """21 hand landmarks in single pictures, about 40 ms each. Safe to call from any thread.

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

    name: str = "MediaPipe Hands"

    _mode: Literal["IMAGE", "VIDEO"] = "IMAGE"

    def __init__(self, model: Path | None = None) -> None:
        self._lock = threading.Lock()
        self._landmarker: Any | None = None
        self._warm = False
        with quiet():
            self._picture, self._landmarker, said = open_landmarker(_HAND, self._mode, model)
            with _open_lock:
                _open.add(self)
            try:
                self.detect(np.zeros((64, 64, 3), np.uint8))
            except (RuntimeError, ValueError, OSError) as error:
                self.close()
                raise WorkError(f"{said}: {error}") from error

    def detect(self, rgb: NDArray[np.uint8]) -> HandLandmarks | None:
        """Landmarks of the most prominent hand, or None.

        Parameters
        ----------
        rgb : ndarray (h, w, 3) uint8

        Raises
        ------
        WorkError
            If the detector has been closed.
        """
        with self._lock:
            if self._landmarker is None:
                raise WorkError("The hand detector has been closed.")
            image = self._picture(rgb)
            # the native code has something to say when it sees its first hand, then never again
            with contextlib.nullcontext() if self._warm else quiet():
                found = self._look(self._landmarker, image)
            self._warm = self._warm or bool(found.hand_landmarks)
        return _landmarks_of(found, rgb.shape[1], rgb.shape[0])

    def _look(self, landmarker: Any, image: Any) -> Any:
        return landmarker.detect(image)

    def close(self) -> None:
        """Release the native part; twice does nothing. What was forgotten is closed before the end."""
        with self._lock:
            landmarker, self._landmarker = self._landmarker, None
        if landmarker is not None:
            landmarker.close()


class HandFollower(MediaPipeHands):
    """21 hand landmarks in successive pictures of one camera, about 20 ms each.

    Each follower keeps its own memory of where the hand was. A hand that is lost, or has jumped away, is
    looked for again in the same picture, so that nothing is missed that `MediaPipeHands` sees. A new hand
    is looked at twice, the second time where its landmarks are: of 60 rendered bare hands, 1 instead of 3 was
    then taken for the other hand.

    Parameters
    ----------
    model : Path, optional

    Raises
    ------
    InputError, WorkError
        As `MediaPipeHands`.
    """

    name: str = "MediaPipe Hands, following"

    _mode = "VIDEO"

    def __init__(self, model: Path | None = None) -> None:
        self._now_ms = 0
        self._followed = False
        super().__init__(model)

    def _look(self, landmarker: Any, image: Any) -> Any:
        found = self._next(landmarker, image)
        if self._followed and not found.hand_landmarks:
            self._followed = False
            found = self._next(landmarker, image)
        if found.hand_landmarks and not self._followed:
            again = self._next(landmarker, image)
            found = again if again.hand_landmarks else found
        self._followed = bool(found.hand_landmarks)
        return found

    def forget(self) -> None:
        """Make the next picture the first: for pictures that do not follow each other."""
        self.detect(np.zeros((64, 64, 3), np.uint8))

    def _next(self, landmarker: Any, image: Any) -> Any:
        # the library wants rising times and uses them for nothing else: it does not smooth hands
        self._now_ms += _STEP_MS
        return landmarker.detect_for_video(image, self._now_ms)


def _landmarks_of(found: Any, width: int, height: int) -> HandLandmarks | None:
    """The first hand of the library's answer, in pixels."""
    if not found.hand_landmarks:
        return None
    points, side = found.hand_landmarks[0], found.handedness[0][0]
    if len(points) != LANDMARKS:
        raise WorkError(f"The hand model gives {len(points)} landmarks instead of {LANDMARKS}.")
    # normalised 0..1 runs over pixel edges; pixel centres are at integer coordinates here
    pixels = np.array([(p.x * width - 0.5, p.y * height - 0.5) for p in points])
    return HandLandmarks(
        pixels,
        np.array([float(p.z) for p in points]),
        _SIDES[side.category_name],
        float(side.score),
        np.array([(p.x, p.y, p.z) for p in found.hand_world_landmarks[0]]),
    )


def close_hand_detectors() -> None:
    """Close every detector that is still open: the native part must not outlive the interpreter."""
    with _open_lock:
        detectors = list(_open)
        _open.clear()
    for detector in detectors:
        detector.close()


atexit.register(close_hand_detectors)
