"""The marker's corners on the skin, against what simulated hands know; and what is said when they are not."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray

import core.hand.marker_anchors as room
from core.capture import PinholeCamera
from core.hand.marker_anchors import MarkerAnchors
from core.hand.skin_patch import depth_along, fit_patch
from devices.simulator.hands.scene import HandFrame, MarkerSheet, take_frame
from devices.simulator.hands.shots import HandVariation, Holder, hand_view, shoot
from devices.simulator.room import make_rig

SIDE_M = 0.036


@lru_cache(maxsize=16)
def _frame(shape: str = "f_old_heavy", configuration: str = "open", seed: int = 0) -> HandFrame:
    return shoot(Holder(shape, seed=seed), configuration, seed, variation=HandVariation(tilt_deg=25.0))


@lru_cache(maxsize=4)
def _with(markers: tuple[MarkerSheet, ...]) -> HandFrame:
    rng = np.random.default_rng(5)
    view = hand_view(Holder("m_young_avg"), "open", rng, HandVariation(tilt_deg=8.0))
    return take_frame(replace(view, markers=markers), make_rig((640, 480)), rng)


def _depth(frame: HandFrame) -> NDArray[np.float64]:
    return frame.capture.depth_frames[0] * frame.capture.depth_unit_m


def _find(finder: MarkerAnchors, frame: HandFrame, **changed: object):  # type: ignore[no-untyped-def]
    given = {"rgb": frame.capture.color, "depth_m": _depth(frame), "rig": frame.capture.rig, **changed}
    return finder.find(**given)  # type: ignore[arg-type]


def test_corners_lie_on_the_skin_within_two_millimetres() -> None:
    errors = []
    for shape, configuration, seed in (
        ("f_old_heavy", "open", 0),
        ("m_tall_thin", "fist", 1),
        ("child10", "two", 2),
        ("f_young_avg", "pinch", 3),
    ):
        frame = _frame(shape, configuration, seed)
        found = _find(MarkerAnchors(SIDE_M), frame)
        assert found.seen
        assert found.reason is None
        errors.append(np.linalg.norm(found.places_m - frame.corners_m[0], axis=1))
    assert np.median(errors) < 0.0010
    assert np.max(errors) < 0.0030


def test_near_the_place_of_the_frame_before_the_same_is_found() -> None:
    frame = _frame()
    moved = frame.corners_m[0] + (0.012, -0.010, 0.015)
    near = _find(MarkerAnchors(SIDE_M), frame, near_m=moved)
    assert near.places_m == pytest.approx(_find(MarkerAnchors(SIDE_M), frame).places_m, abs=2e-4)
    # and elsewhere, if the hand has moved on
    far = _find(MarkerAnchors(SIDE_M), frame, near_m=frame.corners_m[0] + (0.2, 0.1, 0.0))
    assert far.seen
    assert far.places_m == pytest.approx(near.places_m, abs=2e-4)


def test_depth_that_is_missing_in_places_does_not_move_the_corners() -> None:
    frame = _frame()
    rig = frame.capture.rig
    depth = _depth(frame)
    u, v = np.rint(rig.depth.project(frame.corners_m[0].mean(axis=0))[0]).astype(int)
    depth[v - 3 : v + 4, u - 3 : u + 4] = 0.0
    found = _find(MarkerAnchors(SIDE_M), frame, depth_m=depth)
    assert np.linalg.norm(found.places_m - frame.corners_m[0], axis=1).max() < 0.003


def test_a_marker_without_depth_is_placed_by_its_size_and_says_so() -> None:
    frame = _frame()
    found = _find(MarkerAnchors(SIDE_M), frame, depth_m=np.zeros_like(_depth(frame)))
    assert found.seen
    assert found.reason is not None
    assert "no depth" in found.reason
    assert np.linalg.norm(found.places_m - frame.corners_m[0], axis=1).max() < 0.06


def test_a_wrong_size_is_told_in_millimetres() -> None:
    found = _find(MarkerAnchors(0.050), _frame())
    assert not found.seen
    assert np.isnan(found.places_m).all()
    assert found.reason is not None
    assert "not 50 mm" in found.reason
    assert any(f"measures {mm} mm" in found.reason for mm in (34, 35, 36, 37))


def test_two_markers_are_refused_unless_size_or_number_tells_them_apart() -> None:
    second = MarkerSheet(0.020, number=9, shift_m=(0.0, 0.045))
    twin = replace(second, side_m=0.024)
    first = MarkerSheet(0.024, number=7, shift_m=(0.0, -0.005))
    both = _find(MarkerAnchors(0.024), _with((first, twin)))
    assert not both.seen
    assert both.reason is not None
    assert "2 markers" in both.reason
    numbered = _find(MarkerAnchors(0.024, number=7), _with((first, twin)))
    assert numbered.seen
    truth = _with((first, twin)).corners_m[0]
    assert np.linalg.norm(numbered.places_m - truth, axis=1).max() < 0.003


def test_no_marker_and_no_picture_are_said() -> None:
    frame = _with(())
    finder = MarkerAnchors(SIDE_M)
    assert _find(finder, frame).reason == "No marker is in view."
    assert "colour picture" in (_find(finder, frame, rgb=None).reason or "")


def test_another_dictionary_is_named_and_not_looked_for_on_every_frame(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    frame = _with((MarkerSheet(0.040, number=3, dictionary="DICT_5X5_50"),))
    finder = MarkerAnchors(0.040)
    asked = []
    real = room.other_dictionary
    monkeypatch.setattr(room, "other_dictionary", lambda *a: (asked.append(1), real(*a))[1])
    reasons = {_find(finder, frame).reason for _ in range(10)}
    assert reasons == {"The marker in view is of DICT_5X5_50, not of DICT_4X4_50."}
    assert len(asked) == 1


def test_a_noisy_tilted_plane_is_met_where_it_is() -> None:
    camera = PinholeCamera(200, 160, 300.0, 300.0, 99.5, 79.5)
    rng = np.random.default_rng(1)
    x, y = camera.pixel_rays[..., 0], camera.pixel_rays[..., 1]
    truth = 0.6 / (1.0 - 0.4 * x + 0.3 * y)
    depth = truth + rng.normal(0.0, 0.002, truth.shape)
    depth[rng.random(depth.shape) < 0.05] += 0.03
    outline = np.array([(80.0, 60.0), (120.0, 60.0), (120.0, 100.0), (80.0, 100.0)])
    patch = fit_patch(depth, camera, outline, 0.6)
    assert patch is not None
    at = outline.astype(int)
    assert patch.depth_m(outline) == pytest.approx(truth[at[:, 1], at[:, 0]], abs=0.0008)
    assert fit_patch(np.zeros_like(depth), camera, outline, 0.6) is None
    way = depth_along(truth, camera, np.zeros(3), camera.pixel_rays[80, 100])
    assert way == pytest.approx(truth[80, 100], abs=0.002)
