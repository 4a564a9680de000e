"""Specification: a marker can be printed at its true size."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.hand.marker import find_markers
from tests.app.cli.cases import geoderm

POINTS_PER_M = 72 / 0.0254
DPI = 254


def test_the_black_square_has_the_side_that_was_asked_for(tmp_path: Path) -> None:
    out = tmp_path / "marker.pdf"
    outcome = geoderm("hand", "marker", out, "--marker-m", 0.05)
    assert (outcome.code, outcome.err) == (0, "")
    placed = re.findall(rb"([\d.]+) 0 0 ([\d.]+) [\d.]+ [\d.]+ cm", out.read_bytes())
    sides_m = [(float(across) / POINTS_PER_M, float(up) / POINTS_PER_M) for across, up in placed]
    assert max(sides_m) == pytest.approx((0.05, 0.05), abs=1e-5)


@pytest.mark.skipif(shutil.which("pdftoppm") is None, reason="needs pdftoppm to look at the page")
def test_the_printed_marker_is_found_with_its_number_and_size(tmp_path: Path) -> None:
    out, page = tmp_path / "marker.pdf", tmp_path / "page"
    assert geoderm("hand", "marker", out, "--dictionary", "DICT_5X5_50", "--number", 7).code == 0
    subprocess.run(["pdftoppm", "-r", str(DPI), "-png", "-singlefile", out, page], check=True)
    picture = cv2.imread(str(page.with_suffix(".png")))
    found = find_markers(np.ascontiguousarray(picture[:, :, ::-1]), "DICT_5X5_50")
    assert [marker.number for marker in found] == [7]
    assert found[0].side_px / DPI * 0.0254 == pytest.approx(0.036, abs=0.0002)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--marker-m", 0.2), "does not fit on A4"),
        (("--marker-m", 0.001), "side is between"),
        (("--dictionary", "DICT_NONE"), "no ArUco dictionary"),
        (("--number", 50), "markers 0 to 49"),
    ],
)
def test_what_cannot_be_printed_is_refused(arguments: tuple[object, ...], said: str, tmp_path: Path) -> None:
    out = tmp_path / "marker.pdf"
    outcome = geoderm("hand", "marker", out, *arguments)
    assert outcome.code == 2
    assert said in outcome.err
    assert not out.exists()
