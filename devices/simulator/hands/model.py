"""The right or left hand of a body model: its skin, its 15 true points, its configurations.

Hand frame: origin on the skin in the middle of the back of the hand, y along toward the fingertips, z out of
the back, x = y x z (the thumb is at -x on a right hand); metres. The frame goes with the middle metacarpal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.hand.names import FINGERS, POINT_NAMES
from devices.simulator.body import BodyModel, load_body, pose_body, rotation_about

FloatArray = NDArray[np.float64]

_NAIL = 0.8
"""Share of the last phalanx at which a tip lies."""

_BONES = ("finger", "metacarpal", "wrist", "lowerarm", "upperarm")


@dataclass(frozen=True)
class FingerAngles:
    """Flexion of the three joints of one finger from the outstretched hand, and spread, in degrees.

    Of the thumb: base, middle and end joint; spread moves it away from the palm's plane.
    """

    base: float = 0.0
    middle: float = 0.0
    end: float = 0.0
    spread: float = 0.0


HandPose = Mapping[str, FingerAngles]
"""Angles by finger."""


def _fingers(thumb: FingerAngles, **others: FingerAngles) -> dict[str, FingerAngles]:
    straight = {"index": -8.0, "middle": -2.0, "ring": 5.0, "little": 12.0}
    pose = {name: FingerAngles(spread=spread) for name, spread in straight.items()}
    return {"thumb": thumb, **pose, **others}


_BENT = FingerAngles(75.0, 95.0, 55.0)
_AWAY, _ACROSS = FingerAngles(spread=12.0), FingerAngles(35.0, 40.0, 45.0)
_ROUND = FingerAngles(38.0, 42.0, 25.0)

CONFIGURATIONS: dict[str, dict[str, FingerAngles]] = {
    "open": _fingers(_AWAY),
    "fist": _fingers(_ACROSS, index=_BENT, middle=_BENT, ring=_BENT, little=_BENT),
    "point": _fingers(_ACROSS, middle=_BENT, ring=_BENT, little=_BENT),
    "two": _fingers(_ACROSS, ring=_BENT, little=_BENT),
    "grip": _fingers(FingerAngles(57.0, 10.0, 15.0), index=_ROUND, middle=_ROUND, ring=_ROUND, little=_ROUND),
    "pinch": _fingers(
        FingerAngles(30.0, 25.0, 25.0),
        index=FingerAngles(52.0, 48.0, 28.0),
        middle=FingerAngles(22.0, 25.0, 15.0),
        ring=FingerAngles(12.0, 20.0, 10.0),
        little=FingerAngles(8.0, 15.0, 10.0),
    ),
}
"""What a hand is asked to do: angles of every finger."""


@dataclass(frozen=True, eq=False)
class HandModel:
    """Hand and arm of one body shape; never changed after making.

    Attributes
    ----------
    body : BodyModel
    side : {"R", "L"}
    rows : ndarray (n,)
        Vertices of the body model that belong to hand, forearm and upper arm, which goes straight on.
    triangles : ndarray (m, 3) int32
        Of those rows.
    reference : ndarray (n, 3)
        Outstretched hand, hand frame.
    point_triangle, point_weights : ndarray (15,), (15, 3)
        Where on the skin the true points are.
    length_m : float
        From the wrist to the nail of the middle finger.
    """

    body: BodyModel
    side: str
    rows: NDArray[np.int64]
    triangles: NDArray[np.int32]
    reference: FloatArray
    point_triangle: NDArray[np.int64]
    point_weights: FloatArray
    length_m: float

    def points(self, vertices: FloatArray) -> dict[str, FloatArray]:
        """The true points (3,) on the skin of the posed hand's vertices (n, 3)."""
        corners = vertices[self.triangles[self.point_triangle]]
        places = np.einsum("kc,kcx->kx", self.point_weights, corners)
        return dict(zip(POINT_NAMES, places, strict=True))

    def posed(self, pose: HandPose) -> FloatArray:
        """Vertices (n, 3) of the hand with bent fingers, hand frame."""
        axes = _Axes.of(self.body, self.side)
        local = {}
        for number, finger in enumerate(FINGERS, start=1):
            angles = pose[finger]
            for joint, degrees in enumerate((angles.base, angles.middle, angles.end), start=1):
                turn = rotation_about(axes.flexion[number], np.deg2rad(degrees))
                if joint == 1 and angles.spread:
                    turn = rotation_about(axes.spread(number), np.deg2rad(angles.spread)) @ turn
                local[f"finger{number}-{joint}.{self.side}"] = turn
        return self._skinning.posed(local)

    @cached_property
    def _skinning(self) -> _Skinning:
        return _Skinning.of(self)


