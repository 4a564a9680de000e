"""Figures over many frames, with how much they differ from hand to hand."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.evaluation.hand.scores import FrameScore

FloatArray = NDArray[np.float64]

LEAST_BODIES = 4
"""Fewer hands give no interval: then only their own figures are told."""

_DRAWS = 500
_NAN = float("nan")


@dataclass(frozen=True)
class Spread:
    """A figure of several hands.

    Attributes
    ----------
    value : float
        Of all frames together; NaN without any.
    low, high : float
        95 % interval that drawing hands with replacement gives; NaN for fewer than `LEAST_BODIES`.
    by_body : dict of str to float
        The same figure of every hand alone.
    """

    value: float
    low: float
    high: float
    by_body: Mapping[str, float]

    def scaled(self, factor: float) -> Spread:
        """In another unit."""
        bodies = {body: factor * value for body, value in self.by_body.items()}
        return Spread(factor * self.value, factor * self.low, factor * self.high, bodies)

    def __str__(self) -> str:
        if not np.isfinite(self.value):
            return "-"
        if np.isfinite(self.low):
            return f"{self.value:.1f} ({self.low:.1f}-{self.high:.1f})"
        if len(self.by_body) > 1:
            return f"{self.value:.1f} [{' '.join(f'{v:.1f}' for v in self.by_body.values())}]"
        return f"{self.value:.1f}"


def spread(
    values: Mapping[str, FloatArray], figure: Callable[[FloatArray], float], *, seed: int = 0
) -> Spread:
    """A figure of values by hand; NaN among the values does not count.

    Parameters
    ----------
    values : dict of str to ndarray
    figure : function of an ndarray
        Median, for example.
    """
    known = {body: v[np.isfinite(v)] for body, v in values.items()}
    known = {body: v for body, v in known.items() if len(v)}
    if not known:
        return Spread(_NAN, _NAN, _NAN, {})
    groups = list(known.values())
    value = float(figure(np.concatenate(groups)))
    by_body = {body: float(figure(v)) for body, v in known.items()}
    if len(groups) < LEAST_BODIES:
        return Spread(value, _NAN, _NAN, by_body)
    rows = np.random.default_rng(seed).integers(0, len(groups), (_DRAWS, len(groups)))
    drawn = [figure(np.concatenate([groups[k] for k in row])) for row in rows]
    low, high = np.percentile(drawn, [2.5, 97.5])
    return Spread(value, float(low), float(high), by_body)


@dataclass(frozen=True)
class Accuracy:
    """What many answers are worth.

    Attributes
    ----------
    frames : int
    unanswered : int
        Frames without two visible points told.
    outliers : int
        Frames whose median joint-joint error is above `scores.OUTLIER_M`.
    joint_mm : Spread
        Joint-joint error: median over frames of the median over pairs.
    joint_pairs_mm : Spread
        The same over all pairs of all frames.
    joint_sd_mm : Spread
        Standard deviation over time of a pair's joint-joint error, median over pairs.
    path_mm : Spread
        Joint-joint error along the skin; empty if it was not measured.
    point_mm, point_p90_mm : Spread
        Distance of visible told points to the truth: median and 90th percentile.
    visible, visible_told, hidden, hidden_told : int
        Points.
    hidden_mm, hidden_p90_mm : Spread
        Distance of hidden points that were told all the same.
    judged, right, unknown, wrong : int
        Frames that have a configuration, and what was said of it.
    """

    frames: int
    unanswered: int
    outliers: int
    joint_mm: Spread
    joint_pairs_mm: Spread
    joint_sd_mm: Spread
    path_mm: Spread
    point_mm: Spread
    point_p90_mm: Spread
    visible: int
    visible_told: int
    hidden: int
    hidden_told: int
    hidden_mm: Spread
    hidden_p90_mm: Spread
    judged: int
    right: int
    unknown: int
    wrong: int

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self)


def accuracy(scores: Sequence[FrameScore]) -> Accuracy:
    """Summarise the scores of some frames."""
    bodies = by_body(scores)

    def gathered(of_frame: Callable[[FrameScore], FloatArray]) -> dict[str, FloatArray]:
        return {
            body: 1e3 * np.concatenate([np.atleast_1d(of_frame(s)) for s in some])
            for body, some in bodies.items()
        }

    joint = gathered(lambda s: np.array(s.joint_error_m))
    errors = gathered(lambda s: s.visible_error_m)
    hidden = gathered(lambda s: s.hidden_error_m)
    paths = gathered(lambda s: np.array(_median(np.abs(s.path_error_m))))
    deviations = {body: 1e3 * _deviations(some) for body, some in bodies.items()}
    judged = [s for s in scores if s.configuration is not None]
    right = sum(s.told_configuration == s.configuration for s in judged)
    unknown = sum(s.told_configuration is None for s in judged)
    return Accuracy(
        frames=len(scores),
        unanswered=sum(not np.isfinite(s.joint_error_m) for s in scores),
        outliers=sum(s.outlier for s in scores),
        joint_mm=spread(joint, _median),
        joint_pairs_mm=spread(gathered(lambda s: np.abs(s.pair_error_m)), _median),
        joint_sd_mm=spread(deviations, _median),
        path_mm=spread(paths, _median),
        point_mm=spread(errors, _median),
        point_p90_mm=spread(errors, _p90),
        visible=sum(int(s.visible.sum()) for s in scores),
        visible_told=sum(int((s.visible & s.told).sum()) for s in scores),
        hidden=sum(int((~s.visible).sum()) for s in scores),
        hidden_told=sum(int((~s.visible & s.told).sum()) for s in scores),
        hidden_mm=spread(hidden, _median),
        hidden_p90_mm=spread(hidden, _p90),
        judged=len(judged),
        right=right,
        unknown=unknown,
        wrong=len(judged) - right - unknown,
    )


def by_body(scores: Iterable[FrameScore]) -> dict[str, list[FrameScore]]:
    """Scores by hand, in their order."""
    out: dict[str, list[FrameScore]] = {}
    for score in scores:
        out.setdefault(score.body, []).append(score)
    return out


def frames_since_lost(scores: Sequence[FrameScore]) -> list[int]:
    """For every frame of one sequence, for how many frames the anchors have not been found: 0 if they are."""
    out, since = [], 0
    for score in scores:
        since = 0 if score.anchored == "seen" else since + 1
        out.append(since)
    return out


def _deviations(scores: Sequence[FrameScore]) -> FloatArray:
    """Over time, of every pair that was told in at least ten frames."""
    errors = np.array([s.pair_error_m for s in scores])
    often = np.isfinite(errors).sum(axis=0) >= 10
    return np.asarray(np.nanstd(errors[:, often], axis=0))


def _median(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else _NAN


def _p90(values: FloatArray) -> float:
    return float(np.quantile(values, 0.9))
