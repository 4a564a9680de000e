"""The real tracker on a rendered person: colour, depth alone, bad light, wrong view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.anchors import (
    JOINT_NAMES,
    analyse_capture,
    calibrate_skeleton,
    check_psi,
    find_skeleton,
    project_to_skin,
)
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import WorkError

# the model's torso joint sits at another height than the middle of the trunk
DEFINED_ALIKE = [name for name in JOINT_NAMES if name != "torso"]


def without_color(capture: RgbdCapture) -> RgbdCapture:
    return replace(capture, color=None, rig=CameraRig(capture.rig.depth))


def errors_m(skeleton, truth) -> dict[str, float]:
    return {n: float(np.linalg.norm(skeleton.point(n) - truth.joints_m[n])) for n in DEFINED_ALIKE}


def test_all_joints_are_found_in_the_colour_picture(psi, psi_scan, tracker) -> None:
    skeleton = find_skeleton(psi_scan, tracker)
    assert skeleton.source == "color"
    assert skeleton.warnings == ()
    assert skeleton.visible() == JOINT_NAMES
    errors = errors_m(skeleton, psi.truth)
    assert np.mean(list(errors.values())) < 0.035
    assert max(errors.values()) < 0.070, errors
    for joint in skeleton.joints.values():
        np.testing.assert_allclose(
            psi.capture.rig.project_to_picture(joint.point_m)[0], joint.pixel, atol=1e-6
        )


def test_the_stance_is_recognised_as_psi(psi_scan, tracker) -> None:
    assert check_psi(find_skeleton(psi_scan, tracker)).ok


def test_depth_alone_is_enough(psi, psi_scan, tracker) -> None:
    scan = replace(psi_scan, capture=without_color(psi.capture))
    skeleton = find_skeleton(scan, tracker)
    assert skeleton.source == "relief"
    assert skeleton.warnings == ()
    errors = errors_m(skeleton, psi.truth)
    assert np.mean(list(errors.values())) < 0.05
    assert max(errors.values()) < 0.13, errors


def test_in_a_dark_room_the_depth_helps_and_it_is_said(psi, psi_scan, tracker) -> None:
    dark = replace(psi.capture, color=(psi.capture.color // 40).astype(np.uint8))
    skeleton = find_skeleton(replace(psi_scan, capture=dark), tracker)
    assert any("too dark" in warning for warning in skeleton.warnings)
    errors = errors_m(skeleton, psi.truth)
    assert np.mean(list(errors.values())) < 0.05


def test_a_colour_picture_of_nothing_is_replaced_by_the_depth(psi, psi_scan, tracker) -> None:
    blank = replace(psi.capture, color=np.full_like(psi.capture.color, 128))
    skeleton = find_skeleton(replace(psi_scan, capture=blank), tracker)
    assert skeleton.source == "relief"
    assert any("come from the depth image" in warning for warning in skeleton.warnings)


def test_the_wrong_view_is_noticed_and_nothing_is_exchanged(psi, psi_scan, tracker) -> None:
    right = find_skeleton(psi_scan, tracker)
    wrong = find_skeleton(replace(psi_scan, capture=replace(psi.capture, view="back")), tracker)
    assert any("nothing was exchanged" in warning for warning in wrong.warnings)
    for name in JOINT_NAMES:
        np.testing.assert_array_equal(wrong.point(name), right.point(name))


def test_recorded_joints_are_used_unless_refused(psi, psi_scan, tracker) -> None:
    scan = replace(psi_scan, capture=psi.capture.with_joints(psi.truth.joints_m))
    recorded = find_skeleton(scan, tracker)
    assert recorded.source == "recording"
    assert recorded.visible() == JOINT_NAMES
    np.testing.assert_array_equal(recorded.point("left_hand"), psi.truth.joints_m["left_hand"])
    assert find_skeleton(scan, tracker, use_recorded=False).source == "color"


def test_recorded_joints_of_another_place_are_refused(psi, psi_scan, tracker) -> None:
    elsewhere = {name: p + np.array([0.0, 0.0, 3.0]) for name, p in psi.truth.joints_m.items()}
    with pytest.raises(WorkError, match="do not lie on the body"):
        find_skeleton(replace(psi_scan, capture=psi.capture.with_joints(elsewhere)), tracker)


def test_anchors_lie_on_the_skin_near_their_joints(psi_scan, tracker) -> None:
    skeleton = find_skeleton(psi_scan, tracker)
    anchors = project_to_skin(skeleton, psi_scan.surface)
    assert [a.name for a in anchors.anchors] == list(JOINT_NAMES)
    assert all(a.reliable for a in anchors.anchors)
    np.testing.assert_allclose(
        psi_scan.surface.positions(list(anchors.as_mapping().values())),
        [a.position_m for a in anchors.anchors],
        atol=1e-9,
    )
    for anchor in anchors.anchors:
        assert np.linalg.norm(anchor.position_m - skeleton.point(anchor.name)) < 0.15
    assert {a.name for a in anchors.extra} >= {"nose", "left_wrist"}


def test_a_back_view_in_another_stance_fits_the_calibrated_bones(person, psi_scan, tracker) -> None:
    """Working capture: turned around, arms down. Left is still the patient's own left."""
    calibration = calibrate_skeleton(find_skeleton(psi_scan, tracker))
    working = person.capture(stance="A", view="back", frames=6, seed=5)
    analysed = analyse_capture(working.capture, tracker, calibration=calibration)
    assert not any("eft and right" in warning for warning in analysed.warnings)
    errors = errors_m(analysed.skeleton, working.truth)
    assert max(errors.values()) < 0.08, errors
    assert check_psi(analysed.skeleton).corrections[0] == "Turn to face the camera."
