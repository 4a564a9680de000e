"""``geoderm capture``: a good capture, or a reason why not; never a half-written folder."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.cli.main import main
from core.calibration.profile import CalibrationProfile, ProfileStore
from core.capture import read_capture, write_capture
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError
from core.progress import Progress, no_progress
from devices import registry
from devices.camera import DEFAULT_FRAMES
from tests.app.cli.conftest import Shot
from tests.devices.auxiliary.moving_body import BodyDepthCamera, Path3, hold_still

BAG = Path(__file__).parents[2] / "devices" / "realsense" / "software_camera.bag"


class CapturedBody(BodyDepthCamera):
    """Sees a moving body while it is waited for, and then takes a capture that was made before."""

    def __init__(self, taken: RgbdCapture, path: Path3 = hold_still) -> None:
        super().__init__(path)
        self._taken = taken

    @property
    def rig(self):  # type: ignore[no-untyped-def]
        return self._taken.rig if self._started is None else super().rig

    def use_profile(self, profile: CalibrationProfile | None) -> None:
        self._profile = profile

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        profile = None if self._profile is None else self._profile.document()
        return replace(self._taken, calibration=profile)


@pytest.fixture
def bodies(first: Shot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, object]:
    """Cameras of a kind of their own, by name."""
    monkeypatch.setenv("GEODERM_DATA_DIR", str(tmp_path / "clinic"))
    known: dict[str, object] = {}

    class Bodies:
        def devices(self) -> list[object]:
            return []

        def create(self, address: str) -> object:
            return known[address]

    monkeypatch.setitem(registry._factories, "body", Bodies())  # type: ignore[arg-type]
    return known


def test_a_capture_is_written_with_what_it_is_worth(
    first: Shot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "taken"
    code = main(["capture", f"folder:{first.folder}", str(out), "--view", "back", "--stance", "A", "--json"])
    assert code == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["view"], report["stance"], report["frames"]) == ("back", "A", 2)
    assert 0.8 < report["body_coverage"] <= 1.0
    assert report["calibration"] is None
    taken = read_capture(out)
    np.testing.assert_array_equal(taken.depth_frames, read_capture(first.folder).depth_frames)
    assert (taken.view, taken.stance) == ("back", "A")
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []
    assert main(["capture", f"folder:{first.folder}", str(tmp_path / "again")]) == 0
    text = capsys.readouterr().out
    assert "Body coverage" in text
    assert "Movement       not measured" in text, "two frames tell no movement"


def test_nothing_is_written_over(first: Shot, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = first.copy(tmp_path / "there")
    before = (out / "capture.json").read_bytes()
    assert main(["capture", f"folder:{first.folder}", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert (out / "capture.json").read_bytes() == before
    assert main(["capture", f"folder:{first.folder}", str(tmp_path / "no" / "where")]) == 2


@pytest.mark.parametrize(
    ("device", "code", "said"),
    [
        ("simulator:nobody", 2, "no simulated body"),
        ("camera", 2, "is not a camera"),
        ("shutter:1", 2, "no kind of camera"),
        ("folder:/nowhere", 2, "no such capture folder"),
        ("rig:uvc:0", 2, "is not a rig"),
        ("realsense:99", 3, "RealSense"),
        (f"realsense-bag:{BAG}", 3, "not kept"),
    ],
)
def test_what_cannot_be_captured_is_said_in_one_line(
    device: str, code: int, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["capture", device, str(tmp_path / "out"), "--frames", "3"]) == code
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert "Traceback" not in error
    assert list(tmp_path.iterdir()) == []


def test_wrong_options_are_refused(first: Shot, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    device, out = f"folder:{first.folder}", str(tmp_path / "out")
    assert main(["capture", device, out, "--when-still"]) == 2
    assert "sees the present" in capsys.readouterr().err
    assert main(["capture", device, out, "--profiles", str(tmp_path / "none")]) == 2
    assert main(["capture", device, out, "--frames", "0"]) == 2
    assert main(["capture", device]) == 2


def test_a_body_with_holes_is_not_kept(
    first: Shot, bodies: dict[str, object], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = read_capture(first.folder)
    depth = taken.depth_frames.copy()
    depth[:, ::3], depth[:, :, ::3], depth[:, 1::3, 1::3] = 0, 0, 0
    bodies["holes"] = CapturedBody(replace(taken, depth_frames=depth))
    assert main(["capture", "body:holes", str(tmp_path / "out")]) == 3
    assert "not kept" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_newest_calibration_of_the_cameras_is_used(
    first: Shot, bodies: dict[str, object], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = read_capture(first.folder)
    for folder in (tmp_path / "clinic" / "calibration", tmp_path / "other"):
        for _ in range(2 if folder.name == "other" else 1):
            ProfileStore(folder).add(CalibrationProfile(taken.rig, "D1", "D1"))
    for options, version in (([], 1), (["--profiles", str(tmp_path / "other")], 2)):
        bodies["seen"] = CapturedBody(taken)
        out = tmp_path / f"out{version}"
        assert main(["capture", "body:seen", str(out), "--json", *options]) == 0
        assert json.loads(capsys.readouterr().out)["calibration"]["version"] == version
        kept = read_capture(out).calibration
        assert kept is not None
        assert kept["version"] == version


def test_when_still_waits_for_a_body_that_holds_still(
    first: Shot, bodies: dict[str, object], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bodies["still"] = CapturedBody(read_capture(first.folder))
    assert main(["capture", "body:still", str(tmp_path / "a"), "--when-still"]) == 0
    bodies["restless"] = CapturedBody(read_capture(first.folder), lambda t: (0.1 * np.sin(6.0 * t), 0.0, 0.0))
    capsys.readouterr()
    assert main(["capture", "body:restless", str(tmp_path / "b"), "--when-still", "--wait-s", "3"]) == 3
    assert "did not hold still within 3 seconds" in capsys.readouterr().err
    assert not (tmp_path / "b").exists()


@pytest.mark.parametrize("moment", ["capture", "write", "move"])
def test_ctrl_c_leaves_nothing_half_written(
    moment: str,
    first: Shot,
    bodies: dict[str, object],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    camera = bodies["seen"] = CapturedBody(read_capture(first.folder))

    def stop(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    work = tmp_path / "work"
    work.mkdir()
    if moment == "capture":
        monkeypatch.setattr(camera, "capture", stop)
    elif moment == "write":
        monkeypatch.setattr("core.capture.folder._swap", stop)
    else:
        monkeypatch.setattr(Path, "rename", stop)
    assert main(["capture", "body:seen", str(work / "out")]) == 130
    assert list(work.iterdir()) == []
    assert camera.state.value == "closed", "the camera was released"
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write anywhere")
def test_a_folder_that_cannot_be_written_is_said(first: Shot, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    assert main(["capture", f"folder:{first.folder}", str(tmp_path / "out")]) == 2
    tmp_path.chmod(0o700)


def test_a_captured_folder_can_be_captured_again(first: Shot, tmp_path: Path) -> None:
    """A capture is itself a device: nothing is lost on the way through."""
    source = tmp_path / "source"
    write_capture(read_capture(first.folder), source)
    assert main(["capture", f"folder:{source}", str(tmp_path / "copy"), "--view", "front"]) == 0
    a, b = read_capture(source), read_capture(tmp_path / "copy")
    assert a.color is not None
    assert b.color is not None
    np.testing.assert_array_equal(a.color, b.color)
    assert a.rig == b.rig or a.rig.depth == b.rig.depth
    shutil.rmtree(source)


def test_a_capture_that_came_first_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two captures with one name at the same time: both found the name free, one may have it."""
    from app.cli import capture as command

    rig = CameraRig(PinholeCamera(64, 48, 58.0, 58.0, 31.5, 23.5))
    first, second = (RgbdCapture(np.full((1, 48, 64), d, np.uint16), 0.001, rig) for d in (1500, 1600))
    command._write(first, tmp_path / "c")
    monkeypatch.setattr(command, "_check_target", lambda out: None)
    with pytest.raises(InputError, match="c: exists already"):
        command._write(second, tmp_path / "c")
    assert read_capture(tmp_path / "c").depth_frames[0, 0, 0] == 1500
