"""What the matching sees of the first visit: lesions, confirmed places, all other spots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.lesions import SkinSpots
from core.relocation import LesionQuery
from core.relocation.moles import gather_moles, usable
from core.relocation.pair import KnownPlace, PickedLesion, VisitPair
from core.relocation.registration.graph import skin_net
from core.relocation.registration.start import skeleton_start
from core.relocation.relocate import pick_query


@pytest.fixture(scope="module")
def start(simulated_visits):
    first = simulated_visits.first
    net = skin_net(first.scan.surface)
    made = skeleton_start(VisitPair(first, simulated_visits.same), net.places, net.edges)
    assert made is not None
    return made


@pytest.fixture(scope="module")
def spots(simulated_visits):
    return usable(simulated_visits.first.spots)


def picked(visits, pixel, name="L", **more):
    query = LesionQuery(name, (float(pixel[0]), float(pixel[1])), **more)
    pick = pick_query(visits.first, query)
    assert pick.point is not None
    return PickedLesion(query, pick.point, pick.normal)


def gather(visits, start, spots, lesions, known=()):
    return gather_moles(lesions, known, spots, visits.first.scan.surface, start)


def test_a_click_beside_a_spot_means_the_spot_and_every_spot_is_there_once(simulated_visits, start, spots):
    row = 3
    lesion = picked(simulated_visits, spots.pixels[row] + [1.5, -1.0])
    moles = gather(simulated_visits, start, spots, [lesion])
    assert moles.lesions == 1
    assert moles.spot[0] == row
    assert moles.places[0] == pytest.approx(spots.points_m[row])
    assert sorted(moles.spot.tolist()) == list(range(len(spots)))
    assert moles.places[1:] == pytest.approx(spots.points_m[moles.spot[1:]])


def test_a_click_on_bare_skin_stays_where_it_is(simulated_visits, start, spots):
    pixel = simulated_visits.first.capture.rig.project_to_picture(
        simulated_visits.first.anchors["torso"].position_m
    )[0]
    pixel = next(
        p
        for p in pixel + np.array([[0.0, 9.0 * k] for k in range(-12, 12)])
        if np.linalg.norm(spots.pixels - p, axis=1).min() > 9.0
    )
    lesion = picked(simulated_visits, pixel)
    moles = gather(simulated_visits, start, spots, [lesion])
    assert moles.spot[0] == -1
    assert moles.places[0] == pytest.approx(lesion.point.position_m)
    assert (moles.looks(spots, spots)[0] == 0.0).all(), "bare skin looks like no spot more than another"
    assert len(moles.places) == 1 + len(spots)


def test_a_healed_lesion_is_no_spot_and_never_looks_like_one(simulated_visits, start, spots):
    lesion = picked(simulated_visits, spots.pixels[3], healed=True)
    moles = gather(simulated_visits, start, spots, [lesion])
    assert moles.healed.tolist() == [True] + [False] * (len(moles.places) - 1)
    assert moles.spot[0] == -1
    assert 3 not in moles.spot, "its own spot is not offered to others either"
    looks = moles.looks(spots, simulated_visits.same.spots)
    assert looks[0].min() > 1000 * np.abs(looks[1:]).max()


def test_confirmed_places_come_after_the_lesions(simulated_visits, start, spots):
    lesions = [picked(simulated_visits, spots.pixels[k], f"L{k}") for k in (1, 2)]
    place = picked(simulated_visits, spots.pixels[8]).point
    moles = gather(simulated_visits, start, spots, lesions, [KnownPlace("K", place, place)])
    assert moles.lesions == 2
    assert moles.places[2] == pytest.approx(place.position_m)
    assert moles.spot[2] == -1


def test_a_spot_looks_most_like_itself(simulated_visits, start, spots):
    moles = gather(simulated_visits, start, spots, [])
    looks = moles.looks(spots, spots)
    own = looks[np.arange(len(moles.spot)), moles.spot]
    assert (own <= looks.min(axis=1) + 1e-9).mean() > 0.95
    assert looks.min() >= -6.0
    assert looks.max() <= 12.0


def test_skin_of_two_limbs_counts_as_farther_apart(simulated_visits, start):
    joints = simulated_visits.first.skeleton
    surface = simulated_visits.first.scan.surface
    fore, chest, belly = (
        surface.nearest(p)[0].position_m
        for p in (
            0.5 * (joints.point("left_elbow") + joints.point("left_hand")),
            joints.point("torso") - [0.0, 0.05, 0.1],
            joints.point("torso") + np.array([0.0, 0.05, -0.1]),
        )
    )
    from core.relocation.moles import limb_coordinates

    there = limb_coordinates(np.array([fore, chest, belly]), start)
    apart = np.linalg.norm(there[0] - there[1]) - np.linalg.norm(fore - chest)
    assert apart > 0.01
    assert np.linalg.norm(there[1] - there[2]) == pytest.approx(np.linalg.norm(chest - belly), rel=0.05)
    assert limb_coordinates(np.zeros((0, 3)), start).shape == (0, there.shape[1])


def test_faint_blobs_take_no_part(simulated_visits):
    every = simulated_visits.first.spots
    doubted = replace(every, confidence=np.where(np.arange(len(every)) == 0, 0.01, every.confidence))
    assert len(usable(doubted)) < len(every) + 1
    assert usable(doubted).confidence.min() > 0.01
    assert len(usable(SkinSpots.none())) == 0
