"""Figure 8 and the CPU times: what is known about paths on planes must come out."""

from __future__ import annotations

import numpy as np
import pytest

from app.cli.evaluate_thesis import simulated_wall
from core.capture import CameraRig, PinholeCamera, RgbdCapture
from core.errors import InputError
from core.evaluation.thesis.draw_paths import ZOOM_PX, zoom_center
from core.evaluation.thesis.shortest_paths import synthetic_plane, wall_plane
from core.evaluation.thesis.timing import POINTS, sixty_thousand_points, time_methods


def test_on_a_synthetic_plane_graph_paths_are_octagonal_and_fronts_straight():
    scene = synthetic_plane()
    (pair,) = scene.paths
    along, across = 0.48, 0.20
    octile = along - across + np.sqrt(2) * across
    assert pair.straight_m == pytest.approx(np.hypot(along, across))
    assert pair.lengths_m["DM"] == pytest.approx(octile, rel=1e-6)
    assert pair.straight_m <= pair.lengths_m["FMM"] + 1e-9 < 1.002 * pair.straight_m
    assert np.allclose(pair.dijkstra_m[[0, -1]], pair.fast_marching_m[[0, -1]])


def test_noise_lengthens_both_paths_and_dijkstra_more():
    wall = simulated_wall(0)
    assert wall.color is None
    (pair,) = wall_plane(wall).paths
    assert pair.straight_m < pair.lengths_m["FMM"] < pair.lengths_m["DM"] < 1.4 * pair.straight_m


def test_the_zoom_shows_both_paths():
    scene = wall_plane(simulated_wall(0))
    (pair,) = scene.paths
    at = zoom_center(scene, ZOOM_PX)
    for line in (pair.dijkstra_m, pair.fast_marching_m):
        pixels = scene.surface.camera.project(line)
        assert (np.abs(pixels - at) <= np.array(ZOOM_PX) / 2).all(axis=1).any()


def test_a_capture_that_shows_no_wall_is_refused():
    camera = PinholeCamera(160, 120, 150.0, 150.0, 79.5, 59.5)
    x, y = camera.pixel_rays[..., 0], camera.pixel_rays[..., 1]
    bowl = (1000 * (1.5 - 1.2 * (x**2 + y**2))).astype(np.uint16)
    with pytest.raises(InputError, match="not flat"):
        wall_plane(RgbdCapture(bowl[None], 0.001, CameraRig(camera)))


def test_sixty_thousand_points_are_timed_for_all_methods():
    assert len(sixty_thousand_points().vertices) == POINTS
    count, times = time_methods(rounds=1)
    assert count == POINTS
    assert [t.method for t in times] == ["DM", "FMM", "virtual source"]
    assert [t.thesis_s for t in times] == [0.065, 1.75, None]
    for t in times:
        assert 0 < t.low_s <= t.one_source_s <= t.high_s < t.fifteen_sources_s
