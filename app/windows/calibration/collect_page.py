"""Third page: hold the board up, follow the guidance, and watch the views come in."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtGui import QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QVBoxLayout, QWidget

from app.theme import icon_pixmap, palette, style_class
from app.widgets.status import MessageBanner
from app.widgets.tables import Column, Row, RowTable
from app.windows.calibration.feed import Tick
from app.windows.calibration.parts import Page, button, card, label
from app.windows.calibration.pictures import BoardPicture, CoverageGauge
from app.windows.calibration.wording import rms_in_words
from app.windows.calibration.work import Findings
from app.workflows.calibrating import Outcome

_SIDE_W = 404
_SIGNS = {
    Outcome.NOTHING: ("info", palette.SECONDARY),
    Outcome.REFUSED: ("move", palette.AMBER),
    Outcome.HOLD: ("clock", palette.ACCENT),
    Outcome.ADDED: ("success", palette.GREEN),
}


class CollectPage(Page):
    """Pictures, guidance, coverage and the list of views.

    Signals
    -------
    take_now(), remove_view(int), solve(), back(), open_again()
    room_changed(int, int)
        Device pixels that a picture may take.
    """

    take_now = Signal()
    remove_view = Signal(int)
    solve = Signal()
    back = Signal()
    open_again = Signal()
    room_changed = Signal(int, int)

    def __init__(self) -> None:
        super().__init__("calibration_collect")
        self.findings: Findings | None = None
        self.banner = MessageBanner()
        self.banner.action_triggered.connect(lambda _key: self.open_again.emit())
        self.body.addWidget(self.banner)
        self.body.addWidget(self._guidance_card())
        across = QHBoxLayout()
        across.setSpacing(16)
        self.color = BoardPicture("calibration_color", "Waiting for the colour picture")
        self.infrared = BoardPicture("calibration_infrared", "Waiting for the infrared picture")
        self._together, self._gone = True, False
        self.color_gauge = CoverageGauge("calibration_color_gauge")
        self.infrared_gauge = CoverageGauge("calibration_infrared_gauge")
        self.color_column = _column("Colour camera", self.color, self.color_gauge)
        self.infrared_column = _column("Depth camera, infrared picture", self.infrared, self.infrared_gauge)
        across.addWidget(self.infrared_column, 1)
        across.addWidget(self.color_column, 1)
        across.addWidget(self._side())
        self.body.addLayout(across, 1)
        self.add_left(button("Back", "secondary", "collect_back", self.back.emit))
        self.take_button = self.add_right(
            button("Take this view", "secondary", "collect_take", self.take_now.emit)
        )
        self.take_button.setToolTip("Keep the view as it is now (Space)")
        self.solve_button = self.add_right(button("Calibrate", "primary", "collect_solve", self.solve.emit))
        self.begin(has_color=True, together=True)

    def _guidance_card(self) -> QWidget:
        frame, column = card()
        row = QHBoxLayout()
        row.setSpacing(12)
        self.sign = QLabel()
        self.sign.setFixedWidth(32)
        self.message = label("", "heading", "collect_message", wrap=True)
        self.message.setMinimumHeight(28)
        self.wish = label("", "secondary", "collect_wish", wrap=True)
        texts = QVBoxLayout()
        texts.setSpacing(2)
        texts.addWidget(self.message)
        texts.addWidget(self.wish)
        self.counter = label("", "title", "collect_counter")
        self.bar = QProgressBar()
        self.bar.setObjectName("collect_bar")
        self.bar.setTextVisible(False)
        self.bar.setFixedWidth(140)
        count = QVBoxLayout()
        count.setSpacing(6)
        count.addWidget(self.counter, 0, Qt.AlignmentFlag.AlignHCenter)
        count.addWidget(self.bar)
        row.addWidget(self.sign)
        row.addLayout(texts, 1)
        row.addSpacing(16)
        row.addLayout(count)
        column.addLayout(row)
        return frame

    def _side(self) -> QWidget:
        side = QWidget()
        side.setFixedWidth(_SIDE_W)
        column = QVBoxLayout(side)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(8)
        self.rms = label("", "caption", "collect_rms", wrap=True)
        column.addWidget(self.rms)
        frame, inner = card(margin=4)
        self.views = RowTable([Column("#", 54), Column("Where"), Column("Tilt", 138), Column("m", 54)])
        self.views.setObjectName("collect_views")
        self.views.setAccessibleName("Views taken")
        self.views.verticalHeader().setDefaultSectionSize(34)
        self.views.selected_changed.connect(self._on_selected)
        inner.addWidget(self.views)
        column.addWidget(frame, 1)
        self.remove_button = button("Remove view", "quiet", "collect_remove", self._remove)
        self.remove_button.setToolTip("Take the selected view out again (Delete)")
        column.addWidget(self.remove_button, 0, Qt.AlignmentFlag.AlignLeft)
        return side

    def begin(self, *, has_color: bool, together: bool) -> None:
        """A new collection."""
        self.findings = None
        self.banner.clear()
        for picture in (self.color, self.infrared):
            picture.clear()
        self.color_column.setVisible(has_color)
        self.take_button.setVisible(together)
        self.views.set_rows([])
        self._say(Outcome.NOTHING, "Hold the board before the cameras.")
        self.wish.setText(
            "The views are taken by themselves whenever the board is still."
            if together
            else "This camera shows infrared or colour, not both: lean the board on something and leave it "
            "until the view is taken. The camera changes over by itself."
        )
        self.counter.setText("0")
        self.bar.setValue(0)
        self.rms.setText("Error of the corners: " + rms_in_words({}))
        self._together, self._gone = together, False
        self._refresh()

    def show_tick(self, tick: Tick) -> None:
        """Show a frame and what was found in it."""
        added = tick.findings.step.outcome is Outcome.ADDED
        if tick.color is not None or tick.infrared is not None:
            self.color.show_frame(tick.color, tick.color_corners)
            self.infrared.show_frame(tick.infrared, tick.infrared_corners)
            self.banner.clear()
        if added:
            for picture in (self.color, self.infrared):
                picture.flash()
        self._show_findings(tick.findings)

    def _show_findings(self, found: Findings) -> None:
        before, self.findings = self.findings, found
        self._say(found.step.outcome, found.step.message)
        self.counter.setText(f"{len(found.rows)} of {found.wanted}")
        self.bar.setRange(0, 100)
        self.bar.setValue(min(100, round(100 * len(found.rows) / found.wanted)))
        if before is None or before.rows != found.rows or before.coverage is not found.coverage:
            self.views.set_rows(
                [
                    Row(str(r.number), (str(r.number), r.place, r.tilt, r.distance.removesuffix(" m")))
                    for r in found.rows
                ]
            )
            if found.rows:
                self.views.scrollToBottom()
            self.infrared.show_coverage(found.coverage.infrared)
            self.infrared_gauge.show_coverage(found.coverage.infrared)
            self.color.show_coverage(found.coverage.color)
            if found.coverage.color is not None:
                self.color_gauge.show_coverage(found.coverage.color)
        if self._together:
            said = found.step.message
            missing = [text for text in found.coverage.missing() if text not in said]
            if found.ready:
                self.wish.setText("There is enough of everything: calibrate.")
            else:
                self.wish.setText(f"Also wanted: {_small(missing[0])}." if missing else "")
        self.rms.setText(f"Error of the corners: {rms_in_words(found.rms_px)}")
        self._gone = False
        self._refresh()

    def lost(self, message: str, advice: str) -> None:
        """The camera does not deliver any more."""
        self.banner.show_error(message, advice, [("open_again", "Open the camera again")])
        for picture in (self.color, self.infrared):
            picture.show_gone()
        self._say(Outcome.NOTHING, "The camera is not there.")
        self.wish.setText("The views taken so far are kept.")
        self._gone = True
        self._refresh()

    def _say(self, outcome: Outcome, message: str) -> None:
        name, color = _SIGNS[outcome]
        self.sign.setPixmap(icon_pixmap(name, 26, color))
        self.message.setText(message)

    @Slot()
    def _on_selected(self, _key: str = "") -> None:
        self._refresh()

    def _refresh(self) -> None:
        found = self.findings
        self.solve_button.setEnabled(found is not None and found.can_solve)
        self.solve_button.setToolTip("" if self.solve_button.isEnabled() else "Possible from six views on")
        self.take_button.setEnabled(found is not None and not self._gone)
        self.remove_button.setEnabled(self.views.selected() is not None)

    def _remove(self) -> None:
        key = self.views.selected()
        if key is not None:
            self.views.set_selected(None)
            self.remove_view.emit(int(key))

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102
        if event.key() == Qt.Key.Key_Space and self.take_button.isVisible() and self.take_button.isEnabled():
            self.take_now.emit()
        elif event.key() == Qt.Key.Key_Delete and self.remove_button.isEnabled():
            self._remove()
        else:
            super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102
        super().resizeEvent(event)
        ratio = self.devicePixelRatioF()
        self.room_changed.emit(
            round(max(self.color.width(), self.infrared.width()) * ratio),
            round(max(self.color.height(), self.infrared.height()) * ratio),
        )


def _small(text: str) -> str:
    return text[:1].lower() + text[1:]


def _column(title: str, picture: BoardPicture, below: QWidget | None = None) -> QWidget:
    made = QWidget()
    column = QVBoxLayout(made)
    column.setContentsMargins(0, 0, 0, 0)
    column.setSpacing(4)
    heading = label(title, "field")
    style_class(heading, "field")
    column.addWidget(heading)
    column.addWidget(picture, 1)
    if below is not None:
        column.addSpacing(4)
        column.addWidget(below)
    column.addStretch(0)
    return made
