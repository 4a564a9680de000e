"""A still camera's folder: only complete, new, decodable pictures, in the order of their exposure."""

from __future__ import annotations

import io
import os
import shutil
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, Image

from core.errors import InputError, WorkError
from devices.auxiliary.camera import ColorCamera
from devices.auxiliary.camera_clock import CameraClock
from devices.auxiliary.folder_watch import FolderWatchCamera
from devices.auxiliary.picture_file import Unusable, read_picture
from devices.auxiliary.registry import create_color_camera
from devices.live import LiveState

BASE = ExifTags.Base


def picture_bytes(
    value: int = 100,
    size: tuple[int, int] = (64, 48),
    *,
    kind: str = "JPEG",
    exposed: datetime | None = None,
    subsec: str | None = None,
    orientation: int | None = None,
    focal_mm: int | None = None,
    serial: str | None = None,
) -> bytes:
    pixels = np.full((size[1], size[0], 3), value, np.uint8)
    pixels[: size[1] // 2, : size[0] // 2] = (200, 0, 0)  # the sensor's top left is red
    exif = Image.Exif()
    details = exif.get_ifd(ExifTags.IFD.Exif)
    if exposed is not None:
        details[BASE.DateTimeOriginal] = exposed.strftime("%Y:%m:%d %H:%M:%S")
    if subsec is not None:
        details[BASE.SubsecTimeOriginal] = subsec
    if focal_mm is not None:
        details[BASE.FocalLengthIn35mmFilm] = focal_mm
    if serial is not None:
        details[BASE.BodySerialNumber] = serial
    if orientation is not None:
        exif[BASE.Orientation] = orientation
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, kind, exif=exif)
    return stream.getvalue()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "card").mkdir()
    return tmp_path / "card"


@pytest.fixture
def camera(folder: Path) -> Iterator[FolderWatchCamera]:
    (folder / "yesterday.jpg").write_bytes(picture_bytes(9))
    camera = FolderWatchCamera(folder)
    camera.open()
    yield camera
    camera.close()


def test_a_folder_watch_is_a_colour_camera_that_waits_for_the_shutter(camera: FolderWatchCamera) -> None:
    assert isinstance(camera, ColorCamera)
    assert not camera.streams
    assert camera.state is LiveState.STREAMING
    assert camera.latest(0, 0.5) is None, "what was there before is not a new picture"
    assert camera.mode is None


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "TIFF"])
def test_a_new_picture_is_taken(camera: FolderWatchCamera, folder: Path, kind: str) -> None:
    before = time.monotonic()
    (folder / f"a.{kind.lower()}").write_bytes(picture_bytes(100, kind=kind))
    picture = camera.latest(0, 5.0)
    assert picture is not None
    assert (picture.number, picture.rgb.shape) == (1, (48, 64, 3))
    assert abs(int(picture.rgb[-1, -1, 0]) - 100) < 4
    assert before - 0.1 <= picture.time_s <= before + 0.5, "the arrival began when the file appeared"
    assert picture.time_sigma_s > 0.1, "an arrival says little about the exposure"


