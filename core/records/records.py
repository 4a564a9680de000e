"""What comes out of the clinic store: frozen values with no database behind them.

All times are UTC and aware. Places on the skin are metres in the depth-camera frame of their capture;
pixels are (u, v) of its picture (the colour image, or the depth image when there is no colour).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime
from typing import Final, Literal

Sex = Literal["F", "M", "O", "U"]
Role = Literal["psi", "working"]
LesionState = Literal["active", "removed"]
Status = Literal["found", "predicted", "ambiguous", "not_visible", "refused", "marked"]
Decision = Literal["proposed", "confirmed", "corrected", "marked", "rejected"]
Laterality = Literal["", "left", "right"]

SEXES: Final[tuple[Sex, ...]] = ("F", "M", "O", "U")
ROLES: Final[tuple[Role, ...]] = ("psi", "working")
LESION_STATES: Final[tuple[LesionState, ...]] = ("active", "removed")
STATUSES: Final[tuple[Status, ...]] = (
    "found",
    "predicted",
    "ambiguous",
    "not_visible",
    "refused",
    "marked",
)
DECISIONS: Final[tuple[Decision, ...]] = ("proposed", "confirmed", "corrected", "marked", "rejected")
LATERALITIES: Final[tuple[Laterality, ...]] = ("", "left", "right")

Pixel = tuple[float, float]
Point = tuple[float, float, float]


@dataclass(frozen=True)
class User:
    """A person who may sign in."""

    id: int
    username: str
    display_name: str
    created_at: datetime


@dataclass(frozen=True)
class PatientDraft:
    """What the user types about a patient."""

    family_name: str
    given_name: str = ""
    birth_date: date | None = None
    sex: str = "U"
    clinic_number: str = ""
    note: str = ""


@dataclass(frozen=True)
class Patient:
    """A patient of the clinic, with who entered and who last changed the entry."""

    id: int
    family_name: str
    given_name: str
    birth_date: date | None
    sex: Sex
    clinic_number: str
    note: str
    created_at: datetime
    created_by: int
    updated_at: datetime
    updated_by: int

    @property
    def full_name(self) -> str:
        """``Family, Given``."""
        return ", ".join(part for part in (self.family_name, self.given_name) if part)

    def age_on(self, day: date) -> int | None:
        """Completed years on ``day``; None if the birth date is unknown or later."""
        born = self.birth_date
        if born is None or born > day:
            return None
        return day.year - born.year - ((day.month, day.day) < (born.month, born.day))


@dataclass(frozen=True)
class PatientSummary:
    """A row of the patient list."""

    patient: Patient
    visit_count: int
    lesion_count: int
    last_visit_at: datetime | None


@dataclass(frozen=True)
class Visit:
    """One consultation. Numbers run from 1 per patient; an open visit has no `closed_at`."""

    id: int
    patient_id: int
    number: int
    started_at: datetime
    started_by: int
    closed_at: datetime | None
    closed_by: int | None
    note: str

    @property
    def is_open(self) -> bool:
        """Whether the visit still takes captures."""
        return self.closed_at is None


@dataclass(frozen=True)
class CaptureRecord:
    """A stored capture without its pictures.

    Attributes
    ----------
    role : {"psi", "working"}
        The psi capture calibrates the skeleton; lesions are marked on working captures.
    picture_size : (int, int)
        Width and height of the picture lesions are marked on.
    has_color : bool
        Whether that picture is a colour image rather than the depth image.
    """

    id: int
    visit_id: int
    role: Role
    view: str
    stance: str
    taken_at: datetime
    stored_at: datetime
    stored_by: int | None
    frame_count: int
    picture_size: tuple[int, int]
    has_color: bool


@dataclass(frozen=True)
class AnchorRecord:
    """An anchor found on one capture: its place on the skin and how well it is known."""

    name: str
    x: float
    y: float
    z: float
    pixel_u: float | None
    pixel_v: float | None
    visibility: float
    sigma_m: float
    source: str


@dataclass(frozen=True)
class AnatomicSite:
    """A coded place on the body (DICOM CID 4029), with the side where there are two.

    Attributes
    ----------
    code, scheme, meaning : str
        As in the standard, for example ``("45981001", "SCT", "Skin of anterior surface of upper arm")``.
    laterality : {"", "left", "right"}
        The patient's own side. The standard's list has one code for both sides.
    """

    code: str
    scheme: str
    meaning: str
    laterality: Laterality = ""

    @property
    def name(self) -> str:
        """The meaning as a person says it, for example ``Anterior surface of upper arm, left``."""
        text = self.meaning
        for prefix in ("Skin of part of ", "Skin of "):
            if text.startswith(prefix):
                text = text.removeprefix(prefix)
                break
        text = text[:1].upper() + text[1:]
        return f"{text}, {self.laterality}" if self.laterality else text


@dataclass(frozen=True)
class Lesion:
    """A lesion of a patient. Numbers run from 1 per patient; `visit_id` is where it was first marked."""

    id: int
    patient_id: int
    visit_id: int
    number: int
    site: AnatomicSite | None
    state: LesionState
    note: str
    created_at: datetime
    created_by: int
    updated_at: datetime
    updated_by: int


@dataclass(frozen=True)
class CandidatePlace:
    """Another place where the lesion may be, offered to the doctor."""

    pixel: Pixel | None
    point_m: Point | None
    confidence: float


@dataclass(frozen=True)
class ObservationDraft:
    """Where a lesion is on one capture, as a method proposes it or as the doctor marks it.

    A draft whose `status` is ``marked`` is the doctor's own; any other is a proposal.
    """

    lesion_id: int
    visit_id: int
    capture_id: int
    status: str
    pixel: Sequence[float] | None = None
    point_m: Sequence[float] | None = None
    radius95_m: float | None = None
    confidence: float | None = None
    method: str = ""
    reason: str = ""
    note: str = ""
    size_mm: float | None = None
    appearance_matched: bool = False
    candidates: tuple[CandidatePlace, ...] = ()


@dataclass(frozen=True)
class Observation:
    """A lesion on one capture: the place in force, the place that was proposed, and who decided.

    Attributes
    ----------
    pixel, point_m
        The place in force: the doctor's where it was corrected or marked, otherwise the proposal.
    proposed_pixel, proposed_point_m, radius95_m, confidence, method, reason, candidates
        The proposal; empty for a lesion that the doctor marked.
    decision, decided_by, decided_at
        ``proposed`` until a person confirms, corrects or rejects it.
    """

    id: int
    lesion_id: int
    visit_id: int
    capture_id: int
    status: Status
    pixel: Pixel | None
    point_m: Point | None
    proposed_pixel: Pixel | None
    proposed_point_m: Point | None
    radius95_m: float | None
    confidence: float | None
    appearance_matched: bool
    method: str
    reason: str
    candidates: tuple[CandidatePlace, ...]
    decision: Decision
    decided_by: int | None
    decided_at: datetime | None
    size_mm: float | None
    note: str
    created_at: datetime
    created_by: int
    updated_at: datetime
    updated_by: int


@dataclass(frozen=True)
class ObservationEvent:
    """One step of an observation's history, with the place in force after it."""

    id: int
    observation_id: int
    at: datetime
    by: int
    action: str
    decision: Decision
    status: Status
    pixel: Pixel | None
    point_m: Point | None
    detail: str


@dataclass(frozen=True)
class DermoscopicImage:
    """A dermoscopic image of a lesion; the bytes are kept exactly as they came."""

    id: int
    lesion_id: int
    visit_id: int
    media_type: str
    width: int
    height: int
    size_bytes: int
    sha256: str
    note: str
    added_at: datetime
    added_by: int
