"""Relocation of a simulated patient's lesions, with recorded joints: from captures to answers."""

from __future__ import annotations

import numpy as np
import pytest

from core.anchors import AnalysedCapture, analyse_capture
from core.errors import Cancelled, InputError
from core.relocation import (
    RELOCATION_METHODS,
    LesionQuery,
    RelocationOptions,
    register_relocation_method,
    relocate,
    relocate_visit,
)
from core.relocation.explain import explain_lesion
from core.relocation.explain_draw import draw_explanation
from core.relocation.registry import MethodOutcome
from core.relocation.types import Estimate
from devices.simulator import SimulatedPatient, make_rig


class NoTracker:
    """Recorded joints need no tracker; asking one is an error."""

    name = "none"

    def detect(self, rgb):
        raise AssertionError("the recorded joints were not used")

    def close(self):
        pass


class Patients:
    """Captures of simulated people, each made once."""

    def __init__(self):
        self.people = {
            shape: SimulatedPatient(shape, 5, 60, lesions=30, rig=make_rig((960, 720)))
            for shape in ("m_young_avg", "child10")
        }
        self.made = {}

    def capture(self, stance, visit, view="front", shape="m_young_avg"):
        key = (stance, visit, view, shape)
        if key not in self.made:
            shot = self.people[shape].capture(
                stance, view, visit, frames=4, seed=visit, joints=True, distance_m=2.5
            )
            self.made[key] = analyse_capture(shot.capture, NoTracker()), shot.truth
        return self.made[key]

    def pair(self, first, second, shape="m_young_avg"):
        """Two captures, the queries of the lesions that the first shows, and rows of the second's truth."""
        (one, truth1), (two, truth2) = (
            self.capture(first, 1, shape=shape),
            self.capture(second, 2, shape=shape),
        )
        names = [n for n in truth1.lesion_ids if truth1.mole_visible[truth1.mole_row[n]]]
        queries = [LesionQuery(n, tuple(truth1.mole_pixels[truth1.mole_row[n]])) for n in names]
        return one, two, queries, truth2


@pytest.fixture(scope="module")
def patients():
    return Patients()


def errors(result, truth):
    """Metres to the truth of every answered lesion that the follow-up shows."""
    rows = {lesion.id: truth.mole_row[lesion.id] for lesion in result.lesions}
    return np.array(
        [
            np.linalg.norm(lesion.point_m - truth.mole_points_m[rows[lesion.id]])
            for lesion in result.lesions
            if lesion.has_point and truth.mole_visible[rows[lesion.id]]
        ]
    )


@pytest.mark.parametrize(("second", "worst_mm"), [("psi", 22), ("A", 35)])
def test_trilateration_finds_lesions_in_the_same_and_in_another_stance(patients, second, worst_mm):
    one, two, queries, truth = patients.pair("psi", second)
    result = relocate(one, two, queries, method="trilateration")
    assert result.method == "trilateration"
    assert [lesion.id for lesion in result.lesions] == [q.id for q in queries]
    found = errors(result, truth)
    seen = sum(bool(truth.mole_visible[truth.mole_row[q.id]]) for q in queries)
    assert len(found) >= 0.85 * seen
    assert 1000 * found.mean() < worst_mm
    surface = two.scan.surface
    for lesion in result.lesions:
        assert lesion.status != "found"
        assert not lesion.appearance_matched
        if lesion.has_point:
            assert np.linalg.norm(surface.nearest(lesion.point_m)[0].position_m - lesion.point_m) < 1e-6
            assert lesion.pixel == pytest.approx(two.capture.rig.project_to_picture(lesion.point_m)[0])
            assert 0 < lesion.radius95_m < 0.3
            assert 0 < lesion.confidence < 1
        else:
            assert lesion.reason


