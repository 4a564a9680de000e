"""One clinic: a folder with a database and the pictures it refers to."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

from sqlalchemy import select

from core.progress import Progress, no_progress
from core.records.anchors import Anchors
from core.records.blobs import BlobCipher, BlobStore
from core.records.captures import Captures
from core.records.database import Database, EngineFactory, plain_engine
from core.records.dermoscopy import Dermoscopy
from core.records.failures import told_to_the_user
from core.records.lesions import Lesions
from core.records.migrate import prepare_database
from core.records.models import CaptureImageRow, CaptureRow, DermoscopicImageRow, LesionRow, VisitRow
from core.records.observations import Observations
from core.records.patients import Patients
from core.records.settings import Settings
from core.records.users import Users
from core.records.visits import Visits

DATABASE_NAME = "clinic.db"
BLOBS_NAME = "blobs"


class ClinicStore:
    """The door to a clinic's records. May be used from several threads.

    Attributes
    ----------
    folder : Path
        The clinic folder: ``clinic.db`` and ``blobs/``.
    users, patients, visits, captures, anchors, lesions, observations, dermoscopy, settings
        One repository per kind of record.
    """

    def __init__(self, folder: Path, database: Database, blobs: BlobStore) -> None:
        self.folder = folder
        self._database = database
        self._blobs = blobs
        self.users = Users(database)
        self.settings = Settings(database)
        self.patients = Patients(database)
        self.visits = Visits(database)
        self.captures = Captures(database, blobs)
        self.anchors = Anchors(database)
        self.lesions = Lesions(database)
        self.observations = Observations(database)
        self.dermoscopy = Dermoscopy(database, blobs)

    @classmethod
    def open(
        cls,
        folder: Path,
        *,
        engine_factory: EngineFactory = plain_engine,
        cipher: BlobCipher | None = None,
    ) -> ClinicStore:
        """Open a clinic folder; create it if it is not there, upgrade it if it is older.

        Parameters
        ----------
        folder : Path
        engine_factory : callable
            Makes the database engine; the seam for an encrypted database.
        cipher : BlobCipher, optional
            Seals pictures before they reach the disk.

        Raises
        ------
        WorkError
            If the folder was written by a newer version or is not a clinic.
        StorageError
            If the folder cannot be read and written.
        """
        folder = Path(folder)
        with told_to_the_user():
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            blobs = BlobStore(folder / BLOBS_NAME, cipher)
        path = folder / DATABASE_NAME
        database = Database(engine_factory(path))
        try:
            prepare_database(database, path)
        except BaseException:
            database.dispose()
            raise
        return cls(folder, database, blobs)

    def close(self) -> None:
        """Close every connection to the database."""
        self._database.dispose()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def verify(self, *, progress: Progress = no_progress) -> list[str]:
        """Recompute the hash of every stored picture and check the database.

        Returns
        -------
        list of str
            One sentence per damaged thing, empty if all is well. Records are named by their numbers,
            never by a patient's name.
        """
        problems = self._verify_database()
        users = self._blob_users()
        for i, (name, where) in enumerate(sorted(users.items())):
            progress(i / len(users), "Checking pictures")
            wrong = self._blobs.check(name)
            if wrong is not None:
                problems += [f"{place} is {wrong}." for place in where]
        progress(1.0, "Checked")
        return problems

    def remove_orphans(self, *, min_age_s: float = 3600.0) -> int:
        """Remove pictures that no record refers to (a crash, a discarded visit) and return how many."""
        return self._blobs.remove_unused(self._blob_users(), min_age_s=min_age_s)

    def _verify_database(self) -> list[str]:
        with self._database.read() as session:
            connection = session.connection()
            found = [row[0] for row in connection.exec_driver_sql("PRAGMA integrity_check(20)")]
            dangling = connection.exec_driver_sql("PRAGMA foreign_key_check").all()
        problems = [f"The database is damaged: {text}." for text in found if text != "ok"]
        problems += [f"A row of {row[0]} refers to a missing row of {row[2]}." for row in dangling]
        return problems

    def _blob_users(self) -> dict[str, list[str]]:
        """Every blob in use, with the places that use it in words."""
        users: dict[str, list[str]] = {}
        with self._database.read() as session:
            captures = session.execute(
                select(
                    CaptureImageRow.sha256,
                    CaptureImageRow.kind,
                    CaptureImageRow.position,
                    CaptureRow.id,
                    VisitRow.number,
                    VisitRow.patient_id,
                )
                .join(CaptureRow, CaptureImageRow.capture_id == CaptureRow.id)
                .join(VisitRow, CaptureRow.visit_id == VisitRow.id)
                .order_by(CaptureRow.id, CaptureImageRow.kind, CaptureImageRow.position)
            )
            for sha256, kind, position, capture_id, visit, patient in captures:
                picture = "The colour picture" if kind == "color" else f"Depth frame {position + 1}"
                users.setdefault(sha256, []).append(
                    f"{picture} of capture {capture_id} (patient record {patient}, visit {visit})"
                )
            images = session.execute(
                select(
                    DermoscopicImageRow.sha256,
                    DermoscopicImageRow.id,
                    LesionRow.number,
                    VisitRow.number,
                    VisitRow.patient_id,
                )
                .join(LesionRow, DermoscopicImageRow.lesion_id == LesionRow.id)
                .join(VisitRow, DermoscopicImageRow.visit_id == VisitRow.id)
                .order_by(DermoscopicImageRow.id)
            )
            for sha256, image_id, lesion, visit, patient in images:
                place = f"(patient record {patient}, visit {visit})"
                users.setdefault(sha256, []).append(
                    f"Dermoscopic image {image_id} of lesion {lesion} {place}"
                )
        return users
