"""Between the live service and the capture screen: pictures, readings, sentences, and the countdown."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final

from PySide6.QtCore import QObject, QTimer, Signal, Slot

from app.live import CaptureAssistant, LiveStatus, Phase

if TYPE_CHECKING:
    from app.windows.visit.camera_deck import CameraDeck
    from app.windows.visit.capture_screen import CaptureScreen
    from core.guidance import Guidance

_TICK_MS: Final = 40
_SETTLE_S: Final = 0.35
"""A sentence must hold for this long before it takes the place of another: nobody can follow a flicker."""

_PASSING: Final = ("blur", "stillness")
"""Readings that everybody who moves makes bad: no reason for alarm."""

WELL: Final = "Well placed and still."
HOLD: Final = "Well placed. Hold still."


class LiveAssist(QObject):
    """Drives one capture screen at a time while its live picture is shown.

    Signals
    -------
    take()
        A capture is to be taken now.
    phase_changed()
        A countdown has begun or ended.
    """

    take = Signal()
    phase_changed = Signal()

    def __init__(self, deck: CameraDeck, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._deck = deck
        self._screen: CaptureScreen | None = None
        self.assistant = CaptureAssistant()
        self._phase = self.assistant.phase
        self._waiting: tuple[str, str] = ("", "unknown")
        self._waiting_since = 0.0
        self._timer = QTimer(self, interval=_TICK_MS)
        self._timer.timeout.connect(self._tick)
        live = deck.live
        live.pictured.connect(self._on_picture)
        live.posed.connect(self._on_pose)
        live.guided.connect(self._on_guidance)
        live.status_changed.connect(self._on_status)

    @property
    def counting(self) -> bool:
        """Whether a countdown runs."""
        return self.assistant.phase is Phase.COUNTDOWN

    @property
    def busy(self) -> bool:
        """Whether a countdown runs or a capture is being taken."""
        return self.assistant.phase is not Phase.WATCHING

    def attach(self, screen: CaptureScreen | None, *, psi: bool = False) -> None:
        """Show the live picture on a screen, or nowhere."""
        live = self._deck.live
        live.set_psi(psi)
        if screen is not self._screen:
            old, self._screen = self._screen, screen
            if old is not None:
                old.live_view.set_count(0)
                old.live_view.show_picture(None)
                old.live_view.room_changed.disconnect(live.set_room)
                old.live_view.visible_changed.disconnect(live.look)
            if old is not None and self.assistant.phase is not Phase.TAKING:
                self.assistant.rest()
            if screen is not None:
                screen.live_view.room_changed.connect(live.set_room)
                screen.live_view.visible_changed.connect(live.look)
                live.set_room(*screen.live_view.room())
            self._note_phase()
        live.look(screen is not None and screen.live_view.isVisible())

    def press(self) -> None:
        """The capture button: begin the countdown, or stop the one that runs."""
        if not self.cancel():
            self.assistant.press(time.monotonic())
            self._note_phase()

    def cancel(self) -> bool:
        """Stop the countdown; True if one ran."""
        stopped = self.assistant.cancel()
        if stopped:
            self._note_phase()
        return stopped

    def set_automatic(self, on: bool) -> None:
        """Capture when still."""
        self.assistant.set_automatic(on)
        self._note_phase()

    def done(self) -> None:
        """The capture was taken, or failed."""
        self.assistant.done()
        self._note_phase()

    def _note_phase(self) -> None:
        now = time.monotonic()
        if self._screen is not None:
            self._screen.live_view.set_count(self.assistant.count(now))
        running = self.counting
        if running != self._timer.isActive():
            self._timer.start() if running else self._timer.stop()
        if self.assistant.phase is not self._phase:
            self._phase = self.assistant.phase
            self.phase_changed.emit()

    @Slot()
    def _tick(self) -> None:
        now = time.monotonic()
        if self.assistant.tick(now):
            self._note_phase()
            self.take.emit()
        elif self._screen is not None:
            self._screen.live_view.set_count(self.assistant.count(now))

    @Slot()
    def _on_picture(self) -> None:
        shown = self._deck.live.take_picture()
        if shown is not None and self._screen is not None:
            self._screen.live_view.show_picture(shown)

    @Slot()
    def _on_pose(self) -> None:
        if self._screen is not None:
            self._screen.live_view.set_pose(self._deck.live.pose)

    @Slot()
    def _on_guidance(self) -> None:
        guidance, screen = self._deck.live.guidance, self._screen
        if guidance is None or screen is None or self._deck.status.kind != "streaming":
            return
        screen.strip.show_guidance(guidance)
        now = time.monotonic()
        self.assistant.look(guidance, now)
        self._note_phase()
        self._say(_sentence(guidance, self.assistant), now)

    def _say(self, said: tuple[str, str], now: float) -> None:
        if said != self._waiting:
            self._waiting, self._waiting_since = said, now
        view = self._screen.live_view if self._screen is not None else None
        if view is not None and (not view.sentence or now - self._waiting_since >= _SETTLE_S):
            view.set_sentence(*said)

    @Slot(object)
    def _on_status(self, status: LiveStatus) -> None:
        if status.kind in ("gone", "stalled") and self.assistant.phase is Phase.COUNTDOWN:
            self.assistant.rest()
            self._note_phase()
        screen = self._screen
        if screen is None:
            return
        if status.kind != "streaming":
            screen.strip.show_guidance(None)
            screen.live_view.set_sentence("")
        if status.kind in ("gone", "idle"):
            screen.live_view.show_picture(None)
        screen.live_view.set_notice(_NOTICES.get(status.kind, ""))


_NOTICES: Final = {
    "gone": "The camera is gone. Waiting for it to come back.",
    "stalled": "The camera delivers no pictures.",
}


def _sentence(guidance: Guidance, assistant: CaptureAssistant) -> tuple[str, str]:
    """What to say, and how serious it is."""
    if not guidance.person:
        first = guidance.readings.get("distance")
        return ("" if first is None else first.sentence, "unknown")
    for reading in sorted(guidance.readings.values(), key=lambda r: -r.badness):
        if reading.badness and reading.sentence:
            if reading.name in _PASSING:
                return assistant.message or reading.sentence, "fair"
            return reading.sentence, reading.state
    return (WELL if guidance.still else HOLD, "good")
