"""A simulated patient before virtual cameras, with the truth about every pixel.

Importing this package is cheap: a name is loaded when it is first asked for.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from devices.simulator.camera_device import SimulatedCamera, SimulatedScene
    from devices.simulator.cases import (
        CALIBRATION_PAIRS,
        TEST_PAIRS,
        TUNING_PAIRS,
        SimulatedPair,
        make_pair,
    )
    from devices.simulator.patient import SimulatedPatient
    from devices.simulator.room import (
        DEMANDING,
        STILL,
        Bystander,
        Room,
        SimulatedRig,
        Variation,
        VisitChange,
        make_rig,
    )
    from devices.simulator.shapes import CALIBRATION_SHAPES, SHAPES, TEST_SHAPES, TUNING_SHAPES
    from devices.simulator.stances import STANCES
    from devices.simulator.truth import CaptureTruth, SimulatedCapture, read_truth, write_simulated

__all__ = [
    "CALIBRATION_PAIRS",
    "CALIBRATION_SHAPES",
    "DEMANDING",
    "SHAPES",
    "STANCES",
    "STILL",
    "TEST_PAIRS",
    "TEST_SHAPES",
    "TUNING_PAIRS",
    "TUNING_SHAPES",
    "Bystander",
    "CaptureTruth",
    "Room",
    "SimulatedCamera",
    "SimulatedCapture",
    "SimulatedPair",
    "SimulatedPatient",
    "SimulatedRig",
    "SimulatedScene",
    "Variation",
    "VisitChange",
    "make_pair",
    "make_rig",
    "read_truth",
    "write_simulated",
]

_HOME = {
    "CALIBRATION_PAIRS": "cases",
    "TEST_PAIRS": "cases",
    "TUNING_PAIRS": "cases",
    "SimulatedPair": "cases",
    "make_pair": "cases",
    "CALIBRATION_SHAPES": "shapes",
    "SHAPES": "shapes",
    "TEST_SHAPES": "shapes",
    "TUNING_SHAPES": "shapes",
    "STANCES": "stances",
    "SimulatedCamera": "camera_device",
    "SimulatedScene": "camera_device",
    "SimulatedPatient": "patient",
    "CaptureTruth": "truth",
    "SimulatedCapture": "truth",
    "read_truth": "truth",
    "write_simulated": "truth",
}


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME.get(name, 'room')}"), name)
