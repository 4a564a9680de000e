"""Pictures of how the proposed place of a lesion came about."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from app.workflows.plan import KnownPlace, Search
from app.workflows.search import Analyse
from core.errors import WorkError
from core.progress import Progress, ScaledProgress, no_progress

if TYPE_CHECKING:
    from numpy.typing import NDArray

EXPLAINED = ("voting-dijkstra", "voting-fmm", "trilateration")
"""Methods with distances of their own to show; the last one stands for the others."""

_TITLES = {
    "1-paths-first": "Paths, previous visit",
    "2-bands": "Bands",
    "3-votes": "Votes",
    "4-cluster": "Biggest cluster",
    "5-paths-followup": "Paths, this visit",
}


def explanation_pictures(
    place: KnownPlace,
    search: Search,
    analyse: Analyse,
    *,
    number: str,
    method: str,
    answer_m: tuple[float, float, float] | None,
    progress: Progress = no_progress,
) -> tuple[dict[str, NDArray[np.uint8]], tuple[tuple[str, float], ...]]:
    """Bands, votes, biggest cluster and geodesic paths of one lesion, and how sharp its anchors are.

    Parameters
    ----------
    place : KnownPlace
        Of the earlier visit.
    search : Search
        The pair of captures.
    analyse : callable
    number : str
        The lesion's number, written on the pictures.
    method : str
        Which method's distances are shown.
    answer_m : tuple of float or None
        The place that was proposed.
    progress : Progress

    Returns
    -------
    pictures : dict of str to ndarray (h, w, 3) uint8
        RGB by title.
    anchors : tuple of (str, float)
        Every anchor used, with the spread of its place in metres over both visits, the sharpest first.
    """
    from core.relocation import LesionQuery
    from core.relocation.explain import explain_lesion
    from core.relocation.explain_draw import draw_explanation
    from core.relocation.pair import VisitPair

    first = analyse(search.reference_capture_id, ScaledProgress(progress, 0.0, 0.3))
    followup = analyse(search.target_capture_id, ScaledProgress(progress, 0.3, 0.6))
    progress(0.6, "Tracing the paths")
    explanation = explain_lesion(
        first,
        followup,
        LesionQuery(number, pixel=place.pixel),
        method=method if method in EXPLAINED else EXPLAINED[-1],
        answer_m=None if answer_m is None else np.asarray(answer_m),
    )
    if explanation is None:
        raise WorkError(
            "There is nothing to show for this lesion.",
            "No anchor reaches its place on both visits; place it by hand.",
        )
    progress(0.9, "Drawing")
    pictures = draw_explanation(explanation, first, followup)
    names = tuple(explanation.anchor_names)
    spreads = VisitPair(first, followup).sigma_m(names)
    anchors = sorted(zip(names, (float(s) for s in spreads), strict=True), key=lambda pair: pair[1])
    return {_TITLES.get(name, name): picture for name, picture in pictures.items()}, tuple(anchors)
