"""Bad capture folders: one line that names the file and the field, and nothing written."""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from core.capture import read_capture
from tests.app.cli.cases import (
    Outcome,
    assert_told,
    cropped,
    description,
    drop,
    edit,
    empty_room,
    geoderm,
    map_depth,
    mirrored,
    put,
    without_color,
    without_joints,
)
from tests.app.cli.conftest import Shot

Path_ = tuple[str | int, ...]


@pytest.fixture
def folder(first: Shot, tmp_path: Path) -> Path:
    return first.copy(tmp_path / "capture")


def info(folder: Path) -> Outcome:
    return geoderm("capture-info", folder, "--json")


def report(folder: Path) -> dict[str, Any]:
    outcome = info(folder)
    assert (outcome.code, outcome.err) == (0, ""), outcome
    loaded: dict[str, Any] = json.loads(outcome.out)
    return loaded


# --- the folder itself


def test_a_folder_that_does_not_exist(tmp_path: Path) -> None:
    assert_told(info(tmp_path / "nowhere"), 2, tmp_path / "nowhere")


def test_a_file_instead_of_a_folder(folder: Path) -> None:
    assert_told(info(folder / "color.png"), 2, folder / "color.png", "not a folder")


def test_an_empty_folder(tmp_path: Path) -> None:
    assert_told(info(tmp_path), 2, tmp_path / "capture.json")


def test_a_folder_in_the_place_of_a_file(folder: Path) -> None:
    (folder / "color.png").unlink()
    (folder / "color.png").mkdir()
    assert_told(info(folder), 2, folder / "color.png")


def test_a_folder_in_the_place_of_the_description(folder: Path) -> None:
    (folder / "capture.json").unlink()
    (folder / "capture.json").mkdir()
    assert_told(info(folder), 2, folder / "capture.json")


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read everything")
@pytest.mark.parametrize("name", ["capture.json", "color.png", "depth_000.png"])
def test_a_file_that_may_not_be_read(folder: Path, name: str) -> None:
    (folder / name).chmod(0)
    assert_told(info(folder), 2, folder / name)


@pytest.mark.parametrize("name", ["color.png", "depth_000.png", "depth_001.png"])
def test_a_missing_image(folder: Path, name: str) -> None:
    (folder / name).unlink()
    assert_told(info(folder), 2, folder / name, "does not exist")


# --- damaged files


@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.5, 0.9, 0.999])
@pytest.mark.parametrize("name", ["color.png", "depth_000.png"])
def test_a_truncated_image(folder: Path, name: str, share: float) -> None:
    data = (folder / name).read_bytes()
    (folder / name).write_bytes(data[: int(share * len(data))])
    assert_told(info(folder), 2, folder / name)


@pytest.mark.parametrize("name", ["color.png", "depth_000.png"])
def test_flipped_bits_inside_an_image_are_noticed(folder: Path, name: str) -> None:
    data = bytearray((folder / name).read_bytes())
    at = data.index(b"IDAT") + 200
    data[at] ^= 0xFF
    (folder / name).write_bytes(data)
    assert_told(info(folder), 2, folder / name)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.7, 0.99])
def test_a_truncated_description(folder: Path, share: float) -> None:
    path = folder / "capture.json"
    text = path.read_text()
    path.write_text(text[: int(share * len(text))])
    assert_told(info(folder), 2, path, "JSON")


@pytest.mark.parametrize(
    "content",
    [b"a text, not a picture", b"%PDF-1.7\n", b"GIF89a\x01\x00\x01\x00", b"\x89PNG\r\n\x1a\n", b"\0" * 4096],
)
@pytest.mark.parametrize(("name", "field"), [("color.png", "color.file"), ("depth_000.png", "depth.frames")])
def test_an_image_that_is_not_an_image(folder: Path, name: str, field: str, content: bytes) -> None:
    (folder / name).write_bytes(content)
    assert_told(info(folder), 2, folder / name, field)


def test_a_depth_image_of_eight_bits(folder: Path) -> None:
    Image.new("L", (256, 192), 90).save(folder / "depth_000.png")
    assert_told(info(folder), 2, folder / "depth_000.png", "16-bit")


