"""What can be made to go wrong with the simulated camera, for training and tests."""

from __future__ import annotations

import math
from dataclasses import dataclass

from core.errors import InputError


@dataclass(frozen=True)
class Faults:
    """When something goes wrong, in seconds after the first frame.

    Attributes
    ----------
    stall_s : float
        From then on no frame comes.
    unplug_s : float
        From then on the camera is gone.
    """

    stall_s: float = math.inf
    unplug_s: float = math.inf

    @classmethod
    def parse(cls, text: str) -> Faults:
        """Read ``stall@20``, ``unplug@20`` or both with a comma."""
        found: dict[str, float] = {}
        for part in text.split(","):
            name, _, seconds = part.partition("@")
            if name not in ("stall", "unplug"):
                raise InputError(
                    f"A simulated camera has no fault '{name}'.", "Write stall@SECONDS or unplug@SECONDS."
                )
            value = float(seconds)
            if not value >= 0:
                raise ValueError(seconds)
            found[f"{name}_s"] = value
        return cls(**found)


NO_FAULTS = Faults()
