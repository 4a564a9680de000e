"""When a capture is taken: by hand after a countdown, or by itself when the patient holds still.

    phase       event                                   becomes
    WATCHING    press                                   COUNTDOWN (by hand)
    WATCHING    automatic, well placed, still for long  COUNTDOWN (by itself)
    COUNTDOWN   time is up                              TAKING, and `tick` says so once
    COUNTDOWN   cancel (Esc)                            WATCHING; automatic is switched off
    COUNTDOWN   by itself, and the patient moves        WATCHING, with a sentence
    TAKING      done                                    WATCHING

Qt-free and without a clock: whoever drives it tells the time.
"""

from __future__ import annotations

from enum import Enum
from math import ceil
from typing import Final

from core.guidance.readings import Guidance

COUNTDOWN_S: Final = 3.0
STILL_FOR_S: Final = 0.8
"""How long the patient must hold still before the countdown begins by itself."""

MOVED: Final = "Moved: hold still again."


class Phase(Enum):
    """Where the assistant is."""

    WATCHING = "watching"
    COUNTDOWN = "countdown"
    TAKING = "taking"


class CaptureAssistant:
    """See the module's documentation.

    Attributes
    ----------
    phase : Phase
    automatic : bool
        Capture when still.
    message : str
        Why the last countdown ended without a capture; empty if it did not.
    """

    def __init__(self) -> None:
        self.phase = Phase.WATCHING
        self.automatic = False
        self.message = ""
        self._by_hand = False
        self._ends_s = 0.0
        self._still_since: float | None = None

    def set_automatic(self, on: bool) -> None:
        """Capture when still, or only by hand."""
        self.automatic = on
        self._still_since = None
        if not on and self.phase is Phase.COUNTDOWN and not self._by_hand:
            self.phase = Phase.WATCHING

    def press(self, now_s: float) -> None:
        """The capture button."""
        if self.phase is Phase.WATCHING:
            self._begin(now_s, by_hand=True)

    def cancel(self) -> bool:
        """Esc: stop the countdown; True if there was one. It does not begin by itself again."""
        if self.phase is not Phase.COUNTDOWN:
            return False
        self.phase = Phase.WATCHING
        self.automatic = False
        self._still_since = None
        self.message = ""
        return True

    def look(self, guidance: Guidance, now_s: float) -> None:
        """New readings."""
        ready = guidance.placed and guidance.still
        if self.phase is Phase.COUNTDOWN and not self._by_hand:
            stillness = guidance.readings.get("stillness")
            moves = stillness is not None and stillness.state == "bad"
            if not guidance.placed or moves:
                self.phase = Phase.WATCHING
                self._still_since = None
                self.message = MOVED if guidance.placed else "".join(guidance.sentences[:1])
            return
        if self.phase is not Phase.WATCHING or not self.automatic:
            return
        if not ready:
            self._still_since = None
            return
        if self._still_since is None:
            self._still_since = now_s
        if now_s - self._still_since >= STILL_FOR_S:
            self._begin(now_s, by_hand=False)

    def tick(self, now_s: float) -> bool:
        """Time passes; True exactly once when the capture is to be taken."""
        if self.phase is Phase.COUNTDOWN and now_s >= self._ends_s:
            self.phase = Phase.TAKING
            return True
        return False

    def done(self) -> None:
        """The capture was taken, or failed."""
        self.phase = Phase.WATCHING
        self._still_since = None

    def rest(self) -> None:
        """Another screen is shown: no countdown, nothing pending."""
        if self.phase is Phase.COUNTDOWN:
            self.phase = Phase.WATCHING
        self._still_since = None
        self.message = ""

    def count(self, now_s: float) -> int:
        """The number to show, 3, 2, 1; 0 outside of a countdown."""
        if self.phase is not Phase.COUNTDOWN:
            return 0
        return min(max(ceil(self._ends_s - now_s - 1e-6), 1), ceil(COUNTDOWN_S))

    def _begin(self, now_s: float, *, by_hand: bool) -> None:
        self.phase = Phase.COUNTDOWN
        self._by_hand = by_hand
        self._ends_s = now_s + COUNTDOWN_S
        self._still_since = None
        self.message = ""
