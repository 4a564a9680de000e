"""``geoderm geodesics``: the file it writes, and every bad mesh, source and place told in one line."""

from __future__ import annotations

import os
import stat
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.app.cli.cases import Outcome, assert_told, geoderm

METHODS = ("dijkstra", "fast-marching", "virtual-source")

OFF = "OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n9 9 9\n3 0 1 2\n3 0 2 3\n"
OBJ = "# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nf 1 2 3\nf 1/1 3//2 4/3/3\n"
PLY_HEADER = (
    "ply\nformat {order} 1.0\ncomment a square\nelement vertex 5\nproperty float x\nproperty float y\n"
    "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
)
PLY = PLY_HEADER.format(order="ascii") + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n9 9 9\n3 0 1 2\n3 0 2 3\n"


def binary_ply(order: str = "<") -> bytes:
    name = "binary_little_endian" if order == "<" else "binary_big_endian"
    body = struct.pack(f"{order}15f", 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 9, 9, 9)
    faces = b"".join(struct.pack(f"{order}B3i", 3, *f) for f in ((0, 1, 2), (0, 2, 3)))
    return PLY_HEADER.format(order=name).encode() + body + faces


GOOD: dict[str, bytes] = {
    "text.off": OFF.encode(),
    "text.obj": OBJ.encode(),
    "text.ply": PLY.encode(),
    "little.ply": binary_ply("<"),
    "big.ply": binary_ply(">"),
    "UPPER.OFF": OFF.encode(),
    "windows.off": OFF.replace("\n", "\r\n").encode(),
    "comments.off": OFF.replace("5 2 0", "# counts\n5 2 0 # five").encode(),
    "quad.off": OFF.replace("5 2 0", "5 1 0").replace("3 0 1 2\n3 0 2 3", "4 0 1 2 3").encode(),
    "quad.obj": OBJ.split("f ")[0].encode() + b"f 1 2 3 4\n",
    "relative.obj": OBJ.split("f ")[0].encode() + b"f -5 -4 -3\nf -5 -3 -2\n",
}


def run(mesh: Path, out: Path, sources: str = "0", *options: object) -> Outcome:
    return geoderm("geodesics", mesh, "--sources", sources, "--out", out, *options)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "distances.npy"


@pytest.fixture
def square(tmp_path: Path) -> Path:
    path = tmp_path / "square.off"
    path.write_text(OFF)
    return path


@pytest.mark.parametrize("name", GOOD)
def test_distances_from_every_kind_of_mesh_file(name: str, tmp_path: Path, out: Path) -> None:
    (tmp_path / name).write_bytes(GOOD[name])
    outcome = run(tmp_path / name, out, "0,2,4")
    assert (outcome.code, outcome.err) == (0, ""), outcome
    distances = np.load(out)
    assert distances.shape == (3, 5)
    assert distances.dtype.kind == "f"
    inf, d = np.inf, np.sqrt(2)
    np.testing.assert_allclose(
        distances, [[0, 1, d, 1, inf], [d, 1, 0, 1, inf], [inf, inf, inf, inf, 0]], atol=1e-6
    )


@pytest.mark.parametrize("method", METHODS)
def test_every_method_by_its_name(method: str, square: Path, out: Path) -> None:
    assert run(square, out, "1,0", "--method", method).code == 0
    distances = np.load(out)
    assert distances.shape == (2, 5)
    np.testing.assert_allclose(distances[:, [0, 1, 2]], [[1, 0, 1], [0, 1, np.sqrt(2)]], atol=1e-6)
    assert np.isinf(distances[:, 4]).all()


def test_virtual_source_is_the_default(square: Path, out: Path, tmp_path: Path) -> None:
    """On a bent strip the three methods differ; the default is the exact one."""
    u, v = np.meshgrid(np.arange(9.0), np.arange(4.0))
    places = np.stack([u.ravel(), v.ravel(), 0.4 * np.abs(u.ravel() - 4)], axis=1)
    faces = [
        f"3 {a} {a + 1} {a + 10}\n3 {a} {a + 10} {a + 9}"
        for a in (9 * j + i for j in range(3) for i in range(8))
    ]
    mesh = tmp_path / "strip.off"
    rows = [" ".join(map(repr, p)) for p in places.tolist()]
    mesh.write_text("\n".join([f"OFF {len(rows)} {2 * len(faces)} 0", *rows, *faces]) + "\n")
    results = {}
    for method in (None, *METHODS):
        assert run(mesh, out, "0", *(("--method", method) if method else ())).code == 0
        results[method] = np.load(out)
    np.testing.assert_array_equal(results[None], results["virtual-source"])
    assert not np.array_equal(results["dijkstra"], results["virtual-source"])
    assert (results["virtual-source"] <= results["dijkstra"] + 1e-5).all()


