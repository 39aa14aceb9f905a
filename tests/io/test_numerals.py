"""Integers and numbers of files: what no format has is refused, in each of them."""

from __future__ import annotations

import base64
import json
import zipfile

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.errors import FileFormatError, SignedHeatError
from signedheat.io.numerals import integer, integers, parsed_numbers


@pytest.mark.parametrize(
    "word", ["1_0", "١", "1.0", "1e3", "0x1", "", "--1", "+-1", "9" * 30, "9" * 5000, "nan", "1 2"]
)
def test_words_that_are_no_integers(word):
    with refused(FileFormatError):
        integer(word, "count")
    with refused(FileFormatError):
        integers(["1", word], "counts")


@pytest.mark.parametrize("value", [True, 1.5, float("nan"), float("inf"), None, "a", [1], {}, 10**30, -1, -1.0])
def test_values_of_json_that_are_no_integers(value):
    with refused(FileFormatError):
        integer(value, "count")
    with refused(FileFormatError):
        integers([3, value], "counts", 0)


@pytest.mark.parametrize("value", [7, 7.0, "7", b"7", "+7", "007"])
def test_integers_of_all_kinds(value):
    assert integer(value, "count") == 7
    assert integers([value, value], "counts").tolist() == [7, 7]


@pytest.mark.parametrize(
    "values", [[0.5], [np.nan], [np.inf], [1e30], np.array([2**63], dtype=np.uint64), ["a"], [None], [1j]]
)
def test_arrays_that_are_no_integers(values):
    with refused(FileFormatError):
        integers(np.array(values), "ids")


@pytest.mark.parametrize("word", ["1_0", "１", "1,5", "", "0x1p3", "1 2"])
def test_words_that_are_no_numbers(word):
    with refused(FileFormatError):
        parsed_numbers(["1", word], "points")
    with refused(FileFormatError):
        parsed_numbers([["1"], [word]], "points")


# -- in each format --

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]


def gltf(path, index, old):
    points, ids = np.array(CORNERS, dtype="<f4").tobytes(), np.array([0, 1, 2], dtype="<u2").tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": f"data:,{base64.b64encode(points + ids).decode()}", "byteLength": 54}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48, "byteOffset": 0, "byteStride": 12},
            {"buffer": 0, "byteOffset": 48, "byteLength": 6},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "byteOffset": 0},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
        "nodes": [{"mesh": 0}, {"children": [0]}],
        "scenes": [{"nodes": [1]}],
        "scene": 0,
    }
    text = json.dumps(tree)
    assert old in text
    path.write_text(text.replace(old, f"{old.rpartition(' ')[0]} {index}{']' * old.count(']')}", 1))


GLTF = [
    '"buffer": 0', '"byteLength": 48', '"byteOffset": 0', '"byteStride": 12', '"bufferView": 0', '"bufferView": 1',
    '"count": 4', '"count": 3', '"POSITION": 0', '"indices": 1', '"mode": 4', '"mesh": 0', '"scene": 0',
]  # fmt: skip


@pytest.mark.parametrize("old", GLTF)
@pytest.mark.parametrize("index", ["-1", "1.7", "240.9", "true", '"1_0"', "1e99", "null", "[0]"])
def test_gltf(tmp_path, old, index):
    gltf(tmp_path / "a.gltf", index, old)
    with refused(SignedHeatError, file="a.gltf"):
        sh.read(tmp_path / "a.gltf")


@pytest.mark.parametrize("old", GLTF)
def test_gltf_integers_may_be_written_with_a_point(tmp_path, old):
    gltf(tmp_path / "a.gltf", old.rpartition(" ")[2] + ".0", old)
    assert sh.read(tmp_path / "a.gltf").n_faces == 1


VTP = """<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="4" NumberOfPolys="1">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>
<Polys><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">3</DataArray></Polys></Piece></PolyData></VTKFile>"""
OFF, OBJ = "OFF\n4 1 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
    "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n"
)
PCD = (
    "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n1 2 3\n"
    "4 5 6\n"
)
NRRD = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 1 1 2\nline skip: 0\nbyte skip: 0\nencoding: text\n\n1 0\n"
TEXTS = {
    "a.vtp": (VTP, ['Points="4', 'Polys="1', "0 1 2<", ">3<", "0 0 0 1<"]),
    "a.off": (OFF, ["4 1 0", "\n3 0", "0 1 2\n", "1 0 0"]),
    "a.obj": (OBJ, ["1 2 3\n", "v 1 0 0", "0 0 1\n"]),
    "a.ply": (PLY, ["vertex 4", "face 1", "\n3 0", "0 1 2\n", "1 0 0"]),
    "a.pcd": (PCD, ["COUNT 1", "POINTS 2", "SIZE 4", "1 2 3\n"]),
    "a.nrrd": (NRRD, ["dimension: 3", "sizes: 1", "skip: 0", "1 0\n"]),
    "a.xyz": ("0 0 0\n1 0 0\n0 1 0\n", ["1 0 0", "0 1 0\n"]),
}


