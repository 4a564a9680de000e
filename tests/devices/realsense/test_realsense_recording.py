"""Recordings written by the RealSense library itself: .db3 by the installed version, .bag by 2.55."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyrealsense2", reason="the optional library pyrealsense2 is not installed")

from core.capture import read_capture, write_capture
from core.errors import Cancelled, InputError, WorkError
from devices.realsense.recording import RealSenseRecording
from devices.registry import open_device
from tests.devices.realsense.software_device import SERIAL, TRUE_UNIT_M, record

BAG = Path(__file__).with_name("software_camera.bag")
BAG_FRAMES = 12


@pytest.fixture(scope="module")
def db3(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rs") / "session.db3"
    record(str(path), 20)
    return path


@pytest.mark.parametrize("kind", [".bag", ".db3"])
def test_frames_come_in_order_none_lost_and_the_file_starts_again(kind: str, db3: Path) -> None:
    path, total = (BAG, BAG_FRAMES) if kind == ".bag" else (db3, 20)
    with open_device(f"realsense-bag:{path}") as camera:
        assert camera.info.kind == "recording"
        assert not camera.info.live
        first = camera.capture(8)
        assert first.depth_frames[:, 50, 50].tolist() == list(range(4001, 4009))
        assert first.depth_unit_m == TRUE_UNIT_M
        assert first.sensor == "realsense-d4xx"
        assert first.color is not None
        assert abs(int(first.color[0, 0, 1]) - 4.5) <= 1, "the picture nearest to the middle"
        assert first.warnings == ()
        rest = camera.capture(30)
        assert rest.depth_frames[:, 50, 50].tolist() == list(range(4009, 4001 + total))
        assert any("ended after" in w for w in rest.warnings)
        again = camera.capture(3)
        assert again.depth_frames[:, 50, 50].tolist() == [4001, 4002, 4003]


def test_a_recording_becomes_a_capture_folder(tmp_path: Path) -> None:
    with RealSenseRecording(BAG) as camera:
        capture = camera.capture(4)
        assert camera.preview() is not None
    # The stamps are of the host's clock, 1 790 000 000 s and the first frames.
    assert abs((capture.taken_at - datetime.fromtimestamp(1_790_000_000.08, UTC)).total_seconds()) < 0.05
    write_capture(capture, tmp_path / "c")
    back = read_capture(tmp_path / "c")
    np.testing.assert_array_equal(back.depth_frames, capture.depth_frames)
    assert back.rig.color is not None
    assert capture.rig.color is not None
    assert back.rig.color.distortion == capture.rig.color.distortion
    assert SERIAL not in str(back.warnings)


def test_foreign_missing_and_misnamed_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "letter.bag").write_text("Dear colleague")
    shutil.copy(BAG, tmp_path / "bag.db3")
    shutil.copy(BAG, tmp_path / "x.oni")
    for name in ("letter.bag", "bag.db3", "x.oni", "nowhere.bag"):
        with pytest.raises(InputError, match=name.replace(".", r"\.")):
            RealSenseRecording(tmp_path / name)


@pytest.mark.parametrize("keep", [0.0005, 0.3, 0.98])
def test_a_truncated_recording_is_a_message(tmp_path: Path, keep: float) -> None:
    path = tmp_path / "cut.bag"
    data = BAG.read_bytes()
    path.write_bytes(data[: int(len(data) * keep)])
    camera = RealSenseRecording(path)
    with pytest.raises((InputError, WorkError), match="recording"):
        camera.open()
    camera.close()
    assert camera.pid is None


@pytest.mark.parametrize("seed", range(int(os.environ.get("GEODERM_BAG_MUTATIONS", "4"))))
def test_a_damaged_recording_never_takes_the_application_along(tmp_path: Path, seed: int) -> None:
    """Bytes changed anywhere: the library may complain, crash or hang in its process; we get a message."""
    dice = random.Random(seed)
    data = bytearray(BAG.read_bytes())
    for _ in range(dice.choice([1, 8, 64])):
        data[dice.randrange(13, len(data))] = dice.randrange(256)
    path = tmp_path / "damaged.bag"
    path.write_bytes(data)
    camera = RealSenseRecording(path)
    pid = None
    try:
        with contextlib.suppress(InputError, WorkError):
            camera.open()
            pid = camera.pid
            assert camera.capture(5).depth_frames.dtype == np.uint16
    finally:
        camera.close()
    assert pid is None or not Path(f"/proc/{pid}").exists()


def test_a_capture_can_be_cancelled() -> None:
    def stop(fraction: float, message: str = "") -> None:
        raise Cancelled

    with RealSenseRecording(BAG) as camera, pytest.raises(Cancelled):
        camera._burst(5, stop)
