"""What was measured, one record per pair of captures and rung, in a file that a killed run goes on with."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from core.errors import InputError, WorkError
from core.evaluation.cases import CaseName, Joints
from core.evaluation.scores import LesionScore, SpotScore

FLOOR = "sensor floor"
"""A row that is no method: what the sensor itself says about the true pixel."""


@dataclass(frozen=True)
class Rung:
    """A method under conditions.

    Attributes
    ----------
    method : str
        A relocation method, or `FLOOR`.
    joints : "tracked" or "true"
    frames : int
        Depth frames of each capture; 0 for all that were taken.
    appearance : bool
        Whether colour may be matched.
    """

    method: str
    joints: Joints = "tracked"
    frames: int = 30
    appearance: bool = False

    @property
    def conditions(self) -> str:
        """The conditions in words."""
        frames = (
            "all frames" if self.frames == 0 else "1 frame" if self.frames == 1 else f"{self.frames} frames"
        )
        return f"{self.joints} joints, {frames}"

    @property
    def label(self) -> str:
        """Method and appearance in words."""
        return f"{self.method} + appearance" if self.appearance else self.method


@dataclass(frozen=True)
class Record:
    """One method on one pair of captures.

    Attributes
    ----------
    code : str
        Fingerprint of the program that was measured.
    seconds : float
        Of the relocation; `analysis_seconds` of surfaces, joints and anchors of both captures before it.
    others : int
        Moles on the body that an answer could be mistaken for.
    failure : str
        Why there are no scores; empty otherwise.
    new_spots, vanished_spots : SpotScore or None
        None where there is no truth, or the method does not look.
    """

    rung: Rung
    name: CaseName
    code: str
    seconds: float = 0.0
    analysis_seconds: float = 0.0
    others: int = 0
    lesions: tuple[LesionScore, ...] = ()
    new_spots: SpotScore | None = None
    vanished_spots: SpotScore | None = None
    failure: str = ""

    def to_json(self) -> dict[str, Any]:
        """A dictionary of plain values."""
        return {
            "rung": asdict(self.rung),
            "name": asdict(self.name),
            "code": self.code,
            "seconds": round(self.seconds, 4),
            "analysis_seconds": round(self.analysis_seconds, 4),
            "others": self.others,
            "lesions": [score.to_json() for score in self.lesions],
            "new_spots": None if self.new_spots is None else asdict(self.new_spots),
            "vanished_spots": None if self.vanished_spots is None else asdict(self.vanished_spots),
            "failure": self.failure,
        }

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Record:
        """What `to_json` made."""
        return cls(
            rung=Rung(**values["rung"]),
            name=CaseName(**values["name"]),
            code=values["code"],
            seconds=values["seconds"],
            analysis_seconds=values["analysis_seconds"],
            others=values["others"],
            lesions=tuple(LesionScore.from_json(v) for v in values["lesions"]),
            new_spots=_spots(values["new_spots"]),
            vanished_spots=_spots(values["vanished_spots"]),
            failure=values["failure"],
        )


def _spots(values: dict[str, int] | None) -> SpotScore | None:
    return None if values is None else SpotScore(**values)


class Journal:
    """Records in a file, one JSON line each; a line that a killed run left torn is dropped.

    Parameters
    ----------
    path : Path or None
        None keeps records in memory only.
    code : str
        Records of another program are not taken over, unless ``any_code``.

    Raises
    ------
    InputError
        If the file is no journal.
    """

    def __init__(self, path: Path | None, code: str, *, any_code: bool = False) -> None:
        self._path, self.code = path, code
        self.outdated = 0
        self._records: dict[tuple[Rung, CaseName], Record] = {}
        if path is not None and path.exists():
            for record in _read(path):
                if any_code or record.code == code:
                    self._records[record.rung, record.name] = record
                else:
                    self.outdated += 1
            self._rewrite()

    def __len__(self) -> int:
        return len(self._records)

    def __contains__(self, key: tuple[Rung, CaseName]) -> bool:
        return key in self._records

    def records(self, rungs: Iterable[Rung], names: Iterable[CaseName]) -> list[Record]:
        """Those of these rungs and pairs that were measured."""
        wanted = set(names)
        chosen = list(rungs)
        return [
            self._records[rung, name]
            for name in sorted(wanted, key=lambda n: n.case)
            for rung in chosen
            if (rung, name) in self._records
        ]

    def add(self, record: Record) -> None:
        """Keep a record; it is on disk when this returns.

        Raises
        ------
        WorkError
            If the file cannot be written.
        """
        # As it is read back: a report says the same whether its run was stopped in between or not.
        self._records[record.rung, record.name] = Record.from_json(record.to_json())
        if self._path is None:
            return
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(record.to_json()) + "\n")
        except OSError as error:
            raise WorkError(f"{self._path}: cannot be written ({error.strerror or error}).") from error

    def _rewrite(self) -> None:
        """The file again without torn and outdated lines."""
        assert self._path is not None
        partial = self._path.with_name(self._path.name + ".part")
        try:
            lines = (json.dumps(record.to_json()) + "\n" for record in self._records.values())
            partial.write_text("".join(lines), encoding="utf-8")
            partial.replace(self._path)
        except OSError as error:
            raise WorkError(f"{self._path}: cannot be written ({error.strerror or error}).") from error


def _read(path: Path) -> list[Record]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}).") from error
    out = []
    for number, line in enumerate(lines, 1):
        try:
            out.append(Record.from_json(json.loads(line)))
        except (ValueError, KeyError, TypeError) as error:
            if number == len(lines):
                break
            raise InputError(
                f"{path}: line {number} is no record of an evaluation.", "Choose another --out."
            ) from error
    return out


def code_fingerprint(folders: Sequence[Path]) -> str:
    """Twelve hexadecimal digits that change with any Python source in these folders or files."""
    digest = hashlib.sha256()
    for folder in folders:
        for path in [folder] if folder.is_file() else sorted(folder.rglob("*.py")):
            digest.update(path.name.encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
