"""The sheet "Options": how hands are tracked, and the marker that new models are learned with."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QComboBox, QGridLayout, QLabel, QLineEdit, QWidget

from app.theme import set_state, style_class
from app.widgets.forms import Field, line_edit
from app.widgets.sheet import Sheet
from app.workflows.hand_settings import (
    LARGEST_MARKER_M,
    LARGEST_THRESHOLD_M,
    MOST_LOST_FRAMES,
    SMALLEST_MARKER_M,
    HandSettings,
    check_dictionary,
    read_count,
    read_millimetres,
)
from core.errors import InputError
from core.hand.marker import dictionaries

_REFINEMENTS = (
    ("joint", "All points together"),
    ("sequential", "One after the other (thesis)"),
)
_ANCHORS = (("marker", "ArUco marker"), ("palm", "Palm, without a marker"))


class OptionsSheet(Sheet):
    """See the module's documentation.

    Parameters
    ----------
    parent : QWidget
    settings : HandSettings
    accepted : callable
        Called with the new settings.
    """

    def __init__(
        self, parent: QWidget, settings: HandSettings, accepted: Callable[[HandSettings], object]
    ) -> None:
        super().__init__(parent, "Options", "hand_options", width=640)
        self._accepted = accepted
        self.refinement = _combo("hand_refinement", _REFINEMENTS, settings.refinement)
        self.threshold = Field(
            "Error threshold in mm",
            line_edit("hand_threshold"),
            "A point that disagrees with the model by more is not shown.",
        )
        self.lost = Field(
            "Frames without marker",
            line_edit("hand_lost_frames"),
            "For so many frames the marker may be lost.",
        )
        self.anchors = _combo("hand_anchors", _ANCHORS, settings.anchors)
        self.marker = Field(
            "Side of the marker in mm", line_edit("hand_marker_side"), "Of its black square, as printed."
        )
        self.dictionary = QComboBox()
        self.dictionary.setObjectName("hand_dictionary")
        self.dictionary.setEditable(True)
        self.dictionary.addItems(list(dictionaries()))
        self.dictionary.setCurrentText(settings.dictionary)
        self.dictionary.setMaxVisibleItems(12)
        self.dictionary_field = Field("ArUco dictionary", self.dictionary)
        self._set(self.threshold, f"{1000 * settings.threshold_m:g}")
        self._set(self.lost, str(settings.lost_frames))
        self._set(self.marker, f"{1000 * settings.marker_m:g}")
        grid = QGridLayout()
        grid.setHorizontalSpacing(20)
        grid.setVerticalSpacing(10)
        grid.setColumnStretch(0, 1)
        grid.setColumnStretch(1, 1)
        grid.addWidget(_heading("Tracking"), 0, 0, 1, 2)
        grid.addWidget(Field("Points are refined", self.refinement), 1, 0)
        grid.addWidget(self.threshold, 1, 1)
        grid.addWidget(self.lost, 2, 0)
        grid.addWidget(_heading("New models"), 3, 0, 1, 2)
        grid.addWidget(Field("Distances are measured from", self.anchors), 4, 0)
        grid.addWidget(self.marker, 4, 1)
        grid.addWidget(self.dictionary_field, 5, 0)
        note = QLabel("A model that is in use keeps the anchors, marker and dictionary it was learned with.")
        note.setWordWrap(True)
        style_class(note, "caption")
        grid.addWidget(note, 5, 1)
        self.body.addLayout(grid)
        self.anchors.currentIndexChanged.connect(self._anchors_changed)
        self._anchors_changed()
        self.add_button("Cancel", "secondary", self.close_sheet, "hand_options_cancel")
        self.add_button("Use", "primary", self._use, "hand_options_use")

    def _set(self, field: Field, text: str) -> None:
        assert isinstance(field.editor, QLineEdit)
        field.editor.setText(text)

    def _text(self, field: Field) -> str:
        assert isinstance(field.editor, QLineEdit)
        return field.editor.text()

    def _anchors_changed(self) -> None:
        marker = self.anchors.currentData() == "marker"
        self.marker.setEnabled(marker)
        self.dictionary_field.setEnabled(marker)

    def _use(self) -> None:
        """Take the fields over; what is wrong is told at its field."""
        values: dict[str, float | int | str] = {}
        good = True
        for field, key, read in (
            (
                self.threshold,
                "threshold_m",
                lambda t: read_millimetres(t, "The threshold", 0.001, LARGEST_THRESHOLD_M),
            ),
            (self.lost, "lost_frames", lambda t: read_count(t, "The number of frames", MOST_LOST_FRAMES)),
            (
                self.marker,
                "marker_m",
                lambda t: read_millimetres(t, "The side of the marker", SMALLEST_MARKER_M, LARGEST_MARKER_M),
            ),
        ):
            try:
                values[key] = read(self._text(field))
                field.set_error("")
            except InputError as error:
                field.set_error(str(error))
                good = False
        try:
            values["dictionary"] = check_dictionary(self.dictionary.currentText().strip())
            self.dictionary_field.set_error("")
        except InputError as error:
            self.dictionary_field.set_error(str(error))
            set_state(self.dictionary, "invalid", "true")
            good = False
        if not good:
            return
        settings = HandSettings(
            refinement=self.refinement.currentData(),
            anchors=self.anchors.currentData(),
            **values,  # type: ignore[arg-type]
        )
        self.close_sheet()
        self._accepted(settings)


def _combo(name: str, choices: tuple[tuple[str, str], ...], chosen: str) -> QComboBox:
    box = QComboBox()
    box.setObjectName(name)
    for key, text in choices:
        box.addItem(text, key)
    box.setCurrentIndex(max(box.findData(chosen), 0))
    return box


def _heading(text: str) -> QLabel:
    label = QLabel(text)
    style_class(label, "strong")
    return label
