"""The moment of capture: where the camera stands, how the patient sways, the raw frames, what was seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.progress import Progress
from devices.simulator.body import rotation_about
from devices.simulator.marks import Moles
from devices.simulator.render import Picture
from devices.simulator.room import Room, SimulatedRig
from devices.simulator.sensor import FrameMaker, SensorView
from devices.simulator.stage import Stage, room_depth, true_depth
from devices.simulator.truth import CaptureTruth

FloatArray = NDArray[np.float64]

USUAL_DISTANCE_M = 2.3
_FRAMING_STEP_M = 0.05
_FARTHEST_M = 4.5
_FRAMING_MARGIN = 0.012
_GRAZING_COSINE = 0.17
_FRAME_SECONDS = 1.0 / 30.0
_SWAY_MEMORY_S = 0.4
_ANKLE_HEIGHT_M = 0.08
_HIDDEN_SLACK_M = 0.003
_SHADOW_SLACK_M = 0.004


def framing_distance(standing: FloatArray, rig: SimulatedRig, room: Room, height_m: float) -> float:
    """Distance at which both cameras see all vertices (n, 3) of the world frame; at least the usual 2.3 m."""
    distance = USUAL_DISTANCE_M
    while distance < _FARTHEST_M:
        points = room.depth_from_world(distance, height_m).apply(standing)
        margin = _FRAMING_MARGIN * rig.rig.depth.width
        inside = rig.rig.depth.contains(rig.rig.depth.project(points), margin).all()
        margin = _FRAMING_MARGIN * rig.color.width
        if inside and rig.color.contains(rig.rig.project_to_picture(points), margin).all():
            break
        distance += _FRAMING_STEP_M
    return distance


def sway_motions(
    count: int, angle_rad: float, depth_from_world: RigidTransform, rng: np.random.Generator
) -> list[RigidTransform]:
    """Motion of the patient in each frame: an inverted pendulum about the ankles, zero in the mean.

    ``angle_rad`` is the RMS of the angle, forward and sideways. A single frame is taken in
    the middle of the sway.
    """
    keep = np.exp(-_FRAME_SECONDS / _SWAY_MEMORY_S)
    angles = np.zeros((count, 2))
    state = rng.normal(size=2)
    for k in range(count):
        angles[k] = state
        state = keep * state + np.sqrt(1 - keep**2) * rng.normal(size=2)
    angles = (angles - angles.mean(axis=0)) * angle_rad
    ankles = depth_from_world.apply(np.array([0.0, 0.0, _ANKLE_HEIGHT_M]))
    motions = []
    for forward, sideways in angles:
        axis = depth_from_world.rotate(np.array([forward, sideways, 0.0]))
        angle = float(np.linalg.norm(axis))
        rotation = rotation_about(axis, angle) if angle > 0 else np.eye(3)
        motions.append(RigidTransform(rotation, ankles - rotation @ ankles))
    return motions


def _sensor_view(
    stage: Stage,
    rig: SimulatedRig,
    room: NDArray[np.float32],
    which: NDArray[np.int8],
    cells: NDArray[np.bool_],
) -> tuple[NDArray[np.float32], SensorView]:
    """True depth (h, w) with the patient at rest, and what the sensor can see of it."""
    camera = rig.sensor.depth_camera
    depth, hits, pixels = true_depth(stage, camera, room, cells, RigidTransform())
    rays = camera.pixel_rays.reshape(-1, 3)
    normals = np.zeros((len(rays), 3))
    for k, plane in enumerate(stage.planes):
        normals[which.ravel() == k] = plane.normal
    body = hits.t <= depth.ravel()[pixels] + 1e-6
    normals[pixels[body]] = hits.normal[body]
    length = np.maximum(np.linalg.norm(normals, axis=1) * np.linalg.norm(rays, axis=1), 1e-9)
    cosine = np.abs((normals * rays).sum(axis=1)) / length
    flat = depth.ravel().astype(float)
    shadow = np.zeros(len(rays), bool)
    if rig.sensor.baseline_m > 0:
        seen = np.flatnonzero(np.isfinite(flat))
        beside = np.array([rig.sensor.baseline_m, 0.0, 0.0])
        shadow[seen] = stage.blocked(beside, rays[seen] * flat[seen, None], _SHADOW_SLACK_M)
    skin = np.zeros(len(rays), bool)
    skin[pixels[body]] = True
    shape = depth.shape
    return depth, SensorView(
        depth, cosine.reshape(shape).astype(np.float32), shadow.reshape(shape), skin.reshape(shape)
    )


def depth_frames(
    stage: Stage,
    rig: SimulatedRig,
    motions: Sequence[RigidTransform],
    rng: np.random.Generator,
    progress: Progress,
) -> NDArray[np.uint16]:
    """Raw depth frames (n, h, w), one for each motion of the patient."""
    camera = rig.sensor.depth_camera
    cells = stage.body_cells(camera, RigidTransform())
    room, which = room_depth(stage, camera)
    at_rest, view = _sensor_view(stage, rig, room, which, cells)
    maker = FrameMaker(rig.sensor, view, rig.device_seed, rng)
    frames = np.empty((len(motions), *at_rest.shape), np.uint16)
    for k, motion in enumerate(motions):
        still = np.array_equal(motion.rotation, np.eye(3))
        frames[k] = maker.frame(at_rest if still else true_depth(stage, camera, room, cells, motion)[0])
        progress((k + 1) / len(motions), f"Frame {k + 1} of {len(motions)}")
    return frames


def capture_truth(
    stage: Stage, rig: CameraRig, moles: Moles, picture: Picture, joints_m: dict[str, FloatArray]
) -> CaptureTruth:
    """What a capture shows of the patient, who is the first actor of the stage."""
    patient, marks = stage.actors[0], moles.marks
    faces = patient.model.triangles[marks.triangle]
    corners = patient.vertices[faces]
    points = np.einsum("kc,kcx->kx", marks.barycentric, corners)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    under_cloth = (patient.skin.cloth[faces] * marks.barycentric).sum(axis=1) > -marks.radius_m
    under_hair = (patient.skin.hair[faces] * marks.barycentric).sum(axis=1) > -marks.radius_m

    def sees(eye: FloatArray) -> NDArray[np.bool_]:
        toward = eye - points
        toward /= np.linalg.norm(toward, axis=1, keepdims=True)
        facing = (normal * toward).sum(axis=1) > _GRAZING_COSINE
        return np.asarray(facing & ~under_cloth & ~under_hair & ~stage.blocked(eye, points, _HIDDEN_SLACK_M))

    pixels, depth_pixels = rig.project_to_picture(points), rig.depth.project(points)
    in_color = sees(rig.picture_from_depth.inverse().translation) & rig.picture_camera.contains(pixels, 1.0)
    in_depth = sees(np.zeros(3)) & rig.depth.contains(depth_pixels, 1.0)
    pixels[~in_color], depth_pixels[~in_depth] = np.nan, np.nan
    return CaptureTruth(
        rig=rig,
        vertices_m=patient.vertices,
        triangles=patient.model.triangles,
        pixel_numbers=picture.pixels,
        pixel_triangle=picture.triangle,
        pixel_uv=picture.uv,
        joints_m=joints_m,
        mole_ids=moles.ids,
        mole_triangle=marks.triangle,
        mole_barycentric=marks.barycentric,
        mole_points_m=points,
        mole_pixels=pixels,
        mole_depth_pixels=depth_pixels,
        mole_visible_color=in_color,
        mole_visible_depth=in_depth,
        mole_radius_m=marks.radius_m,
        healed_ids=tuple(sorted(moles.healed)),
        faint_ids=tuple(sorted(moles.faint)),
    )
