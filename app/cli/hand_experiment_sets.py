"""Which simulated hands the hand experiments are made on. Frozen: nothing was chosen on the test sets.

Hands to learn from and hands to be tested on differ in shape, in where the marker sits, in view angle,
distance, looseness of the pose and noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.cli.simulated_hands import Motion, Stills
from core.evaluation.hand.frames import HandSets
from devices.simulator.hands.sequence import RATE_HZ, USUAL_FRAMES
from devices.simulator.hands.shots import HandVariation, Holder
from devices.simulator.shapes import TEST_SHAPES, TUNING_SHAPES

THREE = ("open", "fist", "point")
FIVE = (*THREE, "two", "pinch")
SIX = (*FIVE, "grip")

TRAINING = HandVariation(
    joint_deg=4.0, spread_deg=2.5, tilt_deg=20.0, roll_deg=35.0, distance_m=(0.55, 0.80), aside_m=0.05
)
"""Views that are learned from."""

TESTING = HandVariation(
    joint_deg=5.0, spread_deg=3.0, tilt_deg=28.0, roll_deg=50.0, distance_m=(0.50, 0.95), aside_m=0.08
)
"""Views of the test: wider in every respect."""

_TRAINING_SEED, _TEST_SEED, _MOTION_SEED = 100_000, 500_000, 7
_HOLDER_TRAINING, _HOLDER_TEST = 100, 500
_SLOW_HZ = 15.0
_LARGE = (0, 3, 12, 9)  # of the test: tall thin man, obese man, girl of six, average woman

LEARN_FROM = 8
"""Of the tuning shapes: while something is tuned, the others are what it is judged on."""


@dataclass(frozen=True)
class Plan:
    """How many frames of what.

    Attributes
    ----------
    three_each, more_each : int
        Training frames per shape and configuration of `THREE`, and of the others.
    bare_each : int
        Training frames per shape and configuration of `FIVE` without a marker.
    test_each, bare_test_each : int
        Test frames per shape and configuration of `SIX`; of `FIVE` without a marker.
    large, bare_large, changing, occluded, bottle, lost : int
        Shapes with such a sequence.
    share : float
        Part of the usual length of sequences.
    """

    three_each: int = 25
    more_each: int = 5
    bare_each: int = 3
    test_each: int = 4
    bare_test_each: int = 2
    large: int = 4
    bare_large: int = 1
    changing: int = 2
    occluded: int = 2
    bottle: int = 2
    lost: int = 2
    shapes: int | None = None
    share: float = 1.0


FULL = Plan()
QUICK = Plan(3, 3, 2, 3, 1, 1, 1, 1, 1, 1, 1, shapes=4, share=0.15)


def hand_sets(cache: Path | None, plan: Plan = FULL, *, tuning: bool = False) -> HandSets:
    """The sets of the report, or, for tuning, sets of the tuning shapes alone.

    Parameters
    ----------
    cache : Path or None
        As `simulated_hands.cache_folder` gives it.
    plan : Plan
    tuning : bool
        Learn from the first of the tuning shapes and test on the others.
    """
    learned = TUNING_SHAPES[:LEARN_FROM] if tuning else TUNING_SHAPES
    tested = TUNING_SHAPES[LEARN_FROM:] if tuning else TEST_SHAPES
    learned, tested = learned[: plan.shapes], tested[: plan.shapes]
    training: list[Stills] = []
    for k, shape in enumerate(learned):
        holder = Holder(shape, seed=_HOLDER_TRAINING + k)
        still = Stills("training", holder, THREE, plan.three_each, _TRAINING_SEED, TRAINING, cache)
        training.append(still)
        more = SIX[len(THREE) :]
        training.append(
            replace(still, configurations=more, each=plan.more_each, seed=_TRAINING_SEED + 50_000)
        )
    bare = [
        Stills(
            "training",
            Holder(shape, seed=_HOLDER_TRAINING + k, marker_m=0.0),
            FIVE,
            plan.bare_each,
            _TRAINING_SEED,
            TRAINING,
            cache,
        )
        for k, shape in enumerate(learned)
    ]
    holders = [Holder(shape, seed=_HOLDER_TEST + k) for k, shape in enumerate(tested)]
    test = [Stills("test", h, SIX, plan.test_each, _TEST_SEED, TESTING, cache) for h in holders]
    bare_test = [
        replace(
            still, holder=replace(still.holder, marker_m=0.0), configurations=FIVE, each=plan.bare_test_each
        )
        for still in test
    ]

    def motions(
        kind: str,
        how_many: int,
        frames: int,
        places: tuple[int, ...],
        rate_hz: float = RATE_HZ,
        configurations: tuple[str, ...] = (),
    ) -> tuple[Motion, ...]:
        chosen = list(dict.fromkeys(holders[place % len(holders)] for place in places[:how_many]))
        length = max(round(frames * plan.share), 12)
        return tuple(Motion(kind, h, length, _MOTION_SEED, configurations, rate_hz, cache) for h in chosen)

    large = motions("large-displacements", plan.large, USUAL_FRAMES["large-displacements"], _LARGE)
    bare_large = [replace(m, holder=replace(m.holder, marker_m=0.0)) for m in large[: plan.bare_large]]
    return HandSets(
        training=tuple(training),
        bare_training=tuple(bare),
        test=tuple(test),
        bare_test=tuple(bare_test),
        large=large,
        bare_large=tuple(bare_large),
        changing=motions("configurations", plan.changing, 120, (1, 4), _SLOW_HZ, FIVE),
        occluded=motions("occlusion", plan.occluded, 124, (1, 4), _SLOW_HZ),
        bottle=motions("bottle", plan.bottle, 120, (2, 5), _SLOW_HZ),
        lost=motions("marker-lost", plan.lost, USUAL_FRAMES["marker-lost"], (0, 3)),
        three=THREE,
        five=FIVE,
        six=SIX,
    )


def about_sets(sets: HandSets, *, tuning: bool) -> dict[str, Any]:
    """What the figures were measured on, in words and numbers."""
    hands = (("learned from", TRAINING), ("tested on", TESTING))
    views = {
        name: f"{v.distance_m[0]:.2f}-{v.distance_m[1]:.2f} m, tilt up to {v.tilt_deg:.0f} degrees, "
        f"roll up to {v.roll_deg:.0f}, up to {100 * v.aside_m:.0f} cm aside, "
        f"joints {v.joint_deg:.0f} degrees (standard deviation) from the configuration"
        for name, v in hands
    }
    return {
        "frames": "simulated (devices/simulator/hands), Kinect v1 noise, 640 x 480, marker of 36 mm",
        "split": "tuning shapes, part learned and part tested" if tuning else "test shapes",
        "hands learned from": list(dict.fromkeys(one.body for one in sets.training)),
        "hands tested on": list(dict.fromkeys(one.body for one in sets.test)),
        "views": views,
        "sequences": {
            key: f"{len(some)} hands x {len(some[0])} frames"
            for key, some in (
                ("large displacements", sets.large),
                ("large displacements without marker", sets.bare_large),
                ("one configuration after the other", sets.changing),
                ("occlusion", sets.occluded),
                ("bottle", sets.bottle),
                ("marker lost", sets.lost),
            )
            if some
        },
        "program": program_code(),
    }


def program_code() -> str:
    """Fingerprint of what is measured."""
    import core.hand
    from core.evaluation.records import code_fingerprint

    return code_fingerprint([Path(core.hand.__file__).parent])
