"""Recordings put together by hand, or damaged: one message that names the file, never a hang."""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path

import numpy as np
import pytest

from core.calibration.board import BoardSpec
from core.calibration.profile import CalibrationProfile, ProfileStore
from core.calibration.view_folder import ViewFolderInfo, ViewFolderWriter, read_views
from core.capture import RgbdCapture, read_capture, write_capture
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.errors import InputError, WorkError
from devices.openni.calibration import calibration_path, read_calibration
from devices.openni.oni_file import OniWriter
from devices.openni.recording import write_oni
from devices.recordings.recorder import Limits, record
from devices.recordings.sources import SEQUENCE_FILE, open_source
from devices.recordings.targets import OniTarget
from devices.registry import open_device


def capture_of(width: int, frames: int = 2) -> RgbdCapture:
    camera = PinholeCamera(width, 48, 58.0, 58.0, width / 2 - 0.5, 23.5)
    return RgbdCapture(np.full((frames, 48, width), 1500, np.uint16), 0.001, CameraRig(camera))


def no_limits() -> Limits:
    return Limits(None, None, threading.Event())


def test_captures_of_two_cameras_are_not_one_recording(tmp_path: Path) -> None:
    write_capture(capture_of(64), tmp_path / "in/a")
    write_capture(capture_of(96), tmp_path / "in/b")
    with pytest.raises(WorkError, match=r"b/capture.json: depth.intrinsics: 96 x 48 pixels.*2 frames"):
        record(open_source(tmp_path / "in"), tmp_path / "out", no_limits(), burst=3)
    assert read_capture(tmp_path / "out/capture_0001").depth_frames.shape == (2, 48, 64)


def test_a_writer_that_fails_ends_the_recording_instead_of_waiting_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise ValueError("broken")

    monkeypatch.setattr(OniTarget, "add", fails)
    write_capture(capture_of(64, 100), tmp_path / "in")
    with pytest.raises(ValueError, match="broken"):
        record(open_source(tmp_path / "in"), tmp_path / "out.oni", no_limits())


@pytest.mark.parametrize(
    ("times", "named"),
    [([[0.0, 1e300], [0, 1]], "captures.0.times_s.1"), ([[5.0, 6.0], [0.0, 1.0]], "captures.1.times_s")],
)
def test_times_that_cannot_be_are_refused(tmp_path: Path, times: list[list[float]], named: str) -> None:
    entries = [{"folder": f"c{i}", "times_s": t} for i, t in enumerate(times)]
    (tmp_path / SEQUENCE_FILE).write_text(json.dumps({"format": "geoderm-sequence/1", "captures": entries}))
    with pytest.raises(InputError, match=named):
        open_source(tmp_path)


def test_a_calibration_that_is_none_is_refused_with_its_file(tmp_path: Path) -> None:
    write_capture(capture_of(64), tmp_path / "in")
    file = tmp_path / "in/capture.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "calibration": {"id": "x"}}))
    with pytest.raises(InputError, match=r"capture.json: calibration: format"):
        open_source(tmp_path / "in").facts()


def test_a_view_that_did_not_fit_on_the_disk_leaves_no_half_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = ViewFolderWriter(tmp_path / "views", ViewFolderInfo("D", "", "", "", BoardSpec.for_paper("A3")))
    grey = np.zeros((48, 64), np.uint8)
    writer.add(grey, None, None)
    before = {p.name: p.read_bytes() for p in (tmp_path / "views").iterdir()}

    def full(path: Path, text: str, **_: object) -> None:
        path.write_bytes(text[:9].encode())
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(WorkError, match="No space left"):
        writer.add(grey, None, None)
    assert {p.name: p.read_bytes() for p in (tmp_path / "views").iterdir()} == before


def test_a_day_outside_the_calendar_is_refused() -> None:
    document = CalibrationProfile(CameraRig(capture_of(64).rig.depth), "D").document()
    with pytest.raises(InputError, match="made_at"):
        CalibrationProfile.from_document({**document, "made_at": "0001-01-01T00:00:00+23:59"})


