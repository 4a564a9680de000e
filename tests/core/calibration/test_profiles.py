"""A calibration profile survives the disk unchanged; what is damaged or hostile is refused by name."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.calibration.profile import CalibrationProfile, DepthCorrection, ProfileStore, read_profile
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.errors import GeodermError, InputError

DEPTH = PinholeCamera(640, 480, 575.1, 574.9, 318.2, 241.0, (-0.06, 0.1, 0.0, 0.0, 0.0))
COLOR = PinholeCamera(1280, 960, 1052.0, 1050.5, 640.2, 478.9)
RELATION = RigidTransform(np.eye(3), np.array([-0.0251, 0.0004, 0.0011]))


def profile(**changes: object) -> CalibrationProfile:
    made = CalibrationProfile(
        CameraRig(DEPTH, COLOR, RELATION),
        "A00363",
        "C-7/8",
        DepthCorrection(1.004, -0.0035),
        made_at=datetime(2026, 5, 4, 8, 15, tzinfo=UTC),
        sigma={"depth.fx": 0.08, "depth_scale": 0.0004},
        rms_px={"depth": 0.12, "color": 0.1, "stereo": 0.11},
        views=25,
        notes=("Far views are few.",),
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def test_a_stored_profile_is_read_back_unchanged(tmp_path: Path) -> None:
    kept = ProfileStore(tmp_path).add(profile())
    again = ProfileStore(tmp_path).newest("A00363", "C-7/8")
    assert again is not None
    assert again.document() == kept.document()
    assert again.rig.depth == DEPTH
    assert np.array_equal(again.rig.picture_from_depth.matrix, RELATION.matrix)


def test_versions_count_up_and_the_newest_is_in_force(tmp_path: Path) -> None:
    store = ProfileStore(tmp_path)
    versions = [store.add(profile(views=n)).version for n in (20, 21, 22)]
    newest = store.newest("A00363", "C-7/8")
    assert versions == [1, 2, 3]
    assert newest is not None
    assert newest.views == 22
    assert len(store.all()) == 3


def test_a_profile_is_for_one_pair_of_cameras_only(tmp_path: Path) -> None:
    store = ProfileStore(tmp_path)
    store.add(profile())
    assert store.newest("A00363", "another") is None
    assert store.newest("another", "C-7/8") is None
    other = store.add(profile(depth_serial="A0036", color_serial="3C-7/8"))
    assert other.version == 1, "serial numbers that run together are not mixed up"


def test_file_names_are_safe_whatever_the_serial_number_is(tmp_path: Path) -> None:
    store = ProfileStore(tmp_path / "in")
    for serial in ("../../etc", "a\\b:c*?", "ä ö", "." * 300, "\x00"):
        store.add(profile(depth_serial=serial))
    assert {p.parent for p in tmp_path.rglob("*.json")} == {tmp_path / "in"}
    assert len(store.all()) == 5


def test_a_damaged_file_is_named_and_hides_no_other(tmp_path: Path) -> None:
    store = ProfileStore(tmp_path)
    store.add(profile(views=20))
    store.add(profile(views=21))
    newest = sorted(tmp_path.glob("*.json"))[-1]
    newest.write_bytes(newest.read_bytes()[:100])
    in_force = store.newest("A00363", "C-7/8")
    assert store.damaged() == [newest]
    assert in_force is not None
    assert in_force.views == 20
    assert store.add(profile(views=22)).version == 3, "a damaged file is never written over"


def test_no_profile_is_half_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: Path, target: object) -> Path:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(GeodermError, match="No space left"):
        ProfileStore(tmp_path).add(profile())
    assert not list(tmp_path.iterdir())


def test_the_identifier_is_of_the_content() -> None:
    assert profile().id == profile().id
    assert profile().id != profile(views=24).id
    assert profile().id == CalibrationProfile.from_document(profile().document()).id


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda d: d.pop("depth"), "depth"),
        (lambda d: d.update(format="geoderm-calibration/9"), "format"),
        (lambda d: d["depth"].update(fx="wide"), "fx"),
        (lambda d: d["depth"].update(fx=-3.0), "focal lengths"),
        (lambda d: d["depth"].update(width=0), "width"),
        (lambda d: d["depth"].update(distortion=[0.1] * 7), "distortion"),
        (lambda d: d.update(color_from_depth=[[1, 0], [0, 1]]), "4x4"),
        (lambda d: d["color_from_depth"][0].__setitem__(0, 5.0), "rotation"),
        (lambda d: d.update(color_from_depth=None), "belong together"),
        (lambda d: d["depth_correction"].update(scale=40.0), "out of range"),
        (lambda d: d.update(version=-1), "version"),
        (lambda d: d.update(made_at="yesterday"), "made_at"),
        (lambda d: d.update(sigma={"depth.fx": "small"}), "sigma"),
        (lambda d: d.update(views=1e400), "views"),
    ],
)
def test_what_cannot_be_right_is_refused_with_its_field(tmp_path: Path, change: object, field: str) -> None:
    document = profile(version=1).document()
    change(document)  # type: ignore[operator]
    path = tmp_path / "p.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        read_profile(path)
    assert "p.json" in str(caught.value)
    assert field in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [b"", b"null", b"[]", b"\xff\xfe", b"{", b'{"format": NaN}', b"[" * 100_000, b"9" * 2_000_000],
    ids=["empty", "null", "list", "not text", "cut", "NaN", "deep", "huge"],
)
def test_foreign_files_are_refused(tmp_path: Path, text: bytes) -> None:
    path = tmp_path / "p.json"
    path.write_bytes(text)
    with pytest.raises(InputError, match=r"p\.json"):
        read_profile(path)


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=4),
    max_leaves=8,
)


def _paths(node: object, at: tuple[object, ...] = ()) -> list[tuple[object, ...]]:
    found = [at] if at else []
    if isinstance(node, dict):
        for key, value in node.items():
            found += _paths(value, (*at, key))
    elif isinstance(node, list):
        for key, value in enumerate(node):
            found += _paths(value, (*at, key))
    return found


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_a_mutated_profile_is_either_refused_or_usable(data: st.DataObject) -> None:
    document = copy.deepcopy(profile(version=1).document())
    place = data.draw(st.sampled_from(_paths(document)))
    node: object = document
    for key in place[:-1]:
        node = node[key]  # type: ignore[index]
    node[place[-1]] = data.draw(_JSON)  # type: ignore[index]
    try:
        read = CalibrationProfile.from_document(document)
    except InputError:
        return
    assert np.isfinite(read.rig.depth.matrix).all()
    assert CalibrationProfile.from_document(read.document()).id == read.id


@given(
    scale=st.floats(0.9, 1.1), offset_mm=st.floats(-40, 40), raw=st.lists(st.integers(0, 65535), min_size=1)
)
@settings(max_examples=60, deadline=None)
def test_depth_is_corrected_to_half_a_unit_and_no_measurement_stays_none(
    scale: float, offset_mm: float, raw: list[int]
) -> None:
    frames = np.array(raw, np.uint16)
    corrected = DepthCorrection(scale, offset_mm / 1000).apply(frames, 0.001)
    expected = np.clip(scale * frames.astype(float) + offset_mm, 1, 65535)
    assert (corrected[frames == 0] == 0).all()
    seen = frames > 0
    assert (np.abs(corrected[seen] - expected[seen]) <= 0.5 + 1e-6).all()
