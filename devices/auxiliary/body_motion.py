"""How far a body has moved between two moments, from two depth images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from core.capture.camera import PinholeCamera

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_REDUCED_WIDTH = 160
_EDGE_M = 0.06
_BAND_M = (-0.25, 0.65)
_FEWEST_POINTS = 150
_FEWEST_OF_LIMB = 30
_LIMB_REACH_M = 0.4
_ITERATIONS = 8
_REACH_M = 0.08
_HUBER_M = 0.005
_SMOOTH = 5
_SHARE = 95.0
_PARTS_SHARE = 99.0


@dataclass(frozen=True)
class BodyMotion:
    """Movement of a body's surface between two moments.

    Attributes
    ----------
    moved_m : float
        The movement of the whole and, on top, that of its parts.
    whole_m : float
        Of the body as if it were rigid, 95th percentile over its points.
    parts_m : float
        Across the surface and beyond the rigid movement (an arm, the chest), 99th percentile.
    """

    moved_m: float
    whole_m: float
    parts_m: float


def reduced_depth(frame: NDArray[np.uint16], unit_m: float) -> NDArray[np.float32]:
    """Depth in metres in blocks, about 160 across; NaN where most is missing or an edge runs through."""
    k = _block(frame.shape[1])
    h, w = (side // k * k for side in frame.shape)
    blocks = frame[:h, :w].reshape(h // k, k, w // k, k).swapaxes(1, 2)
    cells = blocks.reshape(h // k, w // k, k * k).astype(np.float32)
    count = (cells > 0).sum(axis=2)
    highest = cells.max(axis=2)
    lowest = np.where(cells > 0, cells, np.float32(65535)).min(axis=2)
    mean = cells.sum(axis=2) / np.maximum(count, 1)
    good = (2 * count > k * k) & ((highest - lowest) * unit_m < 2 * _EDGE_M)
    return np.where(good, mean * np.float32(unit_m), np.float32(np.nan)).astype(np.float32)


def reduced_camera(camera: PinholeCamera) -> PinholeCamera:
    """Camera of `reduced_depth`; the lens's distortion is left out, it does not matter for a difference."""
    k = _block(camera.width)
    return PinholeCamera(
        camera.width // k,
        camera.height // k,
        camera.fx / k,
        camera.fy / k,
        (camera.cx + 0.5) / k - 0.5,
        (camera.cy + 0.5) / k - 0.5,
    )


def _block(width: int) -> int:
    """Side of a block: the same share of the image whatever the resolution."""
    return max(1, round(width / _REDUCED_WIDTH))


def body_motion(
    before: NDArray[np.float32], after: NDArray[np.float32], camera: PinholeCamera
) -> BodyMotion | None:
    """Movement between two reduced depth images.

    The rigid part by projective point-to-plane alignment (Newcombe et al., KinectFusion, ISMAR 2011,
    section 3.5), the parts from what is left along the normals.

    Parameters
    ----------
    before, after : ndarray (h, w)
        `reduced_depth`, or means of several; NaN where there is none.
    camera : PinholeCamera
        `reduced_camera`.

    Returns
    -------
    BodyMotion or None
        None if there is no body to be seen in both.
    """
    trunk, limbs = _body(before)
    if trunk.sum() < _FEWEST_POINTS:
        return None
    body = trunk | limbs
    rays = camera.pixel_rays
    start: FloatArray = (rays * before[..., None].astype(float))[body]
    of_trunk = trunk[body]
    target: FloatArray = rays * after[..., None].astype(float)
    normals = _normals(target)
    rotation, shift = np.eye(3), np.zeros(3)
    for _ in range(_ITERATIONS):
        moved = start @ rotation.T + shift
        used, residual, normal = _matches(moved, target, normals, camera)
        used &= of_trunk
        if used.sum() < _FEWEST_POINTS:
            return None
        p, r, n = moved[used], residual[used], normal[used]
        weight = np.minimum(1.0, _HUBER_M / np.maximum(np.abs(r), 1e-9))
        center = p.mean(axis=0)
        rows = np.concatenate([np.cross(p - center, n), n], axis=1)
        a = rows.T @ (rows * weight[:, None]) + 1e-3 * np.eye(6)
        step = np.linalg.solve(a, rows.T @ (weight * r))
        turn = _turn(step[:3])
        rotation, shift = turn @ rotation, turn @ (shift - center) + center + step[3:]
    moved = start @ rotation.T + shift
    used, residual, _ = _matches(moved, target, normals, camera)
    whole = float(np.percentile(np.linalg.norm(moved - start, axis=1)[of_trunk], _SHARE))
    parts = _parts(body, used, residual)
    return BodyMotion(float(np.hypot(whole, parts)), whole, parts)


