"""Gmsh's files, read by ourselves: what meshio and Gmsh write, and what only announces."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.tet_cases import boxes
from signedheat.io.gmsh import read_gmsh

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
    found = read_gmsh(tmp_path / "box.msh", ("signed_distance",))
    [tets] = found.cells
    assert tets.type == "tetra"
    np.testing.assert_array_equal(tets.data, BOX.tets)
    np.testing.assert_array_equal(found.points, BOX.vertices)
    if has_values:
        np.testing.assert_array_equal(sh.load_field(tmp_path / "box.msh").values, VALUES)


def text(nodes: str, elements: str, version: str = "2.2") -> bytes:
    parts = f"$MeshFormat\n{version} 0 8\n$EndMeshFormat\n$Comments\nx\n$EndComments\n"
    return f"{parts}$Nodes\n{nodes}\n$EndNodes\n$Elements\n{elements}\n$EndElements\n".encode()


POINTS = "0 0 0,1 0 0,0 1 0,0 0 1,1 1 1".split(",")
ROWS = [f"{tag} {point}" for tag, point in zip((7, 3, 40, 10**12, 5), POINTS, strict=True)]
TWO = text(
    "5\n" + "\n".join(ROWS),
    f"6\n1 15 2 0 1 7\n2 4 2 0 1 7 3 40 {10**12}\n3 2 0 7 3 40\n9 4 3 0 0 1 3 40 {10**12} 5\n4 15 0 3\n5 1 0 7 3",
)
FOUR = text(
    f"2 5 3 {10**12}\n0 1 0 1\n7\n0 0 0\n3 1 1 4\n3\n40\n{10**12}\n5\n"
    "1 0 0 .5 .5 .5\n0 1 0 0 0 0\n0 0 1 0 0 0\n1 1 1 0 0 0",
    f"2 3 1 9\n3 1 4 2\n1 7 3 40 {10**12}\n2 3 40 {10**12} 5\n2 1 2 1\n9 7 3 40",
    "4.1",
)


@pytest.mark.parametrize("data", [TWO, FOUR], ids=["2.2", "4.1"])
def test_tags_may_be_any_numbers_and_elements_of_any_kind(tmp_path, data):
    (tmp_path / "odd.msh").write_bytes(data)
    found = {block.type: block.data.tolist() for block in read_gmsh(tmp_path / "odd.msh").cells}
    assert found["tetra"] == [[0, 1, 2, 3], [1, 2, 3, 4]] and found["triangle"] == [[0, 1, 2]]
    mesh = sh.read(tmp_path / "odd.msh")
    assert mesh.n_tets == 2 and mesh.n_vertices == 5


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("$Nodes\n5", "$Nodes\n5000000000"),
        ("$Nodes\n5", "$Nodes\n-5"),
        ("$Elements\n6", "$Elements\n1e300"),
        ("2 4 2 0 1", "2 4 900000000 0 1"),
        ("2 4 2 0 1", "2 4 -2 0 1"),
        ("2 4 2 0 1", "2 99 2 0 1"),
        ("3 2 0 7 3 40", "3 2 0 7 3 41"),
        ("3 1 0 0", "3.5 1 0 0"),
        ("3 1 0 0", "nan 1 0 0"),
        ("3 1 0 0", "x 1 0 0"),
        ("$EndNodes", ""),
        ("2.2 0 8", "4 0 8"),
        ("2.2 0 8", "2.2 1 8"),
    ],
)
def test_what_is_only_announced_is_refused(tmp_path, old, new):
    data = TWO.decode()
    assert old in data
    (tmp_path / "odd.msh").write_text(data.replace(old, new, 1))
    with refused(sh.FileFormatError) as caught:
        sh.read(tmp_path / "odd.msh")
    assert caught.value.path == str(tmp_path / "odd.msh")


def test_blocks_of_version_four_that_are_only_announced(tmp_path):
    for old, new in (("0 1 0 1\n7", "0 1 0 9999999999\n7"), ("3 1 4 2", "3 1 4 -1"), ("2 5 3", "999999999999 5 3")):
        (tmp_path / "odd.msh").write_bytes(FOUR.replace(old.encode(), new.encode(), 1))
        with refused(sh.FileFormatError):
            sh.read(tmp_path / "odd.msh")


def test_many_runs_of_elements_keep_their_order(tmp_path):
    """Types that alternate, in a file whose tags are in no order."""
    n = 200
    random = np.random.default_rng(0)
    tags = random.permutation(np.arange(1, n + 1) * 3)
    corners = random.integers(n, size=(300, 4))
    kinds = random.integers(2, size=300)
    rows = [
        f"{k} {4 if kind else 2} 1 0 " + " ".join(map(str, tags[row[: 4 if kind else 3]]))
        for k, (kind, row) in enumerate(zip(kinds, corners, strict=True))
    ]
    points = [f"{tag} {k} 0 0" for k, tag in enumerate(tags)]
    (tmp_path / "many.msh").write_bytes(text(f"{n}\n" + "\n".join(points), "300\n" + "\n".join(rows)))
    found = {block.type: block.data for block in read_gmsh(tmp_path / "many.msh").cells}
    np.testing.assert_array_equal(found["tetra"], corners[kinds == 1])
    np.testing.assert_array_equal(found["triangle"], corners[kinds == 0, :3])
