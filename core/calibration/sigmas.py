"""The standard deviations that a calibration profile states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def named_sigmas(names: Sequence[str], covariance: FloatArray) -> dict[str, float]:
    """Standard deviations as a profile keeps them, of the parameters (n,) whose covariance is (n, n)."""
    each = dict(zip(names, np.sqrt(np.maximum(np.diag(covariance), 0.0)), strict=True))
    out = {name: float(s) for name, s in each.items() if name.startswith(("depth.", "color."))}
    if "relation.rx" in each:
        turn = np.sqrt(sum(each[f"relation.r{axis}"] ** 2 for axis in "xyz"))
        out["rotation_deg"] = float(np.rad2deg(turn))
        out |= {f"translation_{axis}_m": float(each[f"relation.t{axis}"]) for axis in "xyz"}
    for name, parameter in (("depth_scale", "scale"), ("depth_offset_m", "offset")):
        if f"correction.{parameter}" in each:
            out[name] = float(each[f"correction.{parameter}"])
    return out
