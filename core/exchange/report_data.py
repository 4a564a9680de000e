"""What a visit report says, gathered from the store before a single line is laid out."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import RgbdCapture
from core.errors import InputError
from core.exchange.body_map import BodyMapMark
from core.exchange.pictures import Crop, Region, body_region, lesion_crop, scale_at, shaded_depth
from core.records.records import (
    CaptureRecord,
    DermoscopicImage,
    Lesion,
    Observation,
    Patient,
    User,
    Visit,
)
from core.records.store import ClinicStore


@dataclass(frozen=True, eq=False)
class BodyView:
    """A photo of the body with the lesions recorded on it."""

    title: str
    picture: NDArray[np.uint8]
    marks: tuple[BodyMapMark, ...]
    region: Region | None


@dataclass(frozen=True)
class LesionAtVisit:
    """What is known of a lesion at one visit: close up (`crop`) and with its surroundings (`context`)."""

    visit: Visit
    observation: Observation | None
    crop: Crop | None
    context: Crop | None
    dermoscopy: tuple[DermoscopicImage, ...]


@dataclass(frozen=True)
class LesionEntry:
    """A lesion in the report: now, and at the visit before (None at a patient's first visit)."""

    lesion: Lesion
    now: LesionAtVisit
    before: LesionAtVisit | None
    is_new: bool


@dataclass(frozen=True, eq=False)
class VisitReport:
    """Everything a visit report shows."""

    clinic_name: str
    patient: Patient
    visit: Visit
    previous: Visit | None
    doctor: str
    created_by: str
    created_at: datetime
    views: tuple[BodyView, ...]
    entries: tuple[LesionEntry, ...]
    people: dict[int, str]


@dataclass(frozen=True, eq=False)
class _LoadedVisit:
    """Pictures of a visit, each decoded once."""

    visit: Visit
    observations: tuple[Observation, ...]
    captures: tuple[CaptureRecord, ...]
    loaded: dict[int, RgbdCapture]
    dermoscopy: tuple[DermoscopicImage, ...]

    def best(self, lesion_id: int) -> Observation | None:
        """The observation to show: decided before proposed, with a place before without, surest first."""
        mine = [o for o in self.observations if o.lesion_id == lesion_id]
        if not mine:
            return None
        return max(
            mine, key=lambda o: (o.pixel is not None and is_placed(o), is_settled(o), o.confidence or 0.0)
        )


def is_settled(observation: Observation) -> bool:
    """Whether a person stands behind the place."""
    return observation.decision in ("marked", "confirmed", "corrected")


def is_placed(observation: Observation) -> bool:
    """Whether the lesion is shown at a place: it has one, and nobody rejected it."""
    return observation.pixel is not None and observation.decision != "rejected"


def picture_of(capture: RgbdCapture) -> NDArray[np.uint8]:
    """The picture lesions are marked on: the colour photo, or a relief of the depth without one."""
    if capture.color is not None:
        return capture.color
    return shaded_depth(capture.depth_frames[0], capture.depth_unit_m, capture.rig.depth)


def gather(store: ClinicStore, visit_id: int, created_by: User, created_at: datetime) -> VisitReport:
    """Read everything a report of the visit needs.

    Raises
    ------
    InputError
        If there is no such visit.
    DamagedError
        If a stored picture is damaged.
    """
    visit = store.visits.get(visit_id)
    patient = store.patients.get(visit.patient_id)
    previous = store.visits.previous(visit_id)
    people = {user.id: user.display_name for user in store.users.list()}
    lesions = [
        lesion
        for lesion in store.lesions.list(patient.id)
        if store.visits.get(lesion.visit_id).number <= visit.number
    ]
    now = _load(store, visit)
    before = None if previous is None else _load(store, previous)
    entries = tuple(
        LesionEntry(
            lesion=lesion,
            now=_at_visit(now, lesion.id),
            before=None if before is None else _at_visit(before, lesion.id),
            is_new=lesion.visit_id == visit.id and previous is not None,
        )
        for lesion in lesions
    )
    return VisitReport(
        clinic_name=store.settings.get("clinic_name"),
        patient=patient,
        visit=visit,
        previous=previous,
        doctor=people.get(visit.started_by, ""),
        created_by=created_by.display_name,
        created_at=created_at,
        views=_views(now, {lesion.id: lesion.number for lesion in lesions}),
        entries=entries,
        people=people,
    )


def _load(store: ClinicStore, visit: Visit) -> _LoadedVisit:
    """Load the working captures of a visit, and any other that has lesions on it."""
    observations = tuple(store.observations.for_visit(visit.id))
    captures = store.captures.list(visit.id)
    used = {o.capture_id for o in observations if is_placed(o)}
    wanted = [c for c in captures if c.id in used or c.role == "working"]
    return _LoadedVisit(
        visit,
        observations,
        tuple(captures),
        {c.id: store.captures.load(c.id, frames=1) for c in wanted},
        tuple(store.dermoscopy.for_visit(visit.id)),
    )


def _at_visit(loaded: _LoadedVisit, lesion_id: int) -> LesionAtVisit:
    observation = loaded.best(lesion_id)
    crop = context = None
    if observation is not None and observation.pixel is not None and is_placed(observation):
        capture = loaded.loaded[observation.capture_id]
        scale = None
        if observation.point_m is not None:
            in_picture = capture.rig.picture_from_depth.apply(observation.point_m)
            scale = scale_at(
                capture.rig.picture_camera,
                (float(in_picture[0]), float(in_picture[1]), float(in_picture[2])),
            )
        picture = picture_of(capture)
        crop = lesion_crop(picture, observation.pixel, mm_per_pixel=scale)
        context = lesion_crop(picture, observation.pixel, mm_per_pixel=scale, span_mm=500.0)
    images = tuple(image for image in loaded.dermoscopy if image.lesion_id == lesion_id)
    return LesionAtVisit(loaded.visit, observation, crop, context, images)


def _views(loaded: _LoadedVisit, numbers: dict[int, int]) -> tuple[BodyView, ...]:
    """One view per capture with placed lesions; without any lesion, the first working capture."""
    views = []
    for record in loaded.captures:
        if record.id not in loaded.loaded:
            continue
        capture = loaded.loaded[record.id]
        placed = [
            o
            for o in loaded.observations
            if o.capture_id == record.id and is_placed(o) and o.pixel is not None
        ]
        picture = picture_of(capture)
        marks = tuple(
            BodyMapMark(numbers[o.lesion_id], o.pixel, is_settled(o))
            for o in placed
            if o.pixel is not None and _inside(o.pixel, picture)
        )
        views.append(BodyView(_title(record), picture, marks, body_region(capture)))
    marked = [view for view in views if view.marks]
    return tuple(marked or views[:1])


def _title(record: CaptureRecord) -> str:
    view = record.view.strip().capitalize() or "Body"
    return f"{view} view" if view in ("Front", "Back", "Left", "Right") else view


def _inside(pixel: tuple[float, float], picture: NDArray[np.uint8]) -> bool:
    height, width = picture.shape[:2]
    return bool(-0.5 <= pixel[0] <= width - 0.5 and -0.5 <= pixel[1] <= height - 0.5)


def require_picture(data: bytes) -> None:
    """Refuse a body map that is not a picture."""
    from core.records.images import check_image

    try:
        check_image(data)
    except InputError as error:
        raise InputError("The body map is not a readable picture.", error.advice) from None
