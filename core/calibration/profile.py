"""The calibration of one rig as it is kept: versioned, bound to serial numbers, never overwritten."""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from core.calibration.camera_document import CameraDocument
from core.capture.fields import read_bytes
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.errors import GeodermError, InputError, WorkError

PROFILE_FORMAT = "geoderm-calibration/1"
_LIMIT_BYTES = 1_000_000


@dataclass(frozen=True)
class DepthCorrection:
    """True depth is ``offset_m + scale * measured`` along the optical axis.

    Attributes
    ----------
    scale : float
    offset_m : float
    """

    scale: float = 1.0
    offset_m: float = 0.0

    def __post_init__(self) -> None:
        if not (0.5 < self.scale < 2.0 and abs(self.offset_m) < 0.5):
            raise InputError("The depth correction is out of range: scale 0.5 to 2, offset below 0.5 m.")

    def apply(self, frames: NDArray[np.uint16], unit_m: float) -> NDArray[np.uint16]:
        """Corrected raw depth of any shape, in the same unit; 0 (no measurement) stays 0."""
        if self.scale == 1.0 and self.offset_m == 0.0:
            return frames
        table = np.rint(self.scale * np.arange(65536) + self.offset_m / unit_m)
        table = np.clip(table, 1, 65535).astype(np.uint16)
        table[0] = 0
        return np.asarray(table[frames])


@dataclass(frozen=True, eq=False)
class CalibrationProfile:
    """What is known about the geometry of a rig, and how well.

    Attributes
    ----------
    rig : CameraRig
    depth_serial, color_serial : str
        As `devices.live.CameraIdentity`; the profile is for this pair only.
    depth_correction : DepthCorrection
    version : int
        Counts the profiles of this rig, from 1. Given by the store.
    made_at : datetime
    sigma : mapping of str to float
        Standard deviation of each parameter: ``depth.fx``, ``color.cy`` (pixels), ``color.k1``,
        ``rotation_deg``, ``translation_x_m``, ``depth_scale``, ``depth_offset_m``.
    rms_px : mapping of str to float
        Reprojection error: ``depth``, ``color``, ``stereo``.
    views : int
        Board views it was computed from.
    notes : tuple of str
        What people should know, for example a parameter that is only weakly determined.
    """

    rig: CameraRig
    depth_serial: str
    color_serial: str = ""
    depth_correction: DepthCorrection = field(default_factory=DepthCorrection)
    version: int = 0
    made_at: datetime = field(default_factory=lambda: datetime.now(UTC))
    sigma: Mapping[str, float] = field(default_factory=dict)
    rms_px: Mapping[str, float] = field(default_factory=dict)
    views: int = 0
    notes: tuple[str, ...] = ()

    @property
    def id(self) -> str:
        """Short name made of the content, the same wherever the profile is copied."""
        text = json.dumps(self._content(), sort_keys=True)
        return sha256(text.encode()).hexdigest()[:12]

    def fits(self, depth_serial: str, color_serial: str) -> bool:
        """Whether the profile is for this pair of cameras."""
        return (self.depth_serial, self.color_serial) == (depth_serial, color_serial)

    def document(self) -> dict[str, Any]:
        """The profile as JSON can hold it; every capture keeps this of the profile it was taken with."""
        return {"format": PROFILE_FORMAT, "id": self.id, **self._content()}

    def _content(self) -> dict[str, Any]:
        rig = self.rig
        return {
            "version": self.version,
            "made_at": self.made_at.astimezone(UTC).isoformat(),
            "depth_serial": self.depth_serial,
            "color_serial": self.color_serial,
            "depth": rig.depth.document(),
            "color": None if rig.color is None else rig.color.document(),
            "color_from_depth": None
            if rig.color_from_depth is None
            else rig.color_from_depth.matrix.tolist(),
            "depth_correction": {
                "scale": self.depth_correction.scale,
                "offset_m": self.depth_correction.offset_m,
            },
            "sigma": dict(self.sigma),
            "rms_px": dict(self.rms_px),
            "views": self.views,
            "notes": list(self.notes),
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any], where: str = "calibration") -> Self:
        """Read a document back.

        Raises
        ------
        InputError
            If it is not a usable profile; ``where`` names it.
        """
        try:
            content = _Document.model_validate(document)
        except ValidationError as error:
            first = error.errors()[0]
            name = ".".join(str(part) for part in first["loc"]) or "document"
            raise InputError(f"{where}: {name}: {first['msg']}.") from error
        if content.format != PROFILE_FORMAT:
            raise InputError(f"{where}: format: must be {PROFILE_FORMAT}.")
        try:
            transform = content.color_from_depth
            return cls(
                rig=CameraRig(
                    content.depth.camera(),
                    None if content.color is None else content.color.camera(),
                    None if transform is None else RigidTransform.from_matrix(transform),
                ),
                depth_serial=content.depth_serial,
                color_serial=content.color_serial,
                depth_correction=DepthCorrection(
                    content.depth_correction.scale, content.depth_correction.offset_m
                ),
                version=content.version,
                made_at=content.made_at.astimezone(UTC),
                sigma=content.sigma,
                rms_px=content.rms_px,
                views=content.views,
                notes=tuple(content.notes),
            )
        except OverflowError as error:
            raise InputError(f"{where}: made_at: is no date.") from error
        except (GeodermError, ValueError) as error:
            raise InputError(f"{where}: {error}") from error


