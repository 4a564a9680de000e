"""tracks.json and its table: exactly the documented fields, and nothing that is no finite number."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.errors import InputError, WorkError
from core.hand.answer import HandAnswer
from core.hand.names import POINT_NAMES
from core.hand.tracks import CSV_COLUMNS, Tracks, read_tracks, tracks_of, write_csv, write_tracks


def found() -> HandAnswer:
    """All points but two: one whose place is unknown, one that would lie behind the picture's camera."""
    rng = np.random.default_rng(4)
    points = rng.uniform(-0.1, 0.1, (15, 3)) + np.array([0, 0, 0.7])
    pixels = rng.uniform(0, 480, (15, 2))
    points[3] = np.nan
    pixels[4] = np.nan
    return HandAnswer("A", points, pixels, rng.uniform(0.2, 1.0, 15), marker_seen=True)


NOTHING = HandAnswer(reason="No marker is in view.")


def written(path: Path) -> dict[str, Any]:
    write_tracks(path, [("frame_0001", found()), ("frame_0002", NOTHING)])
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def test_the_document_is_the_documented_one(tmp_path: Path) -> None:
    content = written(tmp_path / "tracks.json")
    assert content["format"] == "geoderm-hand/1"
    first, second = content["frames"]
    assert list(first) == ["capture", "configuration", "marker_seen", "reason", "points"]
    assert (first["capture"], first["configuration"], first["marker_seen"]) == ("frame_0001", "A", True)
    assert first["reason"] is None
    assert list(first["points"]) == list(POINT_NAMES)
    assert set(first["points"]["thumb_tip"]) == {"point_m", "pixel", "confidence"}
    assert second["configuration"] is None
    assert second["reason"] == "No marker is in view."
    assert second["points"] == dict.fromkeys(POINT_NAMES)


def test_a_point_without_a_place_or_a_pixel_is_null(tmp_path: Path) -> None:
    points = written(tmp_path / "tracks.json")["frames"][0]["points"]
    assert [name for name, point in points.items() if point is None] == [POINT_NAMES[3], POINT_NAMES[4]]


def test_numbers_are_rounded_to_what_they_are_worth(tmp_path: Path) -> None:
    told = written(tmp_path / "tracks.json")["frames"][0]["points"]["thumb_ip"]
    answer = found()
    assert told["point_m"] == [round(x, 5) for x in answer.points_m[1].tolist()]
    assert told["pixel"] == [round(x, 2) for x in answer.pixels[1].tolist()]
    assert told["confidence"] == round(float(answer.confidence[1]), 4)


def test_tracks_are_read_back_as_they_were_written(tmp_path: Path) -> None:
    answers = [("frame_0001", found()), ("frame_0002", NOTHING)]
    write_tracks(tmp_path / "tracks.json", answers)
    assert read_tracks(tmp_path / "tracks.json") == tracks_of(answers)


def test_no_frames_are_an_empty_track(tmp_path: Path) -> None:
    write_tracks(tmp_path / "tracks.json", [])
    assert read_tracks(tmp_path / "tracks.json") == Tracks(())


def test_the_table_has_a_row_for_every_frame_and_point(tmp_path: Path) -> None:
    write_csv(tmp_path / "tracks.csv", [("frame_0001", found()), ("frame_0002", NOTHING)])
    with (tmp_path / "tracks.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == CSV_COLUMNS
    assert [(row["capture"], row["point"]) for row in rows] == [
        (name, point) for name in ("frame_0001", "frame_0002") for point in POINT_NAMES
    ]
    assert float(rows[0]["x_m"]) == round(float(found().points_m[0, 0]), 5)
    assert rows[0]["marker_seen"] == "true"
    assert {row["x_m"] + row["pixel_u"] + row["confidence"] for row in rows[15:]} == {""}
    assert {row["reason"] for row in rows[15:]} == {"No marker is in view."}


def test_a_name_is_no_formula_for_a_spreadsheet(tmp_path: Path) -> None:
    write_csv(tmp_path / "tracks.csv", [("=cmd|calc", replace(found(), configuration="+A", reason="-1"))])
    with (tmp_path / "tracks.csv").open(encoding="utf-8", newline="") as file:
        row = next(csv.DictReader(file))
    assert (row["capture"], row["configuration"], row["reason"]) == ("'=cmd|calc", "'+A", "'-1")


def test_a_name_that_is_no_text_is_written_all_the_same(tmp_path: Path) -> None:
    write_tracks(tmp_path / "tracks.json", [("frame\udcff", NOTHING)])
    assert read_tracks(tmp_path / "tracks.json").frames[0].capture == "frame?"


def test_a_file_that_cannot_be_written_is_told_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(WorkError, match="cannot be written"):
        write_tracks(tmp_path / "absent" / "tracks.json", [])
    (tmp_path / "folder").mkdir()
    with pytest.raises(WorkError, match="cannot be written"):
        write_csv(tmp_path / "folder", [])
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("format",), "geoderm-hand/2", "format"),
        (("frames", 0, "marker_seen"), 1, "frames.0.marker_seen"),
        (("frames", 0, "points"), {}, "frames.0.points"),
        (("frames", 0, "points", "thumb_nail"), None, "frames.0.points"),
        (("frames", 0, "points", "thumb_tip", "confidence"), 1.2, "frames.0.points.thumb_tip.confidence"),
        (("frames", 0, "points", "thumb_tip", "point_m"), [0, 0], "frames.0.points.thumb_tip.point_m"),
        (("frames", 0, "points", "thumb_tip", "pixel"), [float("nan"), 0], "frames.0.points.thumb_tip.pixel"),
        (("frames", 1, "configuration"), 4, "frames.1.configuration"),
    ],
)
def test_wrong_tracks_are_told_by_file_and_field(
    tmp_path: Path, path: tuple[str | int, ...], value: object, words: str
) -> None:
    file = tmp_path / "tracks.json"
    content: Any = written(file)
    inner = content
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    file.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(InputError) as told:
        read_tracks(file)
    assert str(file) in str(told.value)
    assert words in str(told.value)
