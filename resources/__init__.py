"""Files the application ships: style, fonts, models, the demonstration body.

A leaf: it imports nothing of the application, so every floor may ask it for a path.
"""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parent


def resource_path(*parts: str) -> Path:
    """Path of a shipped file, for example ``resource_path("models", "pose_landmarker_full.task")``.

    Raises
    ------
    FileNotFoundError
        If the file is not part of the installation.
    """
    path = ROOT.joinpath(*parts)
    if not path.exists():
        raise FileNotFoundError(f"{'/'.join(parts)} is missing from the installation; reinstall GeoDerm")
    return path
