"""lesions.json and result.json as FORMATS has them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from core.errors import InputError, WorkError
from core.relocation import (
    Candidate,
    LesionQuery,
    Region,
    RelocatedLesion,
    RelocationResult,
    read_lesions,
    write_json,
)


def written(tmp_path, content):
    path = tmp_path / "lesions.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def test_lesions_are_read_in_their_order(tmp_path):
    path = written(
        tmp_path,
        {
            "lesions": [
                {"id": "L1", "pixel": [3, 4.5]},
                {"id": "L2", "depth_pixel": [7, 8], "capture": "back", "note": "ignored"},
            ]
        },
    )
    assert read_lesions(path) == (
        LesionQuery("L1", (3.0, 4.5)),
        LesionQuery("L2", None, (7.0, 8.0), "back"),
    )


def test_an_empty_list_is_no_error(tmp_path):
    assert read_lesions(written(tmp_path, {"lesions": []})) == ()


@pytest.mark.parametrize(
    ("content", "field"),
    [
        ("{", "JSON"),
        ("[1]", '"lesions"'),
        ({"lesions": {}}, '"lesions"'),
        ({"lesions": [5]}, "lesions[0]"),
        ({"lesions": [{"pixel": [1, 2]}]}, "lesions[0].id"),
        ({"lesions": [{"id": "a"}]}, '"pixel" or "depth_pixel"'),
        ({"lesions": [{"id": "a", "pixel": [1]}]}, "lesions[0].pixel"),
        ({"lesions": [{"id": "a", "pixel": [1, "x"]}]}, "lesions[0].pixel"),
        ('{"lesions": [{"id": "a", "pixel": [1, NaN]}]}', "lesions[0].pixel"),
        ('{"lesions": [{"id": "a", "pixel": [1, 1e999]}]}', "lesions[0].pixel"),
        ({"lesions": [{"id": "a", "pixel": [1, 2], "capture": 3}]}, "lesions[0].capture"),
        ({"lesions": [{"id": "a", "pixel": [1, 2]}, {"id": "a", "pixel": [3, 4]}]}, "lesions[1].id"),
        ("[" * 100_000, "JSON"),
    ],
)
def test_bad_lesions_name_the_file_and_the_field(tmp_path, content, field):
    path = written(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read_lesions(path)
    assert str(path) in caught.value.message
    assert field in caught.value.message


def test_a_missing_file_is_bad_input(tmp_path):
    with pytest.raises(InputError, match=r"absent\.json"):
        read_lesions(tmp_path / "absent.json")


def full_lesion(**changes):
    fields = {
        "id": "L1",
        "status": "ambiguous",
        "reason": "2 places",
        "point_m": np.array([0.1, 0.2, 2.0]),
        "pixel": (10.0, 20.0),
        "depth_pixel": (1.0, 2.0),
        "radius95_m": 0.03,
        "confidence": 0.6,
        "candidates": (Candidate(np.array([0.0, 0.1, 2.1]), 0.3, (5.0, 6.0), (0.5, 0.6)),),
        "region": Region((0.03, 0.02), np.array([1.0, 0.0, 0.0])),
        "agreement_m": 0.01,
    }
    return RelocatedLesion(**{**fields, **changes})


def test_every_field_of_an_answer_is_written(tmp_path):
    result = RelocationResult("trilateration", (full_lesion(),), {"total": 1.23456}, ("careful",))
    path = tmp_path / "result.json"
    write_json(path, result.to_json())
    document = json.loads(path.read_text(encoding="utf-8"))
    assert document["format"] == "geoderm-relocation/1"
    assert document["method"] == "trilateration"
    assert document["seconds"] == {"total": 1.2346}
    assert document["warnings"] == ["careful"]
    (lesion,) = document["lesions"]
    assert set(lesion) == {
        *("id", "status", "point_m", "pixel", "depth_pixel", "radius95_m", "confidence"),
        *("appearance_matched", "candidates", "reason", "region", "agreement_m"),
    }
    assert lesion["appearance_matched"] is False
    assert lesion["region"] == {"axes_m": [0.03, 0.02], "direction": [1.0, 0.0, 0.0]}
    assert lesion["candidates"][0]["pixel"] == [5.0, 6.0]


def test_without_an_answer_there_is_no_place_but_a_reason():
    lesion = RelocatedLesion("L1", "not_visible", "It is turned away.")
    (entry,) = RelocationResult("trilateration", (lesion,)).to_json()["lesions"]
    assert not {"point_m", "pixel", "depth_pixel", "radius95_m", "region"} & set(entry)
    assert entry["reason"] == "It is turned away."


def test_a_recording_without_colour_gets_depth_pixels_only():
    (entry,) = RelocationResult("trilateration", (full_lesion(picture="depth"),)).to_json()["lesions"]
    assert entry["depth_pixel"] == [1.0, 2.0]
    assert "pixel" not in entry
    assert "pixel" not in entry["candidates"][0]


def test_a_result_is_written_whole_or_not_at_all(tmp_path):
    path = tmp_path / "result.json"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(ValueError, match="JSON compliant"):
        write_json(path, {"x": float("nan")})
    with pytest.raises(WorkError):
        write_json(tmp_path / "absent" / "result.json", {"x": 1})
    assert path.read_text(encoding="utf-8") == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["result.json"]
