"""Observations: where a lesion is on a capture, who proposed it and who decided; nothing is forgotten."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from sqlalchemy import select
from sqlalchemy.orm import Session

from core.errors import InputError
from core.records.database import Database
from core.records.failures import missing
from core.records.models import CaptureRow, LesionRow, ObservationEventRow, ObservationRow, VisitRow
from core.records.records import (
    STATUSES,
    CandidatePlace,
    Observation,
    ObservationDraft,
    ObservationEvent,
    Pixel,
    Point,
)
from core.records.text import clean_note


def _numbers(values: Sequence[float] | None, count: int, field: str) -> tuple[float | None, ...]:
    if values is None:
        return (None,) * count
    numbers = tuple(float(v) for v in values)
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise InputError(f"The {field} of a lesion must be {count} finite numbers.")
    return numbers


def _finite(value: float | None, field: str, *, top: float = float("inf")) -> float | None:
    if value is None:
        return None
    number = float(value)
    if not (np.isfinite(number) and 0 <= number <= top):
        raise InputError(f"The {field} of a lesion is out of range.")
    return number


def _pixel(u: float | None, v: float | None) -> Pixel | None:
    return None if u is None or v is None else (u, v)


def _point(x: float | None, y: float | None, z: float | None) -> Point | None:
    return None if x is None or y is None or z is None else (x, y, z)


def _candidate_document(candidate: CandidatePlace) -> dict[str, Any]:
    pixel = _numbers(candidate.pixel, 2, "pixel")
    point = _numbers(candidate.point_m, 3, "point")
    return {
        "pixel": None if candidate.pixel is None else list(pixel),
        "point_m": None if candidate.point_m is None else list(point),
        "confidence": _finite(candidate.confidence, "confidence", top=1.0),
    }


def _candidate(document: dict[str, Any]) -> CandidatePlace:
    pixel, point = document["pixel"], document["point_m"]
    return CandidatePlace(
        None if pixel is None else (pixel[0], pixel[1]),
        None if point is None else (point[0], point[1], point[2]),
        document["confidence"],
    )


def _observation(row: ObservationRow) -> Observation:
    return Observation(
        id=row.id,
        lesion_id=row.lesion_id,
        visit_id=row.visit_id,
        capture_id=row.capture_id,
        status=row.status,  # type: ignore[arg-type]
        pixel=_pixel(row.u, row.v),
        point_m=_point(row.x, row.y, row.z),
        proposed_pixel=_pixel(row.proposed_u, row.proposed_v),
        proposed_point_m=_point(row.proposed_x, row.proposed_y, row.proposed_z),
        radius95_m=row.radius95_m,
        confidence=row.confidence,
        appearance_matched=row.appearance_matched,
        method=row.method,
        reason=row.reason,
        candidates=tuple(_candidate(c) for c in row.candidates),
        decision=row.decision,  # type: ignore[arg-type]
        decided_by=row.decided_by,
        decided_at=row.decided_at,
        size_mm=row.size_mm,
        note=row.note,
        created_at=row.created_at,
        created_by=row.created_by,
        updated_at=row.updated_at,
        updated_by=row.updated_by,
    )


class Observations:
    """Observations of all lesions."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def put(self, draft: ObservationDraft, by: int) -> Observation:
        """Record a proposal, or the doctor's own mark (status ``marked``), for a lesion on a capture.

        There is one observation per lesion and capture. A new proposal replaces an old one; if a person
        has already decided, the decision and its place stay in force and only the proposal is renewed.
        """
        return self.put_many([draft], by)[0]

    def put_many(self, drafts: Sequence[ObservationDraft], by: int) -> list[Observation]:
        """Record several drafts, all or none."""
        with self._db.write() as session:
            rows = [self._put(session, draft, by) for draft in drafts]
            session.flush()
            return [_observation(row) for row in rows]

    def _put(self, session: Session, draft: ObservationDraft, by: int) -> ObservationRow:
        if draft.status not in STATUSES:
            raise InputError(f"The status of a lesion must be one of {', '.join(STATUSES)}.")
        u, v = _numbers(draft.pixel, 2, "pixel")
        x, y, z = _numbers(draft.point_m, 3, "point")
        self._check_belongs(session, draft)
        now = datetime.now(UTC)
        row = session.scalar(
            select(ObservationRow).where(
                ObservationRow.lesion_id == draft.lesion_id, ObservationRow.capture_id == draft.capture_id
            )
        )
        is_new = row is None
        if row is None:
            row = ObservationRow(
                lesion_id=draft.lesion_id,
                visit_id=draft.visit_id,
                capture_id=draft.capture_id,
                decision="proposed",
                created_at=now,
                created_by=by,
                note="",
                candidates=[],
                appearance_matched=False,
                method="",
                reason="",
            )
            session.add(row)
        row.updated_at, row.updated_by = now, by
        if draft.note or is_new:
            row.note = clean_note(draft.note)
        if draft.size_mm is not None or is_new:
            row.size_mm = _finite(draft.size_mm, "size", top=1000.0)
        if draft.status == "marked":
            row.status, row.decision = "marked", "marked"
            row.decided_by, row.decided_at = by, now
            row.u, row.v, row.x, row.y, row.z = u, v, x, y, z
            self._log(session, row, "marked", by, now)
            return row
        row.proposed_u, row.proposed_v = u, v
        row.proposed_x, row.proposed_y, row.proposed_z = x, y, z
        row.radius95_m = _finite(draft.radius95_m, "radius")
        row.confidence = _finite(draft.confidence, "confidence", top=1.0)
        row.appearance_matched = bool(draft.appearance_matched)
        row.method, row.reason = draft.method, draft.reason
        row.candidates = [_candidate_document(c) for c in draft.candidates]
        if row.decision == "proposed":
            row.status = draft.status
            row.u, row.v, row.x, row.y, row.z = u, v, x, y, z
        self._log(session, row, "proposed", by, now, detail=draft.method)
        return row

    def confirm(self, observation_id: int, by: int) -> Observation:
        """The doctor agrees with the proposal, also with a proposal that the lesion is not in view."""

        def apply(row: ObservationRow) -> None:
            row.u, row.v = row.proposed_u, row.proposed_v
            row.x, row.y, row.z = row.proposed_x, row.proposed_y, row.proposed_z

        return self._decide(observation_id, "confirmed", by, apply)

    def correct(
        self, observation_id: int, pixel: Sequence[float] | None, point_m: Sequence[float] | None, by: int
    ) -> Observation:
        """The doctor puts the lesion at another place; the proposed place is kept beside it."""
        if pixel is None and point_m is None:
            raise InputError("A corrected lesion needs a place.", "Click on the lesion in the photo.")
        u, v = _numbers(pixel, 2, "pixel")
        x, y, z = _numbers(point_m, 3, "point")

        def apply(row: ObservationRow) -> None:
            row.u, row.v, row.x, row.y, row.z = u, v, x, y, z

        return self._decide(observation_id, "corrected", by, apply)

    def reject(self, observation_id: int, by: int, reason: str = "") -> Observation:
        """The doctor does not accept the proposal and gives no other place."""
        return self._decide(observation_id, "rejected", by, lambda row: None, detail=clean_note(reason))

    def reopen(self, observation_id: int, by: int) -> Observation:
        """Take a decision back: the proposal is in force again and waits for a decision."""

        def apply(row: ObservationRow) -> None:
            if row.status == "marked" and row.proposed_u is None and row.proposed_x is None:
                raise InputError("The doctor marked this lesion; there is no proposal to return to.")
            row.u, row.v = row.proposed_u, row.proposed_v
            row.x, row.y, row.z = row.proposed_x, row.proposed_y, row.proposed_z

        return self._decide(observation_id, "proposed", by, apply, action="reopened")

    def annotate(
        self, observation_id: int, by: int, *, note: str | None = None, size_mm: float | None = None
    ) -> Observation:
        """Set the note or the measured size of an observation."""
        with self._db.write() as session:
            row = self._row(session, observation_id)
            if note is not None:
                row.note = clean_note(note)
            if size_mm is not None:
                row.size_mm = _finite(size_mm, "size", top=1000.0)
            row.updated_at, row.updated_by = datetime.now(UTC), by
            self._log(session, row, "annotated", by, row.updated_at)
            session.flush()
            return _observation(row)

    def get(self, observation_id: int) -> Observation:
        """One observation."""
        with self._db.read() as session:
            return _observation(self._row(session, observation_id))

    def for_visit(self, visit_id: int) -> list[Observation]:
        """Observations of a visit, by lesion number, then by capture."""
        with self._db.read() as session:
            rows = session.scalars(
                select(ObservationRow)
                .join(LesionRow, ObservationRow.lesion_id == LesionRow.id)
                .where(ObservationRow.visit_id == visit_id)
                .order_by(LesionRow.number, ObservationRow.capture_id)
            )
            return [_observation(row) for row in rows]

    def for_lesion(self, lesion_id: int) -> list[Observation]:
        """Observations of a lesion, first visit first."""
        with self._db.read() as session:
            rows = session.scalars(
                select(ObservationRow)
                .join(VisitRow, ObservationRow.visit_id == VisitRow.id)
                .where(ObservationRow.lesion_id == lesion_id)
                .order_by(VisitRow.number, ObservationRow.capture_id)
            )
            return [_observation(row) for row in rows]

    def history(self, observation_id: int) -> list[ObservationEvent]:
        """Everything that happened to an observation, oldest first."""
        with self._db.read() as session:
            rows = session.scalars(
                select(ObservationEventRow)
                .where(ObservationEventRow.observation_id == observation_id)
                .order_by(ObservationEventRow.id)
            )
            return [
                ObservationEvent(
                    id=row.id,
                    observation_id=row.observation_id,
                    at=row.at,
                    by=row.by,
                    action=row.action,
                    decision=row.decision,  # type: ignore[arg-type]
                    status=row.status,  # type: ignore[arg-type]
                    pixel=_pixel(row.u, row.v),
                    point_m=_point(row.x, row.y, row.z),
                    detail=row.detail,
                )
                for row in rows
            ]

    def _decide(
        self,
        observation_id: int,
        decision: str,
        by: int,
        apply: Any,
        *,
        action: str | None = None,
        detail: str = "",
    ) -> Observation:
        with self._db.write() as session:
            row = self._row(session, observation_id)
            apply(row)
            now = datetime.now(UTC)
            row.decision = decision
            row.decided_by, row.decided_at = (None, None) if decision == "proposed" else (by, now)
            row.updated_at, row.updated_by = now, by
            self._log(session, row, action or decision, by, now, detail=detail)
            session.flush()
            return _observation(row)

    @staticmethod
    def _log(
        session: Session, row: ObservationRow, action: str, by: int, at: datetime, *, detail: str = ""
    ) -> None:
        session.flush()
        session.add(
            ObservationEventRow(
                observation_id=row.id,
                at=at,
                by=by,
                action=action,
                decision=row.decision,
                status=row.status,
                u=row.u,
                v=row.v,
                x=row.x,
                y=row.y,
                z=row.z,
                detail=detail,
            )
        )

    @staticmethod
    def _check_belongs(session: Session, draft: ObservationDraft) -> None:
        lesion = session.get(LesionRow, draft.lesion_id)
        visit = session.get(VisitRow, draft.visit_id)
        capture = session.get(CaptureRow, draft.capture_id)
        if lesion is None:
            raise missing("lesion")
        if visit is None or visit.patient_id != lesion.patient_id:
            raise missing("visit")
        if capture is None or capture.visit_id != visit.id:
            raise missing("capture")

    @staticmethod
    def _row(session: Session, observation_id: int) -> ObservationRow:
        row = session.get(ObservationRow, observation_id)
        if row is None:
            raise missing("observation")
        return row
