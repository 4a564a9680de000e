"""What is learned about a hand: per configuration the distances along the skin, with their spread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from core.errors import InputError
from core.hand.flat import SIZE_SHARE, changes_between_frames, changes_between_people, lay_flat
from core.hand.names import POINT_NAMES

FloatArray = NDArray[np.float64]

LEAST_FRAMES = 3
"""Labelled frames that a configuration needs: fewer show no spread."""

POINTS = len(POINT_NAMES)

OWN_FIELDS = 2
"""Distances of a point beside those from the anchors: to the rim, and to the end (`core.hand.fields`)."""

_LEAST_SIGMA_M = 0.001
_SIGMA_M = 0.002
_RIM_SIGMA_M = 0.0015
_END_SIGMA_M = 0.005
_MODES = 12
_PRIOR_FRAMES = 6.0
_MEASURED_SIGMA_M = 0.002
_ROUNDS = 60
_SETTLED_M = 2e-5


@dataclass(frozen=True, eq=False)
class LabelledFrame:
    """Distances measured in one frame whose points a person has clicked.

    Attributes
    ----------
    configuration : str
    anchor_m : ndarray (15, a + 2)
        dA: geodesic distance of each point from each anchor, then its distances to the rim and to the end
        (`core.hand.fields`); NaN for points that were not labelled.
    pair_m : ndarray (105,)
        dB: geodesic distances between points (`names.PAIRS`); NaN where one of them is missing.
    """

    configuration: str
    anchor_m: FloatArray
    pair_m: FloatArray

    @property
    def vector(self) -> FloatArray:
        """All distances (15 (a + 2) + 105,) in a row."""
        return np.concatenate([self.anchor_m.ravel(), self.pair_m])


@dataclass(frozen=True, eq=False)
class ConfigurationModel:
    """Distances of one configuration of the hand.

    A frame's distances are ``mean + b @ modes`` and noise, b standard normal: the modes say how hands differ
    in size, in how the marker sits, and in how the fingers are held.

    Attributes
    ----------
    name : str
    fields : int
        Distances of a point: of a anchors, and two of its own, f = a + 2.
    mean_m : ndarray (15 f + 105,)
        dA point by point, then dB pair by pair; NaN for what was never seen.
    sigma_m : ndarray (15 f + 105,)
        Standard deviation that the modes leave.
    modes_m : ndarray (k, 15 f + 105)
        Each scaled to one standard deviation, the strongest first; 0 where the mean is NaN.
    seen : ndarray (15,)
        Share of the frames in which a point was labelled.
    frames : int
    """

    name: str
    fields: int
    mean_m: FloatArray
    sigma_m: FloatArray
    modes_m: FloatArray
    seen: FloatArray
    frames: int

    def expected(self, b: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances (15, f) and (105,) of a hand with mode coefficients ``b`` (k,)."""
        values = self.mean_m + b @ self.modes_m
        cut = POINTS * self.fields
        return values[:cut].reshape(POINTS, self.fields), values[cut:]

    @property
    def anchor_sigma_m(self) -> FloatArray:
        """Spread (15, f) of the points' distances that the modes leave."""
        return self.sigma_m[: POINTS * self.fields].reshape(POINTS, self.fields)

    @property
    def pair_sigma_m(self) -> FloatArray:
        """Spread (105,) of the distances between points that the modes leave."""
        return self.sigma_m[POINTS * self.fields :]


def learn_configuration(
    name: str, frames: Sequence[LabelledFrame], *, rigid_anchors: bool = True
) -> ConfigurationModel:
    """Mean, modes and remaining spread of the distances of one configuration.

    What is known beforehand (`core.hand.flat`) about how a hand is held counts like six frames more, so that
    many frames overrule it. How people and sessions differ is added whole: all frames may be of one hand.
    Missing distances are filled in turn from the model itself.

    Parameters
    ----------
    name : str
    frames : sequence of LabelledFrame
    rigid_anchors : bool
        Whether the anchors are the corners of one marker.

    Raises
    ------
    InputError
        If there are too few frames, or no point that is labelled in two of them.
    """
    if len(frames) < LEAST_FRAMES:
        raise InputError(
            f"Configuration '{name}' has {len(frames)} labelled frame{'s'[: len(frames) != 1]}.",
            f"Label at least {LEAST_FRAMES}: fewer show no spread.",
        )
    data = np.array([frame.vector for frame in frames])
    fields = frames[0].anchor_m.shape[1]
    known = np.isfinite(data)
    if not (known[:, : POINTS * fields].sum(axis=0) >= 2).any():
        raise InputError(
            f"Configuration '{name}' has no point that is labelled in two frames.",
            "Label the same points in every frame.",
        )
    usable = known.any(axis=0)
    mean = np.where(usable, _nanmean(data), np.nan)
    people, held, own = _beforehand(mean, fields, rigid_anchors)
    with threadpool_limits(1):  # many small matrices: threads only wait for one another
        centre, modes, rest = _factors(data[:, usable], people[:, usable], held[:, usable], own[usable])
    sigma, spread = np.full(len(mean), np.nan), np.zeros((len(modes), len(mean)))
    mean[usable], sigma[usable], spread[:, usable] = centre, rest, modes
    seen = known[:, : POINTS * fields].reshape(len(data), POINTS, fields).all(axis=2)
    return ConfigurationModel(name, fields, mean, sigma, spread, seen.mean(axis=0), len(frames))


