"""How the last daily check of each calibration ended, kept beside the calibrations."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

_FILE = Path("board") / "checks.json"


@dataclass(frozen=True)
class LastCheck:
    """The last daily check of a calibration.

    Attributes
    ----------
    verdict : str
        ``ok``, ``moved`` or ``cannot tell``.
    at : str
        Time in ISO form, with its zone.
    """

    verdict: str
    at: str

    @property
    def when(self) -> datetime:
        """Local time of the check."""
        return datetime.fromisoformat(self.at).astimezone()


def load_checks(folder: Path) -> dict[str, LastCheck]:
    """Last checks by the calibration's id; unreadable ones are as if never made."""
    try:
        stored = json.loads((folder / _FILE).read_text(encoding="utf-8"))
        checks = {key: LastCheck(str(c["verdict"]), str(c["at"])) for key, c in stored.items()}
        for check in checks.values():
            _ = check.when
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}
    return checks


def store_check(folder: Path, profile_id: str, verdict: str) -> None:
    """Remember how a check ended."""
    checks = load_checks(folder)
    checks[profile_id] = LastCheck(verdict, datetime.now(UTC).isoformat(timespec="seconds"))
    path = folder / _FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".part")
    partial.write_text(json.dumps({key: asdict(c) for key, c in checks.items()}), encoding="utf-8")
    partial.replace(path)
