"""Truth clicked by a person: ``geoderm-clicks/1``, one clicks.json in each capture folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from core.anchors import JOINT_NAMES
from core.capture.camera import PinholeCamera
from core.capture.fields import Fields, load_json_object
from core.errors import InputError

CLICKS_FILE = "clicks.json"
CLICKS_FORMAT = "geoderm-clicks/1"

Pixel = tuple[float, float]


@dataclass(frozen=True)
class Clicks:
    """What was clicked in one capture's picture.

    Attributes
    ----------
    lesions : mapping of str to (u, v)
        Picture pixels, as the image is stored; a lesion that the picture does not show is left out.
    joints : mapping of str to (u, v)
        Places on the skin over joints, which replace the tracker's.
    simulated : bool
        Whether a simulator clicked.
    """

    lesions: Mapping[str, Pixel] = field(default_factory=dict)
    joints: Mapping[str, Pixel] = field(default_factory=dict)
    simulated: bool = False

    def mirrored(self, width: int) -> Clicks:
        """The same clicks on the flipped image."""

        def flipped(places: Mapping[str, Pixel]) -> dict[str, Pixel]:
            return {name: (width - 1 - u, v) for name, (u, v) in places.items()}

        return Clicks(flipped(self.lesions), flipped(self.joints), self.simulated)


def read_clicks(folder: Path, picture: PinholeCamera) -> Clicks:
    """The clicks beside a capture; none when there is no clicks.json.

    Parameters
    ----------
    folder : Path
        The capture folder.
    picture : PinholeCamera
        The camera whose pixels are clicked.

    Raises
    ------
    InputError
        For anything that is not the format, naming the file and the field.
    """
    path = folder / CLICKS_FILE
    if not path.exists():
        return Clicks()
    fields = load_json_object(path)
    if fields.raw("format") != CLICKS_FORMAT:
        raise fields.error("format", f'must be "{CLICKS_FORMAT}".')
    clicks = Clicks(
        _places(fields, "lesions", picture),
        _places(fields, "joints", picture),
        fields.flag("simulated", False),
    )
    for name in clicks.joints:
        if name not in JOINT_NAMES:
            raise fields.error(f"joints.{name}", "is not a joint.", f"Known: {', '.join(JOINT_NAMES)}.")
    return clicks


def _places(fields: Fields, name: str, picture: PinholeCamera) -> dict[str, Pixel]:
    if not fields.has(name):
        return {}
    places = fields.object(name)
    out: dict[str, Pixel] = {}
    for key in places.names():
        if not key:
            raise fields.error(name, "holds a place without a name.")
        if not places.has(key):
            continue
        u, v = places.numbers(key, 2)
        if not picture.contains([[u, v]])[0]:
            raise places.error(
                key, f"is [{u:g}, {v:g}], outside the {picture.width} x {picture.height} picture."
            )
        out[key] = (u, v)
    return out


def write_clicks(folder: Path, clicks: Clicks) -> None:
    """Write clicks.json into a capture folder, whole or not at all."""
    path = folder / CLICKS_FILE
    document = {
        "format": CLICKS_FORMAT,
        "simulated": clicks.simulated,
        "lesions": {name: [round(x, 3) for x in pixel] for name, pixel in clicks.lesions.items()},
        "joints": {name: [round(x, 3) for x in pixel] for name, pixel in clicks.joints.items()},
    }
    partial = path.with_name(f".{path.name}.part")
    try:
        partial.write_text(json.dumps(document, indent=1, ensure_ascii=False), encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}).") from error
