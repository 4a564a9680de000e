"""The hand cut from a depth image: its own skin, no more, with geodesics that noise does not lengthen."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from core.capture import PinholeCamera
from core.errors import WorkError
from core.geodesics import geodesic_solver
from core.hand.segmentation import REACH_M
from core.hand.surface import HandSurface, cut_hand
from devices.simulator.hands.scene import HandFrame, HandView, Thing
from devices.simulator.hands.shots import HandVariation, Holder, hand_view, shoot

FloatArray = NDArray[np.float64]

CAMERA = PinholeCamera(320, 240, 290.0, 290.0, 159.5, 119.5)
SEEDS = np.array([(0.0, 0.0, 0.6), (0.02, 0.0, 0.6), (0.0, 0.02, 0.6), (0.02, 0.02, 0.6)])


def _flat(width_m: float = 0.09, height_m: float = 0.16, z: float = 0.6) -> FloatArray:
    """A palm: a flat piece about the middle of the image."""
    x, y = z * CAMERA.pixel_rays[..., 0], z * CAMERA.pixel_rays[..., 1]
    return np.where((np.abs(x) < width_m / 2) & (np.abs(y) < height_m / 2), z, 0.0)


def _geodesic(hand: HandSurface, start: FloatArray, end: FloatArray) -> float:
    surface = hand.surface
    field = geodesic_solver(surface.vertices, surface.triangles).distances(surface.nearest([start]))[0]
    return float(surface.interpolate(field, surface.nearest([end])[0]))


@given(lean=st.floats(-0.9, 0.9), tip=st.floats(-0.6, 0.6), z=st.floats(0.5, 0.75), seed=st.integers(0, 99))
@settings(max_examples=8, deadline=None)
def test_noise_lengthens_no_way_on_a_leaning_plane(lean: float, tip: float, z: float, seed: int) -> None:
    x, y = CAMERA.pixel_rays[..., 0], CAMERA.pixel_rays[..., 1]
    true = z / (1.0 - lean * x - tip * y)
    inside = (np.abs(x) < 0.07) & (np.abs(y) < 0.11)
    noise = np.random.default_rng(seed).normal(0.0, 0.0012, true.shape)
    depth = np.where(inside, np.round(true + noise, 3), 0.0)
    pixels = np.array([(150, 94), (172, 147), (160, 120)])
    start, end, middle = (true[v, u] * CAMERA.pixel_rays[v, u] for u, v in pixels)
    hand = cut_hand(depth, CAMERA, middle[None], step_px=1)
    # the true way is what lies between the ends' own rays on the plane
    assert _geodesic(hand, start, end) == pytest.approx(np.linalg.norm(end - start), rel=0.035, abs=0.001)


def test_a_finger_before_the_palm_is_cut_at_the_jump() -> None:
    depth = _flat()
    x, y = 0.58 * CAMERA.pixel_rays[..., 0], 0.58 * CAMERA.pixel_rays[..., 1]
    # a bent finger: it leaves the palm's upper end and comes back before it, 22 mm nearer
    finger = (np.abs(x) < 0.009) & (y > -0.095) & (y < -0.01)
    depth[finger] = 0.578
    bridge = (np.abs(x) < 0.009) & (y < -0.07) & (y > -0.10)
    depth[bridge] = (0.6 - 0.022 * np.clip((-0.07 - y) / 0.02, 0, 1))[bridge]
    hand = cut_hand(depth, CAMERA, np.array([(0.03, 0.03, 0.6), (-0.03, 0.04, 0.6)]), step_px=1)
    on_palm = hand.surface.vertices[hand.surface.component == hand.surface.component[0]]
    assert np.isclose(on_palm[:, 2], 0.6, atol=0.004).mean() > 0.9
    joined = hand.surface.triangles
    z = hand.surface.vertices[joined, 2]
    assert (z.max(axis=1) - z.min(axis=1)).max() < 0.012


@pytest.mark.parametrize("gap_m", [0.006, 0.012])
def test_fingers_side_by_side_do_not_melt_together_where_a_gap_is_seen(gap_m: float) -> None:
    depth = _flat(height_m=0.08)
    x, y = 0.6 * CAMERA.pixel_rays[..., 0], 0.6 * CAMERA.pixel_rays[..., 1]
    first = (x > gap_m / 2) & (x < gap_m / 2 + 0.016) & (y < 0) & (y > -0.12)
    second = (x < -gap_m / 2) & (x > -gap_m / 2 - 0.016) & (y < 0) & (y > -0.12)
    depth[first | second] = 0.6
    hand = cut_hand(depth, CAMERA, SEEDS, step_px=1)
    tips = np.array([(gap_m / 2 + 0.008, -0.11, 0.6), (-gap_m / 2 - 0.008, -0.11, 0.6)])
    assert _geodesic(hand, *tips) > 0.13


def test_what_is_beyond_reach_or_behind_is_left_out() -> None:
    depth = np.where(_flat(width_m=0.06, height_m=2.0) > 0, 0.6, 1.2)
    hand = cut_hand(depth, CAMERA, SEEDS)
    vertices = hand.surface.vertices
    assert vertices[:, 2].max() < 0.65
    assert np.linalg.norm(vertices - SEEDS.mean(axis=0), axis=1).max() < REACH_M + 0.005
    assert hand.touching is None


def test_spacing_is_chosen_for_the_distance_unless_it_is_asked_for() -> None:
    near = cut_hand(_flat(z=0.35), CAMERA, np.array([(0.0, 0.0, 0.35)]))
    far = cut_hand(_flat(z=0.7), CAMERA, np.array([(0.0, 0.0, 0.7)]))
    assert (near.step_px, far.step_px) == (2, 1)
    asked = cut_hand(_flat(), CAMERA, SEEDS, step_px=3)
    assert asked.step_px == 3
    # the cropped, thinned camera sees a vertex in its own pixel
    assert asked.surface.camera.project(asked.surface.vertices) == pytest.approx(
        asked.surface.pixels.astype(float), abs=1e-6
    )
    left, top = asked.corner_px
    pixels = CAMERA.project(asked.surface.vertices)
    assert pixels == pytest.approx(asked.surface.pixels * 3.0 + (left, top), abs=1e-6)


@pytest.mark.parametrize(
    ("depth", "seeds"),
    [
        (np.zeros((240, 320)), SEEDS),
        (_flat(), SEEDS + np.array([0.0, 0.0, 0.2])),
        (_flat(), np.full((4, 3), np.nan)),
        (_flat(), np.array([(0.0, 0.0, -0.5)])),
        (_flat(width_m=0.012, height_m=0.012), SEEDS),
    ],
    ids=["nothing measured", "skin elsewhere", "no place", "behind the camera", "a crumb"],
)
def test_without_skin_at_the_place_it_is_said(depth: FloatArray, seeds: FloatArray) -> None:
    with pytest.raises(WorkError) as caught:
        cut_hand(depth, CAMERA, seeds)
    assert caught.value.advice


def test_some_missing_corners_do_no_harm() -> None:
    seeds = SEEDS.copy()
    seeds[2] = np.nan
    whole = cut_hand(_flat(), CAMERA, SEEDS)
    assert len(cut_hand(_flat(), CAMERA, seeds).surface.vertices) == len(whole.surface.vertices)


CALM = HandVariation(tilt_deg=15.0, distance_m=(0.55, 0.75))


def _bottle(view: HandView) -> Thing:
    """A bottle across the palm, 6 cm thick, 20 cm long."""
    turn = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    rings = np.linspace(-0.1, 0.1, 40)
    x, a = (grid.ravel() for grid in np.meshgrid(rings, turn, indexing="ij"))
    skin = np.column_stack([x, 0.055 + 0.03 * np.cos(a), -0.052 + 0.03 * np.sin(a)])
    return Thing(view.depth_from_hand.apply(skin), _tube(40, 48), (0.2, 0.4, 0.7))


def _belly(view: HandView) -> Thing:
    """A large round body that the palm lies on."""
    polar, around = np.linspace(0.05, np.pi - 0.05, 40), np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    t, p = (grid.ravel() for grid in np.meshgrid(polar, around, indexing="ij"))
    skin = np.column_stack([0.17 * np.sin(t) * np.cos(p), 0.3 * np.cos(t), 0.12 * np.sin(t) * np.sin(p)])
    return Thing(
        view.depth_from_hand.apply(skin + np.array([0.0, 0.04, -0.132])), _tube(40, 48), (0.7, 0.5, 0.4)
    )


def _tube(rings: int, around: int) -> NDArray[np.int32]:
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij"))
    p, q = i * around + j, i * around + (j + 1) % around
    return np.vstack([np.stack([p, q, p + around], 1), np.stack([q, q + around, p + around], 1)]).astype(
        np.int32
    )


@lru_cache(maxsize=8)
def _frame(shape: str, configuration: str, seed: int, thing: str = "") -> tuple[HandFrame, FloatArray]:
    """A frame, and the hand's own skin (n, 3)."""
    holder = Holder(shape, seed=seed)
    # the same numbers are drawn as by `shoot`, to know where the hand is before the thing is laid beside it
    view = hand_view(holder, configuration, np.random.default_rng((0x5407, seed, seed)), CALM)
    things = {"bottle": _bottle, "belly": _belly}
    laid = (things[thing](view),) if thing else ()
    frame = shoot(holder, configuration, seed, variation=CALM, things=laid)
    corners = view.depth_from_hand.apply(view.vertices)[view.model.triangles]
    shares = [(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]
    return frame, np.concatenate([np.einsum("k,nkx->nx", np.array(w) / 4.0, corners) for w in shares])


def _cut(frame: HandFrame) -> HandSurface:
    capture = frame.capture
    return cut_hand(
        capture.depth_frames[0] * capture.depth_unit_m, capture.rig.depth, frame.corners_m[0], step_px=2
    )


@pytest.mark.parametrize(
    ("shape", "configuration", "seed"),
    [
        ("f_young_avg", "open", 1),
        ("m_tall_thin", "fist", 2),
        ("f_old_heavy", "two", 3),
        ("child10", "point", 4),
    ],
)
def test_the_points_in_view_lie_on_the_surface_and_nothing_else_does(
    shape: str, configuration: str, seed: int
) -> None:
    frame, skin = _frame(shape, configuration, seed)
    hand = _cut(frame)
    visible = np.array([place for name, place in frame.points_m.items() if frame.visible[name]])
    away = np.array(
        [
            np.linalg.norm(point.position_m - place)
            for point, place in zip(hand.surface.nearest(visible), visible, strict=True)
        ]
    )
    assert (away < 0.005).mean() > 0.9
    from scipy.spatial import cKDTree

    assert np.percentile(cKDTree(skin).query(hand.surface.vertices)[0], 99) < 0.010
    assert 1200 < len(hand.surface.vertices) < 7000
    assert hand.touching is None


def test_a_bottle_in_the_hand_does_not_become_hand() -> None:
    frame, skin = _frame("m_young_avg", "grip", 5, "bottle")
    from scipy.spatial import cKDTree

    foreign = cKDTree(skin).query(_cut(frame).surface.vertices)[0] > 0.010
    assert foreign.mean() < 0.20


def test_a_hand_on_a_belly_is_told() -> None:
    frame, _ = _frame("f_young_avg", "open", 6, "belly")
    touching = _cut(frame).touching
    assert touching is not None
    assert "touches" in touching