def test_a_link_to_nowhere_is_not_replaced_and_a_full_disk_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_capture(capture_of(64), tmp_path / "in")
    (tmp_path / "link.oni").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"link.oni: exists already"):
        record(open_source(tmp_path / "in"), tmp_path / "link.oni", no_limits())
    monkeypatch.setattr("devices.recordings.recorder._free_bytes", lambda _: 0)
    with pytest.raises(WorkError, match=r"out.oni: nothing was recorded: less than 100 MB"):
        record(open_source(tmp_path / "in"), tmp_path / "out.oni", no_limits())
    assert not (tmp_path / "out.oni").exists()


def test_two_recordings_never_share_a_file(tmp_path: Path) -> None:
    camera = capture_of(64).rig.depth
    with OniWriter(tmp_path / "a.oni", camera) as first:
        first.write(np.full((48, 64), 1500, np.uint16))
        with pytest.raises(InputError, match=r"a.oni.part: exists already"):
            OniWriter(tmp_path / "a.oni", camera)
        write_capture(capture_of(64), tmp_path / "in")
        with pytest.raises(InputError, match=r"a.oni.part: exists already"):
            record(open_source(tmp_path / "in"), tmp_path / "a.oni", no_limits())
    assert open_source(tmp_path / "a.oni").facts().frames == 1


def test_text_that_no_file_can_hold_is_refused() -> None:
    document = CalibrationProfile(CameraRig(capture_of(64).rig.depth), "D").document()
    with pytest.raises(InputError, match="color_serial"):
        CalibrationProfile.from_document({**document, "color_serial": "\ud800"})


def test_a_folder_under_recording_is_opened_or_the_way_to_it_is_told(tmp_path: Path) -> None:
    write_capture(capture_of(64), tmp_path / "in/a")
    with open_device(f"recording:{tmp_path / 'in/a'}") as camera:
        assert camera.capture().depth_frames.shape == (2, 48, 64)
    with pytest.raises(InputError, match=r"\?live"):
        open_device(f"recording:{tmp_path / 'in'}")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names here")
def test_a_pipe_in_the_place_of_a_file_is_not_waited_for(tmp_path: Path) -> None:
    recording = tmp_path / "a.oni"
    for name in (calibration_path(recording).name, "views.json", "profile.json"):
        os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match="is not a file"):
        read_calibration(recording)
    with pytest.raises(InputError, match=r"views.json: is not a file"):
        read_views(tmp_path)
    assert tmp_path / "profile.json" in ProfileStore(tmp_path).damaged()


def test_a_transform_of_absurd_numbers_is_refused_by_its_field() -> None:
    camera = PinholeCamera(64, 48, 58.0, 58.0, 31.5, 23.5)
    document = CalibrationProfile(CameraRig(camera, camera, RigidTransform()), "D", "C").document()
    document["color_from_depth"][0][1] = 1e308
    with pytest.raises(InputError, match=r"color_from_depth\.0\.1"):
        CalibrationProfile.from_document(document)


@pytest.mark.parametrize("folder", ["Jörg Müller", "/".join(["long" * 30] * 3)])
def test_recordings_play_wherever_people_keep_them(tmp_path: Path, folder: str) -> None:
    """The runtime's player crashes at other letters than ASCII and refuses long paths."""
    path = tmp_path / folder / "Aufnahme ä.oni"
    path.parent.mkdir(parents=True)
    write_oni(capture_of(64), path)
    source = open_source(path)
    assert [frame.number for frame in source.frames()] == [1, 2]
    source.close()


def test_frames_of_a_recording_with_a_still_carry_the_still(tmp_path: Path) -> None:
    """The rig of such a recording is that of the camera which took the still, so its picture is shown."""
    depth = PinholeCamera(64, 48, 58.0, 58.0, 31.5, 23.5)
    color = PinholeCamera(1800, 1200, 1500.0, 1500.0, 899.5, 599.5)
    picture = np.arange(1800 * 1200 * 3, dtype=np.uint32).astype(np.uint8).reshape(1200, 1800, 3)
    rig = CameraRig(depth, color, RigidTransform())
    write_oni(
        RgbdCapture(np.full((2, 48, 64), 1500, np.uint16), 0.001, rig, color=picture), tmp_path / "a.oni"
    )
    source = open_source(tmp_path / "a.oni")
    record(source, tmp_path / "out", no_limits())
    source.close()
    with open_device(f"folder:{tmp_path / 'out/capture_0001'}") as camera:
        taken = camera.capture()
    assert taken.rig.color == color
    np.testing.assert_array_equal(taken.color, picture)
