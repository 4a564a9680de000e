"""Patients, visits, captures, lesions, observations and dermoscopic images, kept safely on disk.

`ClinicStore` is the door; frozen dataclasses come out of it. The store itself loads SQLAlchemy and is
therefore imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from core.records.records import (
    AnatomicSite,
    AnchorRecord,
    CandidatePlace,
    CaptureRecord,
    DermoscopicImage,
    Lesion,
    Observation,
    ObservationDraft,
    ObservationEvent,
    Patient,
    PatientDraft,
    PatientSummary,
    User,
    Visit,
)

if TYPE_CHECKING:
    from core.records.store import ClinicStore

__all__ = [
    "AnatomicSite",
    "AnchorRecord",
    "CandidatePlace",
    "CaptureRecord",
    "ClinicStore",
    "DermoscopicImage",
    "Lesion",
    "Observation",
    "ObservationDraft",
    "ObservationEvent",
    "Patient",
    "PatientDraft",
    "PatientSummary",
    "User",
    "Visit",
]


def __getattr__(name: str) -> Any:
    if name == "ClinicStore":
        from core.records.store import ClinicStore

        return ClinicStore
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
