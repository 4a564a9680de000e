"""From frames to answers: fusing and smoothing 30 frames, a click, a follow-up with 60 lesions, starting.

Medians and spreads (interquartile range) of repeated runs on a simulated patient at 2.3 m, 30 depth frames
and a 2560 x 1920 picture, the skeleton tracker's own joints. Absolute times are context: they hold for the
machine below, and for whatever else it was doing. The processor time of a follow-up is steadier: on two free
cores the wall clock shows between half of it and all of it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
FOLLOW_UP_LESIONS = 60


def _times_ms(work: Callable[[], object], repeats: int) -> np.ndarray:
    taken = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        taken.append(1e3 * (time.perf_counter() - started))
    return np.array(taken)


def _row(figure: str, taken: np.ndarray, to_reach: str) -> dict[str, Any]:
    low, middle, high = np.percentile(taken, [25, 50, 75])
    return {
        "figure": figure,
        "value": round(float(middle), 1),
        "unit": "ms",
        "spread": f"{low:.1f}-{high:.1f}",
        "runs": len(taken),
        "to reach": to_reach,
    }


def run(quick: bool = False) -> list[dict[str, Any]]:
    """Measure; see the module's docstring."""
    from core.anchors import analyse_capture
    from core.geodesics import geodesic_fields
    from core.relocation import LesionQuery, relocate
    from core.surface import denoise_depth, fuse_depth, pick_skin
    from core.warm_up import warm_up
    from devices.simulator import SimulatedPatient
    from devices.trackers import default_tracker

    repeats = 3 if quick else 9
    warm_up()
    patient = SimulatedPatient("m_young_avg", 11, moles=400, lesions=FOLLOW_UP_LESIONS * 3)
    first_seen = patient.capture("psi", distance_m=2.3, visit=1)
    second_seen = patient.capture("A", distance_m=2.3, visit=2)
    tracker = default_tracker()
    first = analyse_capture(first_seen.capture, tracker)
    frames, unit = first_seen.capture.depth_frames, first_seen.capture.depth_unit_m
    rows = [
        _row(
            "30 frames fused and denoised",
            _times_ms(lambda: denoise_depth(fuse_depth(frames, unit).depth_m), repeats),
            "150 ms",
        )
    ]
    truth = first_seen.truth
    pixels = [
        tuple(map(float, p)) for p, seen in zip(truth.mole_pixels, truth.mole_visible, strict=True) if seen
    ]
    fields = geodesic_fields(first.scan.surface, first.anchors.as_mapping())
    clicks = iter(pixels * repeats)

    def click() -> None:
        point = pick_skin(first.scan, next(clicks)).point
        if point is not None:
            fields.at([point])

    click()
    rows.append(_row("click to signature (fields ready)", _times_ms(click, repeats * 3), "50 ms"))
    queries = [LesionQuery(f"L{i}", pixel=p) for i, p in enumerate(pixels[:FOLLOW_UP_LESIONS])]

    spent = []

    def follow_up() -> None:
        started = time.process_time()
        relocate(first, analyse_capture(second_seen.capture, tracker), queries)
        spent.append(1e3 * (time.process_time() - started))

    # The first visit's spots and geodesics are known from when it was opened.
    relocate(first, first, queries)
    before = _memory_mib("VmRSS")
    peak_forgotten = _forget_peak()
    follow_up()
    if peak_forgotten:
        rows.append(
            {
                "figure": "follow-up, memory on top",
                "value": round(_memory_mib("VmHWM") - before),
                "unit": "MiB",
                "to reach": "600 MiB",
            }
        )
    spent.clear()
    taken = _times_ms(follow_up, repeats)
    rows.append(_row(f"follow-up, capture to answers, {len(queries)} lesions", taken, "4000 ms"))
    rows.append(_row("follow-up, processor time of all threads", np.array(spent), ""))
    rows.append(_row("window visible after start", _start_times_ms(3 if quick else 5), "1500 ms"))
    return rows


def _forget_peak() -> bool:
    """Let the kernel measure the peak of memory from now on; only Linux can, and says so."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return False
    return True


def _memory_mib(name: str) -> float:
    """``VmRSS`` (memory now) or ``VmHWM`` (its peak); 0 where the system does not tell."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith(name)), 0.0)


_START = """
import sys, time
from pathlib import Path
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication
from app.gui import run_gui
def quit_when_shown(window):
    if window.windowHandle() is not None and window.windowHandle().isExposed():
        print("shown", time.time(), flush=True)
        window.close()
    else:
        QTimer.singleShot(5, lambda: quit_when_shown(window))
run_gui(Path(sys.argv[1]), when_open=quit_when_shown)
"""


def _make_clinic(folder: Path) -> None:
    from core.records import ClinicStore

    with ClinicStore.open(folder) as store:
        store.users.create("bench", "Benchmark", "a long password")


def _start_times_ms(repeats: int) -> np.ndarray:
    taken = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            _make_clinic(Path(folder))
            started = time.time()
            printed = subprocess.run(
                [sys.executable, "-c", _START, folder],
                cwd=ROOT,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                capture_output=True,
                text=True,
                timeout=120,
                check=False,
            ).stdout
        shown = [line for line in printed.splitlines() if line.startswith("shown")]
        if not shown:
            raise RuntimeError("the window did not appear; run the benchmark on a screen or a virtual one")
        taken.append(1e3 * (float(shown[0].split()[1]) - started))
    return np.array(taken)


if __name__ == "__main__":
    for row in run(quick=True):
        print(row)
