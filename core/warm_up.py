"""Compiles every kernel before a person waits for it: at set-up, and in the background after the start."""

from __future__ import annotations

import time


def warm_up() -> float:
    """Run every compiled kernel once; return the seconds it took.

    About a minute on a fresh installation, where the kernels are compiled and cached beside the code; a
    second or two later on, when they are loaded. For set-up or a background thread, never for a click.
    """
    from core.geodesics import warm_up as warm_up_geodesics
    from core.hand.warm_up import warm_up as warm_up_hand
    from core.relocation.warm_up import warm_up as warm_up_relocation
    from core.surface import warm_up as warm_up_surface

    started = time.perf_counter()
    warm_up_surface()
    warm_up_geodesics()
    warm_up_relocation()
    warm_up_hand()
    return time.perf_counter() - started


if __name__ == "__main__":
    warm_up()
