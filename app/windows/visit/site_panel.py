"""The verdict on a clicked site, large and in words; shape and word carry it, colour only helps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from app.theme import icon_pixmap, palette, style_class
from app.windows.visit.side_panel import wrapped

if TYPE_CHECKING:
    from core.relocation.site_check import SiteCheck

_ASK = "Click the site on the photo."
_CAUTION = "This is a measurement, not a release for a procedure: compare the patient's file and photographs."
_LOOKS = {
    "inside": ("Inside", "target", palette.ACCENT, "banner-info"),
    "outside": ("Outside", "close", palette.TEXT, "banner-warning"),
    "cannot tell": ("Cannot tell", "warning", palette.AMBER, "banner-warning"),
}


class SitePanel(QFrame):
    """What was measured at a site."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("site_panel")
        self._icon = QLabel()
        self.verdict = wrapped("", "title", "site_verdict")
        self.lesion = wrapped("", "strong", "site_lesion")
        self.figures = wrapped("", "strong", "site_figures")
        self.reason = wrapped("", "", "site_reason")
        self.caution = wrapped(_CAUTION, "caption", "site_caution")
        head = QHBoxLayout()
        head.setSpacing(12)
        head.addWidget(self._icon)
        head.addWidget(self.verdict, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 12, 16, 12)
        column.setSpacing(6)
        column.addLayout(head)
        for label in (self.lesion, self.figures, self.reason, self.caution):
            column.addWidget(label)
        self.hide()

    def ask(self, number: int) -> None:
        """Ask for the click."""
        style_class(self, "banner-info")
        self._icon.setPixmap(icon_pixmap("target", 30, palette.ACCENT))
        self.verdict.setText("Check a site")
        self.lesion.setText(f"Is it the site of lesion {number}?")
        self.figures.hide()
        self.reason.setText(_ASK)
        self.caution.hide()
        self.show()

    def show_check(self, number: int, check: SiteCheck) -> None:
        """Show the verdict."""
        word, symbol, color, style = _LOOKS[check.verdict]
        style_class(self, style)
        self._icon.setPixmap(icon_pixmap(symbol, 30, color))
        self.verdict.setText(word)
        self.lesion.setText(
            f"the region of lesion {number}"
            if check.verdict != "cannot tell"
            else f"whether this is the site of lesion {number}"
        )
        self.figures.setText(_figures(check))
        self.figures.setVisible(bool(self.figures.text()))
        self.reason.setText(check.reason)
        self.caution.show()
        self.show()


def _figures(check: SiteCheck) -> str:
    """Distances in millimetres, one to a line."""
    lines = []
    if check.distance_m is not None and check.border_m is not None:
        side = "outside" if check.border_m > 0 else "inside"
        lines.append(f"{_mm(check.distance_m)} from its centre, along the skin")
        lines.append(f"{_mm(abs(check.border_m))} {side} its border")
    if check.axes_m is not None:
        a, b = check.axes_m
        lines.append(f"Region (95 %): ±{_mm(a).removesuffix(' mm')} x {_mm(b)}")
    return "\n".join(lines)


def _mm(value_m: float) -> str:
    value = value_m * 1000
    return f"{value:.1f} mm" if value < 9.95 else f"{value:.0f} mm"
