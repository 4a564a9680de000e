"""How much more alike two spots of two visits look than two moles picked at random."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.lesions.spots import SkinSpots

FloatArray = NDArray[np.float64]

# Columns: log radius, log contrast, log contrast of red over green and of blue over green, each against the
# skin beside the spot, so that neither exposure nor white balance nor the light of the place counts.
# Spread between two spots picked at random, measured on simulated visit pairs.
_RANDOM = np.array([0.43, 0.92, 0.073, 0.055])
# The same mole twice, square on and large: measured 0.035, 0.03, 0.018 and 0.02 on simulated pairs. Skin that
# tans, moles that grow and real lenses add to that; the surplus is chosen, not measured.
_SAME = np.array([0.10, 0.10, 0.028, 0.028])
# Times 1 / cosine - 1 of the more tilted view.
_TILT = np.array([0.15, 0.15, 0.015, 0.015])
# Times 1 / radius_px squared: the lens blurs small spots, which grow and pale.
_BLUR = np.array([0.08, 0.20, 0.020, 0.020])
# Over the fainter contrast.
_NOISE = np.array([0.015, 0.015, 0.003, 0.003])
_LEAST_COSINE = 0.3
_OUTLIERS = 0.05
_DARK_OFFSET = 4.0


def appearance_distance(one: SkinSpots, i: ArrayLike, other: SkinSpots, j: ArrayLike) -> FloatArray:
    """Cost (n1, n2) of taking spots ``i`` (n1,) of one capture for spots ``j`` (n2,) of the other.

    Minus twice the logarithm of how much likelier the difference in size, contrast and colour is for one mole
    seen twice than for two moles: 0 says nothing, below is alike. It is at most about 6, because a mole may
    change, be scratched or lie in a shadow's edge.
    """
    a, b = one.take(_rows(i)), other.take(_rows(j))
    off = _features(a)[:, None] - _features(b)[None]
    cosine = np.minimum(_cosine(a)[:, None], _cosine(b)[None])
    pixels = np.minimum(a.radius_px[:, None], b.radius_px[None])
    faint = np.maximum(np.minimum(a.contrast[:, None], b.contrast[None]), 0.03)
    variance = _SAME**2 + (_TILT * (1.0 / cosine - 1.0)[..., None]) ** 2
    variance = variance + (_BLUR / np.maximum(pixels, 0.7)[..., None] ** 2) ** 2
    variance = variance + (_NOISE / faint[..., None]) ** 2
    # Where the measurement itself spreads as wide as moles do, it says nothing.
    variance = np.minimum(variance, _RANDOM**2)
    ratio = 0.5 * (off**2 * (1.0 / _RANDOM**2 - 1.0 / variance) - np.log(variance / _RANDOM**2)).sum(axis=2)
    return np.asarray(-2.0 * np.logaddexp(np.log(1.0 - _OUTLIERS) + ratio, np.log(_OUTLIERS)))


def _rows(rows: ArrayLike) -> NDArray[np.int64]:
    return np.asarray(rows, dtype=np.int64).reshape(-1)


def _features(spots: SkinSpots) -> FloatArray:
    darker = np.log((spots.skin_color + _DARK_OFFSET) / (spots.color + _DARK_OFFSET))
    return np.stack(
        [
            np.log(np.maximum(spots.radius_m, 1e-4)),
            np.log(np.maximum(spots.contrast, 0.02)),
            darker[:, 0] - darker[:, 1],
            darker[:, 2] - darker[:, 1],
        ],
        axis=1,
    )


def _cosine(spots: SkinSpots) -> FloatArray:
    """Of the angle between line of sight and normal; the two cameras stand close together."""
    sight = spots.points_m / np.linalg.norm(spots.points_m, axis=1, keepdims=True)
    return np.asarray(np.clip(-np.einsum("nx,nx->n", sight, spots.normals), _LEAST_COSINE, 1.0))
