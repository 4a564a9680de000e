"""Where the application keeps a user's files."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs


def default_data_dir() -> Path:
    """Folder of the clinic's records; ``GEODERM_DATA_DIR`` overrides the platform's place."""
    named = os.environ.get("GEODERM_DATA_DIR")
    return Path(named) if named else Path(platformdirs.user_data_path("geoderm", appauthor=False)) / "clinic"


def calibration_dir(data_dir: Path | None = None) -> Path:
    """Folder of the calibration profiles of this workstation's rigs."""
    return (data_dir or default_data_dir()) / "calibration"
