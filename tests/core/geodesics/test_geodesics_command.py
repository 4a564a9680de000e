"""``geoderm geodesics``: a mesh file in, a NumPy file out."""

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from app.cli.geodesics import register
from core.errors import InputError, WorkError

MESH = "OFF\n5 2 0\n0 0 0\n3 0 0\n0 4 0\n3 4 0\n9 9 9\n3 0 1 2\n3 1 3 2\n"


@pytest.fixture
def run(tmp_path):
    app = typer.Typer()
    register(app)
    app.callback()(lambda: None)
    mesh = tmp_path / "mesh.off"
    mesh.write_text(MESH)

    def invoke(*options, mesh=mesh, out=tmp_path / "d.npy"):
        result = CliRunner().invoke(app, ["geodesics", str(mesh), "--out", str(out), *options])
        if result.exception is not None:
            raise result.exception
        return np.load(out)

    return invoke


def test_distances_are_written_one_row_per_source(run):
    distances = run("--sources", "0, 1")
    assert distances.dtype == np.float64
    assert distances.shape == (2, 5)
    assert distances[0, :4] == pytest.approx([0, 3, 4, 5], rel=1e-6)
    assert np.isinf(distances[:, 4]).all()


def test_the_method_is_chosen_by_name(run):
    assert run("--sources", "0", "--method", "dijkstra")[0, 3] == pytest.approx(7.0)
    assert run("--sources", "0", "--method", "fast-marching")[0, 3] == pytest.approx(5.0, rel=1e-6)


@pytest.mark.parametrize("sources", ["", "a", "0,,1", "-1", "0;1", "1.5", "5", "99999999999"])
def test_wrong_sources_are_refused(run, sources):
    with pytest.raises(InputError, match="sources"):
        run("--sources", sources)


def test_wrong_names_are_refused(run, tmp_path):
    with pytest.raises(InputError, match="heat"):
        run("--sources", "0", "--method", "heat")
    with pytest.raises(InputError, match=r"none\.off"):
        run("--sources", "0", mesh=tmp_path / "none.off")
    with pytest.raises(InputError, match=r"\.npy"):
        run("--sources", "0", out=tmp_path / "d.txt")
    with pytest.raises(InputError, match="no folder"):
        run("--sources", "0", out=tmp_path / "no folder" / "d.npy")


def test_a_result_that_cannot_be_written_is_told(run, tmp_path):
    (tmp_path / "taken.npy").mkdir()
    with pytest.raises(WorkError, match=r"taken\.npy"):
        run("--sources", "0", out=tmp_path / "taken.npy")
