"""How far a body moved, in millimetres, against bodies that were moved by a known distance."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.auxiliary.body_motion import body_motion, motion_within, reduced_camera, reduced_depth
from tests.devices.auxiliary.moving_body import CAMERA, UNIT_M, depth_of_body

FRAMES = 4


def seen(seed: int, **how: object) -> NDArray[np.float32]:
    """Mean of a few noisy frames, as a burst gives."""
    dice = np.random.default_rng(seed)
    frames = [
        reduced_depth(depth_of_body(noise=dice, camera=CAMERA, **how), UNIT_M)  # type: ignore[arg-type]
        for _ in range(FRAMES)
    ]
    return np.mean(frames, axis=0).astype(np.float32)


@pytest.fixture(scope="module")
def before() -> NDArray[np.float32]:
    return seen(0)


def test_a_still_body_has_not_moved_whatever_the_noise(before: NDArray[np.float32]) -> None:
    motion = body_motion(before, seen(100), reduced_camera(CAMERA))
    assert motion is not None
    assert motion.moved_m < 0.0025


@pytest.mark.parametrize(
    "shift",
    [(0.005, 0, 0), (0.03, 0, 0), (0, 0.01, 0), (0, 0, 0.003), (0, 0, -0.04), (0.006, 0, 0.008)],
)
def test_a_moved_body_moved_so_far(before: NDArray[np.float32], shift: tuple[float, float, float]) -> None:
    """Sideways too, where no pixel of its front changes its depth."""
    motion = body_motion(before, seen(200, shift=shift), reduced_camera(CAMERA))
    assert motion is not None
    assert motion.moved_m == pytest.approx(np.linalg.norm(shift), abs=0.0015)


def test_a_turn_moves_the_flanks(before: NDArray[np.float32]) -> None:
    motion = body_motion(before, seen(300, turn=np.radians(2.0)), reduced_camera(CAMERA))
    assert motion is not None
    assert 0.004 < motion.moved_m < 0.008, "0.18 m from the axis, by 2 degrees"


def test_an_arm_counts_though_the_body_stands(before: NDArray[np.float32]) -> None:
    motion = body_motion(before, seen(400, arm=0.02), reduced_camera(CAMERA))
    assert motion is not None
    assert motion.whole_m < 0.002
    assert motion.moved_m == pytest.approx(0.02, abs=0.004)


def test_an_empty_room_has_no_motion() -> None:
    wall = np.full((120, 160), np.nan, np.float32)
    assert body_motion(wall, wall, reduced_camera(CAMERA)) is None


def test_movement_within_a_burst(before: NDArray[np.float32]) -> None:
    frames = np.stack([depth_of_body((0.0, 0.0, 0.001 * i), camera=CAMERA) for i in range(9)])
    motion = motion_within(frames, UNIT_M, CAMERA)
    assert motion is not None
    assert motion.moved_m == pytest.approx(0.006, abs=0.001), "from the middle of one third to the other"
    assert motion_within(frames[:2], UNIT_M, CAMERA) is None
