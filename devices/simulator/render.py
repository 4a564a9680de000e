"""Ray casting: true depth and colour pictures of people in a room, with what every pixel shows.

Everything is in the depth camera's frame (x right, y down, z forward, metres).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from devices.simulator.body import BodyModel, vertex_normals
from devices.simulator.marks import Marks
from devices.simulator.skin import Skin, linear

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

_CELL = 8
_CHUNK = 131_072


def closest_on_surface(vertices: FloatArray, triangles: NDArray[np.int32], points: FloatArray) -> FloatArray:
    """Nearest places (k, 3) on a mesh."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(triangles.astype(np.uint32))
    )
    found = scene.compute_closest_points(o3d.core.Tensor(points.astype(np.float32)))
    return np.asarray(found["points"].numpy(), float)


@dataclass(frozen=True, eq=False)
class Actor:
    """A person in the room.

    Attributes
    ----------
    model : BodyModel
    vertices : ndarray (n, 3)
    skin : Skin
    marks : Marks or None
    """

    model: BodyModel
    vertices: FloatArray
    skin: Skin
    marks: Marks | None


@dataclass(frozen=True, eq=False)
class Plane:
    """Wall or floor: ``normal . x = offset``, with its colour (linear reflectance)."""

    normal: FloatArray
    offset: float
    color: FloatArray


@dataclass(frozen=True, eq=False)
class Hits:
    """What rays met, one row per ray.

    Attributes
    ----------
    t : ndarray (k,) float32
        Ray parameter, inf where nothing was met.
    actor : ndarray (k,) int8
        -1 where nothing was met.
    triangle : ndarray (k,) int32
        Triangle of that actor's body model.
    uv : ndarray (k, 2) float32
        Weights of the triangle's second and third corner.
    normal : ndarray (k, 3) float32
        Of the triangle.
    """

    t: Image
    actor: NDArray[np.int8]
    triangle: NDArray[np.int32]
    uv: Image
    normal: Image


