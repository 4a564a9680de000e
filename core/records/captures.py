"""Captures: pictures go to the blob store first, rows after."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from core.capture.rgbd import RgbdCapture
from core.errors import InputError
from core.progress import Progress, no_progress
from core.records.blobs import BlobStore
from core.records.capture_document import decode_capture, decode_color, decode_depth, encode_capture
from core.records.database import Database
from core.records.failures import missing
from core.records.models import CaptureImageRow, CaptureRow, ObservationRow, VisitRow
from core.records.records import ROLES, CaptureRecord
from core.records.text import clean_line


def _capture(row: CaptureRow) -> CaptureRecord:
    document = row.document
    has_color = "color" in document
    camera = document["color" if has_color else "depth"]["intrinsics"]
    return CaptureRecord(
        id=row.id,
        visit_id=row.visit_id,
        role=row.role,  # type: ignore[arg-type]
        view=row.view,
        stance=row.stance,
        taken_at=row.taken_at,
        stored_at=row.stored_at,
        stored_by=row.stored_by,
        frame_count=len(document["depth"]["frames"]),
        picture_size=(camera["width"], camera["height"]),
        has_color=has_color,
    )


class Captures:
    """Captures of all visits."""

    def __init__(self, database: Database, blobs: BlobStore) -> None:
        self._db, self._blobs = database, blobs

    def add(
        self,
        visit_id: int,
        capture: RgbdCapture,
        role: str,
        by: int | None = None,
        *,
        progress: Progress = no_progress,
    ) -> CaptureRecord:
        """Store a capture, bit for bit. When this returns it survives a power cut.

        Raises
        ------
        InputError
            If the visit is closed or the role unknown.
        StorageError
            If the disk is full, read-only or gone; nothing is then recorded.
        """
        if role not in ROLES:
            raise InputError("A capture is either psi or working.")
        self._require_open(visit_id)
        progress(0.0, "Packing pictures")
        encoded = encode_capture(capture)
        progress(0.5, "Storing pictures")
        files = [*encoded.depth_files, *([encoded.color_file] if encoded.color_file is not None else [])]
        names = self._blobs.put_many(files)
        progress(0.9, "Recording the capture")
        depth_count = len(encoded.depth_files)
        with self._db.write() as session:
            self._require_open(visit_id, session)
            row = CaptureRow(
                visit_id=visit_id,
                role=role,
                view=clean_line(capture.view, "view", longest=200),
                stance=clean_line(capture.stance, "stance", longest=200),
                taken_at=capture.taken_at,
                stored_at=datetime.now(UTC),
                stored_by=by,
                document=encoded.document,
            )
            session.add(row)
            session.flush()
            for i, (name, data) in enumerate(zip(names, files, strict=True)):
                is_depth = i < depth_count
                session.add(
                    CaptureImageRow(
                        capture_id=row.id,
                        kind="depth" if is_depth else "color",
                        position=i if is_depth else 0,
                        sha256=name,
                        size_bytes=len(data),
                    )
                )
            session.flush()
            record = _capture(row)
        progress(1.0, "Stored")
        return record

    def get(self, capture_id: int) -> CaptureRecord:
        """One capture, without its pictures."""
        with self._db.read() as session:
            return _capture(self._row(session, capture_id))

    def list(self, visit_id: int) -> list[CaptureRecord]:
        """Captures of a visit in the order in which they were stored."""
        with self._db.read() as session:
            rows = session.scalars(
                select(CaptureRow).where(CaptureRow.visit_id == visit_id).order_by(CaptureRow.id)
            )
            return [_capture(row) for row in rows]

    def load(self, capture_id: int, *, frames: int | None = None) -> RgbdCapture:
        """The capture exactly as it was stored, or with its first ``frames`` depth frames only.

        Raises
        ------
        DamagedError
            If a stored picture is missing or damaged.
        """
        with self._db.read() as session:
            document = self._row(session, capture_id).document
        depth = [self._blobs.get(name) for name in self._files(capture_id, "depth")[:frames]]
        color = [self._blobs.get(name) for name in self._files(capture_id, "color")]
        return decode_capture(document, depth, color[0] if color else None)

    def color_picture(self, capture_id: int) -> NDArray[np.uint8] | None:
        """The colour picture alone, RGB (h, w, 3); None for a depth-only capture."""
        names = self._files(capture_id, "color")
        return decode_color(self._blobs.get(names[0])) if names else None

    def depth_picture(self, capture_id: int) -> NDArray[np.uint16]:
        """The first raw depth frame (h, w), for showing a depth-only capture without loading it whole."""
        names = self._files(capture_id, "depth")
        if not names:
            raise missing("capture")
        return decode_depth(self._blobs.get(names[0]))

    def remove(self, capture_id: int, by: int) -> None:
        """Remove a capture from an open visit, for example to take it again.

        Raises
        ------
        InputError
            If the visit is closed or lesions were recorded on the capture.
        """
        with self._db.write() as session:
            row = self._row(session, capture_id)
            self._require_open(row.visit_id, session)
            used = session.scalar(
                select(func.count())
                .select_from(ObservationRow)
                .where(ObservationRow.capture_id == capture_id)
            )
            if used:
                raise InputError(
                    "Lesions were recorded on this capture.", "Discard the visit, or take another capture."
                )
            session.execute(delete(CaptureRow).where(CaptureRow.id == capture_id))

    def _files(self, capture_id: int, kind: str) -> tuple[str, ...]:
        with self._db.read() as session:
            return tuple(
                session.scalars(
                    select(CaptureImageRow.sha256)
                    .where(CaptureImageRow.capture_id == capture_id, CaptureImageRow.kind == kind)
                    .order_by(CaptureImageRow.position)
                )
            )

    @staticmethod
    def _row(session: Session, capture_id: int) -> CaptureRow:
        row = session.get(CaptureRow, capture_id)
        if row is None:
            raise missing("capture")
        return row

    def _require_open(self, visit_id: int, session: Session | None = None) -> None:
        if session is None:
            with self._db.read() as own:
                return self._require_open(visit_id, own)
        visit = session.get(VisitRow, visit_id)
        if visit is None:
            raise missing("visit")
        if visit.closed_at is not None:
            raise InputError("This visit is closed.", "Begin a new visit to take another capture.")
        return None
