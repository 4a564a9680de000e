"""Statuses in words and tones: what the doctor reads beside a lesion, and in which colour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from core.records import Observation

Tone = Literal["confirmed", "corrected", "marked", "proposed", "uncertain", "removed"]

CONFIDENT_RADIUS_M = 0.02
"""A place may be confirmed together with others only if it is known at least this well (95 %)."""

CONFIDENT = 0.5
"""And believed at least this much."""


@dataclass(frozen=True)
class StatusText:
    """A status to show: a short label, a sentence of detail, and the tone of the marker."""

    label: str
    detail: str
    tone: Tone
    needs_doctor: bool = False


def is_confident(o: Observation) -> bool:
    """Whether a proposal is sure enough to be confirmed together with others."""
    return (
        o.decision == "proposed"
        and o.pixel is not None
        and o.status in ("found", "predicted")
        and o.radius95_m is not None
        and o.radius95_m <= CONFIDENT_RADIUS_M
        and (o.confidence or 0.0) >= CONFIDENT
    )


def radius_text(radius95_m: float | None) -> str:
    """For example ``±35 mm``."""
    return "" if radius95_m is None else f"±{max(1, round(radius95_m * 1000))} mm"


def when(moment: datetime) -> str:
    """A date and time in the user's own time zone."""
    return moment.astimezone().strftime("%d %b %Y, %H:%M")


def describe(o: Observation | None, user_name: Callable[[int], str]) -> StatusText:
    """Put the observation in force of a lesion into words."""
    if o is None:
        return StatusText(
            "Not looked for yet", "Find the lesions on the body capture first.", "removed", True
        )
    who = (
        ""
        if o.decided_by is None or o.decided_at is None
        else f"{user_name(o.decided_by)}, {when(o.decided_at)}"
    )
    if o.decision == "marked":
        return StatusText("Marked", f"Marked by {who}.", "marked")
    if o.decision == "corrected":
        return StatusText("Corrected", f"Corrected by {who}.", "corrected")
    if o.decision == "rejected":
        return StatusText("Not in view", f"Said not to be in view by {who}.", "removed")
    if o.decision == "confirmed":
        if o.pixel is None:
            return StatusText("Not in view", f"Agreed by {who}.", "removed")
        return StatusText("Confirmed", f"Confirmed by {who}.", "confirmed")
    return _proposal(o)


def _proposal(o: Observation) -> StatusText:
    radius = radius_text(o.radius95_m)
    if o.pixel is None:
        label = "Not in view" if o.status == "not_visible" else "No answer"
        return StatusText(
            f"{label}: please check",
            f"{o.reason} If you see the lesion, place it by hand; otherwise agree.".strip(),
            "uncertain",
            True,
        )
    if is_confident(o):
        seen = "Its look matches the previous visit. " if o.appearance_matched else ""
        return StatusText(f"Proposed, {radius}", f"{seen}{o.reason}".strip(), "proposed", True)
    if o.status == "ambiguous":
        return StatusText(
            f"Several places fit, {radius}: please check" if radius else "Several places fit: please check",
            o.reason or "More than one place explains the measurements.",
            "uncertain",
            True,
        )
    return StatusText(
        f"Proposed, {radius}: please check",
        f"{o.reason} Expect it within {radius.lstrip('±')} (95 %).".strip(),
        "uncertain",
        True,
    )
