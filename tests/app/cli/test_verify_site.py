"""``geoderm verify-site``: the check before a surgeon cuts, careful about what it claims."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.app.cli.cases import assert_told, empty_room, geoderm, mirrored
from tests.app.cli.conftest import Shot


def _common(first: Shot, followup: Shot) -> list[str]:
    return [name for name in first.visible() if name in followup.visible()]


def _verify(
    first: Path, followup: Path, lesions: Path, lesion: str, pixel: object, *more: object
) -> dict[str, object]:
    u, v = pixel  # type: ignore[misc]
    outcome = geoderm(
        "verify-site", first, followup, "--lesions", lesions, "--id", lesion, "--pixel", u, v, "--json", *more
    )
    assert (outcome.code, outcome.err) == (0, ""), outcome
    document: dict[str, object] = json.loads(outcome.out)
    return document


def test_the_true_site_is_never_told_to_be_far_outside_and_another_lesion_is_never_inside(
    first: Shot, followup: Shot, tmp_path: Path
) -> None:
    lesions = first.lesions(tmp_path / "l.json")
    names, placed = _common(first, followup)[:3], 0
    for name in names:
        here = _verify(first.folder, followup.folder, lesions, name, followup.pixel(name))
        assert here["verdict"] in ("inside", "outside", "cannot tell")
        if here["distance_mm"] is None:
            assert here["verdict"] == "cannot tell"
            continue
        placed += 1
        assert here["verdict"] != "outside" or here["border_mm"] < 15
        away = [np.linalg.norm(followup.point(n) - followup.point(name)) for n in _common(first, followup)]
        far = _common(first, followup)[int(np.argmax(away))]
        there = _verify(first.folder, followup.folder, lesions, name, followup.pixel(far))
        assert there["verdict"] != "inside"
        assert there["distance_mm"] > 0.9 * 1000 * max(away) - 30
        assert there["distance_mm"] > here["distance_mm"]
    assert placed


def test_the_verdict_stands_on_the_first_line_and_the_figures_below(
    first: Shot, followup: Shot, tmp_path: Path
) -> None:
    lesions = first.lesions(tmp_path / "l.json")
    name = _common(first, followup)[0]
    u, v = followup.pixel(name)
    outcome = geoderm(
        "verify-site", first.folder, followup.folder, "--lesions", lesions, "--id", name, "--pixel", u, v
    )
    assert (outcome.code, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[0] in ("inside", "outside", "cannot tell")
    assert "mm from the centre" in lines[1]
    assert "border" in lines[1]
    assert "half axes" in lines[2]


@pytest.mark.parametrize("extra", [[], ["--healed"]])
def test_a_click_beside_the_body_cannot_be_judged(
    first: Shot, followup: Shot, tmp_path: Path, extra: list[str]
) -> None:
    lesions = first.lesions(tmp_path / "l.json", 2)
    document = _verify(first.folder, followup.folder, lesions, _common(first, followup)[0], (40, 120), *extra)
    assert document["verdict"] == "cannot tell"
    assert "not on the body" in str(document["reason"])
    assert document["distance_mm"] is None


def test_another_person_and_another_side_cannot_be_judged(
    first: Shot, other_person: Shot, back: Shot, tmp_path: Path
) -> None:
    lesions = first.lesions(tmp_path / "l.json", 2)
    name = first.visible()[0]
    for shot in (other_person, back):
        site = shot.truth.mole_pixels[int(np.flatnonzero(shot.truth.mole_visible)[0])]
        document = _verify(first.folder, shot.folder, lesions, name, site)
        assert document["verdict"] == "cannot tell"
        assert document["status"] == "refused"
        assert "not found" in str(document["reason"])


def test_a_mirrored_follow_up_is_clicked_as_it_is_stored(first: Shot, followup: Shot, tmp_path: Path) -> None:
    lesions = first.lesions(tmp_path / "l.json", 3)
    name = _common(first, followup)[0]
    straight = _verify(first.folder, followup.folder, lesions, name, followup.pixel(name))
    flipped = mirrored(followup.copy(tmp_path / "mirrored"))
    u, v = followup.pixel(name)
    document = _verify(first.folder, flipped, lesions, name, (319 - u, v))
    assert document["verdict"] == straight["verdict"]
    assert document["distance_mm"] == pytest.approx(straight["distance_mm"], abs=1.0)


def test_wrong_use_names_the_file_and_the_field(first: Shot, followup: Shot, tmp_path: Path) -> None:
    lesions = first.lesions(tmp_path / "l.json", 1)
    name = first.visible()[0]

    def call(*arguments: object) -> object:
        return geoderm("verify-site", first.folder, followup.folder, "--lesions", lesions, *arguments)

    assert_told(call("--id", "nobody", "--pixel", 5, 5), 2, "l.json", "nobody")  # type: ignore[arg-type]
    assert_told(call("--id", name, "--pixel", 5000, 5), 2, followup.folder, "--pixel", "5000")  # type: ignore[arg-type]
    assert_told(call("--id", name, "--pixel", "nan", 5), 2, "--pixel")  # type: ignore[arg-type]
    assert_told(call("--id", name, "--pixel", 5, 5, "--capture", "left"), 2, "left")  # type: ignore[arg-type]
    two = tmp_path / "visit"
    followup.copy(two / "a")
    followup.copy(two / "b")
    several = geoderm("verify-site", first.folder, two, "--lesions", lesions, "--id", name, "--pixel", 5, 5)
    assert_told(several, 2, "--capture", "a, b")


def test_no_body_is_work_that_could_not_be_done(first: Shot, followup: Shot, tmp_path: Path) -> None:
    lesions = first.lesions(tmp_path / "l.json", 1)
    room = empty_room(followup.copy(tmp_path / "room"))
    outcome = geoderm(
        "verify-site", first.folder, room, "--lesions", lesions, "--id", first.visible()[0], "--pixel", 5, 5
    )
    assert_told(outcome, 3, "body")
