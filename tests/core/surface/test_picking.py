"""A click on the picture is the skin under it, or is refused with the reason."""

from typing import Any

import numpy as np
import pytest

from core.surface import BodyScan, pick_skin, pick_skin_depth, scan_body
from core.surface.picking import NEAR_EDGE, NOT_MEASURED, NOT_ON_BODY, ON_CLOTHING, ON_HAIR, OUTSIDE_PICTURE

TRUNK = (0.0, -0.15, 2.39)
HAIR = (0.0, -0.78, 2.45)
FACE = (0.0, -0.62, 2.41)
HAND_SIDE = (0.5, -0.12, 2.46)


@pytest.fixture(scope="module")
def scene(make_scene: Any, make_person: Any, room: Any) -> Any:
    return make_scene(make_person(shirt=True), room)


@pytest.fixture(scope="module")
def scan(scene: Any) -> BodyScan:
    return scan_body(scene.capture(frames=10))


@pytest.fixture(scope="module")
def bare(make_scene: Any, make_person: Any, room: Any) -> BodyScan:
    return scan_body(make_scene(make_person(), room).capture(frames=10))


def pixel_of(scan: BodyScan, place: tuple[float, float, float]) -> np.ndarray:
    return scan.capture.rig.project_to_picture(place)[0]


def truth_at(scene: Any, scan: BodyScan, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    origin, rays = scan.capture.rig.picture_rays(pixels)
    t, index = scene.trace(origin, rays)
    return origin + rays * np.where(np.isfinite(t), t, 0)[:, None], index


def test_clicks_all_over_the_body_are_right_within_millimetres(scene: Any, scan: BodyScan) -> None:
    """No click, however near a silhouette, lands on the wall behind."""
    u, v = np.meshgrid(np.arange(100, 300, 3), np.arange(20, 290, 4))
    pixels = np.stack([u.ravel(), v.ravel()], 1)
    truth, index = truth_at(scene, scan, pixels)
    on_body = np.flatnonzero(index >= 0)
    errors, refused = [], 0
    for i in on_body:
        pick = pick_skin(scan, pixels[i])
        if pick.point is None:
            refused += pick.reason != ON_HAIR
        else:
            errors.append(np.linalg.norm(pick.point.position_m - truth[i]))
    assert len(errors) > 700
    assert refused / len(on_body) < 0.01
    assert np.median(errors) < 0.003
    assert np.percentile(errors, 95) < 0.012
    assert max(errors) < 0.08


def test_the_background_is_refused(scene: Any, scan: BodyScan) -> None:
    u, v = np.meshgrid(np.arange(20, 380, 14), np.arange(10, 290, 14))
    pixels = np.stack([u.ravel(), v.ravel()], 1)
    _, index = truth_at(scene, scan, pixels)
    rng = np.random.default_rng(0)
    for i in rng.permutation(np.flatnonzero(index < 0))[:150]:
        around = pixels[i] + 5 * np.array(
            [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, 1], [1, -1], [-1, -1]]
        )
        if (truth_at(scene, scan, around)[1] >= 0).any():
            continue
        pick = pick_skin(scan, pixels[i])
        assert pick.point is None
        assert pick.reason in (NOT_ON_BODY, NOT_MEASURED)


@pytest.mark.parametrize("pixel", [(-3, 10), (400, 100), (100, 300), (float("nan"), 5)])
def test_outside_the_picture_is_refused(scan: BodyScan, pixel: tuple[float, float]) -> None:
    assert pick_skin(scan, pixel).reason == OUTSIDE_PICTURE


def test_a_click_just_beside_a_silhouette_is_lifted_with_a_warning(bare: BodyScan) -> None:
    """Depth cameras lose the last pixels of an arm; the picture still shows them."""
    pixels = bare.vertex_picture_pixels
    trunk = np.flatnonzero(np.abs(bare.surface.vertices[:, 1] + 0.1) < 0.004)
    right = trunk[np.argmax(pixels[trunk, 0] * (np.abs(bare.surface.vertices[trunk, 0]) < 0.25))]
    beside = pixels[right] + (1.5, 0)
    pick = pick_skin(bare, beside)
    assert pick.point is not None
    assert NEAR_EDGE in pick.warnings
    assert np.linalg.norm(pick.point.position_m - bare.surface.vertices[right]) < 0.03
    seen = bare.capture.rig.project_to_picture(pick.point.position_m)[0]
    np.testing.assert_allclose(seen, beside, atol=0.5)
    assert pick_skin(bare, pixels[right] + (12, 0)).point is None


