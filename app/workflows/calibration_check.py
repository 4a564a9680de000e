"""The daily check of a rig from live frames: ten seconds with the board held up."""

from __future__ import annotations

from app.workflows.calibrating import CalibrationSession
from app.workflows.calibration_steps import Outcome, Step
from core.calibration.board import BoardSpec
from core.calibration.daily_check import CheckResult, DailyCheck
from core.calibration.profile import CalibrationProfile
from devices.live import CameraIdentity, LiveFrame, StreamKind

CHECK_VIEWS = 5


class CheckSession:
    """Collects a few views of a still board and compares them with the profile.

    Parameters
    ----------
    profile : CalibrationProfile
    identity : CameraIdentity
    spec : BoardSpec
    together : bool
        As `CalibrationSession`.
    """

    def __init__(
        self, profile: CalibrationProfile, identity: CameraIdentity, spec: BoardSpec, together: bool = True
    ) -> None:
        self._session = CalibrationSession(
            identity, spec, together, color=profile.rig.has_color, wanted=CHECK_VIEWS, repeats=True
        )
        self._check = DailyCheck(profile, spec)

    @property
    def streams(self) -> frozenset[StreamKind]:
        """What the camera has to stream now."""
        return self._session.streams

    @property
    def views(self) -> int:
        """Views so far."""
        return self._check.views

    def add_frame(self, frame: LiveFrame) -> Step:
        """Look at a frame; about 50 ms at 640 x 480."""
        step = self._session.add_frame(frame)
        if step.outcome is Outcome.ADDED:
            self._check.add(self._session.views[-1])
        return step

    def done(self) -> bool:
        """Whether there are enough views."""
        return self._check.views >= CHECK_VIEWS

    def result(self) -> CheckResult:
        """What the views so far tell; cheap enough to ask after every view."""
        return self._check.result()
