"""Anchors found on captures."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import delete, select

from core.records.database import Database
from core.records.failures import missing
from core.records.models import AnchorRow, CaptureRow
from core.records.records import AnchorRecord


class Anchors:
    """Anchors of all captures."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def put(self, capture_id: int, anchors: Sequence[AnchorRecord]) -> None:
        """Store the anchors of a capture in place of those that it had."""
        with self._db.write() as session:
            if session.get(CaptureRow, capture_id) is None:
                raise missing("capture")
            session.execute(delete(AnchorRow).where(AnchorRow.capture_id == capture_id))
            session.add_all(
                AnchorRow(
                    capture_id=capture_id,
                    name=a.name,
                    x=float(a.x),
                    y=float(a.y),
                    z=float(a.z),
                    pixel_u=None if a.pixel_u is None else float(a.pixel_u),
                    pixel_v=None if a.pixel_v is None else float(a.pixel_v),
                    visibility=float(a.visibility),
                    sigma_m=float(a.sigma_m),
                    source=a.source,
                )
                for a in anchors
            )

    def list(self, capture_id: int) -> list[AnchorRecord]:
        """Anchors of a capture, by name."""
        with self._db.read() as session:
            rows = session.scalars(
                select(AnchorRow).where(AnchorRow.capture_id == capture_id).order_by(AnchorRow.name)
            )
            return [
                AnchorRecord(r.name, r.x, r.y, r.z, r.pixel_u, r.pixel_v, r.visibility, r.sigma_m, r.source)
                for r in rows
            ]
