"""Reading sensors from JSON files: nothing unchecked gets through."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from core.capture.camera import PinholeCamera
from core.capture.sensor_parts import (
    AxialNoise,
    Dropout,
    Grain,
    MatchingError,
    PhaseError,
    Principle,
    Ripple,
    SensorModel,
    Smoothing,
    Systematic,
    Tilt,
)
from core.capture.transform import RigidTransform
from core.errors import InputError

SENSOR_FORMAT = "geoderm-sensor/1"
_LIMIT_BYTES = 100_000


def read_sensor(path: Path) -> SensorModel:
    """A sensor from a file.

    Raises
    ------
    InputError
        Naming the file and the field, if it is not a usable sensor.
    """
    try:
        if path.stat().st_size > _LIMIT_BYTES:
            raise InputError(f"{path.name}: too large for a sensor.")
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path.name}: cannot be read as JSON ({type(error).__name__}).") from error
    try:
        content = _Document.model_validate(document)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or "document"
        raise InputError(f"{path.name}: {field}: {first['msg']}.") from error
    if content.name != path.stem:
        raise InputError(f"{path.name}: name: must be the name of the file, {path.stem}.")
    return content.model()


_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Length = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]
_Pixels = Annotated[float, Field(ge=0, le=50, allow_inf_nan=False)]
_Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
_Angle = Annotated[float, Field(ge=0, le=90, allow_inf_nan=False)]
_Figure = Annotated[float, Field(ge=-10, le=10, allow_inf_nan=False)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class _Camera(_Strict):
    width: Annotated[int, Field(ge=16, le=8192)]
    height: Annotated[int, Field(ge=16, le=8192)]
    fx: Annotated[float, Field(gt=1, le=1e5, allow_inf_nan=False)]
    fy: Annotated[float, Field(gt=1, le=1e5, allow_inf_nan=False)]
    cx: Annotated[float, Field(ge=-1, le=8192, allow_inf_nan=False)]
    cy: Annotated[float, Field(ge=-1, le=8192, allow_inf_nan=False)]

    def camera(self) -> PinholeCamera:
        return PinholeCamera(self.width, self.height, self.fx, self.fy, self.cx, self.cy)


class _Tilt(_Strict):
    factor: Annotated[float, Field(ge=0, le=0.1, allow_inf_nan=False)]
    power: Annotated[float, Field(ge=-4, le=4, allow_inf_nan=False)]
    from_deg: _Angle


class _Axial(_Strict):
    from_m: _Length
    powers: Annotated[list[_Figure], Field(min_length=1, max_length=6)]
    tilt: _Tilt | None = None


class _Quantisation(_Strict):
    disparity_px: _Positive | None = None
    depth_m: _Positive | None = None

    @model_validator(mode="after")
    def _one(self) -> _Quantisation:
        if (self.disparity_px is None) == (self.depth_m is None):
            raise ValueError("give either disparity_px or depth_m")
        return self


class _Grain(_Strict):
    white: _Share
    correlated: _Share
    window_px: Annotated[float, Field(gt=0, le=20, allow_inf_nan=False)]

    @model_validator(mode="after")
    def _whole(self) -> _Grain:
        if abs(self.white**2 + self.correlated**2 - 1.0) > 0.01:
            raise ValueError("the squares of white and correlated must add up to 1")
        return self


class _Dropout(_Strict):
    grazing_deg: _Angle
    lost_deg: _Angle
    silhouette: _Share
    random: _Share

    @model_validator(mode="after")
    def _ordered(self) -> _Dropout:
        if self.lost_deg <= self.grazing_deg:
            raise ValueError("lost_deg must be beyond grazing_deg")
        return self


class _Ripple(_Strict):
    kind: Literal["ripple"]
    long_px: _Pixels
    short_px: _Pixels

    def part(self) -> Systematic:
        return Ripple(self.long_px, self.short_px)


class _Phase(_Strict):
    kind: Literal["phase"]
    wiggle_m: _Length
    period_m: _Positive
    pattern_m: _Length
    offset_m: _Length
    corner_m: _Length
    flying: _Share

    def part(self) -> Systematic:
        return PhaseError(**self.model_dump(exclude={"kind"}))


class _Matching(_Strict):
    kind: Literal["matching"]
    frozen_px: _Pixels
    window_px: Annotated[float, Field(gt=0, le=20, allow_inf_nan=False)]
    long_px: _Pixels
    texture: _Share
    fatten_px: _Pixels

    def part(self) -> Systematic:
        return MatchingError(**self.model_dump(exclude={"kind"}))


_KIND_OF: dict[Principle, str] = {
    "structured-light": "ripple",
    "time-of-flight": "phase",
    "stereo": "matching",
}


class _Smoothing(_Strict):
    window_px: Annotated[float, Field(gt=0, le=8, allow_inf_nan=False)]
    passes: Annotated[int, Field(ge=1, le=3)] = 1
    gate_m: Annotated[float, Field(gt=0, le=0.5, allow_inf_nan=False)]
    gate_sigmas: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.0
    trim_px: Annotated[int, Field(ge=0, le=5)] = 0


class _Document(_Strict):
    format: Literal["geoderm-sensor/1"]
    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")]
    title: Annotated[str, Field(min_length=1, max_length=80)]
    principle: Principle
    sources: Annotated[list[Annotated[str, Field(min_length=1, max_length=1000)]], Field(min_length=1)]
    depth_camera: _Camera
    color_camera: _Camera
    color_from_depth_m: Annotated[list[_Figure], Field(min_length=3, max_length=3)]
    near_m: _Positive
    far_m: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)]
    baseline_m: Annotated[float, Field(ge=0, le=2, allow_inf_nan=False)]
    axial: _Axial
    lateral_px: _Pixels
    quantisation: _Quantisation
    grain: _Grain
    dropout: _Dropout
    systematic: Annotated[_Ripple | _Phase | _Matching, Field(discriminator="kind")]
    smoothing: _Smoothing

    @model_validator(mode="after")
    def _consistent(self) -> _Document:
        if self.far_m <= self.near_m:
            raise ValueError("far_m must be beyond near_m")
        if self.systematic.kind != _KIND_OF[self.principle]:
            raise ValueError(f"{self.principle} needs a systematic part of kind {_KIND_OF[self.principle]}")
        if (self.principle == "time-of-flight") != (self.baseline_m == 0):
            raise ValueError("baseline_m must be 0 for time of flight and only there")
        if self.quantisation.disparity_px is not None and self.baseline_m == 0:
            raise ValueError("steps of disparity need a baseline")
        sigma = self.model().axial_sigma(np.linspace(self.near_m, self.far_m, 64))
        if not (sigma > 0).all() or (np.diff(sigma) < -1e-4).any():
            raise ValueError("the axial noise must be positive and must not shrink with distance")
        return self

    def model(self) -> SensorModel:
        tilt = self.axial.tilt
        return SensorModel(
            name=self.name,
            title=self.title,
            principle=self.principle,
            sources=tuple(self.sources),
            depth_camera=self.depth_camera.camera(),
            color_camera=self.color_camera.camera(),
            color_from_depth=RigidTransform(np.eye(3), np.array(self.color_from_depth_m, float)),
            near_m=self.near_m,
            far_m=self.far_m,
            baseline_m=self.baseline_m,
            axial=AxialNoise(
                self.axial.from_m,
                tuple(self.axial.powers),
                None if tilt is None else Tilt(tilt.factor, tilt.power, tilt.from_deg),
            ),
            lateral_px=self.lateral_px,
            disparity_step_px=self.quantisation.disparity_px,
            depth_step_m=self.quantisation.depth_m or 0.0,
            grain=Grain(self.grain.white, self.grain.correlated, self.grain.window_px),
            dropout=Dropout(**self.dropout.model_dump()),
            systematic=self.systematic.part(),
            smoothing=Smoothing(**self.smoothing.model_dump()),
        )
