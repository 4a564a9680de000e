"""A hand with a marker before the cameras: true depth, raw frames, colour picture, visible points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import import_module
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.hand.labels import FrameLabels
from core.hand.names import POINT_NAMES
from devices.simulator.body import vertex_normals
from devices.simulator.hands.model import HandModel
from devices.simulator.room import SimulatedRig
from devices.simulator.sensor import DEPTH_UNIT_M, FrameMaker, SensorView
from devices.simulator.skin import TONES, linear

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]

_QUIET_CELLS = 1
_HIDDEN_SLACK_M = 0.004
_STEEP_COSINE = 0.2
_FINE = 2


@dataclass(frozen=True)
class MarkerSheet:
    """The printed marker on the back of the hand.

    Attributes
    ----------
    side_m : float
        Of the black square.
    number : int
        Of the dictionary.
    dictionary : str
        Name in cv2.aruco.
    turn_deg : float
        How it was stuck on: turn about the hand's z.
    shift_m : tuple of float
        Its middle in the hand frame, x and y.
    """

    side_m: float = 0.036
    number: int = 7
    dictionary: str = "DICT_4X4_50"
    turn_deg: float = 0.0
    shift_m: tuple[float, float] = (0.0, 0.0)

    def brightness(self, xy: FloatArray) -> FloatArray:
        """Reflectance (n,) of places (n, 2) on the sheet, hand frame; NaN beside it."""
        a = np.deg2rad(self.turn_deg)
        turned = (xy - self.shift_m) @ np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        picture = _marker_picture(self.dictionary, self.number)
        cells = len(picture)
        scale = (cells - 2 * _QUIET_CELLS) / self.side_m
        column = np.floor(turned[:, 0] * scale + cells / 2).astype(np.int64)
        row = np.floor(-turned[:, 1] * scale + cells / 2).astype(np.int64)
        inside = (column >= 0) & (row >= 0) & (column < cells) & (row < cells)
        out = np.full(len(xy), np.nan)
        out[inside] = picture[row[inside], column[inside]]
        return out

    def corners(self) -> FloatArray:
        """Corners (4, 2) in the hand frame, in ArUco's order: top left first, clockwise on the sheet."""
        h = 0.5 * self.side_m
        square = np.array([(-h, h), (h, h), (h, -h), (-h, -h)])
        a = np.deg2rad(self.turn_deg)
        return np.asarray(square @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) + self.shift_m)


@lru_cache(maxsize=8)
def _marker_picture(dictionary: str, number: int) -> FloatArray:
    """Cells of the sheet, 0.03 black to 0.92 white, with a quiet zone around."""
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    cells = known.markerSize + 2
    black = cv2.aruco.generateImageMarker(known, number, cells).astype(float) / 255.0
    framed = np.pad(black, _QUIET_CELLS, constant_values=1.0)
    return np.asarray(0.03 + 0.89 * framed)


@dataclass(frozen=True, eq=False)
class Thing:
    """Something else in view: a bottle, a body, a table. Depth camera frame."""

    vertices: FloatArray
    triangles: NDArray[np.int32]
    color: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class HandView:
    """A hand held before the camera.

    Attributes
    ----------
    model : HandModel
    vertices : ndarray (n, 3)
        Posed, hand frame.
    depth_from_hand : RigidTransform
    marker : sequence of MarkerSheet
        None, one, or more.
    things : sequence of Thing
    wall_m : float
        Distance of the background; 0 for none.
    tone : int
        Row of `devices.simulator.skin.TONES`.
    blur_px, blur_turn_rad : float
        Motion blur of the colour picture: its length, and its direction from x toward y.
    """

    model: HandModel
    vertices: FloatArray
    depth_from_hand: RigidTransform
    markers: tuple[MarkerSheet, ...] = (MarkerSheet(),)
    things: tuple[Thing, ...] = ()
    wall_m: float = 1.4
    tone: int = 1
    blur_px: float = 0.0
    blur_turn_rad: float = 0.0


@dataclass(frozen=True, eq=False)
class HandFrame:
    """One frame and the truth about it.

    Attributes
    ----------
    capture : RgbdCapture
    points_m : dict of str to ndarray (3,)
        The 15 points on the skin, depth-camera frame.
    visible : dict of str to bool
        Whether the depth camera sees the point.
    corners_m : ndarray (k, 4, 3)
        Of the markers, on the skin.
    configuration : str or None
        What the hand does; None between two configurations.
    time_s : float
        Of a sequence.
    remark : str
        What happens in this frame of a sequence, in words; empty in most.
    """

    capture: RgbdCapture
    points_m: dict[str, FloatArray]
    visible: dict[str, bool]
    corners_m: FloatArray = field(default_factory=lambda: np.zeros((0, 4, 3)))
    configuration: str | None = None
    time_s: float = 0.0
    remark: str = ""

    def labels(self) -> FrameLabels:
        """The truth as somebody would label the frame."""
        return FrameLabels(self.configuration, self.points_m, self.visible)


