"""The numbers behind figures 9, 10, 11 and table 2, from the records of one stance."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.anchors import JOINT_NAMES
from core.evaluation.thesis.records import CaptureRecord

FloatArray = NDArray[np.float64]

Grade = Literal["good", "reasonable", "bad"]

GOOD, REASONABLE = 0.95, 2 / 3
"""Share of right votes from which a joint is good, and from which it is reasonable."""


@dataclass(frozen=True, eq=False)
class JointSpread:
    """Figure 9 for one joint: e = d_i - mean d_i over the captures of a stance.

    Attributes
    ----------
    joint : str
    errors_m : ndarray (k,)
        Of every lesion and capture, each lesion about its own mean.
    seen : float
        Share of the captures and lesions for which the distance was measured.
    p95_m : float
        95th percentile of |e|; NaN without any.
    right : float
        Share of the captures and lesions for which |e| was measured and lies within the voting band.
    grade : {"good", "reasonable", "bad"}
        By `right`; see `grade_joint`.
    """

    joint: str
    errors_m: FloatArray
    seen: float
    p95_m: float
    right: float
    grade: Grade


def grade_joint(right: float) -> Grade:
    """How far a joint can be trusted to vote, by the share of right votes it would cast.

    A joint votes for the right place when its distance to it lies within ``delta_m`` of the stored one (eq.
    1), here of the mean over the captures: when |e| < delta. *Good*: right at least 19 times in 20.
    *Reasonable*: right at least twice as often as wrong. *Bad*: worse. A distance that could not be measured
    is a wrong vote.
    """
    if right >= GOOD:
        return "good"
    return "reasonable" if right >= REASONABLE else "bad"


def joint_spreads(records: Sequence[CaptureRecord], label: str, delta_m: float) -> list[JointSpread]:
    """Figure 9: one row per joint, in the order of `core.anchors.JOINT_NAMES`; empty without clicked lesions.

    Parameters
    ----------
    label : str
        "DM" or "FMM".
    delta_m : float
        Half width of a voting band.
    """
    lesions = list(dict.fromkeys(name for r in records for name in r.lesions_m))
    if not lesions:
        return []
    distances = np.array([[r.to_lesion(label, name) for name in lesions] for r in records])
    clicked = np.array([[name in r.lesions_m for name in lesions] for r in records])
    enough = np.isfinite(distances).sum(axis=0) >= 2
    distances = np.where(enough[None], distances, np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a joint that no capture shows has no mean
        errors = distances - np.nanmean(distances, axis=0)
    out = []
    for row, joint in enumerate(JOINT_NAMES):
        e = errors[:, :, row]
        e = e[np.isfinite(e)]
        places = max(1, int(clicked.sum()))
        p95 = float(np.percentile(np.abs(e), 95)) if len(e) else float("nan")
        right = float((np.abs(e) < delta_m).sum() / places)
        out.append(JointSpread(joint, e, len(e) / places, p95, right, grade_joint(right)))
    return out


def variance_matrix(records: Sequence[CaptureRecord], label: str) -> FloatArray:
    """Figure 10: variance (15, 15) of the distance of every pair of joints over the captures, square metres.

    NaN on the diagonal and where fewer than three captures show both joints connected.
    """
    stack = np.array([r.between(label) for r in records])
    count = np.isfinite(stack).sum(axis=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # pairs without any capture
        variance = np.nanvar(stack, axis=0, ddof=1)
    variance[count < 3] = np.nan
    np.fill_diagonal(variance, np.nan)
    return np.asarray(variance)


@dataclass(frozen=True, eq=False)
class ErrorSeries:
    """Figure 11 and table 2 for one method in one stance.

    Attributes
    ----------
    method : str
    captures : tuple of str (k,)
        Without the first, which is the reference.
    errors_m : ndarray (k, l)
        Distance of each answer to the re-clicked lesion; NaN without an answer or a click.
    per_capture_m : ndarray (k,)
        Mean over the lesions; NaN without any.
    judged, answered : int
        Lesions clicked in the first capture and again in a later one, and those that got a place.
    mean_m, median_m, p95_m : float
        Over all answers; NaN without any.
    low_m, high_m : float
        95 % bootstrap interval of the mean, captures drawn with replacement.
    cpu_s : float
        Median CPU time of one relocation; NaN without any.
    """

    method: str
    captures: tuple[str, ...]
    errors_m: FloatArray
    per_capture_m: FloatArray
    judged: int
    answered: int
    mean_m: float
    median_m: float
    p95_m: float
    low_m: float
    high_m: float
    cpu_s: float


def error_series(
    records: Sequence[CaptureRecord], method: str, *, seed: int = 0, draws: int = 1000
) -> ErrorSeries:
    """Judge a method in one stance: the first capture clicked, the others against their re-clicked truth."""
    first, later = records[0], records[1:]
    lesions = list(first.lesions_m)
    errors = np.array([[r.error_m(method, name) for name in lesions] for r in later], dtype=np.float64)
    errors = errors.reshape(len(later), len(lesions))
    good = np.isfinite(errors)
    judged = sum(name in r.lesions_m for r in later for name in lesions)
    some = good.any(axis=1)
    per_capture = np.full(len(later), np.nan)
    per_capture[some] = np.nanmean(errors[some], axis=1) if some.any() else np.nan
    values = errors[good]
    low = high = float("nan")
    if len(values):
        sums, counts = np.nansum(errors, axis=1), good.sum(axis=1)
        drawn = np.random.default_rng(seed).integers(0, len(later), (draws, len(later)))
        total = counts[drawn].sum(axis=1)
        means = sums[drawn].sum(axis=1)[total > 0] / total[total > 0]
        low, high = (float(x) for x in np.percentile(means, [2.5, 97.5]))
    times = [r.cpu_seconds[method] for r in later if method in r.cpu_seconds]
    return ErrorSeries(
        method=method,
        captures=tuple(r.name for r in later),
        errors_m=errors,
        per_capture_m=per_capture,
        judged=judged,
        answered=int(good.sum()),
        mean_m=float(values.mean()) if len(values) else float("nan"),
        median_m=float(np.median(values)) if len(values) else float("nan"),
        p95_m=float(np.percentile(values, 95)) if len(values) else float("nan"),
        low_m=low,
        high_m=high,
        cpu_s=float(np.median(times)) if times else float("nan"),
    )
