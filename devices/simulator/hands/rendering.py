"""Depth and colour of a hand by ray casting: rays only where something is, fine ones only where they tell.

Everything casts in the depth camera's frame. The inside of a smooth surface takes one ray per pixel; the
pixels of a printed marker, of outlines and of folds take nine.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from devices.simulator.body import vertex_normals
from devices.simulator.room import SimulatedRig
from devices.simulator.sensor import SensorView
from devices.simulator.skin import TONES, linear

if TYPE_CHECKING:
    from devices.simulator.hands.scene import HandView

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]
BoolImage = NDArray[np.bool_]

_FINE = 3
_FOLD_M = 0.003
_HIDDEN_SLACK_M = 0.004
_SHADOW_SLACK_M = 0.003
_STEEP_COSINE = 0.2
_BACK_M = -0.012
_LENS_BLUR_PX = 0.7
COLOR_NOISE = 0.012
"""Standard deviation of a pixel, of full scale."""

_LAMP = np.array([-0.4, -0.75, -0.53], np.float32)
_GRAIN = np.array([(310.0, -170.0), (190.0, 260.0), (240.0, 120.0)], np.float32)
_WALL = (0.62, 0.64, 0.66)
_CROSS = np.ones((3, 3), np.uint8)
_NOTHING = np.iinfo(np.uint32).max


@dataclass(frozen=True)
class Box:
    """Part of a picture: columns left to right (exclusive), rows top to bottom (exclusive)."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    @property
    def empty(self) -> bool:
        """Whether nothing is inside."""
        return self.right <= self.left or self.bottom <= self.top

    def grown(self, across: int, along: int, camera: PinholeCamera) -> Box:
        """Larger on every side, within the picture."""
        return Box(
            max(self.left - across, 0),
            max(self.top - along, 0),
            min(self.right + across, camera.width),
            min(self.bottom + along, camera.height),
        )


@lru_cache(maxsize=4)
def _rays(camera: PinholeCamera, turn: tuple[float, ...]) -> Image:
    """Direction (h, w, 3) of every pixel, turned by a rotation given row by row."""
    rotation = np.array(turn).reshape(3, 3)
    return np.asarray(camera.pixel_rays @ rotation.T, np.float32)


@lru_cache(maxsize=4)
def wall_cosine(camera: PinholeCamera) -> Image:
    """Cosine (h, w) of the angle under which a pixel sees a wall square to the camera."""
    return np.asarray(1.0 / np.linalg.norm(camera.pixel_rays, axis=2), np.float32)


@lru_cache(maxsize=4)
def _background(camera: PinholeCamera) -> Image:
    """Picture (h, w, 3) of the wall, linear light."""
    across = np.sin(np.arange(camera.width) * (640.0 / 18.5 / camera.width))
    along = np.cos(np.arange(camera.height) * (480.0 / 26.5 / camera.height))
    light = 0.8 + 0.1 * np.outer(along, across)
    return np.asarray(light[..., None] * linear(_WALL), np.float32)


@lru_cache(maxsize=4)
def empty_picture(camera: PinholeCamera) -> Image:
    """Picture (h, w, 3) of the wall as the camera delivers it, 0 to 1, without noise."""
    return np.asarray(cv2.pow(_background(camera), 1 / 2.2), np.float32)


