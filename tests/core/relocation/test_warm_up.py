"""After the warm-up nothing is left to compile for a doctor's click."""

from __future__ import annotations

import importlib
import pkgutil

import pytest
from numba.core.registry import CPUDispatcher

import core.relocation
from core.anchors import AnalysedCapture
from core.relocation import LesionQuery, relocate
from core.relocation.warm_up import made_up_visit, warm_up


def compiled() -> dict[str, list[object]]:
    """Signatures for which each kernel of relocation is compiled."""
    out = {}
    for found in pkgutil.walk_packages(core.relocation.__path__, "core.relocation."):
        if found.name.endswith("_kernels"):
            for name, kernel in vars(importlib.import_module(found.name)).items():
                if isinstance(kernel, CPUDispatcher) and not name.startswith("_"):
                    out[f"{found.name}.{name}"] = list(kernel.signatures)
    return out


@pytest.fixture(scope="module")
def visits() -> tuple[AnalysedCapture, AnalysedCapture]:
    return made_up_visit(0.0), made_up_visit(0.01)


def test_every_kernel_of_relocation_is_compiled_and_no_method_asks_for_another_form(visits) -> None:
    warm_up()
    ready = compiled()
    assert len(ready) >= 10
    assert not [name for name, forms in ready.items() if not forms]
    u, v = visits[0].spots.pixels[0]
    for method in ("fused", "registration", "trilateration"):
        relocate(*visits, [LesionQuery("a", pixel=(float(u), float(v)))], method=method)
    assert compiled() == ready


def test_the_made_up_body_takes_the_whole_way(visits) -> None:
    u, v = visits[0].spots.pixels[0]
    result = relocate(*visits, [LesionQuery("a", pixel=(float(u), float(v)))])
    assert result.lesions[0].status == "found"
    assert result.lesions[0].appearance_matched
