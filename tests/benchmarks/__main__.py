"""``make bench``: measures every claimed figure and writes docs/benchmarks/.

Each ``bench_*.py`` beside this file has ``run(quick) -> list of rows``. A row has at least ``figure`` (what),
``value`` and ``unit``; further columns (``peer``, ``ratio``, ``spread`` ...) are printed as they come.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import subprocess
import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
OUT = HERE.parents[1] / "docs" / "benchmarks"
LIBRARIES = ("numpy", "scipy", "numba", "open3d-cpu", "opencv-python-headless", "mediapipe", "potpourri3d")


def machine() -> dict[str, Any]:
    """What the figures were measured on."""
    try:
        model = next(
            line.split(":", 1)[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if line.startswith("model name")
        )
    except (OSError, StopIteration):
        model = platform.processor()
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, cwd=HERE, check=False
    ).stdout.strip()
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": commit,
        "cpu": model,
        "cores": os.cpu_count(),
        "load_before": round(os.getloadavg()[0], 2),
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in LIBRARIES},
    }


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Markdown table of rows, one column for every key that occurs."""
    keys = list(dict.fromkeys(k for row in rows for k in row))
    lines = ["| " + " | ".join(keys) + " |", "|" + "---|" * len(keys)]
    lines += ["| " + " | ".join(_cell(row.get(k, "")) for k in keys) + " |" for row in rows]
    return "\n".join(lines)


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def main() -> None:
    """Run the benchmarks and write the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="only these, for example geodesics accuracy")
    parser.add_argument("--quick", action="store_true", help="few repetitions and cases; nothing is written")
    arguments = parser.parse_args()
    facts = machine()
    names = arguments.names or sorted(p.stem.removeprefix("bench_") for p in HERE.glob("bench_*.py"))
    for name in names:
        started = time.perf_counter()
        module = importlib.import_module(f"tests.benchmarks.bench_{name}")
        rows = module.run(quick=arguments.quick)
        seconds = round(time.perf_counter() - started, 1)
        print(f"\n## {name} ({seconds} s)\n\n{table(rows)}\n", flush=True)
        if not arguments.quick:
            OUT.mkdir(parents=True, exist_ok=True)
            document = {"benchmark": name, "machine": facts, "seconds": seconds, "rows": rows}
            (OUT / f"{name}.json").write_text(json.dumps(document, indent=1, default=float) + "\n")
            about = (module.__doc__ or "").strip()
            measured = (
                f"Measured {facts['date']} at commit {facts['commit']} "
                f"on {facts['cores']} cores of {facts['cpu']}, Python {facts['python']}, "
                f"load before {facts['load_before']}."
            )
            (OUT / f"{name}.md").write_text(f"# {name}\n\n{about}\n\n{table(rows)}\n\n{measured}\n")
    if not arguments.quick:
        print(f"written to {OUT}")


if __name__ == "__main__":
    main()
