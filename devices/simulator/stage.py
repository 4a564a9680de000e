"""Ray casting: people in a room, what a ray meets, and true depth images.

Everything is in the depth camera's frame (x right, y down, z forward, metres).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from devices.simulator.body import BodyModel, vertex_normals
from devices.simulator.body_hair import Strands
from devices.simulator.marks import Marks
from devices.simulator.skin import Skin

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

_CELL = 8


def closest_on_surface(vertices: FloatArray, triangles: NDArray[np.int32], points: FloatArray) -> FloatArray:
    """Nearest places (k, 3) on a mesh."""
    o3d: Any = import_module("open3d")
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(triangles.astype(np.uint32))
    )
    found = scene.compute_closest_points(o3d.core.Tensor(points.astype(np.float32)))
    return np.asarray(found["points"].numpy(), float)


def first_hits(
    vertices: FloatArray, triangles: NDArray[np.int32], rays: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Ray parameter (k,) and triangle normal (k, 3) where rays (k, 3) from the origin meet a mesh first.

    The parameter is inf where a ray meets nothing.
    """
    o3d: Any = import_module("open3d")
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(triangles.astype(np.uint32))
    )
    packed = np.zeros((len(rays), 6), np.float32)
    packed[:, 3:] = rays
    found = scene.cast_rays(o3d.core.Tensor(packed))
    return np.asarray(found["t_hit"].numpy(), float), np.asarray(found["primitive_normals"].numpy(), float)


@dataclass(frozen=True, eq=False)
class Actor:
    """A person in the room.

    Attributes
    ----------
    model : BodyModel
    vertices : ndarray (n, 3)
    skin : Skin
    marks : Marks or None
    strands : Strands or None
        Hair on trunk and limbs.
    """

    model: BodyModel
    vertices: FloatArray
    skin: Skin
    marks: Marks | None
    strands: Strands | None = None


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
        o3d: Any = import_module("open3d")
        self.actors, self.planes, self.light = list(actors), list(planes), light
        self._o3d = o3d
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
        """Whether a person stands between origins (3,) or (k, 3) and targets (k, 3) less ``slack_m``."""
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
        """Pixels (h, w) in which a person may appear, with a margin in cells of 8 pixels."""
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


def room_depth(stage: Stage, camera: PinholeCamera) -> tuple[Image, NDArray[np.int8]]:
    """Depth (h, w) of the empty room, inf for nothing, and the number (h, w) of the plane, or -1."""
    depth, which = stage.plane_hits(np.zeros(3), camera.pixel_rays.reshape(-1, 3))
    shape = (camera.height, camera.width)
    return depth.reshape(shape), which.reshape(shape)


def true_depth(
    stage: Stage, camera: PinholeCamera, room: Image, cells: BoolArray, motion: RigidTransform
) -> tuple[Image, Hits, NDArray[np.int64]]:
    """Depth (h, w) of people, moved by ``motion``, and ``room``; also the hits and their flat pixels."""
    rays = camera.pixel_rays.reshape(-1, 3)
    pixels = np.flatnonzero(cells)
    back = motion.inverse()
    hits = stage.cast(back.apply(np.zeros(3)), back.rotate(rays[pixels]))
    depth = room.ravel().copy()
    depth[pixels] = np.minimum(depth[pixels], hits.t)
    return depth.reshape(camera.height, camera.width), hits, pixels
