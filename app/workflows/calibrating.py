"""Calibrating a rig: collects views of the board from a live camera, solves, judges, keeps the profile.

Without any window; the wizard and ``geoderm calibrate`` both drive it. One thread at a time may use a
session.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from app.workflows.calibration_steps import CalibrationResult, Coverage, Outcome, Step
from core.calibration.board import BoardSpec, BoardView, detect_board, follow_board
from core.calibration.coverage import camera_coverage
from core.calibration.lens import LENS_MODELS, fit_lens
from core.calibration.profile import CalibrationProfile, ProfileStore
from core.calibration.solve import BOARD_SIGMA, solve_rig
from core.calibration.verdict import judge
from core.calibration.views import RigView, is_blurred, is_like, is_moving, view_of
from core.errors import WorkError
from core.progress import Progress, no_progress
from devices.live import CameraIdentity, LiveCamera, LiveFrame, StreamKind

WANTED_VIEWS = 25
LEAST_TO_SOLVE = 6

_ENOUGH_SHARE = 0.8
_STILL_FOR_S = 0.25
_SWITCH_TIMEOUT_S = 8.0
_REPEAT_S = 0.5
_RMS_FROM_VIEWS = 5
_RMS_AT_MOST_VIEWS = 12


@dataclass
class _Seen:
    """Corners of the frames before, and since when they have stood still."""

    view: BoardView | None = None
    still_since_s: float | None = None
    at_s: float = 0.0


@dataclass
class _Pair:
    """A view in the making on a camera that cannot run infrared and colour together."""

    color: BoardView
    frame: LiveFrame
    begun_s: float
    infrared: BoardView | None = None


@dataclass
class CalibrationSession:
    """Collects views of one rig and calibrates it.

    Parameters
    ----------
    identity : CameraIdentity
        Of the camera; the profile is bound to it.
    spec : BoardSpec
        The board as measured.
    together : bool
        Whether infrared and colour run at the same time. If not, the board must be held still while the
        streams change: colour, infrared, and colour again to see that nothing moved. See `start_streams`.
    color : bool
        Whether the rig has a colour camera.
    wanted : int
        Views to collect.
    board_sigma : float
        Relative uncertainty of the board's measured size.
    repeats : bool
        Take views of the same place too, half a second apart: for the daily check.
    """

    identity: CameraIdentity
    spec: BoardSpec
    together: bool = True
    color: bool = True
    wanted: int = WANTED_VIEWS
    board_sigma: float = BOARD_SIGMA
    repeats: bool = False
    _views: list[RigView] = field(default_factory=list)
    _seen: dict[str, _Seen] = field(default_factory=lambda: {"infrared": _Seen(), "color": _Seen()})
    _pair: _Pair | None = None
    _rms: dict[str, float] = field(default_factory=dict)
    _coverage: Coverage | None = None
    _added_s: float = float("-inf")

    @property
    def views(self) -> tuple[RigView, ...]:
        """Views so far."""
        return tuple(self._views)

    @property
    def streams(self) -> frozenset[StreamKind]:
        """What the camera has to stream now; call `LiveCamera.start` whenever this changes."""
        if not self.color:
            return frozenset({"depth", "infrared"})
        if self.together:
            return frozenset({"depth", "color", "infrared"})
        if self._pair is not None and self._pair.infrared is None:
            return frozenset({"depth", "infrared"})
        return frozenset({"depth", "color"})

    def add_frame(self, frame: LiveFrame) -> Step:
        """Look at a frame and keep it as a view if it is a good one; about 50 ms at 640 x 480."""
        infrared = self._find(frame, "infrared")
        color = self._find(frame, "color") if self.color else None
        if self.color and self.together:
            # A board that one camera sees is worth a closer look with the other.
            if infrared is None and color is not None and frame.infrared is not None:
                infrared = detect_board(frame.infrared, self.spec, thorough=True)
            elif color is None and infrared is not None and frame.rgb is not None:
                color = detect_board(frame.rgb, self.spec, thorough=True)
        still = self._stillness(frame, infrared, color)
        if self.color and not self.together:
            return self._alternating(frame, infrared, color, still)
        return self._simultaneous(frame, infrared, color, still)

    def add_view(self, view: RigView) -> None:
        """Add a view without judging it, for example one from a folder."""
        self._views.append(view)
        self._coverage = None

    def remove(self, number: int) -> None:
        """Take a view out again."""
        del self._views[number]
        self._coverage = None
        self._update_rms()

    @property
    def coverage(self) -> Coverage:
        """What the views cover."""
        if self._coverage is None:
            self._coverage = Coverage(
                camera_coverage([v.infrared for v in self._views if v.infrared is not None], self.spec),
                camera_coverage([v.color for v in self._views if v.color is not None], self.spec)
                if self.color
                else None,
            )
        return self._coverage

    @property
    def live_rms_px(self) -> dict[str, float]:
        """Reprojection error of a quick calibration of each camera, ``depth`` and ``color``."""
        return dict(self._rms)

    def missing(self) -> list[str]:
        """What to ask the person for, most important first."""
        return self.coverage.missing()

    def ready(self) -> bool:
        """Whether there are enough views that cover enough; solving is possible from six views on."""
        return len(self._views) >= self.wanted and self.coverage.share >= _ENOUGH_SHARE

    def can_solve(self) -> bool:
        """Whether `solve` can be tried."""
        return len(self._views) >= LEAST_TO_SOLVE

    def solve(self, progress: Progress = no_progress) -> CalibrationResult:
        """Calibrate from the views; some seconds.

        Raises
        ------
        WorkError
            If the views do not determine the rig, with what is missing.
        Cancelled
            Through ``progress``.
        """
        solution = solve_rig(self._views, self.spec, progress, board_sigma=self.board_sigma)
        verdict = judge(solution, self.coverage.cameras)
        profile = CalibrationProfile(
            rig=solution.rig,
            depth_serial=self.identity.depth_serial,
            color_serial=self.identity.color_serial if solution.rig.has_color else "",
            depth_correction=solution.depth_correction,
            sigma=solution.sigma,
            rms_px=solution.rms_px,
            views=solution.used,
            notes=(*solution.notes, *verdict.reasons),
        )
        return CalibrationResult(profile, verdict, solution.views, solution)

    def save(self, store: ProfileStore, result: CalibrationResult) -> CalibrationProfile:
        """Keep the profile as the newest of its rig.

        Raises
        ------
        WorkError
            If the verdict refuses it, or the folder cannot be written.
        """
        if result.verdict.grade == "refused":
            raise WorkError(
                f"This calibration is not good enough to be used. {' '.join(result.verdict.reasons)}",
                ". ".join(result.verdict.missing[:3]) + ".",
            )
        return store.add(result.profile)

    # ------------------------------------------------------------ one frame

    def _find(self, frame: LiveFrame, kind: str) -> BoardView | None:
        image = frame.infrared if kind == "infrared" else frame.rgb
        return None if image is None else follow_board(image, self.spec, self._seen[kind].view)

    def _stillness(
        self, frame: LiveFrame, infrared: BoardView | None, color: BoardView | None
    ) -> dict[str, float]:
        """For how long the board has stood still in each picture, in seconds; negative while it moves."""
        out = {}
        for kind, view in (("infrared", infrared), ("color", color)):
            seen = self._seen[kind]
            if view is None or is_moving(view, seen.view):
                seen.still_since_s = None
            elif seen.still_since_s is None:
                seen.still_since_s = seen.at_s
            seen.view, seen.at_s = view, frame.time_s
            out[kind] = -1.0 if seen.still_since_s is None else frame.time_s - seen.still_since_s
        return out

    def _unfit(self, view: BoardView, still_s: float, name: str) -> str:
        """Why a picture of the board cannot be used; empty if it can."""
        if is_blurred(view):
            return f"The {name} picture is blurred: more light, hold still, or a little farther away."
        if still_s < 0:
            return "Hold the board still."
        if len(view) < 0.4 * self.spec.corner_count:
            return f"Too little of the board is in the {name} picture."
        return ""

    def _repeated(
        self, frame: LiveFrame, infrared: BoardView | None, color: BoardView | None
    ) -> tuple[Outcome, str] | None:
        """What to say where there is a view like this already."""
        if self.repeats:
            soon = frame.time_s - self._added_s < _REPEAT_S
            return (Outcome.HOLD, "Good. Move the board a little, then hold it still.") if soon else None
        for view in self._views:
            pairs = ((infrared, view.infrared), (color, view.color))
            a, b = next(((a, b) for a, b in pairs if a is not None and b is not None), (None, None))
            if a is not None and b is not None and is_like(a, b, self.spec):
                return Outcome.REFUSED, f"There is a view like this already. {self._next_wish()}"
        return None

    def _next_wish(self) -> str:
        if self.repeats:
            return "Move the board to another place and hold it still."
        missing = self.missing()
        return f"{missing[0]}." if missing else "Move on to another place, distance or tilt."

    def _simultaneous(
        self, frame: LiveFrame, infrared: BoardView | None, color: BoardView | None, still: dict[str, float]
    ) -> Step:
        def told(outcome: Outcome, message: str) -> Step:
            return Step(outcome, message, infrared, color)

        if infrared is None and color is None:
            return told(
                Outcome.NOTHING,
                "Hold the board where both cameras see it."
                if self.color
                else "Hold the board before the camera.",
            )
        if infrared is None:
            return told(
                Outcome.REFUSED, "Only the colour camera sees the board: come closer, or toward the middle."
            )
        if self.color and color is None:
            return told(
                Outcome.REFUSED, "Only the infrared camera sees the board: come closer, or toward the middle."
            )
        if why_not := self._repeated(frame, infrared, color):
            return told(*why_not)
        for kind, view, name in (("infrared", infrared, "infrared"), ("color", color, "colour")):
            if view is not None and (why := self._unfit(view, still[kind], name)):
                return told(Outcome.REFUSED, why)
        waited = min(still["infrared"], still["color"] if self.color else still["infrared"])
        if waited < _STILL_FOR_S:
            return told(Outcome.HOLD, "Good. Hold still.")
        self._add(view_of(infrared, color, frame.depth, frame.depth_unit_m), frame)
        return told(Outcome.ADDED, f"View {len(self._views)} of {self.wanted}. {self._next_wish()}")

    def _alternating(
        self, frame: LiveFrame, infrared: BoardView | None, color: BoardView | None, still: dict[str, float]
    ) -> Step:
        def told(outcome: Outcome, message: str) -> Step:
            return Step(outcome, message, infrared, color)

        pair = self._pair
        if pair is not None and frame.time_s - pair.begun_s > _SWITCH_TIMEOUT_S:
            self._pair = None
            return told(
                Outcome.REFUSED,
                "The board was not seen by both cameras in time. Lean it on something and try again.",
            )
        if pair is None:
            if frame.rgb is None:
                return told(Outcome.HOLD, "Wait for the colour picture.")
            if color is None:
                return told(Outcome.NOTHING, "Hold the board before the colour camera.")
            if why_not := self._repeated(frame, None, color):
                return told(*why_not)
            if why := self._unfit(color, still["color"], "colour"):
                return told(Outcome.REFUSED, why)
            if still["color"] < _STILL_FOR_S:
                return told(Outcome.HOLD, "Good. Hold still.")
            self._pair = _Pair(color, frame, frame.time_s)
            return told(Outcome.HOLD, "Hold still: the camera changes to infrared.")
        if pair.infrared is None:
            if frame.infrared is None:
                return told(Outcome.HOLD, "Hold still: the camera changes to infrared.")
            if infrared is None:
                infrared = detect_board(frame.infrared, self.spec, thorough=True)
            if infrared is None:
                return told(Outcome.HOLD, "Hold still: the infrared camera does not see the board yet.")
            if why := self._unfit(infrared, still["infrared"], "infrared"):
                return told(Outcome.HOLD, why)
            pair.infrared = infrared
            return told(Outcome.HOLD, "Hold still: the camera changes back to colour.")
        if frame.rgb is None or color is None:
            return told(Outcome.HOLD, "Hold still: the camera changes back to colour.")
        self._pair = None
        if is_moving(color, pair.color):
            return told(Outcome.REFUSED, "The board moved while the camera changed. Lean it on something.")
        self._add(view_of(pair.infrared, pair.color, pair.frame.depth, pair.frame.depth_unit_m), frame)
        return told(Outcome.ADDED, f"View {len(self._views)} of {self.wanted}. {self._next_wish()}")

    def _add(self, view: RigView, frame: LiveFrame) -> None:
        self.add_view(view)
        self._added_s = frame.time_s
        if not self.repeats:
            self._update_rms()

    def _update_rms(self) -> None:
        """Quick calibration of each camera from an even choice of the views."""
        self._rms = {}
        for name, parts in (
            ("depth", [v.infrared for v in self._views if v.infrared is not None]),
            ("color", [v.color for v in self._views if v.color is not None]),
        ):
            if len(parts) < _RMS_FROM_VIEWS:
                continue
            step = max(1, -(-len(parts) // _RMS_AT_MOST_VIEWS))
            try:
                self._rms[name] = fit_lens(parts[::-1][::step], self.spec, (LENS_MODELS[2],)).rms_px
            except WorkError:
                continue


def start_streams(camera: LiveCamera, *, color: bool = True) -> bool:
    """Start what calibration needs; return whether infrared and colour run together.

    Raises
    ------
    WorkError
        If the camera has no infrared stream: such a camera cannot be calibrated here.
    """
    if not color:
        camera.start(("depth", "infrared"))
        return True
    try:
        camera.start(("depth", "color", "infrared"))
    except WorkError:
        # A Kinect streams either: see that it has infrared at all, then begin with colour.
        camera.start(("depth", "infrared"))
        camera.start(("depth", "color"))
        return False
    return True


__all__ = [
    "LEAST_TO_SOLVE",
    "WANTED_VIEWS",
    "CalibrationResult",
    "CalibrationSession",
    "Coverage",
    "Outcome",
    "Step",
    "start_streams",
]
