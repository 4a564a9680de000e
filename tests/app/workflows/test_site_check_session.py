"""The check of a site, the use of confirmed lesions and the spots of one visit, without a window."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from app.workflows.evidence import Answer, SeenSpot, VisitEvidence
from app.workflows.session import VisitSession
from app.workflows.table import Event, Refused, State
from app.workflows.wording import describe, is_confident, region_text
from core.records import Observation
from core.relocation import (
    RELOCATION_METHODS,
    MethodContext,
    MethodOutcome,
    RelocatedLesion,
    register_relocation_method,
    relocation_method,
)
from core.relocation.pair import PickedLesion, VisitPair
from core.relocation.types import Region
from tests.app.workflows.conftest import (
    Clinic,
    Take,
    capture_body,
    capture_stance,
    close_first_visit,
    seen_lesions,
)


class Listening:
    """Trilateration that tells what it was asked."""

    name = "listening"
    asked: list[tuple[list[PickedLesion], MethodContext]] = []  # noqa: RUF012 - shared by its instances

    def estimate(
        self, pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
    ) -> MethodOutcome:
        self.asked.append((list(lesions), context))
        return relocation_method("trilateration").estimate(pair, lesions, context)


@pytest.fixture
def listening() -> Iterator[list[tuple[list[PickedLesion], MethodContext]]]:
    Listening.asked = []
    register_relocation_method("listening", Listening)
    yield Listening.asked
    del RELOCATION_METHODS["listening"]


@pytest.fixture
def follow_up(clinic: Clinic, take: Take, listening: list[object]) -> tuple[VisitSession, dict[str, int]]:
    """A follow-up whose four lesions were looked for."""
    marked = close_first_visit(clinic.session(), take, lesions=4)
    session = VisitSession.begin(
        clinic.store, clinic.user.id, clinic.patient.id, lambda: clinic.tracker, method="listening"
    )
    capture_stance(session, take("psi", 2))
    capture_body(session, take("A", 2))
    session.adopt_search(session.find_lesions())
    return session, marked


def placed(session: VisitSession, marked: dict[str, int]) -> list[Observation]:
    found = (session.snapshot.in_force(i) for i in marked.values())
    return [o for o in found if o is not None and o.pixel is not None]


def test_sites_are_checked_against_proposal_and_decision_and_spots_leave_the_list_when_marked(
    follow_up: tuple[VisitSession, dict[str, int]], take: Take
) -> None:
    session, marked = follow_up
    here = session.snapshot.views["front"]
    o = placed(session, marked)[0]
    assert o.pixel is not None
    check = session.check_site(o.lesion_id, here, o.pixel)
    assert check.verdict in ("inside", "cannot tell")
    assert check.distance_m is not None
    assert check.distance_m < 0.01
    assert check.axes_m is not None
    assert check.axes_m == session.evidence.axes_m(o)
    others = [p for p in placed(session, marked) if p.lesion_id != o.lesion_id]
    far = max(others, key=lambda p: np.hypot(p.pixel[0] - o.pixel[0], p.pixel[1] - o.pixel[1]))
    away = session.check_site(o.lesion_id, here, far.pixel)
    assert away.verdict != "inside"
    assert away.border_m is not None
    assert away.border_m > 0
    nothing = session.check_site(o.lesion_id, here, (5.0, 5.0))
    assert nothing.verdict == "cannot tell"
    assert nothing.distance_m is None

    name = next(n for n, i in marked.items() if i == o.lesion_id)
    where = seen_lesions(take("A", 2), 20)[name]
    session.move(o.lesion_id, here, where)
    assert session.check_site(o.lesion_id, here, where).verdict == "inside"
    beside = session.check_site(o.lesion_id, here, (where[0] + 12, where[1]))
    assert beside.verdict == "outside"

    names = [n for n in seen_lesions(take("A", 2), 20) if n not in marked]
    free = seen_lesions(take("A", 2), 20)[names[-1]]
    session.evidence.keep_spots((SeenSpot(here, free, 0.8), SeenSpot(here, where, 0.9)), ())
    (spot,), gone = session.spots()
    assert (spot.pixel, gone) == (free, ()), "a spot that is a lesion is not listed"
    session.mark(spot.capture_id, spot.pixel)
    assert session.spots() == ((), ())


def test_a_lesion_that_was_taken_out_is_looked_for_by_geometry_when_its_site_is_asked_for(
    follow_up: tuple[VisitSession, dict[str, int]],
    listening: list[tuple[list[PickedLesion], MethodContext]],
) -> None:
    session, marked = follow_up
    o = placed(session, marked)[0]
    assert o.pixel is not None
    session.fire(Event.GO_REVIEW)
    session.fire(Event.GO_LESIONS)
    session.set_removed(o.lesion_id, True)
    session._search.evidence = VisitEvidence()  # as after opening the visit again
    session.not_in_view(o.lesion_id)
    listening.clear()
    check = session.check_site(o.lesion_id, session.snapshot.views["front"], o.pixel)
    ((lesions, _),) = listening
    numbers = {x.id: str(x.number) for x in session.snapshot.lesions}
    assert {p.query.id: p.query.healed for p in lesions}[numbers[o.lesion_id]]
    assert sum(p.query.healed for p in lesions) == 1
    assert check.distance_m is not None
    listening.clear()
    session.check_site(o.lesion_id, session.snapshot.views["front"], o.pixel)
    assert not listening, "the second click is quick"


def test_confirmed_lesions_hold_the_search_for_the_others_and_decisions_stay(
    follow_up: tuple[VisitSession, dict[str, int]],
    listening: list[tuple[list[PickedLesion], MethodContext]],
    take: Take,
) -> None:
    session, marked = follow_up
    assert session.refinable_count == 0
    with pytest.raises(Refused, match="nothing to refine"):
        session.refine_lesions()
    first, second = placed(session, marked)[:2]
    session.confirm(first.lesion_id)
    name = next(n for n, i in marked.items() if i == second.lesion_id)
    where = seen_lesions(take("A", 2), 20)[name]
    session.move(second.lesion_id, session.snapshot.views["front"], where)
    waiting = {i for i in marked.values() if session.status(i).needs_doctor}
    assert session.refinable_count == len(waiting)
    listening.clear()
    outcome = session.refine_lesions()
    numbers = {x.id: str(x.number) for x in session.snapshot.lesions}
    ((lesions, context),) = listening
    assert {p.query.id for p in lesions} <= {numbers[i] for i in waiting}
    assert {k.id for k in context.known} == {numbers[first.lesion_id], numbers[second.lesion_id]}
    known = next(k for k in context.known if k.id == numbers[second.lesion_id])
    truth = take("A", 2).truth
    place = truth.mole_points_m[list(truth.mole_ids).index(name)]
    assert np.linalg.norm(known.followup.position_m - place) < 0.01
    session.adopt_search(outcome)
    assert session.state is State.CHECK
    decided = session.snapshot.in_force(second.lesion_id)
    assert decided is not None
    assert (decided.decision, decided.pixel) == ("corrected", where)
    assert session.snapshot.in_force(first.lesion_id).decision == "confirmed"  # type: ignore[union-attr]


def _observation(**changed: object) -> Observation:
    now = datetime(2026, 3, 1, tzinfo=UTC)
    place, pixel = (0.1, 0.2, 2.0), (300.0, 200.0)
    o = Observation(
        1, 1, 1, 1, "predicted", pixel, place, pixel, place, 0.03, 0.8, False, "trilateration", "", (),
        "proposed", None, None, None, "", now, 1, now, 1,
    )  # fmt: skip
    return replace(o, **changed)  # type: ignore[arg-type]


def test_the_region_decides_what_is_confident_and_disagreement_forbids_it() -> None:
    o = _observation()

    def evidence(axes: tuple[float, float], agreement: float | None) -> VisitEvidence:
        made = VisitEvidence()
        region = Region(axes, np.array([1.0, 0.0, 0.0]))
        point = np.asarray(o.proposed_point_m)
        lesion = RelocatedLesion("1", "predicted", "", point, region=region, agreement_m=agreement)
        made.keep([Answer(o.lesion_id, o.capture_id, lesion)])
        return made

    assert is_confident(o, evidence((0.03, 0.012), 0.02))
    assert not is_confident(o, evidence((0.03, 0.02), 0.02))
    assert not is_confident(o, evidence((0.05, 0.005), 0.02))
    assert not is_confident(o, evidence((0.02, 0.01), 0.2)), "geodesics and registration disagree"
    assert "200 mm away" in describe(o, str, evidence((0.02, 0.01), 0.2)).detail
    assert not is_confident(o, VisitEvidence()), "without the ellipse the stored radius counts"
    moved = replace(o, proposed_point_m=(0.1, 0.25, 2.0))
    assert evidence((0.03, 0.012), None).of(moved) is None, "an older answer says nothing on a newer proposal"


def test_sizes_are_told_in_whole_millimetres() -> None:
    assert region_text(None) == ""
    assert region_text((0.0304, 0.0121)) == "±30 x 12 mm"
    assert region_text((0.0204, 0.0201)) == "±20 mm"
    assert region_text((0.0002, 0.0001)) == "±1 mm"
