"""From a stream of live frames to one capture: the burst."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from core.calibration.profile import CalibrationProfile
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import WorkError
from core.progress import Progress, no_progress
from devices.live import LiveFrame

FRAME_TIMEOUT_S = 3.0

LatestFrame = Callable[[int, float], LiveFrame | None]
"""`devices.live.LiveCamera.latest`."""


@dataclass(frozen=True, eq=False)
class Burst:
    """Successive frames of one stance.

    Attributes
    ----------
    depth : ndarray (n, h, w) uint16
    depth_unit_m : float
    times_s : ndarray (n,)
        Of the depth frames, on the clock of `time.monotonic`.
    rgb : ndarray (h', w', 3) uint8 or None
        The colour picture nearest to the middle of the burst.
    color_time_s : float
    """

    depth: NDArray[np.uint16]
    depth_unit_m: float
    times_s: NDArray[np.float64]
    rgb: NDArray[np.uint8] | None
    color_time_s: float

    @property
    def middle_s(self) -> float:
        """Time in the middle of the burst."""
        return float(0.5 * (self.times_s[0] + self.times_s[-1]))


def collect_burst(
    latest: LatestFrame,
    frames: int,
    progress: Progress = no_progress,
    *,
    timeout_s: float = FRAME_TIMEOUT_S,
) -> Burst:
    """Take the next ``frames`` depth frames from now on.

    Parameters
    ----------
    latest : callable
        `LiveCamera.latest`.

    Raises
    ------
    WorkError
        If no frame comes for ``timeout_s``, or the camera is gone.
    Cancelled
        Through ``progress``.
    """
    newest = latest(0, 0.0)
    number = 0 if newest is None else newest.number
    taken: list[LiveFrame] = []
    colors: list[tuple[float, NDArray[np.uint8]]] = []
    while len(taken) < frames:
        progress(len(taken) / frames, f"Frame {len(taken) + 1} of {frames}")
        frame = latest(number, timeout_s)
        if frame is None:
            raise WorkError(
                "The camera has stopped delivering frames.",
                "Check its cable; unplug and reconnect it, then try again.",
            )
        number = frame.number
        if frame.depth is not None:
            taken.append(frame)
        if frame.rgb is not None:
            colors.append((frame.color_time_s, frame.rgb))
    progress(1.0, f"Frame {frames} of {frames}")
    times = np.array([frame.time_s for frame in taken])
    middle = 0.5 * (times[0] + times[-1])
    nearest = min(colors, key=lambda c: abs(c[0] - middle)) if colors else None
    return Burst(
        np.stack([frame.depth for frame in taken if frame.depth is not None]),
        taken[0].depth_unit_m,
        times,
        None if nearest is None else nearest[1],
        0.0 if nearest is None else nearest[0],
    )


def assemble_capture(
    burst: Burst,
    rig: CameraRig,
    *,
    sensor: str = "",
    profile: CalibrationProfile | None = None,
    warnings: tuple[str, ...] = (),
    taken_at: datetime | None = None,
) -> RgbdCapture:
    """Capture of a burst; the profile's depth correction is applied and the profile kept with it."""
    depth = (
        burst.depth if profile is None else profile.depth_correction.apply(burst.depth, burst.depth_unit_m)
    )
    return RgbdCapture(
        depth_frames=depth,
        depth_unit_m=burst.depth_unit_m,
        rig=rig if burst.rgb is not None else CameraRig(rig.depth),
        color=burst.rgb,
        taken_at=taken_at or datetime.now(UTC),
        warnings=warnings,
        sensor=sensor,
        calibration=None if profile is None else profile.document(),
    )
