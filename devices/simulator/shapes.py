"""The body shapes of simulated people, and which of them a method may be tuned, calibrated and tested on.

Names say sex, age and build: "f_54_heavy" is a heavy woman of 54, "child7_f" a girl of seven.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from resources import resource_path

FloatArray = NDArray[np.float64]

TUNING_SHAPES = (
    "m_young_avg",
    "f_old_heavy",
    "child10",
    "m_25_muscular",
    "m_33_short",
    "m_48_stout",
    "m_67_obese",
    "f_22_thin",
    "f_38_tall",
    "f_54_heavy",
    "f_71_avg",
    "child7_f",
)
"""Shapes on which parameters may be chosen. Frozen."""

CALIBRATION_SHAPES = (
    "m_21_thin",
    "m_30_athletic",
    "m_41_avg",
    "m_58_heavy",
    "m_76_thin",
    "f_27_avg",
    "f_35_obese",
    "f_49_short",
    "f_63_stout",
    "child12_m",
)
"""Shapes on which stated uncertainties may be calibrated. Frozen."""

TEST_SHAPES = (
    "m_tall_thin",
    "f_young_avg",
    "m_28_strong",
    "m_36_obese",
    "m_52_avg",
    "m_72_heavy",
    "m_80_avg",
    "f_19_athletic",
    "f_31_short_heavy",
    "f_44_avg",
    "f_59_tall_thin",
    "f_78_thin",
    "child6_f",
    "child14_m",
)
"""Shapes that only reported figures come from. Frozen."""

_OWN_FILE = ("m_young_avg", "f_young_avg", "m_tall_thin", "f_old_heavy", "child10")

SHAPES = (
    *_OWN_FILE,
    *(name for name in TUNING_SHAPES + CALIBRATION_SHAPES + TEST_SHAPES if name not in _OWN_FILE),
)
"""Names of all shipped body shapes."""

_DESCRIPTIONS = {
    "m_young_avg": "young man",
    "f_young_avg": "young woman",
    "m_tall_thin": "tall thin man",
    "f_old_heavy": "elderly heavy woman",
    "child10": "child of ten",
}


def describe_shape(shape: str) -> str:
    """Words for a shape's name, for example "heavy woman of 54"."""
    if shape in _DESCRIPTIONS:
        return _DESCRIPTIONS[shape]
    first, *rest = shape.split("_")
    if first.startswith("child"):
        return f"{'girl' if rest == ['f'] else 'boy'} of {first[5:]}"
    age, *build = rest
    words = ["average" if word == "avg" else word for word in build]
    return f"{' '.join(words)} {'woman' if first == 'f' else 'man'} of {age}"


@dataclass(frozen=True, eq=False)
class ShapeArrays:
    """What makes one shape.

    Attributes
    ----------
    bind : ndarray (n, 3)
        Vertices in the posture in which the skin was bound to the bones, metres.
    rest_bones, ref_bones : ndarray (bones, 4, 4)
        Bone frames in that posture and in the reference posture.
    reference : ndarray (n, 3) or None
        Vertices in the reference posture; None where they follow from the others by skinning.
    """

    bind: FloatArray
    rest_bones: FloatArray
    ref_bones: FloatArray
    reference: FloatArray | None


def read_shape(shape: str) -> ShapeArrays:
    """Read one of `SHAPES` (KeyError for another name)."""
    if shape in _OWN_FILE:
        with np.load(resource_path("bodies", f"anny_{shape}.npz")) as own:
            return ShapeArrays(
                own["rest_vertices"].astype(float),
                own["rest_bones"].astype(float),
                own["ref_bones"].astype(float),
                own["ref_vertices"].astype(float),
            )
    with np.load(resource_path("bodies", "anny_shapes.npz")) as many:
        offset = many[f"{shape}.offset"].astype(float) * float(many["step_m"])
        frames = []
        for name in ("rest_bones", "ref_bones"):
            full = np.tile(np.eye(4), (len(many[f"{shape}.{name}"]), 1, 1))
            full[:, :3] = many[f"{shape}.{name}"]
            frames.append(full)
        return ShapeArrays(many["mean"].astype(float) + offset, frames[0], frames[1], None)
