"""Pinhole cameras and rigid transforms are exact inverses of themselves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.capture import CameraRig, PinholeCamera, RigidTransform
from core.errors import InputError

coordinate = st.floats(-3.0, 3.0)
vector = st.tuples(coordinate, coordinate, coordinate).map(np.array)


@st.composite
def cameras(draw: st.DrawFn) -> PinholeCamera:
    width, height = draw(st.integers(64, 2560)), draw(st.integers(48, 1920))
    fx, fy = (draw(st.floats(0.8, 1.5)) * max(width, height) for _ in range(2))
    cx, cy = draw(st.floats(0.4, 0.6)) * width, draw(st.floats(0.4, 0.6)) * height
    distortion = draw(
        st.one_of(
            st.just(()),
            st.tuples(
                st.floats(-0.1, 0.1),
                st.floats(-0.05, 0.05),
                st.floats(-0.002, 0.002),
                st.floats(-0.002, 0.002),
                st.floats(-0.01, 0.01),
            ),
        )
    )
    return PinholeCamera(width, height, fx, fy, cx, cy, distortion)


@st.composite
def transforms(draw: st.DrawFn) -> RigidTransform:
    axis = draw(vector)
    quaternion = np.array([1.0, *axis])
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return RigidTransform(rotation, draw(vector))


@given(cameras(), st.floats(0, 1), st.floats(0, 1), st.floats(0.3, 5.0))
def test_a_pixel_back_projected_and_projected_is_the_pixel(
    camera: PinholeCamera, s: float, t: float, z: float
) -> None:
    pixel = np.array([[s * (camera.width - 1), t * (camera.height - 1)]])
    point = camera.rays(pixel) * z
    assert point[0, 2] == pytest.approx(z)
    np.testing.assert_allclose(camera.project(point), pixel, atol=1e-3)


def test_back_projection_is_equation_3() -> None:
    camera = PinholeCamera(4, 3, 2.0, 3.0, 1.5, 1.0)
    points = camera.backproject(np.full((3, 4), 2.0))
    np.testing.assert_allclose(points[2, 3], [2.0 * (3 - 1.5) / 2.0, 2.0 * (2 - 1.0) / 3.0, 2.0])


def test_points_behind_the_camera_have_no_pixel() -> None:
    camera = PinholeCamera(640, 480, 575.0, 575.0, 319.5, 239.5, (0.1, 0, 0, 0))
    assert np.isnan(camera.project([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]])).all()


@given(transforms(), transforms(), vector)
def test_transforms_compose_and_invert(a: RigidTransform, b: RigidTransform, p: np.ndarray) -> None:
    np.testing.assert_allclose(a.inverse().apply(a.apply(p)), p, atol=1e-9)
    np.testing.assert_allclose((a @ b).apply(p), a.apply(b.apply(p)), atol=1e-9)
    np.testing.assert_allclose(RigidTransform.from_matrix(a.matrix).apply(p), a.apply(p), atol=1e-9)


@given(transforms(), vector, vector)
def test_transforms_keep_distances(a: RigidTransform, p: np.ndarray, q: np.ndarray) -> None:
    assert np.linalg.norm(a.apply(p) - a.apply(q)) == pytest.approx(np.linalg.norm(p - q), abs=1e-9)


@pytest.mark.parametrize(
    "matrix",
    [
        np.diag([2.0, 1, 1, 1]),
        np.diag([-1.0, 1, 1, 1]),
        np.full((4, 4), np.nan),
        np.eye(3),
        np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1.0]]),
    ],
)
def test_what_is_not_rigid_is_refused(matrix: np.ndarray) -> None:
    with pytest.raises(InputError):
        RigidTransform.from_matrix(matrix)


@given(transforms(), st.floats(0, 639), st.floats(0, 479), st.floats(0.5, 4.0))
def test_a_picture_ray_passes_the_points_seen_at_its_pixel(
    color_from_depth: RigidTransform, u: float, v: float, z: float
) -> None:
    color = PinholeCamera(640, 480, 525.0, 525.0, 319.5, 239.5)
    rig = CameraRig(PinholeCamera(640, 480, 575.0, 575.0, 319.5, 239.5), color, color_from_depth)
    origin, directions = rig.picture_rays([(u, v)])
    np.testing.assert_allclose(rig.project_to_picture(origin + z * directions), [(u, v)], atol=1e-6)
