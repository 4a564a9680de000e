"""A live OpenNI2 camera through the process border: rate, delay, processor time.

Depth and colour of 640 x 480 at 30/s, from a driver that feeds frames to the real OpenNI2 runtime (no camera
is attached), through the runtime's own process and shared memory to a reader that takes every frame it can.
The driver writes the clock into each depth picture: the delay is from there to the reader's copy. Processor
time is in percent of one core; that of the runtime's process contains the runtime and the feeding driver.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from devices.openni.cameras import OpenNICamera
from tests.devices.openni_driver.feed import build_redist, make_feed


def run(quick: bool = False) -> list[dict[str, Any]]:
    """Measure; see the module's docstring."""
    seconds = 3.0 if quick else 20.0
    with tempfile.TemporaryDirectory(prefix="geoderm-openni-") as name:
        built = build_redist(Path(name) / "redist")
        if isinstance(built, str):
            raise RuntimeError(built)
        os.environ["OPENNI2_REDIST64"] = str(built)
        feed = make_feed(Path(name) / "feed", infrared=False, stamp=1)
        opening = time.monotonic()
        with OpenNICamera(feed.uri) as camera:
            first = camera.latest(0, 10.0)
            assert first is not None
            opened_s = time.monotonic() - opening
            return [
                {"figure": "from open to the first frame", "value": round(opened_s, 2), "unit": "s"},
                *_stream(camera, first.number, seconds),
            ]


def _stream(camera: OpenNICamera, after: int, seconds: float) -> list[dict[str, Any]]:
    assert camera.runtime_pid is not None
    delays, clock_errors, apart, numbers = [], [], [], []
    mine, theirs = time.process_time(), _cpu_s(camera.runtime_pid)
    begun = time.monotonic()
    while time.monotonic() - begun < seconds:
        frame = camera.latest(after, 1.0)
        if frame is None or frame.depth is None:
            continue
        now = time.monotonic()
        after = frame.number
        made_s = int(frame.depth.ravel()[:4].copy().view(np.uint64)[0]) * 1e-9
        numbers.append(frame.number)
        delays.append(1e3 * (now - made_s))
        clock_errors.append(1e3 * (frame.time_s - made_s))
        apart.append(1e3 * abs(frame.time_s - frame.color_time_s))
    took = time.monotonic() - begun
    mine, theirs = time.process_time() - mine, _cpu_s(camera.runtime_pid) - theirs
    made = numbers[-1] - numbers[0] + 1
    return [
        {"figure": "frames taken", "value": round(len(numbers) / took, 2), "unit": "1/s", "to reach": "30/s"},
        {"figure": "frames published", "value": round(made / took, 2), "unit": "1/s", "to reach": "30/s"},
        {"figure": "frames that nobody took", "value": made - len(numbers), "unit": f"of {made}"},
        _spread("from the driver to the reader", delays),
        _spread("error of the frame's time", clock_errors),
        _spread("colour apart from depth", apart),
        {"figure": "processor time, reader", "value": round(100 * mine / took, 1), "unit": "% of a core"},
        {
            "figure": "processor time, runtime's process",
            "value": round(100 * theirs / took, 1),
            "unit": "% of a core",
        },
    ]


def _spread(figure: str, values: list[float]) -> dict[str, Any]:
    low, middle, high = np.percentile(values, [5, 50, 95])
    return {
        "figure": figure,
        "value": round(float(middle), 2),
        "unit": "ms",
        "spread": f"{low:.1f}-{high:.1f} (5-95 %)",
    }


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    for row in run(quick=True):
        print(row)