def test_a_depth_image_in_the_place_of_the_picture(folder: Path) -> None:
    edit(folder, lambda d: put(d, ("color", "intrinsics"), d["depth"]["intrinsics"]))
    edit(folder, lambda d: put(d, ("color", "file"), "depth_000.png"))
    assert_told(info(folder), 2, "depth_000.png", "color.file", "8-bit")


@pytest.mark.parametrize(
    "text",
    ["", "[]", "null", "3", '"text"', "{", '{"format": }', "\x00", "{}" * 2, "[" * 100_000, "1" * 10_000],
)
def test_a_description_that_is_not_a_json_object(folder: Path, text: str) -> None:
    (folder / "capture.json").write_text(text)
    assert_told(info(folder), 2, folder / "capture.json")


def test_a_description_in_another_encoding(folder: Path) -> None:
    (folder / "capture.json").write_bytes((folder / "capture.json").read_text().encode("utf-16"))
    assert_told(info(folder), 2, folder / "capture.json")


# --- contradictions between the description and the images


@pytest.mark.parametrize(
    ("side", "name"), [("depth", "depth_000.png"), ("color", "color.png")], ids=["depth", "colour"]
)
@pytest.mark.parametrize("key", ["width", "height"])
def test_an_image_of_another_size_than_its_camera(folder: Path, side: str, name: str, key: str) -> None:
    edit(folder, lambda d: put(d, (side, "intrinsics", key), d[side]["intrinsics"][key] + 1))
    assert_told(info(folder), 2, folder / name, side, "intrinsics", "pixels")


def test_depth_frames_of_different_sizes(folder: Path) -> None:
    image = np.asarray(Image.open(folder / "depth_001.png"))
    Image.fromarray(np.ascontiguousarray(image[:-2])).save(folder / "depth_001.png")
    assert_told(info(folder), 2, folder / "depth_001.png", "depth.frames[1]")


# --- calibration

NEEDED: list[Path_] = [
    ("format",),
    ("depth",),
    ("depth", "frames"),
    ("depth", "unit_m"),
    ("depth", "intrinsics"),
    *[("depth", "intrinsics", k) for k in ("width", "height", "fx", "fy", "cx", "cy")],
    ("color", "file"),
    ("color", "intrinsics"),
    *[("color", "intrinsics", k) for k in ("width", "height", "fx", "fy", "cx", "cy")],
    ("color_from_depth",),
]


@pytest.mark.parametrize("path", NEEDED, ids=lambda p: ".".join(p))
@pytest.mark.parametrize("how", ["left out", "null"])
def test_a_missing_piece_is_named(folder: Path, path: Path_, how: str) -> None:
    edit(folder, (lambda d: drop(d, path)) if how == "left out" else (lambda d: put(d, path, None)))
    assert_told(info(folder), 2, folder / "capture.json", ".".join(map(str, path)), "missing")


def test_extrinsics_without_a_colour_camera(folder: Path) -> None:
    edit(folder, lambda d: drop(d, ("color",)))
    assert_told(info(folder), 2, folder / "capture.json", "color_from_depth")


WRONG: list[object] = [True, "0.5", [], [1, 2], {}, {"a": 1}, math.nan, math.inf, -math.inf, "", 10**400]
TYPED: list[Path_] = [
    ("depth",),
    ("depth", "frames"),
    ("depth", "frames", 0),
    ("depth", "unit_m"),
    ("depth", "intrinsics"),
    ("depth", "intrinsics", "width"),
    ("depth", "intrinsics", "fx"),
    ("depth", "intrinsics", "cy"),
    ("color", "file"),
    ("color", "intrinsics", "fy"),
    ("color_from_depth",),
    ("color_from_depth", 1),
    ("color_from_depth", 0, 3),
    ("joints_m", "head"),
    ("joints_m", "left_hand", 2),
    ("format",),
    ("taken_at",),
]


@pytest.mark.parametrize("path", TYPED, ids=lambda p: ".".join(map(str, p)))
def test_a_value_of_a_wrong_type_is_named(folder: Path, path: Path_) -> None:
    original = description(folder)
    for value in WRONG:
        changed = json.loads(json.dumps(original))
        put(changed, path, value)
        (folder / "capture.json").write_text(json.dumps(changed))
        if path == ("depth", "frames") and value == []:
            assert_told(info(folder), 2, folder / "capture.json", "frames", "empty")
        else:
            # a text is a possible file name: then the file that is not there is named
            assert_told(info(folder), 2, folder, "" if isinstance(value, str) else path[0])


