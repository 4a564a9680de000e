"""The colours and measures of the house style. One light, calm scheme; red is for errors alone."""

from __future__ import annotations

BACKGROUND = "#F5F7F8"
CARD = "#FFFFFF"
BORDER = "#E1E6E9"
BORDER_STRONG = "#C6D0D5"
TEXT = "#17242B"
SECONDARY = "#5B6B73"
FAINT = "#8A979D"
ACCENT = "#0F6E77"
ACCENT_HOVER = "#0C5C64"
ACCENT_PRESSED = "#094A51"
ACCENT_SOFT = "#E3F1F2"
ACCENT_LINE = "#B5D8DB"
AMBER = "#B7791F"
AMBER_SOFT = "#FBF3E3"
AMBER_LINE = "#E9CF9C"
RED = "#B3382C"
RED_SOFT = "#FBEBE9"
RED_LINE = "#E8BDB8"
GREEN = "#2E7D4F"
GREEN_SOFT = "#E6F3EB"
GREEN_LINE = "#B7DCC5"
INFO_SOFT = "#EAF1F4"
PHOTO_BACKGROUND = "#1D272C"

GRID = 8
"""Every distance in the windows is a multiple of this many pixels."""

RADIUS = 10
FONT_SIZE = 15

STATE_COLORS: dict[str, str] = {
    "confirmed": GREEN,
    "corrected": GREEN,
    "marked": ACCENT,
    "proposed": ACCENT,
    "uncertain": AMBER,
    "removed": FAINT,
}
"""Colour of a lesion marker by the state of its place."""


def qss_variables() -> dict[str, str]:
    """Name to value of every colour above, for the ``@NAME`` places of the style sheet."""
    return {name: value for name, value in globals().items() if name.isupper() and isinstance(value, str)}
