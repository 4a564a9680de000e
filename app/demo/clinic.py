"""The demonstration clinic: a user, a few patients, and one whose first visit is already closed.

Everything goes the way of a real visit: captures of the simulated patient, the skeleton tracker (never the
simulator's own joints), clicks on the picture, the clinic's records.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from app.demo.places import site_in_words
from app.workflows.session import VisitSession
from app.workflows.table import Event
from core.errors import GeodermError
from core.progress import Progress, ScaledProgress, no_progress
from core.records import ClinicStore, PatientDraft
from core.records.sites import skin_sites
from devices.simulator.camera_device import SimulatedScene

if TYPE_CHECKING:
    from core.anchors import SkeletonTracker
    from core.records import Patient
    from devices.simulator import SimulatedPatient
    from devices.simulator.truth import CaptureTruth

USERNAME = "demo"
PASSWORD = "demo-clinic"
DISPLAY_NAME = "Dr Ada Sommer"
BODY, BODY_SEED = "m_young_avg", 3
FOLLOW_UP_STANCE = "A"
_MARKER = "demonstration-clinic"


PREPARED = PatientDraft(
    "Novák", "Jiří", date(1986, 5, 14), "M", "GD-1042", "Simulated patient, one closed visit."
)
NEWCOMER = PatientDraft("Brandt", "Elisabeth", date(1979, 11, 2), "F", "GD-1043", "Simulated patient.")
OTHERS = (
    PatientDraft("Åkesson", "Maja", date(1993, 2, 27), "F", "GD-0871"),
    PatientDraft("Fournier", "Rémi", date(1958, 8, 9), "M", "GD-0915"),
    PatientDraft("Papadopoulou", "Eleni", date(1971, 1, 30), "F", "GD-0998"),
)


def simulated_patient() -> SimulatedPatient:
    """The person behind the prepared patient; the lesions change a little at the second visit."""
    from devices.simulator import SimulatedPatient, VisitChange

    return SimulatedPatient(
        BODY, BODY_SEED, lesions=60, changes={2: VisitChange(new_moles=2, growth={"L03": 1.35})}
    )


def sample_lesions(truth: CaptureTruth, lesion_ids: tuple[str, ...], count: int) -> list[str]:
    """Ids of up to ``count`` lesions of interest in view, spread over the body as far as they go."""
    seen = {
        name: truth.mole_points_m[i]
        for i, name in enumerate(truth.mole_ids)
        if name in lesion_ids and truth.mole_visible[i]
    }
    if not seen:
        return []
    names, points = list(seen), np.array(list(seen.values()))
    chosen = [int(np.argmin(points[:, 1]))]
    while len(chosen) < min(count, len(names)):
        gap = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(gap)))
    return sorted(names[i] for i in chosen)


def has_demo_clinic(folder: Path) -> bool:
    """Whether the folder holds a complete demonstration clinic."""
    return (folder / _MARKER).exists()


def prepare_demo_clinic(
    folder: Path,
    tracker: Callable[[], SkeletonTracker],
    *,
    lesions: int = 8,
    progress: Progress = no_progress,
) -> None:
    """Make the demonstration clinic in ``folder`` unless it is there; a half-made one is made anew.

    Raises
    ------
    GeodermError
        If the folder cannot be written, or holds something else.
    """
    if has_demo_clinic(folder):
        return
    if folder.exists() and any(folder.iterdir()) and not (folder / (_MARKER + ".part")).exists():
        raise GeodermError(f"{folder}: holds something else.", "Name an empty folder for the demonstration.")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / (_MARKER + ".part")).touch()
    with ClinicStore.open(folder) as store:
        user = store.users.create(USERNAME, DISPLAY_NAME, PASSWORD)
        for draft in (*OTHERS, NEWCOMER):
            store.patients.create(draft, by=user.id)
        prepared = store.patients.create(PREPARED, by=user.id)
        _first_visit(store, user.id, prepared, tracker, lesions, progress)
    (folder / (_MARKER + ".part")).rename(folder / _MARKER)


def _first_visit(
    store: ClinicStore,
    user_id: int,
    patient: Patient,
    tracker: Callable[[], SkeletonTracker],
    lesions: int,
    progress: Progress,
) -> None:
    from devices.simulator import SimulatedCamera

    person = simulated_patient()
    session = VisitSession.begin(store, user_id, patient.id, tracker)
    with SimulatedCamera(person, SimulatedScene("psi", "front", 1)) as camera:
        session.adopt_stance(session.take_stance(camera.capture(), ScaledProgress(progress, 0.1, 0.4)))
        if session.stance_candidate is not None:
            candidate = session.stance_candidate
            session.store_capture(candidate)
            session.adopt_accepted_stance()
        session.fire(Event.GO_CAPTURE)
        session.adopt_working(session.take_working(camera.capture(), ScaledProgress(progress, 0.5, 0.8)))
        assert camera.last is not None
        truth = camera.last.truth
    session.fire(Event.GO_LESIONS)
    capture_id = max(session.snapshot.views.values())
    sites = {site.name: site for site in skin_sites()}
    with tempfile.TemporaryDirectory() as scratch:
        for i, name in enumerate(sample_lesions(truth, person.lesion_ids, lesions)):
            progress(0.8 + 0.15 * i / lesions, "Marking lesions")
            u, v = truth.mole_pixels[truth.mole_ids.index(name)]
            lesion, _ = session.mark(capture_id, (float(u), float(v)))
            site_name, side = site_in_words(truth, name)
            session.set_site(lesion.id, replace(sites[site_name], laterality=side))
            image = Path(scratch) / f"{name}.png"
            image.write_bytes(person.dermoscopy_png(name, 1))
            session.attach_dermoscopy(lesion.id, image)
    session.fire(Event.GO_REVIEW)
    session.close()
    progress(1.0, "The demonstration clinic is ready")
