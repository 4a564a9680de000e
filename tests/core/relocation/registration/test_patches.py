"""Skin belongs to the bone that it is connected to, not to the one that happens to be nearest."""

from __future__ import annotations

import numpy as np

from core.relocation.registration.patches import SkinOwners
from core.relocation.shortcuts import owners
from tests.core.relocation.shapes import Capsule, still_bone

THIGH = Capsule(np.array([0.12, 0.0, 2.0]), np.array([0.12, 0.45, 2.0]), 0.09)
UPPER = Capsule(np.array([0.24, -0.50, 2.0]), np.array([0.24, -0.25, 2.0]), 0.09)
FORE = Capsule(np.array([0.24, -0.25, 2.0]), np.array([0.22, 0.02, 2.0]), 0.06)
BONES = (
    still_bone("trunk", Capsule(np.array([0.0, -0.5, 2.0]), np.array([0.0, 0.0, 2.0]), 0.15)),
    still_bone("left_hip to left_knee", THIGH, 0),
    still_bone("left_shoulder to left_elbow", UPPER, 0),
    still_bone("left_elbow to left_hand", FORE, 2),
)
TRUNK, LEG, ARM, HAND = range(4)


def chains(*ways: tuple[list[float], list[float], int]) -> tuple[np.ndarray, np.ndarray, list[slice]]:
    """Samples along straight ways, each joined to its neighbours: places, edges, rows of every way."""
    places, edges, rows = [], [], []
    for start, end, count in ways:
        rows.append(slice(len(places), len(places) + count))
        edges += [(len(places) + k, len(places) + k + 1) for k in range(count - 1)]
        places += list(np.linspace(start, end, count))
    return np.array(places), np.array(edges, np.int32), rows


def arm_and_leg() -> tuple[np.ndarray, np.ndarray, list[slice]]:
    """An arm whose fingers hang beside the thigh, nearer to the thigh's bone than to the forearm's end."""
    return chains(([0.26, -0.48, 1.95], [0.20, 0.12, 1.95], 60), ([0.12, 0.02, 1.91], [0.12, 0.45, 1.91], 40))


def test_fingers_beside_the_thigh_belong_to_the_forearm():
    places, edges, (arm, leg) = arm_and_leg()
    assert LEG in owners(BONES, places[arm]), "the nearest bone alone is wrong"
    made = SkinOwners(BONES, places, edges)
    assert set(made.of_samples[arm]) == {ARM, HAND}
    assert set(made.of_samples[leg]) == {LEG}


def test_any_place_belongs_to_the_sample_beside_it():
    places, edges, (arm, _) = arm_and_leg()
    made = SkinOwners(BONES, places, edges)
    tips = places[arm][-3:] + np.array([0.002, 0.001, -0.001])
    assert (made.at(tips) == HAND).all()
    carriers = made.may_carry(tips)
    assert carriers[:, [HAND, ARM]].all()
    assert not carriers[:, [LEG, TRUNK]].any()


def test_skin_that_is_connected_to_nothing_stays_with_its_nearest_bone():
    places, edges, _ = chains(
        ([0.12, 0.1, 1.9], [0.12, 0.4, 1.9], 30), ([0.16, 0.2, 1.9], [0.16, 0.22, 1.9], 3)
    )
    assert (SkinOwners(BONES, places, edges).of_samples == LEG).all()
