"""Ways that a distance must not have taken: over skin that merely touches.

Where a hand rests on a hip the depth camera sees one surface, and a geodesic from the forearm to the hip is a
few centimetres instead of the way over the shoulder. Along the skeleton that way has a least length: from the
place to its bone's joint, from joint to joint, to the anchor. A geodesic far below that length crossed
touching skin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.relocation.bones import Bone

FloatArray = NDArray[np.float64]

LEAST_SHARE = 0.65
"""Skin cuts corners that bones do not (armpit, groin); a true way is rarely shorter than this share."""
SLACK_M = 0.05


def skeleton_way_m(bones: tuple[Bone, ...], anchors: FloatArray, places: FloatArray) -> FloatArray:
    """Length (a, k) of the ways along the bones between anchors (a, 3) and places (k, 3), in metres.

    Only where a forearm or a lower leg is involved and at least two joints lie between; elsewhere 0.
    Neighbouring parts are not in doubt: there the skin is one.
    """
    owners1, owners2 = owners(bones, anchors), owners(bones, places)
    out = np.zeros((len(anchors), len(places)))
    depth = np.array([len(_to_trunk(bones, i)) for i in range(len(bones))])
    for one in np.unique(owners1):
        rows = np.flatnonzero(owners1 == one)
        for two in np.unique(owners2):
            columns = np.flatnonzero(owners2 == two)
            joints = _joints_between(bones, int(one), int(two))
            if len(joints) < 2 or max(depth[one], depth[two]) < 2:
                continue
            inner = float(np.linalg.norm(np.diff(joints, axis=0), axis=1).sum())
            start = np.linalg.norm(anchors[rows] - joints[0], axis=1)
            end = np.linalg.norm(places[columns] - joints[-1], axis=1)
            out[np.ix_(rows, columns)] = start[:, None] + inner + end[None, :]
    return out


def owners(bones: tuple[Bone, ...], places: FloatArray) -> NDArray[np.intp]:
    """Number (k,) of the bone nearest to each place (k, 3), in units of the bones' radii."""
    best = np.full(len(places), np.inf)
    owner = np.zeros(len(places), np.intp)
    for number, bone in enumerate(bones):
        along = bone.end - bone.start
        square = max(float(along @ along), 1e-12)
        share = np.clip((places - bone.start) @ along / square, 0.0, 1.0)
        distance = np.linalg.norm(places - bone.start - share[:, None] * along, axis=1) / bone.radius_m
        nearer = distance < best
        owner[nearer], best[nearer] = number, distance[nearer]
    return owner


def is_shortcut(
    bones: tuple[Bone, ...], anchors: FloatArray, places: FloatArray, distances: NDArray[np.floating]
) -> NDArray[np.bool_]:
    """Which distances (a, k) are too short to have gone over connected skin; none without a skeleton."""
    if not bones:
        return np.zeros(distances.shape, bool)
    least = LEAST_SHARE * skeleton_way_m(bones, anchors, places) - SLACK_M
    return np.asarray(distances < least)


def moved(bones: tuple[Bone, ...]) -> tuple[Bone, ...]:
    """The bones where the follow-up has them."""
    return tuple(
        Bone(
            b.name,
            b.moved_start,
            b.moved_start + b.rotation @ (b.end - b.start),
            b.radius_m,
            np.eye(3),
            b.moved_start,
            b.parent,
        )
        for b in bones
    )


def _joints_between(bones: tuple[Bone, ...], one: int, two: int) -> FloatArray:
    """Joint positions (m, 3) on the way from one bone to another, through their common ancestor."""
    up, down = _to_trunk(bones, one), _to_trunk(bones, two)
    while up and down and up[-1] == down[-1]:
        up.pop()
        down.pop()
    return np.array([bones[i].start for i in (*up, *reversed(down))]).reshape(-1, 3)


def _to_trunk(bones: tuple[Bone, ...], number: int) -> list[int]:
    """The bone and its ancestors that hang on a joint, from it to the trunk."""
    out = []
    current: int | None = number
    while current is not None and bones[current].parent is not None:
        out.append(current)
        current = bones[current].parent
    return out
