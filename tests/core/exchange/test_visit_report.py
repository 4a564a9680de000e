from __future__ import annotations

import errno
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from core.capture.rgbd import RgbdCapture
from core.errors import InputError
from core.exchange.report import write_visit_report
from core.records import ClinicStore, Lesion, ObservationDraft, Patient, PatientDraft, User, Visit
from core.records.failures import DamagedError, StorageError
from core.records.sites import find_site, skin_sites

NOW = datetime(2026, 11, 22, 12, tzinfo=UTC)
DISCLAIMER = "GeoDerm measures and relocates; it does not diagnose."

needs_poppler = pytest.mark.skipif(
    not (shutil.which("pdftotext") and shutil.which("pdffonts") and shutil.which("pdfimages")),
    reason="poppler-utils is not installed",
)


def run(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def pages_of(path: Path) -> list[str]:
    pages = run("pdftotext", "-layout", str(path), "-").replace("\u00a0", " ").split("\f")
    return [" ".join(page.split()) for page in pages if page.strip()]


class Clinic:
    """One patient, filled step by step."""

    def __init__(
        self,
        store: ClinicStore,
        doctor: User,
        patient: Patient,
        body: Callable[..., RgbdCapture],
        moles: list[tuple[int, int]],
        image: Callable[[int], bytes],
    ) -> None:
        self.store, self.doctor, self.patient = store, doctor, patient
        self.body, self.moles, self.image = body, moles, image

    def draft(self, lesion: Lesion, visit: Visit, capture: int, status: str, i: int) -> ObservationDraft:
        u, v = self.moles[i % len(self.moles)]
        u += i // len(self.moles)
        point = ((u - 159.5) / 288 * 2.2, (v - 119.5) / 288 * 2.2, 2.2)
        return ObservationDraft(
            lesion.id, visit.id, capture, status, (2.0 * u, 2.0 * v), point, 0.0042, 0.93, "trilateration"
        )

    def first_visit(self, count: int, *, close: bool = True) -> tuple[Visit, list[Lesion]]:
        store, by = self.store, self.doctor.id
        visit = store.visits.create(self.patient.id, by)
        capture = store.captures.add(visit.id, self.body(), "working", by)
        lesions = []
        sites = skin_sites()
        for i in range(count):
            lesion = store.lesions.create(self.patient.id, visit.id, sites[i * 3], by=by)
            store.observations.put(self.draft(lesion, visit, capture.id, "marked", i), by)
            store.dermoscopy.add(lesion.id, visit.id, self.image(i), by)
            lesions.append(lesion)
        if close:
            store.visits.close(visit.id, by)
        return visit, lesions

    def report(self, visit: Visit, path: Path) -> Path:
        write_visit_report(self.store, visit.id, path, created_by=self.doctor, created_at=NOW)
        return path


@pytest.fixture
def clinic(
    store: ClinicStore,
    doctor: User,
    patient: Patient,
    body: Callable[..., RgbdCapture],
    moles: list[tuple[int, int]],
    dermoscopic_image: Callable[[int], bytes],
) -> Clinic:
    return Clinic(store, doctor, patient, body, moles, dermoscopic_image)


@pytest.fixture
def follow_up(clinic: Clinic) -> Visit:
    """Lesions 1 to 6: confirmed, corrected, waiting, not in view, rejected, new."""
    store, by = clinic.store, clinic.doctor.id
    _, lesions = clinic.first_visit(5)
    visit = store.visits.create(clinic.patient.id, by)
    capture = store.captures.add(visit.id, clinic.body(), "working", by)
    made = [
        store.observations.put(clinic.draft(lesion, visit, capture.id, "found", i), by)
        for i, lesion in enumerate(lesions[:3])
    ]
    store.observations.confirm(made[0].id, by)
    store.observations.annotate(made[0].id, by, size_mm=4.25, note="Darker & <larger> than in spring.")
    store.observations.correct(made[1].id, (300.0, 240.0), (0, 0, 2.2), by)
    store.observations.put(
        ObservationDraft(
            lesions[3].id, visit.id, capture.id, "not_visible", reason="behind the raised forearm"
        ),
        by,
    )
    rejected = store.observations.put(clinic.draft(lesions[4], visit, capture.id, "predicted", 4), by)
    store.observations.reject(rejected.id, by)
    new = store.lesions.create(clinic.patient.id, visit.id, find_site("66643007"), by=by)
    store.observations.put(clinic.draft(new, visit, capture.id, "marked", 5), by)
    store.dermoscopy.add(lesions[0].id, visit.id, clinic.image(50), by)
    return store.visits.set_note(visit.id, "Příště za šest měsíců. Ωραία! Hẹn gặp lại.")


@needs_poppler
class TestContent:
    def test_who_when_and_what(self, clinic: Clinic, follow_up: Visit, tmp_path: Path) -> None:
        pages = pages_of(clinic.report(follow_up, tmp_path / "report.pdf"))
        first, everything = pages[0], " ".join(pages)
        for text in (
            "Dermatologie Žižkov",
            "Visit report",
            "Nguyễn Thị, Ελένη",
            "14 Mar 1968",
            "Female",
            "CZ-417",
            "No. 2",
            "MUDr. Žofie Šťastná",
            "Příště za šest měsíců. Ωραία! Hẹn gặp lại.",
            "Not on these photos: 4, 5.",
        ):
            assert text in first, text
        for text in (
            "Confirmed by the doctor",
            "Corrected by the doctor",
            "Found, not yet confirmed",
            "Not in view (behind the raised forearm)",
            "Proposed place rejected",
            "New, marked by the doctor",
            "high (93 %) confidence, 95 % within 4.2 mm",
            "4.2 mm",
            "Darker & <larger> than in spring.",
            "No dermoscopic image",
            "Not placed on a photo",
            "New at this visit",
        ):
            assert text in everything, text

    def test_every_page_says_whose_it_is_and_which_of_how_many(
        self, clinic: Clinic, follow_up: Visit, tmp_path: Path
    ) -> None:
        pages = pages_of(clinic.report(follow_up, tmp_path / "report.pdf"))
        assert len(pages) > 1
        for i, page in enumerate(pages, start=1):
            assert f"Page {i} of {len(pages)}" in page
            assert DISCLAIMER in page
            assert "Nguyễn Thị, Ελένη" in page
            assert "CZ-417" in page

    def test_both_visits_are_shown_side_by_side(
        self, clinic: Clinic, follow_up: Visit, tmp_path: Path
    ) -> None:
        path = clinic.report(follow_up, tmp_path / "report.pdf")
        listed = run("pdfimages", "-list", str(path)).splitlines()[2:]
        # one map; crops: 5 of the previous visit, 4 placed now; dermoscopy: 5 then, 1 now
        assert len(listed) == 1 + 9 + 6

    def test_fonts_are_embedded_subsets_of_one_family(
        self, clinic: Clinic, follow_up: Visit, tmp_path: Path
    ) -> None:
        rows = run("pdffonts", str(clinic.report(follow_up, tmp_path / "report.pdf"))).splitlines()[2:]
        assert rows
        assert all("DejaVuSans" in row for row in rows)
        assert all(re.search(r"yes +yes +yes", row) for row in rows)

    def test_sixty_lesions_are_all_listed_and_shown(self, clinic: Clinic, tmp_path: Path) -> None:
        visit, lesions = clinic.first_visit(60)
        pages = pages_of(clinic.report(visit, tmp_path / "report.pdf"))
        everything = " ".join(pages)
        assert everything.count("Marked by MUDr. Žofie Šťastná") == 60
        for lesion in lesions:
            assert lesion.site is not None
            assert lesion.site.name.split(",")[0][:25] in everything

    def test_a_patient_without_lesions_or_photos(self, clinic: Clinic, tmp_path: Path) -> None:
        visit = clinic.store.visits.create(clinic.patient.id, clinic.doctor.id)
        (page,) = pages_of(clinic.report(visit, tmp_path / "report.pdf"))
        assert "No lesion has been recorded for this patient." in page
        assert "No body photo was taken at this visit." in page
        assert "None, this is the first" in page

    def test_long_names_and_notes_run_on(self, clinic: Clinic, tmp_path: Path) -> None:
        visit, lesions = clinic.first_visit(2, close=False)
        store, by = clinic.store, clinic.doctor.id
        store.patients.update(
            clinic.patient.id, PatientDraft("Wolfeschlegelsteinhausenbergerdorff" * 4, "Hubert " * 25), by
        )
        store.lesions.update(
            lesions[0].id, note="W" * 3000 + " " + "irregular border " * 800 + "THE END", by=by
        )
        store.visits.set_note(visit.id, "\n".join(f"line {i}" for i in range(200)))
        pages = pages_of(clinic.report(visit, tmp_path / "report.pdf"))
        everything = " ".join(pages)
        assert "THE END" in everything
        assert "line 199" in everything
        assert all(DISCLAIMER in page for page in pages)

    def test_a_depth_only_capture_is_shown_as_a_relief(self, clinic: Clinic, tmp_path: Path) -> None:
        store, by = clinic.store, clinic.doctor.id
        visit = store.visits.create(clinic.patient.id, by)
        capture = store.captures.add(visit.id, clinic.body(color=False), "working", by)
        lesion = store.lesions.create(clinic.patient.id, visit.id, by=by)
        store.observations.put(
            ObservationDraft(lesion.id, visit.id, capture.id, "marked", (158.0, 120.0)), by
        )
        path = clinic.report(visit, tmp_path / "report.pdf")
        assert len(run("pdfimages", "-list", str(path)).splitlines()[2:]) == 3
        assert "Site not stated" in " ".join(pages_of(path))

    def test_two_views_and_another_picture_as_body_map(self, clinic: Clinic, tmp_path: Path) -> None:
        visit, _ = clinic.first_visit(3, close=False)
        store, by = clinic.store, clinic.doctor.id
        back = store.captures.add(visit.id, clinic.body(view="back"), "working", by)
        new = store.lesions.create(clinic.patient.id, visit.id, by=by)
        store.observations.put(clinic.draft(new, visit, back.id, "marked", 3), by)
        page = pages_of(clinic.report(visit, tmp_path / "report.pdf"))[0]
        assert "Front view" in page
        assert "Back view" in page
        other = tmp_path / "other.pdf"
        write_visit_report(
            store, visit.id, other, created_by=clinic.doctor, created_at=NOW, body_map=clinic.image(1)
        )
        assert "Front view" not in " ".join(pages_of(other))


class TestWriting:
    def test_the_same_visit_gives_the_same_bytes(
        self, clinic: Clinic, follow_up: Visit, tmp_path: Path
    ) -> None:
        a = clinic.report(follow_up, tmp_path / "a.pdf")
        b = clinic.report(follow_up, tmp_path / "b.pdf")
        assert a.read_bytes() == b.read_bytes()
        assert a.read_bytes().startswith(b"%PDF")

    def test_a_full_disk_keeps_the_old_report(
        self, clinic: Clinic, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        visit, _ = clinic.first_visit(1)
        path = tmp_path / "out" / "report.pdf"
        path.parent.mkdir()
        path.write_bytes(b"old")

        def failing(handle: int) -> None:
            raise OSError(errno.ENOSPC, "full")

        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", failing)
            with pytest.raises(StorageError, match="The disk with the folder of the report is full"):
                clinic.report(visit, path)
        assert path.read_bytes() == b"old"
        assert list(path.parent.iterdir()) == [path]

    def test_wrong_places_and_inputs_are_clear(self, clinic: Clinic, tmp_path: Path) -> None:
        visit, _ = clinic.first_visit(1)
        with pytest.raises(StorageError, match="cannot reach the folder of the report"):
            clinic.report(visit, tmp_path / "nowhere" / "report.pdf")
        with pytest.raises(InputError, match="not a folder"):
            clinic.report(visit, tmp_path)
        with pytest.raises(InputError, match="body map is not a readable picture"):
            write_visit_report(
                clinic.store, visit.id, tmp_path / "r.pdf", created_by=clinic.doctor, body_map=b"no"
            )

    def test_a_damaged_photo_is_said_and_nothing_is_written(self, clinic: Clinic, tmp_path: Path) -> None:
        visit, _ = clinic.first_visit(1)
        for path in (clinic.store.folder / "blobs").glob("??/*"):
            path.write_bytes(b"spoilt")
        with pytest.raises(DamagedError):
            clinic.report(visit, tmp_path / "report.pdf")
        assert not (tmp_path / "report.pdf").exists()