def test_the_unit_is_the_meshs(tmp_path: Path, out: Path) -> None:
    mesh = tmp_path / "mm.off"
    mesh.write_text(OFF.replace("1 0 0", "1000 0 0"))
    assert run(mesh, out, "0").code == 0
    assert np.load(out)[0, 1] == pytest.approx(1000)


def test_a_source_named_twice_has_two_rows(square: Path, out: Path) -> None:
    assert run(square, out, "0, 0").code == 0
    distances = np.load(out)
    np.testing.assert_array_equal(distances[0], distances[1])


def test_points_without_a_face_reach_nothing(tmp_path: Path, out: Path) -> None:
    mesh = tmp_path / "points.off"
    mesh.write_text("OFF\n2 0 0\n0 0 0\n1 0 0\n")
    assert run(mesh, out, "0").code == 0
    np.testing.assert_array_equal(np.load(out), [[0, np.inf]])


# --- bad input


@pytest.mark.parametrize(
    "sources",
    ["", " ", ",", "0,", "-1", "1.0", "one", "0;1", "0 1", "0,0x1", "5", "0,5", "99999999999999", "٣"],
)
def test_sources_that_are_no_vertices(square: Path, out: Path, sources: str) -> None:
    assert_told(geoderm("geodesics", square, f"--sources={sources}", "--out", out), 2, "--sources")
    assert not out.exists()


def test_an_unknown_method_is_named_with_those_that_exist(square: Path, out: Path) -> None:
    assert_told(run(square, out, "0", "--method", "magic"), 2, "magic", *METHODS)


