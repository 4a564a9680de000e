"""Recording cameras: with the runtime's own recorder, with our writer, into folders; and what goes wrong."""

from __future__ import annotations

import resource
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from core.calibration.profile import CalibrationProfile, DepthCorrection
from core.capture import read_capture
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.errors import InputError, WorkError
from devices.openni.calibration import calibration_path
from devices.openni.cameras import OniRecording, OpenNICamera
from devices.openni.oni_file import OniWriter
from devices.openni.oni_layout import inspect_oni
from devices.openni.oni_mend import mend_oni
from devices.recordings.played import PlayedCamera
from devices.recordings.recorder import Limits, record
from devices.recordings.sources import open_source
from tests.devices.openni_driver.feed import FeedFolder, wait_until

Feeds = Callable[..., FeedFolder]
VGA = PinholeCamera(640, 480, 580.0, 581.0, 318.0, 242.0)
RIG = CameraRig(VGA, PinholeCamera(640, 480, 525.0, 525.0, 320.0, 240.0), RigidTransform())
SMALL = PinholeCamera(64, 48, 58.0, 58.0, 31.5, 23.5)


def limits(frames: int | None = None, seconds: float | None = None) -> Limits:
    return Limits(seconds, frames, threading.Event())


def test_the_runtimes_recorder_keeps_raw_frames_and_the_calibration_goes_beside(
    feeds: Feeds, tmp_path: Path
) -> None:
    feed = feeds()
    profile = CalibrationProfile(RIG, "A00363A01", "A00363A01", DepthCorrection(1.02, 0.0), version=2)
    with OpenNICamera(feed.uri) as camera:
        camera.use_profile(profile)
        report = record(camera, tmp_path / "a.oni", limits(frames=12))
    assert report.recorder == "OpenNI2"
    assert report.frames >= 8
    assert inspect_oni(tmp_path / "a.oni").stream("depth").codec == "16zT"  # type: ignore[union-attr]
    with OniRecording(tmp_path / "a.oni") as recording:
        raw = list(recording.frames())
        recording.close()
        capture = recording.capture(frames=4)
    assert len(raw) == report.frames
    assert all(any(np.array_equal(f.depth, made) for made in feed.depth) for f in raw)
    np.testing.assert_array_equal(raw[2].rgb, feed.color[0])  # type: ignore[index]
    assert np.all(np.diff([f.time_s for f in raw]) > 0)
    # A capture of it is what the camera would have given: corrected, with sensor and profile.
    corrected = profile.depth_correction.apply(feed.depth, 0.001)
    assert any(np.array_equal(capture.depth_frames[0], made) for made in corrected)
    assert capture.sensor == "kinect-v1"
    assert capture.calibration is not None
    assert capture.rig.depth == VGA
    assert capture.warnings == ()


def test_a_driver_without_cropping_gives_recordings_that_play_all_the_same(
    feeds: Feeds, tmp_path: Path
) -> None:
    """What the runtime's recorder writes then, its own player does not deliver."""
    with OpenNICamera(feeds(cropping=0).uri) as camera:
        camera.record_oni(str(tmp_path / "raw.oni"))
        first = camera.latest(0, 5.0)
        assert first is not None
        assert wait_until(lambda: camera.latest(first.number + 6) is not None)
        camera.stop_recording()
        report = record(camera, tmp_path / "a.oni", limits(frames=6))
    assert not inspect_oni(tmp_path / "raw.oni").playable
    assert inspect_oni(tmp_path / "a.oni").playable
    for name, count in (("raw.oni", 4), ("a.oni", report.frames)):
        with OniRecording(tmp_path / name) as recording:
            assert len(list(recording.frames())) >= count


@pytest.mark.parametrize("end", ["unplug", "crash"])
def test_a_camera_that_goes_while_it_is_recorded_leaves_a_complete_recording(
    feeds: Feeds, tmp_path: Path, end: str
) -> None:
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        threading.Timer(1.0, feed.command, [end]).start()
        with pytest.raises(WorkError, match=r"(unplugged|crashed).* frames until then are kept"):
            record(camera, tmp_path / "a.oni", limits(frames=2000))
    kept = inspect_oni(tmp_path / "a.oni").stream("depth")
    assert kept is not None
    assert kept.frames >= 5
    with OniRecording(tmp_path / "a.oni") as recording:
        assert recording.capture(frames=3).depth_frames.shape == (3, 480, 640)
    assert not list(tmp_path.glob("*.part"))


def test_infrared_is_recorded_and_played(feeds: Feeds, tmp_path: Path) -> None:
    feed = feeds(color=False)
    with OpenNICamera(feed.uri) as camera:
        camera.start(("depth", "infrared"))
        record(camera, tmp_path / "a.oni", limits(frames=5))
    with OniRecording(tmp_path / "a.oni") as recording:
        frame = list(recording.frames())[1]
    assert feed.infrared is not None
    np.testing.assert_array_equal(frame.infrared, feed.infrared[0])
    assert frame.depth is not None


