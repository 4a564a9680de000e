"""From a capture to the patient's skin, with what the person at the screen must know."""

from typing import Any

import numpy as np
import pytest

from core.errors import Cancelled, WorkError
from core.surface import BodyScan, scan_body, warm_up


@pytest.fixture(scope="module")
def scan(make_scene: Any, make_person: Any, room: Any) -> BodyScan:
    return scan_body(make_scene(make_person(), room).capture(frames=10))


def test_the_surface_is_the_body_within_millimetres(
    scan: BodyScan, make_scene: Any, make_person: Any, room: Any
) -> None:
    truth, _ = make_scene(make_person(), room).true_depth()
    u, v = scan.surface.pixels.T
    inner = ~scan.surface.boundary
    error = np.abs(scan.surface.vertices[:, 2] - truth[v, u])[inner]
    assert error.mean() < 0.002
    assert np.percentile(error, 99) < 0.012


def test_noise_and_coverage_are_measured(scan: BodyScan) -> None:
    assert scan.depth_noise_m == pytest.approx(0.0012 + 0.0019 * (2.4 - 0.4) ** 2, rel=0.2)
    assert 0.95 < scan.body_coverage <= 1.0
    assert scan.warnings == ()


def test_the_noise_of_a_single_frame_is_estimated_too(make_scene: Any, make_person: Any) -> None:
    single = scan_body(make_scene(make_person()).capture(frames=1))
    assert single.depth_noise_m == pytest.approx(0.0012 + 0.0019 * (2.4 - 0.4) ** 2, rel=0.25)


def test_missing_depth_inside_the_body_is_told(make_scene: Any, make_person: Any) -> None:
    capture = make_scene(make_person()).capture(frames=1)
    capture.depth_frames[:, 90:130, 145:175] = 0
    scan = scan_body(capture)
    assert scan.body_coverage < 0.93
    capture.depth_frames[:, np.random.default_rng(0).random((240, 320)) < 0.25] = 0
    assert any("measured" in w for w in scan_body(capture).warnings)


def test_progress_is_reported_and_cancelling_stops(make_scene: Any, make_person: Any) -> None:
    capture = make_scene(make_person()).capture(frames=1)
    seen: list[float] = []
    scan_body(capture, progress=lambda fraction, message="": seen.append(fraction))
    assert seen[0] == 0
    assert seen[-1] == 1
    assert seen == sorted(seen)

    def stop(fraction: float, message: str = "") -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        scan_body(capture, progress=stop)


def test_no_body_is_a_failure_of_the_work_not_of_the_input(make_scene: Any, room: Any) -> None:
    with pytest.raises(WorkError, match="No body found") as caught:
        scan_body(make_scene([], room).capture())
    assert caught.value.exit_code == 3


def test_a_flat_thing_is_no_body(make_scene: Any, make_part: Any) -> None:
    """A board with next to no thickness is left out rather than taken for a patient."""
    with pytest.raises(WorkError):
        scan_body(make_scene([make_part((0, 0, 2), (0.2, 0.5, 0.004))]).capture())


def test_warming_up_needs_no_device_and_no_data() -> None:
    warm_up()