def test_a_half_written_picture_is_waited_for(camera: FolderWatchCamera, folder: Path) -> None:
    data = picture_bytes(50, (800, 600))
    with (folder / "slow.jpg").open("wb") as stream:
        stream.write(data[: len(data) // 2])
        stream.flush()
        assert camera.latest(0, 1.2) is None
        stream.write(data[len(data) // 2 :])
    picture = camera.latest(0, 5.0)
    assert picture is not None
    assert picture.rgb.shape == (600, 800, 3)
    assert abs(int(picture.rgb[-1, -1, 0]) - 50) < 4, "to its last line"


def test_foreign_and_hidden_files_are_let_be(camera: FolderWatchCamera, folder: Path) -> None:
    (folder / "raw.cr2").write_bytes(b"raw")
    (folder / ".transfer.jpg").write_bytes(picture_bytes())
    (folder / "sub.jpg").mkdir()
    assert camera.latest(0, 1.0) is None


def test_a_file_that_never_becomes_a_picture_is_named(
    camera: FolderWatchCamera, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("devices.auxiliary.folder_watch._GIVE_UP_S", 0.6)
    (folder / "letter.jpg").write_bytes(b"Dear colleague")
    with pytest.raises(WorkError, match=r"letter\.jpg: damaged, cut off or not a picture"):
        camera.still(2.0)
    (folder / "letter.jpg").write_bytes(picture_bytes(70))
    assert camera.latest(0, 5.0) is not None, "written over with a picture, it is one"


def test_the_same_name_written_again_is_a_new_picture(camera: FolderWatchCamera, folder: Path) -> None:
    (folder / "capt0000.jpg").write_bytes(picture_bytes(40))
    first = camera.latest(0, 5.0)
    assert first is not None
    (folder / "capt0000.jpg").write_bytes(picture_bytes(90))
    second = camera.latest(first.number, 5.0)
    assert second is not None
    assert abs(int(second.rgb[-1, -1, 0]) - 90) < 4


def test_pictures_that_come_together_are_numbered_in_the_order_they_were_written(
    camera: FolderWatchCamera, folder: Path
) -> None:
    for i, name in enumerate(("z.jpg", "b.jpg")):
        partial = folder / f"{name}.part"
        partial.write_bytes(picture_bytes(60 + 40 * i))
        os.utime(partial, (1_700_000_000 + i, 1_700_000_000 + i))
    for name in ("b.jpg", "z.jpg"):
        (folder / f"{name}.part").rename(folder / name)
    deadline = time.monotonic() + 5.0
    while len(found := camera.since(0, 0.2)) < 2:
        assert time.monotonic() < deadline
    by_number = sorted(found, key=lambda p: p.number)
    assert [abs(int(p.rgb[-1, -1, 0]) - v) < 4 for p, v in zip(by_number, (60, 100), strict=True)] == [
        True,
        True,
    ]


def test_a_folder_that_vanishes_is_said_and_can_come_back(camera: FolderWatchCamera, folder: Path) -> None:
    shutil.rmtree(folder)
    with pytest.raises(WorkError, match="folder of the still camera is gone"):
        camera.latest(0, 5.0)
    assert camera.state is LiveState.GONE
    with pytest.raises(WorkError, match="cannot be read"):
        camera.open()
    folder.mkdir()
    camera.open()
    assert camera.state is LiveState.STREAMING


def test_a_picture_is_not_turned_for_its_orientation(camera: FolderWatchCamera, folder: Path) -> None:
    """Orientation 6 asks for a quarter turn: the calibration would no longer fit the pixels."""
    (folder / "portrait.jpg").write_bytes(picture_bytes(orientation=6))
    picture = camera.latest(0, 5.0)
    assert picture is not None
    assert picture.rgb.shape == (48, 64, 3)
    assert picture.rgb[2, 2, 0] > 150 > picture.rgb[2, -3, 0], "red is still at the sensor's top left"
    assert any("turned" in w for w in picture.warnings)


def test_a_zoomed_lens_and_another_body_are_said(camera: FolderWatchCamera, folder: Path) -> None:
    (folder / "1.jpg").write_bytes(picture_bytes(focal_mm=50, serial="A1"))
    first = camera.latest(0, 5.0)
    assert first is not None
    assert first.warnings == ()
    # 50 mm on a 43.27 mm diagonal, 80 pixels across the corners.
    assert first.nominal_camera().fx == pytest.approx(50 / 43.267 * 80, rel=1e-3)
    (folder / "2.jpg").write_bytes(picture_bytes(focal_mm=35, serial="B2"))
    second = camera.latest(1, 5.0)
    assert second is not None
    assert [("zoomed" in w, "another camera" in w) for w in second.warnings] == [(False, True), (True, False)]


def test_a_still_is_one_whose_shutter_opened_after_it_was_asked_for(
    camera: FolderWatchCamera, folder: Path
) -> None:
    with pytest.raises(WorkError, match="No picture came from the still camera within 1 seconds"):
        camera.still(0.6)
    (folder / "now.png").write_bytes(picture_bytes(33, kind="PNG"))
    assert camera.still(5.0).rgb[-1, -1, 0] == 33


@pytest.mark.parametrize("damage", ["truncated", "16-bit", "too many pixels", "svg", "empty"])
def test_a_bad_file_is_refused_with_the_reason(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "x.jpg"
    reason = "damaged"
    if damage == "truncated":
        path.write_bytes(picture_bytes(size=(640, 480))[:-400])
    elif damage == "16-bit":
        Image.fromarray(np.zeros((8, 8), np.uint16)).save(path, "PNG")
        reason = "8 bits"
    elif damage == "too many pixels":
        Image.new("L", (6001, 4400)).save(path, "PNG")
        reason = "24 megapixels"
    else:
        path.write_bytes(b"<svg/>" if damage == "svg" else b"")
    with pytest.raises(Unusable, match=reason):
        read_picture(path)


def test_a_pipe_in_the_folder_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "x.jpg")
    with pytest.raises(Unusable, match="not a file"):
        read_picture(tmp_path / "x.jpg")


def test_the_cameras_clock_is_read_to_its_fraction_or_not_at_all(tmp_path: Path) -> None:
    moment = datetime(2026, 11, 22, 10, 15, 30, tzinfo=UTC)
    path = tmp_path / "x.jpg"
    path.write_bytes(picture_bytes(exposed=moment, subsec="25"))
    assert read_picture(path).exposed_at == pytest.approx(moment.timestamp() + 0.25)
    path.write_bytes(picture_bytes(exposed=moment))
    assert read_picture(path).exposed_at is None, "whole seconds are worse than the arrival"


def test_exposures_are_placed_by_the_cameras_clock_once_it_is_known() -> None:
    """Clock two hours off, transfers of 0.4 to 3 s: the jitter of the transfer goes, 50 ms stay."""
    clock = CameraClock(latency_s=0.4, arrival_sigma_s=0.7)
    offset = timedelta(hours=2).total_seconds()
    errors = []
    for i, transfer_s in enumerate((0.4, 3.0, 0.6, 1.7)):
        exposed = 100.0 + 5.0 * i
        moment = clock.exposed(exposed + transfer_s, exposed + offset)
        errors.append(abs(moment.time_s - exposed))
    assert max(errors[1:]) < 0.01
    assert clock.exposed(200.4, None).sigma_s == 0.7


def test_a_clock_that_is_set_anew_is_not_trusted_at_once() -> None:
    clock = CameraClock(0.0, 0.7)
    clock.exposed(10.0, 1000.0)
    assert clock.exposed(20.0, 1010.0).sigma_s == 0.05
    moment = clock.exposed(30.0, 5000.0)
    assert (moment.time_s, moment.sigma_s) == (30.0, 0.7)
    assert clock.exposed(40.0, 5010.0).time_s == pytest.approx(40.0)


def test_a_watch_is_made_by_its_id(folder: Path) -> None:
    camera = create_color_camera(f"folder-watch:{folder}?latency_s=0.8")
    assert [c.value for c in camera.controls()] == [0.8]
    camera.set_control("latency_s", 0.5)
    assert [c.value for c in camera.controls()] == [0.5]
    for wrong in (
        "folder-watch:/nowhere/at/all",
        f"folder-watch:{folder}?latency_s=soon",
        "shutter:1",
        "uvc",
    ):
        with pytest.raises(InputError):
            create_color_camera(wrong)
