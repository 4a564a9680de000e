"""Fourth page: what the calibration is good for, in plain words and in numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QVBoxLayout

from app.theme import icon_pixmap, palette, style_class
from app.widgets.tables import Column, RowTable
from app.windows.calibration.parts import Page, button, card, label
from app.windows.calibration.pictures import ResidualPicture
from app.windows.calibration.wording import HEADLINES, figures, parameter_rows

if TYPE_CHECKING:
    from app.windows.calibration.residuals import CornerResiduals
    from app.workflows.calibrating import CalibrationResult
    from core.calibration.profile import CalibrationProfile

_SIGNS = {
    "good": ("success", palette.GREEN),
    "usable": ("warning", palette.AMBER),
    "refused": ("error", palette.RED),
}
_MOST_LINES = 4


@dataclass(frozen=True, eq=False)
class Solved:
    """What the worker hands to the page."""

    result: CalibrationResult
    depth: CornerResiduals
    color: CornerResiduals | None
    next_version: int


class ResultPage(Page):
    """Verdict, figures, parameters, residuals.

    Signals
    -------
    save(), go_on(), done()
    """

    save = Signal()
    go_on = Signal()
    done = Signal()

    def __init__(self) -> None:
        super().__init__("calibration_result")
        self.solved: Solved | None = None
        head = QHBoxLayout()
        head.setSpacing(12)
        self.sign = QLabel()
        self.headline = label("", "heading", "result_headline")
        head.addWidget(self.sign)
        head.addWidget(self.headline)
        head.addStretch(1)
        self.views = label("", "secondary", "result_views")
        head.addWidget(self.views)
        self.body.addLayout(head)
        row = QHBoxLayout()
        row.setSpacing(16)
        self.figures: dict[str, tuple[QLabel, QLabel]] = {}
        for key in ("picture", "depth", "length"):
            frame, column = card()
            value, meaning = label("", "title", f"result_{key}"), label("", "caption", wrap=True)
            column.setSpacing(2)
            column.addWidget(value)
            column.addWidget(meaning)
            self.figures[key] = value, meaning
            row.addWidget(frame, 1)
        self.body.addLayout(row)
        columns = QHBoxLayout()
        columns.setSpacing(16)
        left = QVBoxLayout()
        left.setSpacing(8)
        self.reasons_title = label("", "strong", "result_reasons_title")
        self.reasons = label("", "", "result_reasons", wrap=True)
        self.missing_title = label("What is missing", "strong", "result_missing_title")
        self.missing = label("", "", "result_missing", wrap=True)
        for part in (self.reasons_title, self.reasons, self.missing_title, self.missing):
            left.addWidget(part)
        pictures = QHBoxLayout()
        pictures.setSpacing(16)
        self.depth_picture = ResidualPicture(
            "result_depth_residuals", "Infrared: corners against the calibration"
        )
        self.color_picture = ResidualPicture(
            "result_color_residuals", "Colour: corners against the calibration"
        )
        pictures.addWidget(self.depth_picture, 1)
        pictures.addWidget(self.color_picture, 1)
        left.addLayout(pictures, 1)
        columns.addLayout(left, 1)
        frame, column = card(margin=4)
        frame.setFixedWidth(540)
        self.table = RowTable(
            [Column("Parameter"), Column("Value", 120, True), Column("95 % within", 130, True)]
        )
        self.table.setObjectName("result_parameters")
        self.table.setAccessibleName("Parameters of the calibration")
        self.table.verticalHeader().setDefaultSectionSize(30)
        column.addWidget(self.table)
        columns.addWidget(frame)
        self.body.addLayout(columns, 1)
        self.saved = label("", "badge-green", "result_saved")
        self._row.addWidget(self.saved, 0, Qt.AlignmentFlag.AlignLeft)
        self.go_on_button = self.add_right(
            button("Go on collecting", "secondary", "result_go_on", self.go_on.emit)
        )
        self.save_button = self.add_right(button("Save", "primary", "result_save", self.save.emit))
        self.done_button = self.add_right(button("Done", "primary", "result_done", self.done.emit))

    def show_result(self, solved: Solved) -> None:
        """Show a calibration that is not saved yet."""
        self.solved = solved
        result = solved.result
        verdict, profile = result.verdict, result.profile
        name, color = _SIGNS[verdict.grade]
        self.sign.setPixmap(icon_pixmap(name, 28, color))
        self.headline.setText(HEADLINES[verdict.grade])
        left_out = len(result.views) - profile.views
        counted = f"{profile.views} views"
        self.views.setText(counted if not left_out else f"{counted}, {left_out} left out")
        for key, value, meaning in figures(verdict):
            self.figures[key][0].setText(value)
            if verdict.grade == "refused":
                meaning = f"{meaning}; not to be relied on"
            self.figures[key][1].setText(meaning)
        notes = [*verdict.reasons, *(n for n in profile.notes if n not in verdict.reasons)]
        self.reasons_title.setText(
            "Why it is refused" if verdict.grade == "refused" else "What to know about it"
        )
        self.reasons.setText("\n".join(notes[:_MOST_LINES]))
        missing = [_sentence(text) for text in verdict.missing[:_MOST_LINES]]
        self.missing.setText("\n".join(missing))
        for title, text in ((self.reasons_title, self.reasons), (self.missing_title, self.missing)):
            title.setVisible(bool(text.text()))
            text.setVisible(bool(text.text()))
        self.depth_picture.show_residuals(solved.depth.size, solved.depth.places, solved.depth.off)
        self.color_picture.setVisible(solved.color is not None)
        if solved.color is not None:
            self.color_picture.show_residuals(solved.color.size, solved.color.places, solved.color.off)
        self.table.set_rows(parameter_rows(profile))
        refused = verdict.grade == "refused"
        self.save_button.setText(f"Save as version {solved.next_version}")
        self.save_button.setVisible(not refused)
        self.go_on_button.setVisible(True)
        self.done_button.hide()
        self.saved.hide()
        style_class(self.go_on_button, "primary" if refused else "secondary")
        self.primary = self.go_on_button if refused else self.save_button

    def show_saved(self, profile: CalibrationProfile) -> None:
        """The calibration is kept."""
        self.saved.setText(f"Saved as version {profile.version}: new captures use it")
        self.saved.show()
        self.save_button.hide()
        self.go_on_button.hide()
        self.done_button.show()
        self.primary = self.done_button


def _sentence(text: str) -> str:
    return text if text.endswith(".") else f"{text}."
