"""Learning from labelled frames: what is measured agrees with the truth, and what cannot teach is said."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.capture import RgbdCapture
from core.errors import InputError, WorkError
from core.hand.labels import FrameLabels
from core.hand.learning import (
    FEW_FRAMES,
    learn_hand,
    measure_frame,
    measure_labelled,
)
from core.hand.marker_anchors import MarkerAnchors
from core.hand.model import LEAST_FRAMES
from core.hand.names import PAIRS, POINT_NAMES
from core.hand.stills import still_depth
from core.progress import Cancelled
from tests.core.hand.training_frames import (
    CONFIGURATIONS,
    FRAMES,
    Labelled,
    colourless,
    new_frame,
    training_frames,
)

MARKER_M = 0.036
ON_THE_WALL_M = 0.16
"""What the markers of `with_markers` measure."""

TIP, PIP = POINT_NAMES.index("index_tip"), POINT_NAMES.index("index_pip")


def finder(side_m: float = MARKER_M, dictionary: str = "DICT_4X4_50") -> MarkerAnchors:
    return MarkerAnchors(side_m, dictionary)


def with_markers(capture: RgbdCapture, count: int) -> RgbdCapture:
    """The capture whose picture shows so many markers on grey, wherever the hand is."""
    assert capture.color is not None
    picture = np.full_like(capture.color, 128)
    sheet = np.pad(
        cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 3, 60),
        12,
        constant_values=255,
    )
    for k in range(count):
        picture[40 : 40 + 84, 40 + 150 * k : 40 + 150 * k + 84] = sheet[..., None]
    return replace(capture, color=picture)


def moved(labels: FrameLabels, name: str, by_m: tuple[float, float, float]) -> FrameLabels:
    points = {**labels.points_m, name: labels.points_m[name] + np.array(by_m)}
    return FrameLabels(labels.configuration, points, labels.visible)


def test_distances_between_points_are_those_along_the_true_hand() -> None:
    """A finger's skin is bent little between two joints: at least the straight way, and hardly more."""
    _, capture, labels = new_frame()
    measured = measure_frame(capture, labels, finder())
    place = labels.array()
    for finger in ("index", "middle", "ring"):
        tip, pip = POINT_NAMES.index(f"{finger}_tip"), POINT_NAMES.index(f"{finger}_pip")
        straight = float(np.linalg.norm(place[tip] - place[pip]))
        along = measured.pair_m[PAIRS.index((tip, pip))]
        assert straight - 0.003 < along < 1.15 * straight + 0.004


def test_distances_from_the_anchors_are_those_from_the_markers_corners() -> None:
    _, capture, labels = new_frame()
    measured = measure_frame(capture, labels, finder())
    assert measured.anchor_m.shape[0] == len(POINT_NAMES)
    corner_m = finder().find(capture.color, still_depth(capture), capture.rig).places_m
    mcp = POINT_NAMES.index("middle_mcp")
    straight = np.linalg.norm(corner_m - labels.array()[mcp], axis=1)
    np.testing.assert_allclose(measured.anchor_m[mcp, :4], straight, atol=0.008)


def test_hidden_points_do_not_teach() -> None:
    _, capture, labels = new_frame()
    hidden = FrameLabels("open", labels.points_m, {**labels.visible, "index_tip": False})
    measured = measure_frame(capture, hidden, finder())
    assert np.isnan(measured.anchor_m[TIP]).all()
    assert all(np.isnan(measured.pair_m[k]) for k, pair in enumerate(PAIRS) if TIP in pair)
    assert np.isfinite(measured.anchor_m[PIP]).all()


def test_a_point_off_the_hand_is_left_out_and_told() -> None:
    _, capture, labels = new_frame()
    measured = measure_labelled(capture, moved(labels, "index_tip", (0.0, 0.0, -0.04)), finder())
    assert np.isnan(measured.frame.anchor_m[TIP]).all()
    assert len(measured.left_out) == 1
    assert measured.left_out[0].startswith("index_tip is labelled ")
    off_mm = float(measured.left_out[0].split()[3])
    assert 30 <= off_mm <= 42


def test_a_frame_whose_points_are_mostly_off_the_hand_is_refused() -> None:
    """As when the labels are of another frame, or in another camera's coordinates."""
    _, capture, labels = new_frame()
    for name in POINT_NAMES:
        labels = moved(labels, name, (0.0, 0.0, 0.15))
    with pytest.raises(InputError, match="points are labelled off the hand"):
        measure_frame(capture, labels, finder())


def test_what_is_wrong_with_a_frame_is_said() -> None:
    _, capture, labels = new_frame()
    said = {}
    for name, wrong, looking in (
        ("no marker", with_markers(capture, 0), finder()),
        ("two markers", with_markers(capture, 2), finder(ON_THE_WALL_M)),
        ("dictionary", capture, finder(dictionary="DICT_5X5_50")),
        ("size", capture, finder(2 * MARKER_M)),
        ("colour", colourless(capture), finder()),
    ):
        with pytest.raises((InputError, WorkError)) as told:
            measure_frame(wrong, labels, looking)
        said[name] = str(told.value)
    assert "o marker" in said["no marker"]
    assert "2 markers" in said["two markers"]
    assert "DICT_4X4" in said["dictionary"]
    assert "mm" in said["size"]
    assert "colour" in said["colour"]


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        (FrameLabels(None, {"index_tip": np.array([0.0, 0.0, 0.6])}), "configuration"),
        (FrameLabels("open", {}), "No visible point"),
        (FrameLabels("open", {"index_tip": np.array([0.0, 0.0, 0.6])}, {"index_tip": False}), "No visible"),
    ],
)
def test_a_frame_needs_a_configuration_and_points(labels: FrameLabels, words: str) -> None:
    with pytest.raises(InputError, match=words):
        measure_frame(new_frame()[1], labels, finder())


