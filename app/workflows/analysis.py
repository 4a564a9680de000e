"""Captures and what was computed from them: surface, joints, anchors. Long work, done in a worker."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Literal, Protocol, runtime_checkable

from core.capture.rgbd import RgbdCapture
from core.progress import Progress, ScaledProgress, no_progress

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture, SkeletonCalibration, SkeletonTracker
    from devices.camera import DepthCamera

Role = Literal["psi", "working"]
TrackerSource = Callable[[], "SkeletonTracker"]


@dataclass(frozen=True, eq=False)
class NewCapture:
    """A capture that was analysed and not stored yet.

    Attributes
    ----------
    analysed : AnalysedCapture
    role : {"psi", "working"}
    corrections : tuple of str
        What the patient should change, for a psi capture; empty if the stance is good.
    warnings : tuple of str
        Everything else the doctor should know, in sentences.
    """

    analysed: AnalysedCapture
    role: Role
    corrections: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def good(self) -> bool:
        """Whether nothing has to be corrected."""
        return not self.corrections


class CameraOpener(Protocol):
    """Gives the camera with an id (`app.context.CameraSource.open`, `devices.registry.open_device`)."""

    def __call__(self, camera_id: str, /) -> DepthCamera:
        """The camera, perhaps not opened yet."""


@runtime_checkable
class PosablePatient(Protocol):
    """A simulated camera whose patient does as told."""

    def stand(self, stance: str | None = None, view: str | None = None, visit: int | None = None) -> None:
        """Change stance, side or visit; None leaves it as it is."""


def take(
    camera: DepthCamera,
    *,
    view: str | None,
    stance: str | None,
    frames: int,
    progress: Progress = no_progress,
) -> RgbdCapture:
    """Take one capture with an open camera.

    Parameters
    ----------
    camera : DepthCamera
    view, stance : str or None
        What the doctor chose; None keeps what the camera or the recording says.
    frames : int
    progress : Progress
    """
    capture = camera.capture(frames, progress)
    if camera.info.kind == "simulator":
        capture = capture.with_joints(None)
    return replace(
        capture,
        view=capture.view if view is None else view,
        stance=capture.stance if stance is None else stance,
    )


def camera_id_of_path(path: Path) -> str:
    """Camera id of what is on disk: an .oni, .bag or .db3 recording, a capture folder or its capture.json."""
    kinds = {".oni": "recording", ".bag": "realsense-bag", ".db3": "realsense-bag"}
    if kind := kinds.get(path.suffix.lower()):
        return f"{kind}:{path}"
    return f"folder:{path.parent if path.name == 'capture.json' else path}"


def analyse_new(
    capture: RgbdCapture,
    role: Role,
    tracker: TrackerSource,
    *,
    calibration: SkeletonCalibration | None = None,
    progress: Progress = no_progress,
) -> NewCapture:
    """Find body, joints and anchors of a capture; for a psi capture also what to correct."""
    from core.anchors import analyse_capture, check_psi

    analysed = analyse_capture(
        capture, tracker(), calibration=calibration, progress=ScaledProgress(progress, 0.0, 0.95)
    )
    corrections = tuple(check_psi(analysed.skeleton).corrections) if role == "psi" else ()
    return NewCapture(analysed, role, corrections, tuple(dict.fromkeys(analysed.warnings)))


class AnalysisCache:
    """The analysed captures of a visit in memory; the least recently used one goes first.

    Parameters
    ----------
    load : callable
        Capture id to stored capture, bit exact.
    tracker : callable
    size : int
        Captures kept; one of 640 x 480 depth and a 5-megapixel picture needs some 150 MB.
    """

    def __init__(self, load: Callable[[int], RgbdCapture], tracker: TrackerSource, size: int = 6) -> None:
        self._load, self._tracker, self._size = load, tracker, size
        self._kept: OrderedDict[int, AnalysedCapture] = OrderedDict()
        self._lock = Lock()

    def put(self, capture_id: int, analysed: AnalysedCapture) -> None:
        """Keep the analysis of a stored capture."""
        with self._lock:
            self._kept[capture_id] = analysed
            self._kept.move_to_end(capture_id)
            while len(self._kept) > self._size:
                self._kept.popitem(last=False)

    def peek(self, capture_id: int) -> AnalysedCapture | None:
        """Return the analysis if it is in memory; never computes."""
        with self._lock:
            analysed = self._kept.get(capture_id)
            if analysed is not None:
                self._kept.move_to_end(capture_id)
            return analysed

    def get(
        self,
        capture_id: int,
        *,
        calibration: SkeletonCalibration | None = None,
        progress: Progress = no_progress,
    ) -> AnalysedCapture:
        """Return the analysis, computed from the stored capture if need be (seconds: call it in a worker)."""
        from core.anchors import analyse_capture

        analysed = self.peek(capture_id)
        if analysed is None:
            progress(0.0, "Reading the capture")
            analysed = analyse_capture(
                self._load(capture_id), self._tracker(), calibration=calibration, progress=progress
            )
            self.put(capture_id, analysed)
        return analysed
