"""The capture folder: what is written is read back, and whatever is wrong is named."""

import json
import shutil
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.capture import (
    CameraRig,
    PinholeCamera,
    RgbdCapture,
    RigidTransform,
    read_capture,
    read_visit,
    write_capture,
)
from core.errors import InputError

Change = Callable[[dict[str, Any]], object]


def make_capture(**changes: Any) -> RgbdCapture:
    rng = np.random.default_rng(3)
    depth = PinholeCamera(64, 48, 57.6, 57.7, 31.5, 23.4)
    color = PinholeCamera(80, 60, 70.1, 70.2, 39.5, 29.6, (0.1, -0.05, 0.001, -0.001, 0.0))
    fields: dict[str, Any] = {
        "depth_frames": rng.integers(1500, 2500, (3, 48, 64)).astype(np.uint16),
        "depth_unit_m": 0.001,
        "rig": CameraRig(depth, color, RigidTransform(np.eye(3), np.array([-0.025, 0.0, 0.001]))),
        "color": rng.integers(0, 256, (60, 80, 3)).astype(np.uint8),
        "view": "back",
        "stance": "psi",
        "taken_at": datetime(2026, 11, 22, 10, 15, tzinfo=UTC),
        "joints_m": {"head": np.array([0.01, -0.5, 2.2]), "left_hand": np.array([0.6, 0.1, 2.0])},
    }
    return RgbdCapture(**{**fields, **changes})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_capture(make_capture(), tmp_path / "front")
    return tmp_path / "front"


def edit(folder: Path, change: Change) -> None:
    path = folder / "capture.json"
    description = json.loads(path.read_text())
    change(description)
    path.write_text(json.dumps(description))


def assert_same(a: RgbdCapture, b: RgbdCapture) -> None:
    np.testing.assert_array_equal(a.depth_frames, b.depth_frames)
    assert (a.color is None) == (b.color is None)
    if a.color is not None:
        np.testing.assert_array_equal(a.color, b.color)
    assert a.rig.depth == b.rig.depth
    assert a.rig.color == b.rig.color
    np.testing.assert_allclose(
        a.rig.picture_from_depth.matrix, b.rig.picture_from_depth.matrix, atol=1e-12, rtol=0
    )
    assert (a.depth_unit_m, a.view, a.stance, a.taken_at, a.mirrored) == (
        b.depth_unit_m,
        b.view,
        b.stance,
        b.taken_at,
        b.mirrored,
    )
    assert (a.joints_m is None) == (b.joints_m is None)
    for name, p in (a.joints_m or {}).items():
        np.testing.assert_array_equal(p, (b.joints_m or {})[name])


def test_a_capture_survives_the_round_trip(tmp_path: Path) -> None:
    capture = make_capture()
    write_capture(capture, tmp_path / "a")
    assert_same(capture, read_capture(tmp_path / "a"))


def test_a_depth_only_capture_survives_the_round_trip(tmp_path: Path) -> None:
    full = make_capture()
    capture = make_capture(rig=CameraRig(full.rig.depth), color=None, joints_m=None)
    write_capture(capture, tmp_path / "a")
    assert_same(capture, read_capture(tmp_path / "a"))


def test_writing_replaces_an_older_capture_whole(folder: Path) -> None:
    newer = make_capture(depth_frames=make_capture().depth_frames[:1], stance="arms down")
    write_capture(newer, folder)
    assert_same(newer, read_capture(folder))
    assert sorted(p.name for p in folder.iterdir()) == ["capture.json", "color.png", "depth_000.png"]
    assert [p.name for p in folder.parent.iterdir()] == ["front"]


def test_a_folder_of_something_else_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "letters").mkdir()
    (tmp_path / "letters" / "a.txt").write_text("dear")
    with pytest.raises(InputError, match="not a capture folder"):
        write_capture(make_capture(), tmp_path / "letters")
    assert (tmp_path / "letters" / "a.txt").read_text() == "dear"