class Stage:
    """People in a room, ready to be looked at.

    Parameters
    ----------
    actors : sequence of Actor
        The patient first.
    planes : sequence of Plane
        Floor and walls; they cut off what lies behind but cast no shadow.
    light : ndarray (3,)
        Unit vector toward the main lamp.
    """

    def __init__(self, actors: Sequence[Actor], planes: Sequence[Plane], light: FloatArray) -> None:
        import open3d as o3d

        self.actors, self.planes, self.light = list(actors), list(planes), light
        self._o3d: Any = o3d
        self._scene: Any = o3d.t.geometry.RaycastingScene(nthreads=2)
        vertices, faces, owner, number, offset = [], [], [], [], 0
        for k, actor in enumerate(self.actors):
            outer = actor.model.outer
            vertices.append(actor.vertices)
            faces.append(actor.model.triangles[outer] + offset)
            owner.append(np.full(len(outer), k, np.int8))
            number.append(outer.astype(np.int32))
            offset += len(actor.vertices)
        self._scene.add_triangles(
            o3d.core.Tensor(np.concatenate(vertices).astype(np.float32)),
            o3d.core.Tensor(np.concatenate(faces).astype(np.uint32)),
        )
        self._owner, self._number = np.concatenate(owner), np.concatenate(number)
        self._attributes = [self._vertex_attributes(actor) for actor in self.actors]

    def cast(self, origin: FloatArray, directions: NDArray[np.floating]) -> Hits:
        """Cast rays from one origin (3,) or many (k, 3) along directions (k, 3)."""
        rays = np.empty((len(directions), 6), np.float32)
        rays[:, :3], rays[:, 3:] = origin, directions
        found = self._scene.cast_rays(self._o3d.core.Tensor(rays))
        t = found["t_hit"].numpy()
        hit = np.isfinite(t)
        primitive = np.where(hit, found["primitive_ids"].numpy(), 0)
        return Hits(
            t,
            np.where(hit, self._owner[primitive], np.int8(-1)),
            self._number[primitive],
            found["primitive_uvs"].numpy(),
            found["primitive_normals"].numpy(),
        )

    def blocked(self, origins: FloatArray, targets: FloatArray, slack_m: float) -> BoolArray:
        """Whether a person stands between origins (3,) or (k, 3) and targets (k, 3), ending ``slack_m`` before them."""
        d = targets - origins
        length = np.linalg.norm(d, axis=1)
        t = self.cast(origins, d / np.maximum(length, 1e-9)[:, None]).t
        return np.asarray(t < length - slack_m)

    def plane_hits(
        self, origin: FloatArray, directions: NDArray[np.floating]
    ) -> tuple[Image, NDArray[np.int8]]:
        """Ray parameter (k,) of the nearest plane (inf: none) and its number (-1: none)."""
        best = np.full(len(directions), np.inf, np.float32)
        which = np.full(len(directions), -1, np.int8)
        for k, plane in enumerate(self.planes):
            speed = directions @ plane.normal.astype(directions.dtype)
            with np.errstate(divide="ignore", invalid="ignore"):
                t = ((plane.offset - plane.normal @ origin) / speed).astype(np.float32)
            nearer = (t > 0) & (t < best)
            best[nearer], which[nearer] = t[nearer], k
        return best, which

    def body_cells(
        self, camera: PinholeCamera, camera_from_depth: RigidTransform, margin: int = 2
    ) -> BoolArray:
        """Image (h, w) that covers every pixel in which a person may appear, with a margin in cells of 8 pixels."""
        h, w = -(-camera.height // _CELL), -(-camera.width // _CELL)
        cells = np.zeros((h, w), np.uint8)
        for actor in self.actors:
            corners = actor.vertices[actor.model.triangles]
            points = np.concatenate([actor.vertices, corners.mean(axis=1)])
            points = np.concatenate([points, 0.5 * (corners[:, 0] + corners[:, 1])])
            pixels = camera.project(camera_from_depth.apply(points))
            q = np.rint(np.nan_to_num(pixels, nan=-1e6) / _CELL).astype(np.int64)
            inside = (q >= -1).all(axis=1) & (q[:, 0] <= w) & (q[:, 1] <= h)
            cells[np.clip(q[inside, 1], 0, h - 1), np.clip(q[inside, 0], 0, w - 1)] = 1
        size = 2 * margin + 1
        cells = cv2.dilate(cells, np.ones((size, size), np.uint8))
        return np.kron(cells, np.ones((_CELL, _CELL), np.uint8))[: camera.height, : camera.width] > 0

    def _vertex_attributes(self, actor: Actor) -> Image:
        """Canonical place 3, normal 3, openness 1, skin 3, cloth 1, cloth colour 3, hair 1: (n, 15)."""
        normals = vertex_normals(actor.vertices, actor.model.triangles)
        return np.column_stack(
            [
                actor.model.reference,
                normals,
                self._openness(actor.vertices, normals),
                actor.skin.albedo,
                actor.skin.cloth,
                actor.skin.cloth_albedo,
                actor.skin.hair,
            ]
        ).astype(np.float32)

    def _openness(self, vertices: FloatArray, normals: FloatArray) -> FloatArray:
        """Share (n,) of the hemisphere above each vertex that nobody hides within half a metre."""
        rng = np.random.default_rng(7)
        count = 24
        random = rng.normal(size=(count, 3))
        random /= np.linalg.norm(random, axis=1, keepdims=True)
        free = np.zeros(len(vertices))
        start = vertices + 0.003 * normals
        for direction in random:
            d = normals + 0.98 * direction
            d /= np.linalg.norm(d, axis=1, keepdims=True)
            t = self.cast(start, d).t
            free += np.clip(t / 0.5, 0.0, 1.0)
        return free / count

    def interpolate(self, hits: Hits, rows: NDArray[np.int64], actor: int) -> Image:
        """Vertex attributes (k, 15) at hits on one actor."""
        corners = self.actors[actor].model.triangles[hits.triangle[rows]]
        table = self._attributes[actor]
        u, v = hits.uv[rows, :1], hits.uv[rows, 1:]
        out = table[corners[:, 1]]
        out *= u
        out += table[corners[:, 2]] * v
        out += table[corners[:, 0]] * (1.0 - u - v)
        return np.asarray(out)


def true_depth(
    stage: Stage, camera: PinholeCamera, cells: BoolArray, motion: RigidTransform
) -> tuple[Image, Hits, NDArray[np.int64]]:
    """Depth (h, w) of people (moved by ``motion``) and room; also the hits and their flat pixel numbers."""
    rays = camera.pixel_rays.reshape(-1, 3)
    pixels = np.flatnonzero(cells)
    back = motion.inverse()
    hits = stage.cast(back.apply(np.zeros(3)), back.rotate(rays[pixels]))
    depth, _ = stage.plane_hits(np.zeros(3), rays)
    depth[pixels] = np.minimum(depth[pixels], hits.t)
    return depth.reshape(camera.height, camera.width), hits, pixels


@dataclass(frozen=True, eq=False)
class Picture:
    """A colour picture and what its pixels show.

    Attributes
    ----------
    rgb : ndarray (h, w, 3) uint8
    pixels : ndarray (k,) int32
        Flat numbers, ascending, of the pixels that show the patient.
    triangle : ndarray (k,) int32
    uv : ndarray (k, 2) float32
        Weights of the triangle's second and third corner at the pixel centre.
    """

    rgb: NDArray[np.uint8]
    pixels: NDArray[np.int32]
    triangle: NDArray[np.int32]
    uv: Image


@dataclass(frozen=True)
class Exposure:
    """How the colour camera renders light: gain per channel, noise (share of full scale) and blur in pixels."""

    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    noise: float = 0.010
    blur_px: float = 0.6


def render_picture(
    stage: Stage,
    camera: PinholeCamera,
    color_from_depth: RigidTransform,
    exposure: Exposure,
    rng: np.random.Generator,
) -> Picture:
    """Colour picture of the stage. Small pictures are supersampled three times per axis."""
    fine = 3 if camera.width < 1000 else 1
    sampled = PinholeCamera(
        camera.width * fine,
        camera.height * fine,
        camera.fx * fine,
        camera.fy * fine,
        (camera.cx + 0.5) * fine - 0.5,
        (camera.cy + 0.5) * fine - 0.5,
        camera.distortion,
    )
    depth_from_color = color_from_depth.inverse()
    cells = stage.body_cells(sampled, color_from_depth, margin=3)
    canvas = _background(stage, sampled, depth_from_color)
    pixels = np.flatnonzero(cells).astype(np.int64)
    grid = np.stack([pixels % sampled.width, pixels // sampled.width], axis=1)
    directions = depth_from_color.rotate(sampled.rays(grid)).astype(np.float32)
    hits = stage.cast(depth_from_color.translation, directions)
    behind, _ = stage.plane_hits(depth_from_color.translation, directions)
    seen = (hits.actor >= 0) & (hits.t < behind + 0.02)
    flat = canvas.reshape(-1, 3)
    for k in range(len(stage.actors)):
        rows = np.flatnonzero(seen & (hits.actor == k))
        if len(rows):
            flat[pixels[rows]] = _paint(stage, k, hits, rows, directions, sampled, pixels, color_from_depth)
    flat *= np.asarray(exposure.gain, np.float32)
    np.power(np.clip(canvas, 0.0, 1.0, out=canvas), np.float32(1 / 2.2), out=canvas)
    if fine > 1:
        canvas = cv2.resize(canvas, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    canvas = cv2.GaussianBlur(canvas, (0, 0), exposure.blur_px)
    noise = rng.standard_normal(canvas.shape, dtype=np.float32)
    rgb = np.clip(255.0 * (canvas + exposure.noise * noise) + 0.5, 0, 255).astype(np.uint8)
    return _with_truth(rgb, seen & (hits.actor == 0), hits, pixels, sampled.width, fine)


def _with_truth(
    rgb: NDArray[np.uint8],
    patient: BoolArray,
    hits: Hits,
    pixels: NDArray[np.int64],
    width: int,
    fine: int,
) -> Picture:
    rows = np.flatnonzero(patient)
    u, v = pixels[rows] % width, pixels[rows] // width
    centre = (u % fine == fine // 2) & (v % fine == fine // 2)
    rows, u, v = rows[centre], u[centre] // fine, v[centre] // fine
    number = (v * (width // fine) + u).astype(np.int32)
    return Picture(rgb, number, hits.triangle[rows], hits.uv[rows])


def _background(stage: Stage, camera: PinholeCamera, depth_from_color: RigidTransform) -> Image:
    """Linear colour (h, w, 3) of the empty room with soft shadows of the people, painted small and enlarged."""
    shrink = max(1, camera.width // 640)
    w, h = camera.width // shrink, camera.height // shrink
    u, v = np.meshgrid(np.arange(w) * shrink + (shrink - 1) / 2, np.arange(h) * shrink + (shrink - 1) / 2)
    rays = depth_from_color.rotate(camera.rays(np.stack([u.ravel(), v.ravel()], axis=1)))
    origin = depth_from_color.translation
    t, which = stage.plane_hits(origin, rays)
    small = np.empty((h * w, 3), np.float32)
    small[:] = linear((0.55, 0.57, 0.58))
    hit = which >= 0
    points = origin + rays[hit] * t[hit, None]
    lit = np.ones(h * w, np.float32)
    lit[hit] -= stage.blocked(points, points + 3.0 * stage.light, 0.0)
    lit = cv2.GaussianBlur(lit.reshape(h, w), (0, 0), 9.0 * w / 640).ravel()
    for k, plane in enumerate(stage.planes):
        rows = np.flatnonzero(which == k)
        p = origin + rays[rows] * t[rows, None]
        fall = 1.0 / (1.0 + 0.05 * ((p - p.mean(axis=0)) ** 2).sum(axis=1)) if len(rows) else 1.0
        small[rows] = plane.color * (fall * (0.78 + 0.22 * lit[rows]))[:, None]
    picture = cv2.resize(
        small.reshape(h, w, 3), (camera.width, camera.height), interpolation=cv2.INTER_LINEAR
    )
    return np.asarray(picture, np.float32)


def _paint(
    stage: Stage,
    actor: int,
    hits: Hits,
    rows: NDArray[np.int64],
    directions: Image,
    camera: PinholeCamera,
    pixels: NDArray[np.int64],
    color_from_depth: RigidTransform,
) -> Image:
    """Linear colour (k, 3) of one actor at the hits ``rows``."""
    person = stage.actors[actor]
    albedo = np.empty((len(rows), 3), np.float32)
    canonical = np.empty((len(rows), 3), np.float32)
    shade = np.empty((len(rows), 1), np.float32)
    cloth, hair = np.empty(len(rows), np.float32), np.empty(len(rows), np.float32)
    cover = np.empty((len(rows), 3), np.float32)
    light = stage.light.astype(np.float32)
    for start in range(0, len(rows), _CHUNK):
        part = slice(start, start + _CHUNK)
        a = stage.interpolate(hits, rows[part], actor)
        normal = a[:, 3:6] / np.maximum(np.linalg.norm(a[:, 3:6], axis=1, keepdims=True), 1e-6)
        facing = np.clip(normal @ light, 0.0, 1.0)[:, None]
        sky = 0.5 - 0.5 * normal[:, 1:2]
        front = np.clip(-normal[:, 2:3], 0.0, 1.0)
        shade[part] = (
            a[:, 6:7] * (0.24 + 0.20 * sky + 0.30 * front) + (0.25 + 0.75 * a[:, 6:7]) * 0.42 * facing
        )
        canonical[part], albedo[part] = a[:, :3], a[:, 7:10]
        cloth[part], cover[part], hair[part] = a[:, 10], a[:, 11:14], a[:, 14]
    _paint_eyes(person.model, hits.triangle[rows], canonical, albedo)
    if person.marks is not None:
        _paint_marks(person, albedo, canonical, rows, camera, pixels, color_from_depth)
    weave = 1.0 + 0.06 * np.sin(canonical[:, 2:3] * 900.0) * np.sin(canonical[:, :1] * 900.0)
    mix = np.clip(cloth / 0.001 + 0.5, 0.0, 1.0)[:, None]
    albedo += mix * (cover * weave - albedo)
    strands = 1.0 + 0.25 * np.sin(canonical @ np.array([700.0, 160.0, 90.0], np.float32))[:, None]
    mix = np.clip(hair / 0.004 + 0.5, 0.0, 1.0)[:, None]
    albedo += mix * (person.skin.hair_albedo.astype(np.float32) * strands - albedo)
    return np.asarray(albedo * shade)


def _paint_eyes(model: BodyModel, triangle: NDArray[np.int32], canonical: Image, albedo: Image) -> None:
    for side in ("L", "R"):
        rows = np.flatnonzero(model.parts[f"eye_front.{side}"][triangle])
        d = canonical[rows] - model.bone_point(f"eye.{side}").astype(np.float32)
        r = np.hypot(d[:, 0], d[:, 2])
        albedo[rows[r < 0.0058]] = linear((0.32, 0.24, 0.17))
        albedo[rows[r < 0.0022]] = linear((0.05, 0.05, 0.05))


def _paint_marks(
    person: Actor,
    albedo: Image,
    canonical: Image,
    rows: NDArray[np.int64],
    camera: PinholeCamera,
    pixels: NDArray[np.int64],
    color_from_depth: RigidTransform,
) -> None:
    """Paint every mark in a window around its pixel; the canonical place decides what it covers."""
    marks = person.marks
    if marks is None:
        return
    corners = person.vertices[person.model.triangles[marks.triangle]]
    points = color_from_depth.apply(np.einsum("kc,kcx->kx", marks.barycentric, corners))
    centre = camera.project(points)
    index = np.full(camera.height * camera.width, -1, np.int32)
    index[pixels[rows]] = np.arange(len(rows), dtype=np.int32)
    index = index.reshape(camera.height, camera.width)
    for k in np.flatnonzero(camera.contains(centre)):
        reach = int(1.9 * marks.radius_m[k] * camera.fx / points[k, 2]) + 2
        u, v = int(round(centre[k, 0])), int(round(centre[k, 1]))
        window = index[max(v - reach, 0) : v + reach + 1, max(u - reach, 0) : u + reach + 1]
        touched = window[window >= 0]
        if len(touched) == 0:
            continue
        alpha, color = marks.cover(int(k), canonical[touched])
        albedo[touched] += (alpha[:, None] * (color - albedo[touched])).astype(np.float32)
