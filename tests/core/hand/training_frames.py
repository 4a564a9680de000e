"""Labelled frames of simulated hands, made once for all specifications of learning and tracking."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from core.capture import CameraRig, RgbdCapture, write_capture
from core.hand.dataset import write_labels
from core.hand.labels import FrameLabels
from devices.simulator.hands.shots import HandVariation, Holder, shoot

FRAMES = 4
"""Of each configuration."""

CONFIGURATIONS = ("open", "point")

Labelled = tuple[str, RgbdCapture, FrameLabels]

_CALM = HandVariation(tilt_deg=12.0, distance_m=(0.55, 0.7))


@lru_cache(maxsize=1)
def training_frames() -> tuple[Labelled, ...]:
    """Two configurations of two hands in turn; every place is known, also of hidden points."""
    return tuple(
        _frame(f"frame_{2 * k + c:03d}", name, k, Holder(("m_young_avg", "f_young_avg")[k % 2], seed=k))
        for k in range(FRAMES)
        for c, name in enumerate(CONFIGURATIONS)
    )


@lru_cache(maxsize=1)
def new_frame() -> Labelled:
    """An open hand that none of the training frames shows."""
    return _frame("new", "open", 77, Holder("m_tall_thin", seed=40))


def _frame(name: str, configuration: str, seed: int, holder: Holder) -> Labelled:
    shot = shoot(holder, configuration, seed, variation=_CALM)
    return name, shot.capture, FrameLabels(configuration, shot.points_m, shot.visible)


def write_dataset(folder: Path, frames: tuple[Labelled, ...] | None = None) -> Path:
    """The frames as a folder of capture folders with their labels."""
    for name, capture, labels in training_frames() if frames is None else frames:
        write_capture(capture, folder / name)
        write_labels(folder / name, labels)
    return folder


def colourless(capture: RgbdCapture) -> RgbdCapture:
    return replace(capture, color=None, rig=CameraRig(capture.rig.depth))
