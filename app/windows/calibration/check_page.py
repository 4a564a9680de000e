"""The daily check: ten seconds with the board before the first patient."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QVBoxLayout

from app.theme import icon_pixmap, palette, style_class
from app.widgets.status import MessageBanner
from app.windows.calibration.collect_page import _column
from app.windows.calibration.feed import Tick
from app.windows.calibration.parts import Page, button, card, label
from app.windows.calibration.pictures import BoardPicture
from app.windows.calibration.work import CHECK_S

if TYPE_CHECKING:
    from core.calibration.daily_check import CheckResult

_HEADLINES = {
    "ok": ("OK, nothing has moved", "success", palette.GREEN),
    "moved": ("The rig was moved: calibrate it again", "warning", palette.AMBER),
    "cannot tell": ("This could not be told", "info", palette.SECONDARY),
}


class CheckPage(Page):
    """Pictures, time and result of the daily check.

    Signals
    -------
    back(), again(), calibrate(), open_again(), done()
    room_changed(int, int)
    """

    back = Signal()
    again = Signal()
    calibrate = Signal()
    open_again = Signal()
    done = Signal()
    room_changed = Signal(int, int)

    def __init__(self) -> None:
        super().__init__("calibration_check_page")
        self.result: CheckResult | None = None
        self.banner = MessageBanner()
        self.banner.action_triggered.connect(lambda _key: self.open_again.emit())
        self.body.addWidget(self.banner)
        frame, column = card()
        row = QHBoxLayout()
        row.setSpacing(12)
        self.sign = QLabel()
        self.sign.setFixedWidth(36)
        self.headline = label("", "heading", "check_headline", wrap=True)
        self.text = label("", "secondary", "check_text", wrap=True)
        texts = QVBoxLayout()
        texts.setSpacing(4)
        texts.addWidget(self.headline)
        texts.addWidget(self.text)
        row.addWidget(self.sign)
        row.addLayout(texts, 1)
        column.addLayout(row)
        self.bar = QProgressBar()
        self.bar.setObjectName("check_bar")
        self.bar.setTextVisible(False)
        self.bar.setRange(0, 1000)
        column.addWidget(self.bar)
        self.numbers = label("", "caption", "check_numbers", wrap=True)
        column.addWidget(self.numbers)
        self.body.addWidget(frame)
        across = QHBoxLayout()
        across.setSpacing(16)
        self.color = BoardPicture("check_color", "Waiting for the colour picture")
        self.infrared = BoardPicture("check_infrared", "Waiting for the infrared picture")
        self.color_column = _column("Colour camera", self.color)
        across.addWidget(_column("Depth camera, infrared picture", self.infrared), 1)
        across.addWidget(self.color_column, 1)
        self.body.addLayout(across, 1)
        self.add_left(button("Back", "secondary", "check_back", self.back.emit))
        self.again_button = self.add_right(button("Check again", "secondary", "check_again", self.again.emit))
        self.calibrate_button = self.add_right(
            button("Calibrate", "secondary", "check_calibrate", self.calibrate.emit)
        )
        self.done_button = self.add_right(button("Done", "primary", "check_done", self.done.emit))

    def begin(self, *, has_color: bool, together: bool) -> None:
        """A new check."""
        self.result = None
        self.banner.clear()
        self.color_column.setVisible(has_color)
        for picture in (self.color, self.infrared):
            picture.clear()
        self.sign.setPixmap(icon_pixmap("target", 28, palette.ACCENT))
        style_class(self.done_button, "primary")
        self.primary = self.done_button
        self.headline.setText("Hold the board up before the cameras")
        self.text.setText(
            "Move it slowly across the picture and stop now and then; about a metre away."
            if together
            else "Lean it on something and leave it: this camera shows infrared or colour, not both."
        )
        self.numbers.setText("")
        self.bar.setValue(0)
        self.bar.show()
        self.again_button.hide()
        self.calibrate_button.hide()
        self.done_button.setEnabled(False)

    def show_tick(self, tick: Tick) -> None:
        """Show a frame, and the result when there is one."""
        if self.result is not None:
            return
        found = tick.findings
        if tick.color is not None or tick.infrared is not None:
            self.color.show_frame(tick.color, tick.color_corners)
            self.infrared.show_frame(tick.infrared, tick.infrared_corners)
        self.headline.setText(found.step.message)
        self.bar.setValue(min(1000, round(1000 * found.seconds / CHECK_S)))
        if found.check is not None:
            self._show_result(found.check)

    def _show_result(self, result: CheckResult) -> None:
        self.result = result
        headline, name, color = _HEADLINES[result.verdict]
        self.sign.setPixmap(icon_pixmap(name, 28, color))
        self.headline.setText(headline)
        self.text.setText(result.message)
        self.numbers.setText(_numbers(result))
        self.bar.hide()
        self.again_button.show()
        moved = result.verdict == "moved"
        self.calibrate_button.setVisible(moved)
        self.done_button.setEnabled(True)
        style_class(self.calibrate_button, "primary")
        style_class(self.done_button, "secondary" if moved else "primary")
        self.primary = self.calibrate_button if moved else self.done_button
        self.primary.setFocus(Qt.FocusReason.OtherFocusReason)

    def lost(self, message: str, advice: str) -> None:
        """The camera does not deliver any more."""
        self.banner.show_error(message, advice, [("open_again", "Open the camera again")])

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102
        super().resizeEvent(event)
        ratio = self.devicePixelRatioF()
        self.room_changed.emit(
            round(max(self.color.width(), self.infrared.width()) * ratio),
            round(max(self.color.height(), self.infrared.height()) * ratio),
        )


def _numbers(result: CheckResult) -> str:
    parts = [f"{result.views} views"]
    if result.shift_px == result.shift_px:
        parts.append(
            f"corners {result.shift_px:.1f} px from their place (moved from {result.limit_px:.0f} px on)"
        )
    if result.depth_error_mm == result.depth_error_mm:
        parts.append(
            f"depth {round(result.depth_error_mm):+d} mm (up to {result.depth_limit_mm:.0f} mm is normal)"
        )
    return "; ".join(parts)