def _beforehand(
    mean: FloatArray, fields: int, rigid_anchors: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Likely changes (p, 15 f + 105) between people and between frames, and own deviations (15 f + 105,)."""
    anchors = fields - OWN_FIELDS
    points, pairs = mean[: POINTS * fields].reshape(POINTS, fields), mean[POINTS * fields :]
    flat = lay_flat(points[:, :anchors], pairs)

    def with_own(changes: FloatArray, size: float = 0.0) -> FloatArray:
        modes = np.zeros((len(changes), POINTS, fields))
        modes[:, :, :anchors] = changes[:, : POINTS * anchors].reshape(-1, POINTS, anchors)
        modes[0, :, anchors + 1] = size * np.nan_to_num(points[:, anchors + 1])
        return np.hstack([modes.reshape(len(modes), -1), changes[:, POINTS * anchors :]])

    own = np.full((POINTS, fields), _SIGMA_M)
    own[:, anchors], own[:, anchors + 1] = _RIM_SIGMA_M, _END_SIGMA_M
    return (
        with_own(changes_between_people(flat, rigid_anchors=rigid_anchors), SIZE_SHARE),
        with_own(changes_between_frames(flat, rigid_anchors=rigid_anchors)),
        np.concatenate([own.ravel(), np.full(len(pairs), _SIGMA_M)]),
    )


def _nanmean(values: FloatArray) -> FloatArray:
    count = np.isfinite(values).sum(axis=0)
    return np.asarray(np.nansum(values, axis=0) / np.maximum(count, 1))


def _factors(
    data: FloatArray, people: FloatArray, held: FloatArray, own: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean (d,), modes (k, d) and remaining deviation (d,) of data (n, d) with gaps (factor analysis).

    Parameters
    ----------
    data : ndarray (n, d)
    people : ndarray (p, d)
        Modes that are added to what the data show.
    held : ndarray (q, d)
        Modes that are likely beforehand.
    own : ndarray (d,)
        Deviation beside them.
    """
    count = len(data)
    known = np.isfinite(data)
    mean = _nanmean(data)
    between, within = people.T @ people, held.T @ held + np.diag(own**2)
    modes, rest = _split(between + within)
    for _ in range(_ROUNDS):
        fitted = np.array([mean + coefficients(row - mean, modes, 1.0 / rest**2) @ modes for row in data])
        filled = np.where(known, data, fitted)
        before_m, mean = mean, filled.mean(axis=0)
        spread = (filled - mean).T @ (filled - mean)
        seen = (spread + _PRIOR_FRAMES * within) / (count - 1 + _PRIOR_FRAMES)
        modes, rest = _split(between + seen)
        if np.abs(mean - before_m).max() < _SETTLED_M:
            break
    return mean, modes, rest


def _split(covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Strongest modes (k, d) of a covariance, and the deviation (d,) that they leave."""
    values, vectors = np.linalg.eigh(covariance)
    strongest = slice(-1, -1 - _MODES, -1)
    modes = np.sqrt(np.maximum(values[strongest], 0.0))[:, None] * vectors[:, strongest].T
    rest = np.diag(covariance) - (modes**2).sum(axis=0)
    return modes, np.sqrt(np.maximum(rest, _LEAST_SIGMA_M**2))


def coefficients(
    differences: FloatArray,
    modes: FloatArray,
    weight: FloatArray,
    before: FloatArray | None = None,
    trust: float = 0.0,
) -> FloatArray:
    """Most probable mode coefficients (k,) of differences (d,) from the mean; NaN does not count.

    Parameters
    ----------
    differences : ndarray (d,)
        Metres.
    modes : ndarray (k, d)
    weight : ndarray (d,)
        Inverse variances.
    before : ndarray (k,), optional
        What they were in the frame before.
    trust : float
        Inverse variance of that; each coefficient's own is 1.
    """
    known = np.isfinite(differences) & np.isfinite(weight)
    basis, w = modes[:, known], weight[known]
    normal = (basis * w) @ basis.T + np.eye(len(modes))
    right = (basis * w) @ differences[known]
    if before is not None:
        normal, right = normal + trust * np.eye(len(modes)), right + trust * before
    return np.asarray(np.linalg.solve(normal, right))
