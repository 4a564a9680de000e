"""How a report says things: status, confidence, sizes, dates."""

from __future__ import annotations

from datetime import date, datetime

from core.exchange.report_data import LesionEntry, VisitReport
from core.records.records import Observation

SEX_WORDS = {"F": "Female", "M": "Male", "O": "Other", "U": "Not stated"}
NOTHING = "–"
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")

_PROPOSED = {
    "found": "Found, not yet confirmed",
    "predicted": "Predicted, not yet confirmed",
    "ambiguous": "Several places possible",
    "not_visible": "Not in view",
    "refused": "Could not be placed",
    "marked": "Marked by the doctor",
}


def day(value: date | datetime | None) -> str:
    """A date no two countries read differently: ``22 Nov 2026``. Times are shown in local time."""
    if value is None:
        return NOTHING
    if isinstance(value, datetime):
        value = value.astimezone().date()
    return f"{value.day} {_MONTHS[value.month - 1]} {value.year}"


def millimetres(metres: float | None) -> str:
    """``4.2 mm``, whole millimetres from 10 mm."""
    return NOTHING if metres is None else size(metres * 1000.0)


def size(mm: float | None) -> str:
    """A size in millimetres."""
    if mm is None:
        return NOTHING
    return f"{mm:.1f}\u00a0mm" if mm < 9.95 else f"{mm:.0f}\u00a0mm"


def confidence(value: float | None) -> str:
    """A confidence in a word and a percentage."""
    if value is None:
        return NOTHING
    word = "high" if value >= 0.85 else "moderate" if value >= 0.6 else "low"
    return f"{word} ({value * 100:.0f}\u00a0%)"


def finding(entry: LesionEntry) -> str:
    """The state of a lesion at this visit in a few words."""
    observation = entry.now.observation
    if entry.lesion.state == "removed":
        return "Removed"
    if observation is None:
        return "Not recorded at this visit"
    if observation.decision == "marked":
        return "New, marked by the doctor" if entry.is_new else "Marked by the doctor"
    if observation.decision == "confirmed":
        if observation.status in ("not_visible", "refused"):
            return "Not in view, confirmed"
        return "Confirmed by the doctor"
    if observation.decision == "corrected":
        return "Corrected by the doctor"
    if observation.decision == "rejected":
        return "Proposed place rejected"
    return _PROPOSED[observation.status]


def position(report: VisitReport, observation: Observation | None) -> str:
    """How the place came about, how sure it is, and who decided; one or two sentences."""
    if observation is None:
        return "No place was recorded."
    who = report.people.get(observation.decided_by or 0, "")
    by = f" by {who}" if who else ""
    when = f" on {day(observation.decided_at)}" if observation.decided_at else ""
    sure = []
    if observation.confidence is not None and observation.proposed_pixel is not None:
        sure.append(f"{confidence(observation.confidence)} confidence")
    if observation.radius95_m is not None:
        sure.append(f"95\u00a0% within {millimetres(observation.radius95_m)}")
    proposal = f"proposed with {', '.join(sure)}" if sure else "proposed"
    reason = f" ({observation.reason.strip().rstrip('.')})" if observation.reason.strip() else ""
    if observation.decision == "marked":
        return f"Marked{by}{when}."
    if observation.decision == "confirmed":
        if observation.proposed_pixel is None:
            return f"Not in view{reason}; confirmed{by}{when}."
        return f"Confirmed{by}{when}; {proposal}."
    if observation.decision == "corrected":
        return f"Placed{by}{when}; the place {proposal} was not accepted."
    if observation.decision == "rejected":
        return f"The place {proposal} was rejected{by}{when}."
    if observation.proposed_pixel is None:
        return f"{_PROPOSED[observation.status]}{reason}."
    return f"{proposal.capitalize()}{reason}; not yet confirmed by a doctor."
