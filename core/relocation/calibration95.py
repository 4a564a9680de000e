"""Factors that make 95 % regions hold (split conformal calibration)."""

from __future__ import annotations

from typing import Literal

Kind = Literal["seen", "matched", "geometry"]

FACTORS: dict[tuple[Kind, bool, str], float] = {}


def factor95(kind: Kind, other_stance: bool, part: str) -> float:
    """Factor of an answer's raw region, by how it was found, stance class and body part."""
    return FACTORS.get((kind, other_stance, part), 1.0)
