"""Mesh files: every format gives the same mesh; every damaged file one clear error that names it."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.errors import InputError
from core.geodesics import read_mesh

VERTICES = np.array([[0, 0, 0], [1, 0, 0.5], [0, 1, 0], [1, 1, -2.25]])
TRIANGLES = np.array([[0, 1, 2], [1, 3, 2]])


def off(header="OFF\n4 2 0\n"):
    rows = [" ".join(map(str, v)) for v in VERTICES] + ["3 " + " ".join(map(str, t)) for t in TRIANGLES]
    return (header + "\n".join(rows) + "\n").encode()


def obj():
    rows = ["# body", "o skin"] + ["v " + " ".join(map(str, v)) for v in VERTICES] + ["vt 0 0", "vn 0 0 1"]
    return ("\n".join([*rows, "f 1/1/1 2/1/1 3/1/1", "f 2//1 4//1 -2//1"]) + "\n").encode()


def ply(kind="ascii", face="list uchar int vertex_indices", extra=True):
    colour = "property uchar red\n" if extra else ""
    head = (
        f"ply\nformat {kind} 1.0\ncomment skin\nelement vertex 4\nproperty float x\nproperty float y\n"
        f"property float z\n{colour}element face 2\nproperty {face}\nend_header\n"
    ).encode()
    if kind == "ascii":
        rows = [" ".join(map(str, v)) + (" 200" if extra else "") for v in VERTICES]
        rows += ["3 " + " ".join(map(str, t)) for t in TRIANGLES]
        return head + ("\n".join(rows) + "\n").encode()
    order = "<" if "little" in kind else ">"
    body = b"".join(struct.pack(order + "3f", *v) + (b"\xc8" if extra else b"") for v in VERTICES)
    return head + body + b"".join(struct.pack(order + "B3i", 3, *t) for t in TRIANGLES)


FILES = {
    "a.off": off(),
    "b.off": b"# a comment\nOFF 4 2 0\n" + off().split(b"\n", 2)[2],
    "c.off": off("COFF\n\n4 2 0 # counts\n"),
    "a.obj": obj(),
    "a.ply": ply(),
    "b.ply": ply("binary_little_endian"),
    "c.PLY": ply("binary_big_endian"),
}


def write(folder, name, data):
    path = folder / name
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("name", FILES)
def test_all_formats_give_the_same_mesh(tmp_path, name):
    vertices, triangles = read_mesh(write(tmp_path, name, FILES[name]))
    assert vertices == pytest.approx(VERTICES)
    assert (triangles == TRIANGLES).all()
    assert vertices.dtype == np.float64
    assert triangles.dtype == np.int32


def test_polygons_become_fans(tmp_path):
    data = b"OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
    assert read_mesh(write(tmp_path, "q.off", data))[1].tolist() == [[0, 1, 2], [0, 2, 3]]
    head, body = ply("binary_little_endian", extra=False).split(b"end_header\n")
    head = head.replace(b"face 2", b"face 3")
    quad = head + b"end_header\n" + body + struct.pack("<B4i", 4, 0, 1, 3, 2)
    assert read_mesh(write(tmp_path, "q.ply", quad))[1].tolist() == [
        *TRIANGLES.tolist(),
        [0, 1, 3],
        [0, 3, 2],
    ]


def test_a_ply_written_by_another_program_is_read(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    sphere = pyvista.Sphere(theta_resolution=12, phi_resolution=10)
    for binary in (True, False):
        path = tmp_path / f"sphere{binary}.ply"
        sphere.save(path, binary=binary)
        vertices, triangles = read_mesh(path)
        assert vertices == pytest.approx(np.asarray(sphere.points), abs=1e-6)
        assert (triangles == sphere.faces.reshape(-1, 4)[:, 1:]).all()


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.stl", b"solid", "unknown mesh format '.stl'"),
        ("a.off", b"", "line 1: an OFF file begins"),
        ("a.off", b"PNG", "line 1"),
        ("a.off", b"OFF\n", "counts"),
        ("a.off", b"OFF BINARY\n", "binary OFF"),
        ("a.off", b"OFF\nfour 2 0\n", "line 2: 'four'"),
        ("a.off", b"OFF\n-4 2 0\n", "negative"),
        ("a.off", off()[:-20], "line|ends after"),
        ("a.off", b"OFF\n2 0 0\n0 0 0\n1 x 0\n", "line 4: '1 x 0' are not numbers"),
        ("a.off", b"OFF\n1 0 0\n0 0 nan\n", "vertex 0"),
        ("a.off", b"OFF\n1 1 0\n0 0 0\n3 0 0 1\n", "face 0 names a vertex"),
        ("a.off", b"OFF\n1 1 0\n0 0 0\n2 0 0\n", "line 4: a face of 2 corners"),
        ("a.off", b"OFF\n0 0 0\n", "no vertices"),
        ("a.off", b"OFF\n99999999999 1 0\n", "too large"),
        ("a.obj", b"v 0 0\n", "line 1: a vertex needs three"),
        ("a.obj", b"v 0 0 0\nf 1 2\n", "line 2: a face needs three"),
        ("a.obj", b"v 0 0 0\nf 1 1 0\n", "line 2: face corner '0'"),
        ("a.obj", b"v 0 0 0\nf 1 1 -5\n", "line 2: face corner '-5'"),
        ("a.obj", b"v 0 0 0\nf 1 1 2\n", "face 0 names a vertex"),
        ("a.ply", b"pl", "line 1: a PLY file"),
        ("a.ply", b"ply\nformat ascii 1.0\n", "header does not end"),
        ("a.ply", ply()[:-8], "line|ends after"),
        ("a.ply", ply("binary_little_endian")[:-5], "ends after 1 of 2 rows of element 'face'"),
        ("a.ply", ply().replace(b"ascii", b"zip"), "line 2: unknown PLY format 'zip'"),
        ("a.ply", ply().replace(b"float z", b"float w"), "no property 'z'"),
        ("a.ply", ply().replace(b"float z", b"fraction z"), "'property fraction z' is not a PLY property"),
        ("a.ply", ply().replace(b"vertex_indices", b"corners"), "no list 'vertex_indices'"),
        ("a.ply", ply().replace(b"vertex 4", b"vertex 999999"), "too short for 999999 rows"),
        ("a.ply", ply().replace(b"vertex 4", b"vertex 99999999999999"), "too many"),
        ("a.ply", ply().replace(b"0.5", b"half"), "not numbers"),
    ],
)
def test_a_bad_file_is_refused_with_its_name_and_place(tmp_path, name, data, words):
    path = write(tmp_path, name, data)
    with pytest.raises(InputError, match=words) as error:
        read_mesh(path)
    assert str(path) in str(error.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_mesh(tmp_path / "none.off")
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(InputError, match="cannot be read"):
        read_mesh(tmp_path / "folder.ply")


@pytest.mark.parametrize("name", FILES)
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_no_damage_ends_in_anything_but_a_mesh_or_a_clear_error(tmp_path_factory, name, data):
    content = bytearray(FILES[name])
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(content)))
        kind = data.draw(st.sampled_from(["change", "cut", "insert", "repeat"]))
        if kind == "change" and place < len(content):
            content[place] = data.draw(st.integers(0, 255))
        elif kind == "cut":
            del content[place : place + data.draw(st.integers(1, 20))]
        elif kind == "insert":
            content[place:place] = data.draw(st.binary(min_size=1, max_size=8))
        else:
            content[place:place] = content[place : place + 12]
    path = write(tmp_path_factory.mktemp("fuzz"), name, bytes(content))
    mesh, message = None, ""
    try:
        mesh = read_mesh(path)
    except InputError as error:
        message = str(error)
    if mesh is None:
        assert str(path) in message
    else:
        assert np.isfinite(mesh[0]).all()
        assert ((mesh[1] >= 0) & (mesh[1] < len(mesh[0]))).all()
