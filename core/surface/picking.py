"""A click on the picture becomes a place on the skin, or a reason why not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.capture.rgbd import CameraRig
from core.surface.points import SurfacePoint
from core.surface.scan import BodyScan
from core.surface.skin_judgement import judge_skin

FloatArray = NDArray[np.float64]

# A ray that passes the rim of the measured skin this closely meant the skin: depth cameras lose the last
# pixels.
_LIFT_M = 0.012
# A nearer rim this close wins over what the ray hits farther behind it.
_RIM_M = 0.004
_FARTHER_M = 0.03

NOT_ON_BODY = "The click is not on the body."
NOT_MEASURED = "The depth camera does not see this place; move so that both cameras see it."
OUTSIDE_PICTURE = "The click is outside the picture."
ON_HAIR = "The lesion lies on hair; the skin there cannot be seen or measured."
ON_CLOTHING = "The lesion may lie on clothing; uncover the skin."
NEAR_EDGE = "The click is at the edge of a body part; its depth is less certain."


@dataclass(frozen=True, eq=False)
class SkinPick:
    """What was clicked.

    Attributes
    ----------
    point : SurfacePoint or None
        None if the click is refused. Beyond the rim of the measured surface `SurfacePoint.position_m` lies on
        the tangent plane under the click, up to 12 mm from the triangle that carries it.
    normal : ndarray (3,) or None
        Unit, toward the camera.
    reason : str or None
        Why the click is refused.
    warnings : tuple of str
    """

    point: SurfacePoint | None
    normal: FloatArray | None
    reason: str | None
    warnings: tuple[str, ...] = ()


def pick_skin(scan: BodyScan, pixel: ArrayLike, *, head_m: ArrayLike | None = None) -> SkinPick:
    """The skin under a picture pixel (u, v).

    The ray through the pixel is traced to the surface; a single depth pixel is never read, because beside a
    silhouette it may belong to the wall.

    Parameters
    ----------
    head_m : array_like (3,), optional
        Centre of the head in the depth-camera frame, where hair is looked for; guessed from the outline
        without it.
    """
    return _pick(scan, scan.capture.rig, np.asarray(pixel, dtype=float).reshape(2), head_m)


def pick_skin_depth(scan: BodyScan, depth_pixel: ArrayLike, *, head_m: ArrayLike | None = None) -> SkinPick:
    """The skin under a pixel (u, v) of the depth image."""
    rig = CameraRig(scan.capture.rig.depth)
    return _pick(scan, rig, np.asarray(depth_pixel, dtype=float).reshape(2), head_m)


def _pick(scan: BodyScan, rig: CameraRig, pixel: FloatArray, head_m: ArrayLike | None) -> SkinPick:
    if not np.isfinite(pixel).all() or not rig.picture_camera.contains(pixel)[0]:
        return SkinPick(None, None, OUTSIDE_PICTURE)
    origin, directions = rig.picture_rays(pixel)
    direction = directions[0]
    hits = scan.surface.raycast(origin, direction)
    through = float(hits.t[0]) if hits.hit[0] else np.inf
    point, warnings = _rim_point(scan, origin, direction, through)
    if point is None:
        if not hits.hit[0]:
            return SkinPick(None, None, _miss(scan, origin, direction))
        point = scan.surface.point(int(hits.triangle[0]), hits.barycentric[0])
    verdict = judge_skin(scan, point.position_m, None if head_m is None else np.asarray(head_m, dtype=float))
    if verdict == "hair":
        return SkinPick(None, None, ON_HAIR)
    if verdict == "clothing":
        warnings = (*warnings, ON_CLOTHING)
    return SkinPick(point, scan.surface.normal_at(point), None, warnings)


def _miss(scan: BodyScan, origin: FloatArray, direction: FloatArray) -> str:
    """Why a ray misses: at the body's distance it is outside the depth image, or it passes the body."""
    surface = scan.surface
    middle = float(np.median(surface.vertices[:, 2]))
    place = origin + (middle - origin[2]) / direction[2] * direction if direction[2] > 1e-6 else origin
    pixel = surface.camera.project(place)
    return NOT_ON_BODY if surface.camera.contains(pixel)[0] else NOT_MEASURED


def _rim_point(
    scan: BodyScan, origin: FloatArray, direction: FloatArray, through: float
) -> tuple[SurfacePoint | None, tuple[str, ...]]:
    """The skin just beside the ray, when the ray misses the surface or passes close before a farther part.

    The place is where the ray meets the tangent plane of the nearest rim vertex. Seen flat, that plane is
    useless, and the point of the ray nearest to the vertex is taken.
    """
    surface = scan.surface
    rim = np.flatnonzero(surface.boundary)
    if len(rim) == 0:
        return None, ()
    unit = direction / np.linalg.norm(direction)
    from_origin = surface.vertices[rim] - origin
    along = from_origin @ unit
    off = np.linalg.norm(from_origin - along[:, None] * unit, axis=1)
    limit = _LIFT_M if not np.isfinite(through) else _RIM_M
    near = (off < limit) & (along > 0) & (along < through * np.linalg.norm(direction) - _FARTHER_M)
    if not near.any():
        close = (off < _LIFT_M) & (along > 0) & (along < through * np.linalg.norm(direction) - _FARTHER_M)
        return None, (NEAR_EDGE,) if close.any() else ()
    best = int(np.flatnonzero(near)[np.argmin(off[near])])
    vertex, normal = surface.vertices[rim[best]], surface.normals[rim[best]]
    position = origin + along[best] * unit
    flat = float(normal @ unit)
    if abs(flat) > 0.15:
        lifted = origin + float(normal @ from_origin[best]) / flat * unit
        if np.linalg.norm(lifted - vertex) < 2.0 * _LIFT_M:
            position = lifted
    anchor = surface.nearest(vertex)[0]
    nearest = surface.nearest(position)[0]
    if np.linalg.norm(nearest.position_m - vertex) < 2.0 * _LIFT_M:
        anchor = nearest
    return SurfacePoint(anchor.triangle, anchor.barycentric, position), (NEAR_EDGE,)
