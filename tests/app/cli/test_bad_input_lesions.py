"""Bad lists of lesions, bad clicks, bad pairs of captures and bad places for the result."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.capture import read_capture
from tests.app.cli.cases import (
    Outcome,
    assert_told,
    copy_of,
    edit,
    geoderm,
    put,
    without_color,
    write_lesions,
)
from tests.app.cli.conftest import Shot


def relocate(first: Path, followup: Path, lesions: Path, out: Path, *options: object) -> Outcome:
    return geoderm("relocate", first, followup, "--lesions", lesions, "--out", out, *options)


def answers(outcome: Outcome, out: Path) -> list[dict[str, Any]]:
    assert (outcome.code, outcome.err) == (0, ""), outcome
    lesions: list[dict[str, Any]] = json.loads(out.read_text())["lesions"]
    return lesions


@pytest.fixture
def lesions(tmp_path: Path) -> Path:
    return tmp_path / "lesions.json"


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "result.json"


# --- the file


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"[]",
        b"null",
        b"7",
        b'"L1"',
        b"{",
        b'{"lesions": [}',
        b"\xff\xfe\x00",
        b"\x89PNG\r\n\x1a\n",
        b"[" * 100_000,
        b'{"lesions": ' + b"1" * 9000 + b"}",
    ],
    ids=["empty", "list", "null", "number", "text", "brace", "broken", "bytes", "png", "deep", "digits"],
)
def test_a_file_that_is_no_list_of_lesions(
    first: Shot, followup: Shot, lesions: Path, out: Path, content: bytes
) -> None:
    lesions.write_bytes(content)
    assert_told(relocate(first.folder, followup.folder, lesions, out), 2, lesions)
    assert not out.exists()


@pytest.mark.parametrize("entries", [{}, {"id": "L1", "pixel": [1, 2]}, None, "L1", 3, True], ids=repr)
def test_lesions_that_are_not_a_list(
    first: Shot, followup: Shot, lesions: Path, out: Path, entries: object
) -> None:
    write_lesions(lesions, entries)
    assert_told(relocate(first.folder, followup.folder, lesions, out), 2, lesions, '"lesions"', "list")


def test_no_file_of_lesions(first: Shot, followup: Shot, lesions: Path, out: Path) -> None:
    assert_told(relocate(first.folder, followup.folder, lesions, out), 2, lesions)


def test_a_folder_in_the_place_of_the_lesions(first: Shot, followup: Shot, tmp_path: Path, out: Path) -> None:
    assert_told(relocate(first.folder, followup.folder, tmp_path, out), 2, tmp_path)


@pytest.mark.parametrize(
    ("entry", "field"),
    [
        (None, "lesions[1]"),
        ([], "lesions[1]"),
        ("L2", "lesions[1]"),
        ({}, "lesions[1].id"),
        ({"pixel": [160, 100]}, "lesions[1].id"),
        ({"id": None, "pixel": [160, 100]}, "lesions[1].id"),
        ({"id": "", "pixel": [160, 100]}, "lesions[1].id"),
        ({"id": ["L2"], "pixel": [160, 100]}, "lesions[1].id"),
        ({"id": True, "pixel": [160, 100]}, "lesions[1].id"),
        ({"id": "\ud800", "pixel": [160, 100]}, "lesions[1].id"),
        ({"id": "L1", "pixel": [160, 100]}, "lesions[1].id"),
        ({"id": "L2"}, "lesions[1]"),
        ({"id": "L2", "pixel": None}, "lesions[1]"),
        ({"id": "L2", "pixel": []}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [160]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [160, 100, 2]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": ["160", "100"]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [True, False]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [None, None]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [[160], [100]]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": {"u": 160, "v": 100}}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": "160,100"}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [float("nan"), 100]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [160, float("-inf")]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [10**400, 100]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [1e300, 100]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [-1, 100]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [320, 100]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [160, 240]}, "lesions[1].pixel"),
        ({"id": "L2", "pixel": [160, -0.6]}, "lesions[1].pixel"),
        ({"id": "L2", "depth_pixel": [256, 100]}, "lesions[1].depth_pixel"),
        ({"id": "L2", "depth_pixel": [float("nan"), 1]}, "lesions[1].depth_pixel"),
        ({"id": "L2", "pixel": [160, 100], "capture": 3}, "lesions[1].capture"),
        ({"id": "L2", "pixel": [160, 100], "capture": "rear"}, "lesions[1].capture"),
    ],
    ids=str,
)
def test_a_bad_entry_is_named(
    first: Shot, followup: Shot, lesions: Path, out: Path, entry: object, field: str
) -> None:
    write_lesions(lesions, [{"id": "L1", "pixel": first.pixel(first.visible()[0]).tolist()}, entry])
    assert_told(relocate(first.folder, followup.folder, lesions, out), 2, lesions, field)
    assert not out.exists()


def test_in_a_visit_folder_every_lesion_names_its_capture(
    first: Shot, back: Shot, tmp_path: Path, lesions: Path, out: Path
) -> None:
    visit = tmp_path / "visit"
    first.copy(visit / "front")
    back.copy(visit / "back")
    write_lesions(lesions, [{"id": "L1", "pixel": [160, 100]}])
    assert_told(
        relocate(visit, first.folder, lesions, out), 2, lesions, "lesions[0].capture", "front", "back"
    )


def test_a_number_is_a_name_too(first: Shot, followup: Shot, lesions: Path, out: Path) -> None:
    write_lesions(lesions, [{"id": 17, "pixel": first.pixel(first.visible()[0]).tolist()}])
    assert answers(relocate(first.folder, followup.folder, lesions, out), out)[0]["id"] == "17"


def test_names_may_be_any_text(first: Shot, followup: Shot, lesions: Path, out: Path) -> None:
    name = "Ліва рука / naevus № 3 \\ ../x \u200f"
    write_lesions(lesions, [{"id": name, "pixel": first.pixel(first.visible()[0]).tolist()}])
    assert answers(relocate(first.folder, followup.folder, lesions, out), out)[0]["id"] == name


# --- the click


def assert_refused(lesion: dict[str, Any]) -> None:
    assert lesion["status"] == "refused"
    assert lesion["reason"]
    assert all(lesion.get(key) is None for key in ("point_m", "pixel", "depth_pixel", "radius95_m"))
    assert lesion["candidates"] == []
    assert lesion["confidence"] == 0


@pytest.mark.parametrize(
    ("pixel", "reason"),
    [
        ([205.0, 153.0], "not on the body"),
        ([156.0, 196.0], "not on the body"),
        ([100.0, 110.0], "not on the body"),
        ([0, 0], ""),
        ([-0.5, -0.5], ""),
        ([319.4, 239.4], ""),
    ],
    ids=["wall", "floor", "under the arm", "corner", "outermost edge", "last corner"],
)
def test_a_click_on_the_background_is_refused_with_a_reason(
    first: Shot, followup: Shot, lesions: Path, out: Path, pixel: list[float], reason: str
) -> None:
    good = first.visible()[0]
    write_lesions(lesions, [{"id": "bg", "pixel": pixel}, {"id": good, "pixel": first.pixel(good).tolist()}])
    refused, found = answers(relocate(first.folder, followup.folder, lesions, out), out)
    assert_refused(refused)
    assert reason in refused["reason"]
    assert found["status"] != "refused"


def test_a_click_on_hair_is_refused(first: Shot, followup: Shot, lesions: Path, out: Path) -> None:
    head = first.truth.joints_m["head"]
    crown = read_capture(first.folder).rig.project_to_picture(head + np.array([0.0, -0.085, 0.0]))[0]
    write_lesions(lesions, [{"id": "hair", "pixel": crown.tolist()}])
    (refused,) = answers(relocate(first.folder, followup.folder, lesions, out), out)
    assert_refused(refused)
    assert "hair" in refused["reason"]


def test_a_click_on_clothing_is_answered_with_a_warning(
    first: Shot, followup: Shot, lesions: Path, out: Path
) -> None:
    hips = 0.5 * (first.truth.joints_m["left_hip"] + first.truth.joints_m["right_hip"])
    shorts = read_capture(first.folder).rig.project_to_picture(hips + np.array([0.08, 0.05, 0.0]))[0]
    write_lesions(lesions, [{"id": "shorts", "pixel": shorts.tolist()}])
    (lesion,) = answers(relocate(first.folder, followup.folder, lesions, out), out)
    assert lesion["status"] != "refused"
    warnings = json.loads(out.read_text())["warnings"]
    assert any("clothing" in w and "shorts" in w for w in warnings)


def test_a_depth_only_lesion_given_in_the_picture_counts_in_the_depth_image(
    first: Shot, followup: Shot, tmp_path: Path, lesions: Path, out: Path
) -> None:
    bare = without_color(first.copy(tmp_path / "bare"))
    write_lesions(lesions, [{"id": "L1", "pixel": [300, 100]}])
    assert_told(relocate(bare, followup.folder, lesions, out), 2, lesions, "lesions[0].pixel", "256 x 192")


# --- pairs of captures that carry no answer


def test_another_person_is_refused(first: Shot, other_person: Shot, lesions: Path, out: Path) -> None:
    for lesion in answers(relocate(first.folder, other_person.folder, first.lesions(lesions, 4), out), out):
        assert_refused(lesion)
        assert "person" in lesion["reason"]


def test_the_other_side_of_the_body_is_refused(first: Shot, back: Shot, lesions: Path, out: Path) -> None:
    for lesion in answers(relocate(first.folder, back.folder, first.lesions(lesions, 4), out), out):
        assert_refused(lesion)
        assert "side" in lesion["reason"]


def test_too_few_anchors_are_refused(
    first: Shot, followup: Shot, tmp_path: Path, lesions: Path, out: Path
) -> None:
    """The follow-up's recording knows an arm alone."""
    few = followup.copy(tmp_path / "few")
    arm = ("left_shoulder", "left_elbow", "left_hand", "neck")
    edit(few, lambda d: put(d, ("joints_m",), {k: d["joints_m"][k] for k in arm}))
    for lesion in answers(relocate(first.folder, few, first.lesions(lesions, 3), out), out):
        assert lesion["status"] in ("refused", "ambiguous", "not_visible") or lesion["radius95_m"] > 0.02
    edit(few, lambda d: put(d, ("joints_m",), {k: d["joints_m"][k] for k in arm[:2]}))
    assert_told(relocate(first.folder, few, first.lesions(lesions, 3), out), 3, "joints")


