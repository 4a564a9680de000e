"""1,000 damaged ``.oni`` recordings: each gives frames or a clear message.

Bits flipped, headers changed, absurd sizes, files cut off (with and without a proper end), records swapped,
repeated and missing, blocks overwritten, properties and codecs changed; seeded, on recordings of our writer
(depth and colour without loss; colour as JPEG) and of the runtime's own recorder (depth as 16zT, where a
compiler for the test driver is at hand). "refused" is before the runtime sees the file, "message" while it
plays. The last rows hand damaged files to the runtime without our inspection: what its crashes and hangs
then cost is a message as well, because it lives in a process of its own.
"""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any
from unittest import mock

from devices.openni import recording
from devices.openni.cameras import OpenNICamera
from devices.openni.oni_layout import inspect_oni
from devices.recordings.recorder import Limits, record
from tests.devices.openni.oni_mutations import LONGEST_S, MUTATIONS, Outcome, mutate, play, write_original
from tests.devices.openni_driver.feed import build_redist, make_feed

DAMAGED = 1000
UNINSPECTED = 160


def run(quick: bool = False) -> list[dict[str, Any]]:
    """Measure; see the module's docstring."""
    with tempfile.TemporaryDirectory(prefix="geoderm-fuzz-") as name:
        folder = Path(name)
        originals = _originals(folder)
        count = 40 if quick else DAMAGED
        begun = time.monotonic()
        rows, outcomes = _campaign(folder, originals, count, "")
        took = time.monotonic() - begun
        rows.append({"figure": "time for each file", "value": round(1e3 * took / count), "unit": "ms"})
        peaks = [o.peak_mib for o in outcomes if o.peak_mib]
        rows.append(
            {
                "figure": "largest memory of the runtime's process while it plays",
                "value": round(max(peaks, default=0.0)),
                "unit": "MiB",
            }
        )
        rows += _uninspected(folder, originals, 16 if quick else UNINSPECTED)
    return rows


def _originals(folder: Path) -> dict[str, Path]:
    originals = {"lossless": folder / "lossless.oni", "jpeg": folder / "jpeg.oni"}
    write_original(originals["lossless"])
    write_original(originals["jpeg"], codec="JPEG")
    built = build_redist(folder / "redist")
    if isinstance(built, Path):
        os.environ["OPENNI2_REDIST64"] = str(built)
        originals["runtime"] = folder / "runtime.oni"
        feed = make_feed(folder / "feed", color=False, infrared=False)
        with OpenNICamera(feed.uri) as camera:
            camera.choose_mode(next(m for m in camera.modes() if m.width == 320))
            record(camera, originals["runtime"], Limits(None, 5, threading.Event()))
    return originals


def _campaign(
    folder: Path, originals: dict[str, Path], count: int, label: str
) -> tuple[list[dict[str, Any]], list[Outcome]]:
    contents = {name: path.read_bytes() for name, path in originals.items()}
    summaries = {name: inspect_oni(path) for name, path in originals.items()}
    outcomes: list[Outcome] = []
    ways: Counter[str] = Counter()
    raised = 0
    for seed in range(count):
        original = list(contents)[(seed // len(MUTATIONS)) % len(contents)]
        damage, data = mutate(contents[original], seed)
        path = folder / "damaged.oni"
        path.write_bytes(data)
        try:
            if label:
                with mock.patch.object(recording, "inspect_oni", lambda _p, s=summaries[original]: s):
                    outcome = play(path)
            else:
                outcome = play(path)
        except Exception as error:  # noqa: BLE001 - what is counted here is exactly what must not happen
            print(f"seed {seed} ({damage}, {original}): {type(error).__name__}: {error}", flush=True)
            raised += 1
            continue
        outcomes.append(outcome)
        ways[damage] += 1
        if outcome.seconds > LONGEST_S or outcome.child_left:
            print(f"seed {seed} ({damage}, {original}): {outcome}", flush=True)
    kinds = Counter(o.kind for o in outcomes)
    rows = [
        {"figure": f"damaged recordings{label}", "value": count, "unit": f"{len(originals)} originals"},
        *(
            {"figure": f"{kind}{label}", "value": kinds[kind], "unit": "files"}
            for kind in ("refused", "message", "frames")
        ),
        _row(f"crash or hang of the runtime's process, told as a message{label}", _crashes(outcomes), ""),
        _row(f"neither frames nor message{label}", raised, "0"),
        _row(f"files that took longer than {LONGEST_S:.0f} s{label}", _slow(outcomes), "0"),
        _row(f"processes left behind{label}", sum(o.child_left for o in outcomes), "0"),
    ]
    rows.append(
        {
            "figure": f"longest{label}",
            "value": round(max(o.seconds for o in outcomes), 1),
            "unit": "s",
            "to reach": f"{LONGEST_S:.0f} s",
        }
    )
    return rows, outcomes


def _row(figure: str, value: int, to_reach: str) -> dict[str, Any]:
    return {"figure": figure, "value": value, "unit": "files", "to reach": to_reach}


def _crashes(outcomes: list[Outcome]) -> int:
    return sum(o.crashed for o in outcomes)


def _slow(outcomes: list[Outcome]) -> int:
    return sum(o.seconds > LONGEST_S for o in outcomes)


def _uninspected(folder: Path, originals: dict[str, Path], count: int) -> list[dict[str, Any]]:
    return _campaign(folder, originals, count, ", not inspected")[0]


if __name__ == "__main__":
    for row in run(quick=True):
        print(row)
