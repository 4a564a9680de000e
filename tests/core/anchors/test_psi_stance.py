import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.anchors import check_psi, exchange_sides

Points = dict[str, np.ndarray]


def moved(points: Points, **places: tuple[float, float, float]) -> Points:
    """Points with some joints placed relative to another: ``left_hand=(dx, dy, dz)`` from the elbow."""
    parents = {"hand": "elbow", "elbow": "shoulder"}
    out = dict(points)
    for name, offset in places.items():
        side, part = name.split("_")
        out[name] = out[f"{side}_{parents[part]}"] + np.array(offset)
    return out


def test_the_psi_stance_needs_no_correction(psi_points, make_skeleton) -> None:
    report = check_psi(make_skeleton(psi_points))
    assert report.ok
    assert report.corrections == ()


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_hanging_forearm_is_to_be_raised(side, psi_points, make_skeleton) -> None:
    points = moved(psi_points, **{f"{side}_hand": (0.0, 0.3, 0.0)})
    assert check_psi(make_skeleton(points)).corrections == (f"Raise the {side} forearm.",)


def test_a_forearm_towards_the_camera_is_to_be_raised(psi_points, make_skeleton) -> None:
    points = moved(psi_points, left_hand=(0.0, -0.05, -0.3))
    (said,) = check_psi(make_skeleton(points)).corrections
    assert said.startswith("Raise the left forearm")


def test_a_low_elbow_is_to_be_brought_up(psi_points, make_skeleton) -> None:
    points = moved(psi_points, right_elbow=(-0.12, 0.26, 0.0))
    points = moved(points, right_hand=(0.0, -0.3, 0.0))
    assert check_psi(make_skeleton(points)).corrections == ("Bring the right elbow up to shoulder height.",)


def test_a_high_elbow_is_to_be_brought_down(psi_points, make_skeleton) -> None:
    points = moved(psi_points, left_elbow=(0.12, -0.26, 0.0))
    points = moved(points, left_hand=(0.0, -0.3, 0.0))
    assert check_psi(make_skeleton(points)).corrections == ("Bring the left elbow down to shoulder height.",)


def test_an_elbow_in_front_is_to_be_moved_aside(psi_points, make_skeleton) -> None:
    points = moved(psi_points, left_elbow=(0.08, 0.0, -0.27))
    points = moved(points, left_hand=(0.0, -0.3, 0.0))
    assert check_psi(make_skeleton(points)).corrections == ("Move the left elbow out to the side.",)


def test_arms_hanging_down_are_corrected_on_both_sides(psi_points, make_skeleton) -> None:
    points = dict(psi_points)
    for side, out in (("left", 1), ("right", -1)):
        points = moved(points, **{f"{side}_elbow": (0.05 * out, 0.28, 0.0)})
        points = moved(points, **{f"{side}_hand": (0.0, 0.3, 0.0)})
    said = check_psi(make_skeleton(points)).corrections
    assert len(said) == 4
    assert "Bring the left elbow up to shoulder height." in said
    assert "Raise the right forearm." in said


def test_missing_feet_ask_to_step_back(psi_points, make_skeleton) -> None:
    both = make_skeleton(psi_points, hidden=("left_foot", "right_foot"))
    assert check_psi(both).corrections == ("Step back: the feet are not in the picture.",)
    assert check_psi(both, whole_body=False).ok
    one = make_skeleton(psi_points, hidden=("left_foot",))
    assert check_psi(one).corrections == ("Step back: the left foot is not in the picture.",)


@pytest.mark.parametrize("degrees", [40, -40, 75, 180])
def test_a_turned_patient_is_asked_to_face_the_camera(degrees, psi_points, make_skeleton) -> None:
    a = np.radians(degrees)
    turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    axis = psi_points["torso"]
    turned = {name: axis + turn @ (p - axis) for name, p in psi_points.items()}
    assert check_psi(make_skeleton(turned)).corrections[0] == "Turn to face the camera."


def test_a_hidden_hand_is_asked_for(psi_points, make_skeleton) -> None:
    (said,) = check_psi(make_skeleton(psi_points, hidden=("right_hand",))).corrections
    assert "right hand" in said


def test_a_missing_head_is_said_first(psi_points, make_skeleton) -> None:
    skeleton = make_skeleton(psi_points, hidden=("head", "left_foot", "right_foot"))
    assert "head" in check_psi(skeleton).corrections[0]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
@given(seed=st.integers(0, 10**6))
def test_tracking_noise_does_not_turn_a_good_stance_into_a_bad_one(seed, psi_points, make_skeleton) -> None:
    rng = np.random.default_rng(seed)
    noisy = {name: p + rng.uniform(-0.03, 0.03, 3) for name, p in psi_points.items()}
    assert check_psi(make_skeleton(noisy)).ok


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40)
@given(seed=st.integers(0, 10**6))
def test_corrections_of_the_mirror_image_name_the_other_side(seed, psi_points, make_skeleton) -> None:
    rng = np.random.default_rng(seed)
    points = dict(psi_points)
    for side in ("left", "right"):
        points = moved(points, **{f"{side}_elbow": tuple(rng.uniform(-0.3, 0.3, 3))})
        points = moved(points, **{f"{side}_hand": tuple(rng.uniform(-0.3, 0.3, 3))})
    mirrored = make_skeleton({name: p * (-1, 1, 1) for name, p in points.items()})
    said = sorted(check_psi(make_skeleton(points)).corrections)
    other = check_psi(exchange_sides(mirrored)).corrections
    swap = {"left": "right", "right": "left"}
    assert said == sorted(" ".join(swap.get(word, word) for word in s.split(" ")) for s in other)