def test_a_capture_relocated_into_itself_finds_every_lesion_where_it_was(
    first: Shot, lesions: Path, out: Path
) -> None:
    for lesion in answers(relocate(first.folder, first.folder, first.lesions(lesions, 4), out), out):
        assert np.linalg.norm(np.array(lesion["pixel"]) - first.pixel(lesion["id"])) < 4


# --- options and the place of the result


def test_an_unknown_method_is_named_with_those_that_exist(
    first: Shot, followup: Shot, lesions: Path, out: Path
) -> None:
    outcome = relocate(first.folder, followup.folder, first.lesions(lesions), out, "--method", "magic")
    assert_told(outcome, 2, "method", "magic", "trilateration", "voting-dijkstra", "voting-fmm")


@pytest.mark.parametrize(
    "options",
    [
        ("--seed", "-1"),
        ("--seed", "one"),
        ("--seed", "1.5"),
        ("--delta-m", "-1"),
        ("--delta-m", "nan"),
        ("--delta-m", "inf"),
        ("--bogus",),
        ("--method",),
    ],
    ids=" ".join,
)
def test_a_wrong_option_is_named(
    first: Shot, followup: Shot, lesions: Path, out: Path, options: tuple[str, ...]
) -> None:
    outcome = relocate(first.folder, followup.folder, first.lesions(lesions), out, *options)
    assert_told(outcome, 2, options[0].lstrip("-").replace("-", "_").split("_")[0])
    assert not out.exists()


