"""Gmsh's files: what meshio and Gmsh write, and what only announces."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.tet_cases import boxes

pytestmark = pytest.mark.usefixtures("forked_parsers")

BOX = boxes((3, 2, 2), 0.3)
VALUES = np.linspace(-1.0, 2.0, len(BOX.vertices))


@pytest.mark.parametrize("version", ["gmsh", "gmsh22"])
@pytest.mark.parametrize("binary", [True, False])
def test_what_meshio_writes_is_read(tmp_path, capsys, version, binary):
    has_values = binary  # in text, meshio writes none that is a number
    data = {"signed_distance": VALUES, "vectors": BOX.vertices} if has_values else {}
    meshio.Mesh(BOX.vertices, [("tetra", BOX.tets)], point_data=data).write(
        tmp_path / "box.msh", file_format=version, binary=binary
    )
    found = sh.read(tmp_path / "box.msh")
    np.testing.assert_array_equal(found.tets, BOX.tets)
    np.testing.assert_array_equal(found.vertices, BOX.vertices)
    if has_values:
        np.testing.assert_array_equal(sh.read_field(tmp_path / "box.msh").values, VALUES)


def text(nodes: str, elements: str, version: str = "2.2") -> bytes:
    parts = f"$MeshFormat\n{version} 0 8\n$EndMeshFormat\n$Comments\nx\n$EndComments\n"
    return f"{parts}$Nodes\n{nodes}\n$EndNodes\n$Elements\n{elements}\n$EndElements\n".encode()


POINTS = "0 0 0,1 0 0,0 1 0,0 0 1,1 1 1".split(",")
ROWS = [f"{tag} {point}" for tag, point in zip((7, 3, 40, 60, 5), POINTS, strict=True)]
TWO = text(
    "5\n" + "\n".join(ROWS),
    "6\n1 15 2 0 1 7\n2 4 2 0 1 7 3 40 60\n3 2 2 0 1 7 3 40\n9 4 2 0 1 3 40 60 5\n4 15 2 0 1 3\n5 1 2 0 1 7 3",
)
FOUR = text(
    "2 5 3 60\n0 1 0 1\n7\n0 0 0\n3 1 0 4\n3\n40\n60\n5\n1 0 0\n0 1 0\n0 0 1\n1 1 1",
    "2 3 1 9\n3 1 4 2\n1 7 3 40 60\n2 3 40 60 5\n2 1 2 1\n9 7 3 40",
    "4.1",
)


@pytest.mark.parametrize("data", [TWO, FOUR], ids=["2.2", "4.1"])
def test_tags_may_be_any_numbers_and_elements_of_any_kind(tmp_path, data):
    (tmp_path / "odd.msh").write_bytes(data)
    mesh = sh.read(tmp_path / "odd.msh")
    assert mesh.tets.tolist() == [[0, 1, 2, 3], [1, 2, 3, 4]] and mesh.n_vertices == 5


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("$Nodes\n5", "$Nodes\n5000000000"),
        ("$Nodes\n5", "$Nodes\n-5"),
        ("$Elements\n6", "$Elements\n1e300"),
        ("2 4 2 0 1", "2 4 -2 0 1"),
        ("2 4 2 0 1", "2 99 2 0 1"),
        ("9 4 2 0 1 3 40 60 5", "9 4 2 0 1 3 41 60 5"),
        ("3 1 0 0", "nan 1 0 0"),
        ("3 1 0 0", "x 1 0 0"),
        ("$EndNodes", ""),
        ("$Nodes\n5\n7 0", "$Nodes\n5\n9000000000000 0"),
        ("$Nodes\n5", "$PhysicalNames\n1000000000000\n$Nodes\n5"),
        ("$Elements\n6", "$NodeData\n1000000000000\n$Elements\n6"),
        ("2.2 0 8", "4 0 8"),
        ("2.2 0 8", "2.2 1 8"),
    ],
)
def test_what_is_only_announced_is_refused(tmp_path, old, new):
    data = TWO.decode()
    assert old in data
    (tmp_path / "odd.msh").write_text(data.replace(old, new, 1))
    with refused(sh.errors.SignedHeatError) as caught:
        sh.read(tmp_path / "odd.msh")
    assert caught.value.path == str(tmp_path / "odd.msh")


def test_blocks_of_version_four_that_are_only_announced(tmp_path):
    for old, new in (("0 1 0 1\n7", "0 1 0 9999999999\n7"), ("3 1 4 2", "3 1 4 -1"), ("2 5 3", "999999999999 5 3")):
        (tmp_path / "odd.msh").write_bytes(FOUR.replace(old.encode(), new.encode(), 1))
        with refused(sh.errors.SignedHeatError):
            sh.read(tmp_path / "odd.msh")


def test_numbers_of_nodes_for_whose_table_there_is_no_memory(tmp_path, monkeypatch):
    """In text and in blocks of bytes; coordinates may be as large as they like."""
    monkeypatch.setattr("signedheat.io.budgets.available_memory", lambda: 10**9)
    (tmp_path / "odd.msh").write_bytes(FOUR.replace(b"\n40\n", b"\n855000000\n", 1))
    with refused(sh.errors.MemoryLimitError):
        sh.read(tmp_path / "odd.msh")
    (tmp_path / "odd.msh").write_bytes(FOUR.replace(b"\n1 1 1\n", b"\n9000000000000 1 1\n", 1))
    assert sh.read(tmp_path / "odd.msh").vertices[4].tolist() == [9e12, 1.0, 1.0]
    meshio.Mesh(BOX.vertices, [("tetra", BOX.tets)]).write(tmp_path / "box.msh", file_format="gmsh")
    data = (tmp_path / "box.msh").read_bytes()
    number = np.arange(1, 4, dtype=np.uint64).tobytes()
    assert data.count(number) == 1
    (tmp_path / "box.msh").write_bytes(data.replace(number, number[:-5] + b"\x09" + number[-4:]))
    with refused(sh.errors.MemoryLimitError):
        sh.read(tmp_path / "box.msh")


@pytest.mark.parametrize("others", [["triangle"], ["triangle", "tetra"]])
def test_no_part_of_a_volume_is_left_out(tmp_path, others):
    corners = {"pyramid": [0, 1, 2, 3, 4], "triangle": [0, 1, 2], "tetra": [0, 1, 2, 5]}
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1], [0.5, 0.5, -1]])
    cells = [(kind, np.array([corners[kind]])) for kind in ["pyramid", *others]]
    meshio.Mesh(points, cells).write(tmp_path / "mixed.vtu")
    with refused(sh.errors.GeometryError, file="mixed.vtu"):
        sh.read(tmp_path / "mixed.vtu")


@pytest.mark.parametrize("version", ["4.1", "4.0", "2.2"])
@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("node", [-1, -2, len(BOX.vertices), len(BOX.vertices) + 1])
def test_nodes_that_do_not_exist_are_not_the_last_ones(tmp_path, capsys, version, binary, node):
    tets = np.concatenate([BOX.tets, [[0, 1, 2, node]]])
    mesh = meshio.Mesh(BOX.vertices, [("tetra", tets)])
    meshio.gmsh.write(str(tmp_path / "box.msh"), mesh, fmt_version=version, binary=binary)
    with refused(sh.errors.SignedHeatError, file="box.msh"):
        sh.read(tmp_path / "box.msh")
