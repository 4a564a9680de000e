import numpy as np
import pytest

from core.anchors import shade_depth
from core.anchors.relief import LAMPS, shade_depths
from core.capture.camera import PinholeCamera

CAMERA = PinholeCamera(160, 120, 140.0, 140.0, 79.5, 59.5)


@pytest.fixture(scope="module")
def ball() -> tuple[np.ndarray, np.ndarray]:
    """Depth of a ball of 0.3 m radius at 1.2 m, and its outline."""
    rays = CAMERA.pixel_rays
    a, b = (rays**2).sum(-1), rays[..., 2] * 1.2
    root = b**2 - a * (1.2**2 - 0.3**2)
    mask = root > 0
    return np.where(mask, (b - np.sqrt(np.maximum(root, 0))) / a, 0.0), mask


@pytest.mark.parametrize("lamp", LAMPS)
def test_the_side_towards_the_lamp_is_brighter(lamp, ball) -> None:
    image = shade_depth(*ball, CAMERA, lamp).astype(float).sum(2)
    if lamp[0]:
        left, right = image[60, 55:65].mean(), image[60, 95:105].mean()
        assert (left > right) == (lamp[0] < 0)
    assert image[42:48, 80].mean() > image[72:78, 80].mean()


def test_what_is_not_body_is_plain_grey(ball) -> None:
    depth, mask = ball
    image = shade_depth(np.where(mask, depth, 1.9), mask, CAMERA)
    assert image.dtype == np.uint8
    assert len(np.unique(image[~mask].reshape(-1, 3), axis=0)) == 1
    r, g, b = image[60, 80]
    assert r > g > b


def test_the_outline_is_not_lit_falsely_by_the_background(ball) -> None:
    depth, mask = ball
    near_wall = shade_depth(np.where(mask, depth, 1.3), mask, CAMERA)
    no_wall = shade_depth(depth, mask, CAMERA)
    np.testing.assert_array_equal(near_wall, no_wall)


def test_several_lamps_light_the_same_sculpture(ball) -> None:
    images = shade_depths(*ball, CAMERA)
    assert len(images) == len(LAMPS)
    np.testing.assert_array_equal(images[1], shade_depth(*ball, CAMERA, LAMPS[1]))


def test_nothing_in_view_is_an_empty_picture() -> None:
    image = shade_depth(np.zeros((120, 160)), np.zeros((120, 160), bool), CAMERA)
    assert image.min() == image.max()
