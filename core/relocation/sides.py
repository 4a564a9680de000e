"""Left and right of two visits: where a skeleton's sides are in doubt, both labelings are tried."""

from __future__ import annotations

from dataclasses import replace

from core.anchors import Skeleton
from core.anchors.analyse import AnalysedCapture, with_skeleton
from core.anchors.left_right import Sides, guard_left_right, shoulder_order_m
from core.anchors.names import opposite
from core.relocation.pair import VisitPair
from core.relocation.registration.dense import one_linear_algebra_thread, register_skins

CLEARLY = 0.10
"""The other labeling must cover this much more of the skin to be taken."""
LEAST_COVERED = 0.5
SQUARE_ON_M = 0.10
"""Shoulders nearer to each other in the picture: the patient stands sideways, where sides say little."""

EXCHANGED = "Left and right of the {which} skeleton were exchanged: only so the two surfaces fit."


def with_sides_settled(pair: VisitPair) -> tuple[VisitPair, tuple[str, ...]]:
    """The pair with left and right exchanged in a capture whose sides were in doubt, if that fits better.

    Sides that nothing speaks against are left alone: a chest fits a back almost as well, so that the fit
    alone must not decide (METHOD section 3).
    """
    doubtful = [which for which in ("followup", "first") if _in_doubt(getattr(pair, which))]
    if len(doubtful) != 1:
        return pair, ()
    which = doubtful[0]
    own: AnalysedCapture = getattr(pair, which)
    other = replace(pair, **{which: with_skeleton(own.scan, exchanged(own.skeleton))})
    with one_linear_algebra_thread():
        better = _covered(other) >= max(LEAST_COVERED, _covered(pair) + CLEARLY)
    if not better:
        return pair, ()
    word = "follow-up's" if which == "followup" else "first visit's"
    return other, (EXCHANGED.format(which=word),)


def exchanged(skeleton: Skeleton) -> Skeleton:
    """The same skeleton with left and right exchanged."""
    joints = {opposite(n): replace(j, name=opposite(n)) for n, j in skeleton.joints.items()}
    landmarks = {opposite(n): replace(j, name=opposite(n)) for n, j in skeleton.landmarks.items()}
    return replace(skeleton, joints=joints, landmarks=landmarks)


def _in_doubt(capture: AnalysedCapture) -> bool:
    order = shoulder_order_m(capture.skeleton)
    if order is None or abs(order) < SQUARE_ON_M:
        return False
    report = guard_left_right(capture.skeleton, capture.capture.view, surface=capture.scan.surface)
    return report.sides is not Sides.AGREE


def _covered(pair: VisitPair) -> float:
    registration = register_skins(pair)
    return 0.0 if registration is None else registration.fit.covered
