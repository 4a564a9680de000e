"""One stance of the simulated patient, prepared once so that the viewfinder can show it 30 times a second.

The picture and a handful of depth frames are made by the renderer and sensor model of the captures; how each
pixel moves when the patient sways or breathes is kept as a coarse field for each kind of motion.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.progress import Progress, no_progress
from devices.simulator.live_geometry import resized

if TYPE_CHECKING:
    from devices.simulator.camera_device import SimulatedScene
    from devices.simulator.patient import SimulatedPatient
    from devices.simulator.truth import SimulatedCapture

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]

FINE = 4
"""Steps of the fine depth per raw unit: with 1 mm raw depth it counts quarter millimetres, up to 8.19 m."""

LOST = -32768
"""Fine depth of a pixel without a measurement: so low that motion added to it stays below zero."""

MODES = ("forward", "sideways", "breath")
"""Motions: radians about the ankles toward the wall and to the side, metres of the chest's lift."""

NOISE_FRAMES = 6
_GRID = (60, 80)
_RENDER_WIDTH = 1280  # twice the size: one ray per pixel, a coarser background, and the reduction smooths
_ANKLE_HEIGHT_M = 0.1


@dataclass(frozen=True, eq=False)
class LiveScene:
    """What the viewfinder needs of one stance.

    Attributes
    ----------
    fine_depth : ndarray (k, h, w) int16
        Depth frames with the sensor's noise, not quantised, in raw units / `FINE`; `LOST` for no measurement.
    raw_of_fine : ndarray (65536,) uint16
        Raw depth as the sensor quantises it, indexed by a fine depth seen as uint16; 0 for no measurement.
    depth_unit_m : float
    rgb : ndarray (h', w', 3) uint8
    depth_flow : ndarray (3, 3, 60, 80) float32
        For each of `MODES` and unit of it: pixels to the right, pixels down, fine depth.
    color_flow : ndarray (3, 2, 60, 80) float32
        The same of the colour picture, without depth.
    stature_m : float
    """

    fine_depth: NDArray[np.int16]
    raw_of_fine: NDArray[np.uint16]
    depth_unit_m: float
    rgb: NDArray[np.uint8]
    depth_flow: Image
    color_flow: Image
    stature_m: float


def prepare_scene(
    patient: SimulatedPatient,
    scene: SimulatedScene,
    live_rig: CameraRig,
    progress: Progress = no_progress,
) -> LiveScene:
    """Render one stance. ``live_rig`` gives the size of the colour picture; takes a second or two."""
    color = live_rig.picture_camera
    drawn = resized(color, max(_RENDER_WIDTH, color.width))
    dummy = copy(patient)
    dummy.variation = replace(patient.variation, sway_m=0.0)
    dummy.rig = replace(patient.rig, rig=CameraRig(live_rig.depth, drawn, live_rig.picture_from_depth))
    taken = dummy.capture(
        scene.stance,
        scene.view,
        scene.visit,
        NOISE_FRAMES,
        scene.seed,
        scene.distance_m,
        scene.turn_deg,
        progress=progress,
    )
    capture, vertices = taken.capture, taken.truth.vertices_m
    if capture.color is None:
        raise ValueError("A simulated capture has a picture.")
    rgb = cv2.resize(capture.color, (color.width, color.height), interpolation=cv2.INTER_AREA)
    fine, table = unquantised(capture.depth_frames, np.random.default_rng(patient.seed))
    moved = _displacements(patient, vertices)
    front = _facing(patient, vertices)
    transform = live_rig.picture_from_depth
    per_fine = capture.depth_unit_m / FINE
    return LiveScene(
        fine,
        table,
        capture.depth_unit_m,
        np.asarray(rgb, np.uint8),
        np.stack([_flow(live_rig.depth, vertices, d, front, per_fine) for d in moved]),
        np.stack(
            [_flow(color, transform.apply(vertices), transform.rotate(d), front, per_fine)[:2] for d in moved]
        ),
        patient.model.stature_m,
    )


def take_capture(
    patient: SimulatedPatient,
    scene: SimulatedScene,
    sway: float,
    frames: int,
    taken_at: datetime,
    progress: Progress = no_progress,
) -> SimulatedCapture:
    """Capture of a stance; ``sway`` multiplies the patient's usual sway."""
    if sway != 1.0:
        patient = copy(patient)
        patient.variation = replace(patient.variation, sway_m=sway * patient.variation.sway_m)
    return patient.capture(
        scene.stance,
        scene.view,
        scene.visit,
        frames,
        scene.seed,
        scene.distance_m,
        scene.turn_deg,
        taken_at=taken_at,
        progress=progress,
    )


