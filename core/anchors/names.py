"""The vocabulary of anchors: the thesis's 15 joints, the tracker's 33 landmarks, the bones between joints.

Left and right are always the patient's own.
"""

from __future__ import annotations

from typing import Final

JOINT_NAMES: Final[tuple[str, ...]] = (
    "head",
    "neck",
    "torso",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_hand",
    "right_hand",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_foot",
    "right_foot",
)
"""The 15 joints of OpenNI/NITE (thesis, chapter 2)."""

LANDMARK_NAMES: Final[tuple[str, ...]] = (
    "nose",
    "left_eye_inner",
    "left_eye",
    "left_eye_outer",
    "right_eye_inner",
    "right_eye",
    "right_eye_outer",
    "left_ear",
    "right_ear",
    "mouth_left",
    "mouth_right",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_pinky",
    "right_pinky",
    "left_index",
    "right_index",
    "left_thumb",
    "right_thumb",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
    "left_heel",
    "right_heel",
    "left_foot_index",
    "right_foot_index",
)
"""The 33 landmarks of the pose model, in its order."""

EXTRA_NAMES: Final[tuple[str, ...]] = (
    "nose",
    "left_ear",
    "right_ear",
    "left_wrist",
    "right_wrist",
    "left_heel",
    "right_heel",
    "left_foot_index",
    "right_foot_index",
)
"""Landmarks beyond the 15 joints that repeat well from visit to visit."""

BONES: Final[tuple[tuple[str, str], ...]] = (
    ("neck", "head"),
    ("neck", "torso"),
    ("neck", "left_shoulder"),
    ("neck", "right_shoulder"),
    ("left_shoulder", "left_elbow"),
    ("right_shoulder", "right_elbow"),
    ("left_elbow", "left_hand"),
    ("right_elbow", "right_hand"),
    ("torso", "left_hip"),
    ("torso", "right_hip"),
    ("left_hip", "left_knee"),
    ("right_hip", "right_knee"),
    ("left_knee", "left_foot"),
    ("right_knee", "right_foot"),
)
"""Bones (near end, far end), ordered from the trunk outward."""

LIMBS: Final[tuple[tuple[str, str, str], ...]] = (
    ("left_shoulder", "left_elbow", "left_hand"),
    ("right_shoulder", "right_elbow", "right_hand"),
    ("left_hip", "left_knee", "left_foot"),
    ("right_hip", "right_knee", "right_foot"),
)
"""Chains of two bones."""


def opposite(name: str) -> str:
    """Name of the same place on the other side of the body; a midline name is its own opposite."""
    for one, other in (("left", "right"), ("right", "left")):
        if name.startswith(one + "_"):
            return other + name[len(one) :]
        if name.endswith("_" + one):
            return name[: -len(one)] + other
    return name


def spoken(name: str) -> str:
    """Name for a sentence to a person: ``left_elbow`` becomes "left elbow"."""
    return name.replace("_", " ")


OPPOSITE_LANDMARKS: Final[tuple[int, ...]] = tuple(
    LANDMARK_NAMES.index(opposite(name)) for name in LANDMARK_NAMES
)
"""Index of every landmark's opposite."""
