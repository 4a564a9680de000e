"""The installed command as another program sees it: exit code, standard output, standard error."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.app.cli.cases import empty_room, without_joints
from tests.app.cli.conftest import Shot

COMMAND = Path(sys.executable).with_name("geoderm")

pytestmark = pytest.mark.skipif(not COMMAND.exists(), reason="the command geoderm is not installed here")


def run(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = {
        k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONWARNINGS", "DISPLAY")
    }
    return subprocess.run(
        [COMMAND, *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        timeout=120,
        check=False,
        env={**environment, "GEODERM_LOG_DIR": str(cwd / "log")},
    )


def test_capture_info_prints_json_alone_and_no_library_speaks(first: Shot, tmp_path: Path) -> None:
    """With the tracker, that is with every library that likes to write to standard error."""
    folder = without_joints(first.copy(tmp_path / "capture"))
    done = run("capture-info", folder, "--json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert set(json.loads(done.stdout)) == {"joints", "frames", "body_coverage", "depth_noise_m", "warnings"}


def test_relocate_says_nothing_when_all_is_well(first: Shot, followup: Shot, tmp_path: Path) -> None:
    lesions = first.lesions(tmp_path / "lesions.json", 2)
    arguments = ("relocate", first.folder, followup.folder, "--lesions", lesions, "--out", "result.json")
    done = run(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(json.loads((tmp_path / "result.json").read_text())["lesions"]) == 2


def test_bad_input_is_one_line_and_code_2(first: Shot, tmp_path: Path) -> None:
    folder = first.copy(tmp_path / "capture")
    (folder / "color.png").write_bytes(b"no picture")
    done = run("capture-info", folder, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert str(folder / "color.png") in done.stderr
    assert "color.file" in done.stderr


def test_no_body_is_one_line_and_code_3(first: Shot, tmp_path: Path) -> None:
    """Late, when the tracker and the kernels have been loaded."""
    folder = empty_room(without_joints(first.copy(tmp_path / "capture")))
    lesions = first.lesions(tmp_path / "lesions.json", 2)
    start = without_joints(first.copy(tmp_path / "start"))
    done = run("relocate", start, folder, "--lesions", lesions, "--out", "r.json", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (3, "")
    assert done.stderr.count("\n") == 1
    assert "No body" in done.stderr
    assert not (tmp_path / "r.json").exists()


def test_wrong_use_is_one_line_and_code_2(tmp_path: Path) -> None:
    done = run("relocate", "a", "b", "--lesions", "l.json", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "--out" in done.stderr


def test_the_module_is_the_same_command(tmp_path: Path) -> None:
    """``python -m app`` is ``geoderm``."""
    mesh = tmp_path / "m.off"
    mesh.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 nan\n3 0 1 2\n")
    arguments = ["geodesics", str(mesh), "--sources", "0", "--out", str(tmp_path / "d.npy")]
    done = subprocess.run(
        [sys.executable, "-m", "app", *arguments], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "vertex 2" in done.stderr


def test_a_reader_that_stops_reading_causes_no_noise(first: Shot, tmp_path: Path) -> None:
    """``geoderm ... | head -1`` leaves nothing on standard error."""
    with subprocess.Popen(
        [COMMAND, "capture-info", str(first.folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
        env={**os.environ, "GEODERM_LOG_DIR": str(tmp_path / "log")},
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        error = process.stderr.read()
        process.wait(timeout=120)
    assert error == b""
