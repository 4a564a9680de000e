"""Whether a place can be seen is judged against cameras, depth and the turn of the skin."""

from __future__ import annotations

import numpy as np
import pytest

from core.capture import CameraRig, RigidTransform
from core.relocation.sight import BEYOND, COVERED, OUTSIDE, TURNED, look_at
from tests.core.relocation.shapes import CAMERA, Capsule, surface_of

TRUNK = Capsule(np.array([0.0, -0.25, 1.6]), np.array([0.0, 0.25, 1.6]), 0.14)
ARM = Capsule(np.array([-0.3, 0.05, 1.35]), np.array([0.3, 0.05, 1.35]), 0.04)
"""Held across the belly."""
DEPTH_ONLY = CameraRig(CAMERA)
TOWARD = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def surface():
    return surface_of([TRUNK, ARM])


def look(surface, place, normal=TOWARD, rig=DEPTH_ONLY):
    sight = look_at(np.array([place], float), np.array([normal], float), surface, rig, other_stance=False)
    return sight.hidden[0], float(sight.cosine[0]), float(sight.off_m[0])


def test_seen_skin_is_seen(surface):
    hidden, cosine, off_m = look(surface, [0.0, -0.15, 1.46])
    assert hidden == ""
    assert cosine == pytest.approx(1.0, abs=0.02)
    assert off_m < 0.002


def test_skin_on_the_back_is_turned_away(surface):
    hidden, cosine, _ = look(surface, [0.0, -0.15, 1.46], -TOWARD)
    assert hidden == TURNED
    assert cosine < -0.9


def test_the_belly_behind_the_arm_is_covered(surface):
    hidden, _, _ = look(surface, [0.0, 0.055, 1.46])
    assert hidden == COVERED
    assert look(surface, [0.0, 0.05, 1.31])[0] == "", "the arm itself is seen"


def test_a_place_outside_the_picture_is_outside(surface):
    assert look(surface, [1.2, 0.0, 1.5])[0] == OUTSIDE
    assert look(surface, [0.0, 0.0, -1.0])[0] == OUTSIDE, "behind the camera"


def test_a_place_in_the_air_beside_the_skin_is_beyond_the_rim(surface):
    hidden, _, off_m = look(surface, [0.20, -0.15, 1.55])
    assert hidden == BEYOND
    assert off_m > 0.02
    assert look(surface, [0.0, -0.15, 1.45])[0] == "", "a centimetre off the skin is still on it"


def test_the_colour_camera_must_see_the_place_too(surface):
    aside = RigidTransform(np.eye(3), np.array([0.0, 0.45, 0.0]))
    high = CameraRig(CAMERA, CAMERA, aside)
    place = [0.0, 0.13, 1.46]
    assert look(surface, place)[0] == ""
    assert look(surface, place, rig=high)[0] == COVERED, "from above the arm is in the way"
    far = CameraRig(CAMERA, CAMERA, RigidTransform(np.eye(3), np.array([1.5, 0.0, 0.0])))
    assert look(surface, place, rig=far)[0] == OUTSIDE


def test_many_places_are_judged_one_by_one(surface):
    places = np.array([[0.0, -0.15, 1.46], [0.0, 0.055, 1.46], [1.2, 0.0, 1.5], [0.20, -0.15, 1.55]])
    sight = look_at(places, np.tile(TOWARD, (4, 1)), surface, DEPTH_ONLY, other_stance=False)
    assert sight.hidden == ("", COVERED, OUTSIDE, BEYOND)
    assert sight.cosine.shape == sight.off_m.shape == (4,)
    none = look_at(np.zeros((0, 3)), np.zeros((0, 3)), surface, DEPTH_ONLY, other_stance=True)
    assert none.hidden == ()


def test_skin_laid_onto_the_rim_is_judged_by_how_it_hangs_there(surface):
    """The registration does not carry skin quite behind the body: turn and distance together tell it."""
    rim = np.array([0.138, -0.15, 1.58])
    outward = np.array([1.0, 0.0, 0.0])
    assert look(surface, rim, outward)[0] != ""
    assert look(surface, rim + np.array([0.02, 0.0, 0.0]), outward)[0] != ""
    places = rim + np.linspace(-0.03, 0.03, 13)[:, None] * outward
    here, there = (
        look_at(places, np.tile(TOWARD, (13, 1)), surface, DEPTH_ONLY, other_stance=stance).hidden
        for stance in (False, True)
    )
    assert all(b for a, b in zip(here, there, strict=True) if a), "another stance never shows more"
