"""What the truth of a simulated capture promises, checked against the pictures and depths themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.errors import InputError
from devices.simulator import (
    STILL,
    Bystander,
    Room,
    SimulatedCapture,
    SimulatedPatient,
    VisitChange,
    make_rig,
    read_truth,
    write_simulated,
)
from devices.simulator.body import enclosed_volume, load_body, pose_body
from devices.simulator.figure import skin_slide, with_weight_change
from devices.simulator.stances import STANCES, Posture, take_stance


def _brightness(simulated: SimulatedCapture) -> np.ndarray:
    assert simulated.capture.color is not None
    return simulated.capture.color.astype(float).mean(axis=2)


def _darker_than_around(simulated: SimulatedCapture, min_radius_px: float) -> list[float]:
    """Brightness in the middle of each visible mole against the skin around it."""
    truth, picture = simulated.truth, _brightness(simulated)
    camera = simulated.capture.rig.picture_camera
    shares = []
    for k in np.flatnonzero(truth.mole_visible):
        radius = truth.mole_radius_m[k] * camera.fx / truth.mole_points_m[k, 2]
        if radius < min_radius_px:
            continue
        u, v = np.rint(truth.mole_pixels[k]).astype(int)
        reach = int(np.ceil(2.5 * radius)) + 2
        window = picture[v - reach : v + reach + 1, u - reach : u + reach + 1]
        shares.append(float(picture[v, u] / np.median(window)))
    return shares


def test_a_mole_is_seen_in_the_picture_where_the_truth_says(first: SimulatedCapture) -> None:
    shares = _darker_than_around(first, 0.45)
    assert len(shares) >= 15
    assert np.mean(np.array(shares) < 0.97) > 0.9


def test_a_mole_lies_where_the_ray_through_its_pixel_meets_the_skin(first: SimulatedCapture) -> None:
    truth, rig = first.truth, first.capture.rig
    rows = np.flatnonzero(truth.mole_visible)
    assert len(rows) > 20
    for k in rows:
        place = truth.surface_point_at(truth.mole_pixels[k])
        assert place is not None
        assert place.barycentric.sum() == pytest.approx(1.0)
        pixel = rig.project_to_picture(place.position_m)[0]
        assert np.linalg.norm(pixel - truth.mole_pixels[k]) < 1.0
        assert np.linalg.norm(place.position_m - truth.mole_points_m[k]) < 0.004


def test_the_measured_depth_of_a_mole_agrees_within_the_noise(first: SimulatedCapture) -> None:
    truth, capture = first.truth, first.capture
    rows = np.flatnonzero(truth.mole_visible)
    u, v = np.rint(truth.mole_depth_pixels[rows]).astype(int).T
    frames = capture.depth_frames[:, v, u] * capture.depth_unit_m
    frames = np.where(frames > 0, frames, np.nan)
    measured = np.isfinite(frames).any(axis=0)
    off = np.nanmedian(frames[:, measured], axis=0) - truth.mole_points_m[rows[measured], 2]
    assert measured.mean() > 0.9
    assert np.median(np.abs(off)) < 0.010
    assert np.mean(np.abs(off) < 0.035) > 0.9


@pytest.mark.parametrize(("which", "sign"), [("front", 1.0), ("back", -1.0)])
def test_the_patients_own_left_is_on_the_right_of_a_front_view(
    which: str, sign: float, front: SimulatedCapture, back: SimulatedCapture
) -> None:
    joints = {"front": front, "back": back}[which].truth.joints_m
    for part in ("shoulder", "elbow", "hand", "hip", "knee", "foot"):
        assert sign * (joints[f"left_{part}"][0] - joints[f"right_{part}"][0]) > 0.1


@pytest.mark.parametrize(("view", "nearer"), [("left", "left"), ("right", "right")])
def test_a_side_view_shows_that_side(dummy: SimulatedPatient, view: str, nearer: str) -> None:
    joints = dummy.capture("A", view, frames=1).truth.joints_m
    other = "right" if nearer == "left" else "left"
    assert joints[f"{nearer}_shoulder"][2] < joints[f"{other}_shoulder"][2] - 0.2


def test_turning_is_toward_the_patients_own_left(followup: SimulatedCapture) -> None:
    joints = followup.truth.joints_m
    assert joints["left_shoulder"][2] > joints["right_shoulder"][2] + 0.03


def test_joints_travel_with_the_capture_only_when_asked(
    first: SimulatedCapture, followup: SimulatedCapture
) -> None:
    assert followup.capture.joints_m is None
    assert first.capture.joints_m is not None
    assert first.capture.joints_m.keys() == first.truth.joints_m.keys()
    assert len(first.truth.joints_m) == 15


def test_a_mole_keeps_its_identity_in_another_stance_and_visit(
    first: SimulatedCapture, followup: SimulatedCapture
) -> None:
    assert first.truth.mole_ids == followup.truth.mole_ids
    both = np.flatnonzero(first.truth.mole_visible & followup.truth.mole_visible)
    assert len(both) > 10
    moved = []
    for k in both:
        place = first.truth.surface_point_at(first.truth.mole_pixels[k])
        assert place is not None
        there = followup.truth.position(place.triangle, place.barycentric)
        moved.append(np.linalg.norm(there - followup.truth.mole_points_m[k]))
    assert max(moved) < 0.006


def test_unseen_moles_have_no_pixel(first: SimulatedCapture) -> None:
    truth = first.truth
    assert (np.isnan(truth.mole_pixels).any(axis=1) == ~truth.mole_visible_color).all()
    assert 0.2 < truth.mole_visible.mean() < 0.6


def test_moles_of_the_back_are_not_seen_from_the_front(
    front: SimulatedCapture, back: SimulatedCapture
) -> None:
    assert not (front.truth.mole_visible & back.truth.mole_visible).any()
    assert front.truth.mole_visible.sum() > 8
    assert back.truth.mole_visible.sum() > 8


def test_the_background_shows_no_skin(first: SimulatedCapture) -> None:
    assert first.truth.surface_point_at((3.0, 3.0)) is None
    assert first.truth.surface_point_at((-40.0, 3.0)) is None
    assert (first.truth.triangle[:, :40] == -1).all()


def test_pixel_truth_projects_back_onto_its_pixels(first: SimulatedCapture) -> None:
    truth = first.truth
    rows = np.arange(0, len(truth.pixel_numbers), 97)
    triangle, uv = truth.pixel_triangle[rows], truth.pixel_uv[rows]
    weights = np.column_stack([1 - uv.sum(axis=1), uv])
    pixels = truth.rig.project_to_picture(truth.position(triangle, weights))
    width = truth.rig.picture_camera.width
    expected = np.stack([truth.pixel_numbers[rows] % width, truth.pixel_numbers[rows] // width], axis=1)
    assert np.abs(pixels - expected).max() < 0.05
    v, u = expected[:, 1], expected[:, 0]
    assert (truth.triangle[v, u] == triangle).all()
    assert np.allclose(truth.barycentric[v, u], weights, atol=1e-6)


def test_the_auxiliary_camera_with_distortion_keeps_the_truth() -> None:
    rig = make_rig((1280, 960), distortion=True, device_seed=3)
    assert 0.025 <= np.linalg.norm(rig.color_from_depth.inverse().translation) <= 0.060
    patient = SimulatedPatient("f_young_avg", 2, moles=150, variation=STILL, rig=rig)
    simulated = patient.capture("A", frames=1)
    shares = _darker_than_around(simulated, 1.0)
    assert len(shares) > 15
    assert np.mean(np.array(shares) < 0.97) > 0.85


def test_the_same_seeds_give_the_same_capture() -> None:
    def shoot(seed: int) -> SimulatedCapture:
        patient = SimulatedPatient("child10", seed, moles=30, rig=make_rig((64, 48)))
        return patient.capture("A", frames=2)

    one, again, other = shoot(1), shoot(1), shoot(2)
    assert (one.capture.depth_frames == again.capture.depth_frames).all()
    assert one.capture.color is not None
    assert again.capture.color is not None
    assert (one.capture.color == again.capture.color).all()
    assert one.capture.taken_at == again.capture.taken_at
    assert (one.capture.depth_frames != other.capture.depth_frames).any()
    assert (one.truth.mole_triangle != other.truth.mole_triangle).any()


def test_a_second_person_is_in_the_room_but_not_in_the_truth() -> None:
    alone, joined = (
        SimulatedPatient(
            seed=1, moles=30, variation=STILL, rig=make_rig((160, 120)), room=Room(bystander=who)
        ).capture("down", frames=1)
        for who in (None, Bystander(right_m=0.9, behind_m=0.3))
    )
    nearer = alone.capture.depth_frames[0].astype(int) - joined.capture.depth_frames[0]
    someone = (nearer > 300) & (joined.capture.depth_frames[0] > 0)
    assert someone.sum() > 5000
    assert np.flatnonzero(someone.any(axis=0)).mean() > 400
    assert set(joined.truth.pixel_numbers) <= set(alone.truth.pixel_numbers)


def test_floor_and_wall_are_measured_where_they_stand(front: SimulatedCapture) -> None:
    capture = front.capture
    points = capture.rig.depth.backproject(capture.depth_frames[0] * capture.depth_unit_m)
    wall = points[60:200, 20:80].reshape(-1, 3)
    assert np.median(wall[wall[:, 2] > 0, 2]) == pytest.approx(3.3, abs=0.06)
    floor = points[455:, 20:120].reshape(-1, 3)
    floor = floor[floor[:, 2] > 0]
    assert len(floor) > 500
    assert np.median(floor[:, 1]) == pytest.approx(0.9, abs=0.02)


def test_an_open_room_measures_nothing_behind_the_patient() -> None:
    room = Room(floor=False, wall_behind_m=None)
    patient = SimulatedPatient(moles=10, lesions=2, room=room, variation=STILL, rig=make_rig((160, 120)))
    depth = patient.capture("A", frames=1, distance_m=2.3).capture.depth_frames[0]
    assert (depth[:, :60] == 0).all()
    assert 0.05 < (depth > 0).mean() < 0.25


def test_new_vanished_and_grown_moles_of_a_later_visit() -> None:
    change = VisitChange(new_moles=3, vanished=4, weight_change=0.05, growth={"L02": 1.5})
    patient = SimulatedPatient(seed=3, moles=60, changes={2: change})
    before, after, later = (patient.moles(v) for v in (1, 2, 3))
    assert set(after.ids) - set(before.ids) == {"N01", "N02", "N03"}
    gone = set(before.ids) - set(after.ids)
    assert len(gone) == 4
    assert not any(name.startswith("L") for name in gone)
    assert later.ids == after.ids
    radius = [m.marks.radius_m[m.ids.index("L02")] for m in (before, after)]
    assert radius[1] == pytest.approx(1.5 * radius[0])
    kept = [name for name in before.ids if name in after.ids]
    rows = [[m.ids.index(name) for name in kept] for m in (before, after)]
    assert (before.marks.triangle[rows[0]] == after.marks.triangle[rows[1]]).all()


def test_growth_of_an_unknown_mole_is_refused() -> None:
    patient = SimulatedPatient(moles=20, lesions=5, changes={2: VisitChange(growth={"X9": 2.0})})
    with pytest.raises(InputError, match="X9"):
        patient.moles(2)


@pytest.mark.parametrize("share", [-0.05, 0.03, 0.05])
def test_a_weight_change_is_a_change_of_volume(share: float) -> None:
    model = load_body("f_old_heavy")
    changed = with_weight_change(model, model.bind, share)
    ratio = enclosed_volume(changed, model.triangles) / enclosed_volume(model.bind, model.triangles)
    assert ratio == pytest.approx(1.0 + share, abs=0.002)


@pytest.mark.parametrize("stance", STANCES)
def test_skin_slides_by_millimetres_where_joints_bend(stance: str) -> None:
    model = load_body("m_young_avg")
    body = pose_body(model, take_stance(Posture(model), stance))
    slid = np.linalg.norm(skin_slide(body, np.random.default_rng(1)), axis=1)
    assert slid.max() < 0.015
    if stance in ("psi", "up", "forward", "knee"):
        assert slid.max() > 0.003
    assert slid[model.bone_weight("head") > 0.9].max() < 0.0005


def test_every_stance_keeps_the_bones_and_stands_on_the_floor() -> None:
    model = load_body("child10")
    lengths = set()
    for stance in STANCES:
        body = pose_body(model, take_stance(Posture(model), stance))
        assert body.vertices[:, 2].min() == pytest.approx(0.0)
        joints = body.joints
        lengths.add(round(float(np.linalg.norm(joints["left_knee"] - joints["left_hip"])), 6))
        lengths.add(round(float(np.linalg.norm(joints["right_knee"] - joints["right_hip"])), 6))
    assert len(lengths) <= 2


@pytest.mark.parametrize(
    ("change", "word"),
    [({"stance": "handstand"}, "handstand"), ({"view": "above"}, "above"), ({"frames": 0}, "frame")],
)
def test_impossible_captures_are_refused(
    dummy: SimulatedPatient, change: dict[str, object], word: str
) -> None:
    with pytest.raises(InputError, match=word):
        dummy.capture(**change)  # type: ignore[arg-type]


def test_capture_and_truth_survive_the_disk(first: SimulatedCapture, tmp_path) -> None:
    from core.capture.folder import read_capture

    folder = tmp_path / "psi"
    write_simulated(first, folder)
    capture, truth = read_capture(folder), read_truth(folder, first.capture.rig)
    assert (capture.depth_frames == first.capture.depth_frames).all()
    assert truth.mole_ids == first.truth.mole_ids
    assert np.allclose(truth.vertices_m, first.truth.vertices_m)
    pixel = first.truth.mole_pixels[np.flatnonzero(first.truth.mole_visible)[0]]
    here, there = first.truth.surface_point_at(pixel), truth.surface_point_at(pixel)
    assert here is not None
    assert there is not None
    assert np.allclose(here.position_m, there.position_m)


def test_hair_and_clothes_hide_moles(first: SimulatedCapture, patient: SimulatedPatient) -> None:
    truth, skin = first.truth, patient.skin
    corners = patient.model.triangles[truth.mole_triangle]
    under = (skin.cloth[corners].min(axis=1) > 0) | (skin.hair[corners].min(axis=1) > 0)
    assert under.any()
    assert not truth.mole_visible[under].any()


def test_lesions_of_interest_are_on_bare_skin_front_and_back(patient: SimulatedPatient) -> None:
    moles = patient.moles()
    rows = [moles.ids.index(name) for name in patient.lesion_ids]
    assert len(rows) == 24
    assert (moles.marks.radius_m[rows] >= 0.0025).all()
    assert (patient.skin.cloth[patient.model.triangles[moles.marks.triangle[rows]]] < 0).all()
    assert 5 < (moles.marks.position[rows, 1] < 0).sum() < 20


def test_most_moles_have_a_radius_of_two_to_five_millimetres() -> None:
    radius = SimulatedPatient(seed=4, moles=480).moles().marks.radius_m
    assert np.mean((radius > 0.002) & (radius < 0.005)) > 0.8


def test_a_scene_option_is_not_lost(dummy: SimulatedPatient) -> None:
    other = SimulatedPatient(seed=5, moles=60, variation=replace(STILL, slide=True), rig=dummy.rig)
    straight, slid = dummy.posed("psi", 1, 1), other.posed("psi", 1, 1)
    moved = np.linalg.norm(straight.vertices - slid.vertices, axis=1)
    assert 0.002 < moved.max() < 0.012
