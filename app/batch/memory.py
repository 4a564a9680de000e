"""The most memory that this process holds while it works on one pair."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

_LINUX_STATUS = Path("/proc/self/status")
_LINUX_RESET = Path("/proc/self/clear_refs")


def forget_peak() -> None:
    """Start counting anew where the system can (Linux); elsewhere the peak is that of the process so far."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            _LINUX_RESET.write_text("5")


def peak_bytes() -> int:
    """The highest resident memory since `forget_peak`, in bytes; 0 where it cannot be told."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        for line in _LINUX_STATUS.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    if os.name == "nt":
        import psutil

        return int(psutil.Process().memory_info().peak_wset)
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
