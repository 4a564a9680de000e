"""How much of the person the depth camera measures."""

from __future__ import annotations

from typing import Final

from core.guidance.person import Person
from core.guidance.readings import Reading

GOOD: Final = 0.93
FAIR: Final = 0.80


def coverage_reading(person: Person) -> Reading:
    """Share of the outline with depth."""
    measured, missing = int(person.mask.sum()), int(person.missing.sum())
    share = measured / max(measured + missing, 1)
    if share >= GOOD:
        return Reading("coverage", share, "share", "good")
    say = "Parts of the body are not measured: uncover dark or shiny cloth, keep out of sunlight."
    return Reading("coverage", share, "share", "fair" if share >= FAIR else "bad", say)
