"""Random damage to capture.json and lesions.json: read or told in one line, never an internal error."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.app.cli.cases import Json, assert_told, copy_of, description, geoderm
from tests.app.cli.conftest import Shot

FUZZ = settings(
    max_examples=60,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)

ODD_NUMBERS = [0, -1, 1, 0.5, 1e-300, 1e300, -1e9, 2**31, 2**63, 10**40, math.nan, math.inf, -math.inf, 1e-3]
ODD_TEXTS = [
    "",
    " ",
    "..",
    "/",
    "\0",
    "\ud800",
    "front",
    "capture.json",
    "color.png",
    "depth_000.png",
    "é" * 300,
]
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.sampled_from(ODD_NUMBERS),
    st.sampled_from(ODD_TEXTS),
    st.floats(-10, 700),
    st.recursive(
        st.one_of(st.none(), st.sampled_from(ODD_NUMBERS), st.sampled_from(ODD_TEXTS)),
        lambda inner: st.one_of(
            st.lists(inner, max_size=4), st.dictionaries(st.sampled_from(ODD_TEXTS), inner, max_size=3)
        ),
        max_leaves=5,
    ),
)


def places(value: Any, here: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Every path into a JSON value."""
    found = [here] if here else []
    inner: Any = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    for key, child in inner:
        found += places(child, (*here, key))
    return found


def damaged(data: st.DataObject, content: Json) -> Json:
    """One to three places replaced, removed or renamed."""
    for _ in range(data.draw(st.integers(1, 3))):
        paths = places(content)
        if not paths:
            break
        path = data.draw(st.sampled_from(paths))
        owner: Any = content
        for key in path[:-1]:
            owner = owner[key]
        how = data.draw(st.sampled_from(["replace", "replace", "remove", "rename", "double"]))
        if how == "replace":
            owner[path[-1]] = data.draw(VALUES)
        elif how == "remove":
            del owner[path[-1]]
        elif isinstance(owner, list):
            owner.append(owner[path[-1]])
        elif how == "rename":
            owner[f"{path[-1]} "] = owner.pop(path[-1])
        else:
            owner[path[-1]] = [owner[path[-1]], owner[path[-1]]]
    return content


_folders: dict[Path, Path] = {}


def scratch(shot: Shot, factory: Any) -> Path:
    """A copy of a capture whose description is written anew for every example."""
    if shot.folder not in _folders:
        _folders[shot.folder] = copy_of(shot.folder, factory.mktemp("fuzz") / "capture")
    return _folders[shot.folder]


@FUZZ
@given(data=st.data())
def test_a_damaged_description_is_read_or_refused(
    data: st.DataObject, first: Shot, tmp_path_factory: Any
) -> None:
    folder = scratch(first, tmp_path_factory)
    content = damaged(data, description(first.folder))
    (folder / "capture.json").write_text(json.dumps(content), encoding="utf-8")
    outcome = geoderm("capture-info", folder, "--json")
    if outcome.code == 0:
        assert outcome.err == ""
        told = json.loads(outcome.out, parse_constant=lambda name: (_ for _ in ()).throw(ValueError(name)))
        assert set(told) == {"joints", "frames", "body_coverage", "depth_noise_m", "warnings"}
    else:
        assert_told(outcome, outcome.code, folder if outcome.code == 2 else "")
        assert outcome.code in (2, 3)


@FUZZ
@given(data=st.data())
def test_a_damaged_list_of_lesions_is_answered_or_refused(
    data: st.DataObject, first: Shot, followup: Shot, tmp_path_factory: Any
) -> None:
    """The follow-up names a file that is not there: what passes the checks of the list stops at it."""
    folder = scratch(first, tmp_path_factory)
    (folder / "capture.json").write_text(json.dumps(description(first.folder)))
    names = first.visible()[:3]
    good: Json = {
        "lesions": [
            {"id": names[0], "pixel": first.pixel(names[0]).tolist()},
            {"id": names[1], "pixel": first.pixel(names[1]).tolist(), "capture": folder.name},
            {"id": names[2], "depth_pixel": [128, 90]},
        ]
    }
    lesions, out = folder.parent / "lesions.json", folder.parent / "result.json"
    lesions.write_text(json.dumps(damaged(data, good)))
    out.unlink(missing_ok=True)
    outcome = geoderm("relocate", folder, folder, "--lesions", lesions, "--out", out)
    if outcome.code == 0:
        assert outcome.err == ""
        asked = json.loads(lesions.read_text())["lesions"]
        told = json.loads(out.read_text(encoding="utf-8"))["lesions"]
        assert [lesion["id"] for lesion in told] == [str(lesion["id"]) for lesion in asked]
    else:
        assert_told(outcome, 2, lesions)
        assert not out.exists()
    assert sorted(p.name for p in folder.parent.iterdir()) == sorted(
        [folder.name, lesions.name, *([out.name] if outcome.code == 0 else [])]
    )


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_description_with_damaged_bytes_is_read_or_refused(
    data: st.DataObject, first: Shot, tmp_path_factory: Any
) -> None:
    folder = scratch(first, tmp_path_factory)
    content = bytearray((first.folder / "capture.json").read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at] = data.draw(st.integers(0, 255))
    (folder / "capture.json").write_bytes(content)
    outcome = geoderm("capture-info", folder, "--json")
    if outcome.code == 0:
        assert outcome.err == ""
    else:
        assert_told(outcome, outcome.code, folder if outcome.code == 2 else "")
        assert outcome.code in (2, 3)


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_images_with_damaged_bytes_are_read_or_refused(
    data: st.DataObject, first: Shot, tmp_path_factory: Any
) -> None:
    folder = scratch(first, tmp_path_factory)
    (folder / "capture.json").write_bytes((first.folder / "capture.json").read_bytes())
    name = data.draw(st.sampled_from(["color.png", "depth_001.png"]))
    content = bytearray((first.folder / name).read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.one_of(st.integers(0, 120), st.integers(0, len(content) - 1)))
        content[at] = data.draw(st.integers(0, 255))
    (folder / name).write_bytes(content)
    try:
        outcome = geoderm("capture-info", folder, "--json")
        if outcome.code == 0:
            assert outcome.err == ""
        else:
            assert_told(outcome, outcome.code, folder / name if outcome.code == 2 else "")
            assert outcome.code in (2, 3)
    finally:
        (folder / name).write_bytes((first.folder / name).read_bytes())
