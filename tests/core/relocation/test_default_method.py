"""The shipped estimator on a simulated patient: registration, moles and geodesics in one answer."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from core.anchors import AnalysedCapture, with_skeleton
from core.errors import Cancelled
from core.relocation import ConfirmedLesion, LesionQuery, RelocationOptions, RelocationResult, relocate
from core.relocation.registration_methods import GEODESICS_ALONE, NO_TRUNK
from core.surface import scan_body
from tests.core.relocation.conftest import HEALED


@pytest.fixture(scope="module")
def answers(simulated_visits):
    """Results by stance, whether looks may be used, and method; each computed once."""

    @cache
    def make(stance: str, appearance: bool = True, method: str = "fused") -> RelocationResult:
        two, _ = simulated_visits.followup(stance)
        return relocate(
            simulated_visits.first, two, simulated_visits.queries, method=method, appearance=appearance
        )

    return make


def errors(result: RelocationResult, truth) -> dict[str, float]:
    """Metres to the truth of every answered lesion that the follow-up shows."""
    rows = truth.mole_row
    return {
        x.id: float(np.linalg.norm(x.point_m - truth.mole_points_m[rows[x.id]]))
        for x in result.lesions
        if x.has_point and truth.mole_visible[rows[x.id]]
    }


def mean(of: dict[str, float], names=None) -> float:
    return float(np.mean([e for n, e in of.items() if names is None or n in names]))


@pytest.mark.parametrize(("stance", "seen_mm", "shape_mm"), [("psi", 6, 10), ("A", 7, 13)])
def test_lesions_are_found_to_millimetres_and_nearer_with_their_looks(
    simulated_visits, answers, stance, seen_mm, shape_mm
):
    _, truth = simulated_visits.followup(stance)
    with_looks, by_shape = answers(stance), answers(stance, False)
    assert [x.id for x in with_looks.lesions] == [q.id for q in simulated_visits.queries]
    seen, carried = errors(with_looks, truth), errors(by_shape, truth)
    visible = [q.id for q in simulated_visits.queries if truth.mole_visible[truth.mole_row[q.id]]]
    assert len(seen) >= 0.9 * len(visible)
    assert len(carried) >= 0.9 * len(visible)
    assert 1000 * mean(seen, set(seen) - set(HEALED)) < seen_mm
    assert 1000 * mean(carried) < shape_mm
    found = [x.id for x in with_looks.lesions if x.status == "found"]
    assert len(found) >= 0.6 * len(set(visible) - set(HEALED))
    assert max(seen[n] for n in found if n in seen) < 0.012, "nothing is taken for another spot"


@pytest.mark.parametrize("stance", ["psi", "A"])
def test_an_answer_says_what_it_is(simulated_visits, answers, stance):
    two, _ = simulated_visits.followup(stance)
    rig, spots = two.capture.rig, two.spots
    for appearance in (True, False):
        for x in answers(stance, appearance).lesions:
            assert x.reason
            assert x.appearance_matched == (x.status == "found")
            if not x.has_point:
                assert x.status in ("not_visible", "refused")
                assert x.region is None
                continue
            assert 0 < x.confidence <= 1
            long, short = x.region.axes_m
            assert long >= short > 0
            assert x.radius95_m == pytest.approx(long)
            assert long < 0.15
            normal = two.scan.surface.normal_at(two.scan.surface.nearest(x.point_m)[0])
            assert abs(x.region.direction @ normal) < 0.2
            if x.status == "found":
                assert np.linalg.norm(spots.points_m - x.point_m, axis=1).min() < 1e-9
                assert np.linalg.norm(spots.pixels - x.pixel, axis=1).min() < 1e-9
            else:
                assert x.pixel == pytest.approx(rig.project_to_picture(x.point_m)[0])
                nearest = two.scan.surface.nearest(x.point_m)[0].position_m
                assert np.linalg.norm(nearest - x.point_m) < 1e-6
            if x.status == "ambiguous":
                assert x.candidates


def test_what_was_seen_again_is_known_best(answers):
    result = answers("A")
    found = [x.radius95_m for x in result.lesions if x.status == "found"]
    carried = [x.radius95_m for x in result.lesions if x.status == "predicted"]
    assert np.median(found) < np.median(carried)


@pytest.mark.parametrize("stance", ["psi", "A"])
def test_the_stated_region_mostly_holds(simulated_visits, answers, stance):
    _, truth = simulated_visits.followup(stance)
    inside = []
    for appearance in (True, False):
        result = answers(stance, appearance)
        off = errors(result, truth)
        inside += [off[x.id] < 1.2 * x.radius95_m for x in result.lesions if x.id in off]
    assert np.mean(inside) > 0.85


def test_a_healed_lesion_is_carried_never_seen_and_known_less_well(simulated_visits, answers):
    for stance in ("psi", "A"):
        _, truth = simulated_visits.followup(stance)
        result = answers(stance)
        off = errors(result, truth)
        radii = [x.radius95_m for x in result.lesions if x.status == "found"]
        healed = [result[n] for n in HEALED if n in {x.id for x in result.lesions}]
        assert len(healed) >= 2
        for x in healed:
            assert x.status != "found"
            assert not x.appearance_matched
            if x.id in off:
                assert off[x.id] < 0.025
                assert x.radius95_m > np.median(radii)


def test_a_healed_lesion_is_not_matched_even_where_its_spot_is_still_there(simulated_visits, answers):
    found = [x.id for x in answers("psi").lesions if x.status == "found"][:3]
    asked = [replace(q, healed=True) for q in simulated_visits.queries if q.id in found]
    result = relocate(simulated_visits.first, simulated_visits.same, asked)
    seen = {x.id: x for x in answers("psi").lesions}
    for x in result.lesions:
        assert x.status != "found"
        assert x.radius95_m > seen[x.id].radius95_m
        assert np.linalg.norm(x.point_m - seen[x.id].point_m) < 0.03


def listed(spots, truth, within_m=0.012) -> list[str]:
    """Ids of the moles that spots are."""
    out = []
    for spot in spots:
        away = np.linalg.norm(truth.mole_points_m - spot.point_m, axis=1)
        out.append(truth.mole_ids[away.argmin()] if away.min() < within_m else "none")
    return out


@pytest.mark.parametrize("stance", ["psi", "A"])
def test_moles_that_came_and_went_are_listed(simulated_visits, answers, stance):
    result = answers(stance)
    first, (_, second) = simulated_visits.first_truth, simulated_visits.followup(stance)
    came = set(second.mole_ids) - set(first.mole_ids)
    went = set(first.mole_ids) - set(second.mole_ids)
    seen_new = {n for n in came if second.mole_visible[second.mole_row[n]]}
    seen_gone = {n for n in went if first.mole_visible[first.mole_row[n]]}
    new, gone = listed(result.new_spots, second), listed(result.vanished_spots, first)
    assert len(seen_new & set(new)) >= 0.5 * len(seen_new)
    assert len(seen_gone & set(gone)) >= 0.4 * len(seen_gone)
    stayed = set(first.mole_ids) & set(second.mole_ids)
    assert len(stayed & set(new)) <= 2, "a mole that was there is not new"
    for spots in (result.new_spots, result.vanished_spots):
        confidence = [s.confidence for s in spots]
        assert confidence == sorted(confidence, reverse=True)
        assert all(0 < c <= 1 for c in confidence)
        assert all(np.isfinite(s.point_m).all() and len(s.pixel) == 2 for s in spots)


def test_a_lesion_in_question_is_not_called_vanished(simulated_visits, answers):
    for stance in ("psi", "A"):
        asked = {q.id for q in simulated_visits.queries}
        assert not asked & set(listed(answers(stance).vanished_spots, simulated_visits.first_truth, 0.004))


def recoloured(analysed: AnalysedCapture, seed: int) -> AnalysedCapture:
    """The same capture with every colour pixel another one, and the joints it had."""
    color = analysed.capture.color
    noise = np.random.default_rng(seed).integers(1, 256, color.shape, dtype=np.uint8)
    capture = replace(analysed.capture, color=color ^ noise)
    assert (capture.color != color).all()
    scan = replace(analysed.scan, capture=capture)
    return replace(analysed, capture=capture, scan=scan)


def test_without_looks_no_colour_counts(simulated_visits, answers):
    one, two = recoloured(simulated_visits.first, 1), recoloured(simulated_visits.other, 2)
    plain = answers("A", False)
    result = relocate(one, two, simulated_visits.queries, appearance=False)
    for x, y in zip(plain.lesions, result.lesions, strict=True):
        assert (x.status, x.reason, x.confidence, x.radius95_m) == (
            y.status,
            y.reason,
            y.confidence,
            y.radius95_m,
        )
        assert (x.point_m == y.point_m).all() if x.has_point else not y.has_point
    assert plain.new_spots == result.new_spots == ()
    assert plain.vanished_spots == result.vanished_spots == ()
    assert not any(x.appearance_matched or x.candidates for x in plain.lesions)
    assert "spots" not in plain.seconds


def test_the_same_seed_gives_the_same_answers_and_another_nearly_so(simulated_visits, answers):
    one, two = simulated_visits.first, simulated_visits.other
    again = relocate(one, two, simulated_visits.queries)
    for x, y in zip(answers("A").lesions, again.lesions, strict=True):
        assert (x.status, x.confidence, x.pixel, x.radius95_m) == (
            y.status,
            y.confidence,
            y.pixel,
            y.radius95_m,
        )
        assert (x.point_m == y.point_m).all() if x.has_point else not y.has_point
    other = relocate(one, two, simulated_visits.queries, seed=7)
    off = [
        np.linalg.norm(x.point_m - y.point_m)
        for x, y in zip(again.lesions, other.lesions, strict=True)
        if x.has_point and y.has_point
    ]
    assert np.median(off) < 0.003


def test_an_answer_does_not_depend_on_which_others_are_asked(simulated_visits, answers):
    """The other moles take part in the matching whether they are asked about or not."""
    all_of_them = answers("psi")
    asked = simulated_visits.queries[:3]
    few = relocate(simulated_visits.first, simulated_visits.same, asked)
    for x in few.lesions:
        assert x.has_point
        assert np.linalg.norm(x.point_m - all_of_them[x.id].point_m) < 0.004


def pixel_of(analysed: AnalysedCapture, place: np.ndarray) -> tuple[float, float]:
    """Picture pixel of the skin nearest to a place."""
    skin = analysed.scan.surface.nearest(place)[0].position_m
    u, v = analysed.capture.rig.project_to_picture(skin)[0]
    return float(u), float(v)


def test_confirmed_lesions_pull_the_others(simulated_visits):
    """The doctor says that the skin of the belly lies 15 mm lower: what is near follows, what is far not."""
    one, two = simulated_visits.first, simulated_visits.same
    here, there = (
        v.scan.surface.nearest(v.skeleton.point("torso") - [0.0, 0.0, 0.12])[0].position_m for v in (one, two)
    )
    around = 0.05 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0.0]])
    lower = np.array([0.0, 0.015, 0.0])
    asked = [
        LesionQuery("near", pixel_of(one, here)),
        LesionQuery("far", pixel_of(one, one.skeleton.point("left_knee") - [0.0, 0.0, 0.06])),
    ]
    confirmed = {
        way: [
            ConfirmedLesion(
                LesionQuery(f"K{k}", pixel_of(one, here + a)), pixel_of(two, there + a + way * lower)
            )
            for k, a in enumerate(around)
        ]
        for way in (0.0, 1.0)
    }
    plain, drawn = (relocate(one, two, asked, appearance=False, confirmed=c) for c in confirmed.values())
    moved = {n: drawn[n].point_m - plain[n].point_m for n in ("near", "far")}
    assert moved["near"][1] > 0.6 * lower[1]
    assert np.linalg.norm(moved["far"]) < 0.003


def test_a_confirmed_lesion_that_is_asked_for_lands_on_its_place(simulated_visits):
    one, two, truth = simulated_visits.first, simulated_visits.other, simulated_visits.truths["A"]
    query = next(
        q for q in simulated_visits.queries if q.id not in HEALED and truth.mole_visible[truth.mole_row[q.id]]
    )
    pixel = truth.mole_pixels[truth.mole_row[query.id]]
    confirmed = [ConfirmedLesion(query, (float(pixel[0]), float(pixel[1])))]
    free = relocate(one, two, [query], appearance=False)[query.id]
    tied = relocate(one, two, [query], appearance=False, confirmed=confirmed)[query.id]
    place = truth.mole_points_m[truth.mole_row[query.id]]
    assert np.linalg.norm(tied.point_m - place) < 0.008
    assert np.linalg.norm(tied.point_m - place) <= np.linalg.norm(free.point_m - place) + 0.001


def test_a_confirmed_pixel_beside_the_body_changes_nothing(simulated_visits, answers):
    asked = simulated_visits.queries[:2]
    wall = ConfirmedLesion(asked[0], (30.0, 30.0))
    result = relocate(
        simulated_visits.first, simulated_visits.same, asked, appearance=False, confirmed=[wall]
    )
    for x in result.lesions:
        assert x.point_m == pytest.approx(answers("psi", False)[x.id].point_m, abs=1e-3)


def test_geodesics_check_the_fused_answer_only(simulated_visits, answers):
    fused, registered = answers("psi"), answers("psi", method="registration")
    for x in fused.lesions:
        if x.has_point:
            assert x.agreement_m is not None
            assert 0 <= x.agreement_m < 0.2
    assert all(x.agreement_m is None for x in registered.lesions)
    assert {x.id for x in registered.lesions if x.status == "found"} == {
        x.id for x in fused.lesions if x.status == "found"
    }


def without(analysed: AnalysedCapture, names: tuple[str, ...]) -> AnalysedCapture:
    joints = {n: replace(j, visibility=0.0) if n in names else j for n, j in analysed.skeleton.joints.items()}
    return with_skeleton(analysed.scan, replace(analysed.skeleton, joints=joints))


TRUNK = ("neck", "torso", "left_shoulder", "right_shoulder")


def test_without_a_trunk_geodesics_answer_alone_and_say_so(simulated_visits):
    blind, asked = without(simulated_visits.same, TRUNK), simulated_visits.queries[:3]
    registered = relocate(simulated_visits.first, blind, asked, method="registration")
    assert [x.status for x in registered.lesions] == ["refused"] * 3
    assert {x.reason for x in registered.lesions} == {NO_TRUNK}
    fused = relocate(simulated_visits.first, blind, asked)
    plain = relocate(simulated_visits.first, blind, asked, method="trilateration")
    assert GEODESICS_ALONE in fused.warnings
    for x, y in zip(fused.lesions, plain.lesions, strict=True):
        assert x.status == y.status
        assert x.status != "found"


def test_a_limb_that_the_follow_up_does_not_show_is_not_invented(simulated_visits):
    """The right forearm is not tracked: lesions on it are not answered somewhere else."""
    first, truth = simulated_visits.first, simulated_visits.first_truth
    elbow, hand = first.skeleton.point("right_elbow"), first.skeleton.point("right_hand")
    wrist = first.scan.surface.nearest(0.3 * elbow + 0.7 * hand + [0.0, 0.0, -0.04])[0].position_m
    u, v = truth.rig.project_to_picture(wrist)[0]
    blind = without(simulated_visits.other, ("right_elbow", "right_hand"))
    asked = [LesionQuery("wrist", (float(u), float(v)))]
    (lesion,) = relocate(first, blind, asked).lesions
    assert lesion.status in ("refused", "not_visible")
    assert not lesion.has_point
    (wanted,) = relocate(first, blind, asked, options=RelocationOptions(check_visibility=False)).lesions
    assert wanted.status == "refused"
    assert "right forearm" in wanted.reason


def test_hidden_lesions_are_said_to_be_hidden_unless_a_place_is_wanted_all_the_same(simulated_visits):
    """Half of the follow-up's body is not in its picture: a lesion there is not in view."""
    first, two = simulated_visits.first, simulated_visits.same
    skin = two.scan.surface
    knee = 0.5 * (two.skeleton.point("left_knee") + two.skeleton.point("left_hip"))
    cut = two.capture.depth_frames.copy()
    row = int(skin.camera.project(knee)[0, 1])
    cut[:, row:, :] = 0
    half = with_skeleton(scan_body(replace(two.capture, depth_frames=cut)), two.skeleton)
    shin = 0.5 * (first.skeleton.point("left_knee") + first.skeleton.point("left_foot"))
    place = first.scan.surface.nearest(shin - [0.0, 0.0, 0.08])[0].position_m
    u, v = first.capture.rig.project_to_picture(place)[0]
    asked = [LesionQuery("shin", (float(u), float(v))), simulated_visits.queries[0]]
    result = relocate(first, half, asked)
    assert result["shin"].status in ("not_visible", "refused")
    assert result[asked[1].id].has_point
    wanted = relocate(first, half, asked, options=RelocationOptions(check_visibility=False))
    assert wanted["shin"].status != "not_visible"


def test_no_lesions_no_answers_and_clicks_beside_the_body_are_refused(simulated_visits):
    one, two = simulated_visits.first, simulated_visits.same
    assert relocate(one, two, []).lesions == ()
    (wall,) = relocate(one, two, [LesionQuery("wall", (20.0, 20.0))]).lesions
    assert wall.status == "refused"


def test_it_can_be_cancelled_in_every_phase(simulated_visits):
    told: list[str] = []

    def stop_at(limit):
        def progress(fraction, message=""):
            told.append(message)
            if fraction >= limit:
                raise Cancelled

        return progress

    for limit in (0.12, 0.45):
        with pytest.raises(Cancelled):
            relocate(
                simulated_visits.first,
                simulated_visits.same,
                simulated_visits.queries[:1],
                progress=stop_at(limit),
            )
    assert any("moles" in message for message in told)
