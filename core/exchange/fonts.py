"""The typeface of printed pages: DejaVu Sans, embedded, with every Latin, Greek and Cyrillic accent."""

from __future__ import annotations

import unicodedata
from functools import lru_cache
from typing import TYPE_CHECKING

from resources import resource_path

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

REGULAR, BOLD, ITALIC = "DejaVuSans", "DejaVuSans-Bold", "DejaVuSans-Oblique"


@lru_cache(maxsize=1)
def register_pdf_fonts() -> None:
    """Make the family known to reportlab; later calls cost nothing."""
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    for name in (REGULAR, BOLD, ITALIC):
        pdfmetrics.registerFont(TTFont(name, str(resource_path("fonts", f"{name}.ttf"))))
    pdfmetrics.registerFontFamily(REGULAR, normal=REGULAR, bold=BOLD, italic=ITALIC, boldItalic=BOLD)


@lru_cache(maxsize=16)
def picture_font(size: int, *, bold: bool = True) -> FreeTypeFont:
    """The same family for drawing on pictures."""
    from PIL import ImageFont

    return ImageFont.truetype(str(resource_path("fonts", f"{BOLD if bold else REGULAR}.ttf")), size)


def printable(text: str) -> str:
    """Text with composed accents, so that one glyph stands for one letter."""
    return unicodedata.normalize("NFC", text)
