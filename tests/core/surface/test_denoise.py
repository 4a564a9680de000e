"""Smoothing that mends the length of paths and spares the edges (METHOD section 2)."""

import numpy as np
import pytest

from core.capture import PinholeCamera
from core.surface import denoise_depth, fuse_depth

CAMERA = PinholeCamera(320, 240, 575.8, 575.8, 159.5, 119.5)


def cylinder_depth(radius: float = 0.15, distance: float = 1.5) -> np.ndarray:
    """An upright cylinder, depth 0 beside it."""
    x = CAMERA.pixel_rays[..., 0]
    a, b, c = x * x + 1, distance + radius, (distance + radius) ** 2 - radius**2
    root = b * b - a * c
    return np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, 0.0)


def row_lengths(depth: np.ndarray, columns: slice) -> np.ndarray:
    """Length of the path along every image row: what noise makes longer."""
    points = CAMERA.backproject(depth)[20:-20, columns]
    return np.asarray(np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1))


def test_geodesic_lengthening_drops_as_described() -> None:
    rng = np.random.default_rng(0)
    truth = cylinder_depth()
    sigma = 0.0012 + 0.0019 * (truth - 0.4) ** 2
    frames = np.where(truth > 0, truth + sigma * rng.standard_normal((30, *truth.shape)), 0)
    frames = np.rint(frames * 1000).astype(np.uint16)
    columns = slice(120, 200)
    true_length = row_lengths(truth, columns).mean()
    one = row_lengths(fuse_depth(frames[:1], 0.001).depth_m, columns).mean() / true_length - 1
    fused = fuse_depth(frames, 0.001).depth_m
    thirty = row_lengths(fused, columns).mean() / true_length - 1
    smooth = row_lengths(denoise_depth(fused), columns).mean() / true_length - 1
    assert one > 0.16, "a raw frame lengthens paths by more than 16 %"
    assert 0.01 < thirty < 0.10
    assert abs(smooth) < 0.004
    assert np.abs(denoise_depth(fused) - truth)[20:-20, columns].mean() < 0.0004


def test_even_a_single_noisy_frame_gains() -> None:
    """Noise of the size of the gate must not gate away the neighbours that would mend it."""
    rng = np.random.default_rng(1)
    truth = cylinder_depth(radius=0.3, distance=2.3)
    noisy = np.where(truth > 0, truth + 0.009 * rng.standard_normal(truth.shape), 0)
    columns = slice(130, 190)
    true_length = row_lengths(truth, columns).mean()
    assert row_lengths(noisy, columns).mean() / true_length - 1 > 1.0
    assert row_lengths(denoise_depth(noisy), columns).mean() / true_length - 1 < 0.25
    error = np.abs(denoise_depth(noisy) - truth)[20:-20, columns].mean()
    assert error < 0.5 * np.abs(noisy - truth)[20:-20, columns].mean()


def test_a_slanted_plane_is_left_as_it_is() -> None:
    normal = np.array([0.6, 0.3, -0.74])
    truth = -1.2 / (CAMERA.pixel_rays @ normal)
    truth = np.where((truth > 0.5) & (truth < 3), truth, 0)
    smooth = denoise_depth(truth)
    inner = np.zeros(truth.shape, bool)
    inner[8:-8, 8:-8] = (truth > 0.8)[8:-8, 8:-8] & (truth < 2.0)[8:-8, 8:-8]
    assert inner.sum() > 10_000
    np.testing.assert_allclose(smooth[inner], truth[inner], atol=2e-5)


@pytest.mark.parametrize("step_m", [0.025, 0.06, 0.5])
def test_both_sides_of_a_depth_jump_stay_apart(step_m: float) -> None:
    """An arm must not melt into the trunk behind it."""
    depth = np.full((60, 60), 1.5)
    depth[:, 30:] += step_m
    np.testing.assert_allclose(denoise_depth(depth), depth, atol=1e-6)


def test_missing_measurements_stay_missing_and_lone_ones_stay() -> None:
    depth = np.zeros((20, 20))
    depth[10, 10] = 1.3
    smooth = denoise_depth(depth)
    assert smooth[10, 10] == pytest.approx(1.3, abs=1e-6)
    assert (smooth > 0).sum() == 1
    assert (denoise_depth(np.zeros((8, 8))) == 0).all()
