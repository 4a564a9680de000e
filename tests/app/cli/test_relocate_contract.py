"""``geoderm relocate`` on good input: every field of ``geoderm-relocation/1``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from core.capture import read_capture
from tests.app.cli.cases import (
    copy_of,
    depth_pixels_of,
    geoderm,
    mirrored,
    without_color,
    without_joints,
    write_lesions,
)
from tests.app.cli.conftest import Shot

METHODS = ("voting-dijkstra", "voting-fmm", "trilateration")
STATUSES = {"found", "predicted", "ambiguous", "not_visible", "refused"}
WITH_POINT = {"found", "predicted", "ambiguous"}


def relocated(
    first: Path, followup: Path, lesions: Path, out: Path, *options: object, expect: int = 0
) -> dict[str, Any]:
    outcome = geoderm("relocate", first, followup, "--lesions", lesions, "--out", out, *options)
    assert (outcome.code, outcome.err) == (expect, ""), outcome
    result: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    return result


def is_vector(value: object, length: int) -> bool:
    return isinstance(value, list) and len(value) == length and all(np.isfinite(x) for x in value)


def on_surface_m(folder: Path, points: Sequence[Any]) -> float:
    """Largest distance of points to the measured depth of a capture."""
    capture = read_capture(folder)
    cloud = capture.rig.depth.backproject(np.median(capture.depth_frames, axis=0) * capture.depth_unit_m)
    cloud = cloud[cloud[..., 2] > 0]
    return max(float(np.linalg.norm(cloud - np.array(p), axis=1).min()) for p in points)


@pytest.fixture(scope="module")
def result(first: Shot, followup: Shot, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("result")
    return relocated(first.folder, followup.folder, first.lesions(folder / "l.json"), folder / "r.json")


def test_the_result_names_format_method_time_and_warnings(result: dict[str, Any]) -> None:
    assert result["format"] == "geoderm-relocation/1"
    assert result["method"] in METHODS or result["method"] not in ("", None)
    assert result["seconds"]["total"] > 0
    assert all(isinstance(v, float | int) and v >= 0 for v in result["seconds"].values())
    parts = [v for k, v in result["seconds"].items() if k != "total"]
    assert sum(parts) <= 1.05 * result["seconds"]["total"] + 0.01
    assert isinstance(result["warnings"], list)
    assert all(isinstance(w, str) for w in result["warnings"])


def test_every_lesion_is_answered_in_order_with_every_field(result: dict[str, Any], first: Shot) -> None:
    assert [lesion["id"] for lesion in result["lesions"]] == first.visible()
    for lesion in result["lesions"]:
        assert lesion["status"] in STATUSES
        assert 0 <= lesion["confidence"] <= 1
        assert isinstance(lesion["appearance_matched"], bool)
        assert isinstance(lesion["reason"], str)
        assert isinstance(lesion["candidates"], list)
        assert "capture" not in lesion
        if lesion["status"] in WITH_POINT:
            assert is_vector(lesion["point_m"], 3)
            assert is_vector(lesion["pixel"], 2)
            assert 0 < lesion["radius95_m"] < 0.5
        else:
            assert lesion["reason"]
            assert not {"point_m", "pixel", "radius95_m"} & {k for k, v in lesion.items() if v is not None}
        for candidate in lesion["candidates"]:
            assert is_vector(candidate["point_m"], 3)
            assert is_vector(candidate["pixel"], 2)
            assert 0 <= candidate["confidence"] <= 1
        if lesion.get("region") is not None:
            long, short = lesion["region"]["axes_m"]
            assert long >= short > 0
            assert np.linalg.norm(lesion["region"]["direction"]) == pytest.approx(1, abs=1e-3)
        if lesion.get("agreement_m") is not None:
            assert lesion["agreement_m"] >= 0


def test_points_lie_on_the_follow_ups_skin_and_under_their_pixels(
    result: dict[str, Any], followup: Shot
) -> None:
    answered = [lesion for lesion in result["lesions"] if lesion["status"] in WITH_POINT]
    assert len(answered) >= 5
    points = [lesion["point_m"] for lesion in answered]
    assert on_surface_m(followup.folder, points) < 0.03
    shown = read_capture(followup.folder).rig.project_to_picture(points)
    np.testing.assert_allclose(shown, [lesion["pixel"] for lesion in answered], atol=0.6)


def test_lesions_are_found_on_their_place_of_the_body(result: dict[str, Any], followup: Shot) -> None:
    """A coarse camera, another stance: the same place of the same body part, for every one of them."""
    errors = [
        float(np.linalg.norm(np.array(lesion["point_m"]) - followup.point(lesion["id"])))
        for lesion in result["lesions"]
        if lesion["status"] in WITH_POINT and lesion["id"] in followup.visible()
    ]
    assert len(errors) >= 5
    assert np.median(errors) < 0.05
    assert max(errors) < 0.10


@pytest.mark.parametrize("method", METHODS)
def test_a_method_answers_by_its_name(method: str, first: Shot, followup: Shot, tmp_path: Path) -> None:
    lesions = first.lesions(tmp_path / "l.json", 3)
    result = relocated(
        first.folder, followup.folder, lesions, tmp_path / "r.json", "--method", method, "--no-appearance"
    )
    assert result["method"] == method
    assert len(result["lesions"]) == 3
    assert any(lesion["status"] in WITH_POINT for lesion in result["lesions"])


def test_without_appearance_colour_decides_nothing(first: Shot, followup: Shot, tmp_path: Path) -> None:
    """The moles of the follow-up's picture are painted over; the answers stay where they were."""
    bland = copy_of(followup.folder, tmp_path / "bland")
    image = np.asarray(Image.open(bland / "color.png"))
    Image.fromarray(np.full_like(image, 150)).save(bland / "color.png")
    lesions = first.lesions(tmp_path / "l.json", 4)
    answers = [
        relocated(first.folder, f, lesions, tmp_path / "r.json", "--no-appearance")["lesions"]
        for f in (followup.folder, bland)
    ]
    assert not any(lesion["appearance_matched"] for part in answers for lesion in part)
    for a, b in zip(*answers, strict=True):
        assert a["status"] == b["status"]
        assert a.get("point_m") == b.get("point_m")


