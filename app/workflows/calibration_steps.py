"""What a calibration tells while views are collected, and what comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from core.calibration.board import BoardView
from core.calibration.coverage import CameraCoverage
from core.calibration.profile import CalibrationProfile
from core.calibration.solve import RigSolution, ViewResidual
from core.calibration.verdict import Verdict


class Outcome(Enum):
    """What became of a frame."""

    NOTHING = "nothing"
    """No board in sight."""
    REFUSED = "refused"
    """The board was seen, but this view is not worth keeping; the message says why."""
    HOLD = "hold"
    """Good so far: hold still a moment longer."""
    ADDED = "added"
    """A view was added."""


@dataclass(frozen=True, eq=False)
class Step:
    """What happened to one frame.

    Attributes
    ----------
    outcome : Outcome
    message : str
        For the person with the board.
    infrared, color : BoardView or None
        Corners found in this frame, to draw over the pictures.
    """

    outcome: Outcome
    message: str
    infrared: BoardView | None = None
    color: BoardView | None = None


@dataclass(frozen=True, eq=False)
class Coverage:
    """Coverage of both cameras.

    Attributes
    ----------
    infrared : CameraCoverage
    color : CameraCoverage or None
        None for a rig without a colour camera.
    """

    infrared: CameraCoverage
    color: CameraCoverage | None

    @property
    def cameras(self) -> list[CameraCoverage]:
        """Of the cameras there are."""
        return [self.infrared] if self.color is None else [self.infrared, self.color]

    @property
    def share(self) -> float:
        """How much of what is wanted is there, 0 to 1."""
        return min(c.share for c in self.cameras)

    def missing(self) -> list[str]:
        """What to ask for, most important first."""
        return list(dict.fromkeys(text for pair in _zip(self.cameras) for text in pair))


def _zip(cameras: Sequence[CameraCoverage]) -> list[list[str]]:
    lists = [c.missing() for c in cameras]
    return [[part[k] for part in lists if k < len(part)] for k in range(max(map(len, lists), default=0))]


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """Outcome of `CalibrationSession.solve`.

    Attributes
    ----------
    profile : CalibrationProfile
        Not saved yet.
    verdict : Verdict
    views : tuple of ViewResidual
    solution : RigSolution
    """

    profile: CalibrationProfile
    verdict: Verdict
    views: tuple[ViewResidual, ...]
    solution: RigSolution
