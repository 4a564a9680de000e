import numpy as np
import pytest

from core.lesions import SkinSpots, appearance_distance, detect_spots
from core.surface import scan_body
from tests.core.lesions.conftest import Disc, trunk

DISCS = (
    Disc(560.0, 400.0, 2.5),
    Disc(660.0, 380.0, 4.5),
    Disc(640.0, 520.0, 2.5, (150, 105, 85)),
    Disc(700.0, 600.0, 4.5, (120, 60, 60)),
    Disc(600.0, 640.0, 3.5, (40, 35, 32)),
)


def spots_of(discs: tuple[Disc, ...], **options: object) -> SkinSpots:
    found = detect_spots(scan_body(trunk(discs, **options)))
    rows = [int(np.linalg.norm(found.pixels - (d.u, d.v), axis=1).argmin()) for d in discs]
    return found.take(np.array(rows))


@pytest.fixture(scope="module")
def first() -> SkinSpots:
    return spots_of(DISCS)


@pytest.fixture(scope="module")
def later() -> SkinSpots:
    """In other light and shifted to other places of the skin."""
    moved = tuple(Disc(d.u + 15.3, d.v - 20.6, d.radius, d.color) for d in DISCS)
    return spots_of(moved, light=(0.8, 0.72, 0.62), seed=9)


def test_every_mole_looks_most_like_itself_in_other_light(first, later):
    cost = appearance_distance(first, np.arange(5), later, np.arange(5))
    assert cost.shape == (5, 5)
    assert (cost.argmin(axis=1) == np.arange(5)).all()
    assert np.diag(cost).max() < -3.0


def test_unlike_moles_cost_but_never_without_bound(first, later):
    cost = appearance_distance(first, [0], later, [1, 4])
    assert (cost > 2.0).all()
    assert (cost < 6.5).all()


def test_a_tilted_view_says_less(first, later):
    sight = -later.points_m / np.linalg.norm(later.points_m, axis=1, keepdims=True)
    side = np.cross(sight, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    tilted = SkinSpots(
        **{name: getattr(later, name) for name in SkinSpots.__dataclass_fields__}
        | {"normals": 0.4 * sight + np.sqrt(1 - 0.16) * side}
    )
    square = np.diag(appearance_distance(first, np.arange(5), later, np.arange(5)))
    aslant = np.diag(appearance_distance(first, np.arange(5), tilted, np.arange(5)))
    assert (aslant > square).all()


def test_no_spots_make_an_empty_matrix(first):
    assert appearance_distance(first, [0, 1], SkinSpots.none(), []).shape == (2, 0)
