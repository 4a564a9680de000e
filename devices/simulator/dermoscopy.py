"""Simulated dermoscopic images: what a dermatoscope would show of a lesion. Texture, not pathology."""

from __future__ import annotations

from io import BytesIO

import cv2
import numpy as np
from numpy.typing import NDArray

from devices.simulator.skin import linear

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]

FIELD_MM = 16.0
"""Width of skin that the picture shows."""

_CLEAR_RADIUS = 0.485
_SCALE_MM = 10


def _noise(rng: np.random.Generator, size: int, wavelength_px: float) -> Image:
    """Smooth unit-variance noise (size, size) of about this wavelength."""
    coarse = max(4, int(np.ceil(size / wavelength_px * 3)))
    grid = rng.standard_normal((coarse, coarse)).astype(np.float32)
    field = cv2.resize(cv2.GaussianBlur(grid, (0, 0), 0.9), (size, size), interpolation=cv2.INTER_CUBIC)
    return np.asarray((field - field.mean()) / field.std(), np.float32)


def _network(rng: np.random.Generator, x: Image, y: Image, pitch_mm: float) -> Image:
    """Pigment network: dark lines 0..1 around the holes of a jittered hexagonal grid, at places in mm."""
    size = x.shape[0]
    warp = 0.45 * pitch_mm
    px = x + warp * _noise(rng, size, size / 14)
    py = y + warp * _noise(rng, size, size / 14)
    k = 2 * np.pi / pitch_mm
    angles = np.deg2rad((0.0, 60.0, 120.0))
    waves = sum(np.cos(k * (np.cos(a) * px + np.sin(a) * py)) for a in angles)
    lines = np.clip(0.55 - np.asarray(waves) / 3.0, 0.0, 1.0)
    return np.asarray(lines**1.5, np.float32)


def _outline(rng: np.random.Generator, x: Image, y: Image, radius_mm: float, irregular: float) -> Image:
    """Distance from the middle as a share of the distance of the edge in that direction (1 on the edge)."""
    angle = np.arctan2(y, x)
    edge = np.ones_like(x)
    for order in (2, 3, 4, 5, 7, 9):
        phase = rng.uniform(0, 2 * np.pi)
        edge += irregular * rng.normal() / order**0.7 * np.cos(order * angle + phase)
    return np.asarray(np.hypot(x, y) / (radius_mm * np.clip(edge, 0.4, 1.8)), np.float32)


def _draw_hairs(rng: np.random.Generator, picture: Image, per_mm: float) -> None:
    size = picture.shape[0]
    for _ in range(int(rng.integers(2, 7))):
        start, heading = rng.uniform(0, size, 2), rng.uniform(0, 2 * np.pi)
        steps = np.arange(0.0, rng.uniform(0.4, 0.9) * size, 6.0)
        bend = heading + rng.normal(0, 0.0022) * steps
        line = start + np.cumsum(6.0 * np.stack([np.cos(bend), np.sin(bend)], axis=1), axis=0)
        mask = np.zeros((size, size), np.float32)
        thickness = max(1, round(float(rng.uniform(0.05, 0.09)) * per_mm))
        cv2.polylines(mask, [np.rint(line * 8).astype(np.int32)], False, 1.0, thickness, cv2.LINE_AA, 3)
        picture += 0.85 * mask[..., None] * (linear((0.20, 0.14, 0.10)).astype(np.float32) - picture)


