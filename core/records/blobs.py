"""Pictures on disk, named by the SHA-256 of what is stored; written whole or not at all."""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from core.records.failures import DamagedError, told_to_the_user

_NAME = re.compile(r"[0-9a-f]{64}")
_TEMPORARY = ".part-"


class BlobCipher(Protocol):
    """Seals bytes before they reach the disk and opens them again.

    Blobs are named by the hash of the sealed bytes, so damage is found without any key.
    """

    def seal(self, plain: bytes) -> bytes:
        """What is written."""

    def open(self, sealed: bytes) -> bytes:
        """The plain bytes again; raises `core.errors.WorkError` if the key does not fit."""


class NoCipher:
    """Stores bytes as they are."""

    def seal(self, plain: bytes) -> bytes:
        """The same bytes."""
        return plain

    def open(self, sealed: bytes) -> bytes:
        """The same bytes."""
        return sealed


def fsync_directory(folder: Path) -> None:
    """Make renames inside a folder survive a power cut, where the system can."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file whole or not at all: temporary file beside it, fsync, rename, fsync of the folder."""
    temporary = path.with_name(f"{_TEMPORARY}{secrets.token_hex(8)}")
    _write_synced(temporary, data, path)
    fsync_directory(path.parent)


def _write_synced(temporary: Path, data: bytes, path: Path) -> None:
    try:
        with temporary.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


class BlobStore:
    """A folder ``ab/cdef...`` of immutable blobs.

    Parameters
    ----------
    folder : Path
        Created if absent.
    cipher : BlobCipher
        Seals what is written. The default stores bytes as they are.
    """

    def __init__(self, folder: Path, cipher: BlobCipher | None = None) -> None:
        self._folder = folder
        self._cipher: BlobCipher = cipher or NoCipher()
        with told_to_the_user():
            folder.mkdir(parents=True, exist_ok=True)

    def path(self, name: str) -> Path:
        """Where a blob lies."""
        if not _NAME.fullmatch(name):
            raise ValueError("a blob is named by 64 hexadecimal digits")
        return self._folder / name[:2] / name[2:]

    def put(self, data: bytes) -> str:
        """Store bytes and return their name; they are on the disk when this returns."""
        return self.put_many([data])[0]

    def put_many(self, items: Sequence[bytes]) -> list[str]:
        """Store several blobs, syncing each folder once; all are on the disk when this returns.

        A blob that is already there is kept if it is sound and mended if it is damaged.

        Raises
        ------
        StorageError
            If the disk is full, read-only or gone. Blobs written before that are harmless orphans.
        """
        names = []
        touched: dict[Path, None] = {}
        with told_to_the_user():
            for data in items:
                sealed = self._cipher.seal(data)
                name = hashlib.sha256(sealed).hexdigest()
                names.append(name)
                path = self.path(name)
                if self._is_sound(path, name):
                    os.utime(path)
                else:
                    if not path.parent.is_dir():
                        path.parent.mkdir(exist_ok=True)
                        touched[self._folder] = None
                    _write_synced(path.with_name(f"{_TEMPORARY}{secrets.token_hex(8)}"), sealed, path)
                touched[path.parent] = None
            for folder in touched:
                fsync_directory(folder)
        return names

    def get(self, name: str) -> bytes:
        """The bytes of a blob.

        Raises
        ------
        DamagedError
            If the blob is missing or its bytes are not those that were stored.
        """
        path = self.path(name)
        with told_to_the_user():
            if not self._folder.is_dir():
                raise FileNotFoundError(2, "the blob folder is gone")
            try:
                sealed = path.read_bytes()
            except FileNotFoundError:
                sealed = None
        if sealed is None:
            raise DamagedError("A stored picture is missing.", "Restore the clinic folder from a backup.")
        if hashlib.sha256(sealed).hexdigest() != name:
            raise DamagedError("A stored picture is damaged.", "Restore the clinic folder from a backup.")
        return self._cipher.open(sealed)

    def check(self, name: str) -> str | None:
        """What is wrong with a blob: None, ``"missing"`` or ``"damaged"``."""
        path = self.path(name)
        with told_to_the_user():
            if not path.is_file():
                return "missing"
            return None if self._is_sound(path, name) else "damaged"

    def names(self) -> Iterator[str]:
        """Every blob on the disk."""
        with told_to_the_user():
            for folder in sorted(self._folder.iterdir()):
                if len(folder.name) != 2 or not folder.is_dir():
                    continue
                for path in sorted(folder.iterdir()):
                    name = folder.name + path.name
                    if _NAME.fullmatch(name):
                        yield name

    def remove_unused(self, used: Iterable[str], *, min_age_s: float = 3600.0) -> int:
        """Remove blobs and unfinished temporary files that nothing refers to; return how many.

        Parameters
        ----------
        used : iterable of str
            Names that must stay.
        min_age_s : float
            Younger files stay, because the row that will refer to them may be about to be written.
        """
        keep = set(used)
        limit = time.time() - min_age_s
        removed = 0
        with told_to_the_user():
            for path in list(self._folder.glob("??/*")):
                unused = path.name.startswith(_TEMPORARY) or (path.parent.name + path.name) not in keep
                if unused and path.is_file() and path.stat().st_mtime <= limit:
                    path.unlink(missing_ok=True)
                    removed += 1
        return removed

    @staticmethod
    def _is_sound(path: Path, name: str) -> bool:
        try:
            with path.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest() == name
        except FileNotFoundError:
            return False
