"""The shortest path itself, for drawing (thesis figure 8): fronts cross faces, Dijkstra follows edges."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from core.errors import InputError, WorkError
from core.geodesics.meshes import FloatArray, IntArray, Source, checked_point
from core.geodesics.wedges import UnsignedArray, WedgeGraph
from core.surface.points import SurfacePoint


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _best_crossing(vertices, d, x, p, q, ends_only):  # type: ignore[no-untyped-def]
    """Where a path from ``x`` best crosses edge ``pq``: share along it, value there, length of the way."""
    length = 0.0
    along = 0.0
    away = 0.0
    for j in range(3):
        e = vertices[q, j] - vertices[p, j]
        g = x[j] - vertices[p, j]
        length += e * e
        along += e * g
        away += g * g
    length = math.sqrt(length)
    if length == 0.0:
        return 0.0, d[p], math.sqrt(away)
    cx = along / length
    cy = math.sqrt(max(away - cx * cx, 0.0))
    from_p = math.sqrt(away)
    from_q = math.sqrt((cx - length) * (cx - length) + cy * cy)
    share, value, way = 0.0, d[p], from_p
    if d[q] + from_q < value + way:
        share, value, way = 1.0, d[q], from_q
    if ends_only:
        return share, value, way
    sx = ((d[p] - d[q]) * (d[p] + d[q]) + length * length) / (2.0 * length)
    sy2 = (d[p] - sx) * (d[p] + sx)
    if sy2 >= 0.0:
        sy = math.sqrt(sy2)
        if cy + sy > 0.0:
            y = cx + (sx - cx) * cy / (cy + sy)
            if 0.0 < y < length:
                there = math.sqrt((y - sx) * (y - sx) + sy2)
                step = math.sqrt((y - cx) * (y - cx) + cy * cy)
                if there + step <= value + way + 1e-9 * length:
                    share, value, way = y / length, there, step
    return share, value, way


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _walk_down(vertices, start, corners, d, home, a, b, c, x, path):  # type: ignore[no-untyped-def]
    """Walk from ``x`` inside face ``abc`` down ``d`` until inside ``home``; returns the number of points.

    ``home`` is the source's triangle, or one vertex three times. The result is -1 when the walk cannot go on.
    The feature that holds ``x`` is face ``abc``, edge ``ab`` (c = -1) or vertex ``a`` (b = c = -1).
    """
    count = 0
    here = math.inf
    ends_only = False
    limit = path.shape[0]
    while count < limit:
        for j in range(3):
            path[count, j] = x[j]
        count += 1
        inside = (a == home[0] or a == home[1] or a == home[2]) and (
            b < 0 or b == home[0] or b == home[1] or b == home[2]
        )
        if inside and (c < 0 or c == home[0] or c == home[1] or c == home[2]):
            return count
        best = math.inf
        best_end = math.inf
        share = 0.0
        value = 0.0
        p = -1
        q = -1
        end = -1
        if c >= 0:
            candidates = np.int64(1)
            first = np.int64(0)
        else:
            first = np.int64(start[a])
            candidates = np.int64(start[a + 1]) - first
        for k in range(first, first + candidates):
            if c >= 0:
                u, v, w = a, b, c
            else:
                u, v, w = a, np.int64(corners[k, 0]), np.int64(corners[k, 1])
                if b >= 0 and v != b and w != b:
                    continue
            for e in range(3):  # edges of face (u, v, w) that do not hold x
                if e == 0:
                    f, g = v, w
                elif e == 1:
                    f, g = w, u
                else:
                    f, g = u, v
                if c < 0 and b < 0 and e > 0:
                    continue
                if b >= 0 and c < 0 and ((f == a and g == b) or (f == b and g == a)):
                    continue
                if not (d[f] < math.inf and d[g] < math.inf):
                    continue
                t, val, step = _best_crossing(vertices, d, x, f, g, ends_only)
                if val < here - 1e-9 * (step + val) and val + step < best:
                    best = val + step
                    share, value, p, q = t, val, f, g
                t, val, step = _best_crossing(vertices, d, x, f, g, True)
                if val + step < best_end:
                    best_end = val + step
                    end = f if t == 0.0 else g
        if p < 0:
            # Two fronts meet here: the value between two vertices was too low. Go on from a vertex.
            if ends_only or end < 0:
                return -1
            p, q, share, value = end, end, 0.0, d[end]
            ends_only = True
        else:
            ends_only = False
        here = value
        for j in range(3):
            x[j] = (1.0 - share) * vertices[p, j] + share * vertices[q, j]
        a = p if share < 1.0 else q
        b = q if 0.0 < share < 1.0 else -1
        c = -1
    return -1


def _place(vertices: FloatArray, triangles: IntArray, point: SurfacePoint, name: str) -> FloatArray:
    corners, weights = checked_point(triangles, point, name)
    place: FloatArray = weights @ vertices[corners]
    return place


def locate_source(
    vertices: FloatArray, triangles: IntArray, distances: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Find where a distance field starts: its triangle (3,), or one vertex three times, and the place (3,).

    Inside the source's triangle the three corner distances are straight, so they trilaterate the source; the
    triangle around the smallest distance in which they agree best is the source's.
    """
    least = int(np.argmin(distances))
    scale = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    if not np.isfinite(distances[least]):
        raise InputError("The distances reach no vertex, so they have no source.")
    if distances[least] <= 1e-9 * scale:
        return np.full(3, least, dtype=np.int32), vertices[least].copy()
    ring = np.unique(triangles[(triangles == least).any(axis=1)])
    rows = np.flatnonzero(np.isin(triangles, ring).any(axis=1))
    best, found = np.inf, None
    for corners in triangles[rows]:
        a, b, c = vertices[corners]
        r = distances[corners]
        if not np.isfinite(r).all():
            continue
        gram = np.array([[(b - a) @ (b - a), (b - a) @ (c - a)], [(b - a) @ (c - a), (c - a) @ (c - a)]])
        if np.linalg.det(gram) <= 1e-18 * np.trace(gram) ** 2:
            continue
        right = 0.5 * np.array([r[0] ** 2 - r[1] ** 2 + gram[0, 0], r[0] ** 2 - r[2] ** 2 + gram[1, 1]])
        v, w = np.linalg.solve(gram, right)
        weights = np.array([1.0 - v - w, v, w])
        place = weights @ np.array([a, b, c])
        size = math.sqrt(gram[0, 0])
        error = float(np.abs(np.linalg.norm(vertices[corners] - place, axis=1) - r).max()) / size
        error += max(0.0, -float(weights.min()))
        if error < best:
            best, found = error, (corners.copy(), place)
    if found is None or best > 0.05:
        raise InputError("The distances have no source on this surface; were they made for another one?")
    return found