def test_a_recording_of_colour_alone_is_refused_with_a_reason(feeds: Feeds, tmp_path: Path) -> None:
    with OpenNICamera(feeds().uri) as camera:
        camera.start(("color",))
        first = camera.latest(0, 5.0)
        assert first is not None
        camera.record_oni(str(tmp_path / "a.oni"))
        assert wait_until(lambda: camera.latest(first.number + 3) is not None)
        camera.stop_recording()
    with pytest.raises(InputError, match="no depth stream"):
        OniRecording(tmp_path / "a.oni")


def test_a_camera_becomes_capture_folders_that_play_at_the_recorded_times(
    feeds: Feeds, tmp_path: Path
) -> None:
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        report = record(camera, tmp_path / "session", limits(frames=7), burst=3)
    assert (report.frames, report.recorder) == (7, "GeoDerm")
    captures = [read_capture(folder) for folder in sorted((tmp_path / "session").glob("capture_*"))]
    assert [len(c.depth_frames) for c in captures] == [3, 3, 1]
    assert all(c.color is not None for c in captures)
    assert captures[0].sensor == "kinect-v1"
    played = list(open_source(tmp_path / "session").frames())
    assert len(played) == 7
    gaps = np.diff([frame.time_s for frame in played])
    assert np.median(gaps) == pytest.approx(1 / 30, abs=0.01)


