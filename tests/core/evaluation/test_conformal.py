import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.errors import InputError
from core.evaluation.conformal import LEAST, conformal_quantile, read_residuals, region_factors


def row(error, radius, part="trunk", appearance="1", matched="1", visible="1", method="fused"):
    return {
        "method": method,
        "stance_class": "same stance",
        "part": part,
        "visible": visible,
        "appearance": appearance,
        "appearance_matched": matched,
        "error_m": error,
        "radius95_m": radius,
    }


@given(st.lists(st.floats(0.0, 10.0), min_size=20, max_size=200))
def test_at_least_the_wanted_share_lies_below_the_quantile(ratios):
    assert np.mean(np.array(ratios) <= conformal_quantile(ratios)) >= 0.95


def test_few_ratios_give_the_largest():
    assert conformal_quantile([0.2, 0.9, 0.5]) == 0.9


def test_regions_three_times_too_wide_are_told_to_shrink():
    rng = np.random.default_rng(0)
    rows = [row(f"{e:.6f}", "0.03") for e in 0.01 * np.sqrt(rng.uniform(0, 1, 400))]
    (factor,) = region_factors(rows, "fused")
    assert (factor.kind, factor.part, factor.answers, factor.held) == ("seen", "trunk", 400, 1.0)
    assert factor.factor == pytest.approx(np.sqrt(0.95) / 3, rel=0.05)


def test_small_parts_share_the_quantile_of_their_group():
    rows = [row("0.01", "0.01", "thigh")] * LEAST + [row("0.02", "0.01", "foot")]
    factors = {f.part: f for f in region_factors(rows, "fused")}
    assert not factors["thigh"].shared
    assert factors["thigh"].factor == pytest.approx(1.0)
    assert factors["lower leg"].shared
    assert factors["lower leg"].held == 0.0


def test_hidden_unanswered_and_other_methods_do_not_count():
    rows = [row("", ""), row("0.5", "0.01", visible="0"), row("0.5", "0.01", method="trilateration")]
    assert region_factors(rows, "fused") == []


def test_geometry_and_unmatched_answers_are_kinds_of_their_own():
    rows = [row("0.01", "0.01", appearance="0", matched="0"), row("0.01", "0.01", matched="0")]
    assert [f.kind for f in region_factors(rows, "fused")] == ["geometry", "matched"]


def test_a_table_without_a_needed_column_is_named(tmp_path):
    table = tmp_path / "r.csv"
    table.write_text("method,part\nfused,trunk\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"r\.csv.*stance_class"):
        read_residuals(table)
