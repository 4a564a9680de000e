"""Colour pictures of people in a room, with what every pixel shows."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from devices.simulator.body import BodyModel
from devices.simulator.body_hair import hair_cover
from devices.simulator.skin import linear
from devices.simulator.stage import Actor, Hits, Stage

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

_CHUNK = 131_072


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
    """How the colour camera renders light: gain per channel, noise (of full scale), blur in pixels."""

    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    noise: float = 0.010
    blur_px: float = 0.75


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
    canvas = cv2.pow(np.clip(canvas, 0.0, 1.0, out=canvas), 1 / 2.2)
    if fine > 1:
        canvas = cv2.resize(canvas, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    canvas = cv2.GaussianBlur(canvas, (0, 0), exposure.blur_px)
    noise = rng.standard_normal(canvas.shape, dtype=np.float32)
    rgb = cv2.convertScaleAbs(np.maximum(canvas + np.float32(exposure.noise) * noise, 0.0), alpha=255.0)
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
    """Linear colour (h, w, 3) of the empty room with soft shadows of the people.

    Every plane is shaded on a small grid and enlarged; the edge between planes is found at full size from
    the inverse distance, which is linear over the picture.
    """
    shrink = max(1, camera.width // 640)
    w, h = -(-camera.width // shrink), -(-camera.height // shrink)
    u, v = np.meshgrid(np.arange(w) * shrink + (shrink - 1) / 2, np.arange(h) * shrink + (shrink - 1) / 2)
    rays = depth_from_color.rotate(camera.rays(np.stack([u.ravel(), v.ravel()], axis=1)))
    origin = depth_from_color.translation
    size = (w * shrink, h * shrink)
    nearest = np.full((camera.height, camera.width), 1e-3, np.float32)
    picture = np.empty((camera.height, camera.width, 3), np.float32)
    picture[:] = linear((0.55, 0.57, 0.58))
    for plane in stage.planes:
        inverse = (rays @ plane.normal / (plane.offset - plane.normal @ origin)).astype(np.float32)
        rows = np.flatnonzero(inverse > 0.02)
        points = origin + rays[rows] / inverse[rows, None]
        lit = np.ones(h * w, np.float32)
        lit[rows] -= stage.blocked(points, points + 3.0 * stage.light, 0.0)
        lit = cv2.GaussianBlur(lit.reshape(h, w), (0, 0), 12.0 * w / 640).ravel()
        small = np.tile(plane.color.astype(np.float32), (h * w, 1))
        fall = 1.0 / (1.0 + 0.04 * (points[:, 0] ** 2 + (points[:, 2] - 3.0) ** 2))
        small[rows] *= (fall * (0.82 + 0.18 * lit[rows]))[:, None].astype(np.float32)
        shaded = cv2.resize(small.reshape(h, w, 3), size, interpolation=cv2.INTER_LINEAR)
        closeness = cv2.resize(inverse.reshape(h, w), size, interpolation=cv2.INTER_LINEAR)
        closeness = closeness[: camera.height, : camera.width]
        front = (closeness > nearest).view(np.uint8)
        cv2.copyTo(shaded[: camera.height, : camera.width], front, picture)
        cv2.copyTo(closeness, front, nearest)
    return picture


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
    if person.strands is not None:
        mask = hair_cover(person.strands, person.model, person.vertices, camera, color_from_depth)
        covered = mask.reshape(-1)[pixels[rows]][:, None]
        albedo += covered * (person.skin.hair_albedo.astype(np.float32) - albedo)
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
    numbers = np.full(camera.height * camera.width, -1, np.int32)
    numbers[pixels[rows]] = np.arange(len(rows), dtype=np.int32)
    index = numbers.reshape(camera.height, camera.width)
    for k in np.flatnonzero(camera.contains(centre)):
        reach = int(1.9 * marks.radius_m[k] * camera.fx / points[k, 2]) + 2
        u, v = (int(x) for x in np.rint(centre[k]))
        window = index[max(v - reach, 0) : v + reach + 1, max(u - reach, 0) : u + reach + 1]
        touched = window[window >= 0]
        if len(touched) == 0:
            continue
        alpha, color = marks.cover(int(k), canonical[touched])
        albedo[touched] += (alpha[:, None] * (color - albedo[touched])).astype(np.float32)
