"""How far an answer of the hand tracker is from the truth, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.evaluation.hand.frames import TrueFrame
from core.geodesics import geodesic_solver
from core.hand.answer import HandAnswer
from core.hand.names import PAIRS
from core.hand.surface import HandSurface

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

OUTLIER_M = 0.015
"""A frame whose median joint-joint error is above it is an outlier."""

Anchored = Literal["seen", "followed", "none"]

_UNTIMED = (float("nan"), float("nan"))
_FIRST, _SECOND = np.array(PAIRS).T


@dataclass(frozen=True, eq=False)
class FrameScore:
    """What was told of one frame, and what is true.

    Attributes
    ----------
    name, body, remark : str
    configuration, told_configuration : str or None
        True (None between two) and told (None: unknown).
    likeliest : str or None
        What the tracker would have said had it been made to choose; None without any judgement.
    anchored : {"seen", "followed", "none"}
        Anchors found in this frame; followed from earlier ones; nothing told.
    visible, told : ndarray (15,) bool
    error_m : ndarray (15,)
        Distance of told points to their true places, hidden ones too; NaN where nothing was told.
    pair_error_m : ndarray (105,)
        Straight distance between two told, visible points, less the true one; NaN for other pairs.
    path_error_m : ndarray (105,)
        The same of distances along the measured skin; NaN if they were not measured.
    pixels : ndarray (15, 2)
        Told points in the picture.
    reason : str or None
    wall_s, cpu_s : float
        From the frame to the answer: by the clock, and of all the process's threads.
    times_s : dict of str to float
        By step.
    """

    name: str
    body: str
    remark: str
    configuration: str | None
    told_configuration: str | None
    likeliest: str | None
    anchored: Anchored
    visible: BoolArray
    told: BoolArray
    error_m: FloatArray
    pair_error_m: FloatArray
    path_error_m: FloatArray
    pixels: FloatArray = field(default_factory=lambda: np.full((15, 2), np.nan))
    reason: str | None = None
    wall_s: float = float("nan")
    cpu_s: float = float("nan")
    times_s: dict[str, float] = field(default_factory=dict)

    @property
    def joint_error_m(self) -> float:
        """Median of the absolute joint-joint errors; NaN if no two visible points are told."""
        return median(np.abs(self.pair_error_m))

    @property
    def outlier(self) -> bool:
        """Whether the points are grossly wrong."""
        return self.joint_error_m > OUTLIER_M

    @property
    def visible_error_m(self) -> FloatArray:
        """Errors (k,) of the visible points that were told."""
        return np.asarray(self.error_m[self.visible & self.told])

    @property
    def hidden_error_m(self) -> FloatArray:
        """Errors (k,) of hidden points that were told all the same."""
        return np.asarray(self.error_m[~self.visible & self.told])


def score_frame(
    frame: TrueFrame, answer: HandAnswer, *, took_s: tuple[float, float] = _UNTIMED, paths: bool = False
) -> FrameScore:
    """Hold an answer against the truth.

    Parameters
    ----------
    took_s : tuple of float
        Time by the clock, and of the process.
    paths : bool
        Whether to measure distances along the skin between the true points as well (some 20 ms).
    """
    told = answer.found
    anchored: Anchored = "seen" if answer.marker_seen else "followed" if told.any() else "none"
    both = told & frame.visible
    path_error = np.full(len(PAIRS), np.nan)
    if paths and answer.surface is not None:
        true_path = paths_between(answer.surface, np.where(both[:, None], frame.points_m, np.nan))
        path_error = answer.pair_m - true_path
    likelihood = answer.likelihood
    return FrameScore(
        name=frame.name,
        body=frame.body,
        remark=frame.remark,
        configuration=frame.labels.configuration,
        told_configuration=answer.configuration,
        likeliest=max(likelihood, key=likelihood.__getitem__) if likelihood else answer.configuration,
        anchored=anchored,
        visible=frame.visible,
        told=told,
        error_m=np.linalg.norm(answer.points_m - frame.points_m, axis=1),
        pair_error_m=pair_errors(answer.points_m, frame.points_m, both),
        path_error_m=path_error,
        pixels=answer.pixels,
        reason=answer.reason,
        wall_s=took_s[0],
        cpu_s=took_s[1],
        times_s=dict(answer.times_s),
    )


def pair_errors(points_m: FloatArray, true_m: FloatArray, counted: BoolArray) -> FloatArray:
    """Distances (105,) between points (15, 3) less those between true ones; NaN for pairs not counted."""
    error = _distances(points_m) - _distances(true_m)
    return np.where(counted[_FIRST] & counted[_SECOND], error, np.nan)


def _distances(points_m: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(points_m[_FIRST] - points_m[_SECOND], axis=1))


def paths_between(hand: HandSurface, points_m: FloatArray) -> FloatArray:
    """Geodesics (105,) along a measured hand between places (15, 3); NaN where one is NaN or apart."""
    surface, between = hand.surface, np.full((len(points_m), len(points_m)), np.nan)
    known = np.flatnonzero(np.isfinite(points_m).all(axis=1))
    if len(known) > 1:
        solver = geodesic_solver(surface.vertices, surface.triangles)
        triangles, weights, _ = surface.nearest_arrays(points_m[known])
        fields = solver.distances(surface.nearest(points_m[known]))
        there = np.einsum("skc,kc->sk", fields[:, surface.triangles[triangles]], weights)
        mean = 0.5 * (there + there.T)
        between[np.ix_(known, known)] = np.where(np.isfinite(mean), mean, np.nan)
    return np.asarray(between[_FIRST, _SECOND])


def median(values: FloatArray) -> float:
    """Median of the numbers among values; NaN if there are none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")