@pytest.mark.parametrize(("second", "worst_mm"), [("psi", 10), ("A", 14)])
def test_the_default_finds_them_nearer_by_shape_alone(patients, second, worst_mm):
    one, two, queries, truth = patients.pair("psi", second)
    result = relocate(one, two, queries, appearance=False)
    assert result.method == "fused"
    found = errors(result, truth)
    seen = sum(bool(truth.mole_visible[truth.mole_row[q.id]]) for q in queries)
    assert len(found) >= 0.85 * seen
    assert 1000 * found.mean() < worst_mm
    assert found.mean() < errors(relocate(one, two, queries, method="trilateration"), truth).mean()


@pytest.mark.parametrize("method", ["voting-dijkstra", "voting-fmm"])
def test_voting_comes_near_but_trilateration_comes_nearer(patients, method):
    one, two, queries, truth = patients.pair("psi", "psi")
    voted = errors(relocate(one, two, queries, method=method), truth)
    placed = errors(relocate(one, two, queries, method="trilateration"), truth)
    assert np.median(voted) < 0.07
    assert placed.mean() < voted.mean()


def test_the_same_call_gives_the_same_answer(patients):
    one, two, queries, _ = patients.pair("psi", "A")
    a, b = (relocate(one, two, queries[:6], method="trilateration", seed=3) for _ in range(2))
    for x, y in zip(a.lesions, b.lesions, strict=True):
        assert (x.status, x.confidence) == (y.status, y.confidence)
        assert x.point_m == pytest.approx(y.point_m) if x.has_point else not y.has_point


def test_every_phase_is_timed(patients):
    one, two, queries, _ = patients.pair("psi", "psi")
    for method, own in (
        ("trilateration", {"anchors", "trilateration"}),
        ("fused", {"registration", "spots", "matching", "trilateration", "judgement"}),
    ):
        seconds = relocate(one, two, queries[:2], method=method).seconds
        assert {"lesions", "geodesics", "visibility", "total"} | own <= set(seconds)
        assert seconds["total"] >= max(v for k, v in seconds.items() if k != "total")


def test_a_click_beside_the_body_is_refused_and_the_rest_is_answered(patients):
    one, two, queries, _ = patients.pair("psi", "psi")
    result = relocate(one, two, [LesionQuery("wall", (200.0, 150.0)), queries[0]])
    assert result["wall"].status == "refused"
    assert "not on the body" in result["wall"].reason
    assert result[queries[0].id].has_point


def test_a_click_outside_the_picture_is_bad_input(patients):
    one, two, _, _ = patients.pair("psi", "psi")
    with pytest.raises(InputError, match="outside"):
        relocate(one, two, [LesionQuery("L", (5000.0, 5.0))])


def test_no_lesions_no_answers(patients):
    one, two, _, _ = patients.pair("psi", "psi")
    assert relocate(one, two, []).lesions == ()


def test_another_person_is_refused(patients):
    one, _, queries, _ = patients.pair("psi", "psi")
    child, _ = patients.capture("psi", 1, shape="child10")
    for lesion in relocate(one, child, queries[:3]).lesions:
        assert lesion.status == "refused"
        assert "another person" in lesion.reason


def test_the_back_does_not_answer_for_the_front(patients):
    one, _, queries, _ = patients.pair("psi", "psi")
    back, _ = patients.capture("psi", 2, "back")
    for lesion in relocate(one, back, queries[:3]).lesions:
        assert lesion.status == "refused"
        assert "different sides" in lesion.reason


def without_anchors(analysed: AnalysedCapture, keep: int) -> AnalysedCapture:
    """The same capture with only so many joints seen."""
    from dataclasses import replace

    from core.anchors import Skeleton, with_skeleton

    joints = {
        name: joint if k < keep else replace(joint, visibility=0.0)
        for k, (name, joint) in enumerate(analysed.skeleton.joints.items())
    }
    return with_skeleton(analysed.scan, Skeleton(joints, {}, analysed.skeleton.source))


def test_too_few_anchors_are_no_evidence(patients):
    one, two, queries, _ = patients.pair("psi", "psi")
    for lesion in relocate(one, without_anchors(two, 3), queries[:2]).lesions:
        assert lesion.status == "refused"
        assert "3 anchors" in lesion.reason


