"""Which depth pixels are the patient: not the room, not a second person."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.errors import WorkError
from core.surface.planes import find_floor, find_walls
from core.surface.threads import one_linear_algebra_thread

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_STRIDE = 4
_MIN_BODY_M2 = 0.04
_MIN_BODY_PIXELS = 1200
_FARTHEST_M = 6.0
_PERSON_M2 = 0.08
_PERSON_HEIGHT_M = 0.35
_SPECK_PIXELS = 25
_ISLAND_REACH_M = 0.25
_EDGE_PIXELS = 4
_EDGE_LENGTH = 8


@dataclass(frozen=True, eq=False)
class BodyMask:
    """The patient in the depth image.

    Attributes
    ----------
    mask : ndarray (h, w) bool
    warnings : tuple of str
        Sentences for the person at the screen.
    cut_by_frame : bool
        Whether the body leaves the image.
    other_people : int
        Further things of a person's size that were left out.
    """

    mask: BoolArray
    warnings: tuple[str, ...]
    cut_by_frame: bool
    other_people: int


@dataclass(frozen=True, eq=False)
class _Parts:
    """Connected parts of the scene and their measures, one row each."""

    labels: NDArray[np.int32]
    pixels: NDArray[np.int64]
    area: FloatArray
    center: FloatArray
    low: FloatArray
    high: FloatArray


def segment_body(depth_m: FloatArray, camera: PinholeCamera) -> BodyMask:
    """Find the patient in a fused depth image.

    Walls and floor are removed as planes; of the connected parts left, the patient is the one that is large,
    central and near, with the parts that belong to it (a forearm held before the trunk is an island in the
    image).

    Parameters
    ----------
    depth_m : ndarray (h, w)
        Metres; 0 means no measurement.

    Raises
    ------
    WorkError
        If there is nothing of a body's size and shape.
    """
    depth = np.where((depth_m > 0) & (depth_m < _FARTHEST_M), depth_m, 0.0)
    points = camera.backproject(depth)
    with one_linear_algebra_thread():
        depth = np.where(_in_room(points, depth, camera), depth, 0.0)
    parts = _connected_parts(points, depth, camera)
    main = _main_part(parts, points)
    if main is None:
        raise WorkError(
            "No body found in the depth image.",
            "Place the person 1 to 3 m from the camera, facing it, with nothing in between.",
        )
    belongs = _belonging_parts(parts, main)
    mask = belongs[parts.labels] & (parts.labels >= 0)
    others = _other_people(parts, belongs)
    sides = _cut_sides(mask, depth_m > 0)
    warnings = []
    if others:
        warnings.append(
            "Another person or large object is in view; the nearest person in the middle was taken."
        )
    if sides:
        warnings.append(
            f"The body is cut by the {' and '.join(sides)} edge of the image; the rest cannot be tracked."
        )
    return BodyMask(mask, tuple(warnings), bool(sides), others)


def _pixel_area(depth: FloatArray, camera: PinholeCamera) -> FloatArray:
    return depth * depth / (camera.fx * camera.fy)


def _in_room(points: FloatArray, depth: FloatArray, camera: PinholeCamera) -> BoolArray:
    """Measured pixels that are neither wall nor floor nor beyond them."""
    inside = depth > 0
    coarse = depth[::_STRIDE, ::_STRIDE] > 0
    sample = points[::_STRIDE, ::_STRIDE][coarse]
    areas = _pixel_area(depth[::_STRIDE, ::_STRIDE][coarse], camera) * _STRIDE**2
    rows = np.nonzero(coarse)[0] * _STRIDE
    planes = find_walls(sample, areas)
    free = np.ones(len(sample), np.bool_)
    for wall in planes:
        free &= wall.distances(sample) < -wall.tolerance(sample)
    floor = find_floor(sample[free], rows[free] > 0.5 * camera.height)
    if floor is not None:
        planes.append(floor)
    for plane in planes:
        inside &= plane.distances(points) < -plane.tolerance(points)
    return inside


def _connected_parts(points: FloatArray, depth: FloatArray, camera: PinholeCamera) -> _Parts:
    from core.surface.depth_kernels import label_components, measure_parts

    jump = np.maximum(0.04, 0.01 * depth * depth)
    labels, count = label_components(np.ascontiguousarray(depth), jump)
    pixels, measures = measure_parts(labels, points, count)
    kept = np.flatnonzero(pixels >= _SPECK_PIXELS)
    number = np.full(count + 1, -1, np.int32)  # the last entry answers for label -1
    number[kept] = np.arange(len(kept), dtype=np.int32)
    pixels, measures = pixels[kept], measures[kept]
    return _Parts(
        labels=number[labels],
        pixels=pixels,
        area=measures[:, 0] / (camera.fx * camera.fy),
        center=measures[:, 1:4] / np.maximum(pixels, 1)[:, None],
        low=measures[:, 4:7],
        high=measures[:, 7:10],
    )


def _main_part(parts: _Parts, points: FloatArray) -> int | None:
    """The large, central, near part that is not flat."""
    aside = parts.center[:, 0] / np.maximum(parts.center[:, 2], 0.1)
    score = parts.area * np.exp(-((aside / 0.4) ** 2)) / np.maximum(parts.center[:, 2], 0.3)
    for part in np.argsort(-score)[:5]:
        if parts.area[part] < _MIN_BODY_M2 or parts.pixels[part] < _MIN_BODY_PIXELS:
            continue
        if not _is_flat(points[parts.labels == part]):
            return int(part)
    return None


def _is_flat(points: FloatArray) -> bool:
    """Whether points lie in one plane, as those of a door or a piece of wall do, and a body's do not."""
    sample = points[:: max(1, len(points) // 2000)]
    center = sample.mean(0)
    normal = np.linalg.svd(sample - center, full_matrices=False)[2][2]
    off = float(np.percentile(np.abs((sample - center) @ normal), 90))
    return off < 0.012 + 0.002 * float(center[2]) ** 2


def _belonging_parts(parts: _Parts, main: int) -> BoolArray:
    """Which parts are the patient's: islands cut off by an arm held in front, limbs beyond an occlusion."""
    belongs = np.zeros(len(parts.pixels), np.bool_)
    belongs[main] = True
    if len(belongs) == 1:
        return belongs
    low, high, middle = parts.low[main], parts.high[main], parts.center[main]
    reach = _ISLAND_REACH_M
    beside = ((parts.center > low - reach) & (parts.center < high + reach))[:, :2].all(axis=1)
    # Arms reach far to the front; what lies behind the patient is someone else.
    ahead = middle[2] - parts.center[:, 2]
    depth_ok = (ahead < 0.95) & (parts.center[:, 2] < high[2] + reach) & (ahead > -0.4)
    # A limb, not a person: an island of the patient is smaller than what it was cut from.
    limb = parts.area < np.minimum(0.15, 0.4 * parts.area[main])
    belongs |= beside & depth_ok & limb
    return belongs


def _other_people(parts: _Parts, belongs: BoolArray) -> int:
    tall = parts.high[:, 1] - parts.low[:, 1] > _PERSON_HEIGHT_M
    return int((~belongs & tall & (parts.area > _PERSON_M2)).sum())


def _cut_sides(mask: BoolArray, measured: BoolArray) -> list[str]:
    """Edges of the image at which the body leaves it.

    Depth cameras leave a blind rim, so the edge is where measurements end, if that is near the image's
    border. A body that is cut ends there in a straight line; a fingertip that just reaches it does not.
    """
    sides = []
    for name, body, seen in (
        ("upper", mask, measured),
        ("lower", mask[::-1], measured[::-1]),
        ("left", mask.T, measured.T),
        ("right", mask.T[::-1], measured.T[::-1]),
    ):
        first = int(seen.any(axis=1).argmax())
        strip = body[first : first + _EDGE_PIXELS].sum(axis=1)
        at_border = int(strip[0]) >= max(_EDGE_LENGTH, 0.6 * float(strip[-1]))
        if first <= 0.06 * len(seen) and at_border:
            sides.append(name)
    return sides
