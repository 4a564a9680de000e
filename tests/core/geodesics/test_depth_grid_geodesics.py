"""The thesis's own graph and mesh: eight neighbours (figure 6) and Delaunay (figure 7)."""

import numpy as np
import pytest

from core.errors import WorkError
from core.geodesics import delaunay_mesh, geodesic_solver, grid_solver, warm_up


class Sheet:
    """A depth image 20 x 30 at 1 m; ``step_m`` deeper from column 15 on."""

    def __init__(self, step_m=0.0):
        v, u = np.divmod(np.arange(600), 30)
        self.pixels = np.stack([u, v], axis=1).astype(np.int32)
        depth = 1.0 + step_m * (u >= 15)
        self.vertices = np.stack([u * 0.004, v * 0.004, depth], axis=1)
        i = np.flatnonzero((u < 29) & (v < 19))
        self.triangles = np.vstack([np.stack([i, i + 1, i + 30], 1), np.stack([i + 1, i + 31, i + 30], 1)])
        self.triangles = self.triangles.astype(np.int32)


def test_eight_neighbours_measure_the_octile_distance():
    sheet = Sheet()
    distances = grid_solver(sheet).distances([5 * 30 + 7])[0]
    du, dv = np.abs(sheet.pixels - [7, 5]).T
    octile = 0.004 * (np.maximum(du, dv) + (np.sqrt(2) - 1) * np.minimum(du, dv))
    assert distances == pytest.approx(octile, rel=1e-5)


def test_neighbours_across_a_depth_jump_are_not_joined():
    distances = grid_solver(Sheet(step_m=0.2)).distances([0])[0]
    assert np.isinf(distances.reshape(20, 30)[:, 15:]).all()
    assert np.isfinite(distances.reshape(20, 30)[:, :15]).all()
    assert np.isfinite(grid_solver(Sheet(step_m=0.2), jump_m=0.3).distances([0])).all()


def test_the_grid_solver_takes_points_between_pixels(plane):
    source = plane.point(2222, [0.2, 0.2, 0.6])
    distances = grid_solver(plane).distances([source])[0]
    corners = plane.triangles[2222]
    assert distances[corners] == pytest.approx(plane.true_distances(source.position_m)[corners])


def test_delaunay_covers_the_pixels_and_keeps_out_of_depth_jumps():
    flat = delaunay_mesh(Sheet())
    assert len(flat) == 2 * 29 * 19
    assert len(np.unique(flat)) == 600
    step = Sheet(step_m=0.2)
    triangles = delaunay_mesh(step)
    assert len(triangles) == 2 * 28 * 19
    assert np.ptp(step.vertices[triangles][:, :, 2], axis=1).max() == 0.0


def test_delaunay_leaves_gaps_in_the_image_open():
    sheet = Sheet()
    keep = (np.abs(sheet.pixels[:, 0] - 15) > 3) | (np.abs(sheet.pixels[:, 1] - 10) > 3)
    sheet.pixels, sheet.vertices = sheet.pixels[keep], sheet.vertices[keep]
    sheet.triangles = delaunay_mesh(sheet)
    middle = sheet.vertices[sheet.triangles].mean(axis=1)[:, :2] / 0.004
    assert not ((np.abs(middle - [15, 10]) < 3).all(axis=1)).any()


def test_fast_marching_runs_on_the_delaunay_mesh():
    sheet = Sheet()
    distances = geodesic_solver(sheet.vertices, delaunay_mesh(sheet), "fast-marching").distances([155])[0]
    truth = np.linalg.norm(sheet.vertices - sheet.vertices[155], axis=1)
    assert np.abs(distances - truth).max() < 0.02 * truth.max()


def test_pixels_in_one_line_cannot_be_triangulated():
    sheet = Sheet()
    sheet.pixels, sheet.vertices = sheet.pixels[:30], sheet.vertices[:30]
    with pytest.raises(WorkError, match="cannot be triangulated"):
        delaunay_mesh(sheet)


def test_after_warming_up_no_kernel_is_compiled_any_more(plane):
    from core.geodesics import dijkstra, fast_marching, paths, virtual_source, wedges

    kernels = [
        dijkstra.dijkstra_front,
        fast_marching.fast_marching_front,
        virtual_source.virtual_source_front,
        paths._walk_down,
        paths._walk_edges,
        wedges._fill,
        wedges._mark_bends,
    ]
    warm_up()
    known = [len(kernel.signatures) for kernel in kernels]
    assert min(known) == 1
    for method in ("dijkstra", "fast-marching", "virtual-source"):
        solver = geodesic_solver(plane.vertices, plane.triangles, method)
        solver.path(solver.distances([plane.point(10, [0.5, 0.25, 0.25])])[0], plane.vertex_point(3000))
    grid_solver(plane).distances([0])
    assert [len(kernel.signatures) for kernel in kernels] == known
