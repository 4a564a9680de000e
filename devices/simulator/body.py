"""A human body that can be posed: one shape of the shipped body model, linear-blend skinned.

Body frame: x = the subject's left, y = back, z = up, metres, floor at z = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import InputError
from devices.simulator.shapes import SHAPES as SHAPES
from devices.simulator.shapes import read_shape
from resources import resource_path

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]

_HIDDEN_PARTS = (
    "mouth_cavity",
    "tongue",
    "eye_cavity.L",
    "eye_cavity.R",
    "eye_back.L",
    "eye_back.R",
    "missing",
)
_SIDES = (("L", "left"), ("R", "right"))


def rotation_about(axis: ArrayLike, angle_rad: float) -> FloatArray:
    """Rotation matrix (3, 3) about an axis (Rodrigues)."""
    a = np.asarray(axis, float)
    a = a / np.linalg.norm(a)
    k = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle_rad) * k + (1.0 - np.cos(angle_rad)) * k @ k)


def minimal_rotation(source: ArrayLike, target: ArrayLike) -> FloatArray:
    """Shortest rotation (3, 3) that turns one direction into the other."""
    a, b = np.asarray(source, float), np.asarray(target, float)
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    v, c = np.cross(a, b), float(a @ b)
    s = float(np.linalg.norm(v))
    if s < 1e-9:
        return np.eye(3) if c > 0 else rotation_about(np.cross(a, (0.3, 0.5, 0.8)), np.pi)
    return rotation_about(v, float(np.arctan2(s, c)))


def vertex_normals(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Area-weighted unit normals (n, 3), outward for outward-wound triangles."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    index = triangles.T.ravel()
    normals = np.stack(
        [np.bincount(index, np.tile(face[:, k], 3), minlength=len(vertices)) for k in range(3)], axis=1
    )
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15))


def enclosed_volume(vertices: FloatArray, triangles: IntArray) -> float:
    """Volume in cubic metres inside a closed, outward-wound mesh (divergence theorem)."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


@dataclass(frozen=True, eq=False)
class BodyModel:
    """Shape, mesh and skeleton of one body. Never changed after loading.

    Attributes
    ----------
    shape : str
    triangles : ndarray (m, 3) int32
    reference : ndarray (n, 3)
        Vertices in the reference posture: the coordinates in which skin is described.
    bind : ndarray (n, 3)
        Vertices in the posture in which the skin was bound to the bones.
    skin_from_bind : ndarray (bones, 4, 4)
        Inverse bone frames of the bind posture.
    bone_rotation, bone_origin : ndarray (bones, 3, 3), (bones, 3)
        Bone frames of the reference posture.
    bones, parents : names and parent numbers (-1 for the root)
    weight_bones, weights : ndarray (n, 9)
        Bones that move a vertex, and by how much.
    parts : dict of str to ndarray (m,) bool
        Triangles of head, body, hands, feet, eyes and so on.
    stumps : mapping of str to float
        Joints ("left_hand", "right_foot"...) that an amputation has taken; the value tells at which share of
        the way from elbow to wrist or from knee to ankle the limb ends.
    """

    shape: str
    triangles: IntArray
    reference: FloatArray
    bind: FloatArray
    skin_from_bind: FloatArray
    bone_rotation: FloatArray
    bone_origin: FloatArray
    bones: tuple[str, ...]
    parents: NDArray[np.int64]
    weight_bones: NDArray[np.int64]
    weights: FloatArray
    parts: dict[str, BoolArray]
    stumps: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def bone_index(self) -> dict[str, int]:
        """Number of each bone by name."""
        return {name: k for k, name in enumerate(self.bones)}

    @cached_property
    def outer(self) -> NDArray[np.int64]:
        """Triangles that can be seen from outside (no mouth cavity, no back of the eyes, no lost limb)."""
        hidden = np.any([self.parts[name] for name in _HIDDEN_PARTS if name in self.parts], axis=0)
        return np.flatnonzero(~hidden)

    @cached_property
    def stature_m(self) -> float:
        """Height of the standing body."""
        return float(np.ptp(self.reference[:, 2]))

    def bone_weight(self, *prefixes: str) -> FloatArray:
        """Share (n,) of each vertex's skinning weight that belongs to bones with these name prefixes."""
        chosen = np.array([name.startswith(prefixes) for name in self.bones])
        return np.asarray((self.weights * chosen[self.weight_bones]).sum(axis=1))

    def bone_point(self, name: str) -> FloatArray:
        """Origin (3,) of a bone in the reference posture."""
        return np.asarray(self.bone_origin[self.bone_index[name]])

    def bone_direction(self, start: str, end: str) -> FloatArray:
        """Unit vector (3,) from one bone's origin to another's in the reference posture."""
        v = self.bone_point(end) - self.bone_point(start)
        return np.asarray(v / np.linalg.norm(v))


