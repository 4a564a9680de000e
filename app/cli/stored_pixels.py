"""Pixels in the words of the user: those of the images as they are stored.

A mirrored recording is un-mirrored when it is read, so that the patient's left is left everywhere inside. Its
files stay as they are, and whoever clicks on them or draws into them counts their pixels. Points and joints
are in the frame of the camera as it really stood.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from core.capture import CameraRig, RgbdCapture
    from core.relocation import LesionQuery


def mirrored_captures(folder: Path, names: Iterable[str]) -> frozenset[str]:
    """Which captures of a visit folder (or the one capture folder itself) are stored mirrored."""
    from core.capture.fields import load_json_object
    from core.capture.folder import CAPTURE_FILE

    alone = (folder / CAPTURE_FILE).exists()
    return frozenset(
        name
        for name in names
        if load_json_object((folder if alone else folder / name) / CAPTURE_FILE).flag("mirrored", False)
    )


def query_as_read(
    query: LesionQuery, captures: Mapping[str, RgbdCapture], mirrored: frozenset[str]
) -> LesionQuery:
    """The query with pixels of the un-mirrored images."""
    name = query.capture if query.capture is not None else next(iter(captures))
    if name not in mirrored:
        return query
    rig = captures[name].rig
    return replace(
        query,
        pixel=None if query.pixel is None else _flipped(query.pixel, rig.picture_camera.width),
        depth_pixel=None if query.depth_pixel is None else _flipped(query.depth_pixel, rig.depth.width),
    )


def entry_as_stored(entry: dict[str, Any], rig: CameraRig) -> None:
    """Turn the pixels of a lesion, a joint and its candidates into those of the mirrored images on disk."""
    for key, width in (("pixel", rig.picture_camera.width), ("depth_pixel", rig.depth.width)):
        if entry.get(key) is not None:
            u, v = entry[key]
            entry[key] = [round(x, 3) for x in _flipped((u, v), width)]
    for candidate in entry.get("candidates", ()):
        entry_as_stored(candidate, rig)


def _flipped(pixel: tuple[float, float], width: int) -> tuple[float, float]:
    return width - 1 - pixel[0], pixel[1]
