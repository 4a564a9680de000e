"""From landmarks in pixels to joint centres in space.

A landmark lies on the skin in front of its joint. The depth under it is taken from a small patch of the
body's surface, never from a single pixel (at silhouettes that hits the wall behind). Where one limb lies in
front of another, the layer that makes plausible bones is chosen. Where a limb points at the camera, a small
error in the picture is a large one in depth: elbow and knee are then moved along the limb until its two bones
are in proportion. The joint centre is a little deeper than the skin, along the ray.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from core.anchors.covariance import OTHER_LAYER, lifted_covariance
from core.anchors.names import EXTRA_NAMES, JOINT_NAMES, LANDMARK_NAMES, LIMBS
from core.anchors.skeleton import VISIBLE, Joint, JointSource, PoseLandmarks, Skeleton
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.surface import BodySurface

FloatArray = NDArray[np.float64]

INTERIOR_M: Final[dict[str, float]] = {
    "head": 0.10,
    "neck": 0.05,
    "torso": 0.10,
    "shoulder": 0.05,
    "elbow": 0.035,
    "hand": 0.015,
    "hip": 0.115,
    "knee": 0.05,
    "foot": 0.035,
}
"""Skin to joint centre along the viewing ray, metres (tuned on rendered adults)."""

BONE_RANGE_M: Final[dict[str, tuple[float, float]]] = {
    "elbow": (0.14, 0.36),
    "hand": (0.14, 0.40),
    "knee": (0.22, 0.56),
    "foot": (0.20, 0.54),
}
"""Lengths of the bone that ends in this joint, from a child's to a tall adult's."""

PATCH_M: Final = 0.02
"""Radius of the patch under a landmark."""

LAYER_GAP_M: Final = 0.06
"""A jump in depth that separates two limbs in one patch."""

REACH_M: Final = 0.06
"""How far beside the body's outline a landmark may fall and still be placed on it."""

PERCENTILE: Final = 20.0
"""Of the depths in a patch: the near side of a limb, not its receding flank."""

NECK_PERCENTILE: Final = 70.0
"""At the neck the near side is the chin."""

PROPORTION: Final[dict[str, float]] = {"elbow": 0.475, "knee": 0.50}
"""Near bone's share of a limb (shoulder, elbow, middle of the hand; hip, knee, ankle)."""

PROPORTION_SIGMA: Final = 0.04
LANDMARK_SIGMA_M: Final = 0.02
"""Spread of a landmark across the picture."""


def interior_m(joint: str) -> float:
    """Depth of a joint centre under the skin; 0 for landmarks on the skin."""
    return (
        INTERIOR_M.get(joint.removeprefix("left_").removeprefix("right_"), 0.0)
        if joint in JOINT_NAMES
        else 0.0
    )


@dataclass(frozen=True)
class Sight:
    """The camera whose pixels the landmarks are in."""

    camera: PinholeCamera
    camera_from_depth: RigidTransform

    @classmethod
    def of(cls, rig: CameraRig, source: JointSource) -> Sight:
        """The colour camera for joints from colour, else the depth camera."""
        if source == "color":
            return cls(rig.picture_camera, rig.picture_from_depth)
        return cls(rig.depth, RigidTransform())

    def points(self, pixel: FloatArray, depths: FloatArray) -> FloatArray:
        """Points (k, 3) in the depth-camera frame on the rays of pixels, at depths (k,) along the axis.

        ``pixel`` is one pixel (2,) or one for each depth (k, 2).
        """
        return self.camera_from_depth.inverse().apply(np.asarray(depths)[:, None] * self.camera.rays(pixel))


@dataclass(frozen=True, eq=False)
class _Spot:
    """A named place in the picture with the depths its surface may have."""

    pixel: FloatArray
    visibility: float
    depths: FloatArray
    shares: FloatArray

    def ambiguity_m(self, chosen: float) -> float:
        """Root of the expected square of the error, should another layer be the right one."""
        return float(np.sqrt(OTHER_LAYER * (self.shares @ (self.depths - chosen) ** 2)))


