"""Embedded deformation on bodies whose motion is known: it finds the motion, and keeps it once found."""

from __future__ import annotations

import numpy as np
import pytest

from core.relocation.bones import Bone
from core.relocation.registration.deformation import EmbeddedDeformation, Fit, Landmarks
from core.relocation.registration.dense import FIRST_STAGES, MATCH_STAGES, SECOND_STAGES
from core.surface import BodySurface
from tests.core.relocation.shapes import (
    Arc,
    Capsule,
    graph_on,
    moved_bone,
    near_to,
    start_on,
    still_bone,
    surface_of,
    turn,
)

NO_JOINTS = Landmarks(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
STILL, NOWHERE = np.eye(3), np.zeros(3)


def register(
    first: BodySurface, followup: BodySurface, bones: tuple[Bone, ...], joints: Landmarks = NO_JOINTS
) -> tuple[EmbeddedDeformation, Fit]:
    """Both stages, as for a pair of captures."""
    deformation = EmbeddedDeformation(graph_on(first, bones), start_on(first, bones))
    deformation.solve(followup, FIRST_STAGES, joints)
    deformation.return_to_rest()
    return deformation, deformation.solve(followup, SECOND_STAGES, joints)


TRUNK = Capsule(np.array([0.0, -0.25, 1.6]), np.array([0.02, 0.25, 1.6]), 0.13)
HEAD = Capsule(np.array([0.0, -0.42, 1.58]), np.array([0.0, -0.40, 1.58]), 0.09)
LEFT = Capsule(np.array([0.08, -0.22, 1.56]), np.array([0.42, -0.1, 1.5]), 0.05)
RIGHT = Capsule(np.array([-0.08, -0.22, 1.56]), np.array([-0.38, 0.05, 1.55]), 0.05)
FIGURE = (TRUNK, HEAD, LEFT, RIGHT)
TURN, SHIFT = turn([0.2, 1.0, 0.3], 8.0), np.array([0.25, -0.03, 0.12])
"""Of the figure about the camera: it slides over the picture and turns a little."""


@pytest.fixture(scope="module")
def figure():
    return surface_of(FIGURE)


@pytest.fixture(scope="module")
def moved_figure():
    return surface_of([part.moved(TURN, SHIFT) for part in FIGURE])


def seen_skin(surface: BodySurface) -> np.ndarray:
    """Places well inside the seen skin of the first visit."""
    facing = -np.einsum("ki,ki->k", surface.normals, surface.vertices) / np.linalg.norm(
        surface.vertices, axis=1
    )
    return surface.vertices[~surface.boundary & (facing > 0.5)]


def off(deformation: EmbeddedDeformation, places: np.ndarray, truth: np.ndarray) -> np.ndarray:
    return np.linalg.norm(deformation.warp(places)[0] - truth, axis=1)


def test_a_body_that_did_not_move_stays(figure):
    deformation, fit = register(figure, figure, (still_bone("trunk", TRUNK),))
    places = seen_skin(figure)
    assert off(deformation, places, places).max() < 0.001
    assert fit.rms_m < 0.001
    assert fit.covered > 0.7


def test_a_rigid_motion_that_the_skeleton_knows_is_kept(figure, moved_figure):
    deformation, fit = register(figure, moved_figure, (moved_bone("trunk", TRUNK, TURN, SHIFT),))
    places = seen_skin(figure)
    error = off(deformation, places, places @ TURN.T + SHIFT)
    assert error.mean() < 0.001
    assert error.max() < 0.004
    assert fit.rms_m < 0.0015


def test_a_rigid_motion_is_found_where_the_skeleton_is_wrong_by_centimetres(figure, moved_figure):
    wrong = moved_bone("trunk", TRUNK, turn([0, 0, 1], 4.0) @ TURN, SHIFT + np.array([0.02, 0.015, -0.03]))
    places = seen_skin(figure)
    truth = places @ TURN.T + SHIFT
    start = np.linalg.norm(start_on(figure, (wrong,))(places)[1] - truth, axis=1)
    deformation, _ = register(figure, moved_figure, (wrong,))
    error = off(deformation, places, truth)
    assert start.mean() > 0.03
    assert error.mean() < 0.004
    assert np.quantile(error, 0.95) < 0.012


def test_normals_turn_with_the_skin(figure, moved_figure):
    deformation, _ = register(figure, moved_figure, (moved_bone("trunk", TRUNK, TURN, SHIFT),))
    rows = np.flatnonzero(~figure.boundary)[::5]
    _, normals = deformation.warp(figure.vertices[rows], figure.normals[rows])
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(len(rows)))
    cosine = np.einsum("ki,ki->k", normals, figure.normals[rows] @ TURN.T)
    assert np.quantile(cosine, 0.05) > 0.995


@pytest.fixture(scope="module")
def bent_bar():
    """A straight bar, the same bar bent, its registration, and places in both: row s, then angle."""
    straight, bent = (Arc(np.array([0.0, 0.0, 1.4]), 0.30, 0.07, bend) for bend in (0.0, 0.7))
    bone = still_bone("trunk", Capsule(*straight.line(np.array([-0.3, 0.3]))[0], 0.07))
    skin = surface_of([bent])
    deformation, fit = register(surface_of([straight]), skin, (bone,))
    s, angle = (g.ravel() for g in np.meshgrid(np.linspace(-0.26, 0.26, 27), np.linspace(-0.9, 0.9, 13)))
    here, there = straight.place(s, angle), bent.place(s, angle)
    assert np.linalg.norm(here - there, axis=1).max() > 0.02
    return bent, skin, deformation, fit, s, here, there


