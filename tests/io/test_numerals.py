"""Integers and numbers of files: what no format has is refused, in each of them."""

from __future__ import annotations

import base64
import json
import re
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.errors import FileFormatError, SignedHeatError
from signedheat.io.numerals import integer, integers, parsed_numbers
from signedheat.io.urdf import meshes_of


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
    data = text.replace(old, f"{old.rpartition(' ')[0]} {index}{']' * old.count(']')}", 1).encode()
    if path.suffix == ".glb":
        data += b" " * (-len(data) % 4)
        data = b"glTF" + struct.pack("<IIII", 2, 20 + len(data), len(data), 0x4E4F534A) + data
    path.write_bytes(data)


GLTF = [
    '"buffer": 0', '"byteLength": 48', '"byteOffset": 0', '"byteStride": 12', '"bufferView": 0', '"bufferView": 1',
    '"count": 4', '"count": 3', '"POSITION": 0', '"indices": 1', '"mode": 4', '"mesh": 0', '"scene": 0',
]  # fmt: skip


@pytest.mark.parametrize("old", GLTF)
@pytest.mark.parametrize("index", ["-1", "1.7", "240.9", "true", '"1_0"', "1e99", "null", "[0]"])
@pytest.mark.parametrize("name", ["a.gltf", "a.glb"])
def test_gltf(tmp_path, old, index, name):
    gltf(tmp_path / name, index, old)
    with refused(SignedHeatError, file=name):
        sh.read(tmp_path / name)


@pytest.mark.parametrize("old", GLTF)
@pytest.mark.parametrize("name", ["a.gltf", "a.glb"])
def test_gltf_integers_may_be_written_with_a_point(tmp_path, old, name):
    gltf(tmp_path / name, old.rpartition(" ")[2] + ".0", old)
    assert sh.read(tmp_path / name).n_faces == 1


