"""What the demonstration's doctor sees with bare eyes: on which part of the body a mole is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from devices.simulator.truth import CaptureTruth

_LIMBS = (
    ("Anterior surface of upper arm", "shoulder", "elbow"),
    ("Anterior surface of forearm", "elbow", "hand"),
    ("Anterior surface of thigh", "hip", "knee"),
    ("Anterior surface of lower leg", "knee", "foot"),
)
_UPPER_CHEST, _LOWER_CHEST, _ABDOMEN = "Anterior surface of thorax", "Lower chest wall", "Abdomen"


def site_in_words(truth: CaptureTruth, lesion: str) -> tuple[str, str]:
    """Name of the anatomic site (DICOM CID 4029) and side ("left", "right" or "") of a simulated lesion."""
    point = truth.mole_points_m[truth.mole_ids.index(lesion)]
    joints = truth.joints_m
    best = (np.inf, _ABDOMEN, "")
    for side in ("left", "right"):
        for name, upper, lower in _LIMBS:
            gap = _distance(point, joints[f"{side}_{upper}"], joints[f"{side}_{lower}"])
            best = min(best, (gap, name, side))
    hips = (joints["left_hip"] + joints["right_hip"]) / 2
    trunk = _distance(point, joints["neck"], hips) - 0.08  # the trunk is thicker than a limb
    if trunk < best[0]:
        share = float(
            (point - joints["neck"]) @ (hips - joints["neck"]) / np.sum((hips - joints["neck"]) ** 2)
        )
        return (_UPPER_CHEST if share < 0.25 else _LOWER_CHEST if share < 0.55 else _ABDOMEN), ""
    return best[1], best[2]


def _distance(point: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    share = float(np.clip((point - a) @ (b - a) / np.sum((b - a) ** 2), 0.0, 1.0))
    return float(np.linalg.norm(point - a - share * (b - a)))