def unquantised(
    raw: NDArray[np.uint16], rng: np.random.Generator
) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
    """Fine depth of raw frames (k, h, w), and the table that quantises it again as the sensor did.

    The levels are those that occur. Each reading is put at random between the middles to its neighbouring
    levels: with motion added and quantised again it jumps between levels as a real reading does.
    """
    occurring = np.flatnonzero(np.bincount(raw.ravel(), minlength=65536)[: 32767 // FINE])
    levels: NDArray[np.int32] = occurring[occurring > 0].astype(np.int32) * FINE
    table = np.zeros(65536, np.uint16)
    if len(levels) == 0:
        return np.full(raw.shape, LOST, np.int16), table
    edges = (levels[1:] + levels[:-1]) // 2
    position = np.arange(1, 32768)
    table[1:32768] = levels[np.searchsorted(edges, position, side="right")] // FINE
    low, high = np.concatenate([levels[:1], edges]), np.concatenate([edges, levels[-1:]])
    # between levels that never occurred (from the patient to the wall) a reading stays near its own
    reach = np.maximum(2, (0.012 * levels).astype(np.int32))
    low, high = np.maximum(low, levels - reach), np.minimum(high, levels + reach)
    start, span = np.full(65536, LOST, np.int32), np.ones(65536, np.int32)
    start[levels // FINE], span[levels // FINE] = low, np.maximum(high - low, 1)
    chance = rng.random(raw.shape, np.float32)
    fine = start[raw] + (chance * span[raw]).astype(np.int32)
    return fine.astype(np.int16), table


def _displacements(patient: SimulatedPatient, vertices: FloatArray) -> list[FloatArray]:
    """Displacement (n, 3) of the skin in the depth camera's frame per unit of each of `MODES`."""
    from devices.simulator.body import vertex_normals
    from devices.simulator.figure import with_breath

    rotation = patient.room.depth_from_world(2.0, 1.0).rotation
    height = vertices @ rotation[:, 2]
    ankles = vertices[height < height.min() + _ANKLE_HEIGHT_M].mean(axis=0)
    bind = patient.model.bind
    lift_m = 0.01
    lift = np.linalg.norm(with_breath(patient.model, bind, lift_m) - bind, axis=1) / lift_m
    return [
        np.cross(rotation[:, 0], vertices - ankles),
        np.cross(rotation[:, 1], vertices - ankles),
        lift[:, None] * vertex_normals(vertices, patient.model.triangles),
    ]


def _facing(patient: SimulatedPatient, vertices: FloatArray) -> FloatArray:
    """Weight (n,) of the vertices that the camera can see; small, not zero, for those turned away."""
    from devices.simulator.body import vertex_normals

    normals = vertex_normals(vertices, patient.model.triangles)
    toward = -vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    return np.asarray(np.clip((normals * toward).sum(axis=1), 0.01, 1.0))


def _flow(
    camera: PinholeCamera, points: FloatArray, moved: FloatArray, weight: FloatArray, fine_m: float
) -> Image:
    """Field (3, 60, 80) of the motion of the picture: pixels right, pixels down, fine depth.

    ``points`` (n, 3) and their displacements ``moved`` are in the camera's frame. Around the figure the field
    fades out: the background beside it is stretched by a pixel or two instead of being uncovered.
    """
    z = np.maximum(points[:, 2], 0.1)
    change = np.stack(
        [
            camera.fx * (moved[:, 0] - points[:, 0] / z * moved[:, 2]) / z,
            camera.fy * (moved[:, 1] - points[:, 1] / z * moved[:, 2]) / z,
            moved[:, 2] / fine_m,
        ]
    )
    h, w = _GRID
    pixels = camera.project(points)
    inside = camera.contains(pixels)
    column = np.clip(((pixels[inside, 0] + 0.5) * w / camera.width).astype(int), 0, w - 1)
    row = np.clip(((pixels[inside, 1] + 0.5) * h / camera.height).astype(int), 0, h - 1)
    cell = row * w + column

    def spread(values: FloatArray, sigma: float) -> Image:
        total = np.bincount(cell, values, h * w).reshape(h, w).astype(np.float32)
        return np.asarray(cv2.GaussianBlur(total, (0, 0), sigma), np.float32)

    there = np.bincount(cell, minlength=h * w).reshape(h, w) > 0
    body = cv2.dilate(there.astype(np.float32), np.ones((3, 3), np.uint8))
    fade = cv2.GaussianBlur(body, (0, 0), 1.2)
    density = spread(weight[inside], 2.0) + 1e-6
    return np.stack([fade * spread(c[inside] * weight[inside], 2.0) / density for c in change])
