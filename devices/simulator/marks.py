"""Moles, freckles and other spots: where they sit on the skin and how they look."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from devices.simulator.body import BodyModel
from devices.simulator.skin import Skin, linear

FloatArray = NDArray[np.float64]

_BROWNS = ((0.30, 0.17, 0.11), (0.42, 0.25, 0.17), (0.55, 0.34, 0.24), (0.22, 0.13, 0.10), (0.62, 0.38, 0.33))
_SITES = {"body": 1.0, "head": 0.35, "hand.L": 0.2, "hand.R": 0.2, "foot.L": 0.15, "foot.R": 0.15}
"""How often moles sit on a part, by area, against the trunk and limbs."""


@dataclass(frozen=True, eq=False)
class Marks:
    """Spots painted onto the skin, k of them, in the coordinates of the reference posture.

    Attributes
    ----------
    triangle, barycentric : ndarray (k,) int32, (k, 3)
        The place on the skin: the same in every posture, visit and view.
    position : ndarray (k, 3)
    tangents : ndarray (k, 2, 3)
        Axes in the skin's plane, in which the outline is drawn.
    radius_m : ndarray (k,)
    outline : ndarray (k, 3, 2)
        Cosine and sine amplitudes of the outline's second, third and fifth harmonic, shares of the radius.
    color, core : ndarray (k, 3)
        Linear reflectance at the rim and in the (off-centre) middle.
    opacity, softness : ndarray (k,)
        Peak cover 0..1; width of the rim as a share of the radius.
    """

    triangle: NDArray[np.int32]
    barycentric: FloatArray
    position: FloatArray
    tangents: FloatArray
    radius_m: FloatArray
    outline: FloatArray
    color: FloatArray
    core: FloatArray
    opacity: FloatArray
    softness: FloatArray

    def __len__(self) -> int:
        return len(self.triangle)

    def take(self, rows: NDArray[np.int64]) -> Marks:
        """Only these rows, in this order."""
        return Marks(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def joined(self, other: Marks) -> Marks:
        """These marks, then the others."""
        return Marks(
            *(np.concatenate([getattr(self, n), getattr(other, n)]) for n in self.__dataclass_fields__)
        )

    def enlarged(self, factors: FloatArray) -> Marks:
        """With radii (k,) multiplied."""
        values = {name: getattr(self, name) for name in self.__dataclass_fields__}
        values["radius_m"] = self.radius_m * factors
        return Marks(**values)

    def cover(self, row: int, canonical: NDArray[np.float32]) -> tuple[FloatArray, FloatArray]:
        """How strongly one mark covers skin places (p, 3), 0..1, and its colour there (p, 3)."""
        d = canonical - self.position[row]
        a, b = d @ self.tangents[row, 0], d @ self.tangents[row, 1]
        height = np.abs(d @ np.cross(self.tangents[row, 0], self.tangents[row, 1]))
        r = np.hypot(a, b)
        angle = np.arctan2(b, a)
        edge = np.ones_like(r)
        for order, (c, s) in zip((2, 3, 5), self.outline[row], strict=True):
            edge += c * np.cos(order * angle) + s * np.sin(order * angle)
        rho = r / (self.radius_m[row] * edge)
        soft = self.softness[row]
        t = np.clip((1.0 + soft / 2 - rho) / soft, 0.0, 1.0)
        alpha = self.opacity[row] * t * t * (3 - 2 * t) * (height < 3.0 * self.radius_m[row])
        shift = 0.25 * self.radius_m[row]
        middle = np.exp(-((a - shift) ** 2 + b**2) / (0.5 * self.radius_m[row]) ** 2)[:, None]
        return alpha, self.color[row] + middle * (self.core[row] - self.color[row])


@dataclass(frozen=True, eq=False)
class Moles:
    """The moles of one patient at one visit.

    Attributes
    ----------
    ids : tuple of str
        "L01"... for lesions of interest, "M001"... for other moles, "N01"... for moles that came later.
    marks : Marks
    healed : frozenset of str
        Those whose pigment is gone.
    faint : frozenset of str
        Those that hardly stand out at this visit.
    """

    ids: tuple[str, ...]
    marks: Marks
    healed: frozenset[str] = frozenset()
    faint: frozenset[str] = frozenset()

    @property
    def lesion_ids(self) -> tuple[str, ...]:
        """Ids of the lesions of interest."""
        return tuple(name for name in self.ids if name.startswith("L"))

    def without(self, ids: Collection[str]) -> Moles:
        """The other moles."""
        rows = np.array([k for k, name in enumerate(self.ids) if name not in ids], np.int64)
        return replace(self, ids=tuple(self.ids[k] for k in rows), marks=self.marks.take(rows))

    def grown(self, growth: Mapping[str, float]) -> Moles:
        """With the radius of some moles multiplied."""
        factors = np.array([growth.get(name, 1.0) for name in self.ids])
        return replace(self, marks=self.marks.enlarged(factors))

    def joined(self, other: Moles) -> Moles:
        """These moles, then the others."""
        return replace(self, ids=self.ids + other.ids, marks=self.marks.joined(other.marks))

    def scarred(self, ids: Collection[str], model: BodyModel, skin: Skin) -> Moles:
        """With the pigment of some moles gone and a pale, soft patch in its place."""
        rows = [k for k, name in enumerate(self.ids) if name in ids]
        marks, faces = self.marks, model.triangles[self.marks.triangle[rows]]
        pale = np.minimum(skin.albedo[faces].mean(axis=1) * np.array([1.10, 1.14, 1.16]), 0.95)
        color, core = marks.color.copy(), marks.core.copy()
        opacity, softness = marks.opacity.copy(), marks.softness.copy()
        color[rows], core[rows], opacity[rows], softness[rows] = pale, pale, 0.6, 1.0
        marks = replace(marks, color=color, core=core, opacity=opacity, softness=softness)
        return replace(self, marks=marks, healed=self.healed | frozenset(ids))

    def faded(self, rng: np.random.Generator, faint_share: float, tan: float) -> Moles:
        """As they look at one visit: all a little fainter, and a share of them hardly seen."""
        count = len(self.ids)
        keep = np.full(count, 1.0 - tan * rng.uniform())
        faint = rng.uniform(size=count) < faint_share
        keep[faint] *= rng.uniform(0.08, 0.30, count)[faint]
        scar = np.array([name in self.healed for name in self.ids])
        keep[scar] = 1.0
        ids = frozenset(name for name, hidden in zip(self.ids, faint & ~scar, strict=True) if hidden)
        return replace(self, marks=replace(self.marks, opacity=self.marks.opacity * keep), faint=ids)


def _skin_weight(model: BodyModel, skin: Skin) -> FloatArray:
    """Relative probability (m,) of a mole on each triangle: its area where there is bare or covered skin."""
    t = model.reference[model.triangles]
    area = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
    share = np.zeros(len(area))
    for part, density in _SITES.items():
        share[model.parts[part]] = density
    visible = np.zeros(len(area))
    visible[model.outer] = 1.0
    for part in ("eye_front.L", "eye_front.R"):
        visible[model.parts[part]] = 0.0
    bare = skin.hair[model.triangles].max(axis=1) < 0
    return np.asarray(area * share * visible * bare)


def _scatter(
    model: BodyModel, weight: FloatArray, count: int, rng: np.random.Generator
) -> tuple[NDArray[np.int32], FloatArray]:
    triangle = rng.choice(len(weight), count, p=weight / weight.sum()).astype(np.int32)
    return triangle, rng.dirichlet((1.0, 1.0, 1.0), count)


def _marks(
    model: BodyModel,
    place: tuple[NDArray[np.int32], FloatArray],
    radius: FloatArray,
    rng: np.random.Generator,
    *,
    irregular: float,
    colors: tuple[FloatArray, FloatArray],
    opacity: FloatArray,
    softness: FloatArray,
) -> Marks:
    triangle, barycentric = place
    corners = model.reference[model.triangles[triangle]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    first = np.cross(normal, rng.normal(size=normal.shape))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    outline = rng.normal(0, 1, (len(triangle), 3, 2)) * np.array([1.0, 0.7, 0.4])[:, None] * irregular
    return Marks(
        triangle,
        barycentric,
        np.einsum("kc,kcx->kx", barycentric, corners),
        np.stack([first, second], axis=1),
        radius,
        outline,
        *colors,
        opacity,
        softness,
    )


def scatter_moles(
    model: BodyModel, skin: Skin, count: int, rng: np.random.Generator, *, median_m: float = 0.0030
) -> Marks:
    """Random moles: radius log-normal, mostly 2 to 5 mm, slightly irregular outlines and browns."""
    place = _scatter(model, _skin_weight(model, skin), count, rng)
    local = skin.albedo[model.triangles[place[0], 0]]
    brown = linear(_BROWNS)[rng.integers(0, len(_BROWNS), count)] * rng.uniform(0.8, 1.2, (count, 1))
    rim = np.minimum(brown, 0.75 * local)
    return _marks(
        model,
        place,
        np.clip(rng.lognormal(np.log(median_m), 0.30, count), 0.0012, 0.008),
        rng,
        irregular=0.07,
        colors=(rim, rim * rng.uniform(0.45, 0.95, (count, 1))),
        opacity=rng.uniform(0.65, 0.97, count),
        softness=rng.uniform(0.3, 0.7, count),
    )


def scatter_freckles(model: BodyModel, skin: Skin, count: int, rng: np.random.Generator) -> Marks:
    """Small faint spots, most of them on shoulders, chest, forearms and face: texture, not moles."""
    sunny = 0.15 + model.bone_weight("clavicle", "shoulder", "upperarm", "lowerarm", "head", "spine01")
    weight = _skin_weight(model, skin) * sunny[model.triangles].mean(axis=1) ** 2
    place = _scatter(model, weight, count, rng)
    local = skin.albedo[model.triangles[place[0], 0]]
    color = local * np.array([0.72, 0.60, 0.52])
    return _marks(
        model,
        place,
        np.clip(rng.lognormal(np.log(0.0011), 0.35, count), 0.0005, 0.0025),
        rng,
        irregular=0.12,
        colors=(color, color),
        opacity=rng.uniform(0.25, 0.75, count),
        softness=rng.uniform(0.6, 1.2, count),
    )


def areolae(model: BodyModel, skin: Skin, rng: np.random.Generator) -> Marks:
    """The two areolae."""
    p = model.reference
    hip, neck = model.bone_point("upperleg01.L")[2], model.bone_point("neck01")[2]
    scale = model.stature_m / 1.75
    centre = p[model.triangles].mean(axis=1)
    rows = []
    for side in (1.0, -1.0):
        away = np.hypot(centre[:, 0] - side * 0.105 * scale, centre[:, 2] - (hip + 0.64 * (neck - hip)))
        away[centre[:, 1] > model.bone_point("spine01")[1] - 0.05] = np.inf
        rows.append(int(away.argmin()))
    triangle = np.array(rows, np.int32)
    color = skin.albedo[model.triangles[triangle, 0]] * np.array([0.72, 0.50, 0.46])
    return _marks(
        model,
        (triangle, np.full((2, 3), 1 / 3)),
        np.full(2, 0.014 * scale),
        rng,
        irregular=0.03,
        colors=(color, 0.8 * color),
        opacity=np.full(2, 0.8),
        softness=np.full(2, 0.5),
    )


def choose_lesions(model: BodyModel, skin: Skin, marks: Marks, count: int) -> NDArray[np.int64]:
    """Rows of ``count`` moles on bare trunk and limbs, spread over the body (farthest-point sampling)."""
    body = model.parts["body"][marks.triangle]
    bare = skin.cloth[model.triangles[marks.triangle]].max(axis=1) < -0.01
    rows = np.flatnonzero(body & bare)
    chosen: list[int] = []
    nearest = np.full(len(rows), np.inf)
    chest = np.array([0.0, -0.1, model.bone_point("spine02")[2]])
    current = int(np.linalg.norm(marks.position[rows] - chest, axis=1).argmin()) if len(rows) else 0
    while len(chosen) < min(count, len(rows)):
        chosen.append(current)
        gap = np.linalg.norm(marks.position[rows] - marks.position[rows[current]], axis=1)
        nearest = np.minimum(nearest, gap)
        current = int(nearest.argmax())
    return rows[chosen]


def make_moles(model: BodyModel, skin: Skin, count: int, lesions: int, rng: np.random.Generator) -> Moles:
    """The moles a person has at the first visit: lesions of interest first, then the others."""
    marks = scatter_moles(model, skin, count, rng)
    first = choose_lesions(model, skin, marks, lesions)
    rest = np.setdiff1d(np.arange(count), first)
    marks = marks.take(np.concatenate([first, rest]))
    boost = np.ones(count)
    boost[: len(first)] = np.maximum(1.0, 0.0026 / marks.radius_m[: len(first)])
    ids = [f"L{k + 1:02d}" for k in range(len(first))] + [f"M{k + 1:03d}" for k in range(len(rest))]
    return Moles(tuple(ids), marks.enlarged(boost))
