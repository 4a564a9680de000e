"""Errors of answers, and their summaries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.evaluation.cases import EvaluationCase
from core.relocation import LesionStatus, RelocationResult
from core.surface import pick_skin

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class LesionScore:
    """One answer against the truth.

    Attributes
    ----------
    error_m : float or None
        Distance to the true place; None without a point.
    """

    body: str
    status: LesionStatus
    visible: bool
    error_m: float | None
    radius95_m: float | None


@dataclass(frozen=True)
class Summary:
    """A row's figures, over the visible lesions unless named otherwise.

    Attributes
    ----------
    lesions, answered : int
        Visible lesions, and how many of them got a point.
    mean_mm, median_mm, p95_mm : float
        Of the error of answers; NaN without any.
    mean_low_mm, mean_high_mm : float
        95 % bootstrap interval of the mean, re-sampling bodies.
    within_10mm, within_radius : float
        Shares of the answers.
    beyond_100mm : int
    hidden, hidden_said : int
        Lesions that the follow-up does not show, and for how many that was said.
    """

    lesions: int
    answered: int
    mean_mm: float
    median_mm: float
    p95_mm: float
    mean_low_mm: float
    mean_high_mm: float
    within_10mm: float
    beyond_100mm: int
    within_radius: float
    hidden: int
    hidden_said: int


def score_lesions(case: EvaluationCase, result: RelocationResult) -> list[LesionScore]:
    """Compare a result with the truth of its case."""
    out = []
    for truth in case.lesions:
        answer = result[truth.id]
        error = None
        if answer.point_m is not None:
            error = float(np.linalg.norm(answer.point_m - truth.followup_m))
        out.append(LesionScore(case.body, answer.status, truth.visible, error, answer.radius95_m))
    return out


def sensor_floor(case: EvaluationCase) -> list[LesionScore]:
    """Error of the clicked true pixel's own place: no relocation can be measured to be better."""
    out = []
    for truth in case.lesions:
        if not truth.visible:
            continue
        pick = pick_skin(case.followup.scan, truth.followup_pixel)
        error = None
        if pick.point is not None:
            error = float(np.linalg.norm(pick.point.position_m - truth.followup_m))
        out.append(LesionScore(case.body, "found", True, error, None))
    return out


def summarise(scores: Sequence[LesionScore], *, seed: int = 0, draws: int = 500) -> Summary:
    """Figures of one row."""
    seen = [s for s in scores if s.visible]
    hidden = [s for s in scores if not s.visible]
    answered = [s for s in seen if s.error_m is not None]
    errors = 1000.0 * np.array([s.error_m for s in answered if s.error_m is not None])
    radii = [
        s.error_m <= s.radius95_m for s in answered if s.error_m is not None and s.radius95_m is not None
    ]
    low, high = _body_interval(answered, seed, draws)
    some = len(errors) > 0
    return Summary(
        lesions=len(seen),
        answered=len(errors),
        mean_mm=float(errors.mean()) if some else float("nan"),
        median_mm=float(np.median(errors)) if some else float("nan"),
        p95_mm=float(np.percentile(errors, 95)) if some else float("nan"),
        mean_low_mm=low,
        mean_high_mm=high,
        within_10mm=float((errors < 10.0).mean()) if some else float("nan"),
        beyond_100mm=int((errors > 100.0).sum()),
        within_radius=float(np.mean(radii)) if radii else float("nan"),
        hidden=len(hidden),
        hidden_said=sum(s.error_m is None for s in hidden),
    )


def _body_interval(scores: Sequence[LesionScore], seed: int, draws: int) -> tuple[float, float]:
    """95 % interval of the mean error in millimetres, bodies drawn with replacement."""
    by_body: dict[str, list[float]] = {}
    for s in scores:
        if s.error_m is not None:
            by_body.setdefault(s.body, []).append(1000.0 * s.error_m)
    if not by_body:
        return float("nan"), float("nan")
    sums = np.array([[sum(e), len(e)] for e in by_body.values()])
    drawn = np.random.default_rng(seed).integers(0, len(sums), (draws, len(sums)))
    totals = sums[drawn].sum(axis=1)
    low, high = np.percentile(totals[:, 0] / totals[:, 1], [2.5, 97.5])
    return float(low), float(high)
