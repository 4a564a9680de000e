"""The live preview in the real window: pictures and skeletons a second, and how long the window ever stalls.

A camera that plays prepared frames of a swaying simulated patient, 640 x 480 depth and colour at 30 a second,
stands in for a sensor, whose driver works in a process of its own. The visit page shows it with skeleton
(colour only) and readings, as it does for a patient. A timer of the window's thread that should fire every
5 ms tells how late it ever was. Run it on a screen or on a virtual one; what else the machine did is in the
rows.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
FPS = 30
SECONDS = 30.0
_TICK_MS = 5
_POSES = 12


class ReplayCamera:
    """A `devices.live.LiveCamera` that plays frames to and fro, at 30 a second."""

    def __init__(self, depth: np.ndarray, rgb: np.ndarray, rig: Any) -> None:
        from devices.camera import DeviceInfo
        from devices.live import CameraIdentity, LiveState

        self._depth, self._rgb, self._rig = depth, rgb, rig
        self.info = DeviceInfo("replay:bench", "Replayed frames", "recording", True)
        self.identity = CameraIdentity("Replay", "bench", "bench", "kinect-v1")
        self.rig, self.profile, self.state = rig, None, LiveState.STREAMING
        self._began = time.monotonic()

    def open(self) -> None:
        """Nothing to do."""

    def close(self) -> None:
        """Nothing to do."""

    def use_profile(self, profile: object) -> None:
        """No calibration."""

    def start(self, streams: Collection[str] = ()) -> None:
        """Always on."""

    def modes(self) -> tuple[()]:
        """None to choose from."""
        return ()

    def choose_mode(self, mode: object) -> None:
        """None to choose from."""

    def controls(self) -> tuple[()]:
        """None."""
        return ()

    def set_control(self, name: str, value: float) -> None:
        """None."""

    def preview(self) -> None:
        """Live."""

    def capture(self, frames: int = FPS, progress: object = None) -> None:
        """Not measured here."""

    def __enter__(self) -> ReplayCamera:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> Any:
        """The frame that is due; copied, as a driver's shared memory would be."""
        from devices.live import LiveFrame

        due = int((time.monotonic() - self._began) * FPS) + 1
        if due <= after:
            wait = self._began + after / FPS - time.monotonic()
            time.sleep(max(0.0, min(wait, timeout_s)))
            due = int((time.monotonic() - self._began) * FPS) + 1
            if due <= after:
                return None
        at = self._began + (due - 1) / FPS
        n = len(self._depth)
        step = due % (2 * n - 2)
        k = step if step < n else 2 * n - 2 - step
        color = self._rgb[(k * len(self._rgb)) // n]
        return LiveFrame(due, at, self._depth[k].copy(), 0.001, color.copy(), at)


def make_frames(folder: Path) -> Path:
    """Frames of a simulated patient in psi, written to a file."""
    from dataclasses import replace

    from devices.simulator import SimulatedPatient
    from devices.simulator.room import make_rig

    patient = SimulatedPatient("m_young_avg", seed=4, moles=60, freckles=40, rig=make_rig((640, 480)))
    taken = patient.capture("psi", frames=30).capture
    turned = [
        patient.capture("psi", frames=1, turn_deg=0.15 * k, seed=1).capture.color for k in range(_POSES)
    ]
    path = folder / "frames.npz"
    rig = replace(taken.rig)
    np.savez(path, depth=taken.depth_frames, rgb=np.stack(turned), rig=np.array([rig], dtype=object))
    return path


def measure(frames: Path, seconds: float) -> dict[str, float]:
    """Show the frames in a visit page for a while; called in a process of its own."""
    from PySide6.QtCore import QEvent, QEventLoop, Qt, QTimer
    from PySide6.QtWidgets import QApplication

    from app.context import AppContext
    from app.gui import application
    from app.windows.visit.page import VisitPage
    from core.records import ClinicStore, PatientDraft
    from core.warm_up import warm_up

    data = np.load(frames, allow_pickle=True)
    camera = ReplayCamera(data["depth"], data["rgb"], data["rig"][0])

    class Cameras:
        def list(self) -> list[Any]:
            return [camera.info]

        def open(self, camera_id: str) -> ReplayCamera:
            return camera

    warm_up()
    app = application()
    with tempfile.TemporaryDirectory() as scratch, ClinicStore.open(Path(scratch) / "clinic") as store:
        user = store.users.create("bench", "Benchmark", "a long password")
        person = store.patients.create(PatientDraft("Bench", "Mark"), by=user.id)
        context = AppContext(store, store.folder, cameras=Cameras())
        context.log_in(user)
        page = VisitPage(context, person.id)
        page.resize(1440, 900)
        page.show()
        deck, view = page.captures.deck, page.captures.stance.live_view
        counts = {"pose": 0, "guide": 0}
        deck.live.posed.connect(lambda: counts.__setitem__("pose", counts["pose"] + 1))
        deck.live.guided.connect(lambda: counts.__setitem__("guide", counts["guide"] + 1))
        deadline = time.monotonic() + 60
        while counts["pose"] < 20 and time.monotonic() < deadline:
            app.processEvents()
            time.sleep(0.002)
        gaps: list[float] = []
        last = [time.perf_counter()]

        def tick() -> None:
            now = time.perf_counter()
            gaps.append(now - last[0])
            last[0] = now

        ticker = QTimer(timerType=Qt.TimerType.PreciseTimer, interval=_TICK_MS)
        ticker.timeout.connect(tick)
        counts.update(pose=0, guide=0)
        painted, cpu, began = view.frames_painted, time.process_time(), time.perf_counter()
        last[0] = began
        ticker.start()
        loop = QEventLoop()  # not the application's: ending that would close the window
        QTimer.singleShot(round(1000 * seconds), loop.quit)
        loop.exec()
        ticker.stop()
        took = time.perf_counter() - began
        stalls = 1000.0 * np.maximum(np.array(gaps) - _TICK_MS / 1000.0, 0.0)
        found = {
            "pictures": (view.frames_painted - painted) / took,
            "skeletons": counts["pose"] / took,
            "readings": counts["guide"] / took,
            "stall_max": float(stalls.max()),
            "stall_99": float(np.percentile(stalls, 99)),
            "cpu": 100.0 * (time.process_time() - cpu) / took,
            "person": float(deck.live.pose is not None),
        }
        page.leave()
        page.close()
        page.deleteLater()
        context.tasks.shut_down()
        QApplication.processEvents()
        QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    return found


_RUN = """
import json, sys
from pathlib import Path
from tests.benchmarks.bench_live import measure
print("measured", json.dumps(measure(Path(sys.argv[1]), float(sys.argv[2]))), flush=True)
"""


def run(quick: bool = False) -> list[dict[str, Any]]:
    """Measure; see the module's docstring."""
    import json

    seconds = 8.0 if quick else SECONDS
    with tempfile.TemporaryDirectory() as folder:
        frames = make_frames(Path(folder))
        before = os.getloadavg()[0]
        done = subprocess.run(
            [sys.executable, "-c", _RUN, str(frames), str(seconds)],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            timeout=180,
            check=False,
        )
    lines = [line for line in done.stdout.splitlines() if line.startswith("measured")]
    if not lines:
        raise RuntimeError(
            f"the window did not appear; run it on a screen or a virtual one\n{done.stderr[-2000:]}"
        )
    found = json.loads(lines[0].split(" ", 1)[1])
    if not found["person"]:
        raise RuntimeError("no skeleton was found in the frames: the figures would mean nothing")
    window = f"{seconds:.0f} s, load before {before:.1f} on {os.cpu_count()} cores"

    def row(figure: str, value: float, unit: str, to_reach: str = "") -> dict[str, Any]:
        return {
            "figure": figure,
            "value": round(value, 1),
            "unit": unit,
            "to reach": to_reach,
            "over": window,
        }

    return [
        row("live pictures shown, 640 x 480 depth and colour", found["pictures"], "/s", "30 /s"),
        row("skeleton updates, colour only", found["skeletons"], "/s", "12 /s"),
        row("readings", found["readings"], "/s", "10 /s"),
        row("longest stall of the window's thread", found["stall_max"], "ms", "50 ms"),
        row("99th percentile of its stalls", found["stall_99"], "ms"),
        row("processor, of one core", found["cpu"], "%", "200 %"),
    ]


if __name__ == "__main__":
    for line in run(quick="--quick" in sys.argv):
        print(line)
