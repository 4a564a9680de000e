"""Labelling a hand by clicks, its dataset, its settings and its log, without any window."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from app.workflows.hand_dataset import HandDataset
from app.workflows.hand_export import write_answers
from app.workflows.hand_labelling import WAIT, Labelling
from app.workflows.hand_log import TrackLog, pair_name
from app.workflows.hand_rows import FolderRow, HandShot, open_row
from app.workflows.hand_settings import HandSettings, check_dictionary, read_count, read_millimetres
from app.workflows.hand_skin import OFF_THE_HAND, look_at
from core.capture import write_capture
from core.errors import InputError
from core.hand.answer import HandAnswer
from core.hand.dataset import read_labels
from core.hand.labels import FrameLabels
from core.hand.marker_anchors import MarkerAnchors
from core.hand.names import PAIRS, POINT_NAMES
from core.progress import no_progress
from devices.simulator.hands.shots import Holder, shoot


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, FrameLabels]:
    """Two captures of an open hand, and the truth of the first."""
    folder = tmp_path_factory.mktemp("hand")
    frames = [shoot(Holder(), "open", seed) for seed in (2, 4)]
    for k, frame in enumerate(frames):
        write_capture(frame.capture, folder / f"frame_{k + 1:04d}")
    return folder, FrameLabels("open", dict(frames[0].points_m), dict(frames[0].visible))


@pytest.fixture(scope="module")
def shot(recorded: tuple[Path, FrameLabels]) -> HandShot:
    return FolderRow(recorded[0]).read(0)


@pytest.fixture
def labelling(shot: HandShot) -> Labelling:
    lab = Labelling()
    lab.begin(shot)
    lab.set_skin(look_at(shot, MarkerAnchors(0.036)))
    return lab


def pixel(shot: HandShot, truth: FrameLabels, name: str) -> tuple[float, float]:
    u, v = shot.rig.project_to_picture(truth.points_m[name][None])[0]
    return float(u), float(v)


def test_a_click_goes_through_the_picture_onto_the_skin(
    labelling: Labelling, shot: HandShot, recorded: tuple[Path, FrameLabels]
) -> None:
    truth = recorded[1]
    for name in POINT_NAMES:
        labelling.select(name)
        if truth.visible[name]:
            labelling.place(*pixel(shot, truth, name))
    off_mm = [1000 * np.linalg.norm(p - truth.points_m[n]) for n, p in labelling.places_m.items()]
    assert len(off_mm) >= sum(truth.visible.values()) - 1
    assert np.median(off_mm) < 2.0
    assert max(off_mm) < 12.0
    again = labelling.pixels()
    assert all(np.hypot(*(np.array(again[n]) - pixel(shot, truth, n))) < 6 for n in again)


def test_points_come_one_after_the_other_and_every_step_can_be_taken_back(
    labelling: Labelling, shot: HandShot, recorded: tuple[Path, FrameLabels]
) -> None:
    truth, told = recorded[1], []
    labelling.changed.connect(lambda: told.append(labelling.current))
    assert labelling.current == "thumb_tip"
    assert labelling.place(3.0, 3.0) == OFF_THE_HAND
    assert (labelling.current, labelling.places_m, labelling.can_undo) == ("thumb_tip", {}, False)
    labelling.skip()
    assert labelling.current == "thumb_ip"
    assert labelling.place(*pixel(shot, truth, "index_mcp")) == ""
    assert labelling.current == "thumb_mcp"
    assert told[-1] == "thumb_mcp"
    assert labelling.move("thumb_ip", 3.0, 3.0) == OFF_THE_HAND
    assert labelling.move("thumb_ip", *pixel(shot, truth, "middle_mcp")) == ""
    assert np.linalg.norm(labelling.places_m["thumb_ip"] - truth.points_m["middle_mcp"]) < 0.006
    labelling.clear()
    assert labelling.current == "thumb_tip"
    for _ in range(2):
        labelling.undo()
    assert np.linalg.norm(labelling.places_m["thumb_ip"] - truth.points_m["index_mcp"]) < 0.006
    for _ in range(2):
        labelling.undo()
    assert (labelling.hidden, labelling.places_m) == (frozenset(), {})
    assert not labelling.unsaved


def test_no_click_before_the_skin_is_known_or_where_there_is_none(shot: HandShot) -> None:
    lab = Labelling()
    assert lab.place(300, 200) == "There is no frame to label."
    lab.begin(shot)
    assert lab.place(300, 200) == WAIT
    lab.set_skin(look_at(shot, MarkerAnchors(0.036, "DICT_6X6_50")))
    assert "DICT_4X4_50" in lab.place(300, 200)


def test_what_a_model_proposes_is_kept_apart_until_a_person_touches_it(
    labelling: Labelling, shot: HandShot, recorded: tuple[Path, FrameLabels]
) -> None:
    truth = recorded[1]
    labelling.place(*pixel(shot, truth, "middle_mcp"))
    mine = labelling.places_m["thumb_tip"]
    points = truth.array(only_visible=False)
    points[3] = np.nan
    assert labelling.propose(HandAnswer("open", points)) == 13, "neither mine nor the one it does not know"
    assert labelling.places_m["thumb_tip"] is mine
    assert labelling.current == "index_tip"
    labelling.move("ring_mcp", *pixel(shot, truth, "ring_mcp"))
    assert "ring_mcp" not in labelling.proposed
    assert len(labelling.proposed) == 12


def test_labels_are_stored_beside_the_frame_and_found_again(
    labelling: Labelling, shot: HandShot, recorded: tuple[Path, FrameLabels], tmp_path: Path
) -> None:
    dataset = HandDataset(recorded[0])
    with pytest.raises(InputError, match="No point is placed"):
        dataset.store(shot, labelling.labels("open"))
    labelling.place(*pixel(shot, recorded[1], "middle_mcp"))
    with pytest.raises(InputError, match="name of a configuration is empty"):
        dataset.store(shot, labelling.labels("  "))
    assert dataset.store(shot, labelling.labels("open")).name == "frame_0001"
    assert dataset.counts() == {"open": 1}
    again = Labelling()
    again.begin(shot, read_labels(recorded[0] / "frame_0001"))
    assert list(again.places_m) == ["thumb_tip"]
    assert (len(again.hidden), again.current, again.unsaved) == (14, None, False)

    live = HandShot(77, "frame_0077", 1.0, shot.depth, shot.depth_unit_m, shot.rgb, shot.rig)
    elsewhere = HandDataset(tmp_path / "new")
    (tmp_path / "new").mkdir()
    assert elsewhere.store(live, labelling.labels("fist")).name == "frame_0001"
    assert elsewhere.store(live, labelling.labels("open")).name == "frame_0002"
    assert elsewhere.counts() == {"fist": 1, "open": 1}
    assert np.array_equal(FolderRow(tmp_path / "new").read(0).depth, shot.depth)
    with pytest.raises(InputError, match="at least 3 frames"):
        elsewhere.learn(HandSettings(), no_progress)


def test_a_folder_is_read_in_any_order_with_the_times_it_was_recorded_at(
    recorded: tuple[Path, FrameLabels], tmp_path: Path
) -> None:
    row = open_row(recorded[0])
    assert (row.count, row.time_s(1)) == (2, pytest.approx(1 / 30))
    assert [row.read(k).name for k in (1, 0)] == ["frame_0002", "frame_0001"]
    timed = tmp_path / "timed"
    timed.mkdir()
    for name in ("frame_0001", "frame_0002"):
        (timed / name).symlink_to(recorded[0] / name)
    entries = [{"folder": f"frame_000{k}", "times_s": [10.0 + k]} for k in (1, 2)]
    (timed / "sequence.json").write_text(json.dumps({"captures": entries}))
    assert FolderRow(timed).time_s(1) == pytest.approx(1.0)
    (timed / "sequence.json").write_text("[]")
    with pytest.raises(InputError, match=r"sequence\.json"):
        FolderRow(timed)
    with pytest.raises(InputError):
        open_row(tmp_path / "nothing")


def test_the_log_keeps_the_last_answer_of_every_frame(shot: HandShot, tmp_path: Path) -> None:
    log = TrackLog(most=2)
    for number in (1, 2, 3, 3):
        taken = HandShot(number, f"f{number}", 0.1 * number, shot.depth, 0.001, None, shot.rig)
        log.add(taken, HandAnswer("open", pair_m=np.full(len(PAIRS), 0.01 * number)))
    assert [frame.number for frame in log.frames()] == [2, 3], "a live log forgets what is old"
    series = log.series(0)
    assert np.allclose(series.measured_m, [0.02, 0.03])
    assert np.isnan(series.expected_m).all()
    assert pair_name(0) == "thumb nail - thumb end"
    answers = [(frame.name, frame.answer) for frame in log.frames()]
    assert write_answers(tmp_path / "tracks.csv", answers).frames == 2
    with pytest.raises(InputError, match=r"neither \.json nor \.csv"):
        write_answers(tmp_path / "tracks.xlsx", answers)
    with pytest.raises(InputError, match="Nothing was tracked"):
        write_answers(tmp_path / "tracks.json", [])


def test_what_is_typed_wrongly_is_refused_with_what_to_type() -> None:
    assert read_millimetres(" 36,5 mm", "The side of the marker", 0.008, 0.12) == pytest.approx(0.0365)
    for text, said in (("x", "not a number"), ("nan", "between 8 and 120 mm"), ("500", "ruler")):
        with pytest.raises(InputError) as refused:
            read_millimetres(text, "The side of the marker", 0.008, 0.12)
        assert said in str(refused.value)
    assert read_count("7", "The number", 300) == 7
    with pytest.raises(InputError, match="whole number"):
        read_count("1.5", "The number", 300)
    with pytest.raises(InputError, match="no ArUco dictionary"):
        check_dictionary("DICT_1X1")
