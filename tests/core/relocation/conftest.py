"""Skin that can be computed: a sheet, flat or rolled without stretching; and one simulated patient twice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from core.anchors import AnalysedCapture, analyse_capture
from core.relocation import LesionQuery
from devices.simulator import CaptureTruth, SimulatedPatient, VisitChange, make_rig

STEP = 0.01


@dataclass(frozen=True, eq=False)
class Sheet:
    """A sheet of 0.6 m x 0.8 m; `flat` (n, 2) are its own coordinates, `vertices` (n, 3) where it lies."""

    flat: np.ndarray
    vertices: np.ndarray
    triangles: np.ndarray
    boundary: np.ndarray

    def distances(self, anchors: np.ndarray) -> np.ndarray:
        """Exact geodesic distances (a, n) from places (a, 2) of the sheet."""
        return np.linalg.norm(self.flat[None] - anchors[:, None], axis=2)

    def at(self, place: np.ndarray) -> np.ndarray:
        """Position (3,) of a place (2,) of the sheet, by the nearest vertex."""
        return self.vertices[np.linalg.norm(self.flat - place, axis=1).argmin()]


def make_sheet(radius: float | None) -> Sheet:
    """A flat sheet at 2 m, or one rolled around an upright axis."""
    columns, rows = 61, 81
    u, v = np.meshgrid(np.arange(columns) * STEP, np.arange(rows) * STEP)
    flat = np.stack([u.ravel(), v.ravel()], axis=1)
    if radius is None:
        vertices = np.column_stack([flat, np.full(len(flat), 2.0)])
    else:
        angle = (flat[:, 0] - 0.3) / radius
        vertices = np.column_stack(
            [radius * np.sin(angle), flat[:, 1], 2.0 + radius - radius * np.cos(angle)]
        )
    index = np.arange(columns * rows).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([b, d, c], -1)]).reshape(-1, 3)
    boundary = (u == 0) | (v == 0) | (u == u.max()) | (v == v.max())
    return Sheet(flat, vertices, triangles.astype(np.int32), boundary.ravel())


@pytest.fixture(scope="session")
def flat_sheet() -> Sheet:
    return make_sheet(None)


@pytest.fixture(scope="session")
def rolled_sheet() -> Sheet:
    return make_sheet(0.25)


@pytest.fixture(scope="session")
def anchors() -> np.ndarray:
    return np.array([[0.05, 0.05], [0.55, 0.10], [0.10, 0.70], [0.50, 0.75], [0.30, 0.35], [0.05, 0.40]])


@dataclass(frozen=True, eq=False)
class SimulatedVisits:
    """Three captures of one patient with recorded joints, and what they show.

    The patient lost moles, got new ones, and some lesions healed between the visits.
    """

    first: AnalysedCapture
    same: AnalysedCapture
    other: AnalysedCapture
    first_truth: CaptureTruth
    truths: dict[str, CaptureTruth]
    queries: tuple[LesionQuery, ...]

    def followup(self, stance: str) -> tuple[AnalysedCapture, CaptureTruth]:
        """Second visit in the same stance ("psi") or in another ("A")."""
        return (self.same if stance == "psi" else self.other), self.truths[stance]


class NoTracker:
    """Recorded joints need no tracker; asking one is an error."""

    name = "none"

    def detect(self, rgb: np.ndarray) -> None:
        raise AssertionError("the recorded joints were not used")

    def close(self) -> None:
        pass


HEALED = ("L16", "L20", "L27")
"""Lesions on the front of the patient."""


@pytest.fixture(scope="session")
def simulated_visits() -> SimulatedVisits:
    patient = SimulatedPatient(
        "m_young_avg",
        5,
        120,
        lesions=40,
        freckles=60,
        rig=make_rig((1280, 960)),
        changes={2: VisitChange(new_moles=16, vanished=16, healed=HEALED)},
    )
    taken = [
        patient.capture(stance, "front", visit, frames=4, seed=seed, joints=True)
        for stance, visit, seed in (("psi", 1, 1), ("psi", 2, 2), ("A", 2, 2))
    ]
    first, same, other = (analyse_capture(t.capture, NoTracker()) for t in taken)
    truth = taken[0].truth
    queries = tuple(
        LesionQuery(name, tuple(truth.mole_pixels[truth.mole_row[name]]), healed=name in HEALED)
        for name in truth.lesion_ids
        if truth.mole_visible[truth.mole_row[name]]
    )
    truths = {"psi": taken[1].truth, "A": taken[2].truth}
    return SimulatedVisits(first, same, other, truth, truths, queries)
