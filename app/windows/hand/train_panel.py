"""Right side while training: the configuration, the points one after the other, saving, learning."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QComboBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.theme import palette, style_class
from app.widgets.forms import Field
from app.widgets.hand_colors import dot_icon
from app.windows.hand.parts import push
from app.workflows.hand_labelling import Labelling
from core.hand.model import LEAST_FRAMES
from core.hand.names import POINT_NAMES, spoken

_ROW = 25


class TrainPanel(QWidget):
    """See the module's documentation.

    Signals
    -------
    save_asked(), propose_asked(), learn_asked(), dataset_asked()
    """

    save_asked = Signal()
    propose_asked = Signal()
    learn_asked = Signal()
    dataset_asked = Signal()

    def __init__(self, labelling: Labelling, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._labelling = labelling
        self.configuration = QComboBox()
        self.configuration.setObjectName("hand_train_configuration")
        self.configuration.setAccessibleName("Configuration of the hand in this frame")
        self.configuration.setEditable(True)
        self.configuration.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
        edit = self.configuration.lineEdit()
        assert edit is not None
        edit.setPlaceholderText("For example: open")
        self.stored_name = ""
        self.field = Field("Configuration", self.configuration)
        edit.textEdited.connect(lambda _: self.field.set_error(""))
        self.next = QLabel()
        self.next.setObjectName("hand_train_next")
        self.next.setWordWrap(True)
        self.next.setTextFormat(Qt.TextFormat.PlainText)
        self.next.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.next.setFixedHeight(3 * self.next.fontMetrics().lineSpacing() + 4)
        self.list = QListWidget()
        self.list.setObjectName("hand_train_points")
        self.list.setAccessibleName("The 15 points, in the order in which they are clicked")
        self.list.setStyleSheet(
            f"QListView::item {{ min-height: {_ROW - 1}px; padding: 0 4px; border-radius: 4px; }}"
        )
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setIconSize(QSize(16, 16))
        for name in POINT_NAMES:
            self.list.addItem(QListWidgetItem(spoken(name).capitalize()))
        self.list.currentRowChanged.connect(self._on_row)
        self.skip = push("hand_train_skip", "Skip", "secondary", labelling.skip, "The point is hidden (S)")
        self.undo = push(
            "hand_train_undo", "Undo", "secondary", labelling.undo, "Take the last step back (Ctrl+Z)"
        )
        self.clear = push("hand_train_clear", "Clear", "secondary", labelling.clear, "Take all points away")
        self.propose = push(
            "hand_train_propose",
            "Propose",
            "secondary",
            self.propose_asked.emit,
            "Points as the model in use finds them, to be corrected (P)",
        )
        self.save = push(
            "hand_train_save", "Save", "primary", self.save_asked.emit, "Save, and go on (Ctrl+S)"
        )
        self.state = QLabel()
        self.state.setObjectName("hand_train_state")
        self.state.setWordWrap(True)
        style_class(self.state, "caption")
        self.dataset = QLabel()
        self.dataset.setObjectName("hand_train_dataset")
        self.dataset.setTextFormat(Qt.TextFormat.PlainText)
        style_class(self.dataset, "strong")
        self.counts = QLabel()
        self.counts.setObjectName("hand_train_counts")
        self.counts.setWordWrap(True)
        self.counts.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.counts.setTextFormat(Qt.TextFormat.PlainText)
        style_class(self.counts, "secondary")
        self.choose = push("hand_train_folder", "Folder…", "secondary", self.dataset_asked.emit)
        self.learn = push("hand_train_learn", "Learn", "primary", self.learn_asked.emit)
        self._lay_out()
        labelling.changed.connect(self.refresh)
        self.configuration.editTextChanged.connect(lambda _: self.refresh())
        self.refresh()

    def _lay_out(self) -> None:
        card = QFrame()
        style_class(card, "card")
        side = QVBoxLayout()
        side.setSpacing(8)
        for button in (self.skip, self.undo, self.clear, self.propose):
            button.setFixedWidth(112)
            side.addWidget(button)
        side.addStretch(1)
        side.addWidget(self.state)
        self.state.setFixedWidth(112)
        self.save.setFixedWidth(112)
        side.addWidget(self.save)
        middle = QHBoxLayout()
        middle.setSpacing(12)
        middle.addWidget(self.list, 1)
        middle.addLayout(side)
        column = QVBoxLayout(card)
        column.setContentsMargins(16, 12, 16, 12)
        column.setSpacing(8)
        column.addWidget(self.field)
        column.addWidget(self.next)
        column.addLayout(middle, 1)
        below = QFrame()
        style_class(below, "card")
        title = QHBoxLayout()
        title.addWidget(self.dataset, 1)
        title.addWidget(self.choose)
        title.addWidget(self.learn)
        lower = QVBoxLayout(below)
        lower.setContentsMargins(16, 10, 16, 10)
        lower.setSpacing(6)
        lower.addLayout(title)
        lower.addWidget(self.counts)
        self.counts.setFixedHeight(2 * self.counts.fontMetrics().lineSpacing() + 2)
        all_of_it = QVBoxLayout(self)
        all_of_it.setContentsMargins(0, 0, 0, 0)
        all_of_it.setSpacing(8)
        all_of_it.addWidget(card, 1)
        all_of_it.addWidget(below)

    # --- contents ----------------------------------------------------------------------------------------

    def name(self) -> str:
        """The configuration as typed or chosen."""
        return self.configuration.currentText().strip()

    def set_name(self, name: str) -> None:
        """The configuration of the frame shown."""
        self.configuration.setEditText(name)
        self.field.set_error("")

    def set_counts(self, title: str, counts: dict[str, int] | None, *, can_choose: bool) -> None:
        """What the dataset holds; None where there is no folder yet."""
        self.dataset.setText(title)
        self.choose.setVisible(can_choose)
        typed = self.configuration.currentText()
        self.configuration.clear()
        self.configuration.addItems(list(counts or {}))
        self.configuration.setEditText(typed)
        if counts is None:
            self.counts.setText("Choose a folder into which labelled frames are stored.")
        elif not counts:
            self.counts.setText("No frame is labelled yet.")
        else:
            told = "   ".join(f"{name}: {count}" for name, count in counts.items())
            few = min(counts.values()) < LEAST_FRAMES
            self.counts.setText(told + (f"\nEach needs at least {LEAST_FRAMES} frames." if few else ""))
        self.counts.setToolTip(self.counts.text())
        self.learn.setEnabled(bool(counts))

    def warn(self, sentence: str) -> None:
        """Say why a click was not taken, until the next one."""
        self.next.setText(sentence)
        self.next.setStyleSheet(f"color: {palette.AMBER}; font-weight: 600;")

    def set_proposing(self, on: bool) -> None:
        """Whether there is a model that could propose points."""
        self.propose.setVisible(on)

    def refresh(self) -> None:
        """Show the labelling as it is now."""
        lab = self._labelling
        placed, hidden = lab.places_m, lab.hidden
        self.list.blockSignals(True)
        for row, name in enumerate(POINT_NAMES):
            state = "open"
            if name in placed:
                state = "proposed" if name in lab.proposed else "placed"
            elif name in hidden:
                state = "hidden"
            item = self.list.item(row)
            item.setIcon(dot_icon(row, state))
            word = {"open": "", "hidden": ", hidden", "proposed": ", proposed", "placed": ""}[state]
            item.setText(f"{spoken(name).capitalize()}{word}")
            item.setForeground(_ink(state))
        self.list.setCurrentRow(-1 if lab.current is None else POINT_NAMES.index(lab.current))
        self.list.blockSignals(False)
        self._say_next()
        ready = lab.shot is not None and lab.skin is not None and lab.skin.surface is not None
        self.skip.setEnabled(ready and lab.current is not None)
        self.undo.setEnabled(lab.can_undo)
        self.clear.setEnabled(bool(placed or hidden))
        self.propose.setEnabled(ready)
        renamed = bool(self.stored_name) and self.name() != self.stored_name
        self.save.setEnabled(bool(placed) and (lab.unsaved or renamed))
        parts = [f"{len(placed)} placed"]
        if hidden:
            parts.append(f"{len(hidden)} hidden")
        if lab.open:
            parts.append(f"{len(lab.open)} open")
        self.state.setText("\n".join(parts))

    def _say_next(self) -> None:
        lab = self._labelling
        if lab.shot is None:
            text = "Open a sequence, or freeze the live picture, to label a frame."
        elif lab.skin is None:
            text = "Measuring the skin of this frame …"
        elif lab.skin.surface is None:
            text = f"This frame cannot be labelled: {lab.skin.reason}"
        elif lab.current is not None:
            text = f"Click on the {spoken(lab.current)}. If it is hidden, press Skip."
        elif lab.unsaved:
            text = "All points are there. Drag one to correct it, then save."
        else:
            text = "This frame is labelled and saved. Drag a point to correct it."
        if lab.proposed:
            text = f"{len(lab.proposed)} points are proposed. Drag those that are wrong, then save the frame."
        self.next.setText(text)
        self.next.setStyleSheet("")

    def _on_row(self, row: int) -> None:
        if row >= 0:
            self._labelling.select(POINT_NAMES[row])


def _ink(state: str) -> QColor:
    return QColor(palette.FAINT if state == "hidden" else palette.TEXT)
