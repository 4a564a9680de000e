"""`geoderm calibrate`: the board, a calibration from a folder of views, the check, the list of profiles."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from app.cli.main import main
from core.calibration.board import BoardSpec
from core.calibration.view_folder import ViewFolderInfo, ViewFolderWriter
from devices.simulator.boards import BoardRenderer, good_poses, random_board_rig

SPEC = BoardSpec.for_paper("A3")
RIG = random_board_rig(0)


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("calibration") / "views"
    writer = ViewFolderWriter(folder, ViewFolderInfo("D-1", "C-1", "Kinect", "kinect-v1", SPEC))
    renderer = BoardRenderer(RIG, SPEC, 0)
    for pose in good_poses(RIG, SPEC, 22, 0, (0.55, 1.0)):
        seen = renderer.render(pose)
        writer.add(seen.infrared, seen.rgb, seen.depth)
    return folder


@pytest.fixture(scope="module")
def calibrated(views: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Path]:
    profiles = tmp_path_factory.mktemp("profiles")
    return main(["calibrate", "run", str(views), "--profiles", str(profiles), "--json"]), profiles


def part(views: Path, out: Path, count: int) -> Path:
    """The first views of a folder."""
    shutil.copytree(views, out)
    document = json.loads((out / "views.json").read_text())
    document["views"] = document["views"][:count]
    (out / "views.json").write_text(json.dumps(document))
    return out


def test_the_board_is_written(tmp_path: Path, capfd) -> None:
    assert main(["calibrate", "board", str(tmp_path / "b.pdf"), "--paper", "A3"]) == 0
    assert (tmp_path / "b.pdf").read_bytes().startswith(b"%PDF")
    assert "100 %" in capfd.readouterr().out
    assert main(["calibrate", "board", str(tmp_path / "b.pdf"), "--paper", "A5"]) == 2
    assert main(["calibrate", "board", str(tmp_path / "no" / "b.pdf")]) == 2


def test_the_board_is_never_written_over_a_file(tmp_path: Path, capfd) -> None:
    mine = tmp_path / "mine.txt"
    mine.write_text("mine")
    (tmp_path / "dangling.pdf").symlink_to(tmp_path / "nowhere")
    for out in (mine, tmp_path, tmp_path / "dangling.pdf"):
        assert main(["calibrate", "board", str(out)]) == 2
        assert "exists already" in capfd.readouterr().err
    assert mine.read_text() == "mine"
    assert not (tmp_path / "nowhere").exists()


def test_profiles_are_not_looked_for_in_what_is_no_folder(tmp_path: Path, capfd) -> None:
    (tmp_path / "file").write_text("")
    for command in (["list"], ["show", "abc"], ["check", str(tmp_path)], ["run", str(tmp_path)]):
        assert main(["calibrate", *command, "--profiles", str(tmp_path / "file")]) == 2
        assert "file: there is no such folder" in capfd.readouterr().err
    assert main(["calibrate", "list", "--profiles", str(tmp_path / "nowhere")]) == 2


def test_a_folder_of_views_becomes_a_profile(calibrated, capfd) -> None:
    code, profiles = calibrated
    assert code == 0
    assert main(["calibrate", "list", "--profiles", str(profiles), "--json"]) == 0
    listed = json.loads(capfd.readouterr().out)
    (row,) = listed["profiles"]
    assert row["in_force"]
    assert (row["depth_serial"], row["color_serial"]) == ("D-1", "C-1")
    assert main(["calibrate", "show", row["id"][:6], "--profiles", str(profiles), "--json"]) == 0
    shown = json.loads(capfd.readouterr().out)
    assert shown["depth"]["fx"] == pytest.approx(RIG.rig.depth.fx, rel=0.001)
    assert np.array(shown["color_from_depth"])[:3, 3] == pytest.approx(
        RIG.rig.picture_from_depth.translation, abs=0.001
    )
    assert shown["depth_correction"]["scale"] == pytest.approx(RIG.depth_error.scale, abs=0.002)
    assert main(["calibrate", "show", row["id"], "--profiles", str(profiles)]) == 0
    assert "+-" in capfd.readouterr().out


def test_a_weak_set_exits_with_3_and_says_what_is_missing(views: Path, tmp_path: Path, capfd) -> None:
    weak = part(views, tmp_path / "weak", 6)
    profiles = tmp_path / "profiles"
    assert main(["calibrate", "run", str(weak), "--profiles", str(profiles), "--json"]) == 3
    said = capfd.readouterr()
    told = json.loads(said.out)
    assert told["verdict"] == "refused"
    assert not told["saved"]
    assert told["missing"]
    assert "not good enough" in said.err
    assert said.err.count("\n") == 1
    assert not profiles.exists()
    assert main(["calibrate", "run", str(part(views, tmp_path / "two", 2)), "--profiles", str(profiles)]) == 3
    assert "At least 4" in capfd.readouterr().err


def test_the_check_knows_the_rig_and_a_moved_one(views: Path, calibrated, tmp_path: Path, capfd) -> None:
    _, profiles = calibrated
    same = part(views, tmp_path / "same", 4)
    assert main(["calibrate", "check", str(same), "--profiles", str(profiles)]) == 0
    assert capfd.readouterr().out.startswith("ok:")
    document = json.loads((same / "views.json").read_text())
    document["board"]["square_m"], document["board"]["marker_m"] = 0.044, 0.033
    (same / "views.json").write_text(json.dumps(document))
    assert main(["calibrate", "check", str(same), "--profiles", str(profiles), "--json"]) == 3
    assert json.loads(capfd.readouterr().out)["verdict"] != "ok"


def test_cameras_without_a_profile_cannot_be_checked(views: Path, tmp_path: Path, capfd) -> None:
    assert main(["calibrate", "check", str(views), "--profiles", str(tmp_path)]) == 3
    assert "no calibration profile" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda d: d.update(format="other"), "format"),
        (lambda d: d.pop("board"), "board"),
        (lambda d: d["board"].update(square_m=9.0), "board"),
        (lambda d: d.update(depth_unit_m=5), "depth_unit_m"),
        (lambda d: d["views"][0].update(color="../color_000.png"), "views.0.color"),
        (lambda d: d["views"][0].update(depth="color_000.png"), "views.0.depth"),
        (lambda d: d["views"][0].update(infrared="views.json.png"), "views.0.infrared"),
    ],
)
def test_a_folder_that_cannot_be_used_is_refused_with_its_field(
    views: Path, tmp_path: Path, capfd, change, field
) -> None:
    folder = part(views, tmp_path / "bad", 1)
    document = json.loads((folder / "views.json").read_text())
    change(document)
    (folder / "views.json").write_text(json.dumps(document))
    assert main(["calibrate", "run", str(folder), "--profiles", str(tmp_path / "p")]) == 2
    said = capfd.readouterr().err
    assert field in said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "nowhere"],
        ["run", "simulator-board:other"],
        ["run", "folder:/"],
        ["show", "abc"],
        ["check", "unknown:kind"],
        ["run", "simulator-board:kinect", "--views", "2"],
    ],
)
def test_wrong_use_is_told_in_one_line(arguments: list[str], tmp_path: Path, capfd) -> None:
    assert main(["calibrate", *arguments, "--profiles", str(tmp_path)]) == 2
    assert "Traceback" not in capfd.readouterr().err


def test_an_empty_list_says_so(tmp_path: Path, capfd) -> None:
    assert main(["calibrate", "list", "--profiles", str(tmp_path)]) == 0
    assert "no calibration profile" in capfd.readouterr().out
