"""Hair on trunk and limbs: thin dark strands that lie on the skin."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from devices.simulator.body import BodyModel, vertex_normals
from devices.simulator.skin import Skin

FloatArray = NDArray[np.float64]

_DENSEST_PER_M2 = 22_000.0
_WIDTH_M = 2.6e-4
"""Of what a camera at this distance sees as one hair: two or three that lie together."""
_SUBPIXEL_BITS = 4


@dataclass(frozen=True, eq=False)
class Strands:
    """Hairs, k of them.

    Attributes
    ----------
    triangle, barycentric : ndarray (k,) int32, (k, 3)
        Where they grow.
    path : ndarray (k, 2, 2)
        Middle and tip of each strand against its root, in metres along the triangle's first edge and
        across it.
    """

    triangle: NDArray[np.int32]
    barycentric: FloatArray
    path: FloatArray


def grow_hair(model: BodyModel, skin: Skin, amount: float, rng: np.random.Generator) -> Strands | None:
    """Hair of a person, ``amount`` 0 (None) to 1: chest, belly, forearms and legs most, clothes hide it."""
    if amount <= 0.0:
        return None
    t = model.reference[model.triangles]
    area = 0.5 * np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
    thick = 0.25 + 1.0 * model.bone_weight("lowerarm", "lowerleg", "upperleg")
    front = np.clip(-vertex_normals(model.reference, model.triangles)[:, 1], 0.0, 1.0)
    thick += 1.2 * front * model.bone_weight("spine01", "spine02", "spine03", "breast", "spine04")
    seen = np.zeros(len(t))
    seen[model.outer] = 1.0
    seen[~model.parts["body"]] = 0.0
    bare = (skin.cloth[model.triangles].max(axis=1) < 0) & (skin.hair[model.triangles].max(axis=1) < 0)
    weight = area * np.clip(thick, 0.0, 1.0)[model.triangles].mean(axis=1) * seen * bare
    count = int(amount * _DENSEST_PER_M2 * weight.sum())
    if count == 0:
        return None
    triangle = rng.choice(len(weight), count, p=weight / weight.sum()).astype(np.int32)
    barycentric = rng.dirichlet((1.0, 1.0, 1.0), count)
    length = rng.uniform(0.008, 0.028, count) * model.stature_m / 1.75
    # hair falls: down the skin in the reference posture, a little askew, and bends on its way
    first, across = _axes(t[triangle])
    down = np.array([0.0, 0.0, -1.0])
    angle = np.arctan2(across @ down, first @ down) + rng.normal(0.0, 0.45, count)
    bend = rng.normal(0.0, 0.5, count)
    half = 0.5 * length[:, None]
    middle = half * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tip = middle + half * np.stack([np.cos(angle + bend), np.sin(angle + bend)], axis=1)
    return Strands(triangle, barycentric, np.stack([middle, tip], axis=1))


def _axes(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (k, 3) along the first edge of triangles (k, 3, 3) and across it in their planes."""
    first = corners[:, 1] - corners[:, 0]
    first = first / np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    across = corners[:, 2] - corners[:, 0]
    across = across - first * (across * first).sum(axis=1, keepdims=True)
    return first, across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)


def hair_cover(
    strands: Strands,
    model: BodyModel,
    vertices: FloatArray,
    camera: PinholeCamera,
    color_from_depth: RigidTransform,
) -> NDArray[np.float32]:
    """How much of every pixel (h, w) hair covers, 0..1, on the side of the body that faces the camera.

    Hair on a limb that another limb hides is drawn as well: its few strands fall on skin in front.
    """
    corners = vertices[model.triangles[strands.triangle]]
    first, across = _axes(corners)
    root = np.einsum("kc,kcx->kx", strands.barycentric, corners)
    eye = color_from_depth.inverse().translation
    normal = np.cross(first, across)
    facing = (normal * (eye - root)).sum(axis=1) > 0.15 * np.linalg.norm(eye - root, axis=1)
    root, first, across, path = root[facing], first[facing], across[facing], strands.path[facing]
    points = np.stack(
        [root] + [root + path[:, k, :1] * first + path[:, k, 1:] * across for k in range(2)],
        axis=1,
    )
    in_camera = color_from_depth.apply(points.reshape(-1, 3))
    pixels = camera.project(in_camera).reshape(-1, 3, 2)
    mask = np.zeros((camera.height, camera.width), np.uint8)
    drawn = np.isfinite(pixels).all(axis=(1, 2)) & (np.abs(pixels) < 2 * camera.width).all(axis=(1, 2))
    lines = np.rint(pixels[drawn] * (1 << _SUBPIXEL_BITS)).astype(np.int32)
    # a line one pixel wide stands for a strand that is thinner: it covers its share of the pixel
    width_px = _WIDTH_M * camera.fx / float(np.median(in_camera[:, 2]))
    cv2.polylines(mask, list(lines), False, 255, 1, cv2.LINE_AA, _SUBPIXEL_BITS)
    return np.asarray(mask, np.float32) * np.float32(min(width_px, 1.0) / 255.0)
