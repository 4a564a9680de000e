"""Colours, sizes and paragraph styles of printed pages."""

from __future__ import annotations

from functools import lru_cache
from typing import Any
from xml.sax.saxutils import escape

from reportlab.lib.colors import HexColor
from reportlab.lib.enums import TA_CENTER, TA_RIGHT
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.platypus import Paragraph

from core.exchange.fonts import BOLD, REGULAR, printable, register_pdf_fonts

TEAL = HexColor(0x0F6E77)
TEAL_PALE = HexColor(0xE8F2F3)
INK = HexColor(0x1E2A2E)
GREY = HexColor(0x5F6E73)
LINE = HexColor(0xD5DEE0)
PALE = HexColor(0xF4F7F7)
AMBER = HexColor(0x9A5B00)

PAGE_WIDTH, PAGE_HEIGHT = A4
MARGIN = 16 * mm
CONTENT = PAGE_WIDTH - 2 * MARGIN


@lru_cache(maxsize=1)
def styles() -> dict[str, Any]:
    """Paragraph styles by name."""
    register_pdf_fonts()
    body = ParagraphStyle(
        "body", fontName=REGULAR, fontSize=8.4, leading=11.8, textColor=INK, splitLongWords=1
    )
    return {
        "body": body,
        "small": ParagraphStyle("small", body, fontSize=7.2, leading=9.8, textColor=GREY),
        "fact": ParagraphStyle("fact", body, fontSize=7.8, leading=10.4),
        "factlabel": ParagraphStyle("factlabel", body, fontSize=7.8, leading=10.4, textColor=GREY),
        "note": ParagraphStyle("note", body, fontSize=7.8, leading=11, spaceBefore=2),
        "label": ParagraphStyle("label", body, fontSize=6.8, leading=9, textColor=GREY),
        "value": ParagraphStyle("value", body, fontSize=9, leading=12),
        "strong": ParagraphStyle("strong", body, fontName=BOLD),
        "title": ParagraphStyle("title", body, fontName=BOLD, fontSize=17, leading=22, textColor=INK),
        "name": ParagraphStyle("name", body, fontName=BOLD, fontSize=12.5, leading=16),
        "section": ParagraphStyle(
            "section", body, fontName=BOLD, fontSize=11, leading=14, textColor=TEAL, spaceAfter=5
        ),
        "site": ParagraphStyle("site", body, fontName=BOLD, fontSize=9.6, leading=12.6),
        "chip": ParagraphStyle("chip", body, fontName=BOLD, fontSize=7.6, leading=10, alignment=TA_RIGHT),
        "caption": ParagraphStyle(
            "caption", body, fontSize=6.9, leading=9, textColor=GREY, alignment=TA_CENTER
        ),
        "head": ParagraphStyle("head", body, fontName=BOLD, fontSize=7.2, leading=9.4, textColor=GREY),
        "right": ParagraphStyle("right", body, alignment=TA_RIGHT),
        "headright": ParagraphStyle(
            "headright", body, fontName=BOLD, fontSize=7.2, leading=9.4, textColor=GREY, alignment=TA_RIGHT
        ),
    }


def words(text: str, style: str = "body", *, color: Any = None) -> Any:
    """A paragraph of plain text: markup signs in it are printed, line breaks are kept."""
    inner = escape(printable(text)).replace("\t", "    ").replace("\n", "<br/>")
    if color is not None:
        inner = f'<font color="#{color.hexval()[2:]}">{inner}</font>'
    return Paragraph(inner, styles()[style])


def labelled(label: str, text: str) -> Any:
    """A paragraph that begins with a grey label."""
    inner = escape(printable(text)).replace("\t", "    ").replace("\n", "<br/>")
    grey = f'<font color="#{GREY.hexval()[2:]}">{escape(label)}:</font>'
    return Paragraph(f"{grey} {inner}", styles()["note"])
