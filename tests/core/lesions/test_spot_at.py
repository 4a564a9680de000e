from dataclasses import replace

import numpy as np
import pytest

from core.lesions import SkinSpots, detect_spots, spot_at
from core.surface import scan_body
from tests.core.lesions.conftest import Disc, trunk

DISCS = (Disc(600.0, 450.0, 3.0), Disc(612.0, 450.0, 3.0), Disc(640.0, 560.0, 9.0))


@pytest.fixture(scope="module")
def spots() -> SkinSpots:
    found = detect_spots(scan_body(trunk(DISCS)))
    rows = [int(np.linalg.norm(found.pixels - (d.u, d.v), axis=1).argmin()) for d in DISCS]
    return found.take(np.array(rows))


def test_a_click_a_little_beside_means_the_spot(spots):
    assert spot_at(spots, (602.0, 448.5), 4.0) == 0
    assert spot_at(spots, (610.5, 452.0), 4.0) == 1


def test_a_click_far_from_any_spot_means_none(spots):
    assert spot_at(spots, (640.0, 450.0), 4.0) is None
    assert spot_at(SkinSpots.none(), (640.0, 450.0), 4.0) is None


def test_a_click_on_a_large_spot_means_it_even_far_from_its_centre(spots):
    assert spot_at(spots, (646.0, 564.0), 3.0) == 2


def test_between_two_the_clearer_one_is_meant(spots):
    faint = replace(spots, confidence=np.array([0.1, 0.95, 0.95]))
    assert spot_at(faint, (605.6, 450.0), 8.0) == 1
    faint = replace(spots, confidence=np.array([0.95, 0.1, 0.95]))
    assert spot_at(faint, (606.4, 450.0), 8.0) == 0


def test_nearness_outweighs_clearness(spots):
    faint = replace(spots, confidence=np.array([0.2, 0.99, 0.99]))
    assert spot_at(faint, (600.5, 450.0), 15.0) == 0
