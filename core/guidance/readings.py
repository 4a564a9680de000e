"""What the assistant tells: readings with a value, a state and a sentence."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal

State = Literal["good", "fair", "bad", "unknown"]
"""How a reading is; "unknown" where there is nothing to judge it by."""

READING_NAMES: Final = ("distance", "frame", "stance", "light", "backlight", "blur", "coverage", "stillness")
"""Every reading there is, in the order in which they matter to a person who is being placed."""

_WORSE: Final[dict[State, int]] = {"unknown": 0, "good": 0, "fair": 1, "bad": 2}


@dataclass(frozen=True)
class Reading:
    """One judgement of the present moment.

    Attributes
    ----------
    name : str
        One of `READING_NAMES`.
    value : float or None
        None where nothing could be measured.
    unit : str
        "m", "mm", "share" (0..1), "px", "level" (0..255), "ratio"; empty if there is no number.
    state : {"good", "fair", "bad", "unknown"}
    sentence : str
        What to say to the patient or the user; empty if there is nothing to say.
    """

    name: str
    value: float | None
    unit: str
    state: State
    sentence: str = ""

    @property
    def badness(self) -> int:
        """0 good or unknown, 1 fair, 2 bad."""
        return _WORSE[self.state]


def unknown(name: str, sentence: str = "") -> Reading:
    """A reading that could not be taken."""
    return Reading(name, None, "", "unknown", sentence)


@dataclass(frozen=True)
class Guidance:
    """All readings of one moment.

    Attributes
    ----------
    time_s : float
    readings : dict of str to Reading
    person : bool
        Whether somebody is in view.
    """

    time_s: float
    readings: dict[str, Reading] = field(default_factory=dict)
    person: bool = False

    def __getitem__(self, name: str) -> Reading:
        return self.readings[name]

    @property
    def sentences(self) -> tuple[str, ...]:
        """What to say now, worst first, at most one sentence a reading."""
        said = [r for r in self.readings.values() if r.sentence and r.badness]
        said.sort(key=lambda r: -r.badness)
        return tuple(dict.fromkeys(r.sentence for r in said))

    @property
    def placed(self) -> bool:
        """Whether a capture can be good: somebody in view and nothing bad but, perhaps, movement."""
        return self.person and all(
            r.state != "bad" for name, r in self.readings.items() if name not in ("stillness", "blur")
        )

    @property
    def still(self) -> bool:
        """Whether the person is known to hold still."""
        reading = self.readings.get("stillness")
        return reading is not None and reading.state == "good"
