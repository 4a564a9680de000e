"""The door for recorded stances: folders of captures, and clicks.json beside each."""

from __future__ import annotations

import json

import pytest

from core.errors import InputError
from core.evaluation.thesis import Clicks, find_sequences, read_clicked, write_clicks
from core.evaluation.thesis.sequences import check_first_clicked


def test_a_folder_of_captures_is_one_stance_in_the_order_of_names(tmp_path, put_capture):
    for name in ("b", "a", "c"):
        put_capture(tmp_path / "standing" / name)
    (sequence,) = find_sequences(tmp_path / "standing")
    assert sequence.name == "standing"
    assert [p.name for p in sequence.folders] == ["a", "b", "c"]
    assert len(sequence.shortened(2).folders) == 2


def test_a_folder_of_such_folders_is_several_stances(tmp_path, put_capture):
    for stance in ("psi", "down"):
        for name in ("0", "1"):
            put_capture(tmp_path / stance / name)
    (tmp_path / "notes").mkdir()
    assert [s.name for s in find_sequences(tmp_path)] == ["down", "psi"]


def test_layouts_that_cannot_be_meant_are_refused(tmp_path, put_capture):
    with pytest.raises(InputError, match="no capture folder"):
        find_sequences(tmp_path)
    with pytest.raises(InputError, match="is not a folder"):
        find_sequences(tmp_path / "nothing")
    one = put_capture(tmp_path / "one" / "0")
    with pytest.raises(InputError, match="is one capture"):
        find_sequences(one)
    with pytest.raises(InputError, match="at least two"):
        find_sequences(tmp_path / "one")
    put_capture(tmp_path / "mixed" / "0")
    put_capture(tmp_path / "mixed" / "psi" / "0")
    with pytest.raises(InputError, match="beside folders of captures"):
        find_sequences(tmp_path / "mixed")


def test_clicks_are_read_back_as_they_were_written(tmp_path, put_capture):
    folder = put_capture(tmp_path / "0")
    assert read_clicked(folder).clicks == Clicks()
    write_clicks(folder, Clicks({"L1": (10.5, 20.25)}, {"head": (3.0, 4.0)}, simulated=True))
    clicks = read_clicked(folder).clicks
    assert clicks.lesions == {"L1": (10.5, 20.25)}
    assert clicks.joints == {"head": (3.0, 4.0)}
    assert clicks.simulated


def test_a_lesion_that_is_null_was_not_seen(tmp_path, put_capture):
    folder = put_capture(tmp_path / "0")
    text = {"format": "geoderm-clicks/1", "lesions": {"L1": None, "L2": [1, 2]}}
    (folder / "clicks.json").write_text(json.dumps(text))
    assert read_clicked(folder).clicks.lesions == {"L2": (1.0, 2.0)}


def test_clicks_on_a_mirrored_recording_count_in_its_files(tmp_path, put_capture):
    folder = put_capture(tmp_path / "0", {"L1": (10.0, 20.0)}, mirrored=True)
    assert read_clicked(folder).clicks.lesions == {"L1": (53.0, 20.0)}


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ({"lesions": {}}, "format"),
        ({"format": "other/1"}, "format"),
        ({"format": "geoderm-clicks/1", "lesions": [1]}, "lesions"),
        ({"format": "geoderm-clicks/1", "lesions": {"L1": [1]}}, "lesions.L1"),
        ({"format": "geoderm-clicks/1", "lesions": {"L1": [64, 3]}}, "lesions.L1"),
        ({"format": "geoderm-clicks/1", "lesions": {"": [1, 2]}}, "lesions"),
        ({"format": "geoderm-clicks/1", "joints": {"nose": [1, 2]}}, "joints.nose"),
        ({"format": "geoderm-clicks/1", "simulated": 1}, "simulated"),
    ],
)
def test_wrong_clicks_name_the_file_and_the_field(tmp_path, put_capture, text, named):
    folder = put_capture(tmp_path / "0")
    (folder / "clicks.json").write_text(json.dumps(text))
    with pytest.raises(InputError) as told:
        read_clicked(folder)
    assert f"{folder / 'clicks.json'}: {named}" in told.value.message


def test_the_first_capture_must_be_clicked_when_others_are(tmp_path, put_capture):
    put_capture(tmp_path / "psi" / "0")
    put_capture(tmp_path / "psi" / "1", {"L1": (5.0, 5.0)})
    (sequence,) = find_sequences(tmp_path / "psi")
    with pytest.raises(InputError, match="no lesion is clicked"):
        check_first_clicked(sequence, read_clicked(sequence.folders[0]))
