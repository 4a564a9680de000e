"""PLY files, text and binary (Turk 1994)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from core.errors import InputError
from core.geodesics.meshes import FloatArray, IntArray

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_INDEX_NAMES = ("vertex_indices", "vertex_index")
_LONGEST_HEADER = 1 << 16


@dataclass
class _Property:
    name: str
    kind: str  # dtype code of a value
    counter: str = ""  # dtype code of a list's length; empty for a single value


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


def read_ply(path: Path, data: bytes) -> tuple[FloatArray, IntArray]:
    """Vertices (n, 3) and triangles (m, 3) of a PLY file's bytes; polygons are split into fans."""
    order, elements, offset = _header(path, data)
    names = [element.name for element in elements]
    if "vertex" not in names:
        raise InputError(f"{path}: the PLY header has no element 'vertex'.")
    # Every row takes at least a byte: a count larger than the file is a lie, found before memory is taken.
    for element in elements:
        if element.properties and element.count > len(data):
            raise InputError(f"{path}: is too short for {element.count} rows of element '{element.name}'.")
    if order:
        body: _Body = _BinaryBody(path, data, offset, order)
    else:
        body = _TextBody(path, data, offset)
    vertices = np.zeros((0, 3))
    triangles = np.zeros((0, 3), dtype=np.int32)
    for element in elements:
        columns, faces = body.rows(element)
        if element.name == "vertex":
            missing = [axis for axis in "xyz" if axis not in columns]
            if missing:
                raise InputError(f"{path}: element 'vertex' has no property '{missing[0]}'.")
            vertices = np.stack([columns[axis].astype(np.float64) for axis in "xyz"], axis=1)
        elif element.name == "face":
            if element.count and not any(p.counter and p.name in _INDEX_NAMES for p in element.properties):
                raise InputError(f"{path}: element 'face' has no list 'vertex_indices'.")
            triangles = _triangles(path, faces)
    return vertices, triangles


def _header(path: Path, data: bytes) -> tuple[str, list[_Element], int]:
    if not data.startswith(b"ply"):
        raise InputError(f"{path}: line 1: a PLY file begins with the word ply.")
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    newline = data.find(b"\n", end)
    if end < 0 or newline < 0:
        raise InputError(f"{path}: the PLY header does not end.")
    order: str | None = None
    elements: list[_Element] = []
    for number, line in enumerate(data[:end].decode("ascii", errors="replace").splitlines(), start=1):
        words = line.split()
        if number == 1 or not words or words[0] in ("comment", "obj_info"):
            continue
        where = f"{path}: line {number}"
        if words[0] == "format" and len(words) >= 2:
            if words[1] not in _ORDERS:
                raise InputError(f"{where}: unknown PLY format '{words[1][:40]}'.")
            order = _ORDERS[words[1]]
        elif words[0] == "element" and len(words) == 3 and words[2].isascii() and words[2].isdigit():
            if len(words[2]) > 9:
                raise InputError(
                    f"{where}: {words[2][:20]}... rows of element '{words[1][:40]}' are too many."
                )
            elements.append(_Element(words[1], int(words[2])))
        elif words[0] == "property" and elements:
            kinds = words[2:4] if len(words) == 5 and words[1] == "list" else words[1:2]
            if len(words) not in (3, 5) or not kinds or any(kind not in _TYPES for kind in kinds):
                raise InputError(f"{where}: '{line[:60]}' is not a PLY property.")
            codes = [_TYPES[kind] for kind in kinds]
            elements[-1].properties.append(
                _Property(words[-1], codes[-1], codes[0] if len(codes) == 2 else "")
            )
            if len(codes) == 2 and codes[0].startswith("f"):
                raise InputError(f"{where}: the length of a list cannot be a fraction.")
        else:
            raise InputError(f"{where}: '{line[:60]}' is not part of a PLY header.")
    if order is None:
        raise InputError(f"{path}: the PLY header has no line 'format'.")
    return order, elements, newline + 1


def _triangles(path: Path, faces: FloatArray | list[FloatArray]) -> IntArray:
    if isinstance(faces, np.ndarray):
        table = faces
    else:
        fans = []
        for row, corners in enumerate(faces):
            if len(corners) < 3:
                raise InputError(f"{path}: face {row} has {len(corners)} corners.")
            fans += [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]
        table = np.array(fans, dtype=np.float64).reshape(-1, 3)
    wrong = np.flatnonzero(
        ~((table >= -(2.0**31)) & (table < 2.0**31) & (table == np.floor(table))).all(axis=1)
    )
    if len(wrong):
        raise InputError(f"{path}: face {int(wrong[0])} holds a vertex number that is not one.")
    triangles: IntArray = table.astype(np.int32)
    return triangles


