"""A folder of successive captures: the door through which simulated and recorded stances enter alike."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from core.capture.fields import load_json_object
from core.capture.folder import CAPTURE_FILE, read_capture
from core.capture.rgbd import RgbdCapture
from core.errors import InputError
from core.evaluation.thesis.clicks import CLICKS_FILE, Clicks, read_clicks

LEAST_CAPTURES = 2
_LAYOUT = (
    "Give a folder of capture folders (successive captures of one stance), or a folder of such folders, one "
    "for each stance."
)


@dataclass(frozen=True)
class StanceSequence:
    """Successive captures of one person in one stance; the first is the one that is clicked.

    Attributes
    ----------
    name : str
        The folder's name.
    folders : tuple of Path
        Capture folders in the order of their names.
    """

    name: str
    folders: tuple[Path, ...]

    def shortened(self, count: int) -> StanceSequence:
        """The first ``count`` captures."""
        return replace(self, folders=self.folders[:count])


@dataclass(frozen=True, eq=False)
class ClickedCapture:
    """A capture with what was clicked in its (un-mirrored) picture."""

    name: str
    capture: RgbdCapture
    clicks: Clicks


def find_sequences(folder: Path) -> tuple[StanceSequence, ...]:
    """The stances in a folder, in the order of their names.

    Raises
    ------
    InputError
        If the folder holds no sequence of at least two captures.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder.", _LAYOUT)
    if (folder / CAPTURE_FILE).exists():
        raise InputError(f"{folder}: is one capture; the experiments need successive ones.", _LAYOUT)
    direct = _captures(folder)
    nested = [(p, _captures(p)) for p in _folders(folder) if p not in direct]
    nested = [(p, found) for p, found in nested if found]
    if direct and nested:
        raise InputError(
            f"{folder}: holds captures ({direct[0].name}) beside folders of captures ({nested[0][0].name}).",
            _LAYOUT,
        )
    stances = [(folder.resolve(), direct)] if direct else nested
    if not stances:
        raise InputError(f"{folder}: no capture folder (with a {CAPTURE_FILE}) was found in it.", _LAYOUT)
    for path, found in stances:
        if len(found) < LEAST_CAPTURES:
            raise InputError(f"{path}: holds {len(found)} capture; a stance needs at least two.", _LAYOUT)
    return tuple(StanceSequence(path.name, tuple(found)) for path, found in stances)


def _folders(folder: Path) -> list[Path]:
    try:
        return sorted(p for p in folder.iterdir() if p.is_dir() and not p.name.startswith("."))
    except OSError as error:
        raise InputError(f"{folder}: cannot be listed ({error.strerror or error}).") from error


def _captures(folder: Path) -> list[Path]:
    return [p for p in _folders(folder) if (p / CAPTURE_FILE).exists()]


def read_clicked(folder: Path) -> ClickedCapture:
    """A capture and its clicks.

    Raises
    ------
    InputError
        Naming file and field.
    """
    capture = read_capture(folder)
    picture = capture.rig.picture_camera
    clicks = read_clicks(folder, picture)
    if load_json_object(folder / CAPTURE_FILE).flag("mirrored", False):
        clicks = clicks.mirrored(picture.width)
    return ClickedCapture(folder.name, capture, clicks)


def check_first_clicked(sequence: StanceSequence, first: ClickedCapture) -> None:
    """Refuse a sequence whose later captures hold lesions that the first one cannot give.

    Raises
    ------
    InputError
        If lesions were clicked, but none in the first capture.
    """
    if first.clicks.lesions:
        return
    for folder in sequence.folders[1:]:
        if (folder / CLICKS_FILE).exists() and load_json_object(folder / CLICKS_FILE).has("lesions"):
            place = sequence.folders[0] / CLICKS_FILE
            raise InputError(
                f"{place}: no lesion is clicked, but {folder.name} has some.",
                "The first capture of a stance is the reference: click its lesions.",
            )