class _Scene:
    """The hand and everything else as one ray-casting scene."""

    def __init__(self, view: HandView) -> None:
        self._o3d: Any = import_module("open3d")
        self._scene = self._o3d.t.geometry.RaycastingScene(nthreads=2)
        self.vertices = view.depth_from_hand.apply(view.vertices)
        self.meshes = [(self.vertices, view.model.triangles)]
        self.meshes += [(thing.vertices, thing.triangles) for thing in view.things]
        for vertices, triangles in self.meshes:
            self._scene.add_triangles(
                self._o3d.core.Tensor(vertices.astype(np.float32)),
                self._o3d.core.Tensor(triangles.astype(np.uint32)),
            )

    def cast(self, origin: FloatArray, directions: NDArray[np.floating]) -> dict[str, Any]:
        rays = np.empty((len(directions), 6), np.float32)
        rays[:, :3], rays[:, 3:] = origin, directions
        found = self._scene.cast_rays(self._o3d.core.Tensor(rays))
        return {key: value.numpy() for key, value in found.items()}

    def blocked(self, origin: FloatArray, targets: FloatArray, slack_m: float) -> NDArray[np.bool_]:
        ray = targets - origin
        length = np.linalg.norm(ray, axis=1)
        t = self.cast(origin, ray / np.maximum(length, 1e-9)[:, None])["t_hit"]
        return np.asarray(t < length - slack_m)


def take_frame(view: HandView, rig: SimulatedRig, rng: np.random.Generator) -> HandFrame:
    """One depth frame and one colour picture of a hand."""
    scene = _Scene(view)
    depth, sight = _depth(scene, view, rig)
    raw = FrameMaker(rig.sensor, sight, rig.device_seed, rng).frame(depth)
    rgb = _picture(scene, view, rig.color, rig.color_from_depth, rng)
    points = {name: view.depth_from_hand.apply(p) for name, p in view.model.points(view.vertices).items()}
    places = np.array([points[name] for name in POINT_NAMES])
    seen = _visible(scene, view, rig.rig.depth, places)
    capture = RgbdCapture(
        raw[None],
        DEPTH_UNIT_M,
        CameraRig(rig.rig.depth, rig.rig.color, rig.rig.color_from_depth),
        rgb,
        stance="hand",
    )
    return HandFrame(capture, points, dict(zip(POINT_NAMES, map(bool, seen), strict=True)), _corners(view))


def _pixels_near(
    scene: _Scene, camera: PinholeCamera, camera_from_depth: RigidTransform, fine: int = 1
) -> NDArray[np.int64]:
    """Flat numbers of the pixels of a picture, ``fine`` times finer, that may show a mesh."""
    height, width = camera.height * fine, camera.width * fine
    near = np.zeros((height, width), np.bool_)
    for vertices, _ in scene.meshes:
        pixels = camera.project(camera_from_depth.apply(vertices))
        low = np.nan_to_num(np.nanmin(pixels, axis=0), nan=0.0) * fine
        high = np.nan_to_num(np.nanmax(pixels, axis=0), nan=width) * fine
        x0, y0 = np.clip(low - 4 * fine, 0, (width, height)).astype(int)
        x1, y1 = np.clip(high + 5 * fine, 0, (width, height)).astype(int)
        near[y0:y1, x0:x1] = True
    return np.flatnonzero(near)


def _depth(scene: _Scene, view: HandView, rig: SimulatedRig) -> tuple[Image, SensorView]:
    camera = rig.sensor.depth_camera
    rays = camera.pixel_rays.reshape(-1, 3)
    near = _pixels_near(scene, camera, RigidTransform())
    hit = scene.cast(np.zeros(3), rays[near])
    depth = np.full(len(rays), np.inf, np.float32)
    depth[near] = hit["t_hit"]
    wall = np.float32(view.wall_m) if view.wall_m > 0 else np.float32(np.inf)
    normal = np.tile((0.0, 0.0, -1.0), (len(rays), 1))
    rows = near[depth[near] < wall]
    normal[rows] = hit["primitive_normals"][depth[near] < wall]
    depth = np.minimum(depth, wall)
    length = np.maximum(np.linalg.norm(normal, axis=1) * np.linalg.norm(rays, axis=1), 1e-9)
    cosine = np.abs((normal * rays).sum(axis=1)) / length
    seen = near[np.isfinite(depth[near])]
    shadow = np.zeros(len(rays), bool)
    projector = np.array([rig.sensor.baseline_m, 0.0, 0.0])
    shadow[seen] = scene.blocked(projector, rays[seen] * depth[seen, None].astype(float), 0.003)
    shape = (camera.height, camera.width)
    image = depth.reshape(shape)
    return image, SensorView(image, cosine.reshape(shape).astype(np.float32), shadow.reshape(shape))


