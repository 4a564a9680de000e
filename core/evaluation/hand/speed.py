"""How long the tracker takes, from the arrays of a capture to the answer."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from core.evaluation.hand.scores import FrameScore


def speed_of(scores: Sequence[FrameScore]) -> dict[str, Any]:
    """Frames per second and time by step; the first frame of all, in which libraries load, does not count.

    The clock says what this machine did while others worked on it too; the processor's time, of all threads
    together, is what the work itself takes.
    """
    counted = scores[1:]
    if not counted:
        return {}
    wall, cpu = np.array([s.wall_s for s in counted]), np.array([s.cpu_s for s in counted])
    steps = dict.fromkeys(step for s in counted for step in s.times_s)
    return {
        "frames": len(counted),
        "frames_per_s": float(len(counted) / wall.sum()),
        "frames_per_cpu_s": float(len(counted) / cpu.sum()),
        "wall_ms": {"median": float(1e3 * np.median(wall)), "p90": float(1e3 * np.quantile(wall, 0.9))},
        "cpu_ms": {"median": float(1e3 * np.median(cpu)), "p90": float(1e3 * np.quantile(cpu, 0.9))},
        "by_step_ms": {
            step: float(1e3 * np.mean([s.times_s.get(step, 0.0) for s in counted])) for step in steps
        },
        "load": round(os.getloadavg()[0], 1),
    }
