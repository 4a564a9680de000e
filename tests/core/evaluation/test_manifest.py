"""A researcher's manifest: what is wrong is named by file, row and column."""

from __future__ import annotations

import json

import pytest

from core.errors import InputError
from core.evaluation.manifest import read_manifest


@pytest.fixture
def study(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "capture.json").write_text("{}")
    (tmp_path / "lesions.json").write_text(
        '{"lesions": [{"id": "L1", "pixel": [3, 4]}, {"id": 2, "pixel": [1, 1]}]}'
    )
    truth = [{"id": "L1", "pixel": [5.5, 6]}, {"id": 2, "visible": False}]
    (tmp_path / "truth.json").write_text(json.dumps({"lesions": truth}))

    def write(*rows, head="case,first,followup,lesions,truth"):
        path = tmp_path / "manifest.csv"
        path.write_text("\n".join((head, *rows)) + "\n")
        return path

    return write


GOOD = "c1,one,two,lesions.json,truth.json"


def test_paths_count_from_the_manifest(study, tmp_path):
    (pair,) = read_manifest(study(GOOD))
    assert (pair.case, pair.body, pair.first) == ("c1", "c1", tmp_path / "one")
    assert pair.truth["L1"].pixel == (5.5, 6.0)
    assert pair.truth["2"].visible is False


def test_a_body_may_be_named(study):
    path = study(GOOD + ",anna", head="case,first,followup,lesions,truth,body")
    assert read_manifest(path)[0].body == "anna"


@pytest.mark.parametrize(
    ("row", "told"),
    [
        ("c1,one,,lesions.json,truth.json", 'row 2: column "followup" is empty'),
        ("c1,one,three,lesions.json,truth.json", 'row 2: column "followup": .*three is no capture folder'),
        ("c1,one,two,none.json,truth.json", 'row 2: column "lesions": .*none.json: cannot be read'),
        ("c1,one,two,lesions.json,lesions.txt", 'row 2: column "truth": .*lesions.txt'),
        (GOOD + ",too,many", "row 2: more cells"),
        (f"{GOOD}\n{GOOD}", 'column "case": "c1" occurs twice'),
    ],
)
def test_what_is_wrong_in_a_row_is_named(study, row, told):
    with pytest.raises(InputError, match=told):
        read_manifest(study(row))


def test_a_missing_column_is_named(study):
    with pytest.raises(InputError, match='row 1: column "truth" is missing'):
        read_manifest(study("c1,one,two,lesions.json", head="case,first,followup,lesions"))


def test_an_empty_or_binary_manifest_is_refused(study, tmp_path):
    with pytest.raises(InputError, match="names no pair"):
        read_manifest(study())
    (tmp_path / "b.csv").write_bytes(b"case,\xff\xfe\x00")
    with pytest.raises(InputError, match=r"b\.csv"):
        read_manifest(tmp_path / "b.csv")
    with pytest.raises(InputError, match="cannot be read"):
        read_manifest(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ({"id": "L1"}, r'"lesions\[0\]" needs "pixel"'),
        ({"id": "L1", "pixel": [1]}, r'"lesions\[0\].pixel" must be 2 finite'),
        ({"id": "L1", "point_m": [1, 2, "x"]}, r'"lesions\[0\].point_m" must be 3 finite'),
        ({"id": "L1", "pixel": [1, 2], "visible": "no"}, r'"lesions\[0\].visible" must be'),
        ({"pixel": [1, 2]}, r'"lesions\[0\].id" must be a text'),
        ({"id": "L9", "pixel": [1, 2]}, 'does not say where lesion "L1" is'),
    ],
)
def test_what_is_wrong_in_a_truth_is_named(study, tmp_path, entry, told):
    (tmp_path / "truth.json").write_text(json.dumps({"lesions": [entry]}))
    with pytest.raises(InputError, match=told):
        read_manifest(study(GOOD))
