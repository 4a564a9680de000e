"""From a capture to the patient's skin."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import RgbdCapture
from core.capture.sensors import SensorModel, sensor_of
from core.progress import Progress, no_progress
from core.surface.body_surface import BodySurface
from core.surface.denoise import denoise_depth
from core.surface.fusion import FusedDepth, fuse_depth
from core.surface.segmentation import BodyMask, segment_body
from core.surface.skin_tone import SkinTone, measure_skin_tone

FloatArray = NDArray[np.float64]

_HEAD_GUESS_M = 0.12


@dataclass(frozen=True, eq=False)
class BodyScan:
    """A capture and the skin found in it.

    Attributes
    ----------
    capture : RgbdCapture
    fused : FusedDepth
        All frames in one, the whole scene.
    mask : BodyMask
    surface : BodySurface
        Of the denoised depth inside the mask.
    warnings : tuple of str
    depth_noise_m : float
        Standard deviation of one measurement on the body, median.
    body_coverage : float
        Share of the body's outline in which depth was measured, 0..1.
    """

    capture: RgbdCapture
    fused: FusedDepth
    mask: BodyMask
    surface: BodySurface
    warnings: tuple[str, ...]
    depth_noise_m: float
    body_coverage: float

    @cached_property
    def vertex_picture_pixels(self) -> FloatArray:
        """Picture pixel (n, 2) of every vertex of the surface."""
        return self.capture.rig.project_to_picture(self.surface.vertices)

    @cached_property
    def skin_tone(self) -> SkinTone | None:
        """The person's own skin colour; None without enough of it."""
        return measure_skin_tone(self.capture, self.vertex_picture_pixels)

    def prepare_clicks(self) -> None:
        """Compute what clicks need now, so that the first one is as fast as the others."""
        _ = self.skin_tone, self.surface.tree

    @cached_property
    def head_m(self) -> FloatArray | None:
        """Roughly the centre of the head: recorded, or guessed by `guess_head`."""
        return guess_head(self.capture, self.surface)


def scan_body(capture: RgbdCapture, *, progress: Progress = no_progress) -> BodyScan:
    """Fuse the frames, find the patient, smooth and triangulate the skin.

    Raises
    ------
    WorkError
        If no body is found.
    Cancelled
        Through ``progress``.
    """
    camera = capture.rig.depth
    progress(0.0, "Fusing depth frames")
    sensor, known = sensor_of(capture.sensor)
    fused = fuse_depth(capture.depth_frames, capture.depth_unit_m)
    progress(0.3, "Finding the body")
    mask = segment_body(fused.depth_m, camera)
    progress(0.6, "Smoothing the skin")
    raw = np.where(_trimmed(mask.mask, sensor.smoothing.trim_px), fused.depth_m, 0.0)
    gate = denoising_gate(sensor, raw, fused.frames)
    smooth = raw
    for _ in range(sensor.smoothing.passes):
        smooth = denoise_depth(smooth, sigma_px=sensor.smoothing.window_px, gate_m=gate)
    progress(0.8, "Building the surface")
    surface = BodySurface.from_depth(smooth, camera)
    noise = _noise(fused, raw)
    coverage = _coverage(mask.mask)
    warnings = list(mask.warnings)
    if capture.sensor and not known:
        warnings.append(
            f"The depth sensor '{capture.sensor}' is not known; it was taken to be as noisy as a Kinect v1."
        )
    if coverage < 0.85:
        warnings.append(
            f"Only {coverage:.0%} of the body's outline was measured; dark, shiny or steep parts are missing."
        )
    scan = BodyScan(capture, fused, mask, surface, tuple(warnings), noise, coverage)
    scan.prepare_clicks()
    progress(1.0, "Skin surface ready")
    return scan


def denoising_gate(sensor: SensorModel, raw: FloatArray, frames: int) -> float:
    """Depth difference in metres beyond which neighbours in a masked image (h, w) do not belong together."""
    gate, sigmas = sensor.smoothing.gate_m, sensor.smoothing.gate_sigmas
    if sigmas > 0 and (raw > 0).any():
        gate = max(gate, sigmas * float(sensor.fused_sigma(float(np.median(raw[raw > 0])), frames)))
    return gate


def _trimmed(mask: NDArray[np.bool_], rim_px: int) -> NDArray[np.bool_]:
    if rim_px == 0:
        return mask
    window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * rim_px + 1, 2 * rim_px + 1))
    return np.asarray(cv2.erode(mask.astype(np.uint8), window) > 0)


def _noise(fused: FusedDepth, raw: FloatArray) -> float:
    """Noise of a single measurement: from the frames, or with one frame from its second differences.

    Second differences of a smooth surface are all noise, with six times its variance; larger ones are edges.
    """
    on = raw > 0
    measured = fused.noise_m[on]
    measured = measured[np.isfinite(measured)]
    if len(measured):
        # A few frames of coarsely stepped depth are equal at most pixels; the others then tell the noise.
        return float(np.median(measured) or np.sqrt(np.mean(measured**2)))
    bend = raw[:, 2:] - 2.0 * raw[:, 1:-1] + raw[:, :-2]
    inner = on[:, 2:] & on[:, 1:-1] & on[:, :-2] & (np.abs(bend) < 0.1)
    return float(np.sqrt(np.mean(bend[inner] ** 2) / 6.0)) if inner.any() else 0.0


def _coverage(mask: NDArray[np.bool_]) -> float:
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 9))
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, kernel)
    outlines, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(closed), outlines, -1, 1, cv2.FILLED)
    return float(mask.sum() / max(1, int(filled.sum())))


def guess_head(capture: RgbdCapture, surface: BodySurface) -> FloatArray | None:
    """Centre of the head: recorded, or below the top of the outline over the middle of the body.

    None when the body is cut at the top, where the outline says nothing.
    """
    recorded = capture.joints_m
    if recorded and "head" in recorded:
        return recorded["head"]
    main = surface.component == 0
    vertices, pixels = surface.vertices[main], surface.pixels[main]
    beside = np.abs(vertices[:, 0] - np.median(vertices[:, 0])) < 0.15
    if not beside.any() or pixels[beside, 1].min() < 6:
        return None
    column = vertices[beside]
    top = np.percentile(column[:, 1], 0.5)
    cap = column[column[:, 1] < top + 2 * _HEAD_GUESS_M]
    center = np.median(cap, axis=0)
    return np.array([center[0], top + _HEAD_GUESS_M, center[2] + 0.08])