def test_a_failed_write_leaves_the_older_capture_and_nothing_else(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full_disk(path: Path, data: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("core.capture.folder._write_synced", full_disk)
    with pytest.raises(InputError, match="No space left"):
        write_capture(make_capture(stance="lost"), folder)
    assert read_capture(folder).stance == "psi"
    assert [p.name for p in folder.parent.iterdir()] == ["front"]


def test_an_interrupted_write_leaves_the_older_capture_and_nothing_else(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(path: Path, data: bytes) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("core.capture.folder._write_synced", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_capture(make_capture(stance="lost"), folder)
    assert read_capture(folder).stance == "psi"
    assert [p.name for p in folder.parent.iterdir()] == ["front"]


def test_the_sensor_and_the_calibration_are_kept(tmp_path: Path) -> None:
    document = {"format": "geoderm-calibration/1", "id": "a1", "version": 2}
    write_capture(make_capture(sensor="kinect-v2", calibration=document), tmp_path / "known")
    kept = read_capture(tmp_path / "known")
    assert (kept.sensor, kept.calibration) == ("kinect-v2", document)
    write_capture(make_capture(), tmp_path / "unknown")
    kept = read_capture(tmp_path / "unknown")
    assert (kept.sensor, kept.calibration) == ("", None)


@pytest.mark.parametrize(("name", "exact"), [("color.tif", True), ("color.jpg", False)])
def test_tiff_and_jpeg_pictures_are_read(folder: Path, name: str, exact: bool) -> None:
    smooth = cv2.resize(np.arange(12, dtype=np.uint8).reshape(2, 2, 3) * 20, (80, 60))
    cv2.imwrite(str(folder / name), cv2.cvtColor(smooth, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 98])
    edit(folder, lambda d: d["color"].update(file=name))
    color = read_capture(folder).color
    assert color is not None
    assert np.abs(color.astype(int) - smooth).max() <= (0 if exact else 8)


def test_symbolic_links_to_frames_are_followed(folder: Path) -> None:
    target = folder.parent / "elsewhere.png"
    shutil.move(folder / "depth_001.png", target)
    (folder / "depth_001.png").symlink_to(target)
    assert_same(make_capture(), read_capture(folder))


def test_a_visit_is_one_capture_folder_or_a_folder_of_them(folder: Path) -> None:
    write_capture(make_capture(view="front"), folder.parent / "another")
    (folder.parent / "notes").mkdir()
    assert [name for name, _ in read_visit(folder)] == ["front"]
    assert [name for name, _ in read_visit(folder.parent)] == ["another", "front"]
    with pytest.raises(InputError, match=r"capture\.json"):
        read_visit(folder.parent / "notes")


def _no_intrinsics(d: dict[str, Any]) -> None:
    del d["depth"]["intrinsics"]


BAD_DESCRIPTIONS: list[tuple[Change, str]] = [
    (lambda d: d.update(format="geoderm-capture/2"), "format"),
    (lambda d: d.pop("format"), "format"),
    (lambda d: d.pop("depth"), "depth"),
    (lambda d: d.update(depth=[1]), "depth"),
    (_no_intrinsics, r"depth\.intrinsics"),
    (lambda d: d["depth"]["intrinsics"].pop("fx"), r"depth\.intrinsics\.fx"),
    (lambda d: d["depth"]["intrinsics"].update(fx="575"), r"depth\.intrinsics\.fx"),
    (lambda d: d["depth"]["intrinsics"].update(fx=-575), r"depth\.intrinsics\.fx"),
    (lambda d: d["depth"]["intrinsics"].update(fx=0.0575), r"depth\.intrinsics\.fx"),
    (lambda d: d["depth"]["intrinsics"].update(cx=1e6), r"depth\.intrinsics\.cx"),
    (lambda d: d["depth"]["intrinsics"].update(cx=float("nan")), r"depth\.intrinsics\.cx"),
    (lambda d: d["depth"]["intrinsics"].update(width=63.5), r"depth\.intrinsics\.width"),
    (lambda d: d["depth"]["intrinsics"].update(width=10**9), r"depth\.intrinsics\.width"),
    (lambda d: d["depth"]["intrinsics"].update(width=16000, height=16000), r"depth\.intrinsics\.width"),
    (lambda d: d["depth"]["intrinsics"].update(height=0), r"depth\.intrinsics\.height"),
    (lambda d: d["depth"]["intrinsics"].update(height=True), r"depth\.intrinsics\.height"),
    (lambda d: d["depth"]["intrinsics"].update(distortion=[0.1]), r"depth\.intrinsics\.distortion"),
    (lambda d: d["depth"]["intrinsics"].update(distortion=[9e9] * 5), r"depth\.intrinsics\.distortion"),
    (lambda d: d["depth"].update(unit_m=1.0), r"depth\.unit_m.*0\.001"),
    (lambda d: d["depth"].update(unit_m=1e-6), r"depth\.unit_m.*Check the unit"),
    (lambda d: d["depth"].update(unit_m=0.1), r"depth\.unit_m.*Check the unit"),
    (lambda d: d["depth"].update(frames=[]), r"depth\.frames"),
    (lambda d: d["depth"].update(frames="depth_000.png"), r"depth\.frames"),
    (lambda d: d["depth"].update(frames=["gone.png"]), r"gone\.png"),
    (lambda d: d["depth"].update(frames=["depth_000.png"] * 5000), r"depth\.frames"),
    (lambda d: d["depth"].update(frames=["../front/depth_000.png"]), r"depth\.frames\[0\]"),
    (lambda d: d["depth"].update(frames=["/etc/passwd"]), r"depth\.frames\[0\]"),
    (lambda d: d["depth"].update(frames=["C:\\depth.png"]), r"depth\.frames\[0\]"),
    (lambda d: d["depth"].update(frames=["a\0b.png"]), r"depth\.frames\[0\]"),
    (lambda d: d["depth"].update(frames=["x" * 5000]), r"depth\.frames\[0\]"),
    (lambda d: d["depth"].update(frames=["."]), "not a file"),
    (lambda d: d["depth"].update(frames=["color.png"]), r"color\.png"),
    (lambda d: d["depth"].update(frames=["capture.json"]), r"capture\.json: depth\.frames\[0\]"),
    (lambda d: d["color"].pop("intrinsics"), r"color\.intrinsics"),
    (lambda d: d["color"].update(file="depth_000.png"), r"color\.file"),
    (lambda d: d["color"].update(file="..\\x.png"), r"color\.file"),
    (lambda d: d["color"].update(file=7), r"color\.file"),
    (lambda d: d["color"]["intrinsics"].update(width=81), r"color\.file is 80 x 60"),
    (lambda d: d.pop("color_from_depth"), "color_from_depth"),
    (lambda d: d.pop("color"), "color_from_depth"),
    (lambda d: d["color_from_depth"][0].__setitem__(0, 2.0), "color_from_depth"),
    (lambda d: d["color_from_depth"][0].__setitem__(0, -1.0), "color_from_depth"),
    (lambda d: d["color_from_depth"][0].__setitem__(3, -25.0), r"color_from_depth.*metres, not millimetres"),
    (lambda d: d["color_from_depth"].pop(), "color_from_depth"),
    (lambda d: d["color_from_depth"][1].__setitem__(1, None), r"color_from_depth\[1\]\[1\]"),
    (lambda d: d["joints_m"].update(head=[0, 0, float("nan")]), r"joints_m\.head"),
    (lambda d: d["joints_m"].update(head=[0, 1]), r"joints_m\.head"),
    (lambda d: d["joints_m"].update(head=None), r"joints_m\.head"),
    (lambda d: d["joints_m"].update(head=[10, -500, 2200]), r"joints_m\.head.*metres, not millimetres"),
    (lambda d: d.update(joints_m=[]), "joints_m"),
    (lambda d: d.update(taken_at="yesterday"), "taken_at"),
    (lambda d: d.update(taken_at="2026-11-22T10:15:00"), "taken_at.*time zone"),
    (lambda d: d.update(mirrored="no"), "mirrored"),
    (lambda d: d.update(view=3), "view"),
    (lambda d: d.update(stance="x" * 10_000), "stance"),
]


@pytest.mark.parametrize(("change", "field"), BAD_DESCRIPTIONS)
def test_a_bad_field_is_named_with_its_file(folder: Path, change: Change, field: str) -> None:
    edit(folder, change)
    with pytest.raises(InputError, match=field) as caught:
        read_capture(folder)
    assert str(folder) in str(caught.value)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "\x80", "[" * 100_000, '{"format": 1e999}'])
def test_a_description_that_is_no_json_object_is_named(folder: Path, text: str) -> None:
    (folder / "capture.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match=r"capture\.json"):
        read_capture(folder)


def test_a_missing_folder_or_description_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        read_capture(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"capture\.json.*does not exist"):
        read_capture(tmp_path)


def test_depth_of_8_bits_is_refused(folder: Path) -> None:
    cv2.imwrite(str(folder / "depth_001.png"), np.full((48, 64), 200, np.uint8))
    with pytest.raises(InputError, match=r"depth_001\.png: depth\.frames\[1\] must be a 16-bit"):
        read_capture(folder)


def test_frames_of_different_sizes_are_refused(folder: Path) -> None:
    cv2.imwrite(str(folder / "depth_002.png"), np.full((50, 64), 2000, np.uint16))
    with pytest.raises(InputError, match=r"depth_002\.png: depth\.frames\[2\] is 64 x 50 pixels.*64 x 48"):
        read_capture(folder)


@pytest.mark.parametrize("name", ["depth_000.png", "color.png"])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.98])
def test_a_truncated_image_is_refused(folder: Path, name: str, share: float) -> None:
    data = (folder / name).read_bytes()
    (folder / name).write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=name):
        read_capture(folder)


