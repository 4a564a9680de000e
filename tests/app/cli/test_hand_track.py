"""``geoderm hand track``: tracks.json as documented, and whatever hinders it said in one line."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.hand.dataset import LABELS_FILE, read_labels
from core.hand.hand_model import HandModel
from core.hand.learning import learn_hand
from core.hand.marker_anchors import MarkerAnchors
from core.hand.model_file import write_model
from core.hand.names import POINT_NAMES
from tests.app.cli.cases import assert_told, copy_of, geoderm, mirrored, without_color
from tests.core.hand.training_frames import CONFIGURATIONS, new_frame, training_frames, write_dataset

FIELDS = ["capture", "configuration", "marker_seen", "reason", "points"]


@pytest.fixture(scope="session")
def learned() -> HandModel:
    return learn_hand(training_frames(), MarkerAnchors(0.036)).model


@pytest.fixture(scope="session")
def model(learned: HandModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("hand") / "model.json"
    write_model(path, learned)
    return path


@pytest.fixture(scope="session")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hand never learned from, and two frames of hands that were."""
    return write_dataset(tmp_path_factory.mktemp("hand") / "sequence", (*training_frames()[:2], new_frame()))


def tracked(model: Path, sequence: Path, out: Path, *options: object) -> list[dict[str, Any]]:
    outcome = geoderm("hand", "track", model, sequence, "--out", out, *options)
    assert (outcome.code, outcome.err) == (0, ""), outcome
    content = json.loads(out.read_text(encoding="utf-8"))
    assert content["format"] == "geoderm-hand/1"
    frames: list[dict[str, Any]] = content["frames"]
    return frames


def check_frame(frame: dict[str, Any]) -> None:
    """Fields, types and ranges of the contract."""
    assert list(frame) == FIELDS
    assert frame["configuration"] is None or isinstance(frame["configuration"], str)
    assert isinstance(frame["marker_seen"], bool)
    assert frame["reason"] is None or isinstance(frame["reason"], str)
    assert list(frame["points"]) == list(POINT_NAMES)
    for point in frame["points"].values():
        if point is None:
            continue
        assert list(point) == ["point_m", "pixel", "confidence"]
        assert len(point["point_m"]) == 3
        assert len(point["pixel"]) == 2
        assert np.isfinite([*point["point_m"], *point["pixel"]]).all()
        assert 0.0 <= point["confidence"] <= 1.0


def test_every_frame_has_its_entry_and_its_15_points(model: Path, sequence: Path, tmp_path: Path) -> None:
    frames = tracked(model, sequence, tmp_path / "tracks.json")
    assert [frame["capture"] for frame in frames] == ["frame_000", "frame_001", "new"]
    for frame in frames:
        check_frame(frame)
        assert frame["marker_seen"]


def test_points_lie_where_they_truly_are(model: Path, sequence: Path, tmp_path: Path) -> None:
    """Hands that were learned from, and one that was not: the median visible point is within a centimetre."""
    for frame in tracked(model, sequence, tmp_path / "tracks.json"):
        labels = read_labels(sequence / frame["capture"])
        assert labels is not None
        assert frame["configuration"] == labels.configuration
        truth = dict(zip(POINT_NAMES, labels.array(), strict=True))
        off = [
            np.linalg.norm(np.array(point["point_m"]) - truth[name])
            for name, point in frame["points"].items()
            if point is not None and np.isfinite(truth[name]).all()
        ]
        assert len(off) >= 6
        assert np.median(off) < 0.010


def test_a_capture_folder_is_a_sequence_of_one(model: Path, sequence: Path, tmp_path: Path) -> None:
    frames = tracked(model, sequence / "new", tmp_path / "tracks.json")
    assert [frame["capture"] for frame in frames] == ["new"]


def test_a_recording_is_tracked_frame_by_frame(model: Path, tmp_path: Path) -> None:
    from devices.openni.cameras import write_oni

    write_oni(new_frame()[1], tmp_path / "hand.oni")
    frames = tracked(model, tmp_path / "hand.oni", tmp_path / "tracks.json")
    assert [frame["capture"] for frame in frames] == ["frame_000001"]
    check_frame(frames[0])
    assert frames[0]["marker_seen"]


