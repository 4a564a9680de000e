"""What else is before the camera: bottle, cup, bar, table, another hand, the person's body.

Everything is a `Thing` in a frame of its own (said with each) until `placed` puts it before the camera.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.capture.transform import RigidTransform
from devices.simulator.body import load_body, minimal_rotation
from devices.simulator.hands.model import CONFIGURATIONS, HandPose, load_hand
from devices.simulator.hands.scene import Thing
from devices.simulator.skin import TONES

FloatArray = NDArray[np.float64]

_ROUND = 32
_TORSO_BONES = ("root", "pelvis", "spine", "neck", "head", "clavicle", "shoulder01", "upperleg01")


def placed(thing: Thing, transform: RigidTransform) -> Thing:
    """The thing moved by a transform."""
    return replace(thing, vertices=transform.apply(thing.vertices))


def upright(up: ArrayLike, foot: ArrayLike) -> RigidTransform:
    """Transform that stands a thing with axis z on a place (3,), its axis along ``up`` (3,)."""
    return RigidTransform(minimal_rotation((0.0, 0.0, 1.0), up), np.asarray(foot, float))


def lathe(profile: ArrayLike, color: tuple[float, float, float]) -> Thing:
    """Body of revolution about z; ``profile`` (k, 2) goes from bottom to top in radius and height, metres."""
    line = np.asarray(profile, float)
    angle = np.linspace(0.0, 2 * np.pi, _ROUND, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rows = [np.column_stack([r * ring, np.full(_ROUND, z)]) for r, z in line]
    ends = np.array([[0.0, 0.0, line[0, 1]], [0.0, 0.0, line[-1, 1]]])
    vertices = np.vstack([*rows, ends])
    k = np.arange(_ROUND)
    after = (k + 1) % _ROUND
    bottom, top = len(line) * _ROUND, len(line) * _ROUND + 1
    last = (len(line) - 1) * _ROUND
    triangles = [np.stack([np.full(_ROUND, bottom), after, k], axis=1)]
    for i in range(len(line) - 1):
        a, b = i * _ROUND, (i + 1) * _ROUND
        triangles.append(np.stack([a + k, a + after, b + after], axis=1))
        triangles.append(np.stack([a + k, b + after, b + k], axis=1))
    triangles.append(np.stack([np.full(_ROUND, top), last + k, last + after], axis=1))
    return Thing(vertices, np.vstack(triangles).astype(np.int32), color)


def bottle(radius_m: float = 0.030, height_m: float = 0.23) -> Thing:
    """A bottle that stands on z = 0: straight up to 60 %, shoulder, neck, cap."""
    r, h = radius_m, height_m
    profile = [
        (0.92 * r, 0.0), (r, 0.02 * h), (r, 0.60 * h), (0.93 * r, 0.68 * h), (0.70 * r, 0.76 * h),
        (0.45 * r, 0.82 * h), (0.40 * r, 0.90 * h), (0.46 * r, 0.91 * h), (0.46 * r, h),
    ]  # fmt: skip
    return lathe(profile, (0.20, 0.42, 0.36))


def cup(radius_m: float = 0.04, height_m: float = 0.095) -> Thing:
    """A cup that stands on z = 0."""
    return lathe([(0.8 * radius_m, 0.0), (radius_m, height_m)], (0.75, 0.30, 0.24))


def box(size_m: ArrayLike, color: tuple[float, float, float]) -> Thing:
    """A box (3,) about the origin."""
    x, y, z = 0.5 * np.asarray(size_m, float)
    corners = np.array([(i, j, k) for i in (-x, x) for j in (-y, y) for k in (-z, z)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return Thing(corners, np.array(triangles, np.int32), color)


def bar(width_m: float = 0.03, length_m: float = 0.35) -> Thing:
    """A flat wooden bar; it begins at the origin and goes along +y."""
    whole = box((width_m, length_m, 0.006), (0.62, 0.48, 0.30))
    return replace(whole, vertices=whole.vertices + np.array([0.0, 0.5 * length_m, 0.0]))


def table(up: ArrayLike, place: ArrayLike, size_m: float = 1.6) -> Thing:
    """A table's top through a place (3,), its upper side along ``up`` (3,); depth-camera frame."""
    whole = box((size_m, size_m, 0.03), (0.50, 0.40, 0.33))
    lowered = replace(whole, vertices=whole.vertices - (0.0, 0.0, 0.015))
    return placed(lowered, upright(up, place))


def other_hand(
    shape: str, side: str, tone: int = 1, pose: HandPose | str = "open", *, hand: RigidTransform
) -> Thing:
    """A bare hand, as something in the way; ``hand`` is the depth camera's frame from the hand's."""
    model = load_hand(shape, side)
    angles = CONFIGURATIONS[pose] if isinstance(pose, str) else pose
    red, green, blue = TONES[tone]
    return Thing(hand.apply(model.posed(angles)), model.triangles, (float(red), float(green), float(blue)))


def torso(shape: str, nearest: ArrayLike, *, color: tuple[float, float, float] = (0.25, 0.30, 0.45)) -> Thing:
    """The person's dressed trunk, upright and square to the camera, without arms; depth-camera frame.

    Parameters
    ----------
    shape : str
    nearest : (3,)
        Where the front of the chest is: the place of the skin nearest to the camera at the breastbone.
    """
    body = load_body(shape)
    weight = body.bone_weight(*_TORSO_BONES)
    faces = body.triangles[body.outer]
    faces = faces[(weight[faces] > 0.5).all(axis=1)]
    rows, flat = np.unique(faces, return_inverse=True)
    # body frame: x the subject's left, y back, z up; the subject looks at the camera
    turned = body.reference[rows] @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]).T
    height = float(body.bone_point("spine02")[2])
    column = (np.abs(turned[:, 1] + height) < 0.04) & (np.abs(turned[:, 0]) < 0.04)
    front = turned[column]
    breastbone = front[np.argmin(front[:, 2])]
    vertices = turned - breastbone + np.asarray(nearest, float)
    return Thing(vertices, flat.reshape(-1, 3).astype(np.int32), color)
