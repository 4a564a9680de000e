"""Points by a landmark detector on the same frames: what the geodesic points are held against."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.evaluation.hand.frames import TrueFrame
from core.evaluation.hand.scores import FrameScore, pair_errors
from core.evaluation.hand.summaries import Spread, spread
from core.hand.landmark_points import landmark_points
from core.hand.landmarks import HandDetector
from core.hand.names import POINT_NAMES

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

WAYS = ("aligned", "as detected")


@dataclass(frozen=True, eq=False)
class LandmarkScore:
    """What a landmark detector tells of one frame.

    Attributes
    ----------
    name, body : str
        As of the frame.
    visible : ndarray (15,) bool
    told : ndarray (15,) bool
        Points that the lifting takes to be visible.
    error_m : dict of str to ndarray (15,)
        By way of lifting (`WAYS`); of every point, NaN if no hand was found.
    joint_m : dict of str to float
        Median joint-joint error over visible points.
    """

    name: str
    body: str
    visible: BoolArray
    told: BoolArray
    error_m: dict[str, FloatArray]
    joint_m: dict[str, float]


def landmark_scores(frames: Iterable[TrueFrame], detector: HandDetector) -> list[LandmarkScore]:
    """Lift a detector's landmarks in every frame and score them."""
    out = []
    for frame in frames:
        if frame.capture.color is None:
            continue
        found = detector.detect(frame.capture.color)
        told = np.zeros(len(POINT_NAMES), bool)
        errors, joints = {}, {}
        for way in WAYS:
            points = np.full((len(POINT_NAMES), 3), np.nan)
            if found is not None:
                lifted = landmark_points(found, frame.depth_m, frame.capture.rig, aligned=way == "aligned")
                points = lifted.points_m
                told = lifted.visible if way == "aligned" else told
            errors[way] = np.linalg.norm(points - frame.points_m, axis=1)
            between = np.abs(pair_errors(points, frame.points_m, frame.visible))
            known = between[np.isfinite(between)]
            joints[way] = float(np.median(known)) if len(known) else float("nan")
        out.append(LandmarkScore(frame.name, frame.body, frame.visible, told, errors, joints))
    return out


@dataclass(frozen=True)
class Beside:
    """Two ways to the points of the same frames, visible points only.

    Attributes
    ----------
    frames, visible : int
    ours_told, theirs_told : int
        Visible points with an answer.
    ours_mm, ours_p90_mm, theirs_mm, theirs_p90_mm : Spread
        Errors of each one's own answers.
    both : int
        Points that both tell.
    both_ours_mm, both_ours_p90_mm, both_theirs_mm, both_theirs_p90_mm : Spread
        Errors of those.
    nearer : Spread
        Percent of those in which ours is nearer to the truth.
    """

    frames: int
    visible: int
    ours_told: int
    theirs_told: int
    ours_mm: Spread
    ours_p90_mm: Spread
    theirs_mm: Spread
    theirs_p90_mm: Spread
    both: int
    both_ours_mm: Spread
    both_ours_p90_mm: Spread
    both_theirs_mm: Spread
    both_theirs_p90_mm: Spread
    nearer: Spread

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        from dataclasses import asdict

        return asdict(self)


def beside(
    ours: Sequence[FrameScore], theirs: Sequence[LandmarkScore], way: str, *, guessed_visible: bool = False
) -> Beside:
    """Compare on the frames that both have seen.

    Parameters
    ----------
    guessed_visible : bool
        Count only those of their points that they take to be visible; otherwise all.
    """
    by_name = {score.name: score for score in theirs}
    pairs = [(one, by_name[one.name]) for one in ours if one.name in by_name]
    rows: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    for one, other in pairs:
        error = other.error_m[way]
        if guessed_visible:
            error = np.where(other.told, error, np.nan)
        rows.setdefault(one.body, []).append((one.error_m[one.visible], error[one.visible]))
    ours_mm = {body: 1e3 * np.concatenate([a for a, _ in some]) for body, some in rows.items()}
    theirs_mm = {body: 1e3 * np.concatenate([b for _, b in some]) for body, some in rows.items()}
    shared = {body: np.isfinite(ours_mm[body]) & np.isfinite(theirs_mm[body]) for body in rows}
    both_ours = {body: ours_mm[body][shared[body]] for body in rows}
    both_theirs = {body: theirs_mm[body][shared[body]] for body in rows}
    nearer = {body: np.where(both_ours[body] < both_theirs[body], 100.0, 0.0) for body in rows}
    return Beside(
        frames=len(pairs),
        visible=sum(len(v) for v in ours_mm.values()),
        ours_told=sum(int(np.isfinite(v).sum()) for v in ours_mm.values()),
        theirs_told=sum(int(np.isfinite(v).sum()) for v in theirs_mm.values()),
        ours_mm=spread(ours_mm, _median),
        ours_p90_mm=spread(ours_mm, _p90),
        theirs_mm=spread(theirs_mm, _median),
        theirs_p90_mm=spread(theirs_mm, _p90),
        both=sum(int(v.sum()) for v in shared.values()),
        both_ours_mm=spread(both_ours, _median),
        both_ours_p90_mm=spread(both_ours, _p90),
        both_theirs_mm=spread(both_theirs, _median),
        both_theirs_p90_mm=spread(both_theirs, _p90),
        nearer=spread(nearer, lambda values: float(np.mean(values))),
    )


def _median(values: FloatArray) -> float:
    return float(np.median(values))


def _p90(values: FloatArray) -> float:
    return float(np.quantile(values, 0.9))