@pytest.mark.parametrize("key", ["view", "stance", "mirrored", "color", "joints_m"])
@pytest.mark.parametrize("value", [7, [1], "no" * 300], ids=["number", "list", "long text"])
def test_an_optional_value_of_a_wrong_type_is_named(folder: Path, key: str, value: object) -> None:
    edit(folder, lambda d: put(d, (key,), value))
    assert_told(info(folder), 2, folder / "capture.json", key)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("depth", "intrinsics", "width"), 0),
        (("depth", "intrinsics", "width"), -256),
        (("depth", "intrinsics", "width"), 256.5),
        (("depth", "intrinsics", "height"), 10**9),
        (("color", "intrinsics", "width"), 1e300),
        (("depth", "intrinsics", "fx"), 0),
        (("depth", "intrinsics", "fx"), -575.8),
        (("depth", "intrinsics", "fx"), 1e-9),
        (("color", "intrinsics", "fy"), 1e12),
        (("color", "intrinsics", "cx"), -1e6),
        (("depth", "intrinsics", "cy"), 1e6),
        (("depth", "intrinsics", "distortion"), [0.1]),
        (("depth", "intrinsics", "distortion"), [0.1] * 40),
        (("depth", "intrinsics", "distortion"), [1e9, 0, 0, 0]),
        (("color", "intrinsics", "distortion"), [-50.0, 0, 0, 0, 0]),
        (("color", "intrinsics", "distortion"), [math.nan, 0, 0, 0]),
        (("color", "intrinsics", "distortion"), "none"),
    ],
    ids=str,
)
def test_impossible_intrinsics(folder: Path, path: Path_, value: object) -> None:
    edit(folder, lambda d: put(d, path, value))
    assert_told(info(folder), 2, folder / "capture.json", path[0], path[-1])


@pytest.mark.parametrize(
    "matrix",
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[1, 0, 0, 0]] * 4,
        np.zeros((4, 4)).tolist(),
        np.diag([-1.0, 1, 1, 1]).tolist(),
        np.diag([2.0, 2, 2, 1]).tolist(),
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0.1, 0, 0, 1]],
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0]],
    ],
    ids=["3x3", "equal rows", "zero", "mirror", "scale", "last row", "ragged"],
)
def test_extrinsics_that_are_no_rigid_motion(folder: Path, matrix: object) -> None:
    edit(folder, lambda d: put(d, ("color_from_depth",), matrix))
    assert_told(info(folder), 2, folder / "capture.json", "color_from_depth")


# --- units


@pytest.mark.parametrize(
    "unit_m", [1.0, 1000.0, 0.5, 1e-6, 1e-9, 0.0, -0.001], ids=lambda u: f"{u:g} m a step"
)
def test_a_wrong_depth_unit_is_named(folder: Path, unit_m: float) -> None:
    edit(folder, lambda d: put(d, ("depth", "unit_m"), unit_m))
    assert_told(info(folder), 2, folder / "capture.json", "unit_m")


def test_depth_in_metres_read_as_millimetres(folder: Path) -> None:
    map_depth(folder, lambda image: np.round(image * 0.001))
    assert_told(info(folder), 2, folder / "capture.json", "unit_m")


def test_extrinsics_in_millimetres(folder: Path) -> None:
    edit(folder, lambda d: put(d, ("color_from_depth", 0, 3), d["color_from_depth"][0][3] * 1000))
    assert_told(info(folder), 2, folder / "capture.json", "color_from_depth", "metres")


def test_joints_in_millimetres(folder: Path) -> None:
    edit(
        folder,
        lambda d: put(d, ("joints_m",), {k: [1000 * x for x in p] for k, p in d["joints_m"].items()}),
    )
    assert_told(info(folder), 2, folder / "capture.json", "joints_m", "metres")


# --- names that lead out of the folder


