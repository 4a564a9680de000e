"""The board as a PDF at exact scale: squares are drawn, not pictures of squares."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from core.calibration.board import PAPERS_M, BoardSpec
from core.errors import InputError

_RULER_M = 0.100
_MARGIN_M = 0.010
_TOP_M = 0.008
_FONT, _BOLD = "DejaVuSans", "DejaVuSans-Bold"


def board_pdf(paper: str = "A4", spec: BoardSpec | None = None) -> bytes:
    """One page with the board, a ruler to check the print, and how to print and measure it.

    Parameters
    ----------
    paper : str
        A4 or A3, landscape.
    spec : BoardSpec, optional
        By default the board of that paper.

    Raises
    ------
    InputError
        If the board does not fit the paper.
    """
    from reportlab.lib.units import mm
    from reportlab.pdfgen.canvas import Canvas

    name = paper.upper()
    if name not in PAPERS_M:
        raise InputError(f"There is no paper '{paper}'.", "Choose A4 or A3.")
    spec = spec or BoardSpec.for_paper(name)
    _register_fonts()
    page_w, page_h = PAPERS_M[name]
    board_w, board_h = spec.size_m
    if board_w > page_w - 2 * _MARGIN_M or board_h > page_h - 0.030:
        raise InputError(f"A board of {1000 * board_w:.0f} x {1000 * board_h:.0f} mm does not fit on {name}.")
    m = 1000 * mm
    out = io.BytesIO()
    canvas = Canvas(
        out, pagesize=(page_w * m, page_h * m), pageCompression=1, invariant=1, initialFontName=_FONT
    )
    canvas.setTitle(f"GeoDerm calibration board, {name}")
    canvas.setAuthor("GeoDerm")
    canvas.setSubject(
        f"ChArUco board {spec.squares_x} x {spec.squares_y}, squares of {1000 * spec.square_m:.2f} mm"
    )
    # No scaling by the viewer's print dialog, where viewers heed it.
    canvas.setViewerPreference("PrintScaling", "None")
    left, top = (page_w - board_w) / 2, page_h - _TOP_M
    canvas.setFillGray(0)
    path = canvas.beginPath()
    for x, y, w, h in black_rectangles(spec):
        path.rect((left + x) * m, (top - y - h) * m, w * m, h * m)
    canvas.drawPath(path, stroke=0, fill=1)
    _foot(canvas, spec, name, left, top - board_h, m)
    canvas.showPage()
    canvas.save()
    return out.getvalue()


def black_rectangles(spec: BoardSpec) -> list[tuple[float, float, float, float]]:
    """What is black: left, top, width, height in metres from the board's top left corner, none overlapping.

    Runs of black modules in a row are joined, and equal runs of successive rows, so that no hairlines of
    paper show between them.
    """
    black = spec.modules()
    module = spec.square_m / 8
    open_runs: dict[tuple[int, int], int] = {}
    found: list[tuple[int, int, int, int]] = []
    for row in range(len(black) + 1):
        runs: set[tuple[int, int]] = set()
        if row < len(black):
            edges = np.flatnonzero(np.diff(np.pad(black[row].astype(np.int8), 1)))
            runs = {(int(a), int(b)) for a, b in edges.reshape(-1, 2)}
        for run in [r for r in open_runs if r not in runs]:
            first = open_runs.pop(run)
            found.append((run[0], first, run[1] - run[0], row - first))
        for run in runs:
            open_runs.setdefault(run, row)
    return [(x * module, y * module, w * module, h * module) for x, y, w, h in sorted(found)]


def _foot(canvas: Any, spec: BoardSpec, paper: str, left: float, bottom: float, m: float) -> None:
    """Ruler and instructions under the board."""
    room = bottom - 0.006
    big = paper == "A3"
    size, line = (9.0, 0.0046) if big else (7.0, 0.0036)
    ruler_y = room - (0.008 if big else 0.006)
    canvas.setStrokeGray(0)
    canvas.setLineWidth(0.4)
    canvas.line(left * m, ruler_y * m, (left + _RULER_M) * m, ruler_y * m)
    for k in range(101):
        height = 0.004 if k % 10 == 0 else (0.003 if k % 5 == 0 else 0.0018)
        x = (left + k / 1000) * m
        canvas.line(x, ruler_y * m, x, (ruler_y + height) * m)
    canvas.setFont(_FONT, size - 1)
    for k in range(0, 101, 20):
        canvas.drawCentredString((left + k / 1000) * m, (ruler_y - 0.0032) * m, str(k))
    canvas.drawString((left + _RULER_M + 0.003) * m, ruler_y * m, "mm")
    canvas.setFont(_BOLD, size)
    canvas.drawString(left * m, (ruler_y - 0.0032 - 1.2 * line) * m, "GeoDerm calibration board")
    width = 1000 * spec.size_m[0]
    canvas.setFont(_FONT, size - 1)
    canvas.drawString(
        left * m,
        (ruler_y - 0.0032 - 2.15 * line) * m,
        f"{paper}   ChArUco {spec.squares_x} x {spec.squares_y}   {spec.dictionary}   "
        f"square {1000 * spec.square_m:.2f} mm, marker {1000 * spec.marker_m:.2f} mm",
    )
    text = canvas.beginText((left + _RULER_M + 0.016) * m, (room - 0.002) * m)
    text.setFont(_FONT, size)
    text.setLeading(line * m)
    for words in (
        "1. Print at 100 % (“actual size”), without “fit to page”, on matt paper.",
        f"2. Measure the ruler. Then measure the whole row of {spec.squares_x} squares: "
        f"{width:.1f} mm if the printer is exact.",
        f"3. Enter one square as measured: that length divided by {spec.squares_x} "
        f"({1000 * spec.square_m:.2f} mm if exact).",
        "4. Glue it flat on a stiff board (glass, aluminium composite, foam board). "
        "A bent board spoils the calibration.",
        "5. Keep a white margin around the squares; do not laminate: reflections hide corners.",
    ):
        text.textLine(words)
    canvas.drawText(text)


def _register_fonts() -> None:
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    from resources import resource_path

    for name in (_FONT, _BOLD):
        if name not in pdfmetrics.getRegisteredFontNames():
            pdfmetrics.registerFont(TTFont(name, str(resource_path("fonts", f"{name}.ttf"))))
