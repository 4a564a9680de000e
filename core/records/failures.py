"""Which failures of disk and database are the environment's, and what the user can do about them.

Everything that is not listed here is a mistake of the program and is raised as it is.
"""

from __future__ import annotations

import errno
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager

from core.errors import InputError, WorkError


class StorageError(WorkError):
    """The clinic folder cannot be read or written just now; nothing was half-written."""


class DamagedError(StorageError):
    """A stored picture or the database is not what was written."""


_DISK_FULL = ("The disk with {place} is full.", "Free some space on it and try again.")
_READ_ONLY = (
    "You may not write to {place}.",
    "Ask for write permission on the folder, or choose another one.",
)
_GONE = (
    "GeoDerm cannot reach {place}.",
    "Check that the folder exists and that the disk or network drive is connected, then try again.",
)
_BUSY = (
    "The clinic database is in use by another program.",
    "Close the other program (a backup, or a second GeoDerm) and try again.",
)
_BROKEN_DISK = (
    "The disk with {place} reports an error.",
    "Save your work elsewhere and have the disk checked.",
)
_NO_HANDLES = ("Too many files are open on this computer.", "Close some programs and try again.")

_OS_FAILURES: dict[int, tuple[str, str]] = {
    errno.ENOSPC: _DISK_FULL,
    errno.EDQUOT: _DISK_FULL,
    errno.EFBIG: _DISK_FULL,
    errno.EROFS: _READ_ONLY,
    errno.EACCES: _READ_ONLY,
    errno.EPERM: _READ_ONLY,
    errno.ENOENT: _GONE,
    errno.ENOTDIR: _GONE,
    errno.EEXIST: ("A file stands where {place} should be.", "Choose another folder."),
    errno.EISDIR: ("A folder stands where a file of {place} should be.", "Choose another folder."),
    errno.ENODEV: _GONE,
    errno.ENXIO: _GONE,
    errno.ESTALE: _GONE,
    errno.ETIMEDOUT: _GONE,
    errno.EHOSTDOWN: _GONE,
    errno.EIO: _BROKEN_DISK,
    errno.EMFILE: _NO_HANDLES,
    errno.ENFILE: _NO_HANDLES,
}

_SQLITE_FAILURES: dict[str, tuple[str, str]] = {
    "SQLITE_FULL": _DISK_FULL,
    "SQLITE_BUSY": _BUSY,
    "SQLITE_LOCKED": _BUSY,
    "SQLITE_PROTOCOL": _BUSY,
    "SQLITE_READONLY": _READ_ONLY,
    "SQLITE_PERM": _READ_ONLY,
    "SQLITE_AUTH": _READ_ONLY,
    "SQLITE_CANTOPEN": _GONE,
    "SQLITE_IOERR": _BROKEN_DISK,
}
_SQLITE_DAMAGE = ("SQLITE_CORRUPT", "SQLITE_NOTADB")


CLINIC_FOLDER = "the clinic folder"


def storage_error(error: OSError, place: str = CLINIC_FOLDER) -> StorageError | None:
    """The user's message for an error of the operating system, or None if it is not the environment's."""
    told = _OS_FAILURES.get(error.errno or 0)
    return StorageError(told[0].format(place=place), told[1]) if told else None


def database_error(error: BaseException | None) -> StorageError | None:
    """The user's message for an error of SQLite, or None if it is a mistake of the program."""
    if not isinstance(error, sqlite3.Error):
        return None
    name = getattr(error, "sqlite_errorname", "") or ""
    for prefix, told in _SQLITE_FAILURES.items():
        if name == prefix or name.startswith(prefix + "_"):
            return StorageError(told[0].format(place=CLINIC_FOLDER), told[1])
    if any(name == damage or name.startswith(damage + "_") for damage in _SQLITE_DAMAGE):
        return DamagedError(
            "The clinic database is damaged.", "Restore the clinic folder from the last good backup."
        )
    return None


@contextmanager
def told_to_the_user(place: str = CLINIC_FOLDER) -> Iterator[None]:
    """Turn the environment's failures inside the block into `StorageError`; let mistakes through.

    ``place`` is what is being read or written, in words, without any patient data.
    """
    from sqlalchemy.exc import DBAPIError

    try:
        yield
    except DBAPIError as error:
        told = database_error(error.orig)
        if told is None:
            raise
        raise told from None
    except sqlite3.Error as error:
        told = database_error(error)
        if told is None:
            raise
        raise told from None
    except OSError as error:
        told = storage_error(error, place)
        if told is None:
            raise
        raise told from error


def missing(what: str) -> InputError:
    """The error for a record that is not (or no longer) in the store."""
    return InputError(
        f"This {what} is not in the clinic's records.", "It may have been removed; reload the page."
    )