@pytest.mark.parametrize(
    "name",
    [
        "../secret.png",
        "/etc/hostname",
        "a/../../secret.png",
        "..",
        ".",
        "",
        " ",
        "C:\\x.png",
        "..\\secret.png",
        "\\\\host\\share\\x.png",
        "x\0.png",
        "x" * 5000,
        "x\n.png",
    ],
    ids=repr,
)
@pytest.mark.parametrize("where", [("color", "file"), ("depth", "frames", 0)], ids=["colour", "depth"])
def test_a_name_cannot_lead_out_of_the_folder(folder: Path, where: Path_, name: str) -> None:
    for target in (folder.parent / "secret.png", folder / "x"):
        shutil.copy(folder / ("color.png" if where[0] == "color" else "depth_000.png"), target)
    edit(folder, lambda d: put(d, where, name))
    assert_told(info(folder), 2, folder)


# --- time


@pytest.mark.parametrize(
    "taken_at",
    ["yesterday", "2026-11-22", "2026-11-22T10:15:00", "2026-13-45T99:00:00Z", "0001-01-01T00:00+14:00"],
)
def test_a_time_that_is_none(folder: Path, taken_at: str) -> None:
    edit(folder, lambda d: put(d, ("taken_at",), taken_at))
    assert_told(info(folder), 2, folder / "capture.json", "taken_at")


# --- what the camera saw


def test_no_body(folder: Path) -> None:
    outcome = info(without_joints(empty_room(folder)))
    assert_told(outcome, 3, "No body")


def test_no_body_although_joints_are_recorded(folder: Path) -> None:
    assert_told(info(empty_room(folder)), 3, "No body")


@pytest.mark.parametrize("value", [0, 65535], ids=["no measurement", "saturated"])
def test_depth_that_measured_nothing(folder: Path, value: int) -> None:
    outcome = info(map_depth(folder, lambda image: np.full_like(image, value)))
    assert outcome.code in ({3} if value == 0 else {2, 3})
    assert_told(outcome, outcome.code)


def test_noise_alone_is_no_body(folder: Path) -> None:
    rng = np.random.default_rng(1)
    map_depth(folder, lambda image: rng.integers(500, 4000, image.shape))
    assert_told(info(without_joints(folder)), 3)


def test_joints_beside_the_body(folder: Path) -> None:
    edit(
        folder, lambda d: put(d, ("joints_m",), {k: [p[0] + 3, p[1], p[2]] for k, p in d["joints_m"].items()})
    )
    assert_told(info(folder), 3, "joints")


def test_a_second_person_is_a_warning_and_the_patient_is_taken(two_people: Shot) -> None:
    told = report(two_people.folder)
    assert any("person" in warning for warning in told["warnings"])
    assert abs(told["joints"]["torso"]["point_m"][0]) < 0.15


def test_a_body_cut_by_the_frame_is_a_warning_and_lost_joints_are_invisible(folder: Path) -> None:
    told = report(cropped(folder, 130))
    assert any("cut" in warning and "lower" in warning for warning in told["warnings"])
    for name in ("left_foot", "right_foot"):
        assert name not in told["joints"] or told["joints"][name]["visibility"] < 0.5
    assert told["joints"]["neck"]["visibility"] > 0.5


def test_a_mirrored_recording_tells_the_patients_own_left_and_right(folder: Path, first: Shot) -> None:
    told = report(mirrored(folder))["joints"]
    for name in ("left_hand", "right_hand", "left_shoulder", "right_knee"):
        np.testing.assert_allclose(told[name]["point_m"], first.truth.joints_m[name], atol=0.02)
    stored = report(first.folder)["joints"]
    for name, joint in told.items():
        assert joint["pixel"][0] == pytest.approx(319 - stored[name]["pixel"][0], abs=1)


@pytest.mark.parametrize("flag", [True, False])
def test_the_tracker_finds_left_and_right_in_a_mirrored_recording(
    folder: Path, first: Shot, flag: bool
) -> None:
    """The same stored images: with the flag the sides are right; without it they are exchanged."""
    told = report(edit(without_joints(mirrored(folder)), lambda d: put(d, ("mirrored",), flag)))["joints"]
    truth = first.truth.joints_m
    for name, other in (("left_elbow", "right_elbow"), ("right_knee", "left_knee")):
        expected = truth[name] if flag else truth[other] * (-1, 1, 1)
        np.testing.assert_allclose(told[name]["point_m"], expected, atol=0.08)


