"""The manifest of a cohort: which pairs of visits, with every check before hours of work begin."""

from __future__ import annotations

import csv
import difflib
import io
import re
import unicodedata
from collections.abc import Iterator
from pathlib import Path

from app.batch.case import Case
from core.errors import InputError

REQUIRED = ("case", "first", "followup", "lesions")
OPTIONAL = ("method", "seed")

MAX_BYTES = 200_000_000
MAX_NAME_BYTES = 200
_UNSAFE = re.compile(r'[<>:"/\\|?*\x00-\x1f\x7f]')
_RESERVED = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
"""Names that Windows keeps for devices: a folder of results must survive being copied to another system."""
_ALIKE = 0.75


def read_manifest(path: Path, *, method: str, appearance: bool, seed: int) -> list[Case]:
    """The pairs of a manifest, in its order.

    Parameters
    ----------
    path : Path
        CSV in UTF-8 (with or without byte order mark) with a header. Columns ``case``, ``first``,
        ``followup``, ``lesions`` and, optionally, ``method`` and ``seed``; paths relative to the manifest's
        folder or absolute. Other columns are left alone.
    method, appearance, seed
        What holds for rows that say nothing else.

    Raises
    ------
    InputError
        Naming the file, the line and the column, for anything that is wrong with the manifest itself.
        Whether the folders exist is not looked at here.
    """
    rows = csv.reader(io.StringIO(_text(path), newline=""), strict=True)
    header = _header(path, rows)
    base = path.resolve().parent
    seen: dict[str, int] = {}
    out: list[Case] = []
    for line, fields in _lines(path, rows):
        if len(fields) != len(header):
            raise InputError(
                f"{path}: line {line} has {len(fields)} fields; the header has {len(header)}.",
                'A field with a comma in it must stand between quotation marks ("...").',
            )
        row = dict(zip(header, (field.strip() for field in fields), strict=True))
        name = _safe_name(path, line, row["case"])
        key = name.casefold()
        if key in seen:
            raise InputError(
                f'{path}: line {line}, column "case": "{name}" is already the case of line {seen[key]}.',
                "Every case needs a name of its own (upper and lower case count as the same).",
            )
        seen[key] = line
        first, followup, lesions = (_place(path, line, base, c, row[c]) for c in REQUIRED[1:])
        chosen = _method(path, line, row.get("method", "")) or method
        out.append(
            Case(
                name,
                first,
                followup,
                lesions,
                chosen,
                appearance,
                _seed(path, line, row.get("seed", ""), seed),
            )
        )
    if not out:
        raise InputError(f"{path}: holds no pair, only a header.", "Add one line for each pair of visits.")
    return out


def _text(path: Path) -> str:
    try:
        if not path.is_file():
            raise InputError(f"{path}: is not a file.", "Give the CSV file that lists the pairs.")
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: the file is larger than {MAX_BYTES // 1_000_000} MB.")
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        told = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise InputError(f"{path}: cannot be read ({told}).") from error
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in data:
        raise InputError(f"{path}: is not a text file in UTF-8.", 'Save it as "CSV UTF-8".')
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}: line {line} is not UTF-8.", 'Save it as "CSV UTF-8".') from error


def _lines(path: Path, rows: Iterator[list[str]]) -> Iterator[tuple[int, list[str]]]:
    """Rows that are not blank, with the line of the file on which they end."""
    while True:
        try:
            fields = next(rows, None)
        except csv.Error as error:
            raise InputError(f"{path}: line {_line(rows)} is not CSV ({error}).") from error
        if fields is None:
            return
        if any(field.strip() for field in fields):
            yield _line(rows), fields


def _line(rows: Iterator[list[str]]) -> int:
    return int(getattr(rows, "line_num", 0))


def _header(path: Path, rows: Iterator[list[str]]) -> list[str]:
    _, fields = next(_lines(path, rows), (0, None))
    if fields is None:
        raise InputError(f"{path}: is empty.", f"Its first line must be: {','.join(REQUIRED)}")
    header = [field.strip().casefold() for field in fields]
    for delimiter, told in ((";", "semicolons"), ("\t", "tabs"), ("|", "bars")):
        if len(header) == 1 and delimiter in header[0]:
            raise InputError(
                f"{path}: its columns are separated by {told}.", "Export it with commas as separators."
            )
    for column in REQUIRED:
        if column not in header:
            raise InputError(
                f'{path}: the column "{column}" is missing.',
                f"The first line must name the columns {', '.join(REQUIRED)}.",
            )
    for column in (*REQUIRED, *OPTIONAL):
        if header.count(column) > 1:
            raise InputError(f'{path}: the column "{column}" occurs twice.')
    for column in set(header) - {*REQUIRED, *OPTIONAL}:
        if meant := difflib.get_close_matches(column, OPTIONAL, 1, _ALIKE):
            raise InputError(f'{path}: there is no column "{column}".', f'Is "{meant[0]}" meant?')
    return header


def _safe_name(path: Path, line: int, name: str) -> str:
    """The case's name where ``<name>.json`` is a plain file on every system."""
    where = f'{path}: line {line}, column "case"'
    name = unicodedata.normalize("NFC", name)
    if not name:
        raise InputError(f"{where}: is empty.", "Every pair needs a name.")
    problem = ""
    if _UNSAFE.search(name) or not name.isprintable():
        problem = "holds a character that a file name must not have"
    elif name.startswith((".", "~")) or name.endswith("."):
        problem = "begins or ends with a character that hides or damages a file name"
    elif _RESERVED.fullmatch(name):
        problem = "is a name that Windows reserves"
    elif len(name.encode("utf-8", "replace")) > MAX_NAME_BYTES:
        problem = f"is longer than {MAX_NAME_BYTES} bytes"
    if problem:
        raise InputError(f"{where}: {name[:60]!r} {problem}.", "Results are written to DIR/<case>.json.")
    return name


def _place(path: Path, line: int, base: Path, column: str, value: str) -> str:
    if not value:
        raise InputError(f'{path}: line {line}, column "{column}": is empty.')
    return str(base / value)


def _method(path: Path, line: int, value: str) -> str:
    from core.relocation import RELOCATION_METHODS

    if value and value not in RELOCATION_METHODS:
        raise InputError(
            f'{path}: line {line}, column "method": there is no method "{value}".',
            f"Choose from: {', '.join(RELOCATION_METHODS)}.",
        )
    return value


def _seed(path: Path, line: int, value: str, default: int) -> int:
    if not value:
        return default
    if not re.fullmatch(r"[0-9]{1,18}", value):
        raise InputError(
            f'{path}: line {line}, column "seed": "{value[:30]}" is not a whole number from 0 on.'
        )
    return int(value)
