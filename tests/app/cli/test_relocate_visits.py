"""``geoderm relocate``: visits of several captures, and pictures that explain the answers."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.app.cli.cases import empty_room, geoderm, write_lesions
from tests.app.cli.conftest import Shot


def _common(first: Shot, followup: Shot, count: int) -> list[str]:
    return [name for name in first.visible() if name in followup.visible()][:count]


def test_a_capture_without_a_body_refuses_its_own_lesions_only(
    first: Shot, followup: Shot, tmp_path: Path
) -> None:
    visit = tmp_path / "visit"
    first.copy(visit / "front")
    empty_room(first.copy(visit / "nobody"))
    names = _common(first, followup, 2)
    lesions = write_lesions(
        tmp_path / "l.json",
        [
            {"id": "good", "capture": "front", "pixel": first.pixel(names[0]).tolist()},
            {"id": "lost", "capture": "nobody", "pixel": first.pixel(names[1]).tolist()},
        ],
    )
    out = tmp_path / "r.json"
    outcome = geoderm("relocate", visit, followup.folder, "--lesions", lesions, "--out", out)
    assert (outcome.code, outcome.err) == (0, "")
    good, lost = json.loads(out.read_text())["lesions"]
    assert good["id"] == "good"
    assert good["point_m"]
    assert (lost["id"], lost["status"]) == ("lost", "refused")
    assert "body" in lost["reason"]
    assert "point_m" not in lost or lost["point_m"] is None


@pytest.mark.parametrize("method", ["trilateration", "voting-dijkstra"])
def test_explanations_are_pictures_of_the_method_that_answered(
    first: Shot, followup: Shot, tmp_path: Path, method: str
) -> None:
    name = _common(first, followup, 1)[0]
    lesions = write_lesions(tmp_path / "l.json", [{"id": name, "pixel": first.pixel(name).tolist()}])
    out, pictures = tmp_path / "r.json", tmp_path / "why"
    outcome = geoderm(
        "relocate", first.folder, followup.folder, "--lesions", lesions, "--out", out,
        "--method", method, "--explain", pictures,
    )  # fmt: skip
    assert (outcome.code, outcome.err) == (0, "")
    files = sorted(pictures.glob(f"{name}-*.png"))
    assert len(files) >= 4
    for file in files:
        picture = cv2.imread(str(file))
        assert picture is not None
        assert np.ptp(picture) > 100


@pytest.mark.parametrize("value", ["0", "-0.01", "nan", "1.5"])
def test_an_impossible_band_is_wrong_use(first: Shot, followup: Shot, tmp_path: Path, value: str) -> None:
    lesions = write_lesions(tmp_path / "l.json", [])
    outcome = geoderm(
        "relocate", first.folder, followup.folder, "--lesions", lesions, "--out", tmp_path / "r.json",
        "--delta-m", value,
    )  # fmt: skip
    assert outcome.code == 2
    assert "delta" in outcome.err
