"""A hand followed from frame to frame: what is told, what is not, and why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from core.capture import RigidTransform
from core.capture.rgbd import CameraRig
from core.errors import InputError
from core.hand.anchors import AnchorKind, FoundAnchors
from core.hand.answer import HandAnswer
from core.hand.hand_model import HandModel
from core.hand.marker_anchors import MarkerAnchors
from core.hand.names import PAIRS
from core.hand.tracker import HandTracker, TrackingOptions
from tests.core.hand.conftest import Shot

FloatArray = NDArray[np.float64]
Shots = Mapping[tuple[str, str], Shot]

MARKER_M = 0.036
I, J = np.array(PAIRS).T  # noqa: E741

LOST_FRAMES = TrackingOptions().lost_frames


def tracker(model: HandModel, shot: Shot, **options: object) -> HandTracker:
    return HandTracker(
        model,
        shot.frame.capture.rig,
        MarkerAnchors(MARKER_M),
        TrackingOptions(**options),  # type: ignore[arg-type]
    )


def tell(follower: HandTracker, shot: Shot, *, marked: bool = True) -> HandAnswer:
    answer = follower.track(shot.depth_m, shot.rgb if marked else shot.unmarked)
    assert_consistent(answer, shot.frame.capture.rig)
    return answer


def off_mm(answer: HandAnswer, shot: Shot) -> FloatArray:
    """Errors of the told points that are in view."""
    off = 1000 * np.linalg.norm(answer.points_m - shot.truth_m, axis=1)
    return np.asarray(off[answer.found & shot.visible])


def assert_consistent(answer: HandAnswer, rig: CameraRig) -> None:
    """What every answer owes, whatever was before the camera."""
    found = answer.found
    np.testing.assert_array_equal(np.isfinite(answer.points_m).any(axis=1), found)
    np.testing.assert_allclose(answer.pixels, rig.project_to_picture(answer.points_m), atol=1e-9)
    np.testing.assert_array_equal(answer.confidence > 0, found)
    assert answer.confidence.max() <= 1.0
    both = found[I] & found[J]
    assert not np.isfinite(answer.pair_m[~both]).any()
    assert not np.isfinite(answer.expected_pair_m[~both]).any()
    np.testing.assert_array_equal(np.isfinite(answer.pair_m), np.isfinite(answer.expected_pair_m))
    apart = np.linalg.norm(answer.points_m[I] - answer.points_m[J], axis=1)
    measured = np.isfinite(answer.pair_m)
    # a place lies between vertices, within 8 mm of the one it is measured from
    assert (answer.pair_m[measured] > apart[measured] - 0.012).all()
    assert np.isfinite(answer.error_m[found]).all()
    assert all(0.0 <= share <= 1.0 for share in answer.likelihood.values())
    if answer.likelihood:
        assert sum(answer.likelihood.values()) == pytest.approx(1.0)
    if found.any():
        assert answer.surface is not None
        assert np.isfinite(answer.anchors_m).all(axis=1).any()
        assert set(answer.times_s) >= {"anchors", "surface", "distances"}
        assert min(answer.times_s.values()) >= 0.0
    else:
        assert answer.reason
    if answer.configuration is None:
        assert answer.reason


def assert_nothing(answer: HandAnswer) -> None:
    assert not answer.found.any()
    assert answer.configuration is None
    assert np.isnan(answer.pixels).all()
    assert answer.likelihood == {}
    assert answer.reason


# ------------------------------------------------------------------ one frame


def test_the_first_frame_of_a_hand_never_trained_on(hand_model: HandModel, shots: Shots) -> None:
    every, hidden, told = [], 0, 0
    for (name, shape), shot in shots.items():
        answer = tell(tracker(hand_model, shot), shot)
        assert answer.configuration == name, shape
        assert answer.marker_seen
        assert answer.reason is None
        assert set(answer.likelihood) == set(hand_model.configurations)
        assert answer.found[shot.visible].mean() >= 0.75, (name, shape)
        every.append(off_mm(answer, shot))
        hidden += int((~shot.visible).sum())
        told += int((answer.found & ~shot.visible).sum())
        corners = shot.frame.corners_m[0]
        assert np.linalg.norm(answer.anchors_m - corners, axis=1).max() < 0.004
    off = np.concatenate(every)
    assert np.median(off) < 5.5
    assert np.percentile(off, 90) < 10.0
    assert told < 0.2 * hidden


def test_told_points_lie_on_the_skin(hand_model: HandModel, shots: Shots) -> None:
    shot = shots["open", "f_27_avg"]
    answer = tell(tracker(hand_model, shot), shot)
    assert answer.surface is not None
    told = answer.points_m[answer.found]
    on_skin = answer.surface.surface.nearest_arrays(told)[2]
    assert np.linalg.norm(told - on_skin, axis=1).max() < 0.003


def without_open(model: HandModel) -> HandModel:
    """As if the open hand had not been learned."""
    kept = {name: of for name, of in model.configurations.items() if name != "open"}
    return replace(model, configurations=kept, tree=None)


def test_a_configuration_that_was_not_learned_is_said_to_be_unknown(
    hand_model: HandModel, shots: Shots
) -> None:
    for shape in ("m_tall_thin", "f_27_avg"):
        shot = shots["open", shape]
        answer = tell(tracker(without_open(hand_model), shot), shot)
        assert answer.configuration is None, shape
        assert answer.reason is not None
        assert "none of the configurations" in answer.reason
        assert answer.marker_seen
        # where no configuration fits at all, no point of one is told
        assert not answer.found.any()


def test_points_that_disagree_by_more_than_the_threshold_are_left_out(
    hand_model: HandModel, shots: Shots
) -> None:
    shot = shots["open", "m_tall_thin"]
    usual = tell(tracker(hand_model, shot), shot)
    limit = float(np.nanmedian(usual.error_m[usual.found]))
    strict = tell(tracker(hand_model, shot, threshold_m=limit), shot)
    np.testing.assert_array_equal(strict.error_m, usual.error_m)
    np.testing.assert_array_equal(strict.found, usual.found & (usual.error_m <= limit))
    assert 0 < strict.found.sum() < usual.found.sum()
    none = tell(tracker(hand_model, shot, threshold_m=0.0), shot)
    assert not none.found.any()
    assert none.reason is not None
    assert "No point agrees" in none.reason
    # more disagreement is less confidence
    order = np.argsort(usual.error_m[usual.found])
    assert (np.diff(usual.confidence[usual.found][order]) <= 0).all()


def test_a_configuration_known_beforehand_is_the_only_one_tried(hand_model: HandModel, shots: Shots) -> None:
    shot = shots["point", "f_27_avg"]
    right = tell(tracker(hand_model, shot, configuration="point"), shot)
    assert (right.configuration, set(right.likelihood)) == ("point", {"point"})
    free = tell(tracker(hand_model, shot), shot)
    np.testing.assert_allclose(right.points_m, free.points_m)
    other = shots["fist", "f_27_avg"]
    wrong = tell(tracker(hand_model, other, configuration="open"), other)
    assert wrong.configuration is None
    assert wrong.reason is not None
    assert "not in the configuration that was given" in wrong.reason


def test_a_configuration_that_was_not_learned_cannot_be_asked_for(
    hand_model: HandModel, shots: Shots
) -> None:
    with pytest.raises(InputError, match="no configuration 'salute'") as told:
        tracker(hand_model, shots["open", "f_27_avg"], configuration="salute")
    assert "fist, open, point" in str(told.value)


def test_the_thesis_refinement_finds_the_points_too(hand_model: HandModel, shots: Shots) -> None:
    for name in ("open", "point"):
        shot = shots[name, "f_27_avg"]
        joint = tell(tracker(hand_model, shot), shot)
        answer = tell(tracker(hand_model, shot, refinement="sequential"), shot)
        assert answer.configuration == name
        assert np.median(off_mm(answer, shot)) < 9.0
        assert not np.array_equal(answer.points_m, joint.points_m)


# ------------------------------------------------------------------ from frame to frame


def test_a_hand_in_motion_is_followed(hand_model: HandModel, strolling: list[Shot]) -> None:
    follower = tracker(hand_model, strolling[0])
    off = []
    for number, shot in enumerate(strolling):
        answer = tell(follower, shot)
        assert answer.configuration == "open", number
        assert answer.reason is None
        assert answer.found[shot.visible].mean() >= 0.75, number
        off.append(off_mm(answer, shot))
    assert np.median(np.concatenate(off)) < 5.5
    assert np.percentile(np.concatenate(off), 95) < 12.0


def test_the_same_frames_give_the_same_answers(hand_model: HandModel, strolling: list[Shot]) -> None:
    one, other = (tracker(hand_model, strolling[0]) for _ in range(2))
    for shot in strolling[:3]:
        first, second = tell(one, shot), tell(other, shot)
        np.testing.assert_array_equal(first.points_m, second.points_m)
        np.testing.assert_array_equal(first.confidence, second.confidence)


def test_a_leap_does_not_lose_the_hand(hand_model: HandModel, leaping: list[Shot]) -> None:
    """20 cm and 40 degrees from one frame to the next, and back."""
    away = np.linalg.norm(leaping[1].truth_m - leaping[0].truth_m, axis=1)
    assert 0.18 < np.median(away) < 0.26
    follower = tracker(hand_model, leaping[0])
    for number, shot in enumerate(leaping):
        answer = tell(follower, shot)
        assert answer.configuration == "open", number
        assert answer.found[shot.visible].mean() >= 0.75, number
        assert np.median(off_mm(answer, shot)) < 6.0, number
        assert np.percentile(off_mm(answer, shot), 85) < 9.0, number


def test_another_configuration_is_noticed_at_once(hand_model: HandModel, shots: Shots) -> None:
    for shape in ("m_tall_thin", "f_27_avg"):
        follower = tracker(hand_model, shots["open", shape])
        for name in ("open", "fist", "point", "fist"):
            answer = tell(follower, shots[name, shape])
            assert answer.configuration == name, shape
            assert off_mm(answer, shots[name, shape]).max() < 18.0


def test_a_hand_comes_back_from_a_configuration_that_is_unknown(hand_model: HandModel, shots: Shots) -> None:
    follower = tracker(without_open(hand_model), shots["fist", "f_27_avg"])
    said = [tell(follower, shots[name, "f_27_avg"]).configuration for name in ("fist", "open", "point")]
    assert said == ["fist", None, "point"]


# ------------------------------------------------------------------ without the marker


def test_a_lost_marker_is_followed_for_ten_frames_and_no_longer(
    hand_model: HandModel, strolling: list[Shot]
) -> None:
    follower = tracker(hand_model, strolling[0])
    seen = [tell(follower, shot) for shot in strolling[:2]]
    for number, shot in enumerate(strolling[2:], start=1):
        answer = tell(follower, shot, marked=False)
        assert not answer.marker_seen
        assert answer.reason is not None
        if number > LOST_FRAMES:
            assert_nothing(answer)
            assert np.isnan(answer.anchors_m).all()
            continue
        assert "Followed by the shape" in answer.reason
        corners = shot.frame.corners_m[0]
        assert np.linalg.norm(answer.anchors_m - corners, axis=1).max() < 0.008, number
        assert answer.configuration == "open", number
        assert answer.found[shot.visible].mean() >= 0.7, number
        assert np.median(off_mm(answer, shot)) < 7.0, number
        # less sure than with the marker in view
        assert answer.confidence.max() <= 0.8 < seen[1].confidence.max()
    assert number == 12 > LOST_FRAMES + 1


def test_a_marker_that_comes_back_is_found_again(hand_model: HandModel, strolling: list[Shot]) -> None:
    """After a few frames, and after so many that the hand was given up."""
    for lost in (3, LOST_FRAMES + 2):
        follower = tracker(hand_model, strolling[0])
        tell(follower, strolling[0])
        for shot in strolling[1 : 1 + lost]:
            tell(follower, shot, marked=False)
        shot = strolling[1 + lost]
        answer = tell(follower, shot)
        assert answer.marker_seen
        assert answer.reason is None
        assert answer.configuration == "open"
        assert np.median(off_mm(answer, shot)) < 5.5
        corners = shot.frame.corners_m[0]
        assert np.linalg.norm(answer.anchors_m - corners, axis=1).max() < 0.004


def test_frames_without_a_marker_are_counted_anew_when_it_was_seen(
    hand_model: HandModel, strolling: list[Shot]
) -> None:
    follower = tracker(hand_model, strolling[0], lost_frames=2)
    marked = (True, False, False, True, False, False, False, False)
    told = [
        bool(tell(follower, shot, marked=m).found.any()) for shot, m in zip(strolling, marked, strict=False)
    ]
    assert told == [True, True, True, True, True, True, False, False]


def test_a_marker_may_be_followed_for_no_frame_at_all(hand_model: HandModel, strolling: list[Shot]) -> None:
    follower = tracker(hand_model, strolling[0], lost_frames=0)
    assert tell(follower, strolling[0]).found.any()
    assert_nothing(tell(follower, strolling[1], marked=False))


def test_a_hand_that_went_away_with_its_marker_is_not_followed(
    hand_model: HandModel, strolling: list[Shot]
) -> None:
    follower = tracker(hand_model, strolling[0])
    tell(follower, strolling[0])
    wall = replace(strolling[1], depth_m=np.full(strolling[1].depth_m.shape, 1.4))
    answer = tell(follower, wall, marked=False)
    assert_nothing(answer)
    assert np.isnan(answer.anchors_m).all()
    # and is found when it is back
    assert tell(follower, strolling[2]).configuration == "open"


def test_a_hand_that_was_never_marked_is_not_followed(hand_model: HandModel, strolling: list[Shot]) -> None:
    follower = tracker(hand_model, strolling[0])
    for shot in strolling[:2]:
        answer = tell(follower, shot, marked=False)
        assert_nothing(answer)
        assert answer.reason == "No marker is in view."


def test_without_a_colour_picture_it_is_said(hand_model: HandModel, strolling: list[Shot]) -> None:
    shot = strolling[0]
    answer = tracker(hand_model, shot).track(shot.depth_m, None)
    assert_consistent(answer, shot.frame.capture.rig)
    assert_nothing(answer)
    assert answer.reason is not None
    assert "colour picture" in answer.reason


def test_after_a_reset_the_next_frame_is_the_first(hand_model: HandModel, strolling: list[Shot]) -> None:
    follower = tracker(hand_model, strolling[0])
    for shot in strolling[:3]:
        tell(follower, shot)
    follower.reset()
    assert_nothing(tell(follower, strolling[3], marked=False))
    follower.reset()
    again, first = tell(follower, strolling[4]), tell(tracker(hand_model, strolling[0]), strolling[4])
    np.testing.assert_array_equal(again.points_m, first.points_m)
    assert again.likelihood == first.likelihood


# ------------------------------------------------------------------ trouble


def barred(shot: Shot, points: list[int], half_px: int = 14) -> Shot:
    """A bar before some points, across the picture to its right end, 12 cm nearer."""
    rig = shot.frame.capture.rig
    depth, rgb = shot.depth_m.copy(), shot.rgb.copy()
    u, v = rig.depth.project(shot.truth_m[points]).T
    top, bottom = int(v.min()) - half_px, int(v.max()) + half_px
    left, right = int(u.min()) - half_px, int(u.max()) + half_px
    depth[max(top, 0) : bottom, left:right] = shot.truth_m[points, 2].min() - 0.12
    u, v = np.rint(rig.depth.project(shot.truth_m)).astype(int).T
    covered = (v >= top) & (v < bottom) & (u >= left) & (u < right)
    capture = replace(shot.frame.capture, color=rgb)
    return Shot(replace(shot.frame, capture=capture), depth, shot.truth_m, shot.visible & ~covered)


def test_points_behind_something_are_left_out_and_the_others_stay(
    hand_model: HandModel, strolling: list[Shot]
) -> None:
    follower = tracker(hand_model, strolling[0])
    before = tell(follower, strolling[0])
    told = 0
    for shot in strolling[1:4]:
        hidden = barred(shot, [6, 9])  # middle and ring fingertip
        assert shot.visible[[6, 9]].all()
        answer = tell(follower, hidden)
        told += int(answer.found[[6, 9]].sum())
        rest = hidden.visible & before.found
        assert rest.sum() >= 6
        assert answer.found[rest].mean() >= 0.8
        assert np.median(off_mm(answer, hidden)) < 6.5
        assert answer.configuration in ("open", None)
    # a finger that is covered in part may be taken for a shorter one
    assert told <= 1
    back = tell(follower, strolling[4])
    assert back.configuration == "open"
    assert back.found[[6, 9]].all()


def test_a_hand_that_touches_a_body_is_not_measured(hand_model: HandModel, strolling: list[Shot]) -> None:
    shot = strolling[1]
    corners = shot.frame.corners_m[0]
    camera = shot.frame.capture.rig.depth
    normal = np.linalg.svd(corners - corners.mean(axis=0))[2][2]
    # skin all around, in the plane 8 mm behind the back of the hand
    there = normal @ (corners.mean(axis=0) + np.array((0.0, 0.0, 0.008)))
    body = there / (camera.pixel_rays @ normal)
    depth = np.where(shot.depth_m > 0, np.minimum(shot.depth_m, body), body)
    follower = tracker(hand_model, shot)
    tell(follower, strolling[0])
    answer = tell(follower, replace(shot, depth_m=depth))
    assert_nothing(answer)
    assert answer.reason is not None
    assert "touches" in answer.reason
    assert answer.marker_seen
    assert answer.surface is not None
    assert np.isfinite(answer.anchors_m).all()
    assert tell(follower, strolling[2]).configuration == "open"


def test_a_marker_without_any_skin_is_no_hand(hand_model: HandModel, strolling: list[Shot]) -> None:
    shot = strolling[0]
    answer = tell(tracker(hand_model, shot), replace(shot, depth_m=np.zeros_like(shot.depth_m)))
    assert_nothing(answer)


def with_a_second_marker(shot: Shot, side_px: int) -> Shot:
    """One more marker of the same kind lies on the wall at 1.4 m, in the upper left corner."""
    rgb = shot.rgb.copy()
    known = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    sheet = np.pad(cv2.aruco.generateImageMarker(known, 3, side_px), side_px // 4, constant_values=255)
    rgb[4 : 4 + len(sheet), 4 : 4 + len(sheet)] = sheet[..., None]
    return replace(shot, frame=replace(shot.frame, capture=replace(shot.frame.capture, color=rgb)))


def test_a_second_marker_of_the_same_size_is_not_guessed_at(
    hand_model: HandModel, strolling: list[Shot]
) -> None:
    shot = strolling[0]
    same = round(MARKER_M * shot.frame.capture.rig.picture_camera.fx / 1.4)
    answer = tell(tracker(hand_model, shot), with_a_second_marker(shot, same))
    assert_nothing(answer)
    assert answer.reason is not None
    assert "2 markers" in answer.reason


def test_a_second_marker_of_another_size_is_told_and_passed_over(
    hand_model: HandModel, strolling: list[Shot]
) -> None:
    shot = strolling[0]
    answer = tell(tracker(hand_model, shot), with_a_second_marker(shot, 72))
    assert answer.reason is not None
    assert "second marker" in answer.reason
    assert answer.configuration == "open"
    assert np.median(off_mm(answer, shot)) < 5.5


@dataclass
class Gives:
    """Anchors from elsewhere: those of a marker, some of which are missing in some frames."""

    rows: Iterator[tuple[int, ...]]
    kind: AnchorKind = "palm"
    count: int = 4

    def __post_init__(self) -> None:
        self._marker = MarkerAnchors(MARKER_M)

    def find(
        self,
        rgb: NDArray[np.uint8] | None,
        depth_m: FloatArray,
        rig: CameraRig,
        near_m: FloatArray | None = None,
    ) -> FoundAnchors:
        found = self._marker.find(rgb, depth_m, rig)
        places = found.places_m.copy()
        places[list(next(self.rows))] = np.nan
        return replace(found, places_m=places, seen=bool(found.seen and np.isfinite(places).any()))


def test_an_anchor_that_is_missing_now_and_then_breaks_nothing(
    hand_model: HandModel, strolling: list[Shot]
) -> None:
    missing = [(0,), (0,), (2,), (), (1,), (3,)]
    follower = HandTracker(hand_model, strolling[0].frame.capture.rig, Gives(iter(missing)))
    for number, (shot, rows) in enumerate(zip(strolling, missing, strict=False)):
        marked = number not in (1, 4)
        answer = tell(follower, shot, marked=marked)
        assert answer.marker_seen == marked
        assert answer.configuration == "open", number
        assert answer.found[shot.visible].mean() >= 0.7, number
        assert np.median(off_mm(answer, shot)) < 8.0, number
        if marked:
            np.testing.assert_array_equal(np.isnan(answer.anchors_m).any(axis=1), np.isin(np.arange(4), rows))


def test_a_hand_is_found_wherever_the_cameras_frame_has_its_origin(
    hand_model: HandModel, shots: Shots
) -> None:
    """The picture's own camera is beside the depth camera: pixels are the picture's."""
    shot = shots["open", "f_27_avg"]
    rig = shot.frame.capture.rig
    answer = tell(tracker(hand_model, shot), shot)
    assert rig.has_color
    assert not np.allclose(rig.picture_from_depth.matrix, RigidTransform().matrix)
    in_depth = rig.depth.project(answer.points_m[answer.found])
    assert np.linalg.norm(answer.pixels[answer.found] - in_depth, axis=1).min() > 3.0
