"""Factors that make 95 % regions hold (split conformal calibration).

Each is the 95 % quantile, with the small-sample correction, of error over raw radius on the calibration
pairs of the simulated patient (10 bodies, 40 pairs, 1114 visible places, tracked joints). Parts with fewer
than 40 places share the quantile of their limb or of trunk and head. Bodies, seeds and pairs of the
calibration appear in no accuracy table; real people may do worse.
"""

from __future__ import annotations

from typing import Literal

from core.relocation.bones import Part

Kind = Literal["seen", "matched", "geometry"]
"""How an answer was found: its spot seen again; carried among matched spots; carried by shape alone."""

FACTORS: dict[tuple[Kind, bool, Part], float] = {
    ("seen", False, "head"): 0.40,
    ("seen", False, "trunk"): 0.35,
    ("seen", False, "upper arm"): 0.67,
    ("seen", False, "forearm"): 0.66,
    ("seen", False, "thigh"): 0.44,
    ("seen", False, "lower leg"): 0.63,
    ("seen", True, "head"): 0.47,
    ("seen", True, "trunk"): 0.47,
    ("seen", True, "upper arm"): 0.98,
    ("seen", True, "forearm"): 0.96,
    ("seen", True, "thigh"): 0.50,
    ("seen", True, "lower leg"): 0.85,
    ("matched", False, "head"): 0.92,
    ("matched", False, "trunk"): 0.92,
    ("matched", False, "upper arm"): 0.65,
    ("matched", False, "forearm"): 0.65,
    ("matched", False, "thigh"): 0.69,
    ("matched", False, "lower leg"): 0.69,
    ("matched", True, "head"): 0.90,
    ("matched", True, "trunk"): 0.90,
    ("matched", True, "upper arm"): 3.08,
    ("matched", True, "forearm"): 3.08,
    ("matched", True, "thigh"): 0.49,
    ("matched", True, "lower leg"): 0.49,
    ("geometry", False, "head"): 0.47,
    ("geometry", False, "trunk"): 0.47,
    ("geometry", False, "upper arm"): 0.59,
    ("geometry", False, "forearm"): 0.59,
    ("geometry", False, "thigh"): 0.39,
    ("geometry", False, "lower leg"): 0.47,
    ("geometry", True, "head"): 0.58,
    ("geometry", True, "trunk"): 0.59,
    ("geometry", True, "upper arm"): 1.58,
    ("geometry", True, "forearm"): 1.36,
    ("geometry", True, "thigh"): 0.38,
    ("geometry", True, "lower leg"): 0.34,
}
"""By kind, whether the stance is another one, and body part."""


def factor95(kind: Kind, other_stance: bool, part: Part) -> float:
    """Factor of an answer's raw region."""
    return FACTORS[kind, other_stance, part]