def test_a_straight_bar_that_bends_is_followed_along_its_length(bent_bar):
    bent, _, deformation, fit, s, here, there = bent_bar
    carried, _ = deformation.warp(here)
    assert fit.rms_m < 0.001
    assert np.abs(bent.distance(carried)).max() < 0.002
    _, across = bent.line(s)
    along = np.stack([across[:, 1], -across[:, 0], across[:, 2]], axis=1)
    slid = np.abs(np.einsum("ki,ki->k", carried - there, along))
    assert slid.mean() < 0.002
    assert slid.max() < 0.010


def test_where_a_round_bar_turned_about_its_axis_a_few_marks_tell_how_far(bent_bar):
    _, skin, deformation, _, _, here, there = bent_bar
    marks = np.flatnonzero(np.arange(len(here)) % 41 == 20)
    deformation.solve(
        skin, MATCH_STAGES, NO_JOINTS, Landmarks(here[marks], there[marks], np.full(len(marks), 3.0))
    )
    error = off(deformation, here, there)
    assert error.mean() < 0.0015
    assert error.max() < 0.010


def test_a_forearm_swings_about_its_elbow_and_the_upper_arm_stays():
    elbow, hand = np.array([0.0, 0.0, 1.4]), np.array([0.3, 0.0, 1.4])
    upper, fore = Capsule(np.array([-0.35, 0.0, 1.4]), elbow, 0.06), Capsule(elbow, hand, 0.05)
    body = Capsule(np.array([-0.42, -0.3, 1.45]), np.array([-0.42, 0.3, 1.45]), 0.13)
    bend = turn([0, 0, 1], 50.0)
    swung = Capsule(elbow, elbow + bend @ (hand - elbow), 0.05)
    first, second = surface_of([body, upper, fore]), surface_of([body, upper, swung])
    doubted = turn([0, 0.3, 1], 38.0)
    bones = (
        still_bone("trunk", body),
        still_bone("upper", upper, 0),
        Bone("fore", elbow, hand, 0.05, doubted, elbow + np.array([0.01, -0.01, 0.0]), 1),
    )
    deformation, _ = register(first, second, bones)
    on_fore = first.vertices[near_to(first, fore)]
    on_fore = on_fore[on_fore[:, 0] > 0.08]
    carried, _ = deformation.warp(on_fore)
    assert np.abs(swung.distance(carried)).mean() < 0.003
    error = np.linalg.norm(carried - (elbow + (on_fore - elbow) @ bend.T), axis=1)
    assert error.mean() < 0.010
    on_upper = first.vertices[near_to(first, upper)]
    on_upper = on_upper[on_upper[:, 0] < -0.08]
    assert off(deformation, on_upper, on_upper).mean() < 0.003


def test_landmarks_draw_the_skin_along_itself():
    """A surface alone does not show that a round bar slid along its axis; two known places do."""
    bar = Capsule(np.array([0.0, -1.5, 1.4]), np.array([0.0, 1.5, 1.4]), 0.12)
    skin = surface_of([bar])
    deformation, _ = register(skin, skin, (still_bone("trunk", bar),))
    slid = np.array([0.0, 0.012, 0.0])
    rows = near_to(skin, bar)
    middle = rows[(np.abs(skin.vertices[rows, 1]) < 0.12) & (np.abs(skin.vertices[rows, 0]) < 0.06)]
    marks = skin.vertices[middle[:: max(1, len(middle) // 12)]]
    before = off(deformation, skin.vertices[middle], skin.vertices[middle] + slid)
    deformation.solve(
        skin, MATCH_STAGES, NO_JOINTS, Landmarks(marks, marks + slid, np.full(len(marks), 30.0))
    )
    after = off(deformation, skin.vertices[middle], skin.vertices[middle] + slid)
    assert before.mean() > 0.010
    assert after.mean() < 0.004


def test_only_the_first_stage_rests_on_the_skeleton(figure, moved_figure):
    bones = (moved_bone("trunk", TRUNK, TURN, SHIFT),)
    deformation = EmbeddedDeformation(graph_on(figure, bones), start_on(figure, bones))
    places = seen_skin(figure)
    warped = deformation.warp(places)[0]
    assert warped == pytest.approx(places @ TURN.T + SHIFT)
    assert deformation.rest_of(places) == pytest.approx(warped)
    deformation.return_to_rest()
    assert deformation.rest_of(places) is places
    assert deformation.warp(places)[0] == pytest.approx(warped, abs=1e-9)


def test_the_same_registration_twice_is_the_same(figure, moved_figure):
    bones = (moved_bone("trunk", TRUNK, TURN, SHIFT + np.array([0.01, 0.0, 0.0])),)
    places = seen_skin(figure)[::17]
    one, two = (register(figure, moved_figure, bones)[0].warp(places)[0] for _ in range(2))
    assert (one == two).all()
