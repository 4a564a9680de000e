"""Two sources' opinions of the same joints as one skeleton.

A photo and a relief of the depth err together (the tracker means the same place by "shoulder" in both, and
the same depth lifts it), so two opinions are worth less than two measurements. What the second one gives is
joints that the first does not see, and doubt where the two differ.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from core.anchors.skeleton import VISIBLE, Joint, Skeleton

AGREE: Final = 9.0
"""Squared Mahalanobis distance up to which two opinions mean the same place."""

FILLED: Final = 0.8
"""Visibility of a joint that only the second source sees, times this."""


def fuse_skeletons(first: Skeleton, second: Skeleton | None, *, blend: bool = False) -> Skeleton:
    """The first skeleton with what the second adds.

    Parameters
    ----------
    first, second : Skeleton
        Of one capture, left and right alike in both; joints need covariances to be compared.
    blend : bool
        Also move joints that both see to their weighted mean. Measured on rendered captures this does not
        bring joints nearer to the truth, nor anchors nearer to each other from visit to visit.
    """
    if second is None:
        return first
    joints = {name: _fused(joint, second.joints.get(name), blend) for name, joint in first.joints.items()}
    extras = {name: _fused(j, second.landmarks.get(name), blend) for name, j in first.landmarks.items()}
    return replace(first, joints=joints, landmarks=extras)


def _fused(one: Joint, other: Joint | None, blend: bool) -> Joint:
    if other is None or other.visibility < VISIBLE:
        return one
    if one.visibility < VISIBLE:
        return replace(other, visibility=max(FILLED * other.visibility, one.visibility))
    if one.covariance_m2 is None or other.covariance_m2 is None:
        return one
    gap = other.point_m - one.point_m
    both = one.covariance_m2 + other.covariance_m2
    if float(gap @ np.linalg.solve(both, gap)) > AGREE:
        return replace(one, covariance_m2=one.covariance_m2 + np.outer(gap, gap) / 4.0)
    if not blend:
        return one
    gain = one.covariance_m2 @ np.linalg.inv(both)
    point = one.point_m + gain @ gap
    covariance = one.covariance_m2 - 0.5 * gain @ one.covariance_m2
    share = float(np.trace(gain)) / 3.0
    return replace(
        one,
        point_m=point,
        pixel=one.pixel + share * (other.pixel - one.pixel),
        covariance_m2=0.5 * (covariance + covariance.T),
    )
