"""``geoderm hand train``: a model from labelled captures; what cannot teach is said."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from PIL import Image

from core.hand.dataset import LABELS_FILE
from core.hand.model_file import read_model
from tests.app.cli.cases import assert_told, copy_of, geoderm, without_color
from tests.core.hand.training_frames import CONFIGURATIONS, FRAMES, write_dataset


@pytest.fixture(scope="session")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("hand") / "dataset")


def part_of(dataset: Path, target: Path, *names: str) -> Path:
    """A dataset of some of the captures, to be damaged."""
    for name in names:
        copy_of(dataset / name, target / name)
    return target


def edit_labels(folder: Path, **fields: object) -> None:
    path = folder / LABELS_FILE
    path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), **fields}), encoding="utf-8")


def test_a_model_is_written_and_the_lesson_told(dataset: Path, tmp_path: Path) -> None:
    out, picture = tmp_path / "model.json", tmp_path / "tree.png"
    outcome = geoderm("hand", "train", dataset, "--out", out, "--tree-picture", picture)
    assert (outcome.code, outcome.err) == (0, "")
    assert set(read_model(out).configurations) == set(CONFIGURATIONS)
    for name in CONFIGURATIONS:
        assert f"{name}" in outcome.out
    assert "frames judged rightly" in outcome.out
    assert "note: Few frames" in outcome.out
    with Image.open(picture) as image:
        assert min(image.size) > 100


def test_json_tells_the_lesson_field_by_field(dataset: Path, tmp_path: Path) -> None:
    out, picture = tmp_path / "model.json", tmp_path / "tree.svg"
    outcome = geoderm("hand", "train", dataset, "--out", out, "--tree-picture", picture, "--json")
    assert outcome.code == 0
    told: dict[str, Any] = json.loads(outcome.out)
    assert told["configurations"] == [{"name": name, "frames": FRAMES} for name in CONFIGURATIONS]
    assert told["confusion"]["classes"] == list(CONFIGURATIONS)
    assert told["confusion"]["said"] == [*CONFIGURATIONS, "unknown"]
    assert all(len(row) == len(CONFIGURATIONS) + 1 for row in told["confusion"]["counts"])
    assert sum(map(sum, told["confusion"]["counts"])) == 2 * FRAMES
    assert 0.0 <= told["accuracy"] <= 1.0
    assert (told["anchors"], told["marker_m"], told["dictionary"]) == ("marker", 0.036, "DICT_4X4_50")
    assert ElementTree.parse(picture).getroot().tag.endswith("svg")


def test_captures_without_labels_or_colour_are_told(dataset: Path, tmp_path: Path) -> None:
    copy = part_of(dataset, tmp_path / "d", *(f"frame_{2 * k:03d}" for k in range(FRAMES)), "frame_001")
    without_color(copy / "frame_000")
    (copy / "frame_001" / LABELS_FILE).unlink()
    outcome = geoderm("hand", "train", copy, "--out", tmp_path / "model.json", "--json")
    told = json.loads(outcome.out)
    assert outcome.code == 0
    assert told["unlabelled"] == 1
    assert [one["capture"] for one in told["left_out"]] == ["frame_000"]
    assert "no colour" in told["left_out"][0]["reason"]
    assert told["confusion"] is None


def test_one_training_frame_is_too_few(dataset: Path, tmp_path: Path) -> None:
    copy = part_of(dataset, tmp_path / "d", "frame_000")
    outcome = geoderm("hand", "train", copy, "--out", tmp_path / "model.json")
    assert_told(outcome, 2, copy, "One frame shows no spread")
    assert not (tmp_path / "model.json").exists()


def test_captures_without_any_labels_are_refused(dataset: Path, tmp_path: Path) -> None:
    copy = part_of(dataset, tmp_path / "d", "frame_000")
    (copy / "frame_000" / LABELS_FILE).unlink()
    assert_told(geoderm("hand", "train", copy, "--out", tmp_path / "model.json"), 2, copy, LABELS_FILE)


def test_damaged_labels_are_told_by_file_and_field(dataset: Path, tmp_path: Path) -> None:
    copy = part_of(dataset, tmp_path / "d", "frame_000")
    edit_labels(copy / "frame_000", points={"index_tip": {"point_m": [1, 2]}})
    outcome = geoderm("hand", "train", copy, "--out", tmp_path / "model.json")
    assert_told(outcome, 2, copy / "frame_000" / LABELS_FILE, "points.index_tip.point_m")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--marker-m", "36"), "0.036"),
        (("--marker-m", "nan"), "marker"),
        (("--dictionary", "DICT_9X9_50"), "DICT_9X9_50"),
        (("--dictionary", "DICT_5X5_50"), "DICT_4X4_50"),
        (("--marker-m", "0.072"), "36 mm"),
        (("--anchors", "elbow"), "elbow"),
        (("--tree-picture", "tree.gif"), ".png or .svg"),
        (("--tree-picture", "absent/tree.png"), "folder does not exist"),
    ],
)
def test_wrong_options_are_told(dataset: Path, tmp_path: Path, options: tuple[str, ...], words: str) -> None:
    copy = part_of(dataset, tmp_path / "d", "frame_000", "frame_002")
    outcome = geoderm("hand", "train", copy, "--out", tmp_path / "model.json", *options)
    assert_told(outcome, 2, words)


def test_paths_that_cannot_be_are_told(dataset: Path, tmp_path: Path) -> None:
    assert_told(geoderm("hand", "train", tmp_path / "absent", "--out", tmp_path / "m.json"), 2, "absent")
    assert_told(geoderm("hand", "train", dataset, "--out", tmp_path / "absent" / "m.json"), 2, "--out")
    assert_told(geoderm("hand", "train", dataset, "--out", tmp_path), 2, "is a folder")
    assert_told(geoderm("hand", "train", dataset), 2, "--out")


def test_help_loads_no_numbers() -> None:
    """The group's help is as quick as the others': no NumPy, no scikit-learn, no matplotlib."""
    script = (
        "import sys; from app.cli.main import main; code = main(['hand', '--help']); "
        "heavy = {'numpy', 'sklearn', 'matplotlib', 'cv2'} & set(sys.modules); "
        "print(sorted(heavy), file=sys.stderr); sys.exit(code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stderr.strip()) == (0, "[]")
    for command in ("train", "track"):
        assert command in done.stdout
