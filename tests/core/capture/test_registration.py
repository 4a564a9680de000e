"""Registration of depth to colour and colour to depth (thesis eq. 2 to 4)."""

import numpy as np
import pytest

from core.capture import (
    CameraRig,
    PinholeCamera,
    RigidTransform,
    register_color_to_depth,
    register_depth_to_color,
)
from core.errors import InputError

DEPTH = PinholeCamera(160, 120, 140.0, 140.0, 79.5, 59.5)
COLOR = PinholeCamera(400, 300, 380.0, 380.0, 199.5, 149.5)
ANGLE = 0.05
RIG = CameraRig(
    DEPTH,
    COLOR,
    RigidTransform.from_matrix(
        [
            [np.cos(ANGLE), 0, np.sin(ANGLE), -0.04],
            [0, 1, 0, 0.01],
            [-np.sin(ANGLE), 0, np.cos(ANGLE), 0.005],
            [0, 0, 0, 1],
        ]
    ),
)


def plane_depth(camera: PinholeCamera, normal: np.ndarray, distance: float) -> np.ndarray:
    """Depth at which rays meet the plane ``normal . p = distance`` of the camera's frame."""
    return np.asarray(distance / (camera.pixel_rays @ normal))


def test_a_plane_is_seen_where_the_colour_camera_would_measure_it() -> None:
    normal = np.array([0.2, -0.1, 1.0]) / np.linalg.norm([0.2, -0.1, 1.0])
    transform = RIG.picture_from_depth
    moved = transform.rotate(normal)
    expected = plane_depth(COLOR, moved, 1.5 + moved @ transform.translation)
    seen = register_depth_to_color(plane_depth(DEPTH, normal, 1.5), RIG)
    inside = seen[60:-60, 80:-80]
    assert (inside > 0).all(), "a finer colour image has no holes"
    np.testing.assert_allclose(inside, expected[60:-60, 80:-80], atol=1e-9)


def test_the_nearer_surface_hides_the_farther() -> None:
    depth = np.full((120, 160), 2.0)
    depth[40:80, 60:100] = 1.0
    seen = register_depth_to_color(depth, CameraRig(DEPTH, COLOR, RigidTransform(np.eye(3), np.zeros(3))))
    assert seen[150, 200] == pytest.approx(1.0)
    assert set(np.unique(seen.round(6))) <= {0.0, 1.0, 2.0}, "nothing is drawn across the depth jump"


def test_depth_pixels_take_the_colour_that_the_picture_shows_of_them() -> None:
    depth = plane_depth(DEPTH, np.array([0.0, 0.0, 1.0]), 1.5)
    u, v = np.meshgrid(np.arange(COLOR.width), np.arange(COLOR.height))
    picture = np.stack([u // 2, v // 2, 0 * u], axis=-1).astype(np.uint8)
    colors, known = register_color_to_depth(picture, depth, RIG)
    pixels = RIG.project_to_picture(DEPTH.backproject(depth).reshape(-1, 3)).reshape(120, 160, 2)
    inside = known & COLOR.contains(pixels.reshape(-1, 2), 2.0).reshape(120, 160)
    assert inside.mean() > 0.8
    np.testing.assert_allclose(colors[inside][:, :2], pixels[inside] / 2, atol=1.1)


def test_what_is_hidden_from_the_colour_camera_has_no_known_colour() -> None:
    depth = np.full((120, 160), 2.0)
    depth[30:90, 60:100] = 1.0
    rig = CameraRig(DEPTH, COLOR, RigidTransform(np.eye(3), np.array([-0.2, 0.0, 0.0])))
    picture = np.full((300, 400, 3), 90, np.uint8)
    _, known = register_color_to_depth(picture, depth, rig)
    assert known[60, 80], "the near square itself"
    assert not known[60, 55], "left of it the background is hidden from a camera that stands on the right"
    assert known[60, 105], "on the other side nothing is hidden"


def test_pixels_without_depth_have_no_colour() -> None:
    depth = np.full((120, 160), 2.0)
    depth[50:60, 50:60] = 0
    colors, known = register_color_to_depth(np.full((300, 400, 3), 90, np.uint8), depth, RIG)
    assert not known[50:60, 50:60].any()
    assert (colors[50:60, 50:60] == 0).all()


def test_registration_without_a_colour_camera_is_refused() -> None:
    with pytest.raises(InputError, match="no colour camera"):
        register_depth_to_color(np.ones((120, 160)), CameraRig(DEPTH))
