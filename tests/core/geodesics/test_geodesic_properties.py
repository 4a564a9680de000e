"""What must hold for every surface, on bumpy sheets drawn at random, whole or with triangles missing."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.geodesics import GEODESIC_METHODS, geodesic_solver

SIDE = 14
METHODS = st.sampled_from(list(GEODESIC_METHODS))
# Dijkstra is exact on its graph. The fronts approximate: on sheets as coarse as these, ragged at the
# edge, they are right to about 0.2 per cent on average but to a few per cent at worst.
SLACK = {"dijkstra": 1e-5, "fast-marching": 0.1, "virtual-source": 0.1}


@dataclass(frozen=True)
class Sheet:
    seed: int
    bumps: float
    missing: float

    @property
    def rng(self):
        return np.random.default_rng(self.seed)

    @property
    def vertices(self):
        rng = self.rng
        v, u = np.divmod(np.arange(SIDE * SIDE), SIDE)
        height = self.bumps * rng.normal(size=(SIDE, SIDE))
        for axis in (0, 1):
            height = (np.roll(height, 1, axis) + height + np.roll(height, -1, axis)) / 3.0
        aside = rng.uniform(-0.3, 0.3, (2, SIDE * SIDE))
        return np.stack([u + aside[0], v + aside[1], height.ravel()], axis=1)

    @property
    def triangles(self):
        v, u = np.divmod(np.arange(SIDE * SIDE), SIDE)
        c = np.flatnonzero((u < SIDE - 1) & (v < SIDE - 1))
        upper = np.stack([c, c + 1, c + SIDE], axis=1)
        lower = np.stack([c + 1, c + SIDE + 1, c + SIDE], axis=1)
        triangles = np.vstack([upper, lower])
        return triangles[self.rng.random(len(triangles)) >= self.missing]

    @property
    def some_vertices(self):
        return self.rng.choice(SIDE * SIDE, 3, replace=False).tolist()


def sheets(most_bumps=1.0, missing=(0.0,)):
    return st.builds(
        Sheet, st.integers(0, 2**32 - 1), st.floats(0.0, most_bumps), st.sampled_from(list(missing))
    )


def solve(sheet, method="virtual-source"):
    return geodesic_solver(sheet.vertices, sheet.triangles, method).distances(sheet.some_vertices, threads=1)


@given(sheets(), METHODS)
@settings(max_examples=60, deadline=None)
def test_distance_is_symmetric_and_obeys_the_triangle_inequality(sheet, method):
    between = solve(sheet, method)[:, sheet.some_vertices]
    slack = SLACK[method]
    assert between == pytest.approx(between.T, rel=slack)
    assert between[0, 2] <= (between[0, 1] + between[1, 2]) * (1.0 + slack)


@given(sheets(3.0, (0.05, 0.2)))
@settings(max_examples=40, deadline=None)
def test_with_triangles_missing_dijkstra_stays_symmetric(sheet):
    between = solve(sheet, "dijkstra")[:, sheet.some_vertices]
    assert between == pytest.approx(between.T, rel=1e-5)


@given(sheets(3.0, (0.0, 0.05, 0.2)), st.sampled_from(["fast-marching", "virtual-source"]))
@settings(max_examples=60, deadline=None)
def test_a_front_reaches_what_dijkstra_reaches_and_never_takes_a_longer_way(sheet, method):
    front, edges = solve(sheet, method), solve(sheet, "dijkstra")
    reached = np.isfinite(edges)
    assert (np.isfinite(front) == reached).all()
    assert (front[reached] <= edges[reached] * (1.0 + 1e-5)).all()


@given(sheets(), METHODS)
@settings(max_examples=40, deadline=None)
def test_no_way_is_shorter_than_the_straight_line(sheet, method):
    places = sheet.vertices
    straight = np.linalg.norm(places[None] - places[sheet.some_vertices][:, None], axis=2)
    ratio = solve(sheet, method)[straight > 0.0] / straight[straight > 0.0]
    if method == "virtual-source":  # where a bent and a straight front meet it may fall short
        assert ratio.min() > 0.75
        assert np.quantile(ratio, 0.03) > 0.99
    else:
        assert ratio.min() > 1.0 - 1e-5


@given(sheets(), METHODS, st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_moving_turning_scaling_and_renumbering_the_sheet_change_nothing(sheet, method, seed):
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    scale = 10.0 ** rng.uniform(-3, 3)
    order = rng.permutation(SIDE * SIDE)
    number = np.argsort(order)
    vertices = scale * (sheet.vertices @ turn.T + rng.normal(size=3))[order]
    triangles = rng.permutation(number[sheet.triangles])
    solver = geodesic_solver(vertices, triangles, method)
    moved = solver.distances(number[sheet.some_vertices].tolist(), threads=1)[:, number] / scale
    kept = solve(sheet, method)
    slack = {"dijkstra": 1e-5, "fast-marching": 1e-4, "virtual-source": 0.1}[method]
    assert moved == pytest.approx(kept, rel=slack, abs=1e-6)
    assert np.median(np.abs(moved - kept)) < 1e-4
