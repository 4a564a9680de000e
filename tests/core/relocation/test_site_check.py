"""The check before a surgeon cuts: measured along the skin, and careful about what it claims."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.anchors import AnalysedCapture, analyse_capture
from core.errors import InputError
from core.relocation import LesionQuery, RelocatedLesion
from core.relocation.site_check import LARGEST_M, SiteCheck, check_site
from core.relocation.types import Region
from devices.simulator import STILL, SimulatedPatient
from devices.trackers import default_tracker
from tests.app.cli.cases import small_rig

Pixel = tuple[float, float]


@pytest.fixture(scope="module")
def capture() -> AnalysedCapture:
    patient = SimulatedPatient(
        "m_young_avg", seed=3, moles=5, lesions=3, freckles=0, variation=STILL, rig=small_rig()
    )
    return analyse_capture(patient.capture("A", "front", 1, frames=1, joints=True).capture, default_tracker())


def _frontal(capture: AnalysedCapture) -> np.ndarray:
    """A place on the trunk."""
    surface = capture.scan.surface
    middle = capture.skeleton.point("torso") - [0.0, 0.0, 0.12]
    return np.asarray(surface.nearest(middle)[0].position_m)


def _lesion(
    point: np.ndarray | None, axes: tuple[float, float] = (0.02, 0.01), **more: object
) -> RelocatedLesion:
    region = None if point is None else Region(axes, np.array([1.0, 0.0, 0.0]))
    made = RelocatedLesion(
        "L1", "found", "Seen again.", point, confidence=0.9, radius95_m=axes[0], region=region,
        appearance_matched=True,
    )  # fmt: skip
    return replace(made, **more)  # type: ignore[arg-type]


def _beside(capture: AnalysedCapture, point: np.ndarray, x_m: float, y_m: float) -> tuple[Pixel, np.ndarray]:
    """Pixel and skin of a place some way to the right and below."""
    place = capture.scan.surface.nearest(point + np.array([x_m, y_m, 0.0]))[0].position_m
    u, v = capture.capture.rig.project_to_picture(place)[0]
    return (float(u), float(v)), np.asarray(place)


def _check(
    capture: AnalysedCapture, lesion: RelocatedLesion, x_m: float, y_m: float, **more: object
) -> SiteCheck:
    assert lesion.point_m is not None
    pixel, _ = _beside(capture, lesion.point_m, x_m, y_m)
    return check_site(lesion, capture, pixel, **more)  # type: ignore[arg-type]


def test_the_verdict_follows_the_ellipse_not_a_circle(capture: AnalysedCapture) -> None:
    lesion = _lesion(_frontal(capture), (0.04, 0.015))
    along, across = _check(capture, lesion, 0.028, 0.0), _check(capture, lesion, 0.0, 0.028)
    assert (along.verdict, across.verdict) == ("inside", "outside")
    assert along.border_m is not None
    assert across.border_m is not None
    assert along.border_m < 0 < across.border_m
    assert across.border_m == pytest.approx(0.028 - 0.015, abs=0.004)
    assert along.normalised == pytest.approx(0.028 / 0.04, abs=0.1)


def test_distances_run_along_the_skin(capture: AnalysedCapture) -> None:
    """From the trunk to the hand: the way over the shoulder, not through the air."""
    lesion = _lesion(_frontal(capture))
    assert lesion.point_m is not None
    hand = capture.anchors["left_hand"].point.position_m
    u, v = capture.capture.rig.project_to_picture(hand)[0]
    check = check_site(lesion, capture, (float(u), float(v)))
    assert check.verdict == "outside"
    assert check.distance_m is not None
    assert check.distance_m > 1.15 * float(np.linalg.norm(hand - lesion.point_m))


def test_a_region_too_large_says_nothing_inside_but_far_away_is_outside(capture: AnalysedCapture) -> None:
    lesion = _lesion(_frontal(capture), (LARGEST_M + 0.01, 0.03))
    near = _check(capture, lesion, 0.0, 0.005)
    assert near.verdict == "cannot tell"
    assert "50 mm" in near.reason
    assert near.distance_m == pytest.approx(0.005, abs=0.003)
    assert _check(capture, lesion, 0.0, -0.15).verdict == "outside"


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({"status": "ambiguous"}, "not unique"),
        ({"confidence": 0.1}, "in doubt"),
        ({"agreement_m": 0.15}, "150 mm"),
        ({"status": "not_visible", "point_m": None, "region": None}, "not in view"),
        ({"status": "refused", "point_m": None, "region": None}, "not found"),
    ],
)
def test_degraded_evidence_is_never_inside(
    capture: AnalysedCapture, changed: dict[str, object], word: str
) -> None:
    sound = _lesion(_frontal(capture))
    assert sound.point_m is not None
    pixel, _ = _beside(capture, sound.point_m, 0.0, 0.0)
    assert check_site(sound, capture, pixel).verdict == "inside"
    check = check_site(replace(sound, **changed), capture, pixel)  # type: ignore[arg-type]
    assert check.verdict == "cannot tell"
    assert word in check.reason


def test_the_border_is_as_wide_as_a_click(capture: AnalysedCapture) -> None:
    place = _frontal(capture)
    pixel, skin = _beside(capture, place, 0.0, 0.02)
    exact = float(np.linalg.norm(skin - place))
    check = check_site(_lesion(place, (exact, exact)), capture, pixel)
    assert check.verdict == "cannot tell"
    assert "border" in check.reason


def test_another_lesion_s_region_is_named_and_the_nearer_one_wins(capture: AnalysedCapture) -> None:
    place = _frontal(capture)
    lesion = _lesion(place, (0.03, 0.03))
    _, there = _beside(capture, place, 0.04, 0.0)
    rival = replace(_lesion(there, (0.03, 0.03)), id="L2")
    assert _check(capture, lesion, 0.0, -0.02, others=[rival]).also_inside == ()
    nearer = _check(capture, lesion, 0.012, 0.0, others=[rival])
    assert (nearer.verdict, nearer.also_inside) == ("inside", ("L2",))
    assert "L2" in nearer.reason
    farther = _check(capture, lesion, 0.0235, 0.0, others=[rival])
    assert farther.verdict == "cannot tell"
    assert "nearer to lesion L2" in farther.reason


def test_the_anchors_contradict_a_site_elsewhere_on_the_body(capture: AnalysedCapture) -> None:
    """The lesion was marked on the trunk; a region that was read onto the thigh is not believed."""
    rig = capture.capture.rig
    u, v = rig.project_to_picture(_frontal(capture))[0]
    query = LesionQuery("L1", pixel=(float(u), float(v)))
    thigh = capture.scan.surface.nearest(
        (capture.skeleton.point("left_hip") + capture.skeleton.point("left_knee")) / 2 - [0, 0, 0.08]
    )[0].position_m
    lesion = _lesion(np.asarray(thigh))
    pixel, _ = _beside(capture, np.asarray(thigh), 0.0, 0.0)
    assert check_site(lesion, capture, pixel).verdict == "inside"
    check = check_site(lesion, capture, pixel, first=capture, query=query)
    assert check.verdict == "cannot tell"
    assert check.signature_m is not None
    assert check.signature_m > 0.1


def test_beside_the_body_cannot_be_told_and_outside_the_picture_is_wrong_use(
    capture: AnalysedCapture,
) -> None:
    lesion = _lesion(_frontal(capture))
    assert check_site(lesion, capture, (30.0, 120.0)).verdict == "cannot tell"
    with pytest.raises(InputError, match="outside"):
        check_site(lesion, capture, (-5.0, 10.0))
