"""An explanation shows every way that can be followed, and names those that cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.relocation import explain
from core.relocation.explain_draw import draw_explanation
from core.relocation.field_store import FIELDS
from core.relocation.pair import anchor_points


def test_a_way_that_cannot_be_followed_is_left_out_and_named(simulated_visits):
    one, two, queries = simulated_visits.first, simulated_visits.same, simulated_visits.queries
    whole = explain.explain_lesion(one, two, queries[0])
    assert whole is not None
    assert whole.untraced == whole.first_untraced == ()
    names = whole.anchor_names
    fields = FIELDS.fields(two.scan.surface, anchor_points(two, names), "virtual-source")
    flat = fields.distances.copy()
    flat[0] = 1.0  # distances that fall nowhere lead to no source
    broken = replace(fields, distances=flat)
    place = two.scan.surface.nearest(whole.answer_m)[0]
    paths, untraced = explain._paths(two, broken, place, "virtual-source")
    assert untraced == names[:1]
    assert set(paths) == set(names[1:])

    partly = replace(whole, paths=paths, untraced=untraced)
    before, after = (draw_explanation(e, one, two)["5-paths-followup"] for e in (whole, partly))
    assert not np.array_equal(before[:, -400:], after[:, -400:])  # the legend says so
