"""Files that are easily misread: what they mean comes out, or an error."""

import base64
import codecs
import json
import zipfile

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.errors import FileFormatError, MemoryLimitError
from signedheat.io.scenes import scale_to, unit_of

pytestmark = pytest.mark.usefixtures("forked_parsers")

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4")
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], "<u2")
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@pytest.mark.parametrize(
    "data", [codecs.BOM_UTF8 + OBJ.encode(), OBJ.encode("utf-16"), OBJ.replace("\n", "\r").encode()]
)
def test_obj_in_other_encodings(tmp_path, data):
    (tmp_path / "a.obj").write_bytes(data)
    np.testing.assert_array_equal(sh.read(tmp_path / "a.obj").faces, FACES)


@pytest.mark.parametrize(
    "damaged", [OBJ.replace("v 1", "w 1", 1), OBJ.replace("v 1", "\0v 1", 1), OBJ.replace("f 2", "F 2")]
)
def test_obj_keywords_that_do_not_exist_shift_nothing(tmp_path, damaged):
    (tmp_path / "a.obj").write_text(damaged)
    with refused(FileFormatError):
        sh.read(tmp_path / "a.obj")


def test_obj_names_hold_any_characters(tmp_path):
    names = "o a\fv 9 9 9\ng b\x85v 9 9 9\nusemtl c\u2028v 9 9 9\n"
    (tmp_path / "a.obj").write_text(names + OBJ + "comment that nobody marked\n", encoding="utf-8")
    mesh = sh.read(tmp_path / "a.obj")
    np.testing.assert_array_equal(mesh.vertices, CORNERS)


def facet(*vertices):
    corners = "".join(f"vertex {vertex}\n" for vertex in vertices)
    return f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n"


TRIANGLE = facet("0 0 0", "1 0 0", "0 1 0")


@pytest.mark.parametrize("name", ["", "vertex group", "vertex 1 2 3", "facet", "endsolid"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_stl_text_with_any_name(tmp_path, name, mark):
    (tmp_path / "a.stl").write_text(
        f"{mark}solid {name}\n{TRIANGLE}endsolid {name}\nsolid\n{TRIANGLE}endsolid\n", "utf-8"
    )
    assert sh.read(tmp_path / "a.stl").faces.tolist() == 2 * [[0, 1, 2]]


@pytest.mark.parametrize(
    "facets",
    [
        facet("0 0 0", "1 0 0") + facet("0 0 0", "0 1 0", "1 1 0", "0 0 1"),
        3 * facet("0 0 0", "1 0 0", "1 1 0", "0 1 0"),
        TRIANGLE + facet("0 0 0", "1 0 0", "0 1"),
        TRIANGLE + "vertex 1 2 3\n",
        TRIANGLE.replace("endfacet", ""),
    ],
)
def test_stl_text_facets_have_three_corners(tmp_path, facets):
    (tmp_path / "a.stl").write_text(f"solid\n{facets}endsolid\n")
    with refused(FileFormatError):
        sh.read(tmp_path / "a.stl")


@pytest.mark.parametrize("ending", ["ply", "off", "pcd", "xyz"])
def test_byte_order_marks_of_text(tmp_path, ending):
    texts = {
        "ply": "ply\nformat ascii 1.0\nelement vertex 2\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n",
        "off": "OFF\n2 0 0\n",
        "pcd": "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n",
        "xyz": "",
    }
    (tmp_path / f"a.{ending}").write_text("\ufeff" + texts[ending] + "0 0 0\n1 2 3\n", "utf-8")
    assert sh.read(tmp_path / f"a.{ending}").points.tolist() == [[0, 0, 0], [1, 2, 3]]


@pytest.mark.parametrize(
    ("text", "points"),
    [
        ("0,5 0,1 0,2\n1,5\t2 -0,2e1\n", [[0.5, 0.1, 0.2], [1.5, 2, -2]]),
        ("x;y;z\n0,5;0,1;0,2\n1;2;3,5\n", [[0.5, 0.1, 0.2], [1, 2, 3.5]]),
        ("1,2,3\n4,5,6\n", [[1, 2, 3], [4, 5, 6]]),
        ("1, 2, 3\n4, 5, 6\n", [[1, 2, 3], [4, 5, 6]]),
        ("1.0,2 3\n4,5 6\n", [[1, 2, 3], [4, 5, 6]]),
    ],
)
def test_decimal_commas(tmp_path, text, points):
    (tmp_path / "a.xyz").write_text(text)
    cloud = sh.read(tmp_path / "a.xyz")
    assert cloud.points.tolist() == points and cloud.normals is None


@pytest.fixture
def gltf(tmp_path):
    """A function that writes a scene of one tetrahedron, with whatever is said otherwise, and reads it."""

    def make(views=(CORNERS, FACES), accessors=(), **others):
        data = b"".join(view.tobytes() for view in views)
        starts = np.cumsum([0, *(view.nbytes for view in views)]).tolist()
        tree = {
            "asset": {"version": "2.0"},
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "buffers": [{"byteLength": len(data), "uri": f"data:;base64,{base64.b64encode(data).decode()}"}],
            "bufferViews": [
                {"buffer": 0, "byteOffset": start, "byteLength": view.nbytes}
                for start, view in zip(starts, views, strict=False)
            ],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"} | dict(*accessors[:1]),
                {"bufferView": 1, "componentType": 5123, "count": FACES.size, "type": "SCALAR"} | dict(*accessors[1:]),
            ],
            **others,
        }
        (tmp_path / "a.gltf").write_text(json.dumps(tree), encoding="utf-8-sig")
        return sh.read(tmp_path / "a.gltf")

    return make


def test_gltf_normalized_integers_are_fractions(gltf):
    for code, kind in ((5122, "<i2"), (5123, "<u2"), (5120, "<i1"), (5121, "<u1")):
        most = np.iinfo(kind).max
        whole = (CORNERS * most).astype(kind)
        mesh = gltf(
            (whole, FACES), [{"componentType": code, "normalized": True}], extensionsRequired=["KHR_mesh_quantization"]
        )
        np.testing.assert_allclose(mesh.vertices, CORNERS)
        assert gltf((whole, FACES), [{"componentType": code}]).vertices.max() == most


def test_gltf_sparse_accessors(gltf):
    views = CORNERS, FACES, np.array([3, 0], "<u2"), np.array([0, 0, 7], "<f4")
    sparse = {"count": 1, "indices": {"bufferView": 2, "componentType": 5123}, "values": {"bufferView": 3}}
    assert gltf(views, [{"sparse": sparse}]).vertices[3].tolist() == [0, 0, 7]


@pytest.mark.parametrize("name", ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "VENDOR_unknown"])
def test_gltf_extensions_that_are_needed_and_not_known_are_refused_by_name(gltf, name):
    with refused(FileFormatError, name):
        gltf(extensionsRequired=[name])