def test_the_summary_and_the_table(model: Path, sequence: Path, tmp_path: Path) -> None:
    table = tmp_path / "tracks.csv"
    outcome = geoderm(
        "hand", "track", model, sequence, "--out", tmp_path / "t.json", "--csv", table, "--json"
    )
    assert outcome.code == 0
    told = json.loads(outcome.out)
    assert (told["frames"], told["marker_seen"]) == (3, 3)
    assert sum(one["frames"] for one in told["configurations"]) == 3
    assert told["frames_per_second"] > 0
    with table.open(encoding="utf-8", newline="") as file:
        assert len(list(csv.DictReader(file))) == 3 * len(POINT_NAMES)
    words = geoderm("hand", "track", model, sequence, "--out", tmp_path / "t.json").out
    assert "3 frames" in words
    assert "frames/s" in words


def test_frames_of_which_nothing_can_be_said_say_why(model: Path, sequence: Path, tmp_path: Path) -> None:
    blind = tmp_path / "s" / "blind"
    without_color(copy_of(sequence / "new", blind))
    (frame,) = tracked(model, blind.parent, tmp_path / "tracks.json")
    check_frame(frame)
    assert frame["marker_seen"] is False
    assert frame["configuration"] is None
    assert frame["points"] == dict.fromkeys(POINT_NAMES)
    assert "colour" in frame["reason"]


@pytest.mark.parametrize(
    ("options", "warning", "reason"),
    [
        (("--dictionary", "DICT_5X5_50"), "DICT_5X5_50 is not the model's DICT_4X4_50", "DICT_4X4_50"),
        (("--marker-m", "0.072"), "0.072 is not the 0.036 m of the model", "36 mm"),
    ],
)
def test_another_marker_than_the_models_is_warned_of(
    model: Path, sequence: Path, tmp_path: Path, options: tuple[str, ...], warning: str, reason: str
) -> None:
    out = tmp_path / "tracks.json"
    outcome = geoderm("hand", "track", model, sequence / "new", "--out", out, *options)
    assert outcome.code == 0
    assert outcome.err.count("\n") == 1
    assert warning in outcome.err
    (frame,) = json.loads(out.read_text(encoding="utf-8"))["frames"]
    assert reason in frame["reason"]
    assert frame["points"] == dict.fromkeys(POINT_NAMES)


def test_a_known_configuration_is_not_judged(model: Path, sequence: Path, tmp_path: Path) -> None:
    frames = tracked(model, sequence, tmp_path / "tracks.json", "--configuration", CONFIGURATIONS[0])
    assert {frame["configuration"] for frame in frames} <= {CONFIGURATIONS[0], None}


@pytest.mark.parametrize("refinement", ["joint", "sequential"])
def test_both_refinements_track(model: Path, sequence: Path, tmp_path: Path, refinement: str) -> None:
    (frame,) = tracked(model, sequence / "new", tmp_path / "t.json", "--refinement", refinement)
    check_frame(frame)
    assert any(point is not None for point in frame["points"].values())


def test_a_strict_threshold_reports_fewer_points(model: Path, sequence: Path, tmp_path: Path) -> None:
    told = [
        sum(
            p is not None
            for f in tracked(model, sequence, tmp_path / "t.json", *options)
            for p in f["points"].values()
        )
        for options in ((), ("--threshold-mm", "1"))
    ]
    assert told[1] < told[0]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--configuration", "salute"), "salute"),
        (("--refinement", "both"), "both"),
        (("--threshold-mm", "0"), "--threshold-mm"),
        (("--marker-m", "36"), "0.036"),
        (("--dictionary", "DICT_9X9"), "DICT_9X9"),
        (("--csv", "absent/t.csv"), "--csv"),
        (("--csv", "{out}"), "--out"),
    ],
)
def test_wrong_options_of_tracking_are_told(
    model: Path, sequence: Path, tmp_path: Path, options: tuple[str, ...], words: str
) -> None:
    out = tmp_path / "t.json"
    given = [option.replace("{out}", str(out)) for option in options]
    assert_told(geoderm("hand", "track", model, sequence, "--out", out, *given), 2, words)
    assert not out.exists()