def _home(
    vertices: FloatArray, triangles: IntArray, distances: FloatArray, source: Source | None
) -> tuple[IntArray, FloatArray]:
    if source is None:
        return locate_source(vertices, triangles, distances)
    if isinstance(source, SurfacePoint):
        corners, weights = checked_point(triangles, source, "The path's source")
        return corners.copy(), weights @ vertices[corners]
    if not 0 <= int(source) < len(vertices):
        raise InputError(f"The path's source is vertex {int(source)}, which the mesh does not have.")
    return np.full(3, int(source), dtype=np.int32), vertices[int(source)].copy()


def _checked_distances(vertices: FloatArray, distances: FloatArray) -> FloatArray:
    field = np.array(distances, dtype=np.float64, order="C")
    if field.shape != (len(vertices),):
        raise InputError(f"A path needs one distance per vertex ({len(vertices)}), not {field.shape}.")
    return field


def trace_front_path(
    vertices: FloatArray,
    triangles: IntArray,
    wedges: WedgeGraph,
    distances: FloatArray,
    target: SurfacePoint,
    source: Source | None = None,
) -> FloatArray:
    """Trace the shortest path of a fast-marching or virtual-source field.

    From each point the path goes straight, through one face, to the place of the face's border from which the
    whole way is shortest; the value between two vertices is that of the circular front through both.

    Returns
    -------
    ndarray (k, 3)
        From ``target`` to the source.

    Raises
    ------
    WorkError
        ``target`` cannot be reached from the source.
    """
    field = _checked_distances(vertices, distances)
    corners, weights = checked_point(triangles, target, "The path's target")
    home, end = _home(vertices, triangles, field, source)
    if not np.isfinite(field[corners]).all():
        raise WorkError("No path joins the two points: they lie on separate parts of the surface.")
    x = weights @ vertices[corners]
    buffer = np.empty((16 * len(vertices) + 16, 3))
    a, b, c = (int(i) for i in corners)
    count = _walk_down(vertices, wedges.start, wedges.corners, field, home, a, b, c, x, buffer)
    if count < 0:
        raise WorkError("The path could not be followed: the distances do not fall toward a source.")
    points = np.vstack([buffer[:count], end[None]])
    keep = np.ones(len(points), dtype=bool)
    keep[1:-1] = (np.diff(points[:-1], axis=0) != 0.0).any(axis=1)
    if len(points) > 2 and not (points[-1] != points[-2]).any():
        keep[-2] = False
    path: FloatArray = points[keep]
    return path


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _walk_edges(start, neighbours, lengths, d, home, v, path):  # type: ignore[no-untyped-def]
    count = 0
    while count < path.shape[0]:
        path[count] = v
        count += 1
        if v == home[0] or v == home[1] or v == home[2]:
            return count
        best = math.inf
        following = np.int64(-1)
        for k in range(np.int64(start[v]), np.int64(start[v + 1])):
            t = np.int64(neighbours[k])
            if d[t] < d[v] and d[t] + lengths[k] < best:
                best = d[t] + lengths[k]
                following = t
        if following < 0:
            return -1
        v = following
    return -1


def trace_edge_path(
    vertices: FloatArray,
    triangles: IntArray,
    graph: tuple[UnsignedArray, UnsignedArray, NDArray[np.float32]],
    distances: FloatArray,
    target: SurfacePoint,
    source: Source | None = None,
) -> FloatArray:
    """Trace the shortest path of a Dijkstra field from vertex to vertex along ``graph``.

    Returns
    -------
    ndarray (k, 3)
        From ``target`` to the source.
    """
    field = _checked_distances(vertices, distances)
    corners, weights = checked_point(triangles, target, "The path's target")
    home, end = _home(vertices, triangles, field, source)
    if not np.isfinite(field[corners]).all():
        raise WorkError("No path joins the two points: they lie on separate parts of the surface.")
    place = weights @ vertices[corners]
    if set(corners.tolist()) == set(home.tolist()):
        return np.vstack([place, end])
    ways = field[corners] + np.linalg.norm(vertices[corners] - place, axis=1)
    first = int(corners[int(np.argmin(ways))])
    order = np.empty(len(vertices), dtype=np.int32)
    count = _walk_edges(*graph, field, home, first, order)
    if count < 0:
        raise WorkError("The path could not be followed: the distances do not fall toward a source.")
    points = np.vstack([place, vertices[order[:count]], end])
    keep = np.append(True, (np.diff(points, axis=0) != 0.0).any(axis=1))
    path: FloatArray = points[keep]
    return path
