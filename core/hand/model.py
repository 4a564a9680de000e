"""What is learned about a hand: per configuration the distances along the skin, with their spread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.hand.names import POINT_NAMES

FloatArray = NDArray[np.float64]

LEAST_FRAMES = 3
"""Labelled frames that a configuration needs: fewer show no spread."""

POINTS = len(POINT_NAMES)

_LEAST_SIGMA_M = 0.0015
_MOST_MODES = 6
_FRAMES_PER_MODE = 4
_SIZE_SIGMA = 0.12
_MEASURED_SIGMA_M = 0.003
_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class LabelledFrame:
    """Distances measured in one frame whose points a person has clicked.

    Attributes
    ----------
    configuration : str
    anchor_m : ndarray (15, a)
        dA: geodesic distance of each point from each anchor; NaN for points that were not labelled.
    pair_m : ndarray (105,)
        dB: geodesic distances between points (`names.PAIRS`); NaN where one of them is missing.
    """

    configuration: str
    anchor_m: FloatArray
    pair_m: FloatArray

    @property
    def vector(self) -> FloatArray:
        """All distances (15 a + 105,) in a row."""
        return np.concatenate([self.anchor_m.ravel(), self.pair_m])


@dataclass(frozen=True, eq=False)
class ConfigurationModel:
    """Distances of one configuration of the hand.

    A frame's distances are ``mean + b @ modes`` and noise, b standard normal: the modes say how hands differ
    in size, in how the marker sits, and in how far the fingers bend.

    Attributes
    ----------
    name : str
    anchors : int
        How many anchors, a.
    mean_m : ndarray (15 a + 105,)
        dA point by point, then dB pair by pair; NaN for what was never seen twice.
    sigma_m : ndarray (15 a + 105,)
        Standard deviation that the modes leave.
    modes_m : ndarray (k, 15 a + 105)
        Each scaled to one standard deviation; 0 where the mean is NaN.
    seen : ndarray (15,)
        Share of the frames in which a point was labelled.
    frames : int
    """

    name: str
    anchors: int
    mean_m: FloatArray
    sigma_m: FloatArray
    modes_m: FloatArray
    seen: FloatArray
    frames: int

    def expected(self, b: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances (15, a) and (105,) of a hand with mode coefficients ``b`` (k,)."""
        values = self.mean_m + b @ self.modes_m
        cut = POINTS * self.anchors
        return values[:cut].reshape(POINTS, self.anchors), values[cut:]

    @property
    def anchor_sigma_m(self) -> FloatArray:
        """Spread (15, a) of the distances from the anchors."""
        return self.sigma_m[: POINTS * self.anchors].reshape(POINTS, self.anchors)

    @property
    def pair_sigma_m(self) -> FloatArray:
        """Spread (105,) of the distances between points."""
        return self.sigma_m[POINTS * self.anchors :]


def learn_configuration(name: str, frames: Sequence[LabelledFrame]) -> ConfigurationModel:
    """Mean, modes and remaining spread of the distances of one configuration.

    The size of the hand is a mode even where the frames show one hand only; the others are principal
    components, as many as the frames can carry. Missing distances are filled in turn from the model itself.

    Raises
    ------
    InputError
        If there are too few frames, or no point that two of them show.
    """
    if len(frames) < LEAST_FRAMES:
        raise InputError(
            f"Configuration '{name}' has {len(frames)} labelled frame{'s'[: len(frames) != 1]}.",
            f"Label at least {LEAST_FRAMES}: one frame shows no spread.",
        )
    data = np.array([frame.vector for frame in frames])
    usable = np.isfinite(data).sum(axis=0) >= 2
    anchors = frames[0].anchor_m.shape[1]
    if not usable[: POINTS * anchors].any():
        raise InputError(
            f"Configuration '{name}' has no point that is labelled in two frames.",
            "Label the same points in every frame.",
        )
    centre = np.where(usable, _nanmean(data), np.nan)
    modes, rest = _principal(data[:, usable] - centre[usable], centre[usable])
    sigma, spread = np.full(len(centre), np.nan), np.zeros((len(modes), len(centre)))
    sigma[usable], spread[:, usable] = np.maximum(rest, _LEAST_SIGMA_M), modes
    seen = np.isfinite(data[:, : POINTS * anchors]).reshape(len(data), POINTS, anchors).all(axis=2)
    return ConfigurationModel(name, anchors, centre, sigma, spread, seen.mean(axis=0), len(frames))


def _nanmean(values: FloatArray) -> FloatArray:
    count = np.isfinite(values).sum(axis=0)
    return np.asarray(np.nansum(values, axis=0) / np.maximum(count, 1))


def _principal(centred: FloatArray, mean: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Modes (k, d) and the standard deviation (d,) of what they leave, of centred data (n, d) with gaps."""
    count = len(centred)
    known = np.isfinite(centred)
    wanted = min(_MOST_MODES, count // _FRAMES_PER_MODE)
    modes = (_SIZE_SIGMA * mean)[None]
    filled = np.where(known, centred, 0.0)
    for _ in range(_ROUNDS if wanted else 0):
        left, values, right = np.linalg.svd(filled, full_matrices=False)
        modes = (values[:wanted, None] / np.sqrt(count)) * right[:wanted]
        filled = np.where(known, centred, (left[:, :wanted] * values[:wanted]) @ right[:wanted])
    weight = np.full(centred.shape[1], _MEASURED_SIGMA_M**-2)
    fitted = np.array([coefficients(row, modes, weight) @ modes for row in centred])
    freedom = max(1.0 - len(modes) / count, 0.3)
    return modes, np.sqrt(_nanmean(np.where(known, centred - fitted, np.nan) ** 2) / freedom)


def coefficients(differences: FloatArray, modes: FloatArray, weight: FloatArray) -> FloatArray:
    """Most probable mode coefficients (k,) of differences (d,) from the mean; NaN does not count.

    Parameters
    ----------
    differences : ndarray (d,)
        Metres.
    modes : ndarray (k, d)
    weight : ndarray (d,)
        Inverse variances.
    """
    known = np.isfinite(differences) & np.isfinite(weight)
    basis, w = modes[:, known], weight[known]
    normal = (basis * w) @ basis.T + np.eye(len(modes))
    return np.asarray(np.linalg.solve(normal, (basis * w) @ differences[known]))