def test_configurations_are_learned_with_their_tree_and_confusion() -> None:
    lesson = learn_hand(training_frames(), finder(), marker_m=MARKER_M)
    assert dict(lesson.used) == dict.fromkeys(CONFIGURATIONS, FRAMES)
    assert lesson.left_out == ()
    assert set(lesson.model.configurations) == set(CONFIGURATIONS)
    assert lesson.model.tree is not None
    assert lesson.model.tree.classes == CONFIGURATIONS
    assert (lesson.model.anchors, lesson.model.marker_m, lesson.model.dictionary) == (
        "marker",
        MARKER_M,
        "DICT_4X4_50",
    )
    assert lesson.confusion is not None
    assert lesson.confusion.counts.sum(axis=1).tolist() == [FRAMES, FRAMES]
    assert lesson.accuracy == np.trace(lesson.confusion.counts) / (2 * FRAMES)
    assert any(f"'open' ({FRAMES})" in remark for remark in lesson.remarks)
    assert FRAMES < FEW_FRAMES


def test_frames_that_cannot_teach_are_named_and_the_others_teach() -> None:
    frames = list(training_frames())
    _, capture, labels = frames[0]
    frames += [
        ("unlabelled", capture, FrameLabels()),
        ("blind", with_markers(capture, 0), labels),
        ("lonely", capture, FrameLabels("fist", labels.points_m, labels.visible)),
        ("slipped", capture, moved(labels, "index_tip", (0.0, 0.0, -0.04))),
    ]
    lesson = learn_hand(frames, finder())
    reasons = dict(lesson.left_out)
    assert set(reasons) == {"unlabelled", "blind", "lonely"}
    assert "no labels" in reasons["unlabelled"]
    assert "marker" in reasons["blind"]
    assert f"'fist' has 1 of the {LEAST_FRAMES} frames" in reasons["lonely"]
    assert [frame for frame, _ in lesson.points_left_out] == ["slipped"]
    assert "fist" not in lesson.model.configurations
    assert lesson.used["open"] == FRAMES + 1


def test_a_single_configuration_is_learned_without_a_tree() -> None:
    lesson = learn_hand([f for f in training_frames() if f[2].configuration == "open"], finder())
    assert list(lesson.model.configurations) == ["open"]
    assert lesson.model.tree is None
    assert lesson.confusion is None
    assert lesson.accuracy is None
    assert any("single configuration" in remark for remark in lesson.remarks)


def test_a_configuration_taught_by_a_single_point_is_told() -> None:
    frames = [
        (name, capture, replace(labels, points_m={"middle_mcp": labels.points_m["middle_mcp"]}))
        for name, capture, labels in training_frames()
        if labels.configuration == "open"
    ]
    assert any(
        "'open' is taught by 1 of the 15 points" in said for said in learn_hand(frames, finder()).remarks
    )


def test_one_training_frame_is_too_few() -> None:
    with pytest.raises(InputError, match=r"of 'open' there is 1 .* One frame shows no spread"):
        learn_hand([new_frame()], finder())


def test_no_frames_and_no_labels_are_said() -> None:
    with pytest.raises(InputError, match="no frames"):
        learn_hand([], finder())
    with pytest.raises(InputError, match=r"None of the 1 frames .* It has no labels"):
        learn_hand([("one", new_frame()[1], FrameLabels())], finder())


def test_progress_rises_and_names_the_frame() -> None:
    told: list[tuple[float, str]] = []
    learn_hand(training_frames(), finder(), progress=lambda part, said="": told.append((part, said)))
    parts = [part for part, _ in told]
    assert parts == sorted(parts)
    assert parts[-1] == 1.0
    assert "Measuring frame_000" in told[0][1]


def test_learning_can_be_cancelled() -> None:
    seen: list[str] = []

    def frames() -> list[Labelled]:
        return list(training_frames())

    def stop(part: float, said: str = "") -> None:
        seen.append(said)
        if len(seen) == 2:
            raise Cancelled

    with pytest.raises(Cancelled):
        learn_hand(frames(), finder(), progress=stop)
    assert len(seen) == 2


def several(capture: RgbdCapture, *, moving: bool) -> RgbdCapture:
    """Thirty frames with noise of 4 mm; the hand keeps still or is carried through the picture."""
    rng = np.random.default_rng(2)
    first = capture.depth_frames[0]
    frames = []
    for k in range(30):
        frame = np.roll(first, 3 * k if moving else 0, axis=1).astype(float)
        noisy = frame + rng.normal(0.0, 4.0, frame.shape) * (k > 0)
        frames.append(np.where(frame > 0, np.clip(noisy, 1, 65535), 0).astype(np.uint16))
    return replace(capture, depth_frames=np.stack(frames))


def test_frames_of_a_still_hand_are_fused_and_of_a_moving_one_the_first_counts() -> None:
    _, capture, _ = new_frame()
    single = still_depth(capture)
    np.testing.assert_array_equal(single, capture.depth_frames[0] * capture.depth_unit_m)
    still = still_depth(several(capture, moving=False))
    seen = (single > 0) & (still > 0)
    assert 0.0 < np.abs(still - single)[seen].mean() < 0.002
    np.testing.assert_array_equal(still_depth(several(capture, moving=True)), single)
