"""Where pairs are computed: what every way of running them offers, and the plainest of them."""

from __future__ import annotations

import time
from typing import Protocol

from app.batch.case import Case, CaseOutcome
from app.batch.work import run_case


class Runner(Protocol):
    """Computes pairs. It holds only those handed to it and not yet collected."""

    def capacity(self) -> int:
        """How many pairs may be under way at once, now."""

    def submit(self, case: Case) -> None:
        """Take a pair. At most `capacity` pairs are handed over and not yet collected."""

    def collect(self, timeout_s: float) -> CaseOutcome | None:
        """An outcome, as soon as there is one; None if there is none within ``timeout_s``.

        Raises
        ------
        WorkError
            If no pair can be computed any more.
        """

    def close(self) -> None:
        """End at once; what was not collected is lost."""


class InProcess:
    """Computes one pair after the other in this process: to look into a problem, or where Dask may not run.

    A pair that takes the process down ends the run; it goes on when it is started again.
    """

    def __init__(self) -> None:
        self._waiting: list[Case] = []

    def capacity(self) -> int:
        """One."""
        return 1

    def submit(self, case: Case) -> None:
        """Keep the pair until it is collected."""
        self._waiting.append(case)

    def collect(self, timeout_s: float) -> CaseOutcome | None:
        """Compute the pair that waits."""
        if not self._waiting:
            time.sleep(timeout_s)
            return None
        return run_case(self._waiting.pop(0))

    def close(self) -> None:
        """Nothing is open."""
        self._waiting.clear()
