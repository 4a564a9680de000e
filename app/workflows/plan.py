"""Which lesion is looked for where: the newest sure place of each lesion against the captures of a visit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass

Pixel = tuple[float, float]

SIDES = ("front", "back", "left", "right")
"""Views that name a side of the body; every other view is free text."""


@dataclass(frozen=True)
class KnownPlace:
    """A place of a lesion that a doctor marked, confirmed or corrected.

    Attributes
    ----------
    lesion_id, capture_id : int
    view : str
        View of that capture.
    visit_number : int
        Larger is newer.
    pixel : tuple of float
        (u, v) in the picture of that capture.
    """

    lesion_id: int
    capture_id: int
    view: str
    visit_number: int
    pixel: Pixel


@dataclass(frozen=True)
class Search:
    """Find ``places``, all of one earlier capture, on one capture of this visit."""

    reference_capture_id: int
    target_capture_id: int
    view: str
    places: tuple[KnownPlace, ...]


@dataclass(frozen=True)
class OutOfView:
    """A lesion whose side of the body was not captured in this visit."""

    lesion_id: int
    place: KnownPlace

    @property
    def reason(self) -> str:
        """One sentence for the doctor."""
        return f"Last seen in the {self.place.view} view, which was not captured in this visit."


@dataclass(frozen=True)
class RelocationPlan:
    """Everything to look for in one visit."""

    searches: tuple[Search, ...] = ()
    out_of_view: tuple[OutOfView, ...] = ()

    @property
    def lesion_ids(self) -> frozenset[int]:
        """Lesions the plan speaks of."""
        found = {p.lesion_id for s in self.searches for p in s.places}
        return frozenset(found | {o.lesion_id for o in self.out_of_view})

    def __len__(self) -> int:
        return len(self.lesion_ids)


def newest_of_each_view(captures: Iterable[tuple[int, str]]) -> dict[str, int]:
    """Capture in force of each view: ``captures`` are (id, view) in order of taking; a retake replaces."""
    return {view: capture_id for capture_id, view in captures}


def matching_capture(view: str, current: Mapping[str, int]) -> int | None:
    """The capture that may show a lesion seen in ``view``: of the same view, else of one that names no side.

    A view of free text ("turned a little") says nothing about the side, so the search itself has to find out
    whether the captures overlap; two different sides of the body do not.
    """
    if view in current:
        return current[view]
    free = [capture_id for name, capture_id in current.items() if name not in SIDES]
    if free:
        return max(free)
    return max(current.values(), default=None) if view not in SIDES else None


def plan_relocation(places: Sequence[KnownPlace], current: Mapping[str, int]) -> RelocationPlan:
    """Decide where each lesion is looked for.

    Parameters
    ----------
    places : sequence of KnownPlace
        Every sure place of every lesion, from earlier visits and from replaced captures of this visit.
    current : mapping of str to int
        View to capture of this visit that is in force.

    Returns
    -------
    RelocationPlan
        For each lesion one place: the newest in a view of this visit, else it is out of view. Places are
        grouped by (reference, target) capture so that each pair of surfaces is prepared once.
    """
    newest: dict[int, KnownPlace] = {}
    for place in sorted(places, key=lambda p: _rank(p, current)):
        newest[place.lesion_id] = place
    groups: dict[tuple[int, int], list[KnownPlace]] = {}
    unseen: list[OutOfView] = []
    for lesion_id in sorted(newest):
        place = newest[lesion_id]
        target = matching_capture(place.view, current)
        if target is None:
            unseen.append(OutOfView(lesion_id, place))
        else:
            groups.setdefault((place.capture_id, target), []).append(place)
    searches = tuple(
        Search(reference, target, group[0].view, tuple(group))
        for (reference, target), group in sorted(groups.items())
    )
    return RelocationPlan(searches, tuple(unseen))


def _rank(place: KnownPlace, current: Mapping[str, int]) -> tuple[bool, bool, int, int]:
    """Better references last: in a captured view, newer."""
    match = matching_capture(place.view, current) is not None
    return match, place.view in current, place.visit_number, place.capture_id


def pending(plan: RelocationPlan, looked_for: Mapping[int, Set[int]]) -> RelocationPlan:
    """The part of ``plan`` that has not been done.

    Parameters
    ----------
    plan : RelocationPlan
    looked_for : mapping of int to set of int
        Lesion to the captures in force that carry an observation of it, "not in view" included.
    """
    nowhere: Set[int] = frozenset()
    searches = []
    for search in plan.searches:
        open_places = tuple(
            p for p in search.places if search.target_capture_id not in looked_for.get(p.lesion_id, nowhere)
        )
        if open_places:
            searches.append(
                Search(search.reference_capture_id, search.target_capture_id, search.view, open_places)
            )
    unseen = tuple(o for o in plan.out_of_view if not looked_for.get(o.lesion_id))
    return RelocationPlan(tuple(searches), unseen)