@pytest.mark.parametrize(("name", "old"), [(name, old) for name in TEXTS for old in TEXTS[name][1]])
@pytest.mark.parametrize("odd", ["1_0", "٣", "0x3"])
def test_texts(tmp_path, name, old, odd):
    text = TEXTS[name][0]
    digit = max(k for k, character in enumerate(old) if character.isdigit())
    (tmp_path / name).write_text(text.replace(old, old[:digit] + odd + old[digit + 1 :], 1), encoding="utf-8")
    with refused(SignedHeatError, file=name):
        sh.read(tmp_path / name)
    (tmp_path / name).write_text(text)
    sh.read(tmp_path / name)


@pytest.mark.parametrize("new", ["-3", "3.5", "1_0"])
@pytest.mark.parametrize("old", [">3<", 'offset="0"'])
def test_negative_and_fractional_offsets_of_vtk(tmp_path, old, new):
    data = np.array(96, dtype="<u8").tobytes() + np.array(CORNERS, dtype="<f8").tobytes()
    inline = 'format="ascii">0 0 0 1 0 0 0 1 0 0 0 1<'
    text = VTP.replace(inline, 'format="appended" offset="0"><').replace("<VTKFile", '<VTKFile header_type="UInt64"')
    text = text.replace("</VTKFile>", '<AppendedData encoding="raw">_')

    def write(text):
        (tmp_path / "a.vtp").write_bytes(text.encode() + data + b"</AppendedData></VTKFile>")

    write(text)
    assert sh.read(tmp_path / "a.vtp").n_faces == 1
    write(text.replace(old, old.replace("3", new).replace("0", new)))
    with refused(FileFormatError, file="a.vtp"):
        sh.read(tmp_path / "a.vtp")


def test_ids_of_vtk_that_are_real_numbers(tmp_path):
    for ids, is_read in (("0 1 2", True), ("0 1 1.7", False), ("0 1 -1", False)):
        text = VTP.replace('Int64" Name="connectivity', 'Float64" Name="connectivity').replace("0 1 2<", f"{ids}<")
        (tmp_path / "a.vtp").write_text(text)
        if is_read:
            assert sh.read(tmp_path / "a.vtp").faces.tolist() == [[0, 1, 2]]
        else:
            with refused(FileFormatError, file="a.vtp"):
                sh.read(tmp_path / "a.vtp")


@pytest.mark.parametrize(
    ("old", "new"), [('v1="0"', 'v1="0_0"'), ('v1="0"', 'v1="-1"'), ('v1="0"', ""), ('x="1"', 'x="1_0"')]
)
def test_3mf(tmp_path, old, new):
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in CORNERS)
    mesh = f'<mesh><vertices>{vertices}</vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>'
    model = f'<model><resources><object id="0">{mesh}</object></resources><build><item objectid="0"/></build></model>'
    for text in (model, model.replace(old, new, 1)):
        with zipfile.ZipFile(tmp_path / "a.3mf", "w") as file:
            file.writestr("3D/3dmodel.model", text)
        if text == model:
            assert sh.read(tmp_path / "a.3mf").n_faces == 1
    with refused(FileFormatError, file="a.3mf"):
        sh.read(tmp_path / "a.3mf")


@pytest.mark.parametrize(
    ("old", "new"), [("[0]", "[0.5]"), ("[0]", "[true]"), ("[0, 1]", '[0, "1_0"]'), ("[0]", "[-1]")]
)
def test_curves(tmp_path, old, new):
    nodes = [{"v": [v], "w": [1.0]} for v in (0, 1)]
    text = json.dumps({"groups": [{"kind": "signed_curve", "nodes": nodes, "segments": [[0, 1]]}]})
    mesh = samples.sphere(1)
    for written in (text, text.replace(old, new, 1)):
        (tmp_path / "a.json").write_text(written)
        if written == text:
            sh.io.read_curves(tmp_path / "a.json", mesh)
    with refused(SignedHeatError, file="a.json"):
        sh.io.read_curves(tmp_path / "a.json", mesh)