def test_the_same_seed_gives_the_same_answer(first: Shot, followup: Shot, tmp_path: Path) -> None:
    lesions = first.lesions(tmp_path / "l.json", 3)
    one, two = (
        relocated(first.folder, followup.folder, lesions, tmp_path / "r.json", "--seed", 7) for _ in "ab"
    )
    assert one["lesions"] == two["lesions"]


def test_no_lesions_give_an_empty_result(first: Shot, followup: Shot, tmp_path: Path) -> None:
    lesions = write_lesions(tmp_path / "l.json", [])
    result = relocated(first.folder, followup.folder, lesions, tmp_path / "r.json")
    assert result["lesions"] == []
    assert result["format"] == "geoderm-relocation/1"
    assert {"method", "seconds", "warnings"} <= set(result)


def test_depth_only_captures_are_asked_and_answered_in_depth_pixels(
    first: Shot, followup: Shot, tmp_path: Path
) -> None:
    one = without_color(first.copy(tmp_path / "one"))
    two = without_color(followup.copy(tmp_path / "two"))
    names = [name for name in first.visible() if name in followup.visible()][:5]
    pixels = depth_pixels_of(first.folder, np.array([first.pixel(n) for n in names]))
    lesions = write_lesions(
        tmp_path / "l.json",
        [{"id": n, "depth_pixel": p.tolist()} for n, p in zip(names, pixels, strict=True)],
    )
    result = relocated(one, two, lesions, tmp_path / "r.json")
    answered = [lesion for lesion in result["lesions"] if lesion["status"] in WITH_POINT]
    assert len(answered) >= 3
    camera = read_capture(two).rig.depth
    for lesion in answered:
        assert "pixel" not in lesion
        np.testing.assert_allclose(lesion["depth_pixel"], camera.project(lesion["point_m"])[0], atol=0.6)
        assert np.linalg.norm(np.array(lesion["point_m"]) - followup.point(lesion["id"])) < 0.10


