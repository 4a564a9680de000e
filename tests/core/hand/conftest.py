"""Hands that are drawn, and a model that is learned, once for all specifications of tracking."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from core.capture import RigidTransform
from core.hand.hand_model import HandModel
from core.hand.labels import FrameLabels
from core.hand.learning import measure_frame
from core.hand.marker_anchors import MarkerAnchors
from core.hand.model import learn_configuration
from core.hand.names import POINT_NAMES
from core.hand.trying import grow_tree
from devices.simulator.hands.scene import HandFrame, HandView, take_frame
from devices.simulator.hands.shots import HandVariation, Holder, hand_view, shoot
from devices.simulator.room import make_rig
from tests.core.hand.training_frames import training_frames

FloatArray = NDArray[np.float64]

CALM = HandVariation(tilt_deg=14.0, distance_m=(0.55, 0.7))


@dataclass(frozen=True, eq=False)
class Shot:
    """A simulated frame as the tracker gets it, and the truth.

    Attributes
    ----------
    frame : HandFrame
    depth_m : ndarray (h, w)
    truth_m : ndarray (15, 3)
    visible : ndarray (15,) bool
    """

    frame: HandFrame
    depth_m: FloatArray
    truth_m: FloatArray
    visible: NDArray[np.bool_]

    @classmethod
    def of(cls, frame: HandFrame) -> Shot:
        capture = frame.capture
        return cls(
            frame,
            capture.depth_frames[0] * capture.depth_unit_m,
            np.array([frame.points_m[name] for name in POINT_NAMES]),
            np.array([frame.visible[name] for name in POINT_NAMES]),
        )

    @property
    def rgb(self) -> NDArray[np.uint8]:
        assert self.frame.capture.color is not None
        return self.frame.capture.color

    @property
    def unmarked(self) -> NDArray[np.uint8]:
        """The picture as if the light had been switched off: no marker can be read."""
        return np.full_like(self.rgb, 20)


@pytest.fixture(scope="session")
def hand_model() -> HandModel:
    """Three configurations, learned from 24 frames of four people who are seen nowhere else."""
    frames = list(training_frames())
    shapes = ("m_young_avg", "f_young_avg", "f_old_heavy", "m_30_athletic")
    for name, seeds in (("open", range(60, 63)), ("point", range(70, 73)), ("fist", range(80, 90))):
        for k, seed in enumerate(seeds):
            shot = shoot(Holder(shapes[-1 - k % 4], seed=seed), name, seed, variation=CALM)
            labels = FrameLabels(name, shot.points_m, shot.visible)
            frames.append((f"{name}_{seed}", shot.capture, labels))
    # as `learn_hand` does it, but for the cross-validation, which takes longer than all the rest
    finder = MarkerAnchors(0.036)
    measured = [
        measure_frame(capture, labels, finder)
        for _, capture, labels in frames
        if any(labels.visible.values())
    ]
    configurations = {
        name: learn_configuration(name, [frame for frame in measured if frame.configuration == name])
        for name in ("fist", "open", "point")
    }
    return HandModel(configurations, grow_tree(measured), "marker", 0.036)


@pytest.fixture(scope="session")
def shots() -> dict[tuple[str, str], Shot]:
    """Frames of people who taught nothing, by configuration and shape."""
    people = (("m_tall_thin", 40), ("f_27_avg", 41))
    return {
        (name, shape): Shot.of(shoot(Holder(shape, seed=seed), name, seed + 300, variation=CALM))
        for name in ("open", "point", "fist")
        for shape, seed in people
    }


@pytest.fixture(scope="session")
def strolling() -> list[Shot]:
    """Fourteen frames of an open hand that goes 8 mm and turns 3 degrees from one to the next."""
    view, rig = _view("m_41_avg", 42)
    steps = [_gone(view, (0.008 * k, -0.002 * k, 0.003 * k), 3.0 * k) for k in range(14)]
    return [Shot.of(take_frame(step, rig, np.random.default_rng((9, k)))) for k, step in enumerate(steps)]


@pytest.fixture(scope="session")
def leaping() -> list[Shot]:
    """Three frames of an open hand that goes 20 cm and turns 40 degrees, and back."""
    view, rig = _view("f_27_avg", 43)
    there = _gone(view, (0.21, 0.08, 0.09), -40.0)
    return [
        Shot.of(take_frame(step, rig, np.random.default_rng((10, k))))
        for k, step in enumerate((view, there, view))
    ]


def _view(shape: str, seed: int):  # type: ignore[no-untyped-def]
    holder = Holder(shape, seed=seed)
    view = hand_view(holder, "open", np.random.default_rng((11, seed)), CALM)
    rotation = view.depth_from_hand.rotation
    begin = RigidTransform(rotation, np.array([-0.08, -0.01, 0.6]))
    return replace(view, depth_from_hand=begin), make_rig((640, 480), device_seed=seed)


def _gone(view: HandView, step_m: tuple[float, ...], turn_deg: float) -> HandView:
    """The hand after a step, turned in the picture and a third as much away from the camera."""
    turn = Rotation.from_euler("zx", (turn_deg, turn_deg / 3), degrees=True).as_matrix()
    pose = view.depth_from_hand
    moved = RigidTransform(turn @ pose.rotation, pose.translation + np.array(step_m))
    return replace(view, depth_from_hand=moved)
