"""Our files in a program that is not ours: OpenNI2's own C++ interface, default settings, real time."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from core.capture.camera import PinholeCamera
from devices.openni.oni_file import OniWriter
from devices.openni.runtime import runtime_folders

SOURCE = Path(__file__).resolve().parents[1] / "openni_driver/read_oni.cpp"
SIZE = PinholeCamera(320, 240, 290.0, 290.0, 159.5, 119.5)
DEPTH, COLOR = 3, 2


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    library = next((lib for f in runtime_folders() for lib in sorted(f.glob("libOpenNI2.so*"))), None)
    if library is None or shutil.which("g++") is None or not Path("/usr/include/openni2/OpenNI.h").is_file():
        pytest.skip("needs the OpenNI2 runtime, its headers and a compiler (libopenni2-dev, g++)")
    program = tmp_path_factory.mktemp("reader") / "read_oni"
    command = ["g++", "-O1", "-I/usr/include/openni2", str(SOURCE), str(library), "-o", str(program)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    if built.returncode != 0:
        pytest.skip(f"the reader does not compile here: {built.stderr[:300]}")
    return program


def test_a_program_on_the_stock_runtime_plays_our_recording(reader: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    depth = rng.integers(500, 4000, (12, 240, 320)).astype(np.uint16)
    color = rng.integers(0, 255, (12, 240, 320, 3)).astype(np.uint8)
    with OniWriter(tmp_path / "a.oni", SIZE, color_camera=SIZE) as writer:
        for i in range(12):
            writer.write(depth[i], color[i], i / 30)
    done = subprocess.run(
        [str(reader), str(tmp_path / "a.oni"), "24"], capture_output=True, text=True, timeout=60, check=True
    )
    lines = [tuple(map(int, line.split())) for line in done.stdout.splitlines()]
    wanted = {
        DEPTH: {int(d.view(np.uint8).sum()) for d in depth},
        COLOR: {int(c.astype(np.uint64).sum()) for c in color},
    }
    # In real time a busy computer misses frames; what comes is right, and most comes.
    assert sum(kind == DEPTH for kind, *_ in lines) >= 6
    assert sum(kind == COLOR for kind, *_ in lines) >= 6
    for kind, width, height, _stamp, total in lines:
        assert (width, height) == (320, 240)
        assert total in wanted[kind]
