"""Depth sensors as data: how noisy, how coarse, how far, and what no averaging over frames removes.

A sensor is one JSON file in resources/sensors; every figure in it names its source. The simulator draws
frames from it, fusion and the stated regions ask it how much to believe. A new sensor is a new file, and one
short class in `core.capture.sensor_parts` if its principle is new.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from core.capture.sensor_files import SENSOR_FORMAT, read_sensor
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
from core.errors import InputError

__all__ = [
    "DEFAULT_SENSOR",
    "SENSOR_FORMAT",
    "AxialNoise",
    "Dropout",
    "Grain",
    "MatchingError",
    "PhaseError",
    "Principle",
    "Ripple",
    "SensorModel",
    "Smoothing",
    "Systematic",
    "Tilt",
    "read_sensor",
    "sensor_model",
    "sensor_names",
    "sensor_of",
]

DEFAULT_SENSOR = "kinect-v1"
"""What a capture that does not name its sensor is taken for."""


def sensor_names() -> tuple[str, ...]:
    """Names of the sensors that are known, in alphabetical order."""
    return tuple(sorted(path.stem for path in _folder().glob("*.json")))


@lru_cache(maxsize=32)
def sensor_model(name: str) -> SensorModel:
    """The sensor of a name.

    Raises
    ------
    InputError
        If there is none of this name.
    """
    if name not in sensor_names():
        raise InputError(f"There is no sensor '{name}'.", f"Choose one of: {', '.join(sensor_names())}.")
    return read_sensor(_folder() / f"{name}.json")


def sensor_of(name: str) -> tuple[SensorModel, bool]:
    """The sensor that a capture names, and whether it is known; `DEFAULT_SENSOR` stands in for others."""
    known = name in sensor_names()
    return sensor_model(name if known else DEFAULT_SENSOR), known


def _folder() -> Path:
    from resources import resource_path

    return resource_path("sensors")