def test_gltf_1_is_refused_by_its_version(tmp_path):
    path = tmp_path / "old.gltf"
    path.write_text(
        '{"asset": {"version": "1.0"}, "scenes": {"s": {"nodes": ["n"]}}, "nodes": {"n": {"meshes": ["m"]}}}'
    )
    with refused(FileFormatError, "version"):
        sh.read(path)


@pytest.mark.parametrize(
    ("mode", "corners", "faces"),
    [
        (4, [0, 1, 2, 2, 1, 3], [[0, 1, 2], [2, 1, 3]]),
        (5, [0, 1, 2, 3], [[0, 1, 2], [2, 1, 3]]),
        (6, [0, 1, 2, 3], [[0, 1, 2], [0, 2, 3]]),
    ],
)
def test_gltf_modes(gltf, mode, corners, faces):
    ids = np.array(corners, "<u2")
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}
    lines = {"attributes": {"POSITION": 0}, "mode": 1}
    mesh = gltf((CORNERS, ids), [{}, {"count": len(ids)}], meshes=[{"primitives": [primitive, lines]}])
    assert mesh.faces.tolist() == faces
    with refused(FileFormatError):
        gltf(meshes=[{"primitives": [lines | {"mode": 7}]}])


def test_gltf_nodes_place_meshes(gltf):
    half = np.sqrt(0.5)
    nodes = [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "rotation": [0, 0, half, half], "scale": [2, 2, 2]},
        {"mesh": 0, "scale": [-1, 1, 1]},
    ]
    mesh = gltf(nodes=nodes, scenes=[{"nodes": [0]}], scene=0)
    np.testing.assert_allclose(mesh.vertices[:4], CORNERS @ [[0, 2, 0], [-2, 0, 0], [0, 0, 2]] + [10, 0, 0], atol=1e-12)
    assert mesh.to_trimesh().volume == pytest.approx((8 + 1) / 6)  # what is mirrored keeps its outside
    with refused(FileFormatError):
        gltf(nodes=[{"children": [1]}, {"children": [0], "mesh": 0}], scenes=[{"nodes": [0]}])


@pytest.mark.parametrize(
    "accessor", [{"count": 10**9}, {"count": 5}, {"byteOffset": 4}, {"byteOffset": -4}, {"bufferView": 9}]
)
def test_gltf_announcements_are_not_believed(gltf, accessor):
    with refused(FileFormatError):
        gltf(accessors=[accessor])


