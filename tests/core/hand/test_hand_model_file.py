"""Model files of hands: the same numbers come back, and a file from anywhere can do no harm."""

from __future__ import annotations

import copy
import json
import pickle
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.errors import InputError
from core.hand.hand_model import HandModel
from core.hand.model import OWN_FIELDS, POINTS, ConfigurationModel
from core.hand.model_file import read_model, write_model
from core.hand.names import PAIRS
from core.hand.tree import ConfigurationTree, learn_tree

FIELDS = 4 + OWN_FIELDS
LENGTH = POINTS * FIELDS + len(PAIRS)
TREE_ARRAYS = ("left", "right", "feature", "threshold_m", "missing_left", "share", "frames")


def configuration(name: str, seed: int) -> ConfigurationModel:
    rng = np.random.default_rng(seed)
    mean, sigma = rng.uniform(0.0, 0.2, LENGTH), rng.uniform(0.001, 0.01, LENGTH)
    modes = rng.normal(0.0, 0.01, (3, LENGTH))
    never = [5, LENGTH - 1]
    mean[never], sigma[never], modes[:, never] = np.nan, np.nan, 0.0
    return ConfigurationModel(name, FIELDS, mean, sigma, modes, rng.uniform(0.0, 1.0, POINTS), 7)


def grown_tree() -> ConfigurationTree:
    """Of two configurations, one of which hides a pair that the other shows."""
    rng = np.random.default_rng(0)
    pairs = rng.uniform(0.05, 0.1, (40, len(PAIRS)))
    pairs[:20, 7] += 0.05
    pairs[::3, 7] = np.nan
    return learn_tree(pairs, ["open"] * 20 + ["fist"] * 20)


@lru_cache(maxsize=1)
def model() -> HandModel:
    return HandModel({"open": configuration("open", 1), "fist": configuration("fist", 2)}, grown_tree())


@lru_cache(maxsize=1)
def _text() -> str:
    with tempfile.TemporaryDirectory() as folder:
        write_model(Path(folder) / "model.json", model())
        return (Path(folder) / "model.json").read_text(encoding="utf-8")


def document() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(_text())
    return content


def test_a_model_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    write_model(tmp_path / "model.json", model())
    read = read_model(tmp_path / "model.json")
    assert (read.anchors, read.marker_m, read.dictionary) == ("marker", 0.036, "DICT_4X4_50")
    assert list(read.configurations) == ["open", "fist"]
    for name, written in model().configurations.items():
        other = read.configurations[name]
        assert (other.name, other.fields, other.frames) == (written.name, written.fields, written.frames)
        for array in ("mean_m", "sigma_m", "modes_m", "seen"):
            np.testing.assert_array_equal(getattr(other, array), getattr(written, array))


def test_the_tree_that_is_read_back_is_the_same(tmp_path: Path) -> None:
    write_model(tmp_path / "model.json", model())
    read, written = read_model(tmp_path / "model.json").tree, model().tree
    assert read is not None
    assert written is not None
    assert read.classes == written.classes
    for array in TREE_ARRAYS:
        np.testing.assert_array_equal(getattr(read, array), getattr(written, array))


def test_a_question_whether_a_pair_was_measured_survives(tmp_path: Path) -> None:
    pairs = np.full((20, len(PAIRS)), 0.1)
    pairs[10:, 3] = np.nan
    tree = learn_tree(pairs, ["open"] * 10 + ["fist"] * 10)
    write_model(tmp_path / "model.json", HandModel(model().configurations, tree))
    read = read_model(tmp_path / "model.json").tree
    assert read is not None
    assert [read.classes[int(np.argmax(read.likelihood(row)))] for row in pairs[[0, 19]]] == ["open", "fist"]


def test_a_single_configuration_needs_no_tree(tmp_path: Path) -> None:
    alone = HandModel({"open": configuration("open", 1)}, None, "marker", 0.05, "DICT_5X5_100")
    write_model(tmp_path / "model.json", alone)
    read = read_model(tmp_path / "model.json")
    assert read.tree is None
    assert (read.marker_m, read.dictionary) == (0.05, "DICT_5X5_100")


def test_writing_replaces_the_file_whole_and_leaves_nothing_else(tmp_path: Path) -> None:
    for _ in range(2):
        write_model(tmp_path / "model.json", model())
    assert [p.name for p in tmp_path.iterdir()] == ["model.json"]
    assert (tmp_path / "model.json").stat().st_mode & 0o777 == 0o644


def put(*path: str | int, value: object) -> Callable[[dict[str, Any]], None]:
    def change(content: dict[str, Any]) -> None:
        inner: Any = content
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = value

    return change


def circle(content: dict[str, Any]) -> None:
    """A child that is its own grandparent: walking such a tree would never end."""
    content["tree"]["left"][0] = 0


def shared_child(content: dict[str, Any]) -> None:
    content["tree"]["right"][0] = content["tree"]["left"][0]


def orphan(content: dict[str, Any]) -> None:
    for name in ("left", "right", "feature"):
        content["tree"][name].append(-1)
    content["tree"]["threshold_m"].append(None)
    content["tree"]["missing_left"].append(False)
    content["tree"]["share"].append([1.0, 0.0])
    content["tree"]["frames"].append(1)