def test_wrong_files_of_tracking_are_told(model: Path, sequence: Path, tmp_path: Path) -> None:
    out = tmp_path / "t.json"
    bad = tmp_path / "bad.json"
    bad.write_text('{"format": "geoderm-hand-model/1"}', encoding="utf-8")
    assert_told(geoderm("hand", "track", bad, sequence, "--out", out), 2, bad, "anchors")
    assert_told(geoderm("hand", "track", model, tmp_path / "absent", "--out", out), 2, "absent")
    assert_told(geoderm("hand", "track", model, bad, "--out", out), 2, bad)
    broken = copy_of(sequence / "new", tmp_path / "s" / "broken")
    (broken / "capture.json").write_text("{", encoding="utf-8")
    assert_told(geoderm("hand", "track", model, broken.parent, "--out", out), 2, "capture.json")
    assert not out.exists()


def test_what_is_read_is_not_written_over(model: Path, sequence: Path, tmp_path: Path) -> None:
    mine = tmp_path / "model.json"
    mine.write_bytes(model.read_bytes())
    before = mine.read_bytes()
    link = tmp_path / "link.json"
    link.symlink_to(mine)
    out = tmp_path / "t.json"
    assert_told(geoderm("hand", "track", mine, sequence, "--out", link), 2, "--out", "MODEL")
    assert_told(geoderm("hand", "track", mine, sequence, "--out", out, "--csv", mine), 2, "--csv", "MODEL")
    copy = copy_of(sequence / "new", tmp_path / "s" / "new")
    labels = (copy / LABELS_FILE).read_bytes()
    assert_told(geoderm("hand", "track", mine, copy, "--out", copy / LABELS_FILE), 2, LABELS_FILE)
    assert (mine.read_bytes(), (copy / LABELS_FILE).read_bytes()) == (before, labels)
    assert not out.exists()


def test_a_linked_capture_is_told_by_its_name_in_the_sequence(
    model: Path, sequence: Path, tmp_path: Path
) -> None:
    """Several people's frames put together by links have the same names where they come from."""
    together = tmp_path / "together"
    together.mkdir()
    (together / "anna_new").symlink_to(sequence / "new")
    (frame,) = tracked(model, together, tmp_path / "t.json")
    assert frame["capture"] == "anna_new"


def test_a_table_into_a_device_leaves_the_device_alone(model: Path, sequence: Path, tmp_path: Path) -> None:
    device = tmp_path / "null"
    device.symlink_to("/dev/null")
    outcome = geoderm("hand", "track", model, sequence / "new", "--out", tmp_path / "t.json", "--csv", device)
    assert outcome.code == 0
    assert device.is_char_device()


def test_a_sequence_whose_name_cannot_be_is_told_briefly(model: Path, tmp_path: Path) -> None:
    assert_told(
        geoderm("hand", "track", model, "x" * 5000, "--out", tmp_path / "t.json"), 2, "cannot be read"
    )


def test_pixels_count_in_the_pictures_as_they_are_stored(model: Path, sequence: Path, tmp_path: Path) -> None:
    """A mirrored recording: points in the camera's real frame, pixels in the mirrored picture on disk."""
    copy = mirrored(copy_of(sequence / "new", tmp_path / "s" / "new"))
    (plain,) = tracked(model, sequence / "new", tmp_path / "plain.json")
    (other,) = tracked(model, copy, tmp_path / "mirrored.json")
    width = json.loads((copy / "capture.json").read_text(encoding="utf-8"))["color"]["intrinsics"]["width"]
    told = [name for name, point in plain["points"].items() if point is not None]
    assert told
    for name in told:
        one, two = plain["points"][name], other["points"][name]
        assert two["point_m"] == pytest.approx(one["point_m"], abs=1e-5)
        u, v = one["pixel"]
        assert two["pixel"] == pytest.approx([width - 1 - u, v], abs=0.02)
