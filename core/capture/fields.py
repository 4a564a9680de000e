"""Typed reading of a JSON description: whatever is wrong is told with the file's and the field's name."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from core.errors import InputError

_MAX_JSON_BYTES = 16_000_000


def load_json_object(path: Path) -> Fields:
    """The JSON object in a file.

    Raises
    ------
    InputError
        If the file is missing, unreadable, too large, not JSON or not an object.
    """
    data = read_bytes(path, _MAX_JSON_BYTES)
    try:
        value = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        what = "too deeply nested" if isinstance(error, RecursionError) else str(error)
        raise InputError(f"{path}: not valid JSON ({what}).", "Export the capture again.") from error
    if not isinstance(value, dict):
        raise InputError(f"{path}: must be a JSON object.")
    return Fields(path, value)


def read_bytes(path: Path, limit: int) -> bytes:
    """The content of a regular file of at most ``limit`` bytes; `InputError` that names it otherwise."""
    try:
        if not path.exists():
            raise InputError(f"{path}: the file does not exist.")
        if not path.is_file():
            raise InputError(f"{path}: is not a file.")
        if path.stat().st_size > limit:
            raise InputError(f"{path}: the file is larger than {limit // 1_000_000} MB.")
        return path.read_bytes()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{path}: cannot be read ({reason}).") from error


class Fields:
    """A JSON object that knows from which file and field it came."""

    def __init__(self, path: Path, values: Mapping[str, Any], prefix: str = "") -> None:
        self.path = path
        self._values = values
        self._prefix = prefix

    def error(self, name: str, problem: str, advice: str = "") -> InputError:
        """An error about one field, to be raised by the caller."""
        return InputError(f"{self.path}: {self._prefix}{name} {problem}", advice)

    def has(self, name: str) -> bool:
        """Whether the field is there and not null."""
        return self._values.get(name) is not None

    def raw(self, name: str) -> Any:
        """The field's value as JSON has it; it must be there."""
        if not self.has(name):
            raise self.error(name, "is missing.")
        return self._values[name]

    def object(self, name: str) -> Fields:
        """A nested object."""
        value = self.raw(name)
        if not isinstance(value, dict):
            raise self.error(name, "must be an object.")
        return Fields(self.path, value, f"{self._prefix}{name}.")

    def as_dict(self) -> dict[str, Any]:
        """A copy of the object as JSON has it."""
        return dict(self._values)

    def names(self) -> tuple[str, ...]:
        """The field names of this object."""
        return tuple(self._values)

    def text(self, name: str, default: str | None = None, limit: int = 500) -> str:
        """A string; ``default`` when the field is absent and a default is given."""
        if default is not None and not self.has(name):
            return default
        value = self.raw(name)
        if not isinstance(value, str):
            raise self.error(name, "must be text.")
        if len(value) > limit:
            raise self.error(name, f"is longer than {limit} characters.")
        try:
            value.encode("utf-8")
        except UnicodeEncodeError as error:
            raise self.error(name, "is not valid Unicode text.") from error
        return value

    def number(self, name: str) -> float:
        """A finite number."""
        return self._finite(name, self.raw(name))

    def integer(self, name: str, low: int, high: int) -> int:
        """A whole number in ``low..high``."""
        value = self.number(name)
        if value != int(value) or not low <= value <= high:
            raise self.error(name, f"must be a whole number between {low} and {high}.")
        return int(value)

    def flag(self, name: str, default: bool) -> bool:
        """A truth value."""
        if not self.has(name):
            return default
        value = self.raw(name)
        if not isinstance(value, bool):
            raise self.error(name, "must be true or false.")
        return value

    def numbers(self, name: str, length: int | None = None) -> tuple[float, ...]:
        """A list of finite numbers, of ``length`` if given."""
        value = self.raw(name)
        if not isinstance(value, list) or (length is not None and len(value) != length):
            count = "" if length is None else f"{length} "
            raise self.error(name, f"must be a list of {count}numbers.")
        return tuple(self._finite(f"{name}[{i}]", x) for i, x in enumerate(value))

    def matrix(self, name: str, rows: int, columns: int) -> list[tuple[float, ...]]:
        """A list of ``rows`` lists of ``columns`` finite numbers."""
        value = self.raw(name)
        if not isinstance(value, list) or len(value) != rows:
            raise self.error(name, f"must be {rows} rows of {columns} numbers.")
        out = []
        for i, row in enumerate(value):
            if not isinstance(row, list) or len(row) != columns:
                raise self.error(f"{name}[{i}]", f"must be {columns} numbers.")
            out.append(tuple(self._finite(f"{name}[{i}][{j}]", x) for j, x in enumerate(row)))
        return out

    def texts(self, name: str) -> Sequence[str]:
        """A list of strings."""
        value = self.raw(name)
        if not isinstance(value, list) or not all(isinstance(x, str) for x in value):
            raise self.error(name, "must be a list of texts.")
        return list(value)

    def _finite(self, name: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(name, "must be a number.")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(name, "must be a finite number.")
        return number
