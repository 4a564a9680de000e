"""Whether a finished pair is still the answer to its inputs: a digest of the options and of the files."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from collections.abc import Iterator
from pathlib import Path

from app.batch.case import Case
from core.capture.folder import CAPTURE_FILE

_MAX_SMALL_FILE = 50_000_000


def application_version() -> str:
    """Version of the application: results of different versions never stand in one table unnoticed."""
    return importlib.metadata.version("geoderm")


def fingerprint(case: Case) -> str:
    """A digest of all that the result depends on; 64 hexadecimal digits.

    Descriptions (capture.json) and lesions by content; depth frames and pictures by name, size and time of
    the last change, since reading them would cost as much as relocating. Where the folders stand does not
    matter, so that a cohort may move. Whatever cannot be read counts as such: the digest changes when it can.
    """
    digest = hashlib.sha256()
    options = (application_version(), case.method, case.appearance, case.seed)
    digest.update(json.dumps(options).encode())
    for line in _small_file(Path(case.lesions)):
        digest.update(line.encode("utf-8", "surrogateescape"))
    for folder in case.folders:
        digest.update(b"\nvisit\n")
        for line in _visit(folder):
            digest.update(line.encode("utf-8", "surrogateescape"))
    return digest.hexdigest()


def _visit(folder: Path) -> Iterator[str]:
    if _is_there(folder / CAPTURE_FILE):
        yield from _capture(folder)
        return
    try:
        names = sorted(p.name for p in folder.iterdir() if p.name[0] != "." and _is_there(p / CAPTURE_FILE))
    except OSError as error:
        yield f"unreadable {error.errno}\n"
        return
    for name in names:
        yield f"capture {json.dumps(name)}\n"
        yield from _capture(folder / name)


def _capture(folder: Path) -> Iterator[str]:
    yield from _small_file(folder / CAPTURE_FILE)
    for name in _named_files(folder / CAPTURE_FILE):
        try:
            status = (folder / name).stat()
            yield f"{json.dumps(name)} {status.st_size} {status.st_mtime_ns}\n"
        except (OSError, ValueError):
            yield f"{json.dumps(name)} missing\n"


def _named_files(path: Path) -> list[str]:
    """Frames and picture that a description names; none where it is no description (its own digest tells)."""
    try:
        content = json.loads(path.read_bytes())
        names = [*content["depth"]["frames"], content.get("color", {}).get("file")]
    except (OSError, ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return []
    return [name for name in names if isinstance(name, str)]


def _small_file(path: Path) -> Iterator[str]:
    try:
        status = path.stat()
        if status.st_size > _MAX_SMALL_FILE or not path.is_file():
            yield f"no small file {status.st_size} {status.st_mtime_ns}\n"
        else:
            yield f"{hashlib.sha256(path.read_bytes()).hexdigest()}\n"
    except OSError as error:
        yield f"unreadable {error.errno}\n"


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:
        return False