def picture_joints(landmarks: PoseLandmarks, camera: PinholeCamera) -> dict[str, tuple[FloatArray, float]]:
    """The 15 joints and the extra landmarks as (pixel, visibility), from the 33 landmarks.

    A landmark outside the image counts as not seen: the tracker invents limbs there.
    """
    inside = camera.contains(landmarks.pixels)
    seen = np.where(inside, landmarks.visibility, 0.0)

    def mean(*names: str) -> tuple[FloatArray, float]:
        rows = [LANDMARK_NAMES.index(name) for name in names]
        return landmarks.pixels[rows].mean(0), float(seen[rows].min())

    head, shoulders = mean("left_ear", "right_ear"), mean("left_shoulder", "right_shoulder")
    hips = mean("left_hip", "right_hip")
    out: dict[str, tuple[FloatArray, float]] = {
        "head": head,
        "neck": (shoulders[0] + 0.15 * (head[0] - shoulders[0]), shoulders[1]),
        # with the hips below the image the trunk's middle is extrapolated
        "torso": ((shoulders[0] + hips[0]) / 2, shoulders[1] * (1.0 if hips[1] >= 0.5 else 0.8)),
    }
    for side in ("left_", "right_"):
        for joint in ("shoulder", "elbow", "hip", "knee"):
            out[side + joint] = mean(side + joint)
        wrist = mean(side + "wrist")
        hand = mean(side + "wrist", side + "pinky", side + "index")
        out[side + "hand"] = hand if hand[1] > 0 else (hand[0], 0.0)
        out[side + "foot"] = mean(side + "ankle")
        out[side + "wrist"] = wrist
    for name in EXTRA_NAMES:
        if name not in out:
            out[name] = mean(name)
    return {
        name: (pixel, visibility if bool(camera.contains(pixel)[0]) else 0.0)
        for name, (pixel, visibility) in out.items()
    }


_SPREAD_OF: Final[dict[str, tuple[str, ...]]] = {
    "head": ("left_ear", "right_ear"),
    "neck": ("left_shoulder", "right_shoulder"),
    "torso": ("left_shoulder", "right_shoulder", "left_hip", "right_hip"),
    "left_hand": ("left_wrist", "left_pinky", "left_index"),
    "right_hand": ("right_wrist", "right_pinky", "right_index"),
    "left_foot": ("left_ankle",),
    "right_foot": ("right_ankle",),
}
"""Landmarks of the joints that are not landmarks themselves."""


def picture_spreads(landmarks: PoseLandmarks) -> dict[str, float]:
    """How far the looks at each joint differ, pixels along one axis; a joint's landmarks err together."""
    if landmarks.spread_px is None:
        return {}
    return {
        name: float(
            np.mean([landmarks.spread_px[LANDMARK_NAMES.index(n)] for n in _SPREAD_OF.get(name, (name,))])
        )
        for name in (*JOINT_NAMES, *EXTRA_NAMES)
    }


def lift(landmarks: PoseLandmarks, source: JointSource, rig: CameraRig, surface: BodySurface) -> Skeleton:
    """Skeleton in the depth-camera frame from landmarks in pixels.

    Parameters
    ----------
    landmarks : PoseLandmarks
        Pixels of the colour picture (source "color") or of the depth image (source "relief").
    source : {"color", "relief"}
    rig : CameraRig
    surface : BodySurface
        The body alone: no wall, no second person.
    """
    sight = Sight.of(rig, source)
    patches = _Patches(sight, surface)
    places = picture_joints(landmarks, sight.camera)
    spots = {
        name: patches.spot(pixel, visibility, NECK_PERCENTILE if name == "neck" else PERCENTILE)
        for name, (pixel, visibility) in places.items()
    }
    chosen = {name: int(np.argmax(spot.shares)) for name, spot in spots.items()}
    seen = dict(spots)
    for limb in LIMBS:
        chosen.update(_plausible_limb(limb, spots, sight, chosen))
        if all(spots[name].visibility >= VISIBLE for name in limb):
            spots[limb[1]] = _proportioned(limb, spots, chosen, patches)
            chosen[limb[1]] = 0
    joints: dict[str, Joint] = {}
    extras: dict[str, Joint] = {}
    spreads = picture_spreads(landmarks)
    origin = sight.camera_from_depth.inverse().translation
    for name, spot in spots.items():
        skin = float(spot.depths[chosen[name]])
        point = sight.points(spot.pixel, np.array([skin + interior_m(name)]))[0]
        pixel = rig.project_to_picture(point)[0]
        covariance = lifted_covariance(
            name,
            point - origin,
            visibility=spot.visibility,
            spread_m=spreads.get(name, 0.0) * skin / patches.focal,
            patch_m=patches.depth_spread_m(spot.pixel, skin),
            ambiguity_m=seen[name].ambiguity_m(skin),
            relief=source == "relief",
        )
        joint = Joint(name, point, pixel, spot.visibility, source, covariance)
        (joints if name in JOINT_NAMES else extras)[name] = joint
    return Skeleton(joints, extras, source)


