"""What is finished, on disk: one line for each finished pair, appended the moment it is finished.

A line is written after the result it speaks of. Whatever is killed between the two is computed again; a line
that was torn by a crash is no line; a line whose result is not the one on disk does not count.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import BinaryIO

from core.errors import InputError, WorkError

JOURNAL = ".relocate-batch.jsonl"
LOCK = ".relocate-batch.lock"


@dataclass(frozen=True, slots=True)
class Finished:
    """A finished pair: with a result, or with the reason why there is none.

    Attributes
    ----------
    fingerprint : str
        Empty for a failure that another attempt may cure.
    sha256 : str
        Of ``<case>.json``; empty where there is no result.
    counts : mapping of str to int
        Lesions, lesions by status, spots.
    """

    case: str
    fingerprint: str
    sha256: str = ""
    reason: str = ""
    seconds: float = 0.0
    peak_memory_mb: float = 0.0
    counts: Mapping[str, int] = field(default_factory=dict)

    @property
    def done(self) -> bool:
        """Whether there is a result."""
        return bool(self.sha256)


class Journal:
    """The finished pairs of a results folder. Use as a context manager; one process at a time.

    Parameters
    ----------
    folder : Path
    fresh : bool
        Forget what earlier runs finished.
    """

    def __init__(self, folder: Path, *, fresh: bool = False) -> None:
        self.folder = folder
        self._path = folder / JOURNAL
        self._entries: dict[str, Finished] = {} if fresh else _read(self._path)
        self._file: BinaryIO | None = None

    def __enter__(self) -> Journal:
        # written anew without the lines that no longer count, so that it does not grow with every run
        try:
            with tempfile.NamedTemporaryFile("wb", dir=self.folder, prefix=JOURNAL, delete=False) as handle:
                for entry in self._entries.values():
                    handle.write(_line(entry))
            Path(handle.name).replace(self._path)
            self._file = self._path.open("ab", buffering=0)
        except OSError as error:
            raise _unwritable(self._path, error) from error
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()

    def add(self, entry: Finished) -> None:
        """Note a finished pair; it survives the end of this process from here on.

        Raises
        ------
        WorkError
            If the disk is full or the folder went away.
        """
        assert self._file is not None, "the journal is not open"
        try:
            self._file.write(_line(entry))
        except OSError as error:
            raise _unwritable(self._path, error) from error
        self._entries[entry.case] = entry

    def get(self, case: str) -> Finished | None:
        """What is known of a case."""
        return self._entries.get(case)

    def result_is_whole(self, entry: Finished) -> bool:
        """Whether ``<case>.json`` is still the file that was written."""
        try:
            return digest_of(self.folder / f"{entry.case}.json") == entry.sha256
        except OSError:
            return False


def digest_of(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Keep a second run out of a results folder. The operating system lifts the lock if the process dies.

    Raises
    ------
    InputError
        If another run works there.
    WorkError
        If the folder cannot be written.
    """
    path = folder / LOCK
    try:
        file = path.open("ab")
    except OSError as error:
        raise _unwritable(path, error) from error
    with file:
        if not _lock(file):
            raise InputError(
                f"{folder}: another relocate-batch is at work in this folder.", "Wait, or choose another."
            )
        yield


def _lock(file: BinaryIO) -> bool:
    try:
        if os.name == "nt":
            import msvcrt

            file.seek(0)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            import fcntl

            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _line(entry: Finished) -> bytes:
    return json.dumps(asdict(entry), ensure_ascii=True, separators=(",", ":")).encode("ascii") + b"\n"


def _read(path: Path) -> dict[str, Finished]:
    entries: dict[str, Finished] = {}
    try:
        with path.open("rb") as file:
            for line in file:
                entry = _entry(line)
                if entry is not None:
                    entries[entry.case] = entry
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    return entries


def _entry(line: bytes) -> Finished | None:
    """The entry of a line; None for one that was torn."""
    if not line.endswith(b"\n"):
        return None
    try:
        entry = Finished(**json.loads(line))
    except (ValueError, TypeError):
        return None
    return entry if isinstance(entry.case, str) else None


def _unwritable(path: Path, error: OSError) -> WorkError:
    return WorkError(
        f"{path}: cannot be written ({error.strerror or error}).",
        "Make room or choose a folder that you may write to; what is finished is kept.",
    )
