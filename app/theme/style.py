"""Fonts, palette and style sheet of the application."""

from __future__ import annotations

import re

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QFont, QFontDatabase, QPalette
from PySide6.QtWidgets import QApplication, QStyleFactory, QWidget

from app.theme import palette
from resources import resource_path

_FAMILY = "Inter"
_FALLBACK = "DejaVu Sans"


def _load_fonts() -> list[str]:
    for path in sorted(resource_path("fonts", "ui").glob("*.otf")):
        QFontDatabase.addApplicationFont(str(path))
    known = set(QFontDatabase.families())
    return [family for family in (_FAMILY, _FALLBACK) if family in known]


def _qpalette() -> QPalette:
    p = QPalette()
    roles = QPalette.ColorRole
    for role, color in (
        (roles.Window, palette.BACKGROUND),
        (roles.WindowText, palette.TEXT),
        (roles.Base, palette.CARD),
        (roles.AlternateBase, palette.BACKGROUND),
        (roles.Text, palette.TEXT),
        (roles.Button, palette.CARD),
        (roles.ButtonText, palette.TEXT),
        (roles.Highlight, palette.ACCENT),
        (roles.HighlightedText, "#FFFFFF"),
        (roles.ToolTipBase, palette.TEXT),
        (roles.ToolTipText, "#FFFFFF"),
        (roles.PlaceholderText, palette.FAINT),
        (roles.Link, palette.ACCENT),
    ):
        p.setColor(role, QColor(color))
    for role in (roles.Text, roles.WindowText, roles.ButtonText):
        p.setColor(QPalette.ColorGroup.Disabled, role, QColor(palette.FAINT))
    return p


def _style_sheet() -> str:
    text = resource_path("style", "geoderm.qss").read_text(encoding="utf-8")
    values = palette.qss_variables() | {"STYLE": resource_path("style").as_posix()}
    return re.sub(r"@([A-Z_]+)", lambda match: values[match.group(1)], text)


def apply_theme(app: QApplication) -> None:
    """Give ``app`` the house fonts, palette and style sheet. Call it once, before any window is made."""
    app.setStyle(QStyleFactory.create("Fusion"))
    app.setPalette(_qpalette())
    font = QFont()
    font.setFamilies(_load_fonts() or [font.family()])
    font.setPixelSize(palette.FONT_SIZE)
    font.setHintingPreference(QFont.HintingPreference.PreferNoHinting)
    app.setFont(font)
    app.setEffectEnabled(Qt.UIEffect.UI_AnimateCombo, False)
    app.setStyleSheet(_style_sheet())


def style_class(widget: QWidget, name: str) -> QWidget:
    """Give ``widget`` a style class of the style sheet, and return it."""
    widget.setProperty("class", name)
    _repolish(widget)
    return widget


def set_state(widget: QWidget, name: str, value: str | bool) -> None:
    """Set a dynamic property the style sheet looks at (for example ``invalid``)."""
    if widget.property(name) != value:
        widget.setProperty(name, value)
        _repolish(widget)


def _repolish(widget: QWidget) -> None:
    style = widget.style()
    style.unpolish(widget)
    style.polish(widget)
    widget.update()