# In these files, ⟦…⟧ surrounds counts and ids, which are integers and not negative, and ⟨…⟩ finite real numbers.
VTP = """<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="⟦4⟧" NumberOfPolys="⟦1⟧" NumberOfLines="⟦0⟧"
NumberOfVerts="⟦0⟧" NumberOfStrips="⟦0⟧"><Points><DataArray type="Float64" NumberOfComponents="⟦3⟧" format="ascii">
⟨0⟩ 0 0 1 0 0 0 1 0 0 0 ⟨1⟩</DataArray></Points><Polys><DataArray type="Int64" Name="connectivity" format="ascii">
⟦0⟧ 1 ⟦2⟧</DataArray><DataArray type="Int64" Name="offsets" format="ascii">⟦3⟧</DataArray></Polys></Piece></PolyData>
</VTKFile>"""
VTU = """<VTKFile type="UnstructuredGrid"><UnstructuredGrid><Piece NumberOfPoints="⟦4⟧" NumberOfCells="⟦1⟧"><Points>
<DataArray type="Float64" NumberOfComponents="⟦3⟧" format="ascii">⟨0⟩ 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points><Cells>
<DataArray type="Int64" Name="connectivity" format="ascii">⟦0⟧ 1 2 ⟦3⟧</DataArray><DataArray type="Int64" Name="offsets"
format="ascii">⟦4⟧</DataArray><DataArray type="UInt8" Name="types" format="ascii">⟦10⟧</DataArray></Cells></Piece>
</UnstructuredGrid></VTKFile>"""
VTI = """<VTKFile type="ImageData"><ImageData WholeExtent="⟦0⟧ 1 0 1 0 ⟦2⟧" Origin="⟨0⟩ 0 0" Spacing="⟨1⟩ 1 1"><Piece
Extent="⟦0⟧ 1 0 1 0 ⟦2⟧"><PointData Scalars="a"><DataArray type="UInt8" Name="a" NumberOfComponents="⟦1⟧"
format="ascii">⟦1⟧ 0 0 0 0 0 0 0 0 0 0 ⟦1⟧</DataArray></PointData></Piece></ImageData></VTKFile>"""
OFF = "OFF\n⟦4⟧ ⟦1⟧ ⟦0⟧\n⟨0⟩ 0 0\n1 0 0\n0 1 0\n0 0 ⟨1⟩\n⟦3⟧ ⟦0⟧ 1 ⟦2⟧\n"
OBJ = "v ⟨0⟩ 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 ⟨1⟩\nvt 0 0\nvn 0 0 1\nf ⟦1⟧/1/1 2/1/1 ⟦3⟧//1\n"
LINES = "v 0 0 1\nv 0 1 0\nv 1 0 0\nl ⟦1⟧/1 2 ⟦3⟧\np ⟦2⟧\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex ⟦4⟧\nproperty float x\nproperty float y\nproperty float z\n"
    "element face ⟦1⟧\nproperty list uchar int vertex_indices\nend_header\n⟨0⟩ 0 0\n1 0 0\n0 1 0\n0 0 ⟨1⟩\n"
    "⟦3⟧ ⟦0⟧ 1 ⟦2⟧\n"
)
PCD = (
    "VERSION .7\nFIELDS x y z\nSIZE ⟦4⟧ 4 ⟦4⟧\nTYPE F F F\nCOUNT ⟦1⟧ 1 1\nWIDTH ⟦2⟧\nHEIGHT ⟦1⟧\nPOINTS ⟦2⟧\n"
    "DATA ascii\n1 2 3\n4 5 6\n"
)
NRRD = (
    "NRRD0004\ntype: uchar\ndimension: ⟦3⟧\nsizes: ⟦1⟧ 1 ⟦2⟧\nline skip: ⟦0⟧\nbyte skip: ⟦0⟧\nspace origin: (0,⟨0⟩,0)\n"
    "encoding: text\n\n⟦1⟧ ⟦0⟧\n"
)
STL = (
    "solid a\nfacet normal 0 0 1\nouter loop\nvertex ⟨0⟩ 0 0\nvertex 1 0 0\nvertex 0 1 ⟨0⟩\nendloop\nendfacet\n"
    "endsolid\n"
)
SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="⟨10⟩" height="10"><g transform="translate(⟨1⟩ 2)">
<path d="M ⟨0⟩ 0 L 3 1 L 1 ⟨2⟩ Z"/><circle cx="⟨1⟩" cy="2" r="⟨3⟩"/></g></svg>"""
DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><unit meter="1"/></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="⟦12⟧">⟨0⟩ 0 0 1 0 0 0 1 0 0 0 ⟨1⟩
</float_array><technique_common><accessor source="#a" count="⟦4⟧" stride="⟦3⟧"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source><vertices id="v">
<input semantic="POSITION" source="#p"/></vertices><triangles count="⟦1⟧"><input semantic="VERTEX" source="#v"
offset="⟦0⟧"/><p>⟦0⟧ 1 ⟦2⟧</p></triangles></mesh></geometry></library_geometries><library_visual_scenes>
<visual_scene id="s"><node><translate>⟨1⟩ 2 3</translate><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
MODEL = (
    "<model><resources><object id='1'><mesh><vertices>"
    + "".join(f'<vertex x="⟨{x}⟩" y="{y}" z="{z}"/>' for x, y, z in CORNERS)
    + "</vertices><triangles><triangle v1='⟦0⟧' v2='1' v3='⟦2⟧'/></triangles></mesh></object></resources><build>"
    "<item objectid='⟦1⟧' transform='⟨1⟩ 0 0 0 1 0 0 0 1 0 0 ⟨0⟩'/></build></model>"
)
GMSH_2 = (
    "$MeshFormat\n⟦2.2⟧ 0 ⟦8⟧\n$EndMeshFormat\n$Nodes\n⟦4⟧\n⟦1⟧ 0 0 0\n2 1 0 0\n3 0 1 0\n⟦4⟧ 0 ⟨0⟩ 1\n"
    "$EndNodes\n$Elements\n⟦1⟧\n1 4 2 0 1 ⟦1⟧ 2 3 ⟦4⟧\n$EndElements\n"
)
GMSH_4 = (
    "$MeshFormat\n⟦4.1⟧ 0 ⟦8⟧\n$EndMeshFormat\n$Nodes\n⟦1⟧ ⟦4⟧ 1 4\n3 1 ⟦0⟧ ⟦4⟧\n⟦1⟧\n2\n3\n4\n⟨0⟩ 0 0\n1 0 0\n"
    "0 1 0\n0 0 1\n$EndNodes\n$Elements\n⟦1⟧ ⟦1⟧ 1 1\n3 1 ⟦4⟧ 1\n1 1 2 3 4\n$EndElements\n"
)
MEDIT = (
    "MeshVersionFormatted 2\nDimension\n⟦3⟧\nVertices\n⟦4⟧\n⟨0⟩ 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\nTetrahedra\n⟦1⟧\n"
    "⟦1⟧ 2 3 ⟦4⟧ 0\nEnd\n"
)
VTK = (
    "# vtk DataFile Version 3.0\na\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS ⟦4⟧ double\n⟨0⟩ 0 0\n1 0 0\n0 1 0\n"
    "0 0 1\nCELLS ⟦1⟧ ⟦5⟧\n⟦4⟧ ⟦0⟧ 1 2 ⟦3⟧\nCELL_TYPES ⟦1⟧\n⟦10⟧\n"
)
NODE, ELE = "⟦4⟧ ⟦3⟧ ⟦0⟧ 0\n⟦0⟧ ⟨0⟩ 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n", "⟦1⟧ ⟦4⟧ ⟦0⟧\n0 ⟦0⟧ 1 2 ⟦3⟧\n"
CURVES = (
    '{"index_base": ⟦0⟧, "groups": [{"kind": "signed_curve", "nodes": [{"v": [⟦0⟧], "w": [⟨1.0⟩]}, {"v": [1], '
    '"w": [1.0]}], "segments": [[0, ⟦1⟧]]}]}'
)
ROBOT = '<robot name="r"><link name="l"><mesh filename="a.stl" scale="⟨1⟩ 2 ⟨3⟩"/></link></robot>'
DXF = "0\nSECTION\n2\nENTITIES\n0\nLINE\n8\n0\n⟦62⟧\n1\n⟦10⟧\n⟨0.0⟩\n20\n0.0\n11\n3.0\n21\n⟨4.0⟩\n0\nENDSEC\n0\nEOF\n"
BALL = samples.sphere(1)
FILES = {
    "a.vtp": VTP, "a.vtu": VTU, "a.vti": VTI, "a.off": OFF, "a.obj": OBJ, "a.ply": PLY, "a.pcd": PCD, "a.nrrd": NRRD,
    "a.stl": STL, "a.svg": SVG, "a.dae": DAE, "a.3mf": MODEL, "2.msh": GMSH_2, "4.msh": GMSH_4, "a.mesh": MEDIT,
    "a.vtk": VTK, "a.node": NODE, "a.ele": ELE, "curves.json": CURVES, "curves.obj": LINES, "a.urdf": ROBOT,
    "a.xyz": "⟨0⟩ 0 0\n1 ⟨0⟩ 0\n0 1 ⟨0⟩\n", "a.csv": "⟨0⟩,0\n3,0\n0,⟨3⟩\n", "a.dxf": DXF,
    "a.geojson": '{"type": "Polygon", "coordinates": [[[⟨0⟩, 0], [3, ⟨0⟩], [0, 3], [0, 0]]]}',
}  # fmt: skip
NO_NUMBERS = ["1_0", "１", "0x1", "١", "1e400", "nan", "-inf", "x", "true"]
NO_COUNTS = [*NO_NUMBERS, "-7", "1.5", "9" * 30]
PACKAGES = {"a.dae": "collada", "a.dxf": "ezdxf", **dict.fromkeys(["2.msh", "4.msh", "a.mesh", "a.vtk"], "meshio")}


def read_marked(folder, name, text):
    """Read what a file of this name holds whose text this is."""
    if name.endswith(".3mf"):
        with zipfile.ZipFile(folder / name, "w") as file:
            file.writestr("3D/3dmodel.model", text)
    else:
        (folder / name).write_text(text, encoding="utf-8")
    if name.startswith("curves."):
        return sh.io.read_curves(folder / name, BALL)
    if name == "a.urdf":
        return meshes_of(folder / name)
    return (sh.io.read_polylines if name.endswith((".svg", ".csv", ".dxf", ".geojson")) else sh.read)(folder / name)


@pytest.mark.usefixtures("forked_parsers")
@pytest.mark.parametrize("name", FILES)
def test_every_number_of_every_format(tmp_path, name):
    """What is no number, and what is no count where one is due, is refused by an error with the file and a remedy."""
    pytest.importorskip(PACKAGES.get(name, "numpy"))
    for other, text in (("a.node", NODE), ("a.ele", ELE)):
        (tmp_path / other).write_text(re.sub("[⟦⟧⟨⟩]", "", text))
    marked, read = FILES[name], []
    assert read_marked(tmp_path, name, re.sub("[⟦⟧⟨⟩]", "", marked))
    for match in re.finditer("⟦[^⟧]*⟧|⟨[^⟩]*⟩", marked):
        for word in NO_COUNTS if match[0][0] == "⟦" else NO_NUMBERS:
            text = re.sub("[⟦⟧⟨⟩]", "", f"{marked[: match.start()]}{word}{marked[match.end() :]}")
            try:
                read_marked(tmp_path, name, text)
            except SignedHeatError as error:
                if error.path is None or Path(error.path).name != name or not (error.remedy or error.element):
                    read.append((match.start(), word, error))
            else:
                read.append((match.start(), word, marked[match.start() - 20 : match.end() + 20]))
    assert not read


@pytest.mark.parametrize("name", ["a.vtp", "a.vtu", "a.vti", "a.3mf", "a.dae", "curves.json", "a.urdf"])
def test_numbers_that_are_missing(tmp_path, name):
    for match in re.finditer('(?<=[">])(⟦[^⟧]*⟧|⟨[^⟩]*⟩)(?=["<])', FILES[name]):
        if not FILES[name][: match.start()].endswith('NumberOfComponents="'):  # VTK leaves it empty
            with refused(SignedHeatError, file=name):
                text = f"{FILES[name][: match.start()]}{FILES[name][match.end() :]}"
                read_marked(tmp_path, name, re.sub("[⟦⟧⟨⟩]", "", text))


@pytest.mark.parametrize(
    "corner", ["1////", "1//2/3", "1/2/3/4", "1/x", "1/1.5", "1//1_0", "/1", "//1", "1/１", "1/-", "x/1"]
)
@pytest.mark.parametrize("keyword", ["f", "l"])
def test_corners_of_obj_that_are_none(tmp_path, corner, keyword):
    (tmp_path / "a.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\n{keyword} {corner} 2 3\n", encoding="utf-8")
    with refused(FileFormatError, file="a.obj"):
        sh.read(tmp_path / "a.obj") if keyword == "f" else sh.io.read_curves(tmp_path / "a.obj", BALL)


@pytest.mark.parametrize("corner", ["1", "1/", "1//", "1/2", "1//2", "1/2/3", "-3/-1/-1", "+1/2/"])
def test_corners_of_obj(tmp_path, corner):
    (tmp_path / "a.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf {corner} 2 3/1\n")
    assert sh.read(tmp_path / "a.obj").faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("header", ["x y z", "X,Y,Z", "x1 y1 z1", "//X Y Z", "scan of a hall", "# 1 2 3"])
def test_lines_before_the_first_point(tmp_path, header):
    (tmp_path / "a.xyz").write_text(f"{header}\n0 0 0\n1 0 0\n")
    assert sh.read(tmp_path / "a.xyz").n_points == 2


@pytest.mark.parametrize(
    "first", ["1_0 0 0", "0 1_0 0", "１ １ １", "0 0 0,0_1", "0 x 0", "1.2.3 0 0", "0 0", "0 0 0 x"]
)
def test_a_first_point_that_is_damaged_is_no_header(tmp_path, first):
    (tmp_path / "a.xyz").write_text(f"{first}\n0 0 0\n1 0 0\n", encoding="utf-8")
    with refused(FileFormatError, file="a.xyz"):
        sh.read(tmp_path / "a.xyz")


@pytest.mark.parametrize(
    "header",
    ["WIDTH 3\nHEIGHT 1\nPOINTS 2", "WIDTH 2\nHEIGHT 2\nPOINTS 2", "SIZE 4 4 3\nPOINTS 2", "TYPE F F X\nPOINTS 2"],
)
def test_headers_of_pcd_that_contradict_themselves(tmp_path, header):
    text = re.sub("[⟦⟧⟨⟩]", "", PCD).replace("WIDTH 2\nHEIGHT 1\nPOINTS 2", header)
    (tmp_path / "a.pcd").write_text(text)
    with refused(FileFormatError, file="a.pcd"):
        sh.read(tmp_path / "a.pcd")


@pytest.mark.parametrize("new", ["-3", "3.5", "1_0"])
@pytest.mark.parametrize("old", [">3<", 'offset="0"'])
def test_negative_and_fractional_offsets_of_vtk(tmp_path, old, new):
    data = np.array(96, dtype="<u8").tobytes() + np.array(CORNERS, dtype="<f8").tobytes()
    text = re.sub("[⟦⟧⟨⟩]", "", VTP).replace("<VTKFile", '<VTKFile header_type="UInt64"')
    text = re.sub('format="ascii">\\s*0 0 0 1 0 0 0 1 0 0 0 1<', 'format="appended" offset="0"><', text)
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
        text = re.sub("[⟦⟧⟨⟩]", "", VTP).replace('Int64" Name="connectivity', 'Float64" Name="connectivity')
        (tmp_path / "a.vtp").write_text(text.replace("0 1 2<", f"{ids}<"))
        if is_read:
            assert sh.read(tmp_path / "a.vtp").faces.tolist() == [[0, 1, 2]]
        else:
            with refused(FileFormatError, file="a.vtp"):
                sh.read(tmp_path / "a.vtp")


@pytest.mark.parametrize("text", ["256", "-1", "1.5"])
def test_values_that_their_type_does_not_hold(tmp_path, text):
    for name, old in (("a.vti", "⟦1⟧ 0"), ("a.nrrd", "⟦1⟧ ⟦0⟧")):
        with refused(FileFormatError, file=name):
            read_marked(tmp_path, name, re.sub("[⟦⟧⟨⟩]", "", FILES[name].replace(old, f"{text} 0")))


@pytest.mark.parametrize("name", ["offsets", "faces"])
@pytest.mark.parametrize("values", [[0, 4, 3], [0, -1, 8], [0, 4.5, 8], [0, 4, 99], ["0", "4", "8"]], ids=str)
def test_arrays_of_fields_on_surfaces(tmp_path, name, values):
    cube = sh.DigitalSurface(np.ones((1, 1, 1), dtype=bool)).squares
    sh.Field(cube, cube.vertices[:, 0]).save(tmp_path / "a.npz")
    assert sh.read_field(tmp_path / "a.npz").domain.n_vertices == 8
    arrays = dict(np.load(tmp_path / "a.npz"))
    np.savez(tmp_path / "a.npz", **{**arrays, name: np.array(values)})
    with refused(SignedHeatError, file="a.npz"):
        sh.read_field(tmp_path / "a.npz")


@pytest.mark.parametrize("about", ['"1_0"', "[1, 1]", '[1, 1, "1"]', "null", "NaN", "-1", "true", "[1, true, 1]"])
@pytest.mark.parametrize("name", ["origin", "spacing"])
def test_places_of_arrays(tmp_path, name, about):
    sh.Field(sh.Grid((0, 0, 0), 1.0, (2, 2, 2)), np.zeros((2, 2, 2))).save(tmp_path / "a.npy")
    places = {"origin": "[0, 0, 0]", "spacing": "[1, 1, 1]", name: about}
    (tmp_path / "a.json").write_text("{" + ", ".join(f'"{key}": {value}' for key, value in places.items()) + "}")
    with refused(SignedHeatError):
        sh.read_field(tmp_path / "a.npy")


@pytest.mark.parametrize(
    "part", ['"rotation": [0, 0, 0, "1"]', '"scale": 2', '"scale": [1, true, 1]', '"scale": [1, 1, null]',
    '"translation": [1e400, 0, 0]', '"translation": ["1_0", 0, 0]', '"matrix": [1, 2]', '"rotation": [0, 0, 1]'],
)  # fmt: skip
def test_transforms_of_gltf(tmp_path, part):
    gltf(tmp_path / "a.gltf", "0", '"mesh": 0')
    text = (tmp_path / "a.gltf").read_text()
    (tmp_path / "a.gltf").write_text(text.replace('"mesh": 0', f'"mesh": 0, {part}', 1))
    with refused(FileFormatError, file="a.gltf"):
        sh.read(tmp_path / "a.gltf")


@pytest.mark.parametrize("length", ["-1", "53.5", '"5_4"', "55", "1e400", "null"])
def test_lengths_of_buffers_of_gltf(tmp_path, length):
    gltf(tmp_path / "a.gltf", length, '"byteLength": 54')
    with refused(FileFormatError, file="a.gltf"):
        sh.read(tmp_path / "a.gltf")
