"""Dermoscopic images of lesions."""

from __future__ import annotations

from datetime import UTC, datetime

from sqlalchemy import delete, select

from core.errors import InputError
from core.records.blobs import BlobStore
from core.records.database import Database
from core.records.failures import missing
from core.records.images import check_image, thumbnail_png
from core.records.models import DermoscopicImageRow, LesionRow, VisitRow
from core.records.records import DermoscopicImage
from core.records.text import clean_note


def _image(row: DermoscopicImageRow) -> DermoscopicImage:
    return DermoscopicImage(
        id=row.id,
        lesion_id=row.lesion_id,
        visit_id=row.visit_id,
        media_type=row.media_type,
        width=row.width,
        height=row.height,
        size_bytes=row.size_bytes,
        sha256=row.sha256,
        note=row.note,
        added_at=row.added_at,
        added_by=row.added_by,
    )


class Dermoscopy:
    """Dermoscopic images of all lesions."""

    def __init__(self, database: Database, blobs: BlobStore) -> None:
        self._db, self._blobs = database, blobs

    def add(self, lesion_id: int, visit_id: int, data: bytes, by: int, note: str = "") -> DermoscopicImage:
        """Attach an image file (JPEG, PNG, TIFF); its bytes are kept untouched.

        Raises
        ------
        InputError
            If the bytes are not a whole image of a sensible size.
        """
        facts = check_image(data)
        note = clean_note(note)
        with self._db.read() as session:
            lesion, visit = session.get(LesionRow, lesion_id), session.get(VisitRow, visit_id)
        if lesion is None:
            raise missing("lesion")
        if visit is None or visit.patient_id != lesion.patient_id:
            raise missing("visit")
        sha256 = self._blobs.put(data)
        with self._db.write() as session:
            if session.get(LesionRow, lesion_id) is None or session.get(VisitRow, visit_id) is None:
                raise missing("lesion")
            row = DermoscopicImageRow(
                lesion_id=lesion_id,
                visit_id=visit_id,
                media_type=facts.media_type,
                width=facts.width,
                height=facts.height,
                size_bytes=len(data),
                sha256=sha256,
                note=note,
                added_at=datetime.now(UTC),
                added_by=by,
            )
            session.add(row)
            session.flush()
            return _image(row)

    def get(self, image_id: int) -> DermoscopicImage:
        """One image, without its bytes."""
        with self._db.read() as session:
            row = session.get(DermoscopicImageRow, image_id)
        if row is None:
            raise missing("dermoscopic image")
        return _image(row)

    def data(self, image_id: int) -> bytes:
        """The bytes of the image file, exactly as they came."""
        return self._blobs.get(self.get(image_id).sha256)

    def thumbnail(self, image_id: int, longest_side: int = 256) -> bytes:
        """A small upright sRGB PNG of the image, made on demand."""
        return thumbnail_png(self.data(image_id), longest_side)

    def for_lesion(self, lesion_id: int) -> list[DermoscopicImage]:
        """Images of a lesion, first visit first, then in the order in which they were added."""
        with self._db.read() as session:
            rows = session.scalars(
                select(DermoscopicImageRow)
                .join(VisitRow, DermoscopicImageRow.visit_id == VisitRow.id)
                .where(DermoscopicImageRow.lesion_id == lesion_id)
                .order_by(VisitRow.number, DermoscopicImageRow.id)
            )
            return [_image(row) for row in rows]

    def for_visit(self, visit_id: int) -> list[DermoscopicImage]:
        """Images of a visit, by lesion number, then in the order in which they were added."""
        with self._db.read() as session:
            rows = session.scalars(
                select(DermoscopicImageRow)
                .join(LesionRow, DermoscopicImageRow.lesion_id == LesionRow.id)
                .where(DermoscopicImageRow.visit_id == visit_id)
                .order_by(LesionRow.number, DermoscopicImageRow.id)
            )
            return [_image(row) for row in rows]

    def remove(self, image_id: int, by: int) -> None:
        """Take a wrongly attached image away, while its visit is open."""
        with self._db.write() as session:
            row = session.get(DermoscopicImageRow, image_id)
            if row is None:
                raise missing("dermoscopic image")
            if session.get_one(VisitRow, row.visit_id).closed_at is not None:
                raise InputError("The images of a closed visit cannot be removed.")
            session.execute(delete(DermoscopicImageRow).where(DermoscopicImageRow.id == image_id))
