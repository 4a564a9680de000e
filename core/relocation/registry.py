"""Relocation methods by name. A new method is one file plus one `register_relocation_method`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from core.errors import InputError
from core.progress import Progress
from core.relocation.clock import PhaseClock
from core.relocation.pair import KnownPlace, PickedLesion, VisitPair
from core.relocation.types import Estimate, RelocationOptions, Spot

DEFAULT_METHOD = "fused"


@dataclass(frozen=True)
class MethodContext:
    """How a method is to work.

    Attributes
    ----------
    options : RelocationOptions
    appearance : bool
        Whether colour may be used for matching.
    seed : int
        Of every random draw.
    clock : PhaseClock
    progress : Progress
    known : tuple of KnownPlace
        Confirmed lesions: anchors that are certain.
    """

    options: RelocationOptions
    appearance: bool
    seed: int
    clock: PhaseClock
    progress: Progress
    known: tuple[KnownPlace, ...] = ()


@dataclass(frozen=True, eq=False)
class MethodOutcome:
    """Estimates in the order of the lesions, and what else the method noticed.

    `sight_judged` says that the method itself held every place against the cameras; otherwise the skeleton
    decides what is turned away.
    """

    estimates: tuple[Estimate, ...]
    warnings: tuple[str, ...] = ()
    sight_judged: bool = False
    new_spots: tuple[Spot, ...] = ()
    vanished_spots: tuple[Spot, ...] = ()


class RelocationMethod(Protocol):
    """Finds lesions of the first capture again on the skin of the follow-up.

    It need not judge whether the captures fit together: `core.relocation.relocate` has done so.
    """

    @property
    def name(self) -> str:
        """Name in the registry and in results."""

    def estimate(
        self, pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
    ) -> MethodOutcome:
        """One estimate per lesion."""


RelocationMethodFactory = Callable[[], RelocationMethod]


def _voting_dijkstra() -> RelocationMethod:
    from core.relocation.voting_method import VotingMethod

    return VotingMethod("voting-dijkstra", "grid-dijkstra")


def _voting_fmm() -> RelocationMethod:
    from core.relocation.voting_method import VotingMethod

    return VotingMethod("voting-fmm", "delaunay-fast-marching")


def _trilateration() -> RelocationMethod:
    from core.relocation.trilateration_method import TrilaterationMethod

    return TrilaterationMethod()


def _registration() -> RelocationMethod:
    from core.relocation.registration_methods import RegistrationMethod

    return RegistrationMethod()


def _fused() -> RelocationMethod:
    from core.relocation.registration_methods import FusedMethod

    return FusedMethod()


RELOCATION_METHODS: dict[str, RelocationMethodFactory] = {
    "voting-dijkstra": _voting_dijkstra,
    "voting-fmm": _voting_fmm,
    "trilateration": _trilateration,
    "registration": _registration,
    "fused": _fused,
}


def register_relocation_method(name: str, factory: RelocationMethodFactory) -> None:
    """Add a relocation method, or replace one."""
    RELOCATION_METHODS[name] = factory


def relocation_method(name: str) -> RelocationMethod:
    """The method of that name.

    Raises
    ------
    InputError
        If there is none.
    """
    if name not in RELOCATION_METHODS:
        raise InputError(
            f"There is no relocation method '{name}'.", f"Choose one of: {', '.join(RELOCATION_METHODS)}."
        )
    return RELOCATION_METHODS[name]()
