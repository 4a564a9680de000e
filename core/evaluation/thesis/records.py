"""What one capture contributes to every figure: small enough to keep, so that a stopped run can go on."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.anchors import JOINT_NAMES
from core.errors import WorkError

FloatArray = NDArray[np.float64]

RECORD_FORMAT = "geoderm-thesis-record/1"
_N = len(JOINT_NAMES)


@dataclass(frozen=True)
class CaptureRecord:
    """Measures of one capture. Metres, depth-camera frame; NaN for what was not seen or not connected.

    Attributes
    ----------
    name : str
    unusable : str
        Why the capture shows no usable body; empty when it does.
    vertices : int
        Of the surface.
    joints_m : mapping of str to [x, y, z]
        Reliable anchors on the skin.
    lesions_m : mapping of str to [x, y, z]
        Where the lesions were clicked in this capture: the truth of figure 11 and table 2.
    between_m : mapping of str to list (15, 15)
        Geodesic distance of every pair of joints, per method label.
    to_lesion_m : mapping of str to mapping of str to list (15,)
        Geodesic distance of every joint to each clicked lesion, per method label.
    answers_m : mapping of str to mapping of str to [x, y, z] or None
        Where each relocation method puts the lesions of the first capture.
    cpu_seconds : mapping of str to float
        CPU time of that relocation.
    """

    name: str
    unusable: str = ""
    vertices: int = 0
    joints_m: Mapping[str, list[float]] = field(default_factory=dict)
    lesions_m: Mapping[str, list[float]] = field(default_factory=dict)
    between_m: Mapping[str, list[list[float]]] = field(default_factory=dict)
    to_lesion_m: Mapping[str, Mapping[str, list[float]]] = field(default_factory=dict)
    answers_m: Mapping[str, Mapping[str, list[float] | None]] = field(default_factory=dict)
    cpu_seconds: Mapping[str, float] = field(default_factory=dict)

    def between(self, label: str) -> FloatArray:
        """Distances (15, 15) between joints, in the order of `core.anchors.JOINT_NAMES`."""
        if label not in self.between_m:
            return np.full((_N, _N), np.nan)
        return np.array(self.between_m[label], dtype=np.float64)

    def to_lesion(self, label: str, lesion: str) -> FloatArray:
        """Distances (15,) from the joints to a lesion."""
        if lesion not in self.to_lesion_m.get(label, {}):
            return np.full(_N, np.nan)
        return np.array(self.to_lesion_m[label][lesion], dtype=np.float64)

    def error_m(self, method: str, lesion: str) -> float:
        """Distance of a method's answer to the re-clicked lesion; NaN without one of them."""
        answer = self.answers_m.get(method, {}).get(lesion)
        if answer is None or lesion not in self.lesions_m:
            return math.nan
        return float(np.linalg.norm(np.array(answer) - np.array(self.lesions_m[lesion])))


def write_record(path: Path, record: CaptureRecord, fingerprint: str) -> None:
    """Keep a record, whole or not at all; ``fingerprint`` says what it was made of."""
    document = {"format": RECORD_FORMAT, "made_of": fingerprint, **asdict(record)}
    partial = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(json.dumps(without_nan(document)), encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        raise WorkError(f"{path}: cannot be written ({error.strerror or error}).") from error


def read_record(path: Path, fingerprint: str) -> CaptureRecord | None:
    """A record that was kept; None if there is none, or if it was made of something else."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(document, dict):
        return None
    if document.pop("format", None) != RECORD_FORMAT or document.pop("made_of", None) != fingerprint:
        return None
    for name in ("between_m", "to_lesion_m"):
        document[name] = _nan(document[name])
    return CaptureRecord(**document)


def without_nan(value: Any) -> Any:
    """NaN and infinity as null: JSON has neither."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {k: without_nan(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(v) for v in value]
    return value


def _nan(value: Any) -> Any:
    if value is None:
        return math.nan
    if isinstance(value, Mapping):
        return {k: _nan(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_nan(v) for v in value]
    return value