def test_a_visit_folder_carries_the_capture_of_every_lesion(
    first: Shot, followup: Shot, back: Shot, tmp_path: Path
) -> None:
    visit1, visit2 = tmp_path / "visit1", tmp_path / "visit2"
    first.copy(visit1 / "front")
    followup.copy(visit2 / "from-the-front")
    back.copy(visit2 / "from-behind")
    names = [name for name in first.visible() if name in followup.visible()][:6]
    lesions = write_lesions(
        tmp_path / "l.json",
        [{"id": n, "capture": "front", "pixel": first.pixel(n).tolist()} for n in names],
    )
    result = relocated(visit1, visit2, lesions, tmp_path / "r.json")
    assert [lesion["id"] for lesion in result["lesions"]] == names
    answered = [lesion for lesion in result["lesions"] if lesion["status"] in WITH_POINT]
    assert len(answered) >= len(names) / 2, result["lesions"]
    assert {lesion["capture"] for lesion in answered} == {"from-the-front"}


def test_joints_come_from_the_tracker_where_none_are_recorded(
    first: Shot, followup: Shot, tmp_path: Path
) -> None:
    one = without_joints(first.copy(tmp_path / "one"))
    two = without_joints(followup.copy(tmp_path / "two"))
    names = [name for name in first.visible() if name in followup.visible()][:4]
    lesions = write_lesions(tmp_path / "l.json", [{"id": n, "pixel": first.pixel(n).tolist()} for n in names])
    result = relocated(one, two, lesions, tmp_path / "r.json")
    errors = [
        float(np.linalg.norm(np.array(lesion["point_m"]) - followup.point(lesion["id"])))
        for lesion in result["lesions"]
        if lesion["status"] in WITH_POINT
    ]
    assert len(errors) >= 3
    assert np.median(errors) < 0.05


def test_a_mirrored_recording_keeps_the_patients_own_left_and_right(
    first: Shot, followup: Shot, tmp_path: Path
) -> None:
    """Clicked in the mirrored picture as it is stored; the answer is on the same arm, not on the other."""
    flipped = mirrored(first.copy(tmp_path / "flipped"))
    width = Image.open(flipped / "color.png").width
    names = [
        n for n in first.visible() if n in followup.visible() and abs(float(followup.point(n)[0])) > 0.08
    ][:5]
    assert len(names) >= 2
    lesions = write_lesions(
        tmp_path / "l.json",
        [{"id": n, "pixel": [width - 1 - first.pixel(n)[0], first.pixel(n)[1]]} for n in names],
    )
    result = relocated(flipped, followup.folder, lesions, tmp_path / "r.json")
    answered = [lesion for lesion in result["lesions"] if lesion["status"] in WITH_POINT]
    assert len(answered) >= 2
    for lesion in answered:
        assert np.linalg.norm(np.array(lesion["point_m"]) - followup.point(lesion["id"])) < 0.10


def test_the_answer_in_a_mirrored_follow_up_is_a_pixel_of_the_picture_as_it_is_stored(
    first: Shot, followup: Shot, tmp_path: Path
) -> None:
    flipped = mirrored(followup.copy(tmp_path / "flipped"))
    width = Image.open(flipped / "color.png").width
    lesions = first.lesions(tmp_path / "l.json", 6)
    straight = relocated(first.folder, followup.folder, lesions, tmp_path / "r.json")
    result = relocated(first.folder, flipped, lesions, tmp_path / "m.json")
    compared = 0
    for a, b in zip(straight["lesions"], result["lesions"], strict=True):
        if a["status"] in WITH_POINT and b["status"] in WITH_POINT:
            compared += 1
            assert b["pixel"][0] == pytest.approx(width - 1 - a["pixel"][0], abs=3)
            assert b["pixel"][1] == pytest.approx(a["pixel"][1], abs=3)
    assert compared >= 3


def test_the_result_replaces_an_earlier_one_and_leaves_nothing_else(
    first: Shot, followup: Shot, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "r.json").write_text("old")
    relocated(first.folder, followup.folder, first.lesions(tmp_path / "l.json", 1), folder / "r.json")
    assert [p.name for p in folder.iterdir()] == ["r.json"]