def test_a_lesion_is_searched_in_the_view_that_shows_it(patients):
    one, two, queries, _ = patients.pair("psi", "psi")
    back, _ = patients.capture("psi", 2, "back")
    asked = [LesionQuery(q.id, q.pixel, capture="before") for q in queries[:3]]
    result = relocate_visit({"before": one}, {"behind": back, "ahead": two}, asked)
    assert [lesion.capture for lesion in result.lesions] == ["ahead"] * 3
    with pytest.raises(InputError, match="capture"):
        relocate_visit({"a": one, "b": two}, {"c": two}, queries[:1])
    with pytest.raises(InputError, match="nowhere"):
        relocate_visit({"a": one}, {"c": two}, [LesionQuery("L", (1.0, 1.0), capture="nowhere")])


def test_an_unknown_method_names_the_known_ones(patients):
    one, two, queries, _ = patients.pair("psi", "psi")
    with pytest.raises(InputError) as caught:
        relocate(one, two, queries, method="magic")
    assert "voting-fmm" in caught.value.advice


def test_a_new_method_is_one_registration_away(patients):
    class FirstVertex:
        name = "first-vertex"

        def estimate(self, pair, lesions, context):
            point = pair.followup.scan.surface.vertices[0]
            return MethodOutcome(tuple(Estimate(point, 0.1, 0.9, appearance_matched=True) for _ in lesions))

    one, two, queries, _ = patients.pair("psi", "psi")
    register_relocation_method("first-vertex", FirstVertex)
    try:
        lesion = relocate(one, two, queries[:1], method="first-vertex").lesions[0]
    finally:
        del RELOCATION_METHODS["first-vertex"]
    assert lesion.status == "found"
    assert lesion.point_m == pytest.approx(two.scan.surface.vertices[0])


def test_relocation_can_be_cancelled(patients):
    one, two, queries, _ = patients.pair("psi", "psi")

    def stop(fraction, message=""):
        if fraction > 0.2:
            raise Cancelled

    with pytest.raises(Cancelled):
        relocate(one, two, queries, progress=stop)


def test_an_explanation_holds_the_evidence_of_the_answer(patients):
    one, two, queries, _ = patients.pair("psi", "psi")
    options = RelocationOptions(delta_m=0.04)
    for method in ("trilateration", "voting-dijkstra", "voting-fmm"):
        shown = explain_lesion(one, two, queries[0], method=method, options=options)
        assert shown is not None
        assert (shown.bands.sum(axis=0) == shown.votes).all()
        assert set(shown.biggest_cluster) <= set(shown.candidates)
        assert len(shown.paths) == len(shown.anchor_names)
        for name, distance in zip(shown.anchor_names, shown.distances_m, strict=True):
            path = shown.first_paths[name]
            assert np.linalg.norm(path[0] - shown.lesion_m) < 0.02
            assert np.linalg.norm(path[-1] - one.anchors[name].position_m) < 0.02
            if method == "trilateration":
                length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
                assert length == pytest.approx(distance, rel=0.03, abs=0.01)


def test_an_explanation_can_be_looked_at(patients):
    one, two, queries, _ = patients.pair("psi", "A")
    shown = explain_lesion(one, two, queries[0])
    assert shown is not None
    pictures = draw_explanation(shown, one, two)
    assert list(pictures) == ["1-paths-first", "2-bands", "3-votes", "4-cluster", "5-paths-followup"]
    for picture in pictures.values():
        assert picture.dtype == np.uint8
        assert picture.shape[0] >= 1000
        packed = picture.astype(np.int32) @ [65536, 256, 1]
        assert len(np.unique(packed)) > 50


def test_a_lesion_beside_the_skin_has_no_explanation(patients):
    one, two, _, _ = patients.pair("psi", "A")
    assert explain_lesion(one, two, LesionQuery("wall", (5.0, 5.0))) is None
