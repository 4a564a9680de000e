"""What a simulated patient looks like: complexion, clothes, hair and face, at the vertices of the body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

from devices.simulator.body import BodyModel

FloatArray = NDArray[np.float64]

Wardrobe = Literal["none", "briefs", "shorts", "shorts_top", "street"]
"""What is worn. "shorts_top" adds a sports top; "street" covers all but head and hands."""

TONES: tuple[tuple[float, float, float], ...] = (
    (0.93, 0.80, 0.72),
    (0.90, 0.74, 0.63),
    (0.84, 0.66, 0.53),
    (0.70, 0.51, 0.39),
    (0.47, 0.33, 0.25),
)
"""Skin tones, light to dark, sRGB 0..1."""

_HAIR = ((0.16, 0.11, 0.08), (0.30, 0.20, 0.12), (0.10, 0.09, 0.09), (0.52, 0.50, 0.49))
_CLOTH = ((0.18, 0.22, 0.35), (0.25, 0.26, 0.28), (0.13, 0.30, 0.30), (0.35, 0.16, 0.20))
_ARM_BONES = ("upperarm", "lowerarm", "wrist", "finger", "metacarpal")


def linear(srgb: object) -> FloatArray:
    """Linear reflectance of an sRGB colour 0..1."""
    return np.asarray(srgb, float) ** 2.2


@dataclass(frozen=True, eq=False)
class Skin:
    """Appearance at the vertices (n,) of a body; what lies between is interpolated.

    Attributes
    ----------
    albedo : ndarray (n, 3)
        Linear reflectance of bare skin with its mottling.
    cloth, hair : ndarray (n,)
        Metres inside (positive) or outside (negative) the edge of clothes and of the hairy scalp.
    cloth_albedo : ndarray (n, 3)
    hair_albedo : ndarray (3,)
    """

    albedo: FloatArray
    cloth: FloatArray
    hair: FloatArray
    cloth_albedo: FloatArray
    hair_albedo: FloatArray

    def layer_thickness(self, rng: np.random.Generator, model: BodyModel) -> FloatArray:
        """Thickness (n,) in metres of cloth and hair over the skin; folds and tufts differ each time."""
        folds = _smooth(model, rng.standard_normal(len(self.cloth)), 12)
        folds = folds / folds.std()
        cloth = np.clip(self.cloth / 0.02, 0.0, 1.0) * np.clip(0.005 + 0.003 * folds, 0.001, 0.015)
        tufts = _smooth(model, rng.standard_normal(len(self.hair)), 2)
        hair = np.clip(self.hair / 0.03, 0.0, 1.0) * np.clip(0.012 + 0.004 * tufts / tufts.std(), 0.002, 0.03)
        return np.asarray(np.maximum(cloth, hair))


def _smooth(model: BodyModel, values: FloatArray, rounds: int) -> FloatArray:
    """Average over mesh neighbours, repeatedly."""
    t = model.triangles
    rows = np.concatenate([t[:, 0], t[:, 1], t[:, 2]])
    columns = np.concatenate([t[:, 1], t[:, 2], t[:, 0]])
    n = len(model.reference)
    links = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n)).tocsr()
    links = links + links.T
    degree = np.asarray(links.sum(axis=1)).ravel()
    for _ in range(rounds):
        values = 0.4 * values + 0.6 * (links @ values) / np.maximum(degree, 1.0)
    return values


def _waves(p: FloatArray, rng: np.random.Generator, per_metre: float) -> FloatArray:
    direction = rng.normal(size=(14, 3)) * per_metre
    return np.asarray(np.sin(p @ direction.T + rng.uniform(0, 2 * np.pi, 14)).mean(axis=1) * np.sqrt(14))


def make_skin(
    model: BodyModel, rng: np.random.Generator, wardrobe: Wardrobe, tone: int | None = None
) -> Skin:
    """Skin of a new person. ``tone`` is a row of `TONES`; None draws one of the lighter four."""
    p = model.reference
    scale = model.stature_m / 1.75
    base = linear(TONES[int(rng.integers(0, 4)) if tone is None else tone])
    pick = rng.integers(0, 4, 2)
    mottling = 0.05 * _waves(p, rng, 16.0) + 0.025 * _smooth(model, rng.standard_normal(len(p)), 1)
    redness = 0.03 * _waves(p, rng, 9.0)
    warm = 0.06 * model.bone_weight("wrist", "finger", "foot", "toe", "head", "lowerarm02")
    tint = np.stack([redness + warm, -0.5 * redness - warm, -0.7 * redness - warm], axis=1)
    albedo = base * (1.0 + mottling[:, None] + tint)
    _paint_face(model, albedo)
    cloth, cloth_albedo = _clothes(model, wardrobe, linear(_CLOTH[pick[0]]), scale)
    hair = _scalp(model)
    return Skin(np.clip(albedo, 0.01, 0.95), cloth, hair, cloth_albedo, linear(_HAIR[pick[1]]))


def _clothes(
    model: BodyModel, wardrobe: Wardrobe, color: FloatArray, scale: float
) -> tuple[FloatArray, FloatArray]:
    p = model.reference
    x, z = np.abs(p[:, 0]), p[:, 2]
    arm = model.bone_weight(*_ARM_BONES)
    hip, knee, neck = (model.bone_point(b)[2] for b in ("upperleg01.L", "lowerleg01.L", "neck01"))
    colors = np.tile(color, (len(p), 1))
    if wardrobe == "none":
        return np.full(len(p), -1.0), colors
    if wardrobe == "street":
        skin_left = model.bone_weight("head", "neck02", "neck03", "wrist", "finger", "metacarpal", "eye")
        colors[z > hip + 0.08 * scale] = linear((0.82, 0.85, 0.88))
        return np.where(skin_left > 0.5, -0.05, 0.05), colors
    waist = hip + 0.09 * scale
    if wardrobe == "briefs":
        hem = hip - 0.10 * scale + 0.9 * np.maximum(x - 0.05 * scale, 0.0)
    else:
        hem = np.full(len(p), hip - 0.42 * (hip - knee))
    lower = np.minimum(waist - z, z - hem)
    inside = lower
    inside -= 0.4 * np.clip(arm - 0.15, 0.0, 1.0)
    if wardrobe == "shorts_top":
        low, high = hip + 0.50 * (neck - hip), hip + 0.72 * (neck - hip)
        band = np.minimum(z - low, high - z) - 0.4 * np.clip(arm - 0.35, 0.0, 1.0)
        strap = np.minimum(0.016 * scale - np.abs(x - 0.075 * scale), z - low)
        on_head = model.bone_weight("head", "neck02", "neck03") > 0.3
        inside = np.maximum(inside, np.where(on_head, -0.05, np.maximum(band, strap)))
    return np.asarray(inside), colors


def _scalp(model: BodyModel) -> FloatArray:
    p = model.reference
    head = p[np.unique(model.triangles[model.parts["head"]])]
    top, tall = head[:, 2].max(), np.ptp(head[:, 2])
    y = p[:, 1] - model.bone_point("head")[1]
    line = top - 0.30 * tall - np.where(y > 0, 1.2, 0.5) * y
    inside = np.minimum(p[:, 2] - line, p[:, 2] - (top - 0.78 * tall))
    on_head = model.bone_weight("head", "neck02", "neck03")
    return np.asarray(np.where(on_head > 0.4, inside, -0.05))


def _paint_face(model: BodyModel, albedo: FloatArray) -> None:
    """Eyebrows and lips, in place."""
    p = model.reference
    eye = model.bone_point("eye.L")
    head = np.unique(model.triangles[model.parts["head"]])
    tall = float(np.ptp(p[head, 2])) / 0.268
    front = np.clip((eye[1] + 0.01 * tall - p[:, 1]) / (0.01 * tall), 0.0, 1.0)
    x = np.abs(p[:, 0])
    brow_z = eye[2] + 0.021 * tall - 0.004 * tall * ((x - eye[0]) / (0.02 * tall)) ** 2
    brow = np.clip(1.3 - np.abs(p[:, 2] - brow_z) / (0.005 * tall), 0, 1) * (
        np.abs(x - eye[0]) < 0.023 * tall
    )
    mouth = p[np.unique(model.triangles[model.parts["mouth_cavity"]])]
    centre = mouth[mouth[:, 1].argmin()]
    lips = np.clip(
        1.4 - np.hypot(p[:, 0] / (0.026 * tall), (p[:, 2] - centre[2]) / (0.010 * tall)),
        0,
        1,
    ) * (p[:, 1] < centre[1] + 0.012 * tall)
    for weight, color in (
        (0.75 * brow * front, linear((0.25, 0.17, 0.12))),
        (0.8 * lips, linear((0.72, 0.42, 0.40))),
    ):
        albedo += np.clip(weight, 0, 1)[:, None] * (color - albedo)
    for name in ("eye_front.L", "eye_front.R"):
        albedo[np.unique(model.triangles[model.parts[name]])] = linear((0.88, 0.87, 0.85))