def test_gltf_instances_are_counted_before_they_are_made(gltf, monkeypatch):
    monkeypatch.setattr("signedheat.io.budgets.available_memory", lambda: 10**6)
    with refused(MemoryLimitError):
        gltf(nodes=[{"mesh": 0}] * 2000)


def three_mf(path, objects, item):
    text = (
        '<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
        f'{objects}</resources><build><item objectid="{item}"/></build></model>'
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("3D/3dmodel.model", text)


def components(number, *parts):
    listed = "".join(f'<component objectid="{part}"/>' for part in parts)
    return f'<object id="{number}"><components>{listed}</components></object>'


MESH = (
    '<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices>'
    '<triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>'
)


def test_3mf_components_that_double_are_counted_before_they_are_placed(tmp_path):
    doubled = "".join(components(k, k - 1, k - 1) for k in range(2, 31))
    three_mf(tmp_path / "a.3mf", f'<object id="1"><mesh><vertices/><triangles/></mesh></object>{doubled}', 30)
    with refused(FileFormatError):
        sh.read(tmp_path / "a.3mf")
    three_mf(tmp_path / "a.3mf", f'<object id="1">{MESH}</object>{doubled}', 30)
    with refused(MemoryLimitError):
        sh.read(tmp_path / "a.3mf")


@pytest.mark.parametrize("order", [1, -1])
def test_3mf_components_lie_in_one_another_to_a_depth(tmp_path, order):
    chain = "".join([components(k, k - 1) for k in range(2, 2000)][::order])
    three_mf(tmp_path / "a.3mf", f'<object id="1">{MESH}</object>{chain}', 20)
    assert sh.read(tmp_path / "a.3mf").n_faces == 1
    for last in (1999, 2):
        loop = components(1, 1) if last == 2 else f'<object id="1">{MESH}</object>'
        three_mf(tmp_path / "a.3mf", loop + chain, last)
        with refused(FileFormatError):
            sh.read(tmp_path / "a.3mf")


def drawing(path, inside, attributes=""):
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {attributes}>{inside}</svg>')
    return sh.io.read_polylines(path)


def test_svg_lengths_have_units(tmp_path):
    shapes = (
        '<rect x="1in" y="0" width="25.4mm" height="50%"/><circle cx="0" cy="0" r="72pt"/>'
        '<line x1="0" y1="0" x2="3" y2="4px"/>'
    )
    rect, circle, line = drawing(tmp_path / "a.svg", shapes, 'viewBox="0 0 10 20"')
    np.testing.assert_allclose(rect.bounds, [[96, -10], [192, 0]])
    np.testing.assert_allclose(circle.bounds, [[-96, -96], [96, 96]], atol=1e-9)
    assert line.length == 5
    for word in ("3 apples", "50%"):
        with refused(FileFormatError):
            drawing(tmp_path / "a.svg", f'<circle r="{word}"/>')


@pytest.mark.parametrize("where", ['fill-rule="evenodd"', 'style="stroke:red; fill-rule: evenodd"'])
@pytest.mark.parametrize("on_group", [False, True])
def test_svg_rules_of_filling_are_read(tmp_path, where, on_group):
    rings = "M0,0 h8 v8 h-8 Z M2,2 h4 v4 h-4 Z"
    element = f'<g {where}><path d="{rings}"/></g>' if on_group else f'<path d="{rings}" {where}/>'
    points = np.array([[1, -1], [4, -4], [11, -1]])
    for shapes, inside in ((element, [True, False, False]), (f'<path d="{rings}"/>', [True, True, False])):
        lines = drawing(tmp_path / "a.svg", shapes + '<rect x="10" width="2" height="2"/>', "")
        field = sh.signed_distance(lines, resolution=16)
        np.testing.assert_array_equal(field(points) < 0, [*inside[:2], True])


def test_svg_subpaths_without_length_are_left_out(tmp_path):
    data = "M1 1 M2 2 z m3 3 h0 M0 0 L4 0 4 4 z m1 1 l1 0 M7 7 Z"
    square, rest = drawing(tmp_path / "a.svg", f'<path d="{data}"/><path d=""/><path/><polygon points=""/>')
    assert square.closed and square.n_points == 3 and rest.points.tolist() == [[1, -1], [2, -1]]


@pytest.mark.parametrize(
    ("data", "end", "length"),
    [
        ("M0,0a1,1 0 012,0", (2, 0), np.pi),  # flags without spaces
        ("M0,0A1 1 0 0 1 2 0", (2, 0), np.pi),
        ("M0 0a.5.5 0 1 0 2-0", (2, 0), np.pi),  # radii too small are scaled up
        ("M0 0A1 1 0 1 1 1 1", (1, -1), 1.5 * np.pi),
        ("M0 0A1 1 0 0 0 1 1", (1, -1), 0.5 * np.pi),
        ("M0 0H3V4h-3v-4", (0, 0), 14),
        ("m1 1 2 0 0 2-2 0", (1, -3), 6),
        ("M0 0C1 0 2 0 3 0S5 0 6 0", (6, 0), 6),
        ("M0 0Q1 0 2 0T4 0t1 0", (5, 0), 5),
        ("M1e1-.5L1.5.5", (1.5, -0.5), np.hypot(8.5, 1)),
    ],
)
def test_svg_path_data(tmp_path, data, end, length):
    [line] = drawing(tmp_path / "a.svg", f'<path d="{data}"/>')
    last = line.points[0] if line.closed else line.points[-1]
    np.testing.assert_allclose(last, end, atol=1e-12)
    assert line.length == pytest.approx(length, rel=1e-3)


def test_svg_arcs_turn_the_right_way(tmp_path):
    [over] = drawing(tmp_path / "a.svg", '<path d="M0 0A1 1 0 0 1 2 0"/>')
    [under] = drawing(tmp_path / "a.svg", '<path d="M0 0A1 1 0 0 0 2 0"/>')
    [turned] = drawing(tmp_path / "a.svg", '<path d="M-2 0A2 1 90 0 1 2 0"/>')
    assert over.bounds[1, 1] == pytest.approx(1, abs=1e-3) and under.bounds[0, 1] == pytest.approx(-1, abs=1e-3)
    assert turned.bounds[1, 1] == pytest.approx(4, abs=1e-3)


def test_svg_transforms_groups_and_uses(tmp_path):
    inside = (
        '<defs><path id="a" d="M1 0L2 0"/><g id="b"><use href="#a" x="1"/></g></defs>'
        '<g transform="translate(10) rotate(90) scale(2)"><use href="#a"/><a><use xlink:href="#b" '
        'xmlns:xlink="http://www.w3.org/1999/xlink"/></a></g><g display="none"><use href="#a"/></g>'
        '<path transform="matrix(1 2 3 4 5 6)" d="M1 0L0 1"/>'
    )
    first, second, third = drawing(tmp_path / "a.svg", inside)
    np.testing.assert_allclose(first.points, [[10, -2], [10, -4]], atol=1e-12)
    np.testing.assert_allclose(second.points, [[10, -4], [10, -6]], atol=1e-12)
    np.testing.assert_allclose(third.points, [[6, -8], [8, -10]])
    bomb = '<defs><g id="g0"><path d="M0 0L1 0"/></g>' + "".join(
        f'<g id="g{k}">' + f'<use href="#g{k - 1}"/>' * 10 + "</g>" for k in range(1, 12)
    )
    for inside in (f'{bomb}</defs><use href="#g11"/>', '<g id="a"><use href="#a"/></g>'):
        with refused(FileFormatError):
            drawing(tmp_path / "a.svg", inside)


@pytest.mark.parametrize("data", ["L1 1", "M0 0 L1", "M0 0 X1 1", "M0 0 A1 1 0 2 0 1 1", "M0 0 z 1 1", "garbage"])
def test_svg_path_data_that_is_damaged_is_refused(tmp_path, data):
    with refused(FileFormatError):
        drawing(tmp_path / "a.svg", f'<path d="{data}"/>')


def test_svg_of_many_curves_takes_as_long_as_they_are(tmp_path):
    """A path of 20,000 curves in one line, as programs write them, which took a minute and was called damaged."""
    [line] = drawing(tmp_path / "a.svg", f'<path d="M0 0{"t1 1" * 20_000}"/>')
    assert line.points[-1].tolist() == [20_000, -20_000]


def test_dae_is_placed_by_its_nodes(tmp_path):
    pytest.importorskip("collada")
    ball = samples.sphere(1).to_trimesh()
    (tmp_path / "a.dae").write_bytes(ball.export(file_type="dae"))
    mesh = sh.read(tmp_path / "a.dae")
    assert mesh.n_faces == len(ball.faces) and mesh.to_trimesh().volume == pytest.approx(ball.volume, rel=1e-5)
    (tmp_path / "a.dae").write_bytes(ball.export(file_type="dae")[:-500])
    with refused(FileFormatError):
        sh.read(tmp_path / "a.dae")


@pytest.mark.parametrize(
    ("asset", "unit"),
    [
        ('<unit meter="0.0254" name="zoll"/><up_axis>Z_UP</up_axis>', "inch"),
        ('<up_axis>Z_UP</up_axis><unit name="millimeter" meter="1e-3"/>', "mm"),
        ("<unit/>", "m"),
        ('<unit meter="0.7" name="ell"/>', None),
        ('<unit meter="0,01" name="centimeter"/>', None),
        ('<unit meter=""/>', None),
        ("", None),
    ],
)
def test_dae_states_its_unit_by_its_length(tmp_path, asset, unit):
    (tmp_path / "a.dae").write_text(
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f'<asset>{asset}</asset><library_nodes><asset><unit meter="0.01"/></asset></library_nodes></COLLADA>'
    )
    assert unit_of(tmp_path / "a.dae") == unit
    assert scale_to(tmp_path / "a.dae", "cm:mm") == pytest.approx({"inch": 25.4, "mm": 1, "m": 1000, None: 10}[unit])


def test_vtk_structured_points_are_no_more_than_the_file_can_hold(tmp_path):
    head = "# vtk DataFile Version 3.0\na\nASCII\nDATASET STRUCTURED_POINTS\n"
    (tmp_path / "a.vtk").write_text(f"{head}DIMENSIONS 1000 1000 1000\nORIGIN 0 0 0\nSPACING 1 1 1\n")
    with pytest.raises(sh.errors.SignedHeatError) as caught:
        sh.read(tmp_path / "a.vtk")
    assert caught.value.path.endswith("a.vtk")


def test_colors_of_points_are_no_normals(tmp_path):
    (tmp_path / "a.xyz").write_text("0 0 0 255 0 10\n1 0 0 20 30 40\n0 1 0 1 2 3\n")
    assert sh.read(tmp_path / "a.xyz").normals is None
    (tmp_path / "a.xyz").write_text("0 0 0 0 0 1\n1 0 0 0 1 0\n")
    assert sh.read(tmp_path / "a.xyz").normals.tolist() == [[0, 0, 1], [0, 1, 0]]


def test_off_with_four_coordinates_is_not_taken_for_points_in_space(tmp_path):
    (tmp_path / "a.off").write_text("4OFF\n3 1 0\n0 0 0 1\n2 0 0 2\n0 2 0 2\n3 0 1 2\n")
    with refused(FileFormatError):
        sh.read(tmp_path / "a.off")


def test_lines_of_vtk_are_no_points(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    pyvista.Line().save(tmp_path / "a.vtp")
    with refused(FileFormatError):
        sh.read(tmp_path / "a.vtp")


def test_images_of_vtk_have_the_values_that_they_show(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    image = pyvista.ImageData(dimensions=(3, 4, 5))
    image.point_data["mask"], image.point_data["distance"] = np.ones(60), np.arange(60.0)
    image.set_active_scalars("distance")
    image.save(tmp_path / "a.vti")
    assert sh.read_field(tmp_path / "a.vti").values.ravel(order="F").tolist() == list(range(60))


@pytest.mark.parametrize("name", [None, 3, b"a.stl", ["a.stl"]])
def test_what_is_no_name_of_a_file_is_refused(name):
    ball = samples.sphere(0)
    for use in (sh.read, sh.read_field, ball.save, sh.io.read_polylines):
        with refused(sh.SignedHeatError):
            use(name)


SVG = '<svg xmlns="http://www.w3.org/2000/svg">{}<path d="M0,0 L2,0"/></svg>'


def test_symbols_of_drawings_are_drawn_where_they_are_used(tmp_path):
    symbol = '<symbol id="a"><path d="M0,0 L1,0 L1,1"/></symbol>'
    (tmp_path / "a.svg").write_text(SVG.format(symbol + '<use href="#a" x="3"/>'))
    used, line = sh.io.read_polylines(tmp_path / "a.svg")
    assert used.points.tolist() == [[3, 0], [4, 0], [4, -1]] and line.points.tolist() == [[0, 0], [2, 0]]
    (tmp_path / "a.svg").write_text(SVG.format(symbol))
    assert len(sh.io.read_polylines(tmp_path / "a.svg")) == 1


@pytest.mark.parametrize(
    "inner", ['<svg x="1">{}</svg>', '<symbol id="a" viewBox="0 0 9 9">{}</symbol><use href="#a"/>']
)
def test_drawings_in_drawings_with_coordinates_of_their_own_are_refused(tmp_path, inner):
    (tmp_path / "a.svg").write_text(SVG.format(inner.format('<path d="M0,0 L1,1"/>')))
    with refused(FileFormatError):
        sh.io.read_polylines(tmp_path / "a.svg")