def test_a_recording_is_copied_without_loss_from_one_form_to_the_other(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    depth = rng.integers(500, 4000, (5, 48, 64)).astype(np.uint16)
    with OniWriter(tmp_path / "a.oni", SMALL, color_camera=SMALL) as writer:
        for i, frame in enumerate(depth):
            writer.write(frame, np.full((48, 64, 3), 40 * i, np.uint8), 0.1 * i)
    record(open_source(tmp_path / "a.oni"), tmp_path / "folders", limits(), burst=2)
    record(open_source(tmp_path / "folders"), tmp_path / "b.oni", limits())
    with OniRecording(tmp_path / "b.oni") as recording:
        frames = list(recording.frames())
    np.testing.assert_array_equal(np.stack([f.depth for f in frames]), depth)  # type: ignore[misc]
    np.testing.assert_allclose(np.diff([f.time_s for f in frames]), 0.1, atol=2e-5)


def test_compressed_colour_plays(tmp_path: Path) -> None:
    ramp = np.tile(np.linspace(0, 255, 64).astype(np.uint8)[None, :, None], (48, 1, 3))
    with OniWriter(tmp_path / "a.oni", SMALL, color_camera=SMALL, color_codec="JPEG") as writer:
        writer.write(np.full((48, 64), 900, np.uint16), ramp)
    with OniRecording(tmp_path / "a.oni") as recording:
        (frame,) = recording.frames()
    assert frame.rgb is not None
    assert np.abs(frame.rgb.astype(int) - ramp).mean() < 3


def test_a_recording_as_niviewer_makes_it_plays(feeds: Feeds, tmp_path: Path) -> None:
    """The runtime's recorder with depth as 16zT and colour as JPEG."""
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        record(camera, tmp_path / "a.oni", limits(frames=5), lossy_color=True)
    summary = inspect_oni(tmp_path / "a.oni")
    assert {s.kind: s.codec for s in summary.streams.values()} == {"depth": "16zT", "color": "JPEG"}
    with OniRecording(tmp_path / "a.oni") as recording:
        frame = list(recording.frames())[1]
    assert feed.color is not None
    assert frame.rgb is not None
    assert any(np.array_equal(frame.depth, made) for made in feed.depth)
    assert np.abs(frame.rgb.astype(int) - feed.color[0]).mean() < 3


def test_an_existing_recording_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.oni").write_bytes(b"mine")
    with pytest.raises(InputError, match="exists already"):
        record(open_source_of_one_frame(tmp_path), tmp_path / "a.oni", limits())
    assert (tmp_path / "a.oni").read_bytes() == b"mine"
    calibration_path(tmp_path / "b.oni").write_text("{}")
    with pytest.raises(InputError, match="exists already"):
        record(open_source_of_one_frame(tmp_path), tmp_path / "b.oni", limits())


def open_source_of_one_frame(folder: Path):  # type: ignore[no-untyped-def]
    with OniWriter(folder / "one.oni", SMALL) as writer:
        writer.write(np.full((48, 64), 900, np.uint16))
    return open_source(folder / "one.oni")


def write_many(writer: OniWriter, frame: np.ndarray) -> None:
    for _ in range(20):
        writer.write(frame)


@pytest.fixture
def small_disk() -> Iterator[Callable[[int], None]]:
    """Files that may not grow beyond a size: to a writer it is what a full disk is."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_is_told_and_what_fitted_is_a_complete_recording(
    tmp_path: Path, small_disk: Callable[[int], None]
) -> None:
    frame = np.full((48, 64), 900, np.uint16)
    writer = OniWriter(tmp_path / "a.oni", SMALL)
    small_disk(40_000)
    with pytest.raises(WorkError, match=r"disk is full.*first \d+ frames are kept"):
        write_many(writer, frame)
    small_disk(resource.RLIM_INFINITY)
    kept = inspect_oni(tmp_path / "a.oni").stream("depth")
    assert kept is not None
    assert 4 <= kept.frames <= 6
    with OniRecording(tmp_path / "a.oni") as recording:
        assert len(list(recording.frames())) == kept.frames
    assert {p.name for p in tmp_path.iterdir()} == {"a.oni"}


@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="limits of another process are Linux")
def test_a_full_disk_under_the_runtimes_recorder_is_told_and_what_fitted_is_kept(
    feeds: Feeds, tmp_path: Path
) -> None:
    """The recorder itself says nothing, and dies when it is stopped."""
    with OpenNICamera(feeds().uri) as camera:
        assert camera.latest(0, 5.0) is not None
        assert camera.runtime_pid is not None
        limit = (6_000_000, resource.RLIM_INFINITY)
        resource.prlimit(camera.runtime_pid, resource.RLIMIT_FSIZE, limit)
        with pytest.raises(WorkError, match=r"did not take the whole recording\. \d+ frames are kept"):
            record(camera, tmp_path / "a.oni", limits(frames=30))
    with OniRecording(tmp_path / "a.oni") as recording:
        assert len(list(recording.frames())) >= 2


def test_a_disk_that_is_full_from_the_start_leaves_nothing(
    tmp_path: Path, small_disk: Callable[[int], None]
) -> None:
    small_disk(200)
    with pytest.raises(WorkError, match="disk is full"):
        OniWriter(tmp_path / "a.oni", SMALL)
    assert list(tmp_path.iterdir()) == []


def test_a_recording_that_was_cut_off_is_mended_up_to_its_last_whole_frame(tmp_path: Path) -> None:
    depth = np.arange(10, dtype=np.uint16)[:, None, None] * np.ones((1, 48, 64), np.uint16) + 700
    with OniWriter(tmp_path / "a.oni", SMALL) as writer:
        for frame in depth:
            writer.write(frame)
    whole = (tmp_path / "a.oni").read_bytes()
    (tmp_path / "cut.oni").write_bytes(whole[: len(whole) * 6 // 10])
    kept = mend_oni(tmp_path / "cut.oni", tmp_path / "mended.oni")
    assert 4 <= kept <= 6
    with OniRecording(tmp_path / "mended.oni") as recording:
        frames = [f.depth for f in recording.frames()]
    np.testing.assert_array_equal(np.stack(frames), depth[:kept])  # type: ignore[arg-type]


def test_a_recording_played_live_is_a_camera_that_goes_round(tmp_path: Path) -> None:
    with OniWriter(tmp_path / "a.oni", SMALL, color_camera=SMALL) as writer:
        for i in range(6):
            writer.write(np.full((48, 64), 900 + i, np.uint16), np.zeros((48, 64, 3), np.uint8), i / 30)
    camera = PlayedCamera(tmp_path / "a.oni")
    with camera:
        number, seen, times = 0, [], []
        while len(seen) < 14:
            frame = camera.latest(number, 10.0)
            assert frame is not None
            assert frame.depth is not None
            number = frame.number
            seen.append(int(frame.depth[0, 0]))
            times.append(frame.time_s)
        capture = camera.capture(frames=2)
    assert set(seen) == set(range(900, 906))
    assert capture.color is not None
    assert np.median(np.diff(times)) == pytest.approx(1 / 30, abs=0.015)
    assert not any(t.name == "geoderm-playback" for t in threading.enumerate())


def test_the_registry_opens_a_recording_as_a_live_camera(tmp_path: Path) -> None:
    from devices.live import LiveCamera, LiveState
    from devices.registry import open_device

    calibration = calibration_path(tmp_path / "one.oni")
    open_source_of_one_frame(tmp_path)
    camera = open_device(f"recording:{tmp_path / 'one.oni'}?live")
    try:
        assert isinstance(camera, LiveCamera)
        assert camera.info.live
        assert camera.latest(0, 10.0) is not None
        assert camera.state is LiveState.STREAMING
        assert not camera.identity.lasting
    finally:
        camera.close()
    assert not calibration.exists()
