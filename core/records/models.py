"""The tables of a clinic database. Nothing outside this room sees these classes."""

from __future__ import annotations

from datetime import UTC, date, datetime
from typing import Any

from sqlalchemy import (
    JSON,
    CheckConstraint,
    Date,
    DateTime,
    Dialect,
    Float,
    ForeignKey,
    Index,
    MetaData,
    String,
    Text,
    TypeDecorator,
    UniqueConstraint,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from core.records.records import DECISIONS, LATERALITIES, LESION_STATES, ROLES, SEXES, STATUSES

_NAMING = {
    "ix": "ix_%(table_name)s_%(column_0_N_name)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
    "pk": "pk_%(table_name)s",
}


class UtcDateTime(TypeDecorator[datetime]):
    """Aware times, kept in UTC without a zone."""

    impl = DateTime
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """To the database."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError("a time without a time zone")
        return value.astimezone(UTC).replace(tzinfo=None)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """From the database."""
        return None if value is None else value.replace(tzinfo=UTC)


def _one_of(column: str, values: tuple[str, ...]) -> CheckConstraint:
    listed = ", ".join(f"'{value}'" for value in values)
    return CheckConstraint(f"{column} IN ({listed})", name=column)


def _user(*, nullable: bool = False) -> Mapped[Any]:
    return mapped_column(ForeignKey("users.id"), nullable=nullable)


_LASTING_IDS = {"sqlite_autoincrement": True}
"""The id of a removed row is never given to another one: a window may still hold it."""


class Base(DeclarativeBase):
    """Common naming of constraints, so that migrations can speak of them."""

    metadata = MetaData(naming_convention=_NAMING)


class UserRow(Base):
    """A person who may sign in."""

    __tablename__ = "users"
    __table_args__ = _LASTING_IDS

    id: Mapped[int] = mapped_column(primary_key=True)
    username: Mapped[str] = mapped_column(String(64), unique=True)
    display_name: Mapped[str] = mapped_column(String(200))
    password_hash: Mapped[str] = mapped_column(String(255))
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)


class SettingRow(Base):
    """A setting of the whole clinic, for example its name."""

    __tablename__ = "settings"

    key: Mapped[str] = mapped_column(String(64), primary_key=True)
    value: Mapped[str] = mapped_column(Text)


class PatientRow(Base):
    """A patient."""

    __tablename__ = "patients"
    __table_args__ = (
        _one_of("sex", SEXES),
        Index("ix_patients_search_key", "search_key", "id"),
        _LASTING_IDS,
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    family_name: Mapped[str] = mapped_column(String(200))
    given_name: Mapped[str] = mapped_column(String(200))
    birth_date: Mapped[date | None] = mapped_column(Date)
    sex: Mapped[str] = mapped_column(String(1))
    clinic_number: Mapped[str] = mapped_column(String(64))
    clinic_number_key: Mapped[str | None] = mapped_column(String(64), unique=True)
    search_key: Mapped[str] = mapped_column(String(1000))
    note: Mapped[str] = mapped_column(Text)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    created_by: Mapped[int] = _user()
    updated_at: Mapped[datetime] = mapped_column(UtcDateTime)
    updated_by: Mapped[int] = _user()


class VisitRow(Base):
    """One consultation."""

    __tablename__ = "visits"
    __table_args__ = (UniqueConstraint("patient_id", "number"), _LASTING_IDS)

    id: Mapped[int] = mapped_column(primary_key=True)
    patient_id: Mapped[int] = mapped_column(ForeignKey("patients.id"))
    number: Mapped[int]
    started_at: Mapped[datetime] = mapped_column(UtcDateTime)
    started_by: Mapped[int] = _user()
    closed_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    closed_by: Mapped[int | None] = _user(nullable=True)
    note: Mapped[str] = mapped_column(Text)


class CaptureRow(Base):
    """A capture; its pictures are `CaptureImageRow`."""

    __tablename__ = "captures"
    __table_args__ = (_one_of("role", ROLES), _LASTING_IDS)

    id: Mapped[int] = mapped_column(primary_key=True)
    visit_id: Mapped[int] = mapped_column(ForeignKey("visits.id", ondelete="CASCADE"), index=True)
    role: Mapped[str] = mapped_column(String(16))
    view: Mapped[str] = mapped_column(String(200))
    stance: Mapped[str] = mapped_column(String(200))
    taken_at: Mapped[datetime] = mapped_column(UtcDateTime)
    stored_at: Mapped[datetime] = mapped_column(UtcDateTime)
    stored_by: Mapped[int | None] = _user(nullable=True)
    document: Mapped[dict[str, Any]] = mapped_column(JSON)


class CaptureImageRow(Base):
    """One picture file of a capture."""

    __tablename__ = "capture_images"
    __table_args__ = (_one_of("kind", ("depth", "color")),)

    capture_id: Mapped[int] = mapped_column(
        ForeignKey("captures.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    kind: Mapped[str] = mapped_column(String(8), primary_key=True)
    position: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    sha256: Mapped[str] = mapped_column(String(64), index=True)
    size_bytes: Mapped[int]


class AnchorRow(Base):
    """An anchor found on a capture."""

    __tablename__ = "anchors"

    capture_id: Mapped[int] = mapped_column(
        ForeignKey("captures.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    name: Mapped[str] = mapped_column(String(64), primary_key=True)
    x: Mapped[float] = mapped_column(Float)
    y: Mapped[float] = mapped_column(Float)
    z: Mapped[float] = mapped_column(Float)
    pixel_u: Mapped[float | None] = mapped_column(Float)
    pixel_v: Mapped[float | None] = mapped_column(Float)
    visibility: Mapped[float] = mapped_column(Float)
    sigma_m: Mapped[float] = mapped_column(Float)
    source: Mapped[str] = mapped_column(String(32))


class LesionRow(Base):
    """A lesion of a patient."""

    __tablename__ = "lesions"
    __table_args__ = (
        UniqueConstraint("patient_id", "number"),
        _one_of("state", LESION_STATES),
        _one_of("laterality", LATERALITIES),
        _LASTING_IDS,
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    patient_id: Mapped[int] = mapped_column(ForeignKey("patients.id"))
    visit_id: Mapped[int] = mapped_column(ForeignKey("visits.id"), index=True)
    number: Mapped[int]
    site_code: Mapped[str | None] = mapped_column(String(16))
    site_scheme: Mapped[str | None] = mapped_column(String(16))
    site_meaning: Mapped[str | None] = mapped_column(String(200))
    laterality: Mapped[str] = mapped_column(String(8))
    state: Mapped[str] = mapped_column(String(16))
    note: Mapped[str] = mapped_column(Text)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    created_by: Mapped[int] = _user()
    updated_at: Mapped[datetime] = mapped_column(UtcDateTime)
    updated_by: Mapped[int] = _user()


class ObservationRow(Base):
    """A lesion on one capture: the proposal and the decision."""

    __tablename__ = "observations"
    __table_args__ = (
        UniqueConstraint("lesion_id", "capture_id"),
        _one_of("status", STATUSES),
        _one_of("decision", DECISIONS),
        _LASTING_IDS,
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    lesion_id: Mapped[int] = mapped_column(ForeignKey("lesions.id", ondelete="CASCADE"))
    visit_id: Mapped[int] = mapped_column(ForeignKey("visits.id", ondelete="CASCADE"), index=True)
    capture_id: Mapped[int] = mapped_column(ForeignKey("captures.id"), index=True)
    status: Mapped[str] = mapped_column(String(16))
    u: Mapped[float | None] = mapped_column(Float)
    v: Mapped[float | None] = mapped_column(Float)
    x: Mapped[float | None] = mapped_column(Float)
    y: Mapped[float | None] = mapped_column(Float)
    z: Mapped[float | None] = mapped_column(Float)
    proposed_u: Mapped[float | None] = mapped_column(Float)
    proposed_v: Mapped[float | None] = mapped_column(Float)
    proposed_x: Mapped[float | None] = mapped_column(Float)
    proposed_y: Mapped[float | None] = mapped_column(Float)
    proposed_z: Mapped[float | None] = mapped_column(Float)
    radius95_m: Mapped[float | None] = mapped_column(Float)
    confidence: Mapped[float | None] = mapped_column(Float)
    appearance_matched: Mapped[bool]
    method: Mapped[str] = mapped_column(String(64))
    reason: Mapped[str] = mapped_column(Text)
    candidates: Mapped[list[dict[str, Any]]] = mapped_column(JSON)
    decision: Mapped[str] = mapped_column(String(16))
    decided_by: Mapped[int | None] = _user(nullable=True)
    decided_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    size_mm: Mapped[float | None] = mapped_column(Float)
    note: Mapped[str] = mapped_column(Text)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    created_by: Mapped[int] = _user()
    updated_at: Mapped[datetime] = mapped_column(UtcDateTime)
    updated_by: Mapped[int] = _user()


class ObservationEventRow(Base):
    """One step of an observation's history; rows are only ever added."""

    __tablename__ = "observation_events"
    __table_args__ = _LASTING_IDS

    id: Mapped[int] = mapped_column(primary_key=True)
    observation_id: Mapped[int] = mapped_column(ForeignKey("observations.id", ondelete="CASCADE"), index=True)
    at: Mapped[datetime] = mapped_column(UtcDateTime)
    by: Mapped[int] = _user()
    action: Mapped[str] = mapped_column(String(16))
    decision: Mapped[str] = mapped_column(String(16))
    status: Mapped[str] = mapped_column(String(16))
    u: Mapped[float | None] = mapped_column(Float)
    v: Mapped[float | None] = mapped_column(Float)
    x: Mapped[float | None] = mapped_column(Float)
    y: Mapped[float | None] = mapped_column(Float)
    z: Mapped[float | None] = mapped_column(Float)
    detail: Mapped[str] = mapped_column(Text)


class DermoscopicImageRow(Base):
    """A dermoscopic image of a lesion."""

    __tablename__ = "dermoscopic_images"
    __table_args__ = _LASTING_IDS

    id: Mapped[int] = mapped_column(primary_key=True)
    lesion_id: Mapped[int] = mapped_column(ForeignKey("lesions.id", ondelete="CASCADE"), index=True)
    visit_id: Mapped[int] = mapped_column(ForeignKey("visits.id", ondelete="CASCADE"), index=True)
    media_type: Mapped[str] = mapped_column(String(32))
    width: Mapped[int]
    height: Mapped[int]
    size_bytes: Mapped[int]
    sha256: Mapped[str] = mapped_column(String(64), index=True)
    note: Mapped[str] = mapped_column(Text)
    added_at: Mapped[datetime] = mapped_column(UtcDateTime)
    added_by: Mapped[int] = _user()