@dataclass(frozen=True, eq=False)
class _Axes:
    """Directions of the outstretched hand in the body frame."""

    along: FloatArray
    out_of_back: FloatArray
    flexion: dict[int, FloatArray]
    dorsal: dict[int, FloatArray]
    side: str

    @classmethod
    def of(cls, body: BodyModel, side: str) -> _Axes:
        def point(bone: str) -> FloatArray:
            return body.bone_point(f"{bone}.{side}")

        along = body.bone_direction(f"wrist.{side}", f"finger3-1.{side}")
        out = np.cross(along, point("finger5-1") - point("finger2-1"))
        out /= np.linalg.norm(out)
        # fingers at rest are a little bent, toward the palm
        bent = body.bone_direction(f"finger3-1.{side}", f"finger3-3.{side}")
        if out @ (bent - along) > 0:
            out = -out
        flexion, dorsal = {}, {}
        for number in range(1, 6):
            finger = body.bone_direction(f"finger{number}-1.{side}", f"finger{number}-2.{side}")
            toward = -out
            if number == 1:
                # the thumb bends across the palm
                toward = point("finger3-1") - 0.035 * out - point("finger1-1")
            axis = np.cross(finger, toward)
            flexion[number] = axis / np.linalg.norm(axis)
            back = np.cross(flexion[number], finger)
            back = -back if back @ toward > 0 else back
            if number == 1:
                # the thumb's nail looks half sideways; its points are those a person sees from the back
                back = back + out - finger * (out @ finger)
                back /= np.linalg.norm(back)
            dorsal[number] = back
        return cls(along, out, flexion, dorsal, side)

    def spread(self, number: int) -> FloatArray:
        """Axis of spreading: positive moves a finger away from the thumb, the thumb away from the palm."""
        if number == 1:
            return self.out_of_back if self.side == "L" else -self.out_of_back
        return -self.out_of_back if self.side == "L" else self.out_of_back


@dataclass(frozen=True, eq=False)
class _Skinning:
    """Linear blend skinning of `pose_body` for fingers that bend alone: a hundred times faster.

    Attributes
    ----------
    bones : list of (name, parent's number or -1, origin (3,), vertices (k,), weights (k,), places (k, 3))
        The finger bones, parents first. ``places`` is where the bone alone would put the vertices of the
        outstretched hand, against its origin.
    still : ndarray (n, 3)
        What all other bones contribute.
    rotation, origin : ndarray (3, 3), (3,)
        Of the hand frame in the body frame.
    """

    bones: list[tuple[str, int, FloatArray, NDArray[np.int64], FloatArray, FloatArray]]
    still: FloatArray
    rotation: FloatArray
    origin: FloatArray

    @classmethod
    def of(cls, model: HandModel) -> _Skinning:
        body, rows = model.body, model.rows
        names = [f"finger{n}-{k}.{model.side}" for n in range(1, 6) for k in (1, 2, 3)]
        bind = np.column_stack([body.bind[rows], np.ones(len(rows))])
        still = np.zeros((len(rows), 3))
        bones = []
        for k, name in enumerate(body.bones):
            weight = (body.weights[rows] * (body.weight_bones[rows] == k)).sum(axis=1)
            touched = np.flatnonzero(weight)
            if len(touched) == 0:
                continue
            frame = np.eye(4)
            frame[:3, :3], frame[:3, 3] = body.bone_rotation[k], body.bone_origin[k]
            places = (bind[touched] @ (frame @ body.skin_from_bind[k]).T)[:, :3]
            if name not in names:
                still[touched] += weight[touched, None] * places
                continue
            joint = int(name[name.index("-") + 1])
            above = names.index(name) - 1 if joint > 1 else -1
            origin = body.bone_origin[k]
            bones.append((name, above, origin, touched, weight[touched], places - origin))
        bones.sort(key=lambda bone: names.index(bone[0]))
        rotation, origin = _hand_frame(body, model.side)
        return cls(bones, still, rotation, origin)

    def posed(self, local: Mapping[str, FloatArray]) -> FloatArray:
        """Vertices (n, 3) in the hand frame with these bone rotations."""
        vertices = self.still.copy()
        turns: list[FloatArray] = []
        moved: list[FloatArray] = []
        for name, above, origin, rows, weights, places in self.bones:
            turn, place = local[name], origin
            if above >= 0:
                place = moved[above] + turns[above] @ (origin - self.bones[above][2])
                turn = turns[above] @ turn
            turns.append(turn)
            moved.append(place)
            vertices[rows] += weights[:, None] * (places @ turn.T + place)
        return np.asarray((vertices - self.origin) @ self.rotation.T)


