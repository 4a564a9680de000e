"""What is done with the frames: collecting views for a calibration, or the daily check."""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from app.workflows.calibrating import CalibrationSession, Coverage, Step
    from core.calibration.board import BoardView
    from core.calibration.daily_check import CheckResult, DailyCheck
    from devices.live import LiveFrame, StreamKind

CHECK_S = 10.0
CHECK_VIEWS = 6
_ENOUGH_FOR_CHECK = 3


@dataclass(frozen=True)
class ViewRow:
    """A collected view in words."""

    number: int
    place: str
    tilt: str
    distance: str
    cameras: str


@dataclass(frozen=True, eq=False)
class Findings:
    """What is known after a frame; never changed afterwards.

    Attributes
    ----------
    step : Step
    coverage : Coverage
    rms_px : dict of str to float
    rows : tuple of ViewRow
    wanted : int
    can_solve, ready : bool
    pose : (str, float) or None
        Tilt of the board in words and its distance in metres, roughly.
    check : CheckResult or None
        When the daily check is done.
    seconds : float
        For how long the daily check has looked.
    """

    step: Step
    coverage: Coverage
    rms_px: dict[str, float]
    rows: tuple[ViewRow, ...]
    wanted: int
    can_solve: bool
    ready: bool
    pose: tuple[str, float] | None = None
    check: CheckResult | None = None
    seconds: float = 0.0


class FrameWork(Protocol):
    """Looks at one frame after the other, in the feed's thread."""

    @property
    def streams(self) -> Collection[StreamKind]:
        """What the camera has to stream now."""

    def look(self, frame: LiveFrame) -> Findings:
        """Look at a frame."""


@dataclass
class Collecting:
    """Collects views for a calibration."""

    session: CalibrationSession
    _rows: list[ViewRow] = field(default_factory=list)
    _last: tuple[LiveFrame, Step] | None = None

    @property
    def streams(self) -> Collection[StreamKind]:
        """What the camera has to stream now."""
        return self.session.streams

    def look(self, frame: LiveFrame) -> Findings:
        """Look at a frame, and keep the view if it is a good one."""
        step = self.session.add_frame(frame)
        self._last = frame, step
        return self.findings(step)

    def findings(self, step: Step) -> Findings:
        """What is known now."""
        session = self.session
        if len(self._rows) != len(session.views):
            self._rows = [_row(k, v.infrared, v.color, session) for k, v in enumerate(session.views, start=1)]
        return Findings(
            step,
            session.coverage,
            session.live_rms_px,
            tuple(self._rows),
            session.wanted,
            session.can_solve(),
            session.ready(),
            _pose(step.color or step.infrared, session),
        )

    def take(self) -> Findings | None:
        """Keep the last frame as a view although it is not asked for; None before the first frame."""
        from app.workflows.calibrating import Outcome, Step
        from core.calibration.views import view_of

        if self._last is None:
            return None
        frame, seen = self._last
        session = self.session
        if not session.together:
            refusal = "This camera shows infrared or colour at a time: it takes its views itself."
        elif seen.infrared is None or (session.color and seen.color is None):
            refusal = "Both cameras have to see the board." if session.color else "The board is not seen."
        else:
            session.add_view(view_of(seen.infrared, seen.color, frame.depth, frame.depth_unit_m))
            message = f"View {len(session.views)} of {session.wanted} taken."
            return self.findings(Step(Outcome.ADDED, message, seen.infrared, seen.color))
        return self.findings(Step(Outcome.REFUSED, refusal, seen.infrared, seen.color))

    def remove(self, number: int) -> Findings | None:
        """Take view ``number`` (from 1) out again."""
        from app.workflows.calibrating import Outcome, Step

        if not 1 <= number <= len(self.session.views):
            return None
        self.session.remove(number - 1)
        self._rows = []
        return self.findings(Step(Outcome.NOTHING, f"View {number} was removed."))


@dataclass
class Checking:
    """Collects a few views and compares them with the calibration in force."""

    session: CalibrationSession
    check: DailyCheck
    seconds: float = CHECK_S
    _since_s: float = 0.0
    _result: CheckResult | None = None

    @property
    def streams(self) -> Collection[StreamKind]:
        """What the camera has to stream now."""
        return self.session.streams

    def look(self, frame: LiveFrame) -> Findings:
        """Look at a frame; the result comes after some seconds with the board in sight, or enough views."""
        from app.workflows.calibrating import Outcome

        session = self.session
        step = session.add_frame(frame)
        now = time.monotonic()
        if not self._since_s and step.outcome is not Outcome.NOTHING:
            self._since_s = now
        if step.outcome is Outcome.ADDED:
            self.check.add(session.views[-1])
        seconds = now - self._since_s if self._since_s else 0.0
        over = seconds >= self.seconds and self.check.views >= _ENOUGH_FOR_CHECK
        if self._result is None and (over or self.check.views >= CHECK_VIEWS):
            self._result = self.check.result()
        return Findings(
            step, session.coverage, {}, (), CHECK_VIEWS, False, False, None, self._result, seconds
        )


def _pose(view: BoardView | None, session: CalibrationSession) -> tuple[str, float] | None:
    from core.calibration.coverage import tilt_name
    from core.calibration.views import board_pose, guess_camera, tilt_deg

    if view is None:
        return None
    pose = board_pose(view, session.spec, guess_camera(view.size))
    if pose is None:
        return None
    return tilt_name(*tilt_deg(pose)), float(np.linalg.norm(pose.apply(session.spec.centre_m)))


_TILTS = {
    "square": "square",
    "left": "left nearer",
    "right": "right nearer",
    "up": "top nearer",
    "down": "bottom nearer",
}


def _row(
    number: int, infrared: BoardView | None, color: BoardView | None, session: CalibrationSession
) -> ViewRow:
    view = color if color is not None else infrared
    if view is None:
        return ViewRow(number, "", "", "", "")
    place = _place(view)
    pose = _pose(view, session)
    cameras = "both" if infrared is not None and color is not None else "infrared" if infrared else "colour"
    if pose is None:
        return ViewRow(number, place, "", "", cameras)
    return ViewRow(number, place, _TILTS[pose[0]], f"{pose[1]:.1f} m", cameras)


def _place(view: BoardView) -> str:
    u, v = (view.pixels.mean(axis=0) + 0.5) / view.size
    across = ("left", "middle", "right")[min(int(3 * u), 2)]
    down = ("upper", "", "lower")[min(int(3 * v), 2)]
    return f"{down} {across}".strip()