class _Patches:
    """Looks up the surface under pixels of a camera."""

    def __init__(self, sight: Sight, surface: BodySurface) -> None:
        self.sight = sight
        in_camera = sight.camera_from_depth.apply(surface.vertices)
        pixels = sight.camera.project(in_camera)
        ok = np.isfinite(pixels).all(1)
        self._pixels, self._depth = pixels[ok], in_camera[ok, 2]
        self._tree = cKDTree(self._pixels)
        self.focal = (sight.camera.fx + sight.camera.fy) / 2

    def around(self, pixel: FloatArray, radius_m: float, depth: float) -> tuple[FloatArray, FloatArray]:
        """Pixels (k, 2) and depths (k,) of the surface around a pixel, in the layer that has this depth."""
        rows = np.asarray(self._tree.query_ball_point(pixel, radius_m * self.focal / depth), dtype=int)
        rows = rows[np.argsort(self._depth[rows])]
        cuts = np.flatnonzero(np.diff(self._depth[rows]) > LAYER_GAP_M) + 1
        layers = [layer for layer in np.split(rows, cuts) if len(layer)]
        if not layers:
            return np.zeros((0, 2)), np.zeros(0)
        layer = min(layers, key=lambda k: float(np.abs(self._depth[k] - depth).min()))
        return self._pixels[layer], self._depth[layer]

    def depth_spread_m(self, pixel: FloatArray, depth: float) -> float:
        """Standard deviation of the depths under a pixel in its layer; the patch's radius without a layer."""
        _, depths = self.around(pixel, PATCH_M, depth)
        return float(np.std(depths)) if len(depths) >= 5 else PATCH_M

    def metres_apart(self, pixels: FloatArray, pixel: FloatArray, depth: float) -> FloatArray:
        """Distances across the picture, in metres at a depth."""
        return np.asarray(np.linalg.norm(pixels - pixel, axis=1) * depth / self.focal)

    def spot(self, pixel: FloatArray, visibility: float, percentile: float = PERCENTILE) -> _Spot:
        """Depths of the layers of skin under a pixel; beside the body the nearest outline serves."""
        distance, nearest = self._tree.query(pixel)
        per_metre = self.focal / self._depth[nearest]
        rows = np.asarray(self._tree.query_ball_point(pixel, PATCH_M * per_metre), dtype=int)
        if len(rows) < 5:
            visibility *= 0.8 if distance < REACH_M * per_metre else 0.0
            rows = np.asarray(
                self._tree.query_ball_point(self._pixels[nearest], PATCH_M * per_metre), dtype=int
            )
        depth = np.sort(self._depth[rows])
        layers = np.split(depth, np.flatnonzero(np.diff(depth) > LAYER_GAP_M) + 1)
        kept = [layer for layer in layers if len(layer) >= 0.08 * len(depth)]
        return _Spot(
            pixel,
            visibility,
            np.array([np.percentile(layer, percentile) for layer in kept]),
            np.array([len(layer) for layer in kept]) / len(depth),
        )


