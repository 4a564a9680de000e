"""Triangle meshes from OFF, OBJ and PLY files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from core.errors import InputError
from core.geodesics.meshes import FloatArray, IntArray
from core.geodesics.ply import read_ply

_FARTHEST = 1e30
"""Largest coordinate: squares of edge lengths must stay within the kernels' numbers."""


def read_mesh(path: Path | str) -> tuple[FloatArray, IntArray]:
    """Read a mesh file; the format follows from the name's ending.

    Polygons with more than three corners are split into fans; the vertices keep the file's numbering.

    Parameters
    ----------
    path : Path
        ``.off``, ``.obj`` or ``.ply`` (text or binary).

    Returns
    -------
    vertices : ndarray (n, 3) float64
        In the file's unit.
    triangles : ndarray (m, 3) int32

    Raises
    ------
    InputError
        The file cannot be read, is damaged or contradicts itself; the message names the file and the line or
        the field.
    """
    path = Path(path)
    readers = {".off": _read_off, ".obj": _read_obj, ".ply": read_ply}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: unknown mesh format '{path.suffix}'.", "Use an OFF, OBJ or PLY file.")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or 'input error'}).") from error
    vertices, triangles = reader(path, data)
    return _checked(path, vertices, triangles)


def _checked(path: Path, vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    if len(vertices) == 0:
        raise InputError(f"{path}: holds no vertices.")
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise InputError(f"{path}: vertex {int(bad[0])} has a coordinate that is not a finite number.")
    bad = np.flatnonzero((np.abs(vertices) > _FARTHEST).any(axis=1))
    if len(bad):
        raise InputError(
            f"{path}: vertex {int(bad[0])} has a coordinate beyond {_FARTHEST:g}, too large to measure with.",
            "Export the mesh again.",
        )
    bad = np.flatnonzero(((triangles < 0) | (triangles >= len(vertices))).any(axis=1))
    if len(bad):
        raise InputError(
            f"{path}: face {int(bad[0])} names a vertex that does not exist "
            f"({triangles[bad[0]].tolist()} of {len(vertices)} vertices)."
        )
    return vertices, triangles


def _lines(data: bytes) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(data.decode("utf-8", errors="replace").splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if words:
            yield number, words


def _numbers(path: Path, line: int, words: list[str]) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError as error:
        raise InputError(f"{path}: line {line}: '{' '.join(words)[:60]}' are not numbers.") from error


def _whole(path: Path, line: int, word: str) -> int:
    try:
        value = int(word)
    except ValueError as error:
        raise InputError(f"{path}: line {line}: '{word[:60]}' is not a whole number.") from error
    if abs(value) >= 2**31:
        raise InputError(f"{path}: line {line}: the number {word[:30]} is too large.")
    return value


def _arrays(
    vertices: list[list[float]], triangles: list[tuple[int, int, int]]
) -> tuple[FloatArray, IntArray]:
    return (
        np.array(vertices, dtype=np.float64).reshape(-1, 3),
        np.array(triangles, dtype=np.int32).reshape(-1, 3),
    )


def _fan(corners: list[int]) -> list[tuple[int, int, int]]:
    return [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]


def _read_off(path: Path, data: bytes) -> tuple[FloatArray, IntArray]:
    lines = _lines(data)
    number, words = next(lines, (0, [""]))
    if words[0] not in ("OFF", "COFF", "NOFF", "CNOFF"):
        raise InputError(f"{path}: line {max(number, 1)}: an OFF file begins with the word OFF.")
    if len(words) > 1 and words[1].upper() == "BINARY":
        raise InputError(
            f"{path}: line {number}: binary OFF files are not supported.", "Save it as text or as PLY."
        )
    counts = words[1:]
    if not counts:
        number, counts = next(lines, (number, []))
    if len(counts) < 2:
        raise InputError(f"{path}: line {number}: the counts of vertices and faces are missing.")
    vertex_count, face_count = (_whole(path, number, word) for word in counts[:2])
    if vertex_count < 0 or face_count < 0:
        raise InputError(f"{path}: line {number}: a count is negative.")
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for index in range(vertex_count):
        number, words = next(lines, (0, []))
        if not words:
            raise InputError(f"{path}: ends after {index} of {vertex_count} vertices.")
        if len(words) < 3:
            raise InputError(f"{path}: line {number}: a vertex needs three coordinates.")
        vertices.append(_numbers(path, number, words[:3]))
    for index in range(face_count):
        number, words = next(lines, (0, []))
        if not words:
            raise InputError(f"{path}: ends after {index} of {face_count} faces.")
        sides = _whole(path, number, words[0])
        if sides < 3 or len(words) < sides + 1:
            raise InputError(f"{path}: line {number}: a face of {sides} corners is incomplete.")
        triangles += _fan([_whole(path, number, word) for word in words[1 : sides + 1]])
    return _arrays(vertices, triangles)


def _read_obj(path: Path, data: bytes) -> tuple[FloatArray, IntArray]:
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for number, words in _lines(data):
        if words[0] == "v":
            if len(words) < 4:
                raise InputError(f"{path}: line {number}: a vertex needs three coordinates.")
            vertices.append(_numbers(path, number, words[1:4]))
        elif words[0] == "f":
            if len(words) < 4:
                raise InputError(f"{path}: line {number}: a face needs three corners.")
            corners = []
            for word in words[1:]:
                index = _whole(path, number, word.split("/", 1)[0])
                index = index - 1 if index > 0 else len(vertices) + index
                if index < 0 or word.startswith("0"):
                    raise InputError(f"{path}: line {number}: face corner '{word[:30]}' names no vertex.")
                corners.append(index)
            triangles += _fan(corners)
    return _arrays(vertices, triangles)
