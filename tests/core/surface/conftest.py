"""A room with people made of ellipsoids, seen by a noisy depth camera: exact truth, no files."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from core.capture import CameraRig, PinholeCamera, RgbdCapture, RigidTransform

SKIN = (205, 150, 125)
SHIRT = (40, 70, 140)
HAIR = (35, 25, 20)
WALL = (150, 155, 150)

DEPTH = PinholeCamera(320, 240, 288.0, 288.0, 159.5, 119.5)
COLOR = PinholeCamera(400, 300, 328.0, 328.0, 199.5, 149.5)
RIG = CameraRig(DEPTH, COLOR, RigidTransform(np.eye(3), np.array([-0.025, 0.0, 0.0])))


@dataclass(frozen=True)
class Part:
    """An ellipsoid with a colour; half-axes in metres, axis 1 turned towards ``along``."""

    center: tuple[float, float, float]
    half: tuple[float, float, float]
    along: tuple[float, float, float] = (0.0, 1.0, 0.0)
    color: tuple[int, int, int] = SKIN


def person(x: float = 0.0, z: float = 2.5, *, shirt: bool = False, top: float = -0.75) -> list[Part]:
    """A standing person with spread arms, camera at chest height, 1.7 m tall below ``top``."""
    trunk = SHIRT if shirt else SKIN
    parts = [
        Part((x, top + 0.11, z), (0.08, 0.12, 0.09)),
        Part((x, top + 0.02, z + 0.015), (0.085, 0.07, 0.09), color=HAIR),
        Part((x, top + 0.28, z), (0.06, 0.10, 0.06)),
        Part((x, top + 0.60, z), (0.19, 0.36, 0.11), color=trunk),
        Part((x, top + 0.90, z), (0.17, 0.16, 0.11), color=trunk),
    ]
    for s in (-1.0, 1.0):
        parts += [
            Part((x + s * 0.28, top + 0.45, z), (0.05, 0.20, 0.05), (s * 0.8, 0.6, 0.0)),
            Part((x + s * 0.50, top + 0.63, z), (0.04, 0.19, 0.04), (s * 0.75, 0.66, 0.0)),
            Part((x + s * 0.10, top + 1.20, z), (0.08, 0.32, 0.08)),
            Part((x + s * 0.11, top + 1.52, z), (0.055, 0.24, 0.055)),
        ]
    return parts


def _hit(part: Part, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Ray parameter of the first hit, inf where missed."""
    axis = np.array(part.along) / np.linalg.norm(part.along)
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side = side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-6 else np.array([1.0, 0.0, 0.0])
    frame = np.stack([side, axis, np.cross(side, axis)]) / np.array(part.half)[:, None]
    d, o = rays @ frame.T, frame @ (origin - part.center)
    a, b, c = (d * d).sum(-1), (d * o).sum(-1), o @ o - 1.0
    root = b * b - a * c
    t = (-b - np.sqrt(np.maximum(root, 0.0))) / a
    return np.where((root > 0) & (t > 0), t, np.inf)


@dataclass(frozen=True)
class Scene:
    """What is in the room; planes are ``normal . p = distance`` in the depth frame."""

    parts: Sequence[Part]
    planes: Sequence[tuple[tuple[float, float, float], float]] = ()

    def trace(self, origin: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ray parameter (inf = nothing) and part index (-1 = room or nothing)."""
        best, index = np.full(rays.shape[:-1], np.inf), np.full(rays.shape[:-1], -1)
        for normal, distance in self.planes:
            along = rays @ np.array(normal)
            t = (distance - origin @ np.array(normal)) / np.where(np.abs(along) > 1e-9, along, 1e-9)
            best = np.where((t > 0) & (t < best), t, best)
        for i, part in enumerate(self.parts):
            t = _hit(part, origin, rays)
            index = np.where(t < best, i, index)
            best = np.minimum(best, t)
        return best, index

    def true_depth(self) -> tuple[np.ndarray, np.ndarray]:
        """Exact depth (0 = nothing) and part index in the depth camera."""
        t, index = self.trace(np.zeros(3), DEPTH.pixel_rays)
        return np.where(t < 8.0, t, 0.0), np.where(t < 8.0, index, -1)

    def capture(
        self, frames: int = 4, seed: int = 0, *, color: bool = True, noise: float = 1.0
    ) -> RgbdCapture:
        """What a Kinect-like camera records: noise grows with the square of depth."""
        rng = np.random.default_rng(seed)
        z, _ = self.true_depth()
        sigma = noise * (0.0012 + 0.0019 * np.maximum(z - 0.4, 0.0) ** 2)
        noisy = z + sigma * rng.standard_normal((frames, *z.shape))
        raw = np.where(z > 0, np.clip(noisy, 0.3, 10.0), 0.0)
        raw = np.rint(raw * 1000).astype(np.uint16)
        if not color:
            return RgbdCapture(raw, 0.001, CameraRig(DEPTH))
        origin, rays = RIG.picture_rays(_grid(COLOR))
        _, index = self.trace(origin, rays)
        colors = np.array([part.color for part in self.parts] + [WALL])[index]
        picture = colors.reshape(COLOR.height, COLOR.width, 3) + rng.normal(
            0, 3, (COLOR.height, COLOR.width, 1)
        )
        return RgbdCapture(raw, 0.001, RIG, np.clip(picture, 0, 255).astype(np.uint8))


def _grid(camera: PinholeCamera) -> np.ndarray:
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    return np.stack([u.ravel(), v.ravel()], axis=1)


FLOOR = ((0.0, 1.0, 0.0), 1.02)
BACK_WALL = ((0.15, 0.0, 0.98869), 3.4)


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., Scene]:
    return Scene


@pytest.fixture(scope="session")
def make_person() -> Callable[..., list[Part]]:
    return person


@pytest.fixture(scope="session")
def make_part() -> Callable[..., Part]:
    return Part


@pytest.fixture(scope="session")
def room() -> list[tuple[tuple[float, float, float], float]]:
    return [FLOOR, BACK_WALL]


@pytest.fixture(scope="session")
def depth_camera() -> PinholeCamera:
    return DEPTH


@pytest.fixture(scope="session")
def real_recordings() -> Path:
    folder = Path(__file__).parents[4] / "shared" / "real"
    if not folder.is_dir():
        pytest.skip("the real recordings are not beside the project")
    return folder
