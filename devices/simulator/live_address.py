"""Simulated cameras by their address: ``simulator:SHAPE?option=value&...``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any
from urllib.parse import parse_qsl

from core.errors import InputError
from devices.camera import DepthCamera, DeviceInfo
from devices.simulator.camera_device import SimulatedCamera, SimulatedScene
from devices.simulator.live_faults import Faults
from devices.simulator.shapes import SHAPES


def _between(kind: Callable[[str], Any], low: float, high: float) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        value = kind(text)
        if not low <= value <= high:  # NaN is outside
            raise InputError(f"{text} is out of range for a simulated camera.", f"Use {low:g} to {high:g}.")
        return value

    return read


_SCENE: dict[str, Callable[[str], Any]] = {
    "stance": str,
    "view": str,
    "visit": _between(int, 1, 1000),
    "turn_deg": _between(float, -360, 360),
    "distance_m": _between(float, 0.5, 8),
}
_CAMERA: dict[str, Callable[[str], Any]] = {
    "seed": _between(int, 0, 2**31 - 1),
    "sway": str,
    "light": _between(float, 0.01, 100),
    "fault": Faults.parse,
}


class SimulatedCameras:
    """Factory for ``simulator:SHAPE``, with options as in ``simulator:m_young_avg?seed=3&stance=A&visit=2``.

    Options: seed; stance, view, visit, turn_deg, distance_m of the `SimulatedScene`; sway (still, calm,
    restless), light (1 is bright) and fault (``stall@20``, ``unplug@20``: seconds) of the `SimulatedCamera`.
    """

    def devices(self) -> Sequence[DeviceInfo]:
        """One camera per body shape."""
        return [SimulatedCamera(shape).info for shape in SHAPES]

    def create(self, address: str) -> DepthCamera:
        """Return the camera of a shape, not opened yet."""
        shape, _, options = address.partition("?")
        scene: dict[str, Any] = {}
        camera: dict[str, Any] = {}
        for name, text in parse_qsl(options, keep_blank_values=True):
            try:
                if name in _SCENE:
                    scene[name] = _SCENE[name](text)
                elif name in _CAMERA:
                    camera["faults" if name == "fault" else name] = _CAMERA[name](text)
                else:
                    known = ", ".join([*_CAMERA, *_SCENE])
                    raise InputError(f"A simulated camera has no option '{name}'.", f"It has {known}.")
            except ValueError as error:
                raise InputError(f"'{text}' is not a number for '{name}' of a simulated camera.") from error
        return SimulatedCamera(shape, replace(SimulatedScene(), **scene), **camera)


SIMULATED_CAMERAS = SimulatedCameras()