class _Body(ABC):
    """What follows the header, read element by element."""

    def __init__(self, path: Path, data: bytes, offset: int) -> None:
        self.path, self.data, self.offset = path, data, offset

    @abstractmethod
    def rows(self, element: _Element) -> tuple[dict[str, FloatArray], FloatArray | list[FloatArray]]:
        """Single-valued columns by name, and the corner lists (an array (m, 3) when all are triangles)."""

    def short(self, element: _Element, row: int) -> InputError:
        return InputError(
            f"{self.path}: ends after {row} of {element.count} rows of element '{element.name}'."
        )


class _TextBody(_Body):
    def __init__(self, path: Path, data: bytes, offset: int) -> None:
        super().__init__(path, data, offset)
        self.line = data.count(b"\n", 0, offset)
        self.lines = iter(data[offset:].decode("ascii", errors="replace").splitlines())

    def rows(self, element: _Element) -> tuple[dict[str, FloatArray], FloatArray | list[FloatArray]]:
        columns: dict[str, list[float]] = {p.name: [] for p in element.properties if not p.counter}
        faces: list[FloatArray] = []
        if not element.properties:
            return {}, faces
        for row in range(element.count):
            words: list[str] = []
            for line in self.lines:
                self.line += 1
                words = line.split()
                if words:
                    break
            if not words:
                raise self.short(element, row)
            try:
                values = [float(word) for word in words]
            except ValueError as error:
                raise InputError(
                    f"{self.path}: line {self.line}: '{' '.join(words)[:60]}' are not numbers."
                ) from error
            at = 0
            for prop in element.properties:
                size = 1
                if prop.counter and at < len(values):
                    if not (values[at] >= 0 and values[at] == np.floor(values[at])):
                        raise InputError(
                            f"{self.path}: line {self.line}: list '{prop.name}' has no whole length."
                        )
                    size = 1 + int(min(values[at], 2**31))
                if at + size > len(values):
                    raise InputError(f"{self.path}: line {self.line}: property '{prop.name}' is missing.")
                if not prop.counter:
                    columns[prop.name].append(values[at])
                elif prop.name in _INDEX_NAMES:
                    faces.append(np.array(values[at + 1 : at + size]))
                at += size
        return {name: np.array(column, dtype=np.float64) for name, column in columns.items()}, faces


class _BinaryBody(_Body):
    def __init__(self, path: Path, data: bytes, offset: int, order: str) -> None:
        super().__init__(path, data, offset)
        self.order = order

    def rows(self, element: _Element) -> tuple[dict[str, FloatArray], FloatArray | list[FloatArray]]:
        if not element.properties or not element.count:
            return {p.name: np.zeros(0) for p in element.properties if not p.counter}, []
        names = [p.name for p in element.properties]
        if len(set(names)) != len(names):
            raise InputError(f"{self.path}: element '{element.name}' names a property twice.")
        # Most files hold triangles only: then a row has a fixed size and the element is one table.
        fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
        for p in element.properties:
            if p.counter:
                fields += [(f"{p.name} length", self.order + p.counter), (p.name, self.order + p.kind, (3,))]
            else:
                fields.append((p.name, self.order + p.kind))
        layout = np.dtype(fields)
        if self.offset + element.count * layout.itemsize <= len(self.data):
            table = np.frombuffer(self.data, layout, element.count, self.offset)
            if all((table[f"{p.name} length"] == 3).all() for p in element.properties if p.counter):
                self.offset += element.count * layout.itemsize
                columns = {p.name: table[p.name] for p in element.properties if not p.counter}
                lists = [p.name for p in element.properties if p.counter and p.name in _INDEX_NAMES]
                return columns, table[lists[0]].astype(np.float64) if lists else []
        if not any(p.counter for p in element.properties):
            raise self.short(element, (len(self.data) - self.offset) // layout.itemsize)
        return self._ragged(element)

    def _ragged(self, element: _Element) -> tuple[dict[str, FloatArray], list[FloatArray]]:
        columns: dict[str, list[float]] = {p.name: [] for p in element.properties if not p.counter}
        faces: list[FloatArray] = []
        for row in range(element.count):
            for prop in element.properties:
                size = 1
                if prop.counter:
                    size = int(self._take(element, row, prop.counter, 1)[0])
                    if size < 0:
                        raise InputError(
                            f"{self.path}: {element.name} {row}: list '{prop.name}' has no length."
                        )
                values = self._take(element, row, prop.kind, size)
                if not prop.counter:
                    columns[prop.name].append(float(values[0]))
                elif prop.name in _INDEX_NAMES:
                    faces.append(values)
        return {name: np.array(column, dtype=np.float64) for name, column in columns.items()}, faces

    def _take(self, element: _Element, row: int, kind: str, count: int) -> FloatArray:
        dtype = np.dtype(self.order + kind)
        if self.offset + count * dtype.itemsize > len(self.data):
            raise self.short(element, row)
        values = np.frombuffer(self.data, dtype, count, self.offset).astype(np.float64)
        self.offset += count * dtype.itemsize
        return values
