"""Webcams: video files through the real cv2.VideoCapture, and a backend that behaves like a UVC camera."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.errors import InputError, WorkError
from devices.auxiliary.camera import ColorCamera, ColorCameraInfo, ColorIdentity
from devices.auxiliary.registry import create_color_camera, list_color_cameras
from devices.auxiliary.usb_names import node_of_path, video_node, video_nodes
from devices.auxiliary.uvc import UvcCamera
from devices.auxiliary.uvc_source import UvcSource
from devices.live import LiveState
from tests.devices.auxiliary.fake_webcam import open_fake


def webcam(behaviour: str, size: tuple[int, int] | None = None) -> UvcCamera:
    return UvcCamera(
        UvcSource(behaviour, size, 0.0, open_fake),
        ColorCameraInfo("uvc:0", "Webcam", "uvc"),
        ColorIdentity("Webcam", "046d:0825-1", True),
    )


@pytest.fixture(scope="module")
def camera() -> Iterator[UvcCamera]:
    camera = webcam("well")
    camera.open()
    yield camera
    camera.close()
    assert camera.state is LiveState.CLOSED


def test_it_runs_in_its_largest_mode_and_stamps_its_pictures(camera: UvcCamera) -> None:
    assert isinstance(camera, ColorCamera)
    assert camera.mode is not None
    assert (camera.mode.width, camera.mode.height) == (1920, 1080)
    first = camera.latest(0, 5.0)
    assert first is not None
    second = camera.latest(first.number, 5.0)
    assert second is not None
    assert second.number > first.number
    assert second.time_s > first.time_s
    assert 0.0 <= time.monotonic() - second.time_s < 2.0
    assert second.rgb.shape == (1080, 1920, 3)
    assert second.rgb[5, 5].tolist() == [30, 20, 10], "OpenCV's blue first has been turned round"


def test_a_still_is_exposed_after_it_was_asked_for_and_in_the_best_mode(camera: UvcCamera) -> None:
    camera.choose_mode(camera.modes()[0])
    assert camera.mode is not None
    assert (camera.mode.width, camera.mode.height) == (640, 480)
    asked = time.monotonic()
    still = camera.still(10.0)
    assert still.rgb.shape == (1080, 1920, 3)
    assert still.time_s >= asked
    after, deadline = 0, time.monotonic() + 5.0
    while True:
        picture = camera.latest(after, 1.0)
        assert picture is not None
        if picture.rgb.shape == (480, 640, 3):
            break
        after = picture.number
        assert time.monotonic() < deadline, "the stream goes on as before"
    camera.choose_mode(camera.modes()[-1])


def test_the_exposure_is_locked_where_it_is(camera: UvcCamera) -> None:
    def values() -> dict[str, float]:
        return {c.name: c.value for c in camera.controls()}

    assert (values()["auto_exposure"], values()["exposure_lock"]) == (1.0, 0.0)
    camera.set_control("exposure_lock", 1.0)
    assert (values()["auto_exposure"], values()["exposure_lock"]) == (0.0, 1.0)
    assert values()["exposure_s"] == pytest.approx(0.0157), "as the automatic had it"
    camera.set_control("exposure_s", 0.005)
    assert camera.still().rgb[0, 0, 0] == 50, "the driver was told 50 x 100 microseconds"
    camera.set_control("focus_lock", 1.0)
    camera.set_control("white_balance_k", 5200.0)
    now = values()
    assert (now["focus_lock"], now["auto_white_balance"], now["white_balance_k"]) == (1.0, 0.0, 5200.0)
    for name, value in (("exposure_s", 30.0), ("zoom", 1.0)):
        with pytest.raises(InputError):
            camera.set_control(name, value)
    camera.set_control("auto_exposure", 1.0)
    assert values()["exposure_lock"] == 0.0


def test_a_latency_moves_the_stamps(camera: UvcCamera) -> None:
    camera.set_control("latency_s", 0.5)
    asked = time.monotonic()
    still = camera.still()
    assert still.time_s >= asked
    assert time.monotonic() - asked >= 0.5, "a picture that arrives at once was exposed before"
    camera.set_control("latency_s", 0.0)


def test_a_driver_that_blocks_for_ever_is_called_stalled_and_ended() -> None:
    camera = webcam("stalls")
    camera.open()
    pid = camera.pid
    deadline = time.monotonic() + 10.0
    while camera.state is not LiveState.STALLED:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert camera.latest(10**6, 0.1) is None
    started = time.monotonic()
    with pytest.raises(WorkError, match="did not answer"):
        camera.still(0.5)
    assert time.monotonic() - started < 6.0
    assert camera.state is LiveState.GONE
    camera.close()
    assert not Path(f"/proc/{pid}").exists()


@pytest.mark.parametrize("fault", ["unplugged", "crashes", "killed", "30mp"])
def test_a_camera_that_goes_is_a_message(fault: str) -> None:
    camera = webcam("well" if fault == "killed" else fault)
    camera.open()
    if fault == "killed":
        assert camera.pid is not None
        os.kill(camera.pid, signal.SIGKILL)
    reason = {"30mp": "too large"}.get(fault, "camera is gone")
    with pytest.raises(WorkError, match=reason):
        camera.latest(10**6, 20.0)
    assert camera.state is LiveState.GONE
    camera.close()


@pytest.mark.parametrize("behaviour", ["stumbles", "grey", "wrong-size"])
def test_odd_pictures_are_coped_with(behaviour: str) -> None:
    camera = webcam(behaviour)
    camera.open()
    picture = camera.latest(8, 5.0)
    assert picture is not None
    assert picture.rgb.ndim == 3
    if behaviour == "grey":
        assert picture.rgb[5, 5].tolist() == [10, 10, 10]
    assert [("instead of" in w) for w in picture.warnings] == ([True] if behaviour == "wrong-size" else [])
    camera.close()


def test_a_camera_that_does_not_open_or_obey_is_said() -> None:
    with pytest.raises(WorkError, match="cannot be opened"):
        webcam("absent").open()
    with pytest.raises(WorkError, match="no mode of 1000 x 1000"):
        webcam("well", (1000, 1000)).open()
    source = UvcSource("deaf", None, 0.0, open_fake)
    source.open()
    with pytest.raises(WorkError, match="did not take the setting 'exposure_lock'"):
        source.request("set_control", {"control": "exposure_lock", "value": 1.0})


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Motion JPEG as many webcams send it; the brightness counts the frames."""
    path = tmp_path_factory.mktemp("video") / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (320, 240))
    for i in range(24):
        writer.write(np.full((240, 320, 3), 10 * i, np.uint8))
    writer.release()
    return path