def test_joints_recorded_with_exchanged_sides_are_doubted(folder: Path) -> None:
    def exchange(d: dict[str, Any]) -> None:
        joints = d["joints_m"]
        swapped = {
            (k.replace("left", "right") if "left" in k else k.replace("right", "left")): p
            for k, p in joints.items()
        }
        d["joints_m"] = swapped

    told = report(edit(folder, exchange))
    assert any("left" in warning for warning in told["warnings"])


def test_a_recording_without_colour_is_reported_in_depth_pixels(folder: Path) -> None:
    told = report(without_color(folder))
    for joint in told["joints"].values():
        assert set(joint) == {"point_m", "depth_pixel", "visibility"}


def test_a_dark_picture_is_answered_from_the_depth_with_a_warning(folder: Path) -> None:
    image = np.asarray(Image.open(folder / "color.png"))
    Image.fromarray((image * 0.02).astype(np.uint8)).save(folder / "color.png")
    told = report(without_joints(folder))
    assert any("dark" in warning for warning in told["warnings"])


# --- forms that are allowed


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d.pop("joints_m"),
        lambda d: put(d, ("joints_m",), {}),
        lambda d: put(d, ("joints_m",), None),
        lambda d: d.pop("view"),
        lambda d: d.pop("stance"),
        lambda d: d.pop("taken_at"),
        lambda d: d.pop("mirrored"),
        lambda d: put(d, ("view",), "obliquely from the left"),
        lambda d: put(d, ("stance",), "Ärzte-Stand 体位"),
        lambda d: put(d, ("future",), {"unknown": [1, 2]}),
        lambda d: d["depth"]["intrinsics"].pop("distortion"),
        lambda d: put(d, ("taken_at",), "2026-11-22T10:15:00+02:00"),
    ],
    ids=[
        "no joints",
        "no joint",
        "null joints",
        "no view",
        "no stance",
        "no time",
        "no flag",
        "free view",
        "free stance",
        "unknown field",
        "no distortion",
        "time zone",
    ],
)
def test_what_may_be_absent_or_free_is_read(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    assert read_capture(edit(folder, change)).depth_frames.shape == (2, 192, 256)


@pytest.mark.parametrize("kind", ["JPEG", "TIFF", "PNG"])
def test_the_picture_may_be_jpeg_tiff_or_png(folder: Path, kind: str) -> None:
    name = f"picture.{kind.lower()}"
    Image.open(folder / "color.png").save(folder / name, kind)
    edit(folder, lambda d: put(d, ("color", "file"), name))
    assert report(folder)["frames"] == 2


# --- the same checks guard relocate


def test_relocate_names_a_bad_follow_up_and_writes_nothing(
    first: Shot, followup: Shot, tmp_path: Path
) -> None:
    bad = followup.copy(tmp_path / "bad")
    (bad / "depth_001.png").write_bytes(b"no picture")
    out = tmp_path / "r.json"
    outcome = geoderm(
        "relocate", first.folder, bad, "--lesions", first.lesions(tmp_path / "l.json"), "--out", out
    )
    assert_told(outcome, 2, bad / "depth_001.png", "depth.frames[1]")
    assert not out.exists()


@pytest.mark.parametrize("which", ["first", "followup"])
def test_relocate_without_a_body_is_work_not_done(
    first: Shot, followup: Shot, tmp_path: Path, which: str
) -> None:
    folders = {"first": first.folder, "followup": followup.folder}
    folders[which] = empty_room((first if which == "first" else followup).copy(tmp_path / "empty"))
    out = tmp_path / "r.json"
    lesions = first.lesions(tmp_path / "l.json")
    outcome = geoderm("relocate", folders["first"], folders["followup"], "--lesions", lesions, "--out", out)
    assert_told(outcome, 3, "No body")
    assert sorted(p.name for p in tmp_path.iterdir() if p.name != "log") == ["empty", "l.json"]


def test_a_visit_folder_with_one_bad_capture_names_it(first: Shot, tmp_path: Path) -> None:
    visit = tmp_path / "visit"
    first.copy(visit / "a")
    (first.copy(visit / "b") / "color.png").unlink()
    outcome = geoderm(
        *("relocate", visit, visit, "--lesions", first.lesions(tmp_path / "l.json")),
        *("--out", tmp_path / "r.json"),
    )
    assert_told(outcome, 2, visit / "b" / "color.png")