def _hand_frame(body: BodyModel, side: str) -> tuple[FloatArray, FloatArray]:
    """Axes (3, 3), one a row, and origin (3,) of the hand frame in the body frame."""
    axes = _Axes.of(body, side)
    middle = 0.5 * (body.bone_point(f"wrist.{side}") + body.bone_point(f"finger3-1.{side}"))
    y = axes.along - axes.out_of_back * (axes.along @ axes.out_of_back)
    y /= np.linalg.norm(y)
    z = axes.out_of_back
    return np.stack([np.cross(y, z), y, z]), middle


def _in_hand_frame(body: BodyModel, side: str, local: dict[str, FloatArray]) -> FloatArray:
    """All body vertices with these bone rotations, in the hand frame (no bone above the fingers turns)."""
    posed = pose_body(body, local)
    # `pose_body` stands the body on the floor: what the hand does not move tells the shift
    still = int(np.argmin(body.bone_weight("finger")))
    vertices = posed.vertices - posed.vertices[still] + body.reference[still]
    rotation, middle = _hand_frame(body, side)
    return np.asarray((vertices - middle) @ rotation.T)


@lru_cache(maxsize=16)
def load_hand(shape: str = "m_young_avg", side: str = "R") -> HandModel:
    """Hand of one of the shipped body shapes.

    Raises
    ------
    InputError
        If there is no such shape or side.
    """
    if side not in ("R", "L"):
        raise InputError("A hand is R or L.")
    body = load_body(shape)
    chosen = np.array([b.endswith(f".{side}") and b.startswith(_BONES) for b in body.bones])
    weight = (body.weights * chosen[body.weight_bones]).sum(axis=1)
    faces = body.triangles[(weight[body.triangles] > 0.5).all(axis=1)]
    rows = np.unique(faces)
    number = np.full(len(weight), -1, np.int32)
    number[rows] = np.arange(len(rows), dtype=np.int32)
    triangles = number[faces]
    straight = _in_hand_frame(body, side, {})[rows]
    triangle, weights, nail = _skin_points(body, side, body.reference[rows], triangles)
    length = float(np.linalg.norm(nail - body.bone_point(f"wrist.{side}")))
    return HandModel(body, side, rows, triangles, straight, triangle, weights, length)


def _skin_points(
    body: BodyModel, side: str, reference: FloatArray, triangles: NDArray[np.int32]
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Where the 15 points lie on the skin: over their joint, as seen from outside; also the middle nail."""
    axes = _Axes.of(body, side)
    inside, outward = [], []
    middle_nail = np.zeros(3)
    for number in range(1, 6):
        bones = [body.bone_point(f"finger{number}-{k}.{side}") for k in (1, 2, 3)]
        along = (bones[2] - bones[1]) / np.linalg.norm(bones[2] - bones[1])
        last = body.bone_weight(f"finger{number}-3.{side}")
        end = float(((body.reference[last > 0.6] - bones[2]) @ along).max())
        nail = bones[2] + _NAIL * end * along
        joints = [nail, bones[2], bones[1]] if number == 1 else [nail, bones[1], bones[0]]
        inside += joints
        outward += [axes.dorsal[number]] * 3
        if number == 3:
            middle_nail = nail
    start = np.array(inside) + 0.04 * np.array(outward)
    triangle, weights = skin_below(reference, triangles, start, -np.array(outward))
    if not np.isfinite(weights).all():
        raise RuntimeError("a joint of the hand has no skin over it")
    return triangle, weights, middle_nail


def skin_below(
    vertices: FloatArray, triangles: NDArray[np.int32], start: FloatArray, along: FloatArray
) -> tuple[NDArray[np.int64], FloatArray]:
    """Triangle (k,) and weights (k, 3) of the first skin that rays meet; NaN weights where there is none."""
    o3d: Any = import_module("open3d")
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(triangles.astype(np.uint32))
    )
    found = scene.cast_rays(o3d.core.Tensor(np.column_stack([start, along]).astype(np.float32)))
    met = np.isfinite(found["t_hit"].numpy())
    uv = found["primitive_uvs"].numpy().astype(float)
    weights = np.column_stack([1.0 - uv.sum(axis=1), uv])
    triangle = np.where(met, found["primitive_ids"].numpy().astype(np.int64), 0)
    return triangle, np.where(met[:, None], weights, np.nan)