def motion_within(frames: NDArray[np.uint16], unit_m: float, camera: PinholeCamera) -> BodyMotion | None:
    """Movement from the first to the last third of a burst (n, h, w); None if it cannot be told."""
    third = len(frames) // 3
    if third < 1:
        return None
    before, after = (
        np.stack([reduced_depth(frame, unit_m) for frame in part])
        for part in (frames[:third], frames[-third:])
    )
    # A block must have been measured every time: a mean over changing pixels is no mean of one place.
    return body_motion(before.mean(axis=0), after.mean(axis=0), reduced_camera(camera))


def _body(depth: NDArray[np.float32]) -> tuple[BoolArray, BoolArray]:
    """The largest connected surface in front, about the middle of the image; and limbs set off by an edge.

    What touches the left or right border of the image is furniture or a wall, not a limb.
    """
    nothing = np.zeros(depth.shape, bool)
    h, w = depth.shape
    middle = depth[h // 6 : -h // 6, w // 3 : -w // 3]
    seen = middle[np.isfinite(middle)]
    if seen.size < _FEWEST_POINTS // 2:
        return nothing, nothing
    near = float(np.percentile(seen, 15))
    with np.errstate(invalid="ignore"):
        band = (depth > near + _BAND_M[0]) & (depth < near + _BAND_M[1])
    filled = np.where(band, depth, 0.0)
    steps = np.maximum(
        np.abs(np.diff(filled, axis=0, append=filled[-1:])),
        np.abs(np.diff(filled, axis=1, append=filled[:, -1:])),
    )
    labels, count = ndimage.label(band & (steps < _EDGE_M))
    if count == 0:
        return nothing, nothing
    inside = np.zeros(depth.shape, bool)
    inside[:, w // 4 : -w // 4] = True
    sizes = np.bincount(labels[inside], minlength=count + 1)
    sizes[0] = 0
    main = int(sizes.argmax())
    trunk = labels == main
    foreign = {main, 0, *np.unique(labels[:, :2]), *np.unique(labels[:, -2:])}
    everywhere = np.bincount(labels.ravel(), minlength=count + 1)
    limbs = [k for k in np.flatnonzero(everywhere >= _FEWEST_OF_LIMB) if k not in foreign]
    apart = float(np.median(depth[trunk]))
    limbs = [k for k in limbs if abs(float(np.median(depth[labels == k])) - apart) < _LIMB_REACH_M]
    return np.asarray(trunk), np.isin(labels, limbs)


def _normals(points: FloatArray) -> FloatArray:
    """Normals of a point image, NaN at edges and holes."""
    du, dv = np.full_like(points, np.nan), np.full_like(points, np.nan)
    du[:, 1:-1] = points[:, 2:] - points[:, :-2]
    dv[1:-1] = points[2:] - points[:-2]
    normal = np.cross(dv, du)
    edge = (np.abs(du[..., 2]) > 2 * _EDGE_M) | (np.abs(dv[..., 2]) > 2 * _EDGE_M)
    normal[edge] = np.nan
    with np.errstate(invalid="ignore"):
        return np.asarray(normal / np.linalg.norm(normal, axis=2, keepdims=True))


def _matches(
    moved: FloatArray, target: FloatArray, normals: FloatArray, camera: PinholeCamera
) -> tuple[BoolArray, FloatArray, FloatArray]:
    """Which points have a partner behind their pixel, their distance to its plane, and its normal."""
    pixels = np.rint(camera.project(moved))
    inside = camera.contains(pixels)
    u, v = np.where(inside[:, None], pixels, 0).astype(int).T
    partner, normal = target[v, u], normals[v, u]
    with np.errstate(invalid="ignore"):
        apart = np.linalg.norm(partner - moved, axis=1)
        used = inside & (apart < _REACH_M) & np.isfinite(normal).all(axis=1)
    residual = np.where(used, np.einsum("ij,ij->i", normal, partner - moved), 0.0)
    return used, residual, np.where(used[:, None], normal, 0.0)


def _turn(vector: FloatArray) -> FloatArray:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def _parts(body: BoolArray, used: BoolArray, residual: FloatArray) -> float:
    """99th percentile of the residuals, for a forearm is 2 % of a body.

    Each is averaged with its neighbours, so that noise does not count.
    """
    value, weight = np.zeros(body.shape), np.zeros(body.shape)
    value[body], weight[body] = residual * used, used
    total = ndimage.uniform_filter(weight, _SMOOTH)
    mean = ndimage.uniform_filter(value, _SMOOTH) / np.maximum(total, 1e-9)
    # Points that found no partner (an arm that has gone) count as far as one could look; edges have few.
    mean[total < 0.2] = 0.0
    gone = body & (ndimage.uniform_filter(body.astype(float), _SMOOTH) > 0.99) & (total < 0.05)
    mean[gone] = _REACH_M
    return float(np.percentile(np.abs(mean[body]), _PARTS_SHARE))
