"""Play, pause, step, seek and speed of a recording; freeze of a live camera."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import QComboBox, QFrame, QHBoxLayout, QLabel, QSlider, QWidget

from app.theme import icon, palette, style_class
from app.windows.hand.parts import tool

SPEEDS = ((0.25, "¼ speed"), (0.5, "½ speed"), (1.0, "Real time"), (2.0, "2 × speed"), (4.0, "4 × speed"))


class Transport(QFrame):
    """See the module's documentation.

    Signals
    -------
    play_asked(bool), step_asked(int), seek_asked(int), speed_chosen(float)
    """

    play_asked = Signal(bool)
    step_asked = Signal(int)
    seek_asked = Signal(int)
    speed_chosen = Signal(float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        style_class(self, "card")
        self._playing, self._frames, self._live = False, 0, False
        self.back = tool("hand_step_back", "step-back", "One frame back (Page Up)", lambda: self._step(-1))
        self.play = tool("hand_play", "play", "Play (Ctrl+Space)", self.toggle)
        self.forward = tool(
            "hand_step_forward", "step-forward", "One frame on (Page Down)", lambda: self._step(1)
        )
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setObjectName("hand_seek")
        self.slider.setAccessibleName("Frame of the recording")
        self.slider.setPageStep(10)
        self.slider.valueChanged.connect(self.seek_asked)
        self.place = QLabel()
        self.place.setObjectName("hand_place")
        style_class(self.place, "secondary")
        self.place.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.speed = QComboBox()
        self.speed.setObjectName("hand_speed")
        self.speed.setAccessibleName("Speed of playing")
        for factor, text in SPEEDS:
            self.speed.addItem(text, factor)
        self.speed.setCurrentIndex(2)
        self.speed.setFixedWidth(132)
        self.speed.currentIndexChanged.connect(lambda k: self.speed_chosen.emit(SPEEDS[k][0]))
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 6, 8, 6)
        row.setSpacing(4)
        for button in (self.back, self.play, self.forward):
            button.setIconSize(QSize(22, 22))
            row.addWidget(button)
        row.addSpacing(4)
        row.addWidget(self.slider, 1000)
        row.addSpacing(8)
        row.addStretch(1)
        row.addWidget(self.place)
        row.addSpacing(8)
        row.addWidget(self.speed)
        self.set_source(0, live=False)

    def set_source(self, frames: int, *, live: bool) -> None:
        """Another source: how many frames it has."""
        self._frames, self._live = frames, live
        self.slider.blockSignals(True)
        self.slider.setRange(0, max(frames - 1, 0))
        self.slider.setValue(0)
        self.slider.blockSignals(False)
        for widget in (self.back, self.forward, self.slider, self.speed):
            widget.setEnabled(frames > 1)
        self.play.setEnabled(live or frames > 1)
        for widget in (self.back, self.forward, self.slider, self.speed):
            widget.setVisible(not live)
        widest = f"frame {max(frames, 1)} of {max(frames, 1)}   {999.9:.2f} s"
        self.place.setFixedWidth(self.place.fontMetrics().horizontalAdvance(widest) + 4)
        self.place.setText("")
        self.set_playing(False)

    def show_place(self, number: int, time_s: float) -> None:
        """Where the frame shown is."""
        if self._live:
            self.place.setText(f"live, frame {number}")
            return
        self.place.setText(f"frame {number + 1} of {self._frames}   {time_s:.2f} s")
        if not self.slider.isSliderDown():
            self.slider.blockSignals(True)
            self.slider.setValue(number)
            self.slider.blockSignals(False)

    def set_playing(self, on: bool) -> None:
        """Whether it plays."""
        self._playing = on
        self.play.setIcon(icon("pause" if on else "play", palette.ACCENT))
        word = ("Freeze" if self._live else "Pause") if on else "Play"
        self.play.setToolTip(f"{word} (Ctrl+Space)")
        self.play.setAccessibleName(word)

    @property
    def playing(self) -> bool:
        """Whether it plays."""
        return self._playing

    def toggle(self) -> None:
        """Play or hold."""
        if self.play.isEnabled():
            self.play_asked.emit(not self._playing)

    def _step(self, by: int) -> None:
        self.step_asked.emit(by)
