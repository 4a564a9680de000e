"""What travels between the command and the workers: a pair to be relocated, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class Case:
    """One row of the manifest, with every path absolute and every option decided.

    Attributes
    ----------
    name : str
        Unique, and fit to be the name of a file.
    first, followup : str
        Capture folders or visit folders.
    lesions : str
        A lesions.json with places in the first visit.
    method : str
        Relocation method.
    appearance : bool
        Whether colour may be used for matching.
    seed : int
    """

    name: str
    first: str
    followup: str
    lesions: str
    method: str
    appearance: bool
    seed: int

    @property
    def folders(self) -> tuple[Path, Path]:
        """The two visits."""
        return Path(self.first), Path(self.followup)


@dataclass(frozen=True, slots=True)
class CaseOutcome:
    """What became of one pair.

    Attributes
    ----------
    case : str
        The name of the case.
    fingerprint : str
        Of the inputs and options it was computed from (`app.batch.fingerprint`); empty where nothing was
        computed, so that the next run tries again.
    reason : str
        Why there is no result; empty when there is one.
    document : dict or None
        The result, ``geoderm-relocation/1``.
    seconds : float
    peak_memory_bytes : int
        The most memory that the process held while it worked on the pair; 0 where it is unknown.
    trace : str
        Of a bug, for the log.
    """

    case: str
    fingerprint: str = ""
    reason: str = ""
    document: dict[str, Any] | None = None
    seconds: float = 0.0
    peak_memory_bytes: int = 0
    trace: str = ""

    @property
    def done(self) -> bool:
        """Whether there is a result."""
        return self.document is not None
