"""JSON files of the hand application: read with every check by pydantic, written whole or not at all."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from core.capture.fields import read_bytes
from core.errors import InputError, WorkError

CHECKED = ConfigDict(extra="ignore", strict=True, allow_inf_nan=False)
"""For every document: no text for a number, nothing infinite; fields of later versions do not disturb."""

_Document = TypeVar("_Document", bound=BaseModel)
_LONGEST_TOLD = 200


def read_document(path: Path, form: type[_Document], limit_bytes: int) -> _Document:
    """The content of a JSON file of at most ``limit_bytes``.

    Raises
    ------
    InputError
        Naming the file and the first field that is wrong.
    """
    data = read_bytes(path, limit_bytes).removeprefix(b"\xef\xbb\xbf")
    try:
        return form.model_validate_json(data)
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error)}") from error


def first_fault(error: ValidationError) -> str:
    """The first thing wrong as "field: what is wrong."."""
    first = error.errors(include_url=False, include_input=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    said = first["msg"].removeprefix("Value error, ").rstrip(".")
    told = f"{where}: {said}" if where else said
    return f"{told}." if len(told) <= _LONGEST_TOLD else f"{told[:_LONGEST_TOLD]} ..."


def write_document(path: Path, content: Mapping[str, object]) -> None:
    """Write a JSON file whole or not at all.

    Raises
    ------
    WorkError
        If the folder is missing, read-only or full.
    """
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all; see `write_document`."""
    write_file(path, text.encode("utf-8"))


def write_file(path: Path, content: bytes) -> None:
    """Write a file whole or not at all; see `write_document`.

    A link stays one, its target is written; into a device or pipe (/dev/stdout) it is written without
    putting a file in its place.
    """
    temporary: Path | None = None
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            _write_through(path, content)
            return
        target = path.resolve()
        with tempfile.NamedTemporaryFile("wb", dir=target.parent, prefix=".written-", delete=False) as file:
            temporary = Path(file.name)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o644)
        temporary.replace(target)
    except (OSError, RuntimeError) as error:  # RuntimeError: links in a circle, before Python 3.13
        raise WorkError(
            f"{path}: cannot be written ({getattr(error, 'strerror', None) or error}).",
            "Choose a folder that you may write to.",
        ) from error
    finally:  # after Ctrl-C, too; nothing is there once it is in place
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _write_through(path: Path, content: bytes) -> None:
    """Write into what is no file; a pipe that nobody reads is an error, it is not waited for."""
    descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
    os.set_blocking(descriptor, True)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
