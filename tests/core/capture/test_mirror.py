"""A mirrored recording becomes what an honest camera would have seen; left stays the patient's left."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.capture import (
    CameraRig,
    PinholeCamera,
    RgbdCapture,
    RigidTransform,
    read_capture,
    unmirror,
    write_capture,
)

DEPTH = PinholeCamera(64, 48, 57.6, 57.6, 30.0, 23.5)
COLOR = PinholeCamera(80, 60, 70.0, 70.0, 41.0, 29.5, (0.1, -0.05, 0.002, -0.003, 0.0))
TURN = RigidTransform.from_matrix(
    [
        [np.cos(0.1), 0, np.sin(0.1), -0.03],
        [0, 1, 0, 0.01],
        [-np.sin(0.1), 0, np.cos(0.1), 0.002],
        [0, 0, 0, 1],
    ]
)


def mirrored_capture() -> RgbdCapture:
    rng = np.random.default_rng(0)
    return RgbdCapture(
        rng.integers(1000, 3000, (2, 48, 64)).astype(np.uint16),
        0.001,
        CameraRig(DEPTH, COLOR, TURN),
        rng.integers(0, 255, (60, 80, 3)).astype(np.uint8),
        mirrored=True,
        joints_m={"left_hand": np.array([-0.4, 0.1, 2.0])},
    )


def test_images_are_flipped_and_joints_keep_their_names() -> None:
    recorded = mirrored_capture()
    mended = unmirror(recorded)
    assert not mended.mirrored
    np.testing.assert_array_equal(mended.depth_frames, recorded.depth_frames[:, :, ::-1])
    assert mended.color is not None
    assert recorded.color is not None
    np.testing.assert_array_equal(mended.color, recorded.color[:, ::-1])
    assert mended.joints_m is not None
    np.testing.assert_allclose(mended.joints_m["left_hand"], [0.4, 0.1, 2.0])


@given(st.floats(-0.5, 0.5), st.floats(-0.4, 0.4), st.floats(1.0, 3.0))
def test_the_mirror_image_of_a_point_is_seen_at_the_mirror_image_of_its_pixel(
    x: float, y: float, z: float
) -> None:
    """Both cameras, with lens distortion and a turned rig."""
    recorded = mirrored_capture().rig
    mended = unmirror(mirrored_capture()).rig
    assert recorded.color is not None
    for camera, pixels in (
        (recorded.depth, lambda rig, p: rig.depth.project(p)),
        (recorded.color, lambda rig, p: rig.project_to_picture(p)),
    ):
        seen = pixels(recorded, [[x, y, z]])[0]
        expected = [camera.width - 1 - seen[0], seen[1]]
        np.testing.assert_allclose(pixels(mended, [[-x, y, z]])[0], expected, atol=1e-6)


def test_un_mirroring_twice_changes_nothing() -> None:
    once = unmirror(mirrored_capture())
    assert unmirror(once) is once
    twice = unmirror(replace(once, mirrored=True))
    np.testing.assert_array_equal(twice.depth_frames, mirrored_capture().depth_frames)
    assert twice.rig.depth == DEPTH
    np.testing.assert_allclose(twice.rig.picture_from_depth.matrix, TURN.matrix, atol=1e-12)


def test_reading_a_mirrored_folder_gives_an_honest_capture(tmp_path: Path) -> None:
    write_capture(mirrored_capture(), tmp_path / "m")
    read = read_capture(tmp_path / "m")
    assert not read.mirrored
    assert read.joints_m is not None
    assert read.joints_m["left_hand"][0] == pytest.approx(0.4)
    np.testing.assert_array_equal(read.depth_frames, mirrored_capture().depth_frames[:, :, ::-1])