class SkinUnder:
    """Where a joint could be under a pixel of the picture.

    Parameters
    ----------
    rig : CameraRig
    surface : BodySurface
    """

    def __init__(self, rig: CameraRig, surface: BodySurface) -> None:
        self._sight = Sight.of(rig, "color")
        self._patches = _Patches(self._sight, surface)

    def layers(self, name: str, pixel: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Joint centres (k, 3) behind each layer of skin under a pixel, and the layers' shares (k,).

        Empty if the pixel is not on the body, or farther than `REACH_M` beside its outline.
        """
        percentile = NECK_PERCENTILE if name == "neck" else PERCENTILE
        spot = self._patches.spot(pixel, 1.0, percentile)
        if spot.visibility == 0.0:
            return np.zeros((0, 3)), np.zeros(0)
        return self._sight.points(pixel, spot.depths + interior_m(name)), spot.shares


def _plausible_limb(
    limb: tuple[str, str, str], spots: dict[str, _Spot], sight: Sight, chosen: dict[str, int]
) -> dict[str, int]:
    """Layer of the middle and the far joint of a limb such that both bones have a possible length."""
    near, middle, far = limb
    root = sight.points(spots[near].pixel, spots[near].depths[[chosen[near]]] + interior_m(near))[0]
    knots = sight.points(spots[middle].pixel, spots[middle].depths + interior_m(middle))
    ends = sight.points(spots[far].pixel, spots[far].depths + interior_m(far))
    best = (np.inf, 0, 0)
    for i, k in product(range(len(knots)), range(len(ends))):
        cost = (
            bone_cost(middle, float(np.linalg.norm(knots[i] - root)))
            + bone_cost(far, float(np.linalg.norm(ends[k] - knots[i])))
            - np.log(spots[middle].shares[i])
            - np.log(spots[far].shares[k])
        )
        best = min(best, (float(cost), i, k))
    return {middle: best[1], far: best[2]}


def _proportioned(
    limb: tuple[str, str, str], spots: dict[str, _Spot], chosen: dict[str, int], patches: _Patches
) -> _Spot:
    """Place of elbow or knee given the landmark and the proportion of the limb's two bones.

    The mean over the skin around the landmark, weighted by both normal errors. Across the picture the
    landmark decides; along the line of sight, where it says little, the proportion does.
    """
    near, middle, far = limb
    sight, spot = patches.sight, spots[middle]
    skin = float(spot.depths[chosen[middle]])
    pixels, depths = patches.around(spot.pixel, 3 * LANDMARK_SIGMA_M, skin)
    alone = _Spot(spot.pixel, spot.visibility, np.array([skin]), np.ones(1))
    if len(pixels) < 20:
        return alone
    ends = [
        sight.points(spots[n].pixel, spots[n].depths[[chosen[n]]] + interior_m(n))[0] for n in (near, far)
    ]
    knots = sight.points(pixels, depths + interior_m(middle))
    upper, lower = (np.linalg.norm(knots - end, axis=1) for end in ends)
    expected = PROPORTION[middle.split("_")[1]]
    cost = ((upper / (upper + lower) - expected) / PROPORTION_SIGMA) ** 2
    cost += (patches.metres_apart(pixels, spot.pixel, skin) / LANDMARK_SIGMA_M) ** 2
    weight = np.exp(-(cost - cost.min()) / 2)
    weight /= weight.sum()
    pixel = weight @ pixels
    _, patch = patches.around(pixel, PATCH_M, float(weight @ depths))
    if len(patch) < 5:
        return alone
    return _Spot(pixel, spot.visibility, np.array([np.percentile(patch, PERCENTILE)]), np.ones(1))


def bone_cost(end: str, length: float) -> float:
    """How impossible a length (metres) is for the bone that ends in this joint of a limb; 0 if possible."""
    low, high = BONE_RANGE_M[end.split("_")[1]]
    outside = max(low - length, length - high, 0.0)
    return (outside / 0.03) ** 2


def recorded_skeleton(
    joints_m: dict[str, FloatArray], rig: CameraRig, surface: BodySurface, *, reach_m: float = 0.25
) -> Skeleton:
    """Skeleton from the joints stored with a recording.

    Names outside the 15, and joints without a finite place, are left out. A joint outside the picture, or
    farther than ``reach_m`` from the seen body, is not visible.
    """
    names = [name for name in JOINT_NAMES if name in joints_m and np.isfinite(joints_m[name]).all()]
    if not names:
        return Skeleton({}, source="recording")
    points = np.array([joints_m[name] for name in names], dtype=np.float64)
    pixels = rig.project_to_picture(points)
    inside = rig.picture_camera.contains(pixels)
    near = cKDTree(surface.vertices).query(points)[0] < reach_m
    return Skeleton(
        {
            name: Joint(name, points[i], pixels[i], float(inside[i] and near[i]), "recording")
            for i, name in enumerate(names)
        },
        source="recording",
    )


def relifted(joint: Joint, point_m: FloatArray, rig: CameraRig, visibility: float) -> Joint:
    """The joint at another point, its picture pixel brought along."""
    return replace(joint, point_m=point_m, pixel=rig.project_to_picture(point_m)[0], visibility=visibility)
