"""``geoderm hand simulate`` writes folders that can be trained with, tracked and played."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from app.cli.main import main
from core.capture import read_capture
from core.hand.dataset import dataset_frames, read_labels
from core.hand.names import POINT_NAMES
from devices.recordings.sources import open_source


def simulate(*arguments: object) -> int:
    return main(["hand", "simulate", *map(str, arguments)])


def test_a_sequence_is_labelled_and_plays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "sequence"
    code = simulate(out, "--kind", "large-displacements", "--frames", 3, "--seed", 5, "--side", "L")
    assert code == 0
    assert "large-displacements, 3 frames, labelled" in capsys.readouterr().out
    frames = dataset_frames(out)
    assert [f.name for f in frames] == ["frame_0001", "frame_0002", "frame_0003"]
    labels = read_labels(frames[1])
    assert labels is not None
    assert labels.configuration == "open"
    assert set(labels.points_m) == set(POINT_NAMES)
    source = open_source(out)
    played = list(source.frames())
    assert [f.time_s for f in played] == pytest.approx([0.0, 1 / 30, 2 / 30])
    assert source.facts().sensor == "kinect-v1"
    again = tmp_path / "again"
    assert simulate(again, "--kind", "large-displacements", "--frames", 3, "--seed", 5, "--side", "L") == 0
    same = read_capture(again / "frame_0003").depth_frames, read_capture(out / "frame_0003").depth_frames
    assert np.array_equal(*same)


def test_training_frames_take_turns_and_may_be_without_labels(tmp_path: Path) -> None:
    out = tmp_path / "training"
    assert simulate(out, "--frames", 2, "--configurations", "fist, two", "--unlabelled") == 0
    assert not list(out.glob("*/hand.json"))
    labelled = tmp_path / "labelled"
    assert simulate(labelled, "--frames", 2, "--configurations", "fist, two") == 0
    names = [json.loads(p.read_text())["configuration"] for p in sorted(labelled.glob("*/hand.json"))]
    assert names == ["fist", "two"]


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "there").mkdir()
    assert simulate(tmp_path / "there", "--frames", 1) == 2
    assert "exists already" in capsys.readouterr().err
    assert not list((tmp_path / "there").iterdir())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--kind", "dance"), "dance"),
        (("--shape", "nobody"), "nobody"),
        (("--side", "X"), "R or L"),
        (("--configurations", "open,hug"), "hug"),
        (("--marker-m", "0.5"), "0.01 to 0.08"),
        (("--dictionary", "DICT_9"), "DICT_9"),
        (("--sensor", "lidar"), "lidar"),
        (("--frames", "0"), "frames"),
        (("--rate-hz", "0"), "rate-hz"),
    ],
)
def test_bad_input_is_named_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], words: str
) -> None:
    assert simulate(tmp_path / "out", *arguments) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert simulate(tmp_path / "none" / "out", "--frames", "1") == 2
    assert "cannot be made" in capsys.readouterr().err
