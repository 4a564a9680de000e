"""Labels of hands on disk: what is written is read back, and whatever is wrong is told by file and field."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.errors import InputError, WorkError
from core.hand.dataset import LABELS_FILE, dataset_frames, read_labels, write_labels
from core.hand.labels import FrameLabels
from core.hand.names import POINT_NAMES

GOOD: dict[str, Any] = {"configuration": "A", "points": {"thumb_tip": {"point_m": [0.1, -0.2, 0.7]}}}


def capture_folder(folder: Path, **fields: object) -> Path:
    folder.mkdir(parents=True)
    (folder / "capture.json").write_text(json.dumps(fields), encoding="utf-8")
    return folder


def labels_file(folder: Path, content: object) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    text = content if isinstance(content, str) else json.dumps(content)
    (folder / LABELS_FILE).write_text(text, encoding="utf-8")
    return folder


def test_frames_come_in_name_order(tmp_path: Path) -> None:
    for name in ("frame_0010", "frame_0002", ".hidden"):
        capture_folder(tmp_path / name)
    (tmp_path / "notes").mkdir()
    assert [p.name for p in dataset_frames(tmp_path)] == ["frame_0002", "frame_0010"]


def test_a_capture_folder_is_a_sequence_of_one(tmp_path: Path) -> None:
    assert dataset_frames(capture_folder(tmp_path / "one")) == [tmp_path / "one"]


def test_a_folder_without_captures_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no sub-folder holds a capture\.json"):
        dataset_frames(tmp_path)
    with pytest.raises(InputError, match="is not a folder"):
        dataset_frames(tmp_path / "absent")


def test_labels_are_read_back_as_they_were_written(tmp_path: Path) -> None:
    written = FrameLabels(
        "pinch",
        {"index_tip": np.array([0.01, -0.02, 0.612345]), "thumb_mcp": np.array([-0.03, 0.0, 0.6])},
        {"thumb_mcp": False},
    )
    write_labels(tmp_path, written)
    read = read_labels(tmp_path)
    assert read is not None
    assert read.configuration == "pinch"
    assert read.visible == {"index_tip": True, "thumb_mcp": False}
    for name, place in written.points_m.items():
        np.testing.assert_allclose(read.points_m[name], place, atol=1e-6)


def test_a_name_is_the_same_however_its_accents_were_typed(tmp_path: Path) -> None:
    for typed in ("g\u00e9n\u00e9reux", " ge\u0301ne\u0301reux"):
        (tmp_path / LABELS_FILE).write_text(json.dumps({"configuration": typed}), encoding="utf-8")
        read = read_labels(tmp_path)
        assert read is not None
        assert read.configuration == "g\u00e9n\u00e9reux"


def test_the_file_is_the_documented_one(tmp_path: Path) -> None:
    write_labels(tmp_path, FrameLabels("A", {"thumb_tip": np.array([0.1, -0.2, 0.7])}))
    assert json.loads((tmp_path / LABELS_FILE).read_text(encoding="utf-8")) == {
        "configuration": "A",
        "points": {"thumb_tip": {"point_m": [0.1, -0.2, 0.7], "visible": True}},
    }


def test_a_frame_without_labels_has_none(tmp_path: Path) -> None:
    assert read_labels(tmp_path) is None


@pytest.mark.parametrize(
    "content", [{}, {"configuration": None}, {"points": {}}, {"points": {"thumb_tip": None}}]
)
def test_configuration_and_points_may_be_absent(tmp_path: Path, content: dict[str, object]) -> None:
    labels = read_labels(labels_file(tmp_path, content))
    assert labels is not None
    assert labels.configuration is None
    assert not labels.points_m


def test_hidden_points_do_not_teach(tmp_path: Path) -> None:
    point = {"point_m": [0.0, 0.0, 0.6], "visible": False}
    labels = read_labels(labels_file(tmp_path, {"configuration": "A", "points": {"index_tip": point}}))
    assert labels is not None
    assert np.isnan(labels.array()).all()
    assert np.isfinite(labels.array(only_visible=False)).any()


def test_labels_of_a_mirrored_capture_follow_its_unmirroring(tmp_path: Path) -> None:
    """As its recorded joints do: the file is in the recorded frame, the program never sees a mirrored one."""
    folder = labels_file(capture_folder(tmp_path / "mirror", mirrored=True), GOOD)
    labels = read_labels(folder)
    assert labels is not None
    np.testing.assert_allclose(labels.points_m["thumb_tip"], [-0.1, -0.2, 0.7])
    write_labels(folder, labels)
    kept = json.loads((folder / LABELS_FILE).read_text(encoding="utf-8"))
    assert kept["points"]["thumb_tip"]["point_m"] == [0.1, -0.2, 0.7]


def point(**fields: object) -> dict[str, object]:
    return {"configuration": "A", "points": {"thumb_tip": {"point_m": [0.1, 0.2, 0.7], **fields}}}


@pytest.mark.parametrize(
    ("content", "field"),
    [
        ("not json", "JSON"),
        ("[]", "object"),
        ("[" * 100_000, "recursion"),
        ('{"points": {"thumb_tip": {"point_m": [0.1, NaN, 0.7]}}}', "points.thumb_tip.point_m.1"),
        ('{"points": {"thumb_tip": {"point_m": [0.1, 0.2, 1e999]}}}', "points.thumb_tip.point_m.2"),
        (point(point_m=[0.1, 0.2]), "points.thumb_tip.point_m"),
        (point(point_m=[0.1, 0.2, 0.3, 0.4]), "points.thumb_tip.point_m"),
        (point(point_m=[100, 200, 700]), "points.thumb_tip.point_m.0"),
        (point(point_m=[0.1, 0.2, -0.7]), "behind the camera"),
        (point(point_m=["0.1", 0.2, 0.7]), "points.thumb_tip.point_m.0"),
        (point(visible="yes"), "points.thumb_tip.visible"),
        (point(visible=1), "points.thumb_tip.visible"),
        ({"points": {"thumb_nail": {"point_m": [0, 0, 0.7]}}}, "thumb_nail"),
        ({"points": {"thumb_tip": [0, 0, 0.7]}}, "points.thumb_tip"),
        ({"points": [1, 2]}, "points"),
        ({"configuration": 3}, "configuration"),
        ({"configuration": "  "}, "configuration"),
        ({"configuration": "x" * 500}, "configuration"),
        ({"configuration": "a\nb"}, "configuration"),
    ],
)
def test_a_wrong_file_is_told_by_name_and_field(tmp_path: Path, content: object, field: str) -> None:
    with pytest.raises(InputError) as told:
        read_labels(labels_file(tmp_path, content))
    assert str(tmp_path / LABELS_FILE) in str(told.value)
    assert field in str(told.value)
    assert len(str(told.value)) < 600


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    labels_file(tmp_path, '{"configuration": "' + "a" * 300_000 + '"}')
    with pytest.raises(InputError, match="larger than"):
        read_labels(tmp_path)


@pytest.mark.parametrize(
    "labels",
    [
        FrameLabels("A", {"thumb_nail": np.zeros(3)}),
        FrameLabels("A", {"thumb_tip": np.array([0.0, np.nan, 0.7])}),
        FrameLabels("A", {"thumb_tip": np.zeros(2)}),
        FrameLabels(" ", {}),
    ],
)
def test_what_could_not_be_read_again_is_not_written(tmp_path: Path, labels: FrameLabels) -> None:
    labels_file(tmp_path, GOOD)
    with pytest.raises(InputError):
        write_labels(tmp_path, labels)
    assert json.loads((tmp_path / LABELS_FILE).read_text(encoding="utf-8")) == GOOD
    assert [p.name for p in tmp_path.iterdir()] == [LABELS_FILE]


def test_a_file_that_cannot_be_replaced_leaves_no_litter(tmp_path: Path) -> None:
    (tmp_path / LABELS_FILE).mkdir()
    with pytest.raises(WorkError, match="cannot be written"):
        write_labels(tmp_path, FrameLabels("A"))
    assert [p.name for p in tmp_path.iterdir()] == [LABELS_FILE]


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
POINTS = st.dictionaries(
    st.sampled_from(POINT_NAMES) | st.text(max_size=5),
    JSON
    | st.fixed_dictionaries({"point_m": st.lists(st.floats(-1, 1), min_size=2, max_size=4), "visible": JSON}),
    max_size=3,
)


def outcome(folder: Path) -> tuple[FrameLabels | None, str]:
    """Labels, or the words in which they are refused."""
    try:
        return read_labels(folder), ""
    except InputError as error:
        return None, str(error)


@settings(max_examples=150, deadline=None)
@given(JSON | st.fixed_dictionaries({"configuration": JSON, "points": POINTS}))
def test_any_content_gives_labels_or_one_clear_refusal(content: object) -> None:
    with tempfile.TemporaryDirectory() as folder:
        labels, refusal = outcome(labels_file(Path(folder), content))
        if labels is None:
            assert LABELS_FILE in refusal
            return
        assert set(labels.points_m) <= set(POINT_NAMES)
        assert all(np.isfinite(place).all() for place in labels.points_m.values())
        write_labels(Path(folder), labels)


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=60))
def test_any_bytes_give_labels_or_one_clear_refusal(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / LABELS_FILE).write_bytes(content)
        labels, refusal = outcome(Path(folder))
        assert labels is not None or LABELS_FILE in refusal


def test_a_folder_of_datasets_says_where_the_captures_are(tmp_path: Path) -> None:
    capture = tmp_path / "all" / "anna" / "frame_0001"
    capture.mkdir(parents=True)
    (capture / "capture.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match="'anna'"):
        dataset_frames(tmp_path / "all")
