"""The signature of a lesion: its geodesic distances to the anchors (thesis, chapter 3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.geodesics import GeodesicFields
from core.relocation.field_store import nearest_corner
from core.relocation.pair import PickedLesion
from core.surface import BodySurface

FloatArray = NDArray[np.float64]

LEAST_ANCHORS = 4
"""Two distances meet in two places; a third decides, a fourth shows an error."""


@dataclass(frozen=True, eq=False)
class LesionSignature:
    """Distances of one lesion along the skin.

    Attributes
    ----------
    lesion_id : str
    names : tuple of str (a)
        The anchors.
    distances_m : ndarray (a,)
        inf where the skin between anchor and lesion was not seen connected.
    sigma_m : ndarray (a,)
        Spread of each distance between visits.
    position_m : ndarray (3,)
        In the first visit's depth-camera frame.
    """

    lesion_id: str
    names: tuple[str, ...]
    distances_m: FloatArray
    sigma_m: FloatArray
    position_m: FloatArray

    @property
    def reached(self) -> int:
        """Number of anchors that the lesion is connected to."""
        return int(np.isfinite(self.distances_m).sum())


Spread = Callable[[FloatArray, FloatArray], FloatArray]
"""Spread (a, k) of distances (a, k) from the anchors to places (k, 3)."""


def lesion_signatures(
    fields: GeodesicFields,
    lesions: Sequence[PickedLesion],
    spread: Spread | None = None,
    *,
    at_pixels_of: BodySurface | None = None,
) -> tuple[LesionSignature, ...]:
    """Signatures of lesions on the surface of the fields.

    Parameters
    ----------
    fields : GeodesicFields
        Of the first visit.
    spread : callable, optional
        How far a distance may differ between visits; without it `LesionSignature.sigma_m` is zero.
    at_pixels_of : BodySurface, optional
        Read the nearest depth pixel of this surface (the thesis) instead of the point between vertices.
    """
    if not lesions:
        return ()
    if at_pixels_of is not None:
        distances = fields.distances[:, [nearest_corner(at_pixels_of, p.point) for p in lesions]]
    else:
        distances = fields.at([p.point for p in lesions])
    places = np.array([p.point.position_m for p in lesions])
    sigma = np.zeros_like(distances) if spread is None else spread(distances, places)
    return tuple(
        LesionSignature(lesion.query.id, fields.names, distances[:, k], sigma[:, k], places[k])
        for k, lesion in enumerate(lesions)
    )