def no_anchor_distance(content: dict[str, Any]) -> None:
    for name in ("mean_m", "sigma_m"):
        content["configurations"][0][name] = [None] * LENGTH


FIRST = ("configurations", 0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (circle, "tree"),
        (shared_child, "tree"),
        (orphan, "tree"),
        (no_anchor_distance, "mean_m"),
        (put("tree", "left", 0, value=10_000), "tree"),
        (put("tree", "left", 0, value=-1), "tree"),
        (put("tree", "left", 0, value=10**30), "tree"),
        (put("tree", "feature", 0, value=105), "tree.feature.0"),
        (put("tree", "frames", value=[]), "tree"),
        (put("tree", "share", 0, 0, value=0.9), "share"),
        (put("tree", "classes", 0, value="other"), "classes"),
        (put("tree", value=None), "tree"),
        (put("format", value="geoderm-hand-model/9"), "format"),
        (put("anchors", value="elbow"), "anchors"),
        (put("anchors", value="palm"), "anchors"),  # there are four, a palm has five
        (put("marker_m", value=36), "0.036"),
        (put("marker_m", value=float("inf")), "marker_m"),
        (put("dictionary", value="DICT_9X9"), "DICT_9X9"),
        (put("points", 0, value="thumb_nail"), "points"),
        (put("configurations", value=[]), "configurations"),
        (put(*FIRST, "name", value="fist"), "twice"),
        (put(*FIRST, "name", value="fi\x1b[31mst"), "printable"),
        (put(*FIRST, "name", value="\u202etsif"), "printable"),
        (put(*FIRST, "name", value=" fist"), "blanks"),
        (put(*FIRST, "fields", value=5), "fields"),
        (put(*FIRST, "fields", value=2), "fields"),
        (put(*FIRST, "mean_m", 0, value=float("nan")), "mean_m.0"),
        (put(*FIRST, "mean_m", 0, value=85.0), "mean_m.0"),
        (put(*FIRST, "mean_m", 0, value=None), "mean_m"),
        (put(*FIRST, "sigma_m", 0, value=0.0), "sigma_m.0"),
        (put(*FIRST, "sigma_m", 0, value=-0.001), "sigma_m.0"),
        (put(*FIRST, "modes_m", value=[]), "modes_m"),
        (put(*FIRST, "modes_m", 0, value=[0.1]), "modes_m"),
        (put(*FIRST, "seen", value=[1.0]), "seen"),
        (put(*FIRST, "seen", 3, value=1.5), "seen.3"),
        (put(*FIRST, "frames", value="many"), "frames"),
    ],
)
def test_a_wrong_model_is_told_by_file_and_field(
    tmp_path: Path, change: Callable[[dict[str, Any]], None], words: str
) -> None:
    path = tmp_path / "model.json"
    content = document()
    change(content)
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(InputError) as told:
        read_model(path)
    assert str(path) in str(told.value)
    assert words in str(told.value)
    assert len(str(told.value)) < 400 + len(str(path))


class _Trap:
    """Unpickling it would make a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


def test_a_pickle_is_no_model_and_is_not_executed(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_bytes(pickle.dumps(_Trap(tmp_path / "sprung")))
    with pytest.raises(InputError, match=r"model\.json"):
        read_model(path)
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize("content", ["", "null", "[" * 200_000, '{"format": "geoderm-hand/1"}', "\x00\x01"])
def test_what_is_no_model_is_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "model.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"model\.json"):
        read_model(path)


def test_a_folder_or_nothing_is_no_model(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not a file"):
        read_model(tmp_path)
    with pytest.raises(InputError, match="does not exist"):
        read_model(tmp_path / "absent.json")


ANYTHING = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=6), st.just([]), st.just({})
)


@settings(max_examples=120, deadline=None)
@given(st.data())
def test_a_damaged_model_is_refused_or_still_decides(data: st.DataObject) -> None:
    content = copy.deepcopy(document())
    for _ in range(data.draw(st.integers(1, 3))):
        inner: Any = content
        while True:
            keys = list(inner) if isinstance(inner, dict) else list(range(len(inner)))
            key = data.draw(st.sampled_from(keys))
            if isinstance(inner[key], dict | list) and inner[key] and data.draw(st.booleans()):
                inner = inner[key]
                continue
            inner[key] = data.draw(ANYTHING)
            break
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.json"
        path.write_text(json.dumps(content), encoding="utf-8")
        try:
            read = read_model(path)
        except InputError as error:
            read, refusal = None, str(error)
        if read is None:
            assert str(path) in refusal
            return
    if read.tree is not None:
        assert np.isclose(read.tree.likelihood(np.full(len(PAIRS), 0.08)).sum(), 1.0, atol=1e-2)
    for one in read.configurations.values():
        anchor_m, pair_m = one.expected(np.zeros(len(one.modes_m)))
        assert (anchor_m.shape, pair_m.shape) == ((POINTS, one.fields), (len(PAIRS),))
