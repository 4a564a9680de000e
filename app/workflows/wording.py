"""Statuses in words and tones: what the doctor reads beside a lesion, and in which colour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from app.workflows.evidence import VisitEvidence
from core.records import Observation

Tone = Literal["confirmed", "corrected", "marked", "proposed", "uncertain", "removed"]

CONFIDENT_RADIUS_M = 0.02
"""A place may be confirmed together with others only if its region (95 %) is no larger than this circle."""

CONFIDENT_LENGTH_M = 0.035
"""And no longer than this (half axis)."""

CONFIDENT = 0.5
"""And believed at least this much."""


@dataclass(frozen=True)
class StatusText:
    """A status to show: a short label, a sentence of detail, and the tone of the marker."""

    label: str
    detail: str
    tone: Tone
    needs_doctor: bool = False


def is_confident(o: Observation, evidence: VisitEvidence) -> bool:
    """Whether a proposal is sure enough to be confirmed together with others."""
    axes = evidence.axes_m(o)
    return (
        o.decision == "proposed"
        and o.pixel is not None
        and o.status in ("found", "predicted")
        and axes is not None
        and (axes[0] * axes[1]) ** 0.5 <= CONFIDENT_RADIUS_M
        and axes[0] <= CONFIDENT_LENGTH_M
        and (o.confidence or 0.0) >= CONFIDENT
        and evidence.disagreement_m(o) is None
    )


def region_text(axes_m: tuple[float, float] | None) -> str:
    """For example ``±35 mm``, or ``±35 x 20 mm`` for a long region (half axes)."""
    if axes_m is None:
        return ""
    a, b = (max(1, round(x * 1000)) for x in axes_m)
    return f"±{a} mm" if a - b <= max(1, a // 10) else f"±{a} x {b} mm"


def when(moment: datetime) -> str:
    """A date and time in the user's own time zone."""
    return moment.astimezone().strftime("%d %b %Y, %H:%M")


def describe(
    o: Observation | None, user_name: Callable[[int], str], evidence: VisitEvidence | None = None
) -> StatusText:
    """Put the observation in force of a lesion, and the evidence behind it, into words."""
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
    return _proposal(o, evidence or VisitEvidence())


def _proposal(o: Observation, evidence: VisitEvidence) -> StatusText:
    if o.pixel is None:
        label = "Not in view" if o.status == "not_visible" else "No answer"
        return StatusText(
            f"{label}: please check",
            f"{o.reason} If you see the lesion, place it by hand; otherwise agree.".strip(),
            "uncertain",
            True,
        )
    size = region_text(evidence.axes_m(o))
    apart = evidence.disagreement_m(o)
    doubt = (
        ""
        if apart is None
        else f"Distances along the skin point {apart * 1000:.0f} mm away from here: look closely. "
    )
    if is_confident(o, evidence):
        seen = "Its look matches the previous visit. " if o.appearance_matched else ""
        return StatusText(f"Proposed, {size}", f"{seen}{o.reason}".strip(), "proposed", True)
    if o.status == "ambiguous":
        return StatusText(
            f"Several places, {size}: check" if size else "Several places: check",
            doubt + (o.reason or "More than one place explains the measurements."),
            "uncertain",
            True,
        )
    return StatusText(
        f"Proposed, {size}: check",
        f"{doubt}{o.reason} Expect it within {size.lstrip('±')} (95 %).".strip(),
        "uncertain",
        True,
    )
