"""Why a lesion was placed there: bands, votes, biggest cluster, geodesic paths (thesis fig. 3 and 9)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.anchors import AnalysedCapture
from core.errors import InputError, WorkError
from core.geodesics import GeodesicFields, trace_path
from core.relocation.field_store import FIELDS, GeodesicKind
from core.relocation.pair import PickedLesion, VisitPair, anchor_points
from core.relocation.relocate import pick_query
from core.relocation.signatures import lesion_signatures
from core.relocation.types import LesionQuery, RelocationOptions
from core.relocation.voting import band_membership, grid_edges, triangle_edges, vote
from core.surface import SurfacePoint

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

KINDS: dict[str, GeodesicKind] = {
    "voting-dijkstra": "grid-dijkstra",
    "voting-fmm": "delaunay-fast-marching",
    "trilateration": "virtual-source",
}
"""Which distances a method's explanation shows."""


@dataclass(frozen=True, eq=False)
class LesionExplanation:
    """The evidence of one lesion, per vertex of the follow-up's surface.

    Attributes
    ----------
    lesion_id : str
    anchor_names : tuple of str (a)
    distances_m : ndarray (a,)
        From the lesion to the anchors in the first visit; inf where not connected.
    delta_m : float
        Half width of the bands.
    bands : ndarray (a, n) bool
        Which vertices each anchor votes for (eq. 1).
    votes : ndarray (n,)
        Sum of the bands (eq. 5).
    candidates : ndarray (m,)
        The most voted vertices.
    biggest_cluster : ndarray (k,)
        The biggest connected set of them.
    mean_m : ndarray (3,)
        Mean of the biggest cluster.
    answer_m : ndarray (3,)
        What was answered: the voted place (eq. 6), or the place handed to `explain_lesion`.
    lesion_m : ndarray (3,)
        The lesion in the first visit.
    first_paths, paths : mapping of str to ndarray (k, 3)
        Shortest way along the skin from the lesion, and from the answer, to every connected anchor.
    first_untraced, untraced : tuple of str
        Anchors that are connected, but to which no way could be followed through the distances.
    """

    lesion_id: str
    anchor_names: tuple[str, ...]
    distances_m: FloatArray
    delta_m: float
    bands: NDArray[np.bool_]
    votes: NDArray[np.int16]
    candidates: IntArray
    biggest_cluster: IntArray
    mean_m: FloatArray
    answer_m: FloatArray
    lesion_m: FloatArray
    first_paths: Mapping[str, FloatArray]
    paths: Mapping[str, FloatArray]
    first_untraced: tuple[str, ...] = ()
    untraced: tuple[str, ...] = ()


def explain_lesion(
    first: AnalysedCapture,
    followup: AnalysedCapture,
    query: LesionQuery,
    *,
    method: str = "trilateration",
    options: RelocationOptions | None = None,
    answer_m: FloatArray | None = None,
) -> LesionExplanation | None:
    """Collect the evidence for one lesion.

    Parameters
    ----------
    query : LesionQuery
    method : str
        Decides on which distances the bands rest: a key of `KINDS`.
    answer_m : ndarray (3,), optional
        The place that was answered, for the paths; the voted place without it.

    Returns
    -------
    LesionExplanation or None
        None when the lesion is not on the skin or no band of any anchor reaches the follow-up's skin.
    """
    if method not in KINDS:
        raise InputError(f"There is no explanation of '{method}'.", f"Choose one of: {', '.join(KINDS)}.")
    options = options or RelocationOptions()
    pick = pick_query(first, query)
    if pick.point is None or pick.normal is None:
        return None
    pair, kind = VisitPair(first, followup), KINDS[method]
    names = pair.joint_names
    if not names:
        return None
    fields1 = FIELDS.fields(first.scan.surface, anchor_points(first, names), kind)
    fields2 = FIELDS.fields(followup.scan.surface, anchor_points(followup, names), kind)
    lesion = PickedLesion(query, pick.point, pick.normal)
    pixels = None if kind == "virtual-source" else first.scan.surface
    signature = lesion_signatures(fields1, [lesion], at_pixels_of=pixels)[0]
    surface = followup.scan.surface
    edges = (
        grid_edges(surface.vertex_of_pixel, surface.vertices)
        if kind == "grid-dijkstra"
        else triangle_edges(fields2.triangles)
    )
    outcome = vote(fields2.distances, signature.distances_m, surface.vertices, edges, options.delta_m)
    if outcome is None:
        return None
    answer = surface.vertices[outcome.vertex] if answer_m is None else np.asarray(answer_m, dtype=float)
    first_paths, first_untraced = _paths(first, fields1, pick.point, kind)
    paths, untraced = _paths(followup, fields2, surface.nearest(answer)[0], kind)
    return LesionExplanation(
        lesion_id=query.id,
        anchor_names=names,
        distances_m=signature.distances_m,
        delta_m=options.delta_m,
        bands=band_membership(fields2.distances, signature.distances_m, options.delta_m),
        votes=outcome.votes,
        candidates=outcome.candidates,
        biggest_cluster=outcome.cluster,
        mean_m=outcome.mean_m,
        answer_m=answer,
        lesion_m=np.asarray(pick.point.position_m),
        first_paths=first_paths,
        paths=paths,
        first_untraced=first_untraced,
        untraced=untraced,
    )


def _paths(
    analysed: AnalysedCapture, fields: GeodesicFields, target: SurfacePoint, kind: GeodesicKind
) -> tuple[dict[str, FloatArray], tuple[str, ...]]:
    """Paths from a place to every anchor that it is connected to, and the anchors to which none was found."""
    surface = analysed.scan.surface
    solver = FIELDS.solver(surface, kind)
    if kind == "delaunay-fast-marching":
        solver = FIELDS.solver(surface, "virtual-source")
        fields = FIELDS.fields(surface, anchor_points(analysed, fields.names), "virtual-source")
    reached = np.asarray(np.isfinite(fields.distances[:, surface.triangles[target.triangle]]).all(axis=1))
    paths: dict[str, FloatArray] = {}
    untraced = []
    for name, distances, connected in zip(fields.names, fields.distances, reached, strict=True):
        if not connected:
            continue
        try:
            paths[name] = trace_path(solver, distances, target, source=analysed.anchors[name].point)
        except WorkError:  # one way that cannot be drawn must not hide the others
            untraced.append(name)
    return paths, tuple(untraced)
