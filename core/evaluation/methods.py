"""Which methods a ladder has: yardsticks, then everything the application registers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from core.errors import InputError
from core.evaluation.baselines import NearestBone, RigidAlignment
from core.evaluation.library_baselines import CoherentPointDrift, IterativeClosestPoint, has_cpd
from core.relocation import DEFAULT_METHOD, RELOCATION_METHODS, register_relocation_method
from core.relocation.registry import RelocationMethodFactory

BASELINES: dict[str, RelocationMethodFactory] = {
    RigidAlignment.name: RigidAlignment,
    IterativeClosestPoint.name: IterativeClosestPoint,
    CoherentPointDrift.name: CoherentPointDrift,
    NearestBone.name: NearestBone,
}
"""The yardsticks, in the order of the ladder. They state no radius and never look at colour."""

GEOMETRIC = frozenset({*BASELINES, "voting-dijkstra", "voting-fmm", "trilateration"})
"""Methods that have no use for colour: with and without appearance they are one row."""


@contextmanager
def baselines_registered() -> Iterator[None]:
    """Make the yardsticks known to `core.relocation.relocate` for a while; the application offers none."""
    added = {name: factory for name, factory in BASELINES.items() if name not in RELOCATION_METHODS}
    for name, factory in added.items():
        register_relocation_method(name, factory)
    try:
        yield
    finally:
        for name in added:
            RELOCATION_METHODS.pop(name, None)


def ladder_methods() -> tuple[str, ...]:
    """Every method that can run here, from the stiffest yardstick to the application's default."""
    baselines = [name for name in BASELINES if name != CoherentPointDrift.name or has_cpd()]
    shipped = [name for name in RELOCATION_METHODS if name not in BASELINES]
    shipped.sort(key=lambda name: name == DEFAULT_METHOD and name not in GEOMETRIC)
    return (*baselines, *shipped)


def check_methods(names: Sequence[str]) -> tuple[str, ...]:
    """The names, if all of them can run.

    Raises
    ------
    InputError
        Naming the first that cannot.
    """
    known = ladder_methods()
    for name in names:
        if name not in known:
            raise InputError(f"There is no method '{name}'.", f"Choose from: {', '.join(known)}.")
    return tuple(names)