def test_a_video_file_is_played_in_real_time_by_the_real_opencv(video: Path) -> None:
    camera = create_color_camera(f"uvc:{video}")
    camera.open()
    assert [c.name for c in camera.controls()] == ["latency_s"], "a file has no exposure to lock"
    seen: list[tuple[float, float]] = []

    def watch() -> None:
        number = 0
        while (picture := camera.latest(number, 2.0)) is not None:
            number = picture.number
            seen.append((picture.time_s, float(picture.rgb.mean()) / 10.0))

    with pytest.raises(WorkError, match="has ended"):
        watch()
    camera.close()
    frames = [round(f) for _, f in seen]
    assert frames == sorted(frames)
    assert frames[-1] == 23
    assert seen[-1][0] - seen[0][0] > 0.8 * (frames[-1] - frames[0]) / 20.0, "not faster than life"
    assert not camera.identity.lasting


def test_an_image_sequence_is_a_stream_too(tmp_path: Path) -> None:
    for i in range(4):
        cv2.imwrite(str(tmp_path / f"shot_{i:02d}.png"), np.full((48, 64, 3), (0, 0, 60 * i + 10), np.uint8))
    source = UvcSource(str(tmp_path / "shot_%02d.png"))
    source.open()
    reds = []
    for _ in range(4):
        packet = source.read()
        assert packet is not None
        reds.append(int(packet.arrays["rgb"][0, 0, 0]))
    assert reds == [10, 70, 130, 190]
    source.close()


def usb_camera(system: Path, number: int, serial: str | None, index: int = 0) -> None:
    """The kernel's folders of a webcam, as /sys has them."""
    device = system / "devices" / f"1-{number}"
    interface = device / f"1-{number}:1.0"
    interface.mkdir(parents=True, exist_ok=True)
    (device / "idVendor").write_text("046d\n")
    (device / "idProduct").write_text("0825\n")
    if serial is not None:
        (device / "serial").write_text(f"{serial}\n")
    node = system / "video4linux" / f"video{2 * number + index}"
    node.mkdir(parents=True)
    (node / "name").write_text("HD Webcam\n")
    (node / "index").write_text(f"{index}\n")
    (node / "device").symlink_to(interface)


def test_linux_tells_serial_numbers_and_which_nodes_are_cameras(tmp_path: Path) -> None:
    usb_camera(tmp_path, 1, "8A3B2C")
    usb_camera(tmp_path, 1, "8A3B2C", index=1)
    usb_camera(tmp_path, 2, None)
    system = tmp_path / "video4linux"
    found = video_nodes(system)
    assert [(n.number, n.model, n.serial, n.lasting) for n in found] == [
        (2, "HD Webcam", "046d:0825-8A3B2C", True),
        (4, "HD Webcam", "046d:0825@1-2", False),
    ]
    assert video_node(7, system) is None
    link = tmp_path / "by-id"
    (tmp_path / "video4").touch()
    link.symlink_to(tmp_path / "video4")
    assert (node_of_path(link), node_of_path(Path("clip.avi"))) == (4, None)


def test_cameras_are_made_by_their_id() -> None:
    assert all(info.kind == "uvc" for info in list_color_cameras())
    assert create_color_camera("uvc:3?mode=1920x1080&latency_s=0.1").identity.serial == "uvc-3"
    for wrong in ("uvc:", "uvc:/nowhere/clip.avi", "uvc:0?mode=big", "uvc:0?latency_s=99", "uvc:0?zoom=2"):
        with pytest.raises(InputError):
            create_color_camera(wrong)
