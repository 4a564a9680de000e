"""Answers and truth made by hand, for specifications of scoring."""

from __future__ import annotations

import numpy as np

from core.capture import CameraRig, RgbdCapture
from core.capture.camera import PinholeCamera
from core.evaluation.hand.frames import TrueFrame
from core.evaluation.hand.scores import FrameScore, score_frame
from core.hand.answer import HandAnswer
from core.hand.labels import FrameLabels
from core.hand.names import POINT_NAMES

CAMERA = PinholeCamera(8, 6, 10.0, 10.0, 3.5, 2.5)


def true_points() -> np.ndarray:
    """Fifteen places on a grid, 20 mm apart."""
    k = np.arange(len(POINT_NAMES))
    return np.column_stack([0.02 * (k // 3), 0.02 * (k % 3), np.full(len(k), 0.7)])


def moved_points(across_m: float) -> np.ndarray:
    """All of them to one side."""
    return np.asarray(true_points() + np.array([across_m, 0.0, 0.0]))


def true_frame(
    hidden: tuple[str, ...] = (), configuration: str | None = "open", name: str = "f1", body: str = "somebody"
) -> TrueFrame:
    capture = RgbdCapture(np.zeros((1, 6, 8), np.uint16), 0.001, CameraRig(CAMERA))
    points = dict(zip(POINT_NAMES, true_points(), strict=True))
    visible = {point: point not in hidden for point in POINT_NAMES}
    return TrueFrame(name, body, capture, FrameLabels(configuration, points, visible))


def answer(
    points_m: np.ndarray | None = None,
    configuration: str | None = "open",
    likelihood: dict[str, float] | None = None,
    seen: bool = True,
) -> HandAnswer:
    told = true_points() if points_m is None else points_m
    return HandAnswer(
        configuration=configuration,
        points_m=told,
        marker_seen=seen,
        likelihood={"open": 1.0} if likelihood is None else likelihood,
    )


def score(frame: TrueFrame | None = None, said: HandAnswer | None = None) -> FrameScore:
    return score_frame(frame or true_frame(), said or answer())
