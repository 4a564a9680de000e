"""Live readings: what is said of where a person stands, of the light, and of movement."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from core.anchors.live_pose import LiveJoint, LivePose
from core.capture.rgbd import RgbdCapture
from core.guidance import Guidance, LiveGuide, Reach
from core.guidance.moment import Moment
from core.guidance.person import PersonFinder
from core.guidance.readings import Reading
from core.guidance.sharpness import edge_blur
from core.surface import fuse_depth, segment_body

Picture = NDArray[np.uint8]


def play(
    capture: RgbdCapture,
    frames: int = 1,
    *,
    color: Picture | None = None,
    rate: float = 10.0,
    psi: bool = False,
) -> Guidance:
    """The readings after so many frames of a capture."""
    guide = LiveGuide()
    rng = np.random.default_rng(0)
    photo = capture.color if color is None else color
    found = None
    for k in range(frames):
        grainy = None
        if photo is not None:
            grainy = np.clip(photo + rng.normal(0, 3, photo.shape), 0, 255).astype(np.uint8)
        found = guide.update(
            k / rate, capture.depth_frames[k], capture.depth_unit_m, grainy, capture.rig, psi=psi
        )
    assert found is not None
    return found


def without_color(capture: RgbdCapture) -> RgbdCapture:
    return replace(capture, color=None, rig=replace(capture.rig, color=None, color_from_depth=None))


def test_somebody_who_stands_well_is_told_nothing(still: RgbdCapture) -> None:
    found = play(still, 20)
    assert found.person
    assert found.sentences == ()
    assert found["distance"].value == pytest.approx(2.5, abs=0.1)
    assert found.placed
    assert found.still


def test_the_person_is_found_as_the_full_segmentation_finds_it(still: RgbdCapture) -> None:
    moment = Moment.of(0.0, still.depth_frames[0], still.depth_unit_m, None, still.rig)
    person = PersonFinder().find(moment)
    assert person is not None
    fused = fuse_depth(still.depth_frames, still.depth_unit_m)
    whole = segment_body(fused.depth_m, still.rig.depth).mask
    step = moment.step
    same = whole[step // 2 :: step, step // 2 :: step]
    assert (person.mask & same).sum() / (person.mask | same).sum() > 0.9


def test_nobody_in_view_and_a_covered_camera_are_told_apart(still: RgbdCapture) -> None:
    wall = replace(still, depth_frames=np.full((1, 480, 640), 3500, np.uint16))
    covered = replace(still, depth_frames=np.zeros((1, 480, 640), np.uint16))
    assert "Nobody is in view" in play(wall)["distance"].sentence
    assert "step back" in play(covered)["distance"].sentence
    assert not play(wall).person
    assert not play(wall).placed


def test_a_camera_that_is_moved_does_not_take_the_wall_for_the_person(still: RgbdCapture) -> None:
    guide = LiveGuide()
    depth = still.depth_frames[0]
    for time_s, nearer in ((0.0, 0), (1.0, 0), (1.1, 250)):
        moved = np.where(depth > 0, depth - np.uint16(nearer), 0).astype(np.uint16)
        found = guide.update(time_s, moved, still.depth_unit_m, still.color, still.rig)
    assert found["distance"].value == pytest.approx(2.25, abs=0.1)
    assert found["frame"].state == "good"


def test_too_near_is_told_with_what_is_cut_off(too_near: RgbdCapture) -> None:
    found = play(too_near)
    assert found["distance"].state == "fair"
    assert found["frame"].state == "bad"
    assert found.sentences[0] == "Step back: head and feet are cut off."
    assert not found.placed


@pytest.mark.parametrize(
    ("columns", "facing", "word"), [(-210, True, "left"), (-210, False, "right"), (210, True, "right")]
)
def test_a_side_that_is_cut_off_is_told_in_the_patients_own_left_and_right(
    still: RgbdCapture, columns: int, facing: bool, word: str
) -> None:
    # the body pushed over an edge of the picture
    moved = np.roll(still.depth_frames[:1], columns, axis=2)
    at = (
        {"left_shoulder": 340, "right_shoulder": 260}
        if facing
        else {"left_shoulder": 260, "right_shoulder": 340}
    )
    joints = {name: LiveJoint(np.array([u, 150.0]), 1.0) for name, u in at.items()}
    joints |= {n: LiveJoint(np.array([300.0, v]), 1.0) for n, v in (("neck", 150.0), ("torso", 230.0))}
    pose = LivePose(joints, 0.0, "color", (640, 480))
    found = LiveGuide().update(0.0, moved[0], still.depth_unit_m, still.color, still.rig, pose)
    assert found["frame"].sentence.startswith(f"Take a step to your {word}")


def test_light_is_judged_on_the_person(still: RgbdCapture) -> None:
    assert still.color is not None
    photo = still.color
    assert play(still)["light"].state == "good"
    assert "dark" in play(still, color=(photo * 0.15).astype(np.uint8))["light"].sentence
    burnt = np.clip(photo.astype(int) * 2.6, 0, 255).astype(np.uint8)
    assert "bright" in play(still, color=burnt)["light"].sentence
    shade = np.where(np.arange(640) < 315, 0.4, 1.0)[None, :, None]
    assert "Uneven" in play(still, color=(photo * shade).astype(np.uint8))["light"].sentence
    blue = np.clip(photo * np.array([0.5, 0.8, 1.5]), 0, 255).astype(np.uint8)
    assert "blue" in play(still, color=blue)["light"].sentence


def test_a_window_behind_the_patient_is_told(still: RgbdCapture) -> None:
    assert still.color is not None
    moment = Moment.of(0.0, still.depth_frames[0], still.depth_unit_m, still.color, still.rig)
    person = PersonFinder().find(moment)
    assert person is not None
    body = moment.picture_mask(person.mask)
    assert body is not None
    against = np.where(body[..., None], still.color * 0.35, 245).astype(np.uint8)
    assert play(still, color=against)["backlight"].state == "bad"
    assert "behind" in play(still, color=against)["backlight"].sentence
    assert play(still)["backlight"].state == "good"


@pytest.mark.parametrize("pixels", [1.5, 2.5, 4.0])
def test_blur_is_measured_in_pixels(still: RgbdCapture, pixels: float) -> None:
    assert still.color is not None
    grey = cv2.cvtColor(still.color, cv2.COLOR_RGB2GRAY)
    sharp = edge_blur(grey)
    assert sharp is not None
    own = max(sharp)
    assert own < 1.3
    found = edge_blur(np.asarray(cv2.GaussianBlur(grey, (0, 0), pixels), np.uint8))
    assert found is not None
    assert max(found) == pytest.approx(np.hypot(pixels, own), rel=0.2)


def test_motion_blur_is_told_although_it_blurs_one_direction_only(still: RgbdCapture) -> None:
    assert still.color is not None
    assert play(still)["blur"].state == "good"
    dragged = np.asarray(cv2.blur(still.color, (13, 1)), np.uint8)
    assert play(still, color=dragged)["blur"].state == "bad"


def test_cloth_without_depth_lowers_the_coverage(still: RgbdCapture) -> None:
    holed = still.depth_frames[:1].copy()
    holed[:, 250:275, 300:335] = 0
    found = play(replace(still, depth_frames=holed))["coverage"]
    whole = play(still)["coverage"]
    assert whole.value is not None
    assert found.value is not None
    assert whole.value > 0.98
    assert found.value < whole.value - 0.02


# --- the stillness meter -----------------------------------------------------------------------------------


def moved(capture: RgbdCapture, **how: float) -> list[float]:
    """What the meter says, frame after frame."""
    guide, said = LiveGuide(), []
    rng = np.random.default_rng(1)
    for k, depth in enumerate(capture.depth_frames):
        grainy = None
        if capture.color is not None:
            shift = np.float32([[1, 0, how.get("pixels", 0.0) * k], [0, 1, 0]])
            photo = cv2.warpAffine(capture.color, shift, (640, 480), borderMode=cv2.BORDER_REPLICATE)
            grainy = np.clip(photo + rng.normal(0, 4, photo.shape), 0, 255).astype(np.uint8)
        found = guide.update(k / 10, depth, capture.depth_unit_m, grainy, capture.rig)
        value = found["stillness"].value
        if value is not None:
            said.append(value)
    return said


def test_noise_alone_is_not_taken_for_movement(still: RgbdCapture) -> None:
    with_color = moved(still)
    assert np.median(with_color) < 2.0
    assert max(with_color) < 5.0
    depth_alone = moved(without_color(still))
    assert np.median(depth_alone) < 3.0
    assert max(depth_alone) < 8.0


def test_somebody_who_sways_is_seen_to_move_by_depth_alone(still: RgbdCapture, swaying: RgbdCapture) -> None:
    rest, sway = moved(without_color(still)), moved(without_color(swaying))
    assert np.median(sway) > 2 * max(np.median(rest), 1.0)
    assert max(sway) > 5.0, "it is not called still"


def test_movement_across_is_measured_in_millimetres(still: RgbdCapture) -> None:
    # half a pixel a frame, ten frames a second: within a second 5 pixels of 2.5 m / 525 px
    assert still.rig.color is not None
    expected = 1000 * 5 * 2.5 / still.rig.color.fx
    assert np.median(moved(still, pixels=0.5)) == pytest.approx(expected, rel=0.25)


def test_the_meter_waits_for_a_past_and_begins_anew_for_another_person(still: RgbdCapture) -> None:
    guide = LiveGuide()
    first = guide.update(0.0, still.depth_frames[0], still.depth_unit_m, None, still.rig)
    assert first["stillness"].state == "unknown"
    assert not first.still


# --- what a reading is for ---------------------------------------------------------------------------------


def test_the_worst_reading_speaks_first_and_what_is_bad_keeps_a_capture_from_beginning() -> None:
    fair = Reading("distance", 3.2, "m", "fair", "Come closer.")
    bad = Reading("light", 20.0, "level", "bad", "Too dark.")
    still = Reading("stillness", 1.0, "mm", "good")
    found = Guidance(0.0, {"distance": fair, "light": bad, "stillness": still}, person=True)
    assert found.sentences == ("Too dark.", "Come closer.")
    assert not found.placed
    assert Guidance(0.0, {"distance": fair, "stillness": still}, person=True).placed


def test_each_sensor_has_distances_of_its_own() -> None:
    assert Reach.of_sensor("") == Reach()
    for name in ("kinect-v1", "kinect-v2", "realsense-d4xx"):
        reach = Reach.of_sensor(name)
        assert reach.near_m < reach.good_near_m < reach.good_far_m < reach.far_m
    assert Reach.of_sensor("kinect-v2").good_far_m > Reach.of_sensor("kinect-v1").good_far_m


def test_the_stance_is_corrected_while_the_patient_can_still_hear_it(still: RgbdCapture) -> None:
    from core.anchors import LANDMARK_NAMES
    from devices.trackers import default_tracker

    assert still.color is not None
    seen = default_tracker().detect(still.color)
    assert seen is not None
    at = {name: (seen.pixels[k], float(seen.visibility[k])) for k, name in enumerate(LANDMARK_NAMES)}

    def joint(*names: str) -> LiveJoint:
        return LiveJoint(np.mean([at[n][0] for n in names], axis=0), min(at[n][1] for n in names))

    joints = {
        "head": joint("left_ear", "right_ear"),
        "neck": joint("left_shoulder", "right_shoulder"),
        "torso": joint("left_shoulder", "right_shoulder", "left_hip", "right_hip"),
        "nose": joint("nose"),
    }
    for side in ("left", "right"):
        for name, mark in (
            ("shoulder", "shoulder"),
            ("elbow", "elbow"),
            ("hand", "wrist"),
            ("hip", "hip"),
            ("knee", "knee"),
            ("foot", "ankle"),
        ):
            joints[f"{side}_{name}"] = joint(f"{side}_{mark}")
    pose = LivePose(joints, 0.0, "color", (640, 480))
    found = LiveGuide().update(
        0.0, still.depth_frames[0], still.depth_unit_m, still.color, still.rig, pose, psi=True
    )
    assert found["stance"].state == "bad"
    assert "elbow" in found["stance"].sentence, "the arms hang too low for a psi"
    assert not found.placed
