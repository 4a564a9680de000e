"""``geoderm geodesics``: distances along a mesh from any of its vertices, as a NumPy file."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from core.errors import InputError, WorkError

if TYPE_CHECKING:
    import numpy as np


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("geodesics")(geodesics)


def geodesics(
    mesh: Path = typer.Argument(..., help="OFF, OBJ or PLY file."),
    sources: str = typer.Option(..., help="Vertex numbers, 0-based, separated by commas."),
    method: str = typer.Option("virtual-source", help="dijkstra, fast-marching or virtual-source."),
    out: Path = typer.Option(..., help="NumPy file to write: floats [sources, vertices], inf = unreachable."),
) -> None:
    """Distances along a mesh from vertices, in the mesh's unit."""
    from core.geodesics import geodesic_solver, read_mesh

    if out.suffix != ".npy":
        raise InputError(f"--out {out}: the name must end in .npy.")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: the folder does not exist.", "Create it or choose another.")
    numbers = _vertices(sources)
    vertices, triangles = read_mesh(mesh)
    for number in numbers:
        if number >= len(vertices):
            raise InputError(
                f"--sources {number}: {mesh} has only {len(vertices)} vertices, numbered from 0."
            )
    distances = geodesic_solver(vertices, triangles, method).distances(numbers)
    _write_whole(out, distances)
    typer.echo(f"{len(numbers)} x {len(vertices)} distances written to {out}")


def _write_whole(path: Path, distances: np.ndarray) -> None:
    """Write the file whole or not at all."""
    import numpy as np

    temporary: Path | None = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as file:
            temporary = Path(file.name)
            np.save(file, distances)
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        raise WorkError(
            f"{path}: cannot be written ({error.strerror or 'output error'}).",
            "Choose a folder that you may write to.",
        ) from error


def _vertices(text: str) -> list[int]:
    words = [word.strip() for word in text.split(",")]
    if not all(word.isascii() and word.isdigit() and len(word) < 10 for word in words):
        raise InputError(f"--sources '{text[:60]}': give vertex numbers such as 0,17,250.")
    return [int(word) for word in words]
