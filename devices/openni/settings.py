"""What OpenNI2 lets one set about the picture, in the words of `devices.live.CameraControl`."""

from __future__ import annotations

from functools import partial
from typing import Any

from core.errors import InputError
from devices.openni.binding import binding_part
from devices.openni.streams import OpenedStream, told

REGISTRATION = "device_registration"
_DEPTH_TO_COLOR, _OFF = 1, 0
# Property number of the colour stream, and the largest value. OpenNI2 defines neither units nor ranges of
# exposure and gain: each driver has its own, so the names carry no unit.
_COLOR: dict[str, tuple[int, float]] = {
    "auto_white_balance": (100, 1.0),
    "auto_exposure": (101, 1.0),
    "exposure": (102, 65535.0),
    "gain": (103, 65535.0),
}


def read_controls(device: Any, color: OpenedStream | None) -> list[tuple[str, float, float, float]]:
    """Name, value, minimum and maximum of every control that the driver has."""
    found = []
    if color is not None:
        for name, (number, largest) in _COLOR.items():
            if not color.stream.is_property_supported(number):
                continue
            value = told(partial(color.stream.get_int_property, number))
            if value is not None:
                found.append((name, float(value), 0.0, largest))
    if _registers(device):
        mode = told(device.get_image_registration_mode)
        found.append((REGISTRATION, 0.0 if mode is None else float(int(mode) == _DEPTH_TO_COLOR), 0.0, 1.0))
    return found


def write_control(device: Any, color: OpenedStream | None, name: str, value: float) -> float:
    """Set a control; return the value that the driver then tells."""
    refusal: type[Exception] = binding_part("utils").OpenNIError
    known = {control[0]: control for control in read_controls(device, color)}
    if name not in known:
        has = ", ".join(known) or "none"
        raise InputError(f"The camera has no control '{name}'.", f"It has: {has}.")
    low, high = known[name][2:]
    if not low <= value <= high or value != int(value):
        raise InputError(f"{name}: must be a whole number from {low:g} to {high:g}.")
    try:
        if name == REGISTRATION:
            device.set_image_registration_mode(_DEPTH_TO_COLOR if value else _OFF)
        else:
            assert color is not None
            color.stream.set_property(_COLOR[name][0], int(value))
    except refusal as error:
        raise InputError(f"{name}: the camera does not accept {value:g}.") from error
    return next(control[1] for control in read_controls(device, color) if control[0] == name)


def _registers(device: Any) -> bool:
    return bool(told(lambda: device.is_image_registration_mode_supported(_DEPTH_TO_COLOR)))