def _picture(
    scene: _Scene,
    view: HandView,
    camera: PinholeCamera,
    color_from_depth: RigidTransform,
    rng: np.random.Generator,
) -> NDArray[np.uint8]:
    fine = _FINE if camera.width < 1000 else 1
    shape = (camera.height * fine, camera.width * fine)
    u, v = np.meshgrid(
        (np.arange(camera.width * fine) + 0.5) / fine - 0.5,
        (np.arange(camera.height * fine) + 0.5) / fine - 0.5,
    )
    color = np.tile(linear((0.62, 0.64, 0.66)).astype(np.float32), (u.size, 1))
    color *= (0.8 + 0.1 * np.sin(u.ravel() / 37.0) * np.cos(v.ravel() / 53.0))[:, None]
    near = _pixels_near(scene, camera, color_from_depth, fine)
    depth_from_color = color_from_depth.inverse()
    grid = np.stack([u.ravel()[near], v.ravel()[near]], axis=1)
    hit = scene.cast(depth_from_color.translation, depth_from_color.rotate(camera.rays(grid)))
    seen = np.isfinite(hit["t_hit"]) & (hit["t_hit"] < (view.wall_m if view.wall_m > 0 else np.inf))
    for number, (vertices, triangles) in enumerate(scene.meshes):
        rows = np.flatnonzero(seen & (hit["geometry_ids"] == number))
        if len(rows) == 0:
            continue
        corners = triangles[hit["primitive_ids"][rows]]
        uv = hit["primitive_uvs"][rows].astype(float)
        weights = np.column_stack([1.0 - uv.sum(axis=1), uv])
        normals = np.einsum("kc,kcx->kx", weights, vertex_normals(vertices, triangles)[corners])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        light = 0.35 + 0.35 * np.clip(-normals[:, 2], 0, 1) + 0.4 * np.clip(normals @ _LAMP, 0, 1)
        if number == 0:
            albedo = _hand_albedo(view, corners, weights)
        else:
            albedo = np.tile(linear(view.things[number - 1].color), (len(rows), 1))
        color[near[rows]] = albedo * light[:, None]
    picture = np.clip(color.reshape(*shape, 3), 0, 1) ** np.float32(1 / 2.2)
    if fine > 1:
        picture = cv2.resize(picture, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    picture = cv2.GaussianBlur(picture, (0, 0), 0.7)
    if view.blur_px > 1:
        picture = cv2.filter2D(picture, -1, _streak(view.blur_px, view.blur_turn_rad))
    picture = picture + rng.normal(0.0, 0.012, picture.shape).astype(np.float32)
    return np.asarray(np.clip(255.0 * picture, 0, 255).astype(np.uint8))


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


_LAMP = np.array([-0.4, -0.75, -0.53])


def _hand_albedo(view: HandView, corners: NDArray[np.int32], weights: FloatArray) -> FloatArray:
    model = view.model
    place = np.einsum("kc,kcx->kx", weights, model.reference[corners])
    skin = linear(TONES[view.tone])
    grain = 1.0 + 0.05 * np.sin(place @ (310.0, 190.0, 240.0)) * np.sin(place @ (-170.0, 260.0, 120.0))
    albedo = np.asarray(skin * grain[:, None])
    on_back = place[:, 2] > -0.012
    for sheet in view.markers:
        shade = sheet.brightness(place[:, :2])
        rows = on_back & np.isfinite(shade)
        albedo[rows] = shade[rows, None]
    return albedo


def _visible(scene: _Scene, view: HandView, camera: PinholeCamera, points: FloatArray) -> NDArray[np.bool_]:
    normals = vertex_normals(scene.vertices, view.model.triangles)
    corners = view.model.triangles[view.model.point_triangle]
    normal = np.einsum("kc,kcx->kx", view.model.point_weights, normals[corners])
    toward = -points / np.linalg.norm(points, axis=1, keepdims=True)
    facing = (normal * toward).sum(axis=1) > _STEEP_COSINE
    free = ~scene.blocked(np.zeros(3), points, _HIDDEN_SLACK_M)
    return np.asarray(facing & free & camera.contains(camera.project(points), 2.0))


def _corners(view: HandView) -> FloatArray:
    """Marker corners (k, 4, 3) on the skin, depth frame: the sheet follows the back of the hand."""
    found = []
    reference = view.model.reference
    for sheet in view.markers:
        xy = sheet.corners()
        o3d: Any = import_module("open3d")
        scene = o3d.t.geometry.RaycastingScene()
        scene.add_triangles(
            o3d.core.Tensor(reference.astype(np.float32)),
            o3d.core.Tensor(view.model.triangles.astype(np.uint32)),
        )
        rays = np.column_stack([xy, np.full(4, 0.1), np.zeros((4, 2)), np.full(4, -1.0)]).astype(np.float32)
        hit = scene.cast_rays(o3d.core.Tensor(rays))
        uv = hit["primitive_uvs"].numpy().astype(float)
        weights = np.column_stack([1.0 - uv.sum(axis=1), uv])
        ids = hit["primitive_ids"].numpy().astype(np.int64)
        ok = np.isfinite(hit["t_hit"].numpy())
        ids[~ok] = 0
        corners = view.vertices[view.model.triangles[ids]]
        points = np.einsum("kc,kcx->kx", weights, corners)
        points[~ok] = np.nan
        found.append(view.depth_from_hand.apply(points))
    return np.array(found).reshape(-1, 4, 3)
