"""Figures of a row: errors, shares and their intervals over bodies."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.evaluation.records import Record
from core.evaluation.scores import LesionScore

FloatArray = NDArray[np.float64]

NAN = float("nan")
FAR_M = 0.1
NEAR_M = 0.01

Scored = tuple[str, LesionScore]
"""A body and one of its lesions."""


@dataclass(frozen=True)
class Interval:
    """A figure with the 95 % interval that re-sampling bodies gives. NaN without answers."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Summary:
    """Figures over lesions. Errors are of answers to lesions that the follow-up shows.

    Attributes
    ----------
    bodies, lesions : int
        Bodies, and lesions that the follow-up shows.
    answered, refused : float
        Shares of those lesions.
    mean_mm, p95_mm, within_10mm : Interval
    median_mm : float
    beside_floor_mm : float
        Mean distance to the place that the sensor itself gives for the true pixel.
    floor_mm : float
        Mean error of that place.
    beyond_100mm : int
    wrong_lesion : float
        Share of answers; NaN where no other mole is known.
    wrong_limb : int
    hidden : int
        Lesions that the follow-up does not show.
    hidden_said, hidden_answered : float
        Shares of those that were said to be not visible, and that were given a place all the same.
    false_alarms : float
        Share of the lesions that the follow-up shows and that were said to be not visible.
    in_radius : Interval
        Share of answers whose true place lies within the stated 95 % radius.
    radius_mm : float
        Median.
    in_region : float
        The same share for the stated ellipse; NaN without any.
    """

    bodies: int
    lesions: int
    answered: float
    refused: float
    mean_mm: Interval
    median_mm: float
    p95_mm: Interval
    within_10mm: Interval
    beside_floor_mm: float
    floor_mm: float
    beyond_100mm: int
    wrong_lesion: float
    wrong_limb: int
    hidden: int
    hidden_said: float
    hidden_answered: float
    false_alarms: float
    in_radius: Interval
    radius_mm: float
    in_region: float

    def to_json(self) -> dict[str, Any]:
        """Plain values; null where there is no figure."""
        out: dict[str, Any] = {}
        for name, value in asdict(self).items():
            if isinstance(value, dict):
                out[name] = _plain(value["value"])
                out[f"{name}_interval"] = [_plain(value["low"]), _plain(value["high"])]
            else:
                out[name] = _plain(value)
        return out


@dataclass(frozen=True)
class SpotSummary:
    """Spots listed as new (or vanished) against those that truly are."""

    listed: int
    true: int
    precision: float
    recall: float


def scored(records: Sequence[Record], *, healed: bool = False) -> list[Scored]:
    """The lesions of records with their bodies: those that are still there, or the healed sites."""
    return [(r.name.body, s) for r in records for s in r.lesions if s.healed == healed]


def summarise(scores: Sequence[Scored], *, seed: int = 0, draws: int = 500) -> Summary:
    """Figures of one row."""
    seen = [(b, s) for b, s in scores if s.visible]
    hidden = [s for _, s in scores if not s.visible]
    answers = [(b, s) for b, s in seen if s.error_m is not None]
    errors = [(b, 1000.0 * s.error_m) for b, s in answers if s.error_m is not None]
    stated = [
        (b, float(s.error_m <= s.radius95_m))
        for b, s in answers
        if s.error_m is not None and s.radius95_m is not None
    ]
    return Summary(
        bodies=len({b for b, _ in scores}),
        lesions=len(seen),
        answered=_share([s.answered for _, s in seen]),
        refused=_share([s.status == "refused" for _, s in seen]),
        mean_mm=_mean_interval(errors, seed, draws),
        median_mm=_of([e for _, e in errors], np.median),
        p95_mm=_p95_interval(errors, seed, draws),
        within_10mm=_mean_interval([(b, float(e < 1000 * NEAR_M)) for b, e in errors], seed, draws),
        beside_floor_mm=_mean_mm([s.beside_floor_m for _, s in answers]),
        floor_mm=_mean_mm([s.floor_m for _, s in answers]),
        beyond_100mm=sum(e > 1000 * FAR_M for _, e in errors),
        wrong_lesion=_share([s.wrong_lesion for _, s in answers if s.wrong_lesion is not None]),
        wrong_limb=sum(bool(s.wrong_limb) for _, s in answers),
        hidden=len(hidden),
        hidden_said=_share([s.status == "not_visible" for s in hidden]),
        hidden_answered=_share([s.answered for s in hidden]),
        false_alarms=_share([s.status == "not_visible" for _, s in seen]),
        in_radius=_mean_interval(stated, seed, draws),
        radius_mm=_of([1000.0 * s.radius95_m for _, s in answers if s.radius95_m is not None], np.median),
        in_region=_share([s.in_region for _, s in answers if s.in_region is not None]),
    )


def summarise_spots(records: Sequence[Record], which: str) -> SpotSummary | None:
    """Precision and recall of "new_spots" or "vanished_spots"; None where nothing is known."""
    known = [s for s in (getattr(r, which) for r in records) if s is not None]
    if not known:
        return None
    listed, true, right = (sum(getattr(s, name) for s in known) for name in ("listed", "true", "right"))
    return SpotSummary(listed, true, right / listed if listed else NAN, right / true if true else NAN)


def median_seconds(records: Sequence[Record]) -> float:
    """Median time of a relocation; NaN without any."""
    return _of([r.seconds for r in records if not r.failure], np.median)


def _mean_interval(values: Sequence[tuple[str, float]], seed: int, draws: int) -> Interval:
    """A mean and its 95 % interval, bodies drawn with replacement."""
    groups = _by_body(values)
    if not groups:
        return Interval(NAN, NAN, NAN)
    sums = np.array([[group.sum(), len(group)] for group in groups])
    totals = sums[_draw(len(groups), seed, draws)].sum(axis=1)
    low, high = np.percentile(totals[:, 0] / totals[:, 1], [2.5, 97.5])
    return Interval(float(sums[:, 0].sum() / sums[:, 1].sum()), float(low), float(high))


def _p95_interval(values: Sequence[tuple[str, float]], seed: int, draws: int) -> Interval:
    """The 95th percentile and its interval, likewise."""
    groups = _by_body(values)
    if not groups:
        return Interval(NAN, NAN, NAN)
    drawn = [
        np.percentile(np.concatenate([groups[k] for k in row]), 95) for row in _draw(len(groups), seed, draws)
    ]
    low, high = np.percentile(drawn, [2.5, 97.5])
    return Interval(float(np.percentile(np.concatenate(groups), 95)), float(low), float(high))


def _by_body(values: Sequence[tuple[str, float]]) -> list[FloatArray]:
    groups: dict[str, list[float]] = {}
    for body, value in values:
        groups.setdefault(body, []).append(value)
    return [np.array(groups[body]) for body in sorted(groups)]


def _draw(count: int, seed: int, draws: int) -> NDArray[np.int64]:
    return np.random.default_rng(seed).integers(0, count, (draws, count))


def _of(values: Sequence[float], figure: Callable[[FloatArray], np.floating[Any]]) -> float:
    return float(figure(np.array(values))) if values else NAN


def _mean_mm(values: Sequence[float | None]) -> float:
    return _of([1000.0 * v for v in values if v is not None], np.mean)


def _share(values: Sequence[bool | None]) -> float:
    return sum(map(bool, values)) / len(values) if values else NAN


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return None if math.isnan(value) else round(value, 4)
    return value
