"""What is known of a depth sensor. What it gets wrong in a way of its own (`SensorModel.systematic`) is
one short class for each principle.

All distances are depths along the optical axis in metres.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from hashlib import sha256
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from core.errors import InputError

Image = NDArray[np.float32]
Principle = Literal["structured-light", "time-of-flight", "stereo"]

_STEEPEST = 1.5
_NEAREST_M = 0.1
_WORDS = ("title", "sources", "color_from_depth")


@dataclass(frozen=True)
class Tilt:
    """Noise that a slanted surface adds: ``factor * z**power * a**2 / (pi/2 - a)**2`` beyond ``from_deg``."""

    factor: float
    power: float
    from_deg: float


@dataclass(frozen=True)
class AxialNoise:
    """Standard deviation of one reading: powers of ``z - from_m``, and what a slant adds.

    Attributes
    ----------
    from_m : float
    powers : tuple of float
        Metres for the powers 0, 1, 2 ... of the distance in metres.
    tilt : Tilt or None
    """

    from_m: float
    powers: tuple[float, ...]
    tilt: Tilt | None = None


@dataclass(frozen=True)
class Grain:
    """How the noise of neighbouring pixels hangs together: shares of white and of correlated noise.

    Attributes
    ----------
    white, correlated : float
        Their squares add up to one.
    window_px : float
        Standard deviation of the Gaussian that correlates.
    """

    white: float
    correlated: float
    window_px: float


@dataclass(frozen=True)
class Dropout:
    """Which pixels carry no measurement.

    Attributes
    ----------
    grazing_deg, lost_deg : float
        From the first angle on some pixels are lost, at the second all.
    silhouette, random : float
        Shares lost at depth jumps and anywhere.
    """

    grazing_deg: float
    lost_deg: float
    silhouette: float
    random: float


@dataclass(frozen=True)
class Smoothing:
    """How the fused depth is smoothed before it becomes skin (`core.surface.denoise`).

    Attributes
    ----------
    window_px : float
        Standard deviation of the window, in depth pixels.
    passes : int
        How often: the second pass is gated by what the first one smoothed, not by the noise itself.
    gate_m : float
        Neighbours that differ by more belong to something else; at least so much.
    gate_sigmas : float
        The same in standard deviations of the fused depth; 0: `gate_m` alone.
    trim_px : int
        The outermost pixels of a body are left out: they measured what stands before, not what is there.
    """

    window_px: float = 1.5
    passes: int = 1
    gate_m: float = 0.020
    gate_sigmas: float = 0.0
    trim_px: int = 0


@dataclass(frozen=True)
class Ripple:
    """Structured light: a fixed disparity error of each device, RMS in pixels of long and short waves."""

    long_px: float
    short_px: float

    def sigma(self, z_m: ArrayLike, sensor: SensorModel, smoothed_px: float = 0.0) -> NDArray[np.float64]:
        """RMS in metres at depth z; smoothing takes nothing off."""
        pixels = np.hypot(self.long_px, self.short_px * np.sqrt(1.25))  # bands: half as strong as short waves
        return np.asarray(pixels * sensor.metres_per_disparity(z_m), float)


@dataclass(frozen=True)
class PhaseError:
    """Time of flight: what remains of wiggling after the maker's calibration, and light that takes detours.

    Attributes
    ----------
    wiggle_m, period_m : float
        Amplitude and period in distance of the error that follows from harmonics of the modulation.
    pattern_m : float
        RMS of the fixed pattern over the image, for each device.
    offset_m : float
        Skin looks this much farther away: light enters it and comes back later.
    corner_m : float
        Concave corners look up to this much farther away, for light bounces there (multi-path).
    flying : float
        Share of the pixels at depth jumps that measure a mixture of near and far.
    """

    wiggle_m: float
    period_m: float
    pattern_m: float
    offset_m: float
    corner_m: float
    flying: float

    def sigma(self, z_m: ArrayLike, sensor: SensorModel, smoothed_px: float = 0.0) -> NDArray[np.float64]:
        """RMS in metres at depth z; smoothing takes nothing off."""
        rms = np.sqrt(0.5 * self.wiggle_m**2 + self.pattern_m**2 + self.offset_m**2)
        return np.full(np.shape(np.asarray(z_m)), float(rms))


@dataclass(frozen=True)
class MatchingError:
    """Stereo: errors of the matched windows that stay as long as nothing moves, and those of the calibration.

    Attributes
    ----------
    frozen_px : float
        RMS of the disparity error that every frame of a capture shares: the pattern on the skin and the
        windows are the same in all of them. Another stance, another error.
    window_px : float
        Size of the matching window, as the standard deviation of a Gaussian.
    long_px : float
        RMS of the long waves that calibration leaves, for each device.
    texture : float
        By which share noise varies with the texture under the window (standard deviation of its logarithm).
    fatten_px : float
        Edges of near things grow by so many pixels over what is behind them.
    """

    frozen_px: float
    window_px: float
    long_px: float
    texture: float
    fatten_px: float

    def sigma(self, z_m: ArrayLike, sensor: SensorModel, smoothed_px: float = 0.0) -> NDArray[np.float64]:
        """RMS in metres at depth z, before or after smoothing with a Gaussian of so many pixels.

        White noise behind a Gaussian of width a has a spread of 1 / a, and behind another one of width b
        1 / sqrt(a^2 + b^2).
        """
        left = self.window_px / np.hypot(self.window_px, smoothed_px)
        pixels = np.hypot(left * self.frozen_px, self.long_px)
        return np.asarray(pixels * sensor.metres_per_disparity(z_m), float)


Systematic = Ripple | PhaseError | MatchingError


@dataclass(frozen=True)
class SensorModel:
    """A depth sensor.

    Attributes
    ----------
    name, title : str
        For programs and for people.
    principle : str
    sources : tuple of str
        Where the figures are from.
    depth_camera, color_camera : PinholeCamera
        Nominal: as made, before any calibration.
    color_from_depth : RigidTransform
        Nominal.
    near_m, far_m : float
        Range outside of which nothing is measured.
    baseline_m : float
        From the depth camera to the projector, or to the second camera: what one of them sees and the
        other does not is no measurement. Along +x; 0 for none, as with time of flight.
    axial : AxialNoise
    lateral_px : float
        Standard deviation of the sideways uncertainty of a pixel.
    disparity_step_px : float or None
        Quantisation of the disparity; None where depth itself is stepped.
    depth_step_m : float
        Quantisation of depth where it is not of disparity.
    grain : Grain
    dropout : Dropout
    systematic : Ripple, PhaseError or MatchingError
        What stays the same in all frames of a capture.
    smoothing : Smoothing
    """

    name: str
    title: str
    principle: Principle
    sources: tuple[str, ...]
    depth_camera: PinholeCamera
    color_camera: PinholeCamera
    color_from_depth: RigidTransform
    near_m: float
    far_m: float
    baseline_m: float
    axial: AxialNoise
    lateral_px: float
    disparity_step_px: float | None
    depth_step_m: float
    grain: Grain
    dropout: Dropout
    systematic: Systematic
    smoothing: Smoothing = Smoothing()

    @property
    def fingerprint(self) -> str:
        """Twelve hexadecimal digits that change with any figure, not with title and sources."""
        figures = {f.name: repr(getattr(self, f.name)) for f in fields(self) if f.name not in _WORDS}
        figures["color_from_depth"] = repr(self.color_from_depth.matrix.tolist())
        return sha256(repr(sorted(figures.items())).encode()).hexdigest()[:12]

    def axial_sigma(self, z_m: ArrayLike, incidence_rad: ArrayLike = 0.0) -> Image:
        """Standard deviation of one reading in metres, quantisation included.

        Parameters
        ----------
        z_m : array-like
            Depth.
        incidence_rad : array-like
            Angle between the surface normal and the line of sight.
        """
        z = np.asarray(z_m, np.float32)
        angle = np.minimum(np.asarray(incidence_rad, np.float32), _STEEPEST)
        x = z - self.axial.from_m
        out = np.full(np.broadcast_shapes(z.shape, angle.shape), self.axial.powers[0], np.float32)
        for power, factor in enumerate(self.axial.powers[1:], 1):
            if factor:
                out = out + factor * x**power
        tilt = self.axial.tilt
        if tilt is not None:
            scale = np.sqrt(np.maximum(z, _NEAREST_M)) ** abs(2.0 * tilt.power)
            far = tilt.factor / scale if tilt.power < 0 else tilt.factor * scale
            tilted = far * angle**2 / (np.pi / 2 - angle) ** 2
            out = out + np.where(angle > np.deg2rad(tilt.from_deg), tilted, 0.0)
        return np.asarray(out, np.float32)

    def quantisation_step(self, z_m: ArrayLike) -> Image:
        """Distance in metres between two neighbouring depth values."""
        z = np.asarray(z_m, np.float32)
        if self.disparity_step_px is None:
            return np.full(z.shape, self.depth_step_m, np.float32)
        return np.asarray(
            z**2 * (self.disparity_step_px / (self.depth_camera.fx * self.baseline_m)), np.float32
        )

    def metres_per_disparity(self, z_m: ArrayLike) -> NDArray[np.float64]:
        """Depth error in metres that one pixel of disparity makes.

        Raises
        ------
        InputError
            For a sensor without a baseline.
        """
        if self.baseline_m <= 0:
            raise InputError(f"The sensor {self.name} does not measure by disparity.")
        return np.asarray(np.square(np.asarray(z_m, float)) / (self.depth_camera.fx * self.baseline_m))

    def systematic_sigma(self, z_m: ArrayLike) -> NDArray[np.float64]:
        """RMS in metres of the error that all frames of a capture share, at depth z."""
        return self.systematic.sigma(z_m, self)

    def fused_sigma(self, z_m: ArrayLike, frames: int) -> NDArray[np.float64]:
        """Standard deviation in metres of the mean of many frames at depth z, skin square to the camera."""
        return np.asarray(
            np.hypot(self.axial_sigma(z_m) / np.sqrt(max(frames, 1)), self.systematic_sigma(z_m))
        )

    def skin_sigma(self, z_m: ArrayLike, frames: int) -> NDArray[np.float64]:
        """Standard deviation in metres of the smoothed skin along the line of sight, at depth z.

        Smoothing takes off what varies within its window: all but a little of the noise between frames,
        and that part of the systematic error that is no wider than the window.
        """
        window = self.smoothing.window_px * np.sqrt(self.smoothing.passes)
        random = self.axial_sigma(z_m) / np.sqrt(max(frames, 1)) / (2.0 * np.sqrt(np.pi) * max(window, 0.5))
        return np.asarray(np.hypot(random, self.systematic.sigma(z_m, self, window)))

    def scaled(self, share: float) -> SensorModel:
        """A sensor as precise as this one, with ``share`` of its pixels in width and in height."""
        c = self.depth_camera
        camera = PinholeCamera(
            round(c.width * share),
            round(c.height * share),
            c.fx * share,
            c.fy * share,
            (c.cx + 0.5) * share - 0.5,
            (c.cy + 0.5) * share - 0.5,
            c.distortion,
        )
        wrong = self.systematic
        if isinstance(wrong, Ripple):
            wrong = Ripple(wrong.long_px * share, wrong.short_px * share)
        elif isinstance(wrong, MatchingError):
            wrong = replace(
                wrong,
                frozen_px=wrong.frozen_px * share,
                long_px=wrong.long_px * share,
                fatten_px=wrong.fatten_px * share,
            )
        step = None if self.disparity_step_px is None else self.disparity_step_px * share
        return replace(
            self,
            depth_camera=camera,
            lateral_px=self.lateral_px * share,
            disparity_step_px=step,
            systematic=wrong,
        )
