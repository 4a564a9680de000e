"""Exposure, gain, white balance and emitter of a RealSense camera under the application's names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from core.errors import WorkError


@dataclass(frozen=True)
class _Control:
    """One setting: on which sensor, the library's option, and the unit of its value in ours."""

    name: str
    depth: bool
    option: str
    unit: float = 1.0


# Exposure of the depth sensor is in microseconds, that of the colour sensor (a UVC camera) in 100 of them.
_CONTROLS = (
    _Control("auto_exposure", False, "enable_auto_exposure"),
    _Control("exposure_s", False, "exposure", 1e-4),
    _Control("gain", False, "gain"),
    _Control("auto_white_balance", False, "enable_auto_white_balance"),
    _Control("white_balance_k", False, "white_balance"),
    _Control("depth_auto_exposure", True, "enable_auto_exposure"),
    _Control("depth_exposure_s", True, "exposure", 1e-6),
    _Control("depth_gain", True, "gain"),
    _Control("emitter", True, "emitter_enabled"),
    _Control("laser_power_mw", True, "laser_power"),
)


def read_controls(rs: Any, sensors: Sequence[Any]) -> list[tuple[str, float, float, float]]:
    """Name, value, minimum and maximum of what the camera offers."""
    found: list[tuple[str, float, float, float]] = []
    for control in _CONTROLS:
        sensor = _sensor(rs, sensors, control)
        if sensor is not None:
            option = getattr(rs.option, control.option)
            span, value = sensor.get_option_range(option), sensor.get_option(option)
            now, least, most = (float(v) * control.unit for v in (value, span.min, span.max))
            found.append((control.name, now, least, most))
    return found


def write_control(rs: Any, sensors: Sequence[Any], name: str, value: float) -> None:
    """Set a control that `read_controls` names. A value by hand switches its automatic off."""
    automatic = {
        "exposure_s": "auto_exposure",
        "gain": "auto_exposure",
        "white_balance_k": "auto_white_balance",
        "depth_exposure_s": "depth_auto_exposure",
        "depth_gain": "depth_auto_exposure",
    }
    steps = [(automatic[name], 0.0)] if name in automatic else []
    for step, wanted in (*steps, (name, value)):
        control = next(c for c in _CONTROLS if c.name == step)
        sensor = _sensor(rs, sensors, control)
        if sensor is None:
            continue
        try:
            sensor.set_option(getattr(rs.option, control.option), wanted / control.unit)
        except RuntimeError as error:
            raise WorkError(f"The RealSense camera did not take the setting '{step}'. ({error})") from error


def _sensor(rs: Any, sensors: Sequence[Any], control: _Control) -> Any | None:
    option = getattr(rs.option, control.option)
    for sensor in sensors:
        if sensor.is_depth_sensor() == control.depth and sensor.supports(option):
            return sensor
    return None
