"""Bodies of capsules before a small camera: surfaces whose every place is known in any posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.capture import PinholeCamera
from core.relocation.bones import Bone
from core.relocation.registration.graph import DeformationGraph, build_graph, skin_net
from core.relocation.registration.patches import SkinOwners
from core.relocation.registration.start import SkeletonStart
from core.surface import BodySurface

CAMERA = PinholeCamera(160, 120, 144.0, 144.0, 79.5, 59.5)
"""A pixel is about a centimetre of skin at 1.5 m."""


@dataclass(frozen=True, eq=False)
class Capsule:
    """All places nearer than `radius` to the segment from `start` to `end`."""

    start: np.ndarray
    end: np.ndarray
    radius: float

    def distance(self, points: np.ndarray) -> np.ndarray:
        along = self.end - self.start
        share = np.clip((points - self.start) @ along / (along @ along), 0.0, 1.0)
        return np.linalg.norm(points - self.start - share[..., None] * along, axis=-1) - self.radius

    def moved(self, rotation: np.ndarray, shift: np.ndarray) -> Capsule:
        return Capsule(rotation @ self.start + shift, rotation @ self.end + shift, self.radius)


@dataclass(frozen=True, eq=False)
class Arc:
    """A round bar of half length `half`, bent in the picture's plane about its middle, with round ends.

    A place of it is (s along the middle line, angle around it); angle 0 faces the camera.
    """

    middle: np.ndarray
    half: float
    radius: float
    bend_per_m: float

    def line(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places of the middle line (k, 3) and the directions across it in the picture's plane (k, 3)."""
        s = np.asarray(s, float)
        turn = s * self.bend_per_m
        if abs(self.bend_per_m) < 1e-9:
            x, y = s, np.zeros_like(s)
        else:
            x, y = np.sin(turn) / self.bend_per_m, (1.0 - np.cos(turn)) / self.bend_per_m
        across = np.stack([-np.sin(turn), np.cos(turn), np.zeros_like(s)], axis=-1)
        return self.middle + np.stack([x, y, np.zeros_like(s)], axis=-1), across

    def place(self, s: np.ndarray, angle: np.ndarray) -> np.ndarray:
        line, across = self.line(s)
        toward = np.array([0.0, 0.0, -1.0])
        return line + self.radius * (np.cos(angle)[..., None] * toward + np.sin(angle)[..., None] * across)

    def distance(self, points: np.ndarray) -> np.ndarray:
        x, y = points[..., 0] - self.middle[0], points[..., 1] - self.middle[1]
        bend = self.bend_per_m
        s = x if abs(bend) < 1e-9 else np.arctan2(bend * x, 1.0 - bend * y) / bend
        nearest, _ = self.line(np.clip(s, -self.half, self.half))
        return np.linalg.norm(points - nearest, axis=-1) - self.radius


def surface_of(
    parts: Sequence[Capsule | Arc], camera: PinholeCamera = CAMERA, hidden: np.ndarray | None = None
) -> BodySurface:
    """What the camera sees of the parts; `hidden` (h, w) bool are pixels without measurement."""
    rays = camera.pixel_rays
    length = np.linalg.norm(rays, axis=-1)
    t = np.full(rays.shape[:2], 0.3)
    near = np.full(rays.shape[:2], np.inf)
    for _ in range(80):
        near = np.min([part.distance(t[..., None] * rays) for part in parts], axis=0)
        t = np.minimum(t + near / length, 6.0)
    depth = np.where(near < 1e-4, t, 0.0)
    if hidden is not None:
        depth = np.where(hidden, 0.0, depth)
    return BodySurface.from_depth(depth, camera)


def turn(axis: Sequence[float], degrees: float) -> np.ndarray:
    """Rotation (3, 3) about an axis."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def still_bone(name: str, capsule: Capsule, parent: int | None = None) -> Bone:
    """A capsule's bone that does not move."""
    return Bone(name, capsule.start, capsule.end, capsule.radius, np.eye(3), capsule.start, parent)


def moved_bone(
    name: str, capsule: Capsule, rotation: np.ndarray, shift: np.ndarray, parent: int | None = None
) -> Bone:
    """A capsule's bone, with the motion that takes x to rotation x + shift."""
    return Bone(
        name, capsule.start, capsule.end, capsule.radius, rotation, rotation @ capsule.start + shift, parent
    )


def near_to(surface: BodySurface, part: Capsule | Arc, within_m: float = 0.004) -> np.ndarray:
    """Vertices of the surface that lie on a part, off the rim."""
    return np.flatnonzero((np.abs(part.distance(surface.vertices)) < within_m) & ~surface.boundary)


def start_on(surface: BodySurface, bones: tuple[Bone, ...]) -> SkeletonStart:
    """Skin of a surface that bones carry."""
    net = skin_net(surface)
    return SkeletonStart(bones, SkinOwners(bones, net.places, net.edges))


def graph_on(
    surface: BodySurface, bones: tuple[Bone, ...], *, spacing_m: float = 0.045, seed: int = 0
) -> DeformationGraph:
    """The deformation graph of a surface."""
    return build_graph(skin_net(surface), start_on(surface, bones).owners, spacing_m=spacing_m, seed=seed)
