"""What the tracker says of the frame: configuration, likelihoods, marker, frames per second, reason."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QSizePolicy, QVBoxLayout, QWidget

from app.theme import palette, style_class
from app.widgets.likelihood_bars import LikelihoodBars
from app.windows.hand.ticks import Tick

_REASON_ROWS = 2
_KEYS = "S skips a hidden point, Ctrl+Z takes back, P proposes, Ctrl+S saves and goes on, Page Down goes on."


class StatusCard(QFrame):
    """See the module's documentation."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        style_class(self, "card")
        self.configuration = QLabel("–")
        self.configuration.setObjectName("hand_configuration")
        self.configuration.setAccessibleName("Configuration of the hand")
        style_class(self.configuration, "heading")
        self.configuration.setFixedWidth(150)
        self.bars = LikelihoodBars("hand_likelihood")
        self.marker = QLabel()
        self.marker.setObjectName("hand_marker")
        self.marker.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.marker.setFixedWidth(112)
        self.rate = QLabel()
        self.rate.setObjectName("hand_rate")
        self.rate.setFixedWidth(96)
        self.rate.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        style_class(self.rate, "secondary")
        self.reason = QLabel()
        self.reason.setObjectName("hand_reason")
        self.reason.setAccessibleName("What is missing or less sure than usual")
        self.reason.setWordWrap(True)
        self.reason.setTextFormat(Qt.TextFormat.PlainText)
        self.reason.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.reason.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.reason.setFixedHeight(_REASON_ROWS * self.reason.fontMetrics().lineSpacing() + 2)
        top = QHBoxLayout()
        top.setSpacing(12)
        top.addWidget(self.configuration)
        top.addWidget(self.bars, 1)
        top.addWidget(self.marker)
        top.addWidget(self.rate)
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 8, 16, 8)
        column.setSpacing(4)
        column.addLayout(top)
        column.addWidget(self.reason)
        self.clear()

    def clear(self) -> None:
        """Say nothing."""
        self._set(self.configuration, "–")
        self.bars.show_likelihood({}, None)
        self.rate.setText("")
        self._badge("No picture", "badge-grey")
        self.reason.setText("")

    def show_tick(self, tick: Tick, *, has_model: bool, labelling: bool) -> None:
        """What is known of a frame."""
        answer = tick.answer
        if labelling:
            self._set(self.configuration, "Training")
        elif not has_model:
            self._set(self.configuration, "No model")
        else:
            told = answer.configuration if answer is not None else None
            self._set(self.configuration, told or "Unknown")
        likelihood = {} if answer is None else answer.likelihood
        self.bars.show_likelihood(likelihood, None if answer is None else answer.configuration)
        thing = "Marker" if tick.anchors_kind == "marker" else "Palm"
        known = tick.answer is not None or tick.skin is not None
        if not known:
            self._badge(thing, "badge-grey")
        elif tick.anchors_seen:
            self._badge(f"{thing} seen", "badge-green")
        else:
            self._badge(f"{thing} lost", "badge-amber")
        self.rate.setText(f"{tick.rate_hz:.0f} frames/s" if tick.rate_hz > 0 else "")
        reason = tick.reason
        if not reason and not has_model and not labelling:
            reason = "Choose a model, or train one: there is nothing to track with yet."
        if not reason and labelling:
            reason = _KEYS
        if reason != self.reason.text():
            self.reason.setText(reason)
            self.reason.setToolTip(reason)
        warn = bool(tick.reason)
        self.reason.setStyleSheet(f"color: {palette.AMBER if warn else palette.SECONDARY};")

    def _set(self, label: QLabel, text: str) -> None:
        if text != label.toolTip():
            label.setToolTip(text)
            wide = label.maximumWidth() - 4
            label.setText(label.fontMetrics().elidedText(text, Qt.TextElideMode.ElideRight, wide))

    def _badge(self, text: str, look: str) -> None:
        if self.marker.text() != text:
            self.marker.setText(text)
            style_class(self.marker, look)
