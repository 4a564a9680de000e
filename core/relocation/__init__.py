"""Relocation: the lesions of a first visit in the pictures of a follow-up."""

from core.relocation.registry import (
    DEFAULT_METHOD,
    RELOCATION_METHODS,
    MethodContext,
    MethodOutcome,
    RelocationMethod,
    register_relocation_method,
    relocation_method,
)
from core.relocation.relocate import pick_query, relocate
from core.relocation.result_json import read_lesions, write_json
from core.relocation.types import (
    DEFAULT_DELTA_M,
    Candidate,
    ConfirmedLesion,
    Estimate,
    LesionQuery,
    LesionStatus,
    Region,
    RelocatedLesion,
    RelocationOptions,
    RelocationResult,
    Spot,
)
from core.relocation.visits import relocate_visit

__all__ = [
    "DEFAULT_DELTA_M",
    "DEFAULT_METHOD",
    "RELOCATION_METHODS",
    "Candidate",
    "ConfirmedLesion",
    "Estimate",
    "LesionQuery",
    "LesionStatus",
    "MethodContext",
    "MethodOutcome",
    "Region",
    "RelocatedLesion",
    "RelocationMethod",
    "RelocationOptions",
    "RelocationResult",
    "Spot",
    "pick_query",
    "read_lesions",
    "register_relocation_method",
    "relocate",
    "relocate_visit",
    "relocation_method",
    "write_json",
]
