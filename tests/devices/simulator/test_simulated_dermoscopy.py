"""Simulated dermoscopic pictures for the demonstration."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from core.errors import InputError
from devices.simulator import SimulatedPatient, VisitChange


@pytest.fixture(scope="module")
def growing() -> SimulatedPatient:
    return SimulatedPatient(seed=2, moles=40, tone=1)


def _dark_share(picture: np.ndarray) -> float:
    """Share of the clear disc that is clearly darker than the skin."""
    s = picture.shape[0]
    v, u = np.mgrid[:s, :s] - (s - 1) / 2
    disc = picture.astype(float).mean(axis=2)[np.hypot(u, v) < 0.4 * s]
    return float((disc < 0.85 * np.percentile(disc, 90)).mean())


def test_the_same_lesion_and_visit_give_the_same_picture(growing: SimulatedPatient) -> None:
    one, again = (growing.dermoscopy("L02", size=256) for _ in range(2))
    assert one.shape == (256, 256, 3)
    assert one.dtype == np.uint8
    assert (one == again).all()
    assert (one != growing.dermoscopy("L02", 2, size=256)).mean() > 0.3


def test_a_growing_lesion_is_larger_at_the_next_visit(growing: SimulatedPatient) -> None:
    marks = growing.moles().marks
    smallest = growing.lesion_ids[int(marks.radius_m[: len(growing.lesion_ids)].argmin())]
    change = VisitChange(growth={smallest: 1.5})
    patient = SimulatedPatient(seed=2, moles=40, tone=1, changes={2: change})
    before, after = (_dark_share(patient.dermoscopy(smallest, visit, size=384)) for visit in (1, 2))
    assert after > 1.4 * before


def test_the_file_says_that_it_is_simulated(growing: SimulatedPatient) -> None:
    with Image.open(BytesIO(growing.dermoscopy_png("L03", size=128))) as picture:
        assert picture.size == (128, 128)
        assert "Simulated" in picture.text["Comment"]
        assert "L03" in picture.text["Description"]


def test_an_unknown_lesion_is_refused(growing: SimulatedPatient) -> None:
    with pytest.raises(InputError, match="L99"):
        growing.dermoscopy("L99")
