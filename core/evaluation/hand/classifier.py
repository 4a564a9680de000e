"""How often the configuration of a hand is said rightly, and an unlearned one is said to be unknown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.evaluation.hand.scores import FrameScore
from core.evaluation.hand.summaries import Spread, by_body, spread

IntArray = NDArray[np.int64]

UNKNOWN, NO_ANSWER = "unknown", "no answer"


@dataclass(frozen=True, eq=False)
class Judged:
    """What was said of frames whose configuration is known.

    Attributes
    ----------
    classes : tuple of str
        Learned configurations.
    counts : ndarray (c, c + 2) int64
        Frames; rows the true configuration, columns what was said, then "unknown" and "no answer".
    forced : int
        Frames that would be right had the likeliest been said.
    share : Spread
        Percent said rightly, over hands.
    faults : tuple of (str, str, str)
        Frames that were not said rightly: name, what was said, why.
    """

    classes: tuple[str, ...]
    counts: IntArray
    forced: int
    share: Spread
    faults: tuple[tuple[str, str, str], ...]

    @property
    def frames(self) -> int:
        """How many."""
        return int(self.counts.sum())

    @property
    def right(self) -> int:
        """Frames whose configuration was said rightly."""
        return int(np.trace(self.counts))

    @property
    def wrong(self) -> int:
        """Frames of which another configuration was said."""
        return int(self.counts[:, : len(self.classes)].sum()) - self.right

    @property
    def said(self) -> str:
        """In words."""
        unknown, none = self.counts[:, -2].sum(), self.counts[:, -1].sum()
        return f"{self.right} of {self.frames} ({self.wrong} wrong, {unknown} unknown, {none} no answer)"

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        return {
            "classes": list(self.classes),
            "columns": [*self.classes, UNKNOWN, NO_ANSWER],
            "counts": self.counts.tolist(),
            "frames": self.frames,
            "right": self.right,
            "wrong": self.wrong,
            "forced_right": self.forced,
            "percent": [self.share.value, self.share.low, self.share.high],
            "percent_by_body": dict(self.share.by_body),
            "faults": [list(fault) for fault in self.faults],
        }


def judged(scores: Sequence[FrameScore], classes: Sequence[str]) -> Judged:
    """Count what was said of frames; those whose configuration is none of the classes do not count."""
    rows = [s for s in scores if s.configuration in classes]
    counts = np.zeros((len(classes), len(classes) + 2), np.int64)
    for score in rows:
        counts[list(classes).index(str(score.configuration)), _column(score, classes)] += 1
    share = spread(
        {body: np.array([100.0 * _right(s) for s in some]) for body, some in by_body(rows).items()},
        lambda values: float(np.mean(values)),
    )
    faults = tuple((s.name, _said(s), s.reason or "") for s in rows if not _right(s))
    forced = sum(s.likeliest == s.configuration for s in rows)
    return Judged(tuple(classes), counts, forced, share, faults)


@dataclass(frozen=True)
class LeftOut:
    """What is said of a configuration that was not learned.

    Attributes
    ----------
    name : str
    frames, unknown : int
        Frames with an answer, and those of which it was said that the configuration is unknown.
    taken_for : dict of str to int
        Others, by what was said.
    """

    name: str
    frames: int
    unknown: int
    taken_for: dict[str, int]


def left_out(name: str, scores: Iterable[FrameScore]) -> LeftOut:
    """Count what was said of frames in a configuration that the model does not have."""
    rows = [s for s in scores if s.configuration == name and _said(s) != NO_ANSWER]
    taken: dict[str, int] = {}
    for score in rows:
        if score.told_configuration is not None:
            taken[score.told_configuration] = taken.get(score.told_configuration, 0) + 1
    return LeftOut(name, len(rows), sum(s.told_configuration is None for s in rows), taken)


def _right(score: FrameScore) -> bool:
    return score.told_configuration == score.configuration


def _said(score: FrameScore) -> str:
    if score.told_configuration is not None:
        return score.told_configuration
    return UNKNOWN if score.likeliest is not None else NO_ANSWER


def _column(score: FrameScore, classes: Sequence[str]) -> int:
    said = _said(score)
    if said in classes:
        return list(classes).index(said)
    return len(classes) + (said == NO_ANSWER)
