"""The picture of a decision tree: every question and every answer is in it, as PNG and as SVG."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from core.errors import InputError, WorkError
from core.evaluation.hand_tree_picture import question, tree_figure, write_tree_picture
from core.hand.names import PAIRS, POINT_NAMES
from core.hand.tree import ConfigurationTree, learn_tree


def grown(classes: int = 3) -> ConfigurationTree:
    """Configurations told apart by the distance between the nails of thumb and index finger."""
    asked = PAIRS.index((POINT_NAMES.index("thumb_tip"), POINT_NAMES.index("index_tip")))
    pairs = np.full((10 * classes, len(PAIRS)), 0.1)
    pairs[:, asked] = 0.02 + 0.04 * np.repeat(np.arange(classes), 10)
    return learn_tree(pairs, [f"pose{k:02d}" for k in np.repeat(np.arange(classes), 10)])


def chain(depth: int) -> ConfigurationTree:
    """A tree that says no again and again, as only a foreign file would have it."""
    inner = np.arange(2 * depth + 1) % 2 == 0
    inner[-1] = False
    number = np.arange(2 * depth + 1)
    return ConfigurationTree(
        ("A", "B"),
        np.where(inner, number + 1, -1),
        np.where(inner, number + 2, -1),
        np.where(inner, 0, -1),
        np.full(len(number), 0.05),
        np.zeros(len(number), bool),
        np.tile([0.5, 0.5], (len(number), 1)),
        np.full(len(number), 3),
    )


def texts(tree: ConfigurationTree) -> list[str]:
    return [text.get_text() for text in tree_figure(tree).axes[0].texts]


def test_a_question_names_both_points_and_the_distance() -> None:
    assert question(grown(2), 0) == "thumb_tip - index_tip\n≤ 40 mm?"


def test_questions_and_answers_are_drawn_with_the_frames_that_taught_them() -> None:
    drawn = texts(grown())
    assert sum("mm?" in text for text in drawn) == 2
    assert {"pose00\n10 frames", "pose01\n10 frames", "pose02\n10 frames"} <= set(drawn)
    assert drawn.count("yes") == drawn.count("no") == 2


def test_a_question_whether_a_pair_was_measured_is_asked_so() -> None:
    pairs = np.full((20, len(PAIRS)), 0.1)
    pairs[10:, 3] = np.nan
    assert any("measured?" in text for text in texts(learn_tree(pairs, ["A"] * 10 + ["B"] * 10)))


def test_nodes_do_not_overlap() -> None:
    places = [text.get_position() for text in tree_figure(grown(5)).axes[0].texts if "\n" in text.get_text()]
    assert len(set(places)) == len(places) == 9


def test_below_the_fifth_level_the_most_frequent_is_told() -> None:
    drawn = texts(chain(3000))
    assert len(drawn) < 60
    assert any(text.startswith("mostly ") for text in drawn)


def test_it_is_written_as_png_and_svg(tmp_path: Path) -> None:
    write_tree_picture(tmp_path / "tree.png", grown())
    write_tree_picture(tmp_path / "tree.svg", grown())
    with Image.open(tmp_path / "tree.png") as image:
        assert image.format == "PNG"
        assert len(set(image.convert("RGB").get_flattened_data())) > 3
    assert ElementTree.parse(tmp_path / "tree.svg").getroot().tag.endswith("svg")


def test_what_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.png or \.svg"):
        write_tree_picture(tmp_path / "tree.gif", grown())
    with pytest.raises(WorkError, match="cannot be written"):
        write_tree_picture(tmp_path / "absent" / "tree.png", grown())
    assert not list(tmp_path.iterdir())