def test_a_text_called_an_image_is_refused(folder: Path) -> None:
    (folder / "color.png").write_text("this is not an image")
    with pytest.raises(InputError, match=r"color\.png: color\.file is not a readable"):
        read_capture(folder)


def test_an_empty_depth_frame_is_readable(tmp_path: Path) -> None:
    """Nothing in view is no fault of the file; finding no body is told later."""
    write_capture(make_capture(depth_frames=np.zeros((1, 48, 64), np.uint16)), tmp_path / "dark")
    assert read_capture(tmp_path / "dark").depth_frames.max() == 0


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


def _leaves(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    children = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    return [path, *(leaf for key, child in children for leaf in _leaves(child, (*path, key)))]


@settings(max_examples=250, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_changed_description_is_read_or_refused(folder: Path, data: st.DataObject) -> None:
    path = folder / "capture.json"
    keep = path.read_text()
    refusals: list[str] = []
    description = json.loads(keep)
    for _ in range(data.draw(st.integers(1, 2))):
        where = data.draw(st.sampled_from(_leaves(description)[1:]))
        parent = description
        for key in where[:-1]:
            parent = parent[key]
        if isinstance(parent, dict) and data.draw(st.booleans()):
            del parent[where[-1]]
        else:
            parent[where[-1]] = data.draw(json_values)
    try:
        path.write_text(json.dumps(description))
        read_capture(folder)
    except InputError as error:
        refusals.append(error.message)
    finally:
        path.write_text(keep)
    assert all(str(folder) in message for message in refusals)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    name=st.sampled_from(["capture.json", "depth_001.png", "color.png"]),
    cut=st.floats(0, 1),
    flips=st.lists(st.tuples(st.floats(0, 0.999), st.integers(1, 255)), max_size=4),
)
def test_any_damaged_file_is_read_or_refused(
    folder: Path, name: str, cut: float, flips: list[tuple[float, int]]
) -> None:
    path = folder / name
    keep = path.read_bytes()
    refusals: list[str] = []
    damaged = bytearray(keep[: max(1, int(cut * len(keep)))])
    for place, bits in flips:
        damaged[int(place * len(damaged))] ^= bits
    try:
        path.write_bytes(bytes(damaged))
        read_capture(folder)
    except InputError as error:
        refusals.append(error.message)
    finally:
        path.write_bytes(keep)
    assert all(str(folder) in message for message in refusals)