class HandScene:
    """A hand and everything else as one ray-casting scene.

    Parameters
    ----------
    view : HandView
    """

    def __init__(self, view: HandView) -> None:
        self._o3d: Any = import_module("open3d")
        self._scene = self._o3d.t.geometry.RaycastingScene(nthreads=2)
        self._view = view
        self.vertices = view.depth_from_hand.apply(view.vertices)
        self._meshes = [(self.vertices, view.model.triangles)]
        self._meshes += [(thing.vertices, thing.triangles) for thing in view.things]
        for vertices, triangles in self._meshes:
            self._scene.add_triangles(
                self._o3d.core.Tensor(vertices.astype(np.float32)),
                self._o3d.core.Tensor(triangles.astype(np.uint32)),
            )
        self._normals = [vertex_normals(v, t).astype(np.float32) for v, t in self._meshes]
        self._wall_m = view.wall_m if view.wall_m > 0 else np.inf

    def _cast(self, origin: FloatArray, directions: Image) -> dict[str, Any]:
        shape = directions.shape[:-1]
        rays = np.empty((*shape, 6), np.float32)
        rays[..., :3], rays[..., 3:] = origin, directions
        found = self._scene.cast_rays(self._o3d.core.Tensor(rays))
        return {key: value.numpy() for key, value in found.items()}

    def _blocked(self, origin: FloatArray, targets: NDArray[np.floating], slack_m: float) -> BoolImage:
        """Whether something lies between a place and targets (..., 3), more than the slack before them."""
        rays = np.empty((*targets.shape[:-1], 6), np.float32)
        way = (targets - origin).astype(np.float32)
        length = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
        rays[..., :3], rays[..., 3:] = origin, way * np.maximum(1.0 - slack_m / length, 0.0)
        found = self._scene.test_occlusions(self._o3d.core.Tensor(rays), 0.0, 1.0)
        return np.asarray(found.numpy())

    def box(self, camera: PinholeCamera, camera_from_depth: RigidTransform) -> Box:
        """The part of a picture in which something may be seen."""
        low: FloatArray = np.full(2, np.inf)
        high: FloatArray = np.full(2, -np.inf)
        size = np.array([camera.width, camera.height], dtype=float)
        for vertices, _ in self._meshes:
            places = camera_from_depth.apply(vertices)
            if places[:, 2].max() <= 0.0:
                continue
            if places[:, 2].min() < 0.05:  # reaches beside or behind the camera
                low, high = np.zeros(2), size
                break
            pixels = camera.project(places)
            low, high = np.minimum(low, pixels.min(axis=0)), np.maximum(high, pixels.max(axis=0))
        if not np.isfinite(low).all():
            return Box(0, 0, 0, 0)
        left, top = (int(c) for c in np.clip(np.floor(low) - 3, 0, size))
        right, bottom = (int(c) for c in np.clip(np.ceil(high) + 4, 0, size))
        return Box(left, top, right, bottom)

    def depth_box(self, rig: SimulatedRig) -> Box:
        """The part of the depth picture that differs from an empty room's: things and their shadows."""
        camera = rig.sensor.depth_camera
        box = self.box(camera, RigidTransform())
        if box.empty or not np.isfinite(self._wall_m):
            return box
        nearest = max(min(float(v[:, 2].min()) for v, _ in self._meshes), 0.2)
        shift = camera.fx * abs(rig.sensor.baseline_m) * max(1.0 / nearest - 1.0 / self._wall_m, 0.0)
        return box.grown(int(shift) + 4, 4, camera)

    def depth(self, rig: SimulatedRig) -> tuple[Image, SensorView]:
        """True depth (h, w), inf for nothing, and what the sensor's noise depends on."""
        camera = rig.sensor.depth_camera
        shape = (camera.height, camera.width)
        depth = np.full(shape, self._wall_m, np.float32)
        cosine = wall_cosine(camera).copy()
        shadow = np.zeros(shape, np.bool_)
        box = self.depth_box(rig)
        if not box.empty:
            where = box.slices
            rays = _rays(camera, tuple(np.eye(3).ravel()))[where]
            hit = self._cast(np.zeros(3), rays)
            near = hit["t_hit"] < self._wall_m
            depth[where] = np.where(near, hit["t_hit"], depth[where])
            along = np.abs((hit["primitive_normals"] * rays).sum(axis=2)) * cosine[where]
            cosine[where] = np.where(near, along, cosine[where])
            seen = np.isfinite(depth[where])
            places = np.where(seen, depth[where], 1.0)[..., None] * rays
            projector = np.array([rig.sensor.baseline_m, 0.0, 0.0])
            shadow[where] = seen & self._blocked(projector, places, _SHADOW_SLACK_M)
        return depth, SensorView(depth, cosine, shadow)

    def picture(
        self,
        camera: PinholeCamera,
        color_from_depth: RigidTransform,
        rng: np.random.Generator,
        noise: float = COLOR_NOISE,
    ) -> NDArray[np.uint8]:
        """Colour picture (h, w, 3)."""
        picture = empty_picture(camera).copy()
        box, patch = self.picture_patch(camera, color_from_depth)
        picture[box.slices] = patch
        picture += np.float32(noise) * rng.standard_normal(picture.shape, dtype=np.float32)
        return np.asarray(cv2.convertScaleAbs(np.maximum(picture, 0.0, out=picture), alpha=255.0), np.uint8)

    def picture_patch(self, camera: PinholeCamera, color_from_depth: RigidTransform) -> tuple[Box, Image]:
        """The part of the picture, 0 to 1 and without noise, that differs from an empty room's."""
        inner = self.box(camera, color_from_depth)
        if inner.empty:
            return inner, np.zeros((0, 0, 3), np.float32)
        blur = self._view.blur_px
        margin = 4 + int(np.ceil(0.5 * blur))
        box = inner.grown(margin, margin, camera)
        light = _background(camera)[box.slices].copy()
        top, left = inner.top - box.top, inner.left - box.left
        part = light[top : top + inner.bottom - inner.top, left : left + inner.right - inner.left]
        self._paint(part, inner, camera, color_from_depth)
        patch = cv2.pow(np.clip(light, 0.0, 1.0, out=light), 1 / 2.2)
        patch = cv2.GaussianBlur(patch, (0, 0), _LENS_BLUR_PX)
        if blur > 1:
            patch = cv2.filter2D(patch, -1, _streak(blur, self._view.blur_turn_rad))
        return box, np.asarray(patch, np.float32)

    def _paint(self, light: Image, box: Box, camera: PinholeCamera, color_from_depth: RigidTransform) -> None:
        """Paint everything in a box of the picture, in place."""
        depth_from_color = color_from_depth.inverse()
        rays = _rays(camera, tuple(depth_from_color.rotation.ravel()))[box.slices]
        hit = self._cast(depth_from_color.translation, rays)
        shown = self._shown(hit)
        rows = np.flatnonzero(shown)
        if len(rows) == 0:
            return
        flat = light.reshape(-1, 3)
        behind = flat.copy()
        flat[rows], printed = self._shaded({k: _flat(v)[rows] for k, v in hit.items()})
        marked = np.zeros(shown.shape, np.uint8)
        marked.reshape(-1)[rows] = printed
        fine = np.flatnonzero(cv2.dilate(marked, _CROSS) | self._edges(hit, shown))
        if len(fine):
            flat[fine] = self._refined(behind[fine], rays.reshape(-1, 3)[fine], camera, depth_from_color)
        light[:] = flat.reshape(light.shape)

    def _refined(
        self, behind: Image, rays: Image, camera: PinholeCamera, depth_from_color: RigidTransform
    ) -> Image:
        """Pixels (k, 3) as the mean of nine rays through each; the lens is taken as straight within one.

        ``behind`` (k, 3) is the wall's colour there, ``rays`` (k, 3) go through the middles.
        """
        steps = (np.arange(_FINE) + 0.5) / _FINE - 0.5
        du, dv = (s.ravel() for s in np.meshgrid(steps, steps))
        offsets = np.stack([du / camera.fx, dv / camera.fy, np.zeros(_FINE**2)], axis=1)
        turned = (offsets @ depth_from_color.rotation.T).astype(np.float32)
        directions = (rays[:, None] + turned[None]).reshape(-1, 3)
        hit = self._cast(depth_from_color.translation, directions)
        shown = np.flatnonzero(self._shown(hit))
        color = np.repeat(behind, _FINE**2, axis=0)
        color[shown], _ = self._shaded({k: v[shown] for k, v in hit.items()})
        return np.asarray(color.reshape(len(rays), -1, 3).mean(axis=1))

    def _shown(self, hit: dict[str, Any]) -> BoolImage:
        return np.asarray((hit["geometry_ids"] != _NOTHING) & (hit["t_hit"] < self._wall_m))

    def _edges(self, hit: dict[str, Any], shown: BoolImage) -> NDArray[np.uint8]:
        """Pixels beside an outline or fold."""
        z = np.where(shown, hit["t_hit"], np.float32(9.0)).astype(np.float32)
        jump = cv2.dilate(z, _CROSS) - cv2.erode(z, _CROSS) > _FOLD_M * 4
        curve = np.abs(cv2.Laplacian(z, cv2.CV_32F)) > _FOLD_M
        return np.asarray(jump | curve, np.uint8)

    def _shaded(self, hit: dict[str, Any]) -> tuple[Image, NDArray[np.bool_]]:
        """Linear colour (k, 3) of hits, and which of them are printed marker."""
        color = np.empty((len(hit["t_hit"]), 3), np.float32)
        printed = np.zeros(len(color), np.bool_)
        for number, (_, triangles) in enumerate(self._meshes):
            rows = np.flatnonzero(hit["geometry_ids"] == number)
            if len(rows) == 0:
                continue
            corners = triangles[hit["primitive_ids"][rows].astype(np.int64)]
            uv = hit["primitive_uvs"][rows]
            weights = np.column_stack([1.0 - uv.sum(axis=1), uv])
            normals = _mixed(weights, self._normals[number], corners)
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
            light = 0.35 + 0.35 * np.clip(-normals[:, 2], 0, 1) + 0.4 * np.clip(normals @ _LAMP, 0, 1)
            if number == 0:
                albedo, printed[rows] = self._skin(corners, weights)
            else:
                albedo = np.broadcast_to(linear(self._view.things[number - 1].color), (len(rows), 3))
            color[rows] = albedo * light[:, None]
        return color, printed

    def _skin(self, corners: NDArray[np.int32], weights: Image) -> tuple[Image, NDArray[np.bool_]]:
        """Reflectance (k, 3) of the hand with what is printed on it."""
        view = self._view
        place = _mixed(weights, view.model.reference.astype(np.float32), corners)
        waves = np.sin(place @ _GRAIN)
        grain = 1.0 + 0.05 * waves[:, :1] * waves[:, 1:]
        albedo = np.asarray(linear(TONES[view.tone]) * grain, np.float32)
        printed = np.zeros(len(place), np.bool_)
        on_back = np.flatnonzero(place[:, 2] > _BACK_M)
        for sheet in view.markers:
            shade = sheet.brightness(place[on_back, :2])
            rows = np.isfinite(shade)
            albedo[on_back[rows]] = shade[rows, None]
            printed[on_back[rows]] = True
        return albedo, printed

    def visible(self, camera: PinholeCamera, points: FloatArray) -> NDArray[np.bool_]:
        """Which true points (15, 3) the depth camera sees: facing it, before everything, in the picture."""
        model = self._view.model
        corners = model.triangles[model.point_triangle]
        normal = np.einsum("kc,kcx->kx", model.point_weights, self._normals[0][corners])
        toward = -points / np.linalg.norm(points, axis=1, keepdims=True)
        turned = (normal * toward).sum(axis=1) > _STEEP_COSINE
        hidden = self._blocked(np.zeros(3), points, _HIDDEN_SLACK_M)
        return np.asarray(turned & ~hidden & camera.contains(camera.project(points), 2.0))


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    return values.reshape(-1, *values.shape[2:])


def _mixed(weights: Image, values: NDArray[Any], corners: NDArray[np.int32]) -> NDArray[Any]:
    """Values (k, 3) between the corners (k, 3) of triangles."""
    return np.asarray(
        weights[:, :1] * values[corners[:, 0]]
        + weights[:, 1:2] * values[corners[:, 1]]
        + weights[:, 2:] * values[corners[:, 2]]
    )


def _streak(length_px: float, turn_rad: float) -> Image:
    """Kernel of a motion of this length and direction."""
    half = int(np.ceil(0.5 * length_px)) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    way = np.linspace(-0.5, 0.5, 8 * half + 1) * length_px
    u, v = half + way * np.cos(turn_rad), half + way * np.sin(turn_rad)
    u0, v0 = np.floor(u).astype(int), np.floor(v).astype(int)
    for du in (0, 1):
        for dv in (0, 1):
            weight = np.abs(1 - du - (u - u0)) * np.abs(1 - dv - (v - v0))
            np.add.at(kernel, (v0 + dv, u0 + du), weight.astype(np.float32))
    return np.asarray(kernel / kernel.sum())
