"""The patient is found in a room, and only the patient."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.capture import PinholeCamera, read_capture
from core.errors import WorkError
from core.surface import BodyMask, fuse_depth, segment_body


def segment(scene: Any, camera: PinholeCamera, **options: Any) -> BodyMask:
    capture = scene.capture(color=False, **options)
    return segment_body(fuse_depth(capture.depth_frames, capture.depth_unit_m).depth_m, camera)


def overlap(mask: np.ndarray, truth: np.ndarray) -> float:
    """Intersection over union."""
    return float((mask & truth).sum() / max(1, (mask | truth).sum()))


@pytest.mark.parametrize("distance", [2.5, 2.7, 2.9])
@pytest.mark.parametrize("frames", [1, 10])
def test_a_person_in_a_room_is_found(
    make_scene: Any, make_person: Any, room: Any, depth_camera: PinholeCamera, distance: float, frames: int
) -> None:
    scene = make_scene(make_person(z=distance), room)
    found = segment(scene, depth_camera, frames=frames)
    _, index = scene.true_depth()
    assert overlap(found.mask, index >= 0) > 0.95
    assert found.other_people == 0
    assert found.warnings == ()
    assert not found.cut_by_frame


def test_a_person_before_nothing_is_found(
    make_scene: Any, make_person: Any, depth_camera: PinholeCamera
) -> None:
    scene = make_scene(make_person())
    assert overlap(segment(scene, depth_camera).mask, scene.true_depth()[1] >= 0) > 0.97


@pytest.mark.parametrize("z", [2.7, 3.1])
def test_a_second_person_is_left_out_and_told(
    make_scene: Any, make_person: Any, room: Any, depth_camera: PinholeCamera, z: float
) -> None:
    patient = make_person(x=-0.1, z=2.5)
    scene = make_scene([*patient, *make_person(x=1.15, z=z)], room)
    found = segment(scene, depth_camera)
    _, index = scene.true_depth()
    assert overlap(found.mask, (index >= 0) & (index < len(patient))) > 0.95
    assert found.other_people == 1
    assert any("Another person" in w for w in found.warnings)


def test_a_person_behind_the_patient_is_not_merged(
    make_scene: Any, make_person: Any, room: Any, depth_camera: PinholeCamera
) -> None:
    patient = make_person(z=2.0)
    scene = make_scene([*patient, *make_person(x=0.35, z=2.8)], room)
    found = segment(scene, depth_camera)
    _, index = scene.true_depth()
    assert overlap(found.mask, (index >= 0) & (index < len(patient))) > 0.93
    assert found.other_people >= 1


def test_hands_held_before_the_trunk_belong_to_the_patient(
    make_scene: Any, make_person: Any, make_part: Any, room: Any, depth_camera: PinholeCamera
) -> None:
    hands = [make_part((s * 0.12, -0.2, 1.75), (0.05, 0.09, 0.04)) for s in (-1, 1)]
    scene = make_scene([*make_person(z=2.3), *hands], room)
    found = segment(scene, depth_camera)
    assert overlap(found.mask, scene.true_depth()[1] >= 0) > 0.95
    assert found.other_people == 0


def test_a_body_cut_by_the_image_is_told(
    make_scene: Any, make_person: Any, depth_camera: PinholeCamera
) -> None:
    found = segment(make_scene(make_person(z=1.3)), depth_camera)
    assert found.cut_by_frame
    assert any("lower" in w for w in found.warnings)


def test_a_thigh_is_no_floor(
    make_scene: Any, make_person: Any, make_part: Any, depth_camera: PinholeCamera
) -> None:
    """A person on a stool: thighs are level, large and low in the image, with shins below."""
    seated = [p for p in make_person(z=2.0) if p.center[1] < 0.3]
    legs = []
    for s in (-1, 1):
        legs += [
            make_part((s * 0.11, 0.35, 1.75), (0.10, 0.27, 0.09), (0.0, 0.1, -1.0)),
            make_part((s * 0.11, 0.62, 1.55), (0.06, 0.28, 0.06)),
        ]
    scene = make_scene([*seated, *legs])
    found = segment(scene, depth_camera)
    assert overlap(found.mask, scene.true_depth()[1] >= 0) > 0.95


def test_a_person_at_a_table_is_found(
    make_scene: Any, make_person: Any, make_part: Any, room: Any, depth_camera: PinholeCamera
) -> None:
    table = make_part((0.9, 0.35, 2.2), (0.45, 0.02, 0.5))
    scene = make_scene([*make_person(z=2.3), table], room)
    found = segment(scene, depth_camera)
    truth = (scene.true_depth()[1] >= 0) & (scene.true_depth()[1] < len(scene.parts) - 1)
    assert (found.mask & truth).sum() / truth.sum() > 0.9


@pytest.mark.parametrize("what", ["nothing", "far wall", "noise", "a pole", "room"])
def test_without_a_body_the_message_says_what_to_do(
    make_scene: Any, make_part: Any, room: Any, depth_camera: PinholeCamera, what: str
) -> None:
    shape = (depth_camera.height, depth_camera.width)
    depth = {
        "nothing": np.zeros(shape),
        "far wall": np.full(shape, 3.0),
        "noise": np.random.default_rng(0).uniform(0.5, 8.0, shape),
        "a pole": make_scene([make_part((0, 0, 2), (0.02, 0.3, 0.02))]).true_depth()[0],
        "room": make_scene([], room).true_depth()[0],
    }[what]
    with pytest.raises(WorkError, match="No body found") as caught:
        segment_body(depth, depth_camera)
    assert "1 to 3 m" in caught.value.advice


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.integers(1, 40), st.integers(1, 40))
def test_any_depth_image_is_segmented_or_refused(seed: int, share: float, width: int, height: int) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.3, 9.0) + rng.uniform(0, 0.05) * rng.standard_normal((height, width))
    depth = np.where(rng.random(depth.shape) < share, np.maximum(depth, 0), 0)
    try:
        mask = segment_body(depth, PinholeCamera(width, height, 5.0, 5.0, width / 2, height / 2)).mask
    except WorkError:
        return
    assert mask.shape == depth.shape
    assert (depth[mask] > 0).all()


@pytest.mark.real
@pytest.mark.parametrize("number", range(12))
def test_real_people_are_found(real_recordings: Path, number: int) -> None:
    """Frames 10 and 11 show a second person behind; the nearer one is the patient."""
    capture = read_capture(real_recordings / "kinect_depth" / f"{number:02d}")
    fused = fuse_depth(capture.depth_frames, capture.depth_unit_m)
    found = segment_body(fused.depth_m, capture.rig.depth)
    assert found.other_people == (1 if number >= 10 else 0)
    assert found.cut_by_frame
    measured = fused.depth_m > 0
    if number >= 10:
        assert fused.depth_m[found.mask].max() < 1.75
        assert (found.mask & measured & (fused.depth_m < 1.6)).sum() > 0.97 * (
            fused.depth_m[measured] < 1.6
        ).sum()
    else:
        assert found.mask.sum() > 0.98 * measured.sum()


@pytest.mark.real
@pytest.mark.parametrize("number", range(0, 100, 10))
def test_a_real_person_before_a_real_wall_is_found(real_recordings: Path, number: int) -> None:
    capture = read_capture(real_recordings / "person_turning" / f"{number:02d}")
    fused = fuse_depth(capture.depth_frames, capture.depth_unit_m)
    found = segment_body(fused.depth_m, capture.rig.depth)
    near = (fused.depth_m > 0) & (fused.depth_m < 1.5)
    assert overlap(found.mask, near) > 0.98
    assert found.cut_by_frame