def test_the_normal_faces_the_camera(bare: BodyScan) -> None:
    pick = pick_skin(bare, pixel_of(bare, TRUNK))
    assert pick.point is not None
    assert pick.normal is not None
    assert pick.normal @ pick.point.position_m < 0
    assert np.linalg.norm(pick.normal) == pytest.approx(1.0)
    assert pick.normal[2] < -0.9


def test_hair_is_refused_clothing_warned_and_skin_passes(scan: BodyScan, bare: BodyScan) -> None:
    assert pick_skin(scan, pixel_of(scan, HAIR)).reason == ON_HAIR
    shirt = pick_skin(scan, pixel_of(scan, TRUNK))
    assert shirt.point is not None
    assert ON_CLOTHING in shirt.warnings
    for place in (FACE, HAND_SIDE):
        skin = pick_skin(scan, pixel_of(scan, place))
        assert skin.point is not None
        assert ON_CLOTHING not in skin.warnings
    assert ON_CLOTHING not in pick_skin(bare, pixel_of(bare, TRUNK)).warnings


def test_the_head_may_be_told(scan: BodyScan) -> None:
    """With the head elsewhere, dark is clothing; dark cloth near the head is taken for hair."""
    assert pick_skin(scan, pixel_of(scan, HAIR), head_m=(0, 0.8, 2.5)).reason is None
    assert pick_skin(scan, pixel_of(scan, HAIR), head_m=(0, -0.65, 2.5)).reason == ON_HAIR


def test_a_dark_mole_is_no_hair_and_no_clothing(make_scene: Any, make_person: Any) -> None:
    capture = make_scene(make_person()).capture(frames=4)
    u, v = np.rint(capture.rig.project_to_picture(FACE)[0]).astype(int)
    capture.color[v, u] = (60, 35, 25)
    pick = pick_skin(scan_body(capture), (u, v))
    assert pick.point is not None
    assert pick.warnings == ()


@pytest.mark.parametrize("tone", [(90, 60, 45), (235, 200, 180), (160, 110, 80)])
def test_skin_of_any_tone_is_skin(
    make_scene: Any, make_person: Any, make_part: Any, tone: tuple[int, ...]
) -> None:
    parts = [make_part(p.center, p.half, p.along, tone) for p in make_person()]
    scan = scan_body(make_scene(parts).capture(frames=4))
    for place in (TRUNK, FACE, HAND_SIDE):
        pick = pick_skin(scan, pixel_of(scan, place))
        assert pick.reason is None
        assert ON_CLOTHING not in pick.warnings


def test_depth_pixels_are_picked_with_and_without_a_picture(
    scene: Any, scan: BodyScan, make_scene: Any, make_person: Any
) -> None:
    depth_pixel = scan.capture.rig.depth.project(TRUNK)[0]
    with_color = pick_skin_depth(scan, depth_pixel)
    depth_only = scan_body(make_scene(make_person()).capture(color=False))
    without = pick_skin_depth(depth_only, depth_pixel)
    same = pick_skin(depth_only, depth_pixel)
    for pick in (with_color, without, same):
        assert pick.point is not None
        np.testing.assert_allclose(pick.point.position_m[:2], TRUNK[:2], atol=0.01)
    assert without.warnings == ()


def test_an_arm_before_the_trunk_wins_at_its_rim(make_scene: Any, make_person: Any, make_part: Any) -> None:
    """Half a pixel outside the measured arm a click still means the arm, not the trunk behind it."""
    arm = make_part((0.0, -0.15, 1.7), (0.045, 0.2, 0.045), (1.0, 0.2, 0.0))
    scan = scan_body(make_scene([*make_person(), arm]).capture(frames=10))
    arm_rim = np.flatnonzero(scan.surface.boundary & (scan.surface.vertices[:, 2] < 1.8))
    top = arm_rim[
        np.argmin(scan.surface.vertices[arm_rim, 1] + 10 * np.abs(scan.surface.vertices[arm_rim, 0]))
    ]
    pick = pick_skin(scan, scan.vertex_picture_pixels[top] - (0, 0.8))
    assert pick.point is not None
    assert pick.point.position_m[2] < 1.8
    assert NEAR_EDGE in pick.warnings