BAD: dict[str, tuple[bytes, str]] = {
    "empty.off": (b"", "line 1"),
    "empty.obj": (b"", "vertices"),
    "empty.ply": (b"", "line 1"),
    "word.off": (OFF.replace("OFF", "OOF").encode(), "line 1"),
    "short.off": (OFF.encode()[:-8], "1 of 2 faces"),
    "few.off": (b"OFF\n5 2 0\n0 0 0\n1 0 0\n", "2 of 5 vertices"),
    "negative-count.off": (OFF.replace("5 2 0", "-5 2 0").encode(), "line 2"),
    "huge-count.off": (OFF.replace("5 2 0", "2000000000 2 0").encode(), "vertices"),
    "huger-count.off": (OFF.replace("5 2 0", "9" * 30 + " 2 0").encode(), "line 2"),
    "corners.off": (OFF.replace("3 0 2 3", "2000000000 0 2 3").encode(), "line 9"),
    "edge.off": (OFF.replace("3 0 2 3", "2 0 2").encode(), "line 9"),
    "fraction.off": (OFF.replace("3 0 2 3", "3 0 2.5 3").encode(), "line 9"),
    "negative.off": (OFF.replace("3 0 1 2", "3 0 -1 2").encode(), "face 0"),
    "beyond.off": (OFF.replace("3 0 1 2", "3 0 5 2").encode(), "face 0"),
    "nan.off": (OFF.replace("1 1 0", "1 nan 0").encode(), "vertex 2"),
    "inf.off": (OFF.replace("1 1 0", "1 inf 0").encode(), "vertex 2"),
    "overflow.off": (OFF.replace("1 1 0", "1 1e999 0").encode(), "vertex 2"),
    "huge.off": (OFF.replace("1 1 0", "1 1e300 0").encode(), "vertex 2"),
    "word-in.off": (OFF.replace("1 1 0", "1 one 0").encode(), "line 5"),
    "binary.off": (bytes(range(256)) * 8, "line 1"),
    "zero.obj": (OBJ.replace("f 1 2 3", "f 0 2 3").encode(), "line 7"),
    "negative.obj": (OBJ.replace("f 1 2 3", "f -9 2 3").encode(), "line 7"),
    "beyond.obj": (OBJ.replace("f 1 2 3", "f 1 2 6").encode(), "face 0"),
    "nan.obj": (OBJ.replace("v 1 1 0", "v 1 nan 0").encode(), "vertex 2"),
    "short.obj": (OBJ.replace("v 1 1 0", "v 1 1").encode(), "line 4"),
    "edge.obj": (OBJ.replace("f 1 2 3", "f 1 2").encode(), "line 7"),
    "binary.obj": (bytes(range(256)) * 8, "vertices"),
    "endless.ply": (PLY.encode()[:60], "header"),
    "no-format.ply": (PLY.replace("format ascii 1.0\n", "").encode(), "format"),
    "format.ply": (PLY.replace("ascii", "utf8").encode(), "line 2"),
    "no-x.ply": (PLY.replace("float x", "float q").encode(), "'x'"),
    "type.ply": (PLY.replace("float x", "complex x").encode(), "line 5"),
    "no-list.ply": (PLY.replace("vertex_indices", "corners").encode(), "vertex_indices"),
    "few.ply": (PLY.replace("vertex 5", "vertex 50").encode(), "vert"),
    "huge-count.ply": (PLY.replace("vertex 5", "vertex 999999999").encode(), "vertex"),
    "short.ply": (PLY.encode()[:-8], "face"),
    "negative.ply": (PLY.replace("3 0 1 2", "3 0 -1 2").encode(), "face 0"),
    "nan.ply": (PLY.replace("1 1 0", "1 nan 0").encode(), "vertex 2"),
    "fraction.ply": (PLY.replace("3 0 2 3", "3 0 2.5 3").encode(), "face 1"),
    "edge.ply": (PLY.replace("3 0 2 3", "2 0 2").encode(), "face 1"),
    "cut-vertices.ply": (binary_ply()[:-40], "vertex"),
    "cut-faces.ply": (binary_ply()[:-3], "face"),
    "nan-binary.ply": (binary_ply().replace(struct.pack("<f", 9), struct.pack("<f", np.nan), 1), "vertex 4"),
    "negative-binary.ply": (binary_ply().replace(struct.pack("<i", 2), struct.pack("<i", -2), 1), "face"),
    "mesh.stl": (OFF.encode(), "stl"),
    "mesh": (OFF.encode(), "format"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_mesh_is_named_with_the_place_in_it(name: str, tmp_path: Path, out: Path) -> None:
    content, word = BAD[name]
    (tmp_path / name).write_bytes(content)
    assert_told(run(tmp_path / name, out), 2, tmp_path / name, word)
    assert not out.exists()


def test_a_mesh_that_is_not_there(tmp_path: Path, out: Path) -> None:
    assert_told(run(tmp_path / "none.off", out), 2, tmp_path / "none.off")


def test_a_folder_in_the_place_of_a_mesh(tmp_path: Path, out: Path) -> None:
    (tmp_path / "folder.off").mkdir()
    assert_told(run(tmp_path / "folder.off", out), 2, tmp_path / "folder.off")


@pytest.mark.parametrize("name", ["distances.txt", "distances", ".npy/x"])
def test_a_result_that_is_no_npy_file(square: Path, tmp_path: Path, name: str) -> None:
    assert_told(run(square, tmp_path / name), 2, "--out", name)


def test_a_result_in_a_folder_that_does_not_exist(square: Path, tmp_path: Path) -> None:
    assert_told(run(square, tmp_path / "nowhere" / "d.npy"), 2, "--out", tmp_path / "nowhere")


def test_a_folder_in_the_place_of_the_result_stays_and_nothing_is_left(square: Path, tmp_path: Path) -> None:
    (tmp_path / "d.npy").mkdir()
    assert_told(run(square, tmp_path / "d.npy"), 3, tmp_path / "d.npy")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["d.npy", "square.off"]


def test_a_bad_call_leaves_an_earlier_result_alone(square: Path, out: Path) -> None:
    out.write_bytes(b"earlier")
    assert run(square, out, "77").code == 2
    assert out.read_bytes() == b"earlier"


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_result_in_a_folder_without_permission(square: Path, tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir()
    closed.chmod(stat.S_IRUSR | stat.S_IXUSR)
    try:
        assert_told(run(square, closed / "d.npy"), 3, closed / "d.npy")
    finally:
        closed.chmod(stat.S_IRWXU)


@settings(max_examples=120, deadline=None)
@given(data=st.data())
def test_a_damaged_mesh_is_read_or_refused_but_never_a_failure_of_the_program(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    name = data.draw(st.sampled_from(sorted(GOOD)))
    content = bytearray(GOOD[name])
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        match data.draw(st.sampled_from(["flip", "cut", "drop", "insert"])):
            case "flip":
                content[at] = data.draw(st.integers(0, 255))
            case "cut":
                content = content[: at + 1]
            case "drop":
                del content[at]
                content = content or bytearray(b"x")
            case "insert":
                content[at:at] = data.draw(
                    st.sampled_from([b"-", b"9", b"nan", b"1e308", b"\n", b"\0", b" ", b"\xff"])
                )
    folder = tmp_path_factory.mktemp("damaged")
    (folder / name).write_bytes(bytes(content))
    outcome = run(folder / name, folder / "d.npy")
    if outcome.code == 0:
        distances = np.load(folder / "d.npy")
        assert distances[0, 0] == 0
        assert not np.isnan(distances).any()
        assert (distances >= 0).all()
        assert outcome.err == ""
    else:
        assert_told(outcome, 2, folder / name if "--sources" not in outcome.err else "--sources")
