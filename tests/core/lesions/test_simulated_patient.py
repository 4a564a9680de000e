import numpy as np
import pytest
from scipy.spatial import cKDTree

from core.lesions import detect_spots
from core.surface import scan_body
from devices.simulator import SimulatedPatient


@pytest.fixture(scope="module")
def simulated():
    return SimulatedPatient("f_young_avg", 3, 240).capture("psi", frames=6)


def test_nearly_all_visible_moles_of_a_patient_are_found_where_they_are(simulated):
    truth = simulated.truth
    spots = detect_spots(scan_body(simulated.capture))
    seen = truth.mole_pixels[truth.mole_visible]
    away, row = cKDTree(spots.pixels).query(seen)
    found = away < 2.5
    assert len(seen) > 60
    assert found.mean() > 0.9
    assert np.median(away[found]) < 0.2
    assert np.mean(found & (spots.confidence[row] > 0.5)) > 0.65
    apart = np.linalg.norm(
        spots.points_m[row[found]] - truth.mole_points_m[truth.mole_visible][found], axis=1
    )
    assert np.median(apart) < 0.004
    sure = spots.take(spots.confidence > 0.5)
    away, _ = cKDTree(truth.mole_pixels[truth.mole_visible_color]).query(sure.pixels)
    assert np.mean(away < 4.0) > 0.8
    assert len(spots) < 1000
