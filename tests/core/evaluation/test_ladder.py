"""The ladder on one small simulated pair with true joints."""

from __future__ import annotations

import numpy as np
import pytest

from app.cli.evaluate import ladder_table
from app.cli.simulated_cases import TEST_PAIRS, TUNING_PAIRS, SimulatedCases, SimulatedPair
from core.errors import InputError
from core.evaluation import LADDER, run_ladder
from core.evaluation.ladder import FLOOR


@pytest.fixture(scope="module")
def rows():
    source = SimulatedCases(
        [SimulatedPair("m_young_avg", 31, "psi", "A")], frames=3, joints=("true",), moles=40, lesions=24
    )
    return {row.method: row for row in run_ladder(source)}


def test_every_rung_and_the_floor_are_scored_on_the_same_lesions(rows):
    assert list(rows) == [*LADDER, FLOOR]
    counts = {row.summary.lesions for row in rows.values()}
    assert len(counts) == 1
    assert counts.pop() >= 6
    assert {(row.group, row.joints, row.cases) for row in rows.values()} == {("other stance", "true", 1)}


def test_no_method_beats_the_sensor_and_geodesics_beat_stiff_alignment(rows):
    mean = {name: row.summary.mean_mm for name, row in rows.items()}
    assert mean[FLOOR] < mean["trilateration"] < mean["voting-dijkstra"]
    assert mean["trilateration"] < mean["rigid-alignment"]
    assert mean["trilateration"] < 35


def test_the_table_names_every_row(rows):
    table = ladder_table(list(rows.values()))
    for name in (*LADDER, FLOOR):
        assert name in table
    assert len(table.splitlines()) == 1 + len(rows)


def test_rows_are_flat_for_json(rows):
    flat = rows["trilateration"].flat()
    assert all(isinstance(v, str | int | float) for v in flat.values())
    assert np.isfinite(flat["mean_mm"])


def test_no_body_of_the_test_split_was_tuned_on():
    assert not {p.shape for p in TEST_PAIRS} & {p.shape for p in TUNING_PAIRS}
    assert not {p.seed for p in TEST_PAIRS} & {p.seed for p in TUNING_PAIRS}


def test_an_evaluation_needs_pairs():
    with pytest.raises(InputError):
        SimulatedCases([])