@lru_cache(maxsize=6)
def load_body(shape: str) -> BodyModel:
    """Load one of the shipped `SHAPES`.

    Raises
    ------
    InputError
        If there is no such shape.
    """
    if shape not in SHAPES:
        raise InputError(
            f"There is no simulated body called '{shape}'.", f"Choose one of: {', '.join(SHAPES)}."
        )
    own = read_shape(shape)
    with np.load(resource_path("bodies", "anny_common.npz")) as common:
        weight_bones, weights = common["widx"].astype(np.int64), common["weights"].astype(float)
        skin_from_bind: FloatArray = np.asarray(np.linalg.inv(own.rest_bones), float)
        reference = own.reference
        if reference is None:
            reference = _skinned(own.ref_bones @ skin_from_bind, own.bind, weight_bones, weights)
        return BodyModel(
            shape=shape,
            triangles=common["faces"].astype(np.int32),
            reference=reference,
            bind=own.bind,
            skin_from_bind=skin_from_bind,
            bone_rotation=own.ref_bones[:, :3, :3],
            bone_origin=own.ref_bones[:, :3, 3],
            bones=tuple(str(name) for name in common["bones"]),
            parents=common["parents"].astype(np.int64),
            weight_bones=weight_bones,
            weights=weights,
            parts={key[3:]: common[key] for key in common.files if key.startswith("fm_")},
        )


def _skinned(
    frames: FloatArray, bind: FloatArray, weight_bones: NDArray[np.int64], weights: FloatArray
) -> FloatArray:
    """Vertices (n, 3) moved by the bones' motions (bones, 4, 4), blended by weight."""
    skin = frames[:, :3]
    homogeneous = np.column_stack([bind, np.ones(len(bind))])
    vertices = np.zeros_like(bind)
    for k in range(weights.shape[1]):
        moved = np.einsum("vij,vj->vi", skin[weight_bones[:, k]], homogeneous)
        vertices += weights[:, k, None] * moved
    return vertices


@dataclass(frozen=True, eq=False)
class PosedBody:
    """A body in a stance, standing on the floor.

    Attributes
    ----------
    model : BodyModel
    vertices : ndarray (n, 3)
        Body frame, metres, lowest point at z = 0, pelvis above the origin.
    joints : dict of str to ndarray (3,)
        The 15 NITE joints, interior, body frame.
    bend : dict of str to float
        Rotation of each bone against its parent, radians, relative to the reference posture.
    """

    model: BodyModel
    vertices: FloatArray
    joints: dict[str, FloatArray]
    bend: dict[str, float]


def pose_body(model: BodyModel, local: dict[str, FloatArray], bind: FloatArray | None = None) -> PosedBody:
    """Skin a body to bone rotations.

    Parameters
    ----------
    model : BodyModel
    local : dict of str to ndarray (3, 3)
        Rotation of a bone against its parent, expressed in the axes of the body frame.
    bind : ndarray (n, 3), optional
        Vertices in the bind posture instead of the model's own (a changed figure).
    """
    count = len(model.bones)
    rotation, origin = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for k, (name, parent) in enumerate(zip(model.bones, model.parents, strict=True)):
        if parent < 0:
            above, origin[k] = np.eye(3), model.bone_origin[k]
        else:
            above = rotation[parent]
            origin[k] = origin[parent] + above @ (model.bone_origin[k] - model.bone_origin[parent])
        rotation[k] = above @ local.get(name, np.eye(3))
    frames = np.tile(np.eye(4), (count, 1, 1))
    frames[:, :3, :3] = rotation @ model.bone_rotation
    frames[:, :3, 3] = origin
    shape = model.bind if bind is None else bind
    vertices = _skinned(frames @ model.skin_from_bind, shape, model.weight_bones, model.weights)
    pelvis = 0.5 * (origin[model.bone_index["upperleg01.L"]] + origin[model.bone_index["upperleg01.R"]])
    ground = np.array([pelvis[0], pelvis[1], vertices[:, 2].min()])
    joints = {name: p - ground for name, p in _nite_joints(model, rotation, origin).items()}
    bend = {
        name: float(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))
        for name, turn in local.items()
    }
    return PosedBody(model, vertices - ground, joints, bend)


def _nite_joints(model: BodyModel, rotation: FloatArray, origin: FloatArray) -> dict[str, FloatArray]:
    index = model.bone_index
    above_skull_base = np.array([0.0, -0.01, 0.08]) * model.stature_m / 1.75
    joints = {
        "head": origin[index["head"]] + rotation[index["head"]] @ above_skull_base,
        "neck": origin[index["neck01"]],
        "torso": origin[index["spine03"]],
    }
    bones = {"shoulder": "upperarm01", "elbow": "lowerarm01", "hip": "upperleg01", "knee": "lowerleg01"}
    for side, word in _SIDES:
        for joint, bone in bones.items():
            joints[f"{word}_{joint}"] = origin[index[f"{bone}.{side}"]]
        wrist, finger = origin[index[f"wrist.{side}"]], origin[index[f"finger3-1.{side}"]]
        joints[f"{word}_hand"] = 0.5 * (wrist + finger)
        joints[f"{word}_foot"] = origin[index[f"foot.{side}"]]
        for joint, above, end in (("hand", "elbow", "wrist"), ("foot", "knee", "foot")):
            share = model.stumps.get(f"{word}_{joint}")
            if share is not None:
                start = joints[f"{word}_{above}"]
                joints[f"{word}_{joint}"] = start + share * (origin[index[f"{end}.{side}"]] - start)
    return joints
