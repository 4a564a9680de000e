"""What the user has chosen, kept as a small JSON file beside the clinic's data."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

_FILE = "settings.json"


@dataclass(frozen=True)
class Settings:
    """Choices that outlive a run.

    Attributes
    ----------
    privacy_mode : bool
        Names are hidden everywhere, window title included.
    last_username : str
        Offered at the next login.
    export_folder : str
        Where reports went last; empty for the user's documents.
    camera_id : str
        The camera used last; empty for the first one found.
    """

    privacy_mode: bool = False
    last_username: str = ""
    export_folder: str = ""
    camera_id: str = ""

    def with_(self, **changes: Any) -> Settings:
        """A copy with other values."""
        return replace(self, **changes)


def read_settings(folder: Path) -> Settings:
    """The settings in ``folder``; defaults for what is missing or of another type."""
    path = folder / _FILE
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, json.JSONDecodeError, UnicodeDecodeError):
        return Settings()
    if not isinstance(stored, dict):
        return Settings()
    defaults = Settings()
    known = {
        f.name: stored[f.name]
        for f in fields(Settings)
        if f.name in stored and isinstance(stored[f.name], type(getattr(defaults, f.name)))
    }
    return Settings(**known)


def write_settings(folder: Path, settings: Settings) -> None:
    """Store the settings (a temporary file, then renamed, so that they are never half written)."""
    folder.mkdir(parents=True, exist_ok=True)
    temporary = folder / f"{_FILE}.tmp"
    temporary.write_text(json.dumps(asdict(settings), indent=2), encoding="utf-8")
    temporary.replace(folder / _FILE)
