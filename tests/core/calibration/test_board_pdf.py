"""The printed board has exactly the size that calibration takes it to have."""

from __future__ import annotations

import re
import zlib
from base64 import a85decode

import numpy as np
import pytest

from core.calibration.board import PAPERS_M, BoardSpec
from core.calibration.board_pdf import black_rectangles, board_pdf
from core.errors import InputError

POINT_M = 0.0254 / 72


def drawing(data: bytes) -> str:
    """Page content, decompressed."""
    for match in re.finditer(rb"stream\r?\n(.*?)endstream", data, re.DOTALL):
        body = match.group(1).strip()
        if body.endswith(b"~>"):
            body = a85decode(body[:-2])
        try:
            text = zlib.decompress(body).decode("latin-1")
        except zlib.error:
            continue
        if " re\n" in text or " re " in text:
            return text
    raise AssertionError("no page content")


@pytest.mark.parametrize("paper", ["A4", "A3"])
def test_squares_are_drawn_at_exact_scale(paper: str) -> None:
    data, spec = board_pdf(paper), BoardSpec.for_paper(paper)
    box = re.search(rb"/MediaBox \[ ([\d. ]+) \]", data)
    assert box is not None
    page = np.array(box.group(1).split(), float)[2:] * POINT_M
    assert page == pytest.approx(PAPERS_M[paper], abs=2e-6)
    rectangles = (
        np.array(re.findall(r"([-\d.]+) ([-\d.]+) ([-\d.]+) ([-\d.]+) re", drawing(data)), float) * POINT_M
    )
    left, bottom = rectangles[:, 0].min(), rectangles[:, 1].min()
    right, top = (rectangles[:, :2] + rectangles[:, 2:]).max(axis=0)
    assert (right - left, top - bottom) == pytest.approx(spec.size_m, abs=2e-6)
    assert rectangles[:, 2:].prod(axis=1).sum() == pytest.approx(
        spec.modules().mean() * np.prod(spec.size_m), rel=1e-4
    )
    assert min(left, bottom, page[0] - right, page[1] - top) > 0.007, "printers leave 5 mm blank"


def test_what_is_drawn_is_the_board() -> None:
    spec = BoardSpec.for_paper("A4")
    drawn = np.zeros(spec.modules().shape, int)
    module = spec.square_m / 8
    for x, y, w, h in black_rectangles(spec):
        a, b, c, d = (round(v / module) for v in (x, y, w, h))
        drawn[b : b + d, a : a + c] += 1
    assert np.array_equal(drawn, spec.modules().astype(int)), "every black module once"


def test_a_board_that_does_not_fit_is_refused() -> None:
    with pytest.raises(InputError, match="does not fit"):
        board_pdf("A4", BoardSpec.for_paper("A3"))
    with pytest.raises(InputError, match="Choose A4 or A3"):
        board_pdf("Letter")
