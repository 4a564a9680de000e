"""A printable ArUco marker at its true size, with a ruler that shows whether the printer scaled it."""

from __future__ import annotations

import io

MOST_SIDE_M = 0.15
"""A larger one does not fit a sheet beside its ruler."""

_MARGIN_MM = 30.0
_RULER_MM = 100
_CELL_PX = 20


def marker_sheet(dictionary: str, number: int, side_m: float) -> bytes:
    """A page of A4 as PDF.

    Parameters
    ----------
    dictionary : str
        Name of an ArUco dictionary (`core.hand.marker.dictionaries`).
    number : int
        Of the marker in it.
    side_m : float
        Of the black square.
    """
    import cv2
    from PIL import Image
    from reportlab.lib.pagesizes import A4
    from reportlab.lib.units import mm
    from reportlab.lib.utils import ImageReader
    from reportlab.pdfgen.canvas import Canvas

    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    picture = cv2.aruco.generateImageMarker(known, number, _CELL_PX * (known.markerSize + 2))
    content = io.BytesIO()
    page = Canvas(content, pagesize=A4, invariant=1, pageCompression=0)
    page.setTitle(f"Marker {number} of {dictionary}")
    side_mm = 1000 * side_m
    left, top = _MARGIN_MM * mm, A4[1] - _MARGIN_MM * mm
    page.drawImage(
        ImageReader(Image.fromarray(picture)), left, top - side_mm * mm, side_mm * mm, side_mm * mm
    )
    below = top - (side_mm + 15) * mm
    page.setLineWidth(0.3)
    for tick in range(_RULER_MM + 1):
        length = 5 if tick % 10 == 0 else 2.5
        page.line(left + tick * mm, below, left + tick * mm, below + length * mm)
    page.line(left, below, left + _RULER_MM * mm, below)
    page.setFont("Helvetica", 9)
    for tick in range(0, _RULER_MM + 1, 20):
        page.drawCentredString(left + tick * mm, below - 4 * mm, f"{tick}")
    page.drawString(left + (_RULER_MM + 4) * mm, below - 4 * mm, "mm")
    lines = (
        f"Marker {number} of {dictionary}, side of the black square {side_mm:g} mm.",
        "Print at 100 %. If the ruler is not 100 mm long, the printer has scaled the sheet:",
        "measure the black square and give its side when training (--marker-m, in metres).",
        "Cut it out with at least 5 mm of white all around.",
    )
    for number_of_line, line in enumerate(lines):
        page.drawString(left, below - (14 + 5 * number_of_line) * mm, line)
    page.save()
    return content.getvalue()
