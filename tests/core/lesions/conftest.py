"""A bare trunk before a wall with painted spots, by closed formulas: exact truth, no files."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from core.capture import CameraRig, PinholeCamera, RgbdCapture, RigidTransform

SKIN = (205, 150, 125)
DARK_SKIN = (98, 66, 50)
BROWN = (92, 58, 42)

DEPTH = PinholeCamera(320, 240, 288.0, 288.0, 159.5, 119.5)
CENTER = np.array([0.0, 0.0, 1.6])
HALF = np.array([0.26, 0.50, 0.15])


def color_camera(width: int = 1280) -> PinholeCamera:
    """A colour camera of the depth camera's view, four times as fine at the normal width."""
    scale = width / 320
    height = round(240 * scale)
    return PinholeCamera(width, height, 288.0 * scale, 288.0 * scale, (width - 1) / 2, (height - 1) / 2)


@dataclass(frozen=True)
class Disc:
    """A disc round in the picture: centre and radius in its pixels."""

    u: float
    v: float
    radius: float
    color: tuple[int, int, int] = BROWN


def meet(rays: np.ndarray) -> np.ndarray:
    """Ray parameter at which rays from the origin meet the trunk, inf where they miss."""
    d, o = rays / HALF, -CENTER / HALF
    a, b, c = (d * d).sum(-1), d @ o, o @ o - 1.0
    root = b * b - a * c
    t = (-b - np.sqrt(np.maximum(root, 0.0))) / a
    return np.where(root > 0, t, np.inf)


def paint_disc(image: np.ndarray, disc: Disc) -> None:
    """With soft edges: the covered share of every pixel, to an eighth of a pixel."""
    reach = int(disc.radius) + 3
    u0, v0 = round(disc.u) - reach, round(disc.v) - reach
    fine = (np.arange((2 * reach + 1) * 8) + 0.5) / 8 - 0.5
    inside = np.hypot(fine[None] + u0 - disc.u, fine[:, None] + v0 - disc.v) <= disc.radius
    n = 2 * reach + 1
    share = inside.reshape(n, 8, n, 8).mean(axis=(1, 3))[..., None]
    window = image[v0 : v0 + n, u0 : u0 + n]
    window += share * (np.array(disc.color) - window)


def trunk(
    discs: Sequence[Disc] = (),
    *,
    skin: tuple[int, int, int] = SKIN,
    width: int = 1280,
    light: Sequence[float] = (1.0, 1.0, 1.0),
    cloth: tuple[float, float, tuple[int, int, int]] | None = None,
    lines: Sequence[tuple[float, float, float, float]] = (),
    with_color: bool = True,
    lost_rim_px: int = 0,
    seed: int = 0,
) -> RgbdCapture:
    """A capture of the trunk.

    ``cloth`` is a band (first row, last row, colour) under the discs; ``lines`` are hairs from (u, v) to
    (u, v); ``lost_rim_px`` depth pixels are missing along the outline.
    """
    rng = np.random.default_rng(seed)
    t = meet(DEPTH.pixel_rays)
    body = np.isfinite(t)
    if lost_rim_px:
        body = cv2.erode(body.astype(np.uint8), np.ones((3, 3)), iterations=lost_rim_px) > 0
    depth = np.where(body, t, np.where(np.isfinite(t), 0.0, 2.6)) * 1000.0
    frames = np.stack([depth + rng.normal(0, 1.0, depth.shape) * (depth > 0) for _ in range(4)])
    frames = np.clip(np.rint(frames), 0, 60000).astype(np.uint16)
    if not with_color:
        return RgbdCapture(frames, 0.001, CameraRig(DEPTH))
    camera = color_camera(width)
    rays = camera.pixel_rays
    t = meet(rays)
    place = np.where(np.isfinite(t), t, 0.0)[..., None] * rays
    normal = (place - CENTER) / HALF**2
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    shade = 0.55 + 0.45 * np.clip(normal @ np.array([0.3, -0.4, -0.87]), 0.0, 1.0)
    image = np.tile(np.array(skin, float), (camera.height, camera.width, 1))
    if cloth is not None:
        image[int(cloth[0]) : int(cloth[1])] = cloth[2]
    for disc in discs:
        paint_disc(image, disc)
    image *= shade[..., None]
    image = np.where(np.isfinite(t)[..., None], image, 170.0)
    if lines:
        cover = np.zeros(image.shape[:2], np.float32)
        for ends in lines:
            a, b = (tuple(round(16 * x) for x in end) for end in (ends[:2], ends[2:]))
            cv2.line(cover, a, b, 0.7, 1, cv2.LINE_AA, 4)
        image += cover[..., None] * (np.array([50.0, 38.0, 30.0]) - image)
    image = cv2.GaussianBlur(image, (0, 0), 0.7) * np.array(light)
    image += rng.normal(0, 2.0, image.shape)
    color = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    return RgbdCapture(frames, 0.001, CameraRig(DEPTH, camera, RigidTransform()), color)