@pytest.mark.parametrize("missing", ["--lesions", "--out", "followup"])
def test_a_missing_argument_is_named(first: Shot, lesions: Path, out: Path, missing: str) -> None:
    arguments = ["relocate", first.folder, first.folder, "--lesions", first.lesions(lesions), "--out", out]
    if missing == "followup":
        del arguments[2]
    else:
        at = arguments.index(missing)
        del arguments[at : at + 2]
    assert_told(geoderm(*arguments), 2, missing)


def test_a_result_in_a_folder_that_does_not_exist(
    first: Shot, followup: Shot, lesions: Path, tmp_path: Path
) -> None:
    out = tmp_path / "nowhere" / "r.json"
    assert_told(relocate(first.folder, followup.folder, first.lesions(lesions, 1), out), 2, out)
    assert not out.parent.exists()


def test_a_folder_in_the_place_of_the_result(
    first: Shot, followup: Shot, lesions: Path, tmp_path: Path
) -> None:
    out = tmp_path / "taken"
    out.mkdir()
    before = sorted(p.name for p in tmp_path.iterdir())
    outcome = relocate(first.folder, followup.folder, first.lesions(lesions, 1), out)
    assert outcome.code in (2, 3)
    assert_told(outcome, outcome.code, out)
    after = sorted(p.name for p in tmp_path.iterdir())
    assert after == sorted([*before, lesions.name])


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_result_in_a_folder_without_permission(
    first: Shot, followup: Shot, lesions: Path, tmp_path: Path
) -> None:
    closed = tmp_path / "closed"
    closed.mkdir()
    (closed / "r.json").write_text("earlier")
    closed.chmod(stat.S_IRUSR | stat.S_IXUSR)
    try:
        outcome = relocate(first.folder, followup.folder, first.lesions(lesions, 1), closed / "r.json")
        assert outcome.code in (2, 3)
        assert_told(outcome, outcome.code, closed / "r.json")
        assert [p.name for p in closed.iterdir()] == ["r.json"]
        assert (closed / "r.json").read_text() == "earlier"
    finally:
        closed.chmod(stat.S_IRWXU)


def test_a_refused_call_leaves_an_earlier_result_alone(
    first: Shot, followup: Shot, lesions: Path, out: Path
) -> None:
    out.write_text("earlier")
    write_lesions(lesions, [{"id": "L1", "pixel": [9999, 1]}])
    assert_told(relocate(first.folder, followup.folder, lesions, out), 2, lesions)
    assert out.read_text() == "earlier"


def test_the_inputs_are_never_changed(
    first: Shot, followup: Shot, lesions: Path, out: Path, tmp_path: Path
) -> None:
    folders = [copy_of(shot.folder, tmp_path / name) for shot, name in ((first, "a"), (followup, "b"))]
    before = {p: p.read_bytes() for f in folders for p in f.iterdir()}
    answers(relocate(*folders, first.lesions(lesions, 1), out), out)
    assert {p: p.read_bytes() for f in folders for p in f.iterdir()} == before
