"""The visit report: one PDF a patient can take home and a colleague can read."""

from __future__ import annotations

import io
from datetime import UTC, datetime
from pathlib import Path

from core.errors import InputError
from core.exchange.report_data import gather, require_picture
from core.records.blobs import write_atomically
from core.records.failures import told_to_the_user
from core.records.records import User
from core.records.store import ClinicStore


def write_visit_report(
    store: ClinicStore,
    visit_id: int,
    path: Path,
    *,
    created_by: User,
    body_map: bytes | None = None,
    created_at: datetime | None = None,
) -> None:
    """Write the report of a visit as an A4 PDF, whole or not at all.

    Parameters
    ----------
    store : ClinicStore
    visit_id : int
    path : Path
        Replaced if it exists.
    created_by : User
        Printed as the author.
    body_map : bytes, optional
        A picture (PNG or JPEG) to print as the body map, for example of the 3D body. Default: the photos
        of the visit's captures with numbered lesions.
    created_at : datetime, optional
        Printed date; default now. The same visit and date give the same bytes.

    Raises
    ------
    InputError
        If there is no such visit, or the body map is not a picture.
    StorageError
        If a stored picture is damaged, or the disk is full, read-only or gone.
    """
    from core.exchange.report_pages import build_pdf

    path = Path(path)
    if path.is_dir():
        raise InputError("The report needs a file name, not a folder.", "Choose a name that ends in .pdf.")
    if body_map is not None:
        require_picture(body_map)
    report = gather(store, visit_id, created_by, created_at or datetime.now(UTC))
    out = io.BytesIO()
    build_pdf(store, report, out, body_map)
    with told_to_the_user("the folder of the report"):
        write_atomically(path, out.getvalue())
