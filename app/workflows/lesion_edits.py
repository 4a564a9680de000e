"""What the doctor does to lesions in a visit: each act checked against the skin and stored at once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from app.workflows.evidence import VisitEvidence
from app.workflows.snapshot import VisitSnapshot
from app.workflows.table import Refused
from app.workflows.wording import is_confident
from core.errors import InputError
from core.records import AnatomicSite, DermoscopicImage, Lesion, Observation, ObservationDraft

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.records import ClinicStore
    from core.surface import SkinPick

Pixel = tuple[float, float]
Point = tuple[float, float, float]

NOT_IN_VIEW = "Not in view"
REPLACED = "The capture was taken again"
MAX_IMAGE_BYTES = 200_000_000

_ADVICE = {
    "not on the body": "Click on the patient's skin.",
    "outside": "Click inside the photo.",
    "depth camera": "Capture the body again with this skin facing both cameras.",
    "hair": "Part the hair and take the capture again, or mark the lesion beside the hair.",
}


class LesionEdits:
    """Edits of one visit.

    Parameters
    ----------
    store : ClinicStore
    by : int
        Who does it.
    snapshot : callable
        The records as they are now.
    analysed : callable
        Capture id to its analysis in memory; raises `Refused` if it is not ready.
    evidence : VisitEvidence
    """

    def __init__(
        self,
        store: ClinicStore,
        by: int,
        snapshot: Callable[[], VisitSnapshot],
        analysed: Callable[[int], AnalysedCapture],
        evidence: VisitEvidence,
    ) -> None:
        self._store, self._by, self._snapshot, self._analysed = store, by, snapshot, analysed
        self._evidence = evidence

    def pick(self, capture_id: int, pixel: Pixel) -> tuple[Point, tuple[str, ...]]:
        """The skin under a pixel of a capture's picture, with warnings.

        Raises
        ------
        Refused
            If it is not skin, with what to do.
        """
        from core.surface import pick_skin

        analysed = self._analysed(capture_id)
        head = analysed.skeleton.joints.get("head")
        picked: SkinPick = pick_skin(analysed.scan, pixel, head_m=None if head is None else head.point_m)
        if picked.point is None:
            reason = picked.reason or "There is no skin at this place."
            advice = next(
                (a for word, a in _ADVICE.items() if word in reason), "Click on the patient's skin."
            )
            raise Refused(reason, advice)
        x, y, z = (float(c) for c in picked.point.position_m)
        return (x, y, z), picked.warnings

    def mark(self, capture_id: int, pixel: Pixel) -> tuple[Lesion, tuple[str, ...]]:
        """Mark a new lesion; nothing is stored if the click is not on skin."""
        point, warnings = self.pick(capture_id, pixel)
        visit = self._snapshot().visit
        lesion = self._store.lesions.create(visit.patient_id, visit.id, by=self._by)
        self._store.observations.put(
            ObservationDraft(lesion.id, visit.id, capture_id, "marked", pixel=pixel, point_m=point),
            by=self._by,
        )
        return lesion, warnings

    def move(self, lesion_id: int, capture_id: int, pixel: Pixel) -> tuple[str, ...]:
        """Put a lesion where the doctor dragged or placed it, and return warnings.

        A lesion that the doctor marked stays marked; a proposed place is kept beside the corrected one.
        """
        point, warnings = self.pick(capture_id, pixel)
        snapshot = self._snapshot()
        here = [
            o
            for o in snapshot.observations.get(lesion_id, ())
            if o.visit_id == snapshot.visit.id and o.capture_id == capture_id
        ]
        before = snapshot.in_force(lesion_id)
        if here and here[-1].decision != "marked":
            self._store.observations.correct(here[-1].id, pixel, point, self._by)
        else:
            self._store.observations.put(
                ObservationDraft(
                    lesion_id, snapshot.visit.id, capture_id, "marked", pixel=pixel, point_m=point
                ),
                by=self._by,
            )
        if before is not None and before.capture_id != capture_id:
            self._store.observations.reject(before.id, self._by, "Placed on another view")
        return warnings

    def remove(self, lesion_id: int) -> None:
        """Take back a lesion that was marked in this visit by mistake."""
        lesion = self._store.lesions.get(lesion_id)
        if lesion.visit_id != self._snapshot().visit.id:
            raise Refused(
                f"Lesion {lesion.number} was marked at an earlier visit and stays on record.",
                'If it was excised, tick "Removed by physician"; if you cannot see it, choose "Not in view".',
            )
        self._store.lesions.discard(lesion_id, self._by)

    def confirm(self, lesion_id: int) -> None:
        """Agree with the proposal, also with a proposal that the lesion is not in view."""
        observation = self._observation(lesion_id)
        if observation.decision == "proposed":
            self._store.observations.confirm(observation.id, self._by)

    def confident(self) -> list[Observation]:
        """Proposals sure enough to be confirmed together."""
        return [o for o in self._forces() if is_confident(o, self._evidence)]

    def unseen(self) -> list[Observation]:
        """Proposals that say the lesion is not in view."""
        return [o for o in self._forces() if o.decision == "proposed" and o.pixel is None]

    def confirm_all(self, observations: list[Observation]) -> int:
        """Agree with several proposals; returns how many."""
        for observation in observations:
            self._store.observations.confirm(observation.id, self._by)
        return len(observations)

    def not_in_view(self, lesion_id: int) -> None:
        """The doctor does not see the lesion in this visit's pictures."""
        observation = self._observation(lesion_id)
        if observation.decision == "marked":
            raise Refused(
                "You marked this lesion yourself in this visit.", "Remove it if it was marked by mistake."
            )
        if observation.decision == "proposed" and observation.pixel is None:
            self._store.observations.confirm(observation.id, self._by)
        else:
            self._store.observations.reject(observation.id, self._by, NOT_IN_VIEW)

    def reopen(self, lesion_id: int) -> None:
        """Take a decision back: the proposal waits again."""
        self._store.observations.reopen(self._observation(lesion_id).id, self._by)

    def set_site(self, lesion_id: int, site: AnatomicSite | None) -> None:
        """Store the anatomic site."""
        self._store.lesions.update(lesion_id, by=self._by, site=site)

    def set_note(self, lesion_id: int, note: str) -> None:
        """Store the note of a lesion."""
        self._store.lesions.update(lesion_id, by=self._by, note=note)

    def set_removed(self, lesion_id: int, removed: bool) -> None:
        """Say that a physician took the lesion out, or take that back."""
        self._store.lesions.update(lesion_id, by=self._by, state="removed" if removed else "active")

    def set_size(self, lesion_id: int, size_mm: float) -> None:
        """Store the size in this visit."""
        self._store.observations.annotate(self._observation(lesion_id).id, self._by, size_mm=size_mm)

    def attach_dermoscopy(self, lesion_id: int, path: Path) -> DermoscopicImage:
        """Attach an image file to a lesion in this visit.

        Raises
        ------
        InputError
            If the file cannot be read or is not an image; the message names the file.
        """
        try:
            if path.stat().st_size > MAX_IMAGE_BYTES:
                raise InputError(
                    f"{path.name} is larger than 200 MB.", "Choose the image file of the camera."
                )
            data = path.read_bytes()
        except OSError as error:
            raise InputError(f"{path.name} cannot be read.", "Check the file and try again.") from error
        try:
            return self._store.dermoscopy.add(lesion_id, self._snapshot().visit.id, data, self._by)
        except InputError as error:
            raise InputError(f"{path.name}: {error.message}", error.advice) from error

    def detach_dermoscopy(self, image_id: int) -> None:
        """Take a wrongly attached image away."""
        self._store.dermoscopy.remove(image_id, self._by)

    def set_replaced_aside(self) -> None:
        """Set aside what was recorded on captures that were taken again (it stays in the history)."""
        for observation in self._snapshot().replaced():
            self._store.observations.reject(observation.id, self._by, REPLACED)

    def _forces(self) -> list[Observation]:
        snapshot = self._snapshot()
        found = (snapshot.in_force(lesion.id) for lesion in snapshot.lesions)
        return [o for o in found if o is not None]

    def _observation(self, lesion_id: int) -> Observation:
        observation = self._snapshot().in_force(lesion_id)
        if observation is None:
            raise Refused(
                "This lesion was not looked for yet.", "Find the lesions on the body capture first."
            )
        return observation
