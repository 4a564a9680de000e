"""Thirty frames become one depth image."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from core.errors import InputError
from core.surface import fuse_depth


def reference(column: np.ndarray, gate: int, least: int) -> float:
    """The definition, one pixel at a time."""
    values = np.sort(column[column > 0].astype(np.int64))
    if len(values) < least or len(values) == 0:
        return 0.0
    median = values[(len(values) - 1) // 2]
    kept = values[np.abs(values - median) <= gate]
    return float(kept.mean()) if len(kept) >= least else 0.0


depth_value = st.one_of(st.just(0), st.integers(980, 1060), st.integers(1, 65535))


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 31).flatmap(lambda n: arrays(np.uint16, (n, 2, 5), elements=depth_value)))
def test_fusion_is_the_mean_around_the_median(frames: np.ndarray) -> None:
    fused = fuse_depth(frames, 0.001)
    least = max(1, int(np.ceil(0.3 * len(frames))))
    for v, u in np.ndindex(2, 5):
        expected = reference(frames[:, v, u], 25, least) / 1000
        assert fused.depth_m[v, u] == pytest.approx(expected, abs=1e-9)


def test_a_flickering_pixel_takes_one_side_never_the_middle() -> None:
    frames = np.full((10, 4, 4), 1000, np.uint16)
    frames[::3] = 2000
    assert (fuse_depth(frames, 0.001).depth_m == 1.0).all()


def test_a_pixel_rarely_measured_is_not_trusted() -> None:
    frames = np.zeros((30, 4, 4), np.uint16)
    frames[:8] = 1500
    assert (fuse_depth(frames, 0.001).depth_m == 0).all()
    frames[8] = 1500
    assert (fuse_depth(frames, 0.001).depth_m == 1.5).all()


def test_the_noise_of_one_measurement_is_estimated() -> None:
    rng = np.random.default_rng(0)
    frames = np.rint(2000 + 5 * rng.standard_normal((30, 60, 80))).astype(np.uint16)
    fused = fuse_depth(frames, 0.001)
    assert np.median(fused.noise_m) == pytest.approx(0.005, rel=0.1)
    assert np.abs(fused.depth_m - 2.0).mean() < 0.001
    assert fused.frames == 30


def test_a_single_frame_passes_and_its_noise_is_unknown() -> None:
    frame = np.array([[[0, 700], [1234, 65535]]], np.uint16)
    fused = fuse_depth(frame, 0.0005)
    np.testing.assert_allclose(fused.depth_m, frame[0] * 0.0005)
    assert np.isnan(fused.noise_m).all()


def test_frames_of_another_type_are_refused() -> None:
    with pytest.raises(InputError):
        fuse_depth(np.zeros((2, 4, 4), np.float64), 0.001)  # type: ignore[arg-type]