def _draw_scale(picture: Image, per_mm: float) -> None:
    """A millimetre scale of ten divisions at the lower edge, as dermatoscopes etch it into the glass."""
    size = picture.shape[0]
    left, level = round(size / 2 - _SCALE_MM / 2 * per_mm), round(0.90 * size)
    ink = (0.02, 0.02, 0.02)
    width = max(1, size // 512)
    cv2.line(picture, (left, level), (left + round(_SCALE_MM * per_mm), level), ink, width, cv2.LINE_AA)
    for k in range(_SCALE_MM + 1):
        tall = round((0.55 if k % 5 == 0 else 0.3) * per_mm)
        u = left + round(k * per_mm)
        cv2.line(picture, (u, level), (u, level - tall), ink, width, cv2.LINE_AA)


def render_dermoscopy(
    lesion_seed: list[int],
    visit_seed: list[int],
    *,
    radius_mm: float,
    skin: FloatArray,
    color: FloatArray,
    irregular: float = 0.08,
    size: int = 1024,
) -> NDArray[np.uint8]:
    """Polarised dermoscopic picture (size, size, 3) of a pigmented lesion.

    Parameters
    ----------
    lesion_seed : list of int
        Fixes outline, network and globules: the same lesion at every visit.
    visit_seed : list of int
        Fixes how the instrument was held, the light and the hairs.
    radius_mm : float
        Mean radius of the lesion.
    skin, color : ndarray (3,)
        Linear reflectance of the skin and of the pigment.
    irregular : float
        Of the outline, as a share of the radius.
    """
    lesion, visit = np.random.default_rng(lesion_seed), np.random.default_rng(visit_seed)
    per_mm = size / FIELD_MM
    u, v = np.meshgrid(np.arange(size, dtype=np.float32), np.arange(size, dtype=np.float32))
    turn, shift = visit.normal(0.0, 0.25), visit.normal(0.0, 0.5, 2)
    du, dv = (u - (size - 1) / 2) / per_mm - shift[0], (v - (size - 1) / 2) / per_mm - shift[1]
    x = np.asarray(np.cos(turn) * du - np.sin(turn) * dv, np.float32)
    y = np.asarray(np.sin(turn) * du + np.cos(turn) * dv, np.float32)

    ruddy = np.stack([1.06 * skin[0], 0.86 * skin[1], 0.80 * skin[2]]) if skin.ndim == 1 else skin
    picture = np.empty((size, size, 3), np.float32)
    picture[:] = ruddy
    mottle = 0.04 * _noise(visit, size, size / 3) + 0.025 * _noise(visit, size, size / 40)
    picture *= (1.0 + mottle + 0.02 * _noise(visit, size, size / 120))[..., None]
    redness = np.clip(0.06 * _noise(visit, size, size / 9), -0.05, 0.15)
    picture[..., 1:] *= (1.0 - redness)[..., None]

    rho = _outline(lesion, x, y, radius_mm, irregular)
    field = _relative_noise(lesion, x / radius_mm, y / radius_mm)
    inside = 1.0 / (1.0 + np.exp((rho - 1.0 + 0.06 * field) * 14.0))
    network = _network(lesion, x, y, float(lesion.uniform(0.42, 0.58)))
    core = np.exp(-((rho / lesion.uniform(0.45, 0.7)) ** 2))
    pigment = inside * np.clip(0.38 + 0.34 * core + 0.12 * field, 0.1, 0.95)
    pigment += inside * network * np.clip(0.55 * (1.0 - 0.6 * core), 0.0, 1.0)
    for _ in range(int(lesion.integers(6, 26))):
        r, a = 0.92 * np.sqrt(lesion.uniform(0, 1)) * radius_mm, lesion.uniform(0, 2 * np.pi)
        width = lesion.uniform(0.06, 0.16)
        d2 = (x - r * np.cos(a)) ** 2 + (y - r * np.sin(a)) ** 2
        pigment += 0.45 * inside * np.exp(-((d2 / width**2) ** 2))
    absorbed = np.log(np.maximum(color, 0.01) / np.maximum(ruddy, 0.02)).astype(np.float32)
    picture *= np.exp(np.minimum(absorbed, -0.25) * np.clip(pigment, 0.0, 1.6)[..., None])

    _draw_hairs(visit, picture, per_mm)
    radius = np.hypot(u - (size - 1) / 2, v - (size - 1) / 2) / size
    picture *= (1.15 - 0.9 * radius**2)[..., None] * visit.normal(1.0, 0.02, 3).astype(np.float32)
    _draw_scale(picture, per_mm)
    picture *= np.clip((_CLEAR_RADIUS - radius) * size / 6.0, 0.0, 1.0)[..., None]
    srgb = np.power(np.clip(1.25 * picture, 0.0, 1.0), np.float32(1 / 2.2))
    srgb = cv2.GaussianBlur(srgb, (0, 0), 0.7)
    srgb += 0.008 * visit.standard_normal(srgb.shape, dtype=np.float32)
    return np.asarray(np.clip(255.0 * srgb + 0.5, 0, 255), np.uint8)


def _relative_noise(rng: np.random.Generator, x: Image, y: Image) -> Image:
    """Smooth unit noise that moves and grows with the lesion, at places relative to its radius."""
    k, phase = rng.normal(0.0, 3.0, (10, 2)), rng.uniform(0, 2 * np.pi, 10)
    total = sum(np.sin(a * x + b * y + p) for (a, b), p in zip(k, phase, strict=True))
    return np.asarray(np.asarray(total) * np.sqrt(2 / 10), np.float32)


def png_of_simulated(picture: NDArray[np.uint8], description: str) -> bytes:
    """PNG file of a picture whose metadata says that it was simulated."""
    from PIL import Image as PilImage
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    info.add_text("Software", "GeoDerm simulated patient")
    info.add_text("Comment", "Simulated image. Not a patient.")
    info.add_text("Description", description)
    buffer = BytesIO()
    per_metre = round(picture.shape[1] / (FIELD_MM * 1e-3))
    PilImage.fromarray(picture).save(
        buffer, "PNG", pnginfo=info, dpi=(per_metre * 0.0254, per_metre * 0.0254)
    )
    return buffer.getvalue()
