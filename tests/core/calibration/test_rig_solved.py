"""From views to geometry: right within what is stated, robust to bad views, honest about weak ones."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.calibration.coverage import camera_coverage
from core.calibration.solve import RigSolution, solve_rig
from core.calibration.verdict import judge, skin_error
from core.calibration.views import RigView
from core.capture.rgbd import CameraRig
from core.errors import WorkError
from devices.simulator.boards import BoardRig, good_poses, random_board_rig
from tests.core.calibration.boards_before import SPEC, usual_views, views_of


@pytest.fixture(scope="module")
def usual() -> tuple[BoardRig, list[RigView], RigSolution]:
    board_rig, views = usual_views(1)
    return board_rig, views, solve_rig(views, SPEC)


def coverage_of(views):
    return [camera_coverage([getattr(v, k) for v in views], SPEC) for k in ("infrared", "color")]


def turn_deg(a: CameraRig, b: CameraRig) -> float:
    return float(
        np.rad2deg(
            np.linalg.norm(cv2.Rodrigues(a.picture_from_depth.rotation @ b.picture_from_depth.rotation.T)[0])
        )
    )


def test_the_true_rig_is_found(usual) -> None:
    board_rig, _, solution = usual
    true, found = board_rig.rig, solution.rig
    for a, b in ((found.depth, true.depth), (found.color, true.color)):
        assert (a.fx, a.fy) == pytest.approx((b.fx, b.fy), rel=0.001)
        assert (a.cx, a.cy) == pytest.approx((b.cx, b.cy), abs=0.8)
    assert found.picture_from_depth.translation == pytest.approx(
        true.picture_from_depth.translation, abs=5e-4
    )
    assert turn_deg(found, true) < 0.05
    assert solution.depth_correction.scale == pytest.approx(board_rig.depth_error.scale, abs=0.001)
    assert solution.depth_correction.offset_m == pytest.approx(board_rig.depth_error.offset_m, abs=0.001)


def test_true_errors_lie_within_three_stated_sigmas(usual) -> None:
    board_rig, _, solution = usual
    true, s = board_rig.rig, solution.sigma
    pairs = [
        (getattr(found, n) - getattr(real, n), s[f"{prefix}.{n}"])
        for prefix, found, real in (
            ("depth", solution.rig.depth, true.depth),
            ("color", solution.rig.color, true.color),
        )
        for n in ("fx", "fy", "cx", "cy")
    ]
    off = solution.rig.picture_from_depth.translation - true.picture_from_depth.translation
    pairs += [(off[k], s[f"translation_{axis}_m"]) for k, axis in enumerate("xyz")]
    pairs += [(turn_deg(solution.rig, true), s["rotation_deg"])]
    ratio = np.array([abs(error) / sigma for error, sigma in pairs])
    assert ratio.max() < 3.5
    assert np.sqrt((ratio**2).mean()) > 0.3, "nor is everything stated far too wide"


def test_noisier_corners_are_stated_as_less_certain(usual) -> None:
    _, _, solution = usual
    _, noisy_views = usual_views(1, noise_px=0.3)
    noisy = solve_rig(noisy_views, SPEC)
    assert noisy.sigma["depth.fx"] > 3 * solution.sigma["depth.fx"]
    assert noisy.rms_px["stereo"] > 3 * solution.rms_px["stereo"]


def test_errors_that_a_whole_picture_shares_are_seen_in_the_stated_uncertainty(usual) -> None:
    """A hand that is not quite still moves all corners of a picture alike: their number does not help."""
    board_rig, views, solution = usual
    rng = np.random.default_rng(3)
    unsteady = [
        replace(v, color=replace(v.color, pixels=v.color.pixels + rng.normal(0, 0.3, 2))) for v in views
    ]
    again = solve_rig(unsteady, SPEC)
    assert again.sigma["rotation_deg"] > 4 * solution.sigma["rotation_deg"]
    assert turn_deg(again.rig, board_rig.rig) < 3 * again.sigma["rotation_deg"]


def test_a_view_in_which_the_board_moved_between_the_cameras_is_left_out(usual) -> None:
    board_rig, views, solution = usual
    moved = replace(
        views[7], color=replace(views[7].color, pixels=views[7].color.pixels + np.array([4.0, -2.0]))
    )
    again = solve_rig([*views[:7], moved, *views[8:]], SPEC)
    assert [v.number for v in again.views if not v.used] == [7]
    assert again.views[7].reason
    off = again.rig.picture_from_depth.translation - board_rig.rig.picture_from_depth.translation
    assert np.linalg.norm(off) < 0.001
    assert any("left out" in note for note in again.notes)
    assert solution.used == 25


def test_a_wrong_depth_frame_spoils_neither_depth_nor_the_view(usual) -> None:
    board_rig, views, _ = usual
    far = np.where(views[3].depth > 0, views[3].depth + 60, 0).astype(np.uint16)
    again = solve_rig([*views[:3], replace(views[3], depth=far), *views[4:]], SPEC)
    assert again.used == 25
    assert again.depth_correction.scale == pytest.approx(board_rig.depth_error.scale, abs=0.0015)


def test_no_more_distortion_is_fitted_than_there_is() -> None:
    board_rig = random_board_rig(2)
    rig = board_rig.rig
    plain = replace(
        board_rig,
        rig=CameraRig(
            replace(rig.depth, distortion=()),
            replace(rig.color, distortion=(0.1, 0, 0, 0, 0)),
            rig.color_from_depth,
        ),
    )
    solution = solve_rig(views_of(plain, good_poses(plain, SPEC, 16, 2), 2, depth=False), SPEC)
    assert solution.lenses[0] == ()
    assert solution.lenses[1] == ("k1",)


def test_a_rig_without_colour_is_calibrated_as_a_depth_camera(usual) -> None:
    board_rig, views, _ = usual
    alone = solve_rig([replace(v, color=None) for v in views[:14]], SPEC)
    assert not alone.rig.has_color
    assert alone.rig.depth.fx == pytest.approx(board_rig.rig.depth.fx, rel=0.002)
    assert "rotation_deg" not in alone.sigma


def test_without_depth_the_correction_is_none_and_said_so(usual) -> None:
    _, views, _ = usual
    solution = solve_rig([replace(v, depth=None) for v in views[:12]], SPEC)
    assert (solution.depth_correction.scale, solution.depth_correction.offset_m) == (1.0, 0.0)
    assert "depth_scale" not in solution.sigma
    assert any("not compared" in note for note in solution.notes)
    assert judge(solution).grade != "good"


@pytest.mark.parametrize(
    ("weak", "told"),
    [
        (lambda views: views[:3], "3 infrared views"),
        (lambda views: [replace(v, infrared=None) for v in views], "0 infrared views"),
        (
            lambda views: [
                replace(v, color=None) if k % 2 else replace(v, infrared=None) for k, v in enumerate(views)
            ],
            "both cameras",
        ),
        (lambda views: [], "0 infrared views"),
    ],
    ids=["three", "no infrared", "never together", "none"],
)
def test_what_cannot_be_solved_is_refused_with_what_is_missing(usual, weak, told: str) -> None:
    with pytest.raises(WorkError, match=told) as caught:
        solve_rig(weak(usual[1]), SPEC)
    assert caught.value.advice


def test_good_views_are_judged_good(usual) -> None:
    _, views, solution = usual
    verdict = judge(solution, coverage_of(views))
    assert verdict.grade == "good", verdict.reasons
    assert verdict.picture_mm < 1.0
    assert verdict.depth_mm < 8.0


def test_few_views_from_one_place_are_refused_and_what_is_missing_is_said() -> None:
    board_rig = random_board_rig(4)
    near = [p for p in good_poses(board_rig, SPEC, 60, 4) if abs(p.translation[2] - 0.8) < 0.15][:6]
    views = views_of(board_rig, near, 4, noise_px=0.3)
    solution = solve_rig(views, SPEC)
    verdict = judge(solution, coverage_of(views))
    assert verdict.grade == "refused"
    assert verdict.reasons
    assert verdict.missing


def test_the_bound_on_the_skin_holds(usual) -> None:
    """Depth places that the true rig and the found rig put into the picture, compared at 2.3 m."""
    board_rig, _, solution = usual
    true, found = board_rig.rig, solution.rig
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.8, 0.8, 9))
    body = np.stack([x.ravel(), y.ravel(), np.full(81, 2.3)], axis=1)
    pixels = true.depth.project(body)
    inside = true.depth.contains(pixels) & true.picture_camera.contains(true.project_to_picture(body))
    raw = (2.3 - board_rig.depth_error.offset_m) / board_rig.depth_error.scale
    again = solution.depth_correction.offset_m + solution.depth_correction.scale * raw
    seen = found.project_to_picture(found.depth.rays(pixels[inside]) * again)
    off_mm = np.hypot(*(seen - true.project_to_picture(body[inside])).T) * 2300 / true.picture_camera.fx
    assert off_mm.max() < 1.5 * skin_error(solution)["picture_mm"]
    assert 1000 * abs(again - 2.3) < 1.5 * skin_error(solution)["depth_mm"]