class ProfileStore:
    """Profiles of all rigs in one folder: one file for each version, none is ever changed.

    Parameters
    ----------
    folder : Path
        Made when the first profile is added.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @property
    def folder(self) -> Path:
        """Where the files are."""
        return self._folder

    def all(self) -> list[CalibrationProfile]:
        """Every readable profile, by rig and version; `damaged` names the others."""
        return self._read()[0]

    def damaged(self) -> list[Path]:
        """Files that cannot be read as profiles."""
        return self._read()[1]

    def newest(self, depth_serial: str, color_serial: str) -> CalibrationProfile | None:
        """The profile in force for a pair of cameras."""
        fitting = [p for p in self.all() if p.fits(depth_serial, color_serial)]
        return max(fitting, key=lambda p: p.version, default=None)

    def add(self, profile: CalibrationProfile) -> CalibrationProfile:
        """Keep a profile as the next version of its rig and return it with that version.

        Raises
        ------
        WorkError
            If the folder cannot be written.
        """
        earlier = [p.version for p in self.all() if p.fits(profile.depth_serial, profile.color_serial)]
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            version = max(earlier, default=0) + 1
            name = _safe(profile.depth_serial, profile.color_serial)
            while True:
                numbered = replace(profile, version=version)
                target = self._folder / f"{name}-{version:03d}.json"
                if not target.exists():
                    break
                version += 1
            partial = target.with_suffix(".part")
            with partial.open("w", encoding="utf-8") as stream:
                json.dump(numbered.document(), stream, indent=1)
                stream.flush()
                os.fsync(stream.fileno())
            partial.replace(target)
        except OSError as error:
            with contextlib.suppress(OSError, UnboundLocalError):
                partial.unlink(missing_ok=True)
            raise WorkError(
                f"{self._folder}: the calibration could not be saved ({error.strerror}).",
                "Check the folder's free space and permissions, then save again.",
            ) from error
        return numbered

    def _read(self) -> tuple[list[CalibrationProfile], list[Path]]:
        good, bad = [], []
        for path in sorted(self._folder.glob("*.json")):
            try:
                good.append(read_profile(path))
            except InputError:
                bad.append(path)
        return sorted(good, key=lambda p: (p.depth_serial, p.color_serial, p.version)), bad


def read_profile(path: Path) -> CalibrationProfile:
    """Read one profile file; raise `InputError` naming file and field if it cannot be used."""
    data = read_bytes(path, _LIMIT_BYTES)
    try:
        document = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON.") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: is not a calibration.")
    return CalibrationProfile.from_document(document, str(path))


def _safe(*serials: str) -> str:
    """File name made of serial numbers; the hash keeps names apart that look the same when made safe."""
    text = "+".join(s for s in serials if s)
    return f"{re.sub(r'[^A-Za-z0-9._+-]', '_', text)[:60]}-{sha256(text.encode()).hexdigest()[:6]}"


def _writable(text: str) -> str:
    """Refuse half characters, which JSON can hold and no file can."""
    text.encode("utf-8")  # the error is a ValueError
    return text


_Text = Annotated[str, Field(max_length=1000), AfterValidator(_writable)]


class _Correction(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    scale: float = 1.0
    offset_m: float = 0.0


class _Document(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    format: str
    version: int = Field(ge=0)
    made_at: datetime
    depth_serial: _Text
    color_serial: _Text = ""
    depth: CameraDocument
    color: CameraDocument | None = None
    color_from_depth: list[list[Annotated[float, Field(ge=-100, le=100)]]] | None = None
    depth_correction: _Correction = _Correction()
    sigma: dict[str, float] = {}
    rms_px: dict[str, float] = {}
    views: int = Field(default=0, ge=0)
    notes: list[_Text] = Field(default=[], max_length=200)
