"""A calibration session: takes good views, refuses others with the reason, calibrates, keeps the profile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.workflows.calibrating import CalibrationSession, Outcome, start_streams
from app.workflows.calibration_check import CheckSession
from core.calibration.profile import CalibrationProfile, ProfileStore
from core.capture.transform import RigidTransform
from core.errors import WorkError
from devices.live import LiveFrame
from devices.simulator.board_device import BoardScene, SimulatedBoardCamera
from devices.simulator.boards import BoardRenderer, BoardRig, good_poses
from tests.core.calibration.boards_before import SPEC, usual_views

ALL = ("depth", "color", "infrared")


def frames_of(
    board_rig: BoardRig, poses: Sequence[RigidTransform], streams: Sequence[str] = ALL,
    each: int = 5, start: int = 0,
) -> list[LiveFrame]:  # fmt: skip
    """A board that is held still at one pose after the other, seen twelve times a second."""
    frames = []
    for pose in poses:
        seen = BoardRenderer(board_rig, SPEC, len(frames)).render(pose, streams)
        for _ in range(each):
            number = start + len(frames) + 1
            frames.append(
                LiveFrame(number, number / 12, seen.depth, 0.001, seen.rgb, number / 12, seen.infrared)
            )
    return frames


def with_views(seed: int = 0, count: int = 25) -> tuple[SimulatedBoardCamera, CalibrationSession]:
    """A session that has already collected well spread views."""
    camera = SimulatedBoardCamera(BoardScene(seed=seed))
    session = CalibrationSession(camera.identity, camera.spec)
    for view in usual_views(seed, count)[1]:
        session.add_view(view)
    return camera, session


def test_a_board_that_is_held_still_becomes_a_view_and_only_one() -> None:
    camera, _ = with_views(count=1)
    rig = camera.truth
    poses = good_poses(rig, SPEC, 3, 0, (0.6, 0.9))
    session = CalibrationSession(camera.identity, SPEC)
    steps = [session.add_frame(f) for f in frames_of(rig, [poses[0], poses[1], poses[0]])]
    assert [s.outcome for s in steps].count(Outcome.ADDED) == 2 == len(session.views)
    assert steps[0].message == "Hold the board still."
    assert steps[2].outcome is Outcome.HOLD
    added = next(s for s in steps if s.outcome is Outcome.ADDED)
    assert added.infrared is not None
    assert len(added.infrared) > 20
    assert all("like this already" in s.message for s in steps[11:])
    assert all(v.infrared is not None and v.color is not None and v.depth is not None for v in session.views)
    assert 0 < session.coverage.share < 0.8
    assert not session.ready()
    assert session.missing()


def test_a_moving_board_is_never_taken() -> None:
    camera, _ = with_views(count=1)
    pose = good_poses(camera.truth, SPEC, 1, 0, (0.6, 0.9))[0]
    shifted = [
        RigidTransform(pose.rotation, pose.translation + np.array([0.004 * k, 0, 0])) for k in range(6)
    ]
    session = CalibrationSession(camera.identity, SPEC)
    steps = [session.add_frame(f) for f in frames_of(camera.truth, shifted, each=1)]
    assert {s.message for s in steps} == {"Hold the board still."}


def test_what_only_one_camera_sees_is_refused_with_advice() -> None:
    camera, _ = with_views(count=1)
    (frame,) = frames_of(camera.truth, good_poses(camera.truth, SPEC, 1, 0, (0.6, 0.9)), each=1)
    session = CalibrationSession(camera.identity, SPEC)
    step = session.add_frame(replace(frame, infrared=np.full((480, 640), 90, np.uint8)))
    assert step.outcome is Outcome.REFUSED
    assert "Only the colour camera" in step.message


@pytest.mark.parametrize("moved", [False, True])
def test_a_camera_that_streams_one_or_the_other_is_asked_in_turn(moved: bool) -> None:
    camera, _ = with_views(count=1)
    rig, identity = camera.truth, camera.identity
    poses = good_poses(rig, SPEC, 2, 0, (0.6, 0.9))
    session = CalibrationSession(identity, SPEC, together=False)
    assert session.streams == {"depth", "color"}
    for frame in frames_of(rig, poses[:1], ("depth", "color")):
        step = session.add_frame(frame)
    assert session.streams == {"depth", "infrared"}
    assert "changes to infrared" in step.message
    for frame in frames_of(rig, poses[:1], ("depth", "infrared"), each=2, start=10):
        step = session.add_frame(frame)
    assert session.streams == {"depth", "color"}
    assert "back to colour" in step.message
    then = (
        RigidTransform(poses[0].rotation, poses[0].translation + np.array([0.004, 0, 0]))
        if moved
        else poses[0]
    )
    step = session.add_frame(frames_of(rig, [then], ("depth", "color"), each=1, start=20)[0])
    assert step.outcome is (Outcome.REFUSED if moved else Outcome.ADDED)
    assert len(session.views) == (0 if moved else 1)
    if not moved:
        assert session.views[0].infrared is not None
        assert session.views[0].color is not None
        assert session.views[0].depth is not None


def test_a_board_that_is_taken_away_while_the_streams_change_is_given_up() -> None:
    camera, _ = with_views(count=1)
    poses = good_poses(camera.truth, SPEC, 1, 0, (0.6, 0.9))
    session = CalibrationSession(camera.identity, SPEC, together=False)
    for frame in frames_of(camera.truth, poses, ("depth", "color")):
        session.add_frame(frame)
    grey = np.full((480, 640), 90, np.uint8)
    assert session.add_frame(LiveFrame(50, 2.0, None, infrared=grey)).outcome is Outcome.HOLD
    step = session.add_frame(LiveFrame(200, 20.0, None, infrared=grey))
    assert step.outcome is Outcome.REFUSED
    assert session.streams == {"depth", "color"}


def test_a_camera_tells_whether_its_streams_run_together() -> None:
    for exclusive in (False, True):
        with SimulatedBoardCamera(BoardScene(free=True, exclusive=exclusive)) as camera:
            assert start_streams(camera) is not exclusive


def test_nothing_is_seen_in_an_empty_room() -> None:
    camera, _ = with_views(count=1)
    session = CalibrationSession(camera.identity, camera.spec)
    grey = np.full((480, 640), 90, np.uint8)
    step = session.add_frame(LiveFrame(1, 0.0, None, rgb=np.dstack([grey] * 3), infrared=grey))
    assert step.outcome is Outcome.NOTHING


def test_good_views_become_a_saved_profile_that_the_camera_uses(tmp_path: Path) -> None:
    camera, session = with_views(3)
    assert session.ready()
    told: list[float] = []
    result = session.solve(lambda fraction, message="": told.append(fraction))
    assert told[0] == 0.0
    assert told[-1] == 1.0
    assert result.verdict.grade == "good", result.verdict.reasons
    assert len(result.views) == 25
    kept = session.save(ProfileStore(tmp_path), result)
    assert kept.version == 1
    assert kept.fits(camera.identity.depth_serial, camera.identity.color_serial)
    assert set(kept.sigma) >= {"depth.fx", "color.cy", "rotation_deg", "translation_x_m", "depth_scale"}
    camera.use_profile(kept)
    assert camera.rig.depth == kept.rig.depth


def test_a_weak_set_is_refused_and_not_saved(tmp_path: Path) -> None:
    _, session = with_views(3, 6)
    assert session.can_solve()
    assert not session.ready()
    result = session.solve()
    assert result.verdict.grade == "refused"
    assert any("views" in text for text in result.verdict.missing)
    with pytest.raises(WorkError, match="not good enough") as caught:
        session.save(ProfileStore(tmp_path), result)
    assert caught.value.advice
    assert not list(tmp_path.iterdir())


def test_a_view_can_be_taken_out_again() -> None:
    _, session = with_views(3, 8)
    before = session.coverage.share
    session.remove(0)
    assert len(session.views) == 7
    assert session.coverage.share <= before
    assert set(session.live_rms_px) == {"depth", "color"}


@pytest.mark.parametrize(
    ("knock", "verdict"), [({}, "ok"), ({"moved_deg": 0.8}, "moved"), ({"moved_mm": 8.0}, "moved")]
)
def test_the_daily_check_of_a_live_rig(knock: dict[str, float], verdict: str) -> None:
    camera = SimulatedBoardCamera(BoardScene(seed=7, **knock))
    still = SimulatedBoardCamera(BoardScene(seed=7)).truth
    who = camera.identity
    profile = CalibrationProfile(still.rig, who.depth_serial, who.color_serial, still.depth_error)
    check = CheckSession(profile, who, SPEC)
    for frame in frames_of(camera.truth, good_poses(still, SPEC, 3, 7, (0.6, 0.9)), each=6):
        check.add_frame(frame)
    assert check.views == 3
    assert not check.done()
    assert check.result().verdict == verdict, check.result().message
