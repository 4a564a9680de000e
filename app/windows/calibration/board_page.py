"""Second page: print the board and measure it."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QSizePolicy, QVBoxLayout, QWidget

from app.theme import palette, set_state, style_class
from app.widgets.forms import Field, line_edit
from app.windows.calibration.board_choice import BoardChoice, read_width
from app.windows.calibration.parts import Page, button, card, label

PAPERS = ("A3", "A4")
_FITS = {
    "A3": "Better for rigs that stand 1.5 m or more from the patient. Glue it on something stiff and flat.",
    "A4": "For rigs at less than 1.5 m. Glue it on something stiff and flat, such as a clipboard.",
}


class BoardPage(Page):
    """Paper, PDF and the measured width.

    Signals
    -------
    save_pdf(str)
        For a paper.
    ready(object)
        A measured `BoardChoice`.
    back()
    """

    save_pdf = Signal(str)
    ready = Signal(object)
    back = Signal()

    def __init__(self) -> None:
        super().__init__("calibration_board")
        self._paper = PAPERS[0]
        columns = QHBoxLayout()
        columns.setSpacing(32)
        steps = QVBoxLayout()
        steps.setSpacing(16)
        steps.addWidget(label("1   Choose the paper", "strong"))
        papers = QHBoxLayout()
        papers.setSpacing(0)
        self._papers: dict[str, QPushButton] = {}
        for paper in PAPERS:
            made = button(paper, "segment", f"board_paper_{paper}", lambda p=paper: self.choose(p))
            made.setCheckable(True)
            made.setMinimumWidth(90)
            set_state(made, "first", "true" if paper == PAPERS[0] else "false")
            set_state(made, "last", "true" if paper == PAPERS[-1] else "false")
            self._papers[paper] = made
            papers.addWidget(made)
        papers.addStretch(1)
        steps.addLayout(papers)
        self.fits = label("", "caption", "board_fits", wrap=True)
        steps.addWidget(self.fits)
        steps.addSpacing(16)
        steps.addWidget(label("2   Print it at 100 %, without fitting it to the page", "strong"))
        self.save = button("Save the board as PDF", "secondary", "board_save_pdf", self._save)
        row = QHBoxLayout()
        row.addWidget(self.save)
        row.addStretch(1)
        steps.addLayout(row)
        self.saved = label("", "caption", "board_saved", wrap=True)
        steps.addWidget(self.saved)
        steps.addSpacing(16)
        steps.addWidget(label("3   Measure the print", "strong"))
        self.width_edit = line_edit("board_width", "for example 377.6")
        self.width_edit.setMaximumWidth(220)
        self.width_field = Field(
            "Width of all nine squares, in millimetres",
            self.width_edit,
            "With a steel rule, from the outer edge of the first square to the outer edge of the last. "
            "Every length that is measured later depends on it.",
        )
        steps.addWidget(self.width_field)
        steps.addStretch(1)
        frame, column = card(margin=24)
        self.sketch = BoardSketch()
        column.addWidget(self.sketch, 1)
        columns.addLayout(steps, 1)
        columns.addWidget(frame, 1)
        self.body.addLayout(columns, 1)
        self.add_left(button("Back", "secondary", "board_back", self.back.emit))
        self.next = self.add_right(button("Collect views", "primary", "board_next", self._next))
        self.width_edit.returnPressed.connect(self._next)
        self.choose(self._paper)

    def set_choice(self, choice: BoardChoice) -> None:
        """Begin with the board used last."""
        self.choose(choice.paper)
        if choice.width_m is not None:
            self.width_edit.setText(f"{1000 * choice.width_m:.1f}")

    def choose(self, paper: str) -> None:
        """Choose a paper."""
        if paper != self._paper:
            self.width_edit.clear()
            self.saved.clear()
        self._paper = paper
        for name, made in self._papers.items():
            made.setChecked(name == paper)
        nominal = 1000 * BoardChoice(paper).nominal_width_m
        self.fits.setText(_FITS[paper])
        self.width_edit.setPlaceholderText(f"about {nominal:.0f}")
        self.width_field.set_error("")
        self.sketch.set_paper(paper)

    def tell_saved(self, text: str) -> None:
        """Say where the PDF went, or why not."""
        self.saved.setText(text)

    def _save(self) -> None:
        self.save_pdf.emit(self._paper)

    def _next(self) -> None:
        nominal = BoardChoice(self._paper)
        width = read_width(self.width_edit.text(), nominal.nominal_width_m)
        if isinstance(width, str):
            self.width_field.set_error(width)
            self.width_edit.setFocus()
            return
        self.width_field.set_error("")
        self.ready.emit(BoardChoice(self._paper, width))


class BoardSketch(QWidget):
    """The board as it comes out of the printer, with the width to be measured."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("board_sketch")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        style_class(self, "sketch")
        self._paper = PAPERS[0]

    def sizeHint(self) -> QSize:  # noqa: D102
        return QSize(420, 320)

    def set_paper(self, paper: str) -> None:
        """Show another board."""
        self._paper = paper
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        from core.calibration.board import PAPERS_M, BoardSpec

        spec = BoardSpec.for_paper(self._paper)
        page_w, page_h = PAPERS_M[self._paper]
        painter = QPainter(self)
        foot = 44
        scale = min((self.width() - 4) / page_w, (self.height() - foot - 4) / page_h)
        if self._paper == "A4":
            scale *= 0.78
        w, h = page_w * scale, page_h * scale
        x, y = (self.width() - w) / 2, (self.height() - foot - h) / 2
        painter.setPen(QPen(QColor(palette.BORDER_STRONG), 1))
        painter.setBrush(QColor("#FFFFFF"))
        painter.drawRect(QRectF(x, y, w, h))
        board_w = spec.size_m[0] * scale
        left, top = x + (w - board_w) / 2, y + 0.008 * scale
        black = spec.modules()
        module = board_w / black.shape[1]
        painter.setPen(QColor(0, 0, 0, 0))
        painter.setBrush(QColor("#000000"))
        for row in range(black.shape[0]):
            run = 0
            for column in range(black.shape[1] + 1):
                if column < black.shape[1] and black[row, column]:
                    run += 1
                elif run:
                    painter.drawRect(
                        QRectF(left + (column - run) * module, top + row * module, run * module, module)
                    )
                    run = 0
        line = y + h + 14
        painter.setPen(QPen(QColor(palette.ACCENT), 1.5))
        painter.drawLine(round(left), round(line), round(left + board_w), round(line))
        for end in (left, left + board_w):
            painter.drawLine(round(end), round(line - 6), round(end), round(line + 6))
        font = painter.font()
        font.setPixelSize(13)
        painter.setFont(font)
        nominal = 1000 * spec.size_m[0]
        painter.drawText(QRectF(left, line + 6, board_w, 22), 0x84, f"measure here: about {nominal:.0f} mm")
