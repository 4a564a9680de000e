"""What the records say about a visit and the visits before it, read in one go."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.workflows.facts import VisitFacts
from app.workflows.plan import (
    KnownPlace,
    RelocationPlan,
    newest_of_each_view,
    pending,
    plan_relocation,
)
from core.records import CaptureRecord, DermoscopicImage, Lesion, Observation, Patient, Visit

if TYPE_CHECKING:
    from core.records import ClinicStore

SURE = ("confirmed", "corrected", "marked")
"""Decisions that make a place worth looking from."""


@dataclass(frozen=True)
class VisitSnapshot:
    """The records of one visit at one moment.

    Attributes
    ----------
    patient : Patient
    visit : Visit
    earlier : tuple of Visit
        Closed visits before this one, oldest first.
    lesions : tuple of Lesion
        Of the patient, by number.
    captures : mapping of int to CaptureRecord
        Of this visit and the earlier ones.
    observations : mapping of int to tuple of Observation
        Lesion to its observations in this visit and the earlier ones, oldest first.
    dermoscopy : mapping of int to tuple of DermoscopicImage
        Lesion to its images, oldest first.
    """

    patient: Patient
    visit: Visit
    earlier: tuple[Visit, ...]
    lesions: tuple[Lesion, ...]
    captures: Mapping[int, CaptureRecord]
    observations: Mapping[int, tuple[Observation, ...]]
    dermoscopy: Mapping[int, tuple[DermoscopicImage, ...]]

    @classmethod
    def load(cls, store: ClinicStore, visit_id: int) -> VisitSnapshot:
        """Read everything about a visit."""
        visit = store.visits.get(visit_id)
        earlier = tuple(
            v for v in store.visits.list(visit.patient_id) if v.number < visit.number and not v.is_open
        )
        shown = (*earlier, visit)
        captures = {c.id: c for v in shown for c in store.captures.list(v.id)}
        observations: dict[int, list[Observation]] = {}
        dermoscopy: dict[int, list[DermoscopicImage]] = {}
        for v in shown:
            for observation in sorted(store.observations.for_visit(v.id), key=lambda o: o.id):
                observations.setdefault(observation.lesion_id, []).append(observation)
            for image in store.dermoscopy.for_visit(v.id):
                dermoscopy.setdefault(image.lesion_id, []).append(image)
        return cls(
            store.patients.get(visit.patient_id),
            visit,
            earlier,
            tuple(store.lesions.list(visit.patient_id)),
            captures,
            {k: tuple(v) for k, v in observations.items()},
            {k: tuple(v) for k, v in dermoscopy.items()},
        )

    def _own(self, role: str) -> list[CaptureRecord]:
        mine = [c for c in self.captures.values() if c.visit_id == self.visit.id and c.role == role]
        return sorted(mine, key=lambda c: c.id)

    @property
    def stance(self) -> CaptureRecord | None:
        """The psi capture in force: the newest."""
        own = self._own("psi")
        return own[-1] if own else None

    def stance_of(self, visit_id: int) -> CaptureRecord | None:
        """The psi capture in force of this or an earlier visit."""
        own = [c for c in self.captures.values() if c.visit_id == visit_id and c.role == "psi"]
        return max(own, key=lambda c: c.id, default=None)

    @property
    def views(self) -> dict[str, int]:
        """View to working capture in force, in the order in which the views were first taken."""
        return newest_of_each_view((c.id, c.view) for c in self._own("working"))

    @property
    def is_follow_up(self) -> bool:
        """Whether an earlier visit left lesions to be found again."""
        return bool(self._earlier_places())

    def _active(self) -> set[int]:
        return {lesion.id for lesion in self.lesions if lesion.state == "active"}

    def _place(self, o: Observation) -> KnownPlace | None:
        capture = self.captures.get(o.capture_id)
        if o.pixel is None or o.decision not in SURE or capture is None or o.lesion_id not in self._active():
            return None
        numbers = {v.id: v.number for v in (*self.earlier, self.visit)}
        return KnownPlace(o.lesion_id, o.capture_id, capture.view, numbers[o.visit_id], o.pixel)

    def _earlier_places(self) -> list[KnownPlace]:
        found = (
            self._place(o) for os in self.observations.values() for o in os if o.visit_id != self.visit.id
        )
        return [p for p in found if p is not None]

    def _replaced_places(self) -> list[KnownPlace]:
        current = set(self.views.values())
        found = (
            self._place(o)
            for os in self.observations.values()
            for o in os
            if o.visit_id == self.visit.id and o.capture_id not in current
        )
        return [p for p in found if p is not None]

    def plan(self) -> RelocationPlan:
        """Where every known lesion is looked for in this visit."""
        return plan_relocation([*self._earlier_places(), *self._replaced_places()], self.views)

    def pending(self) -> RelocationPlan:
        """What is still to be looked for."""
        current = set(self.views.values())
        looked_for = {
            lesion_id: {o.capture_id for o in os if o.visit_id == self.visit.id and o.capture_id in current}
            for lesion_id, os in self.observations.items()
        }
        return pending(self.plan(), looked_for)

    def replaced(self) -> list[Observation]:
        """Observations of this visit on captures that were taken again, not yet set aside."""
        current = set(self.views.values())
        return [
            o
            for os in self.observations.values()
            for o in os
            if o.visit_id == self.visit.id and o.capture_id not in current and o.decision != "rejected"
        ]

    def in_force(self, lesion_id: int) -> Observation | None:
        """The observation of this visit that counts: on a capture in force, with a place if there is one."""
        current = set(self.views.values())
        own = [o for o in self.observations.get(lesion_id, ()) if o.visit_id == self.visit.id]
        own = [o for o in own if o.capture_id in current]
        return max(own, key=lambda o: (has_place(o), o.id), default=None)

    def previous(self, lesion_id: int) -> Observation | None:
        """Where the lesion was last seen in an earlier visit."""
        earlier = [o for o in self.observations.get(lesion_id, ()) if o.visit_id != self.visit.id]
        return next((o for o in reversed(earlier) if has_place(o) and o.decision in SURE), None)

    def shown_lesions(self) -> list[Lesion]:
        """Lesions of this visit: those observed in it and, at a follow-up, the others still active."""
        return [
            lesion
            for lesion in self.lesions
            if self.in_force(lesion.id) is not None
            or (lesion.state == "active" and self.previous(lesion.id) is not None)
        ]

    def facts(self) -> VisitFacts:
        """What the state tables ask about."""
        forces = [o for o in (self.in_force(lesion.id) for lesion in self.lesions) if o is not None]
        return VisitFacts(
            has_stance=self.stance is not None,
            has_capture=bool(self.views),
            pending=len(self.pending()),
            lesions=len(forces),
            undecided=sum(o.decision == "proposed" for o in forces),
            closed=not self.visit.is_open,
        )


def has_place(observation: Observation) -> bool:
    """Whether an observation says where the lesion is."""
    return observation.pixel is not None and observation.decision != "rejected"
