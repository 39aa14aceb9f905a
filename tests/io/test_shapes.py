"""Shapes from files and back: every element kept, in order; everything damaged refused in one clear sentence."""

import base64
import warnings

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples

TRIANGLES = samples.broken_duck()
POLYGONS = sh.PolygonMesh(
    np.random.default_rng(0).normal(size=(9, 3)), [[0, 1, 2], [3, 4, 5, 6], [2, 1, 7, 8, 4], [0, 0, 1], [0, 1, 2]]
)
POINTS = samples.oriented_points(samples.sphere(3), 200)
BARE_POINTS = sh.PointCloud(POINTS.points)
MEASURED_POINTS = sh.PointCloud(POINTS.points, POINTS.normals, np.linspace(1, 2, 200))


def same(one, other):
    assert type(one) is type(other)
    if isinstance(one, sh.PointCloud):
        np.testing.assert_array_equal(one.points, other.points)
        assert (one.normals is None) == (other.normals is None)
        if one.normals is not None:
            np.testing.assert_allclose(one.normals, other.normals, rtol=0, atol=2e-16)
    elif isinstance(one, sh.TriangleMesh):
        np.testing.assert_array_equal(one.vertices, other.vertices)
        np.testing.assert_array_equal(one.faces, other.faces)
    else:
        np.testing.assert_array_equal(one.vertices, other.vertices)
        np.testing.assert_array_equal(one.corners, other.corners)
        np.testing.assert_array_equal(one.offsets, other.offsets)


@pytest.mark.parametrize("ending", ["obj", "off", "ply", "vtp", "xyz", "pc"])
def test_points_come_back_with_and_without_normals(tmp_path, ending):
    for shape in (POINTS, BARE_POINTS):
        shape.save(tmp_path / f"points.{ending}")
        same(shape, sh.read(tmp_path / f"points.{ending}"))


@pytest.mark.parametrize("ending", ["ply", "vtp"])
def test_areas_round_trip(tmp_path, ending):
    MEASURED_POINTS.save(tmp_path / f"points.{ending}")
    np.testing.assert_array_equal(sh.read(tmp_path / f"points.{ending}").areas, MEASURED_POINTS.areas)


def test_stl_keeps_every_facet_in_order_and_joins_equal_corners(tmp_path):
    single = sh.TriangleMesh(TRIANGLES.vertices.astype(np.float32), TRIANGLES.faces)
    single.save(tmp_path / "shape.STL")
    back = sh.read(tmp_path / "shape.STL")
    np.testing.assert_array_equal(back.vertices[back.faces], single.vertices[single.faces])
    assert back.n_vertices == len(np.unique(single.faces))


def ascii_stl(mesh, name="one"):
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*p) for p in corners)
        + "endloop\nendfacet\n"
        for corners in mesh.vertices[mesh.faces].tolist()
    )
    return f"solid {name}\n{facets}endsolid {name}\n"


def test_text_stl_with_several_solids(tmp_path):
    mesh = samples.sphere(1)
    (tmp_path / "two.stl").write_text(ascii_stl(mesh, "first solid") + ascii_stl(mesh, "second"))
    back = sh.read(tmp_path / "two.stl")
    corners = mesh.vertices[mesh.faces]
    np.testing.assert_array_equal(back.vertices[back.faces], np.concatenate([corners, corners]))
    assert back.n_vertices == mesh.n_vertices


def test_binary_stl_whose_comment_begins_with_solid(tmp_path):
    samples.sphere(1).save(tmp_path / "shape.stl")
    data = b"solid facet".ljust(80) + (tmp_path / "shape.stl").read_bytes()[80:]
    (tmp_path / "shape.stl").write_bytes(data)
    assert sh.read(tmp_path / "shape.stl").n_faces == 80


def test_obj_with_all_it_may_hold(tmp_path):
    (tmp_path / "a.obj").write_text(
        "# a comment\nmtllib x.mtl\no thing\r\nv 0 0 0 1.0\nv\t1 0 0\nv 1 1 0 # more\nv 0 1 0\nvt 0 0\nvn 0 0 1\n"
        "usemtl m\nf 1/1/1 2/1/1 3/1/1\nf 1//1 3//1 4//1\nf -4 \\ \r\n-3 -2 -1\nl 1 2 3\nl 4 1\n"
    )
    mesh = sh.read(tmp_path / "a.obj")
    assert [p.tolist() for p in mesh.polygons] == [[0, 1, 2], [0, 2, 3], [0, 1, 2, 3]]
    from signedheat.io.mesh_files import read_obj_elements

    vertices, lines, points = read_obj_elements(tmp_path / "a.obj")
    assert len(vertices) == 4
    assert lines == [[0, 1, 2], [3, 0]] and points == []


def test_pc_of_the_published_demo(tmp_path):
    (tmp_path / "a.pc").write_text("v 0 0 1\nvn 0 0 2\nv 1 0 0\nvn 1 0 0\n")
    cloud = sh.read(tmp_path / "a.pc")
    np.testing.assert_array_equal(cloud.normals, [[0, 0, 1], [1, 0, 0]])


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_in_every_form_with_other_elements_around(tmp_path, form):
    order = ">" if "big" in form else "<"
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 2, 2]], dtype=float)
    header = (
        f"ply\nformat {form} 1.0\ncomment made by hand\nelement material 1\nproperty uchar red\n"
        "element vertex 5\nproperty float x\nproperty float y\nproperty float z\nproperty uchar quality\n"
        "element face 2\nproperty int flags\nproperty list uchar uint vertex_index\n"
        "property list uchar float texcoord\nend_header\n"
    )
    if form == "ascii":
        body = "7\n" + "".join("{} {} {} 3\n".format(*v) for v in vertices) + "9 3 0 1 2 2 .5 .5\n8 4 0 1 2 3 0\n"
        data = header.encode() + body.encode()
    else:
        row = np.dtype([("xyz", order + "f4", 3), ("quality", "u1")])
        table = np.zeros(5, row)
        table["xyz"] = vertices
        faces = b""
        for flag, ids, coordinates in ((9, [0, 1, 2], [0.5, 0.5]), (8, [0, 1, 2, 3], [])):
            faces += np.array(flag, order + "i4").tobytes() + bytes([len(ids)]) + np.array(ids, order + "u4").tobytes()
            faces += bytes([len(coordinates)]) + np.array(coordinates, order + "f4").tobytes()
        data = header.encode() + b"\x07" + table.tobytes() + faces
    (tmp_path / "a.ply").write_bytes(data)
    mesh = sh.read(tmp_path / "a.ply")
    np.testing.assert_array_equal(mesh.vertices, vertices)
    assert [p.tolist() for p in mesh.polygons] == [[0, 1, 2], [0, 1, 2, 3]]


def test_ply_strips_become_triangles_of_one_orientation(tmp_path):
    (tmp_path / "a.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n9 0 1 2 3 4 -1 0 1 2\n"
    )
    mesh = sh.read(tmp_path / "a.ply")
    assert mesh.faces.tolist() == [[0, 1, 2], [2, 1, 3], [2, 3, 4], [0, 1, 2]]
    assert (mesh.face_area_vectors[:, 2] > 0).all()


def test_off_of_other_kinds(tmp_path):
    (tmp_path / "a.off").write_text(
        "COFF 4 1 0\n# points\n0 0 0 255 0 0 1\n1 0 0 0 0 0 0\n\n1 1 0 0 0 0 0\n0 1 0 0 0 0 0\n4 0 1 2 3 1 0 0\n"
    )
    assert sh.read(tmp_path / "a.off").polygons[0].tolist() == [0, 1, 2, 3]


def test_glb_puts_every_body_in_its_place(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    body = samples.sphere(1).to_trimesh()
    scene = trimesh.Scene()
    scene.add_geometry(body)
    scene.add_geometry(body.copy(), transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    (tmp_path / "a.glb").write_bytes(scene.export(file_type="glb"))
    mesh = sh.read(tmp_path / "a.glb")
    assert mesh.n_faces == 160
    np.testing.assert_allclose(mesh.bounds[1, 0], 5 + body.bounds[1, 0], rtol=1e-6)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "vtp"])
def test_vtk_reads_what_we_write(tmp_path, ending):
    pyvista = pytest.importorskip("pyvista")
    mesh = samples.torus(n_around=12, n_across=6)
    mesh.save(tmp_path / f"a.{ending}")
    theirs = pyvista.read(tmp_path / f"a.{ending}")
    assert theirs.n_cells == mesh.n_faces
    np.testing.assert_allclose(theirs.area, mesh.face_areas.sum(), rtol=1e-6)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("mode", ["ascii", "binary", "appended"])
@pytest.mark.parametrize("compressor", ["none", "zlib"])
def test_we_read_what_vtk_writes(tmp_path, mode, compressor):
    pytest.importorskip("pyvista")
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(POLYGONS.to_pyvista())
    writer.SetFileName(str(tmp_path / "a.vtp"))
    getattr(
        writer,
        {"ascii": "SetDataModeToAscii", "binary": "SetDataModeToBinary", "appended": "SetDataModeToAppended"}[mode],
    )()
    writer.SetCompressorTypeToNone() if compressor == "none" else writer.SetCompressorTypeToZLib()
    writer.Write()
    back = sh.read(tmp_path / "a.vtp")
    np.testing.assert_array_equal(back.corners, POLYGONS.corners)
    np.testing.assert_array_equal(back.vertices, POLYGONS.vertices)


PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
PLY_FACE = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
DAMAGED = {
    "empty.stl": b"",
    "cut.stl": b"x" * 80 + (3).to_bytes(4, "little") + bytes(120),
    "cut-text.stl": ascii_stl(samples.sphere(1)).encode()[:4000],
    "no.obj": b"hello\n",
    "cut.obj": b"v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n",
    "short.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n",
    "words.obj": b"v 0 0 zero\nf 1 1 1\n",
    "nan.obj": b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "inf.off": b"OFF\n3 1 0\n0 0 inf\n1 0 0\n0 1 0\n3 0 1 2\n",
    "zero.obj": b"v 0 0 0\nf 0 1 1\n",
    "range.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",
    "lines.obj": b"v 0 0 0\nv 1 0 0\nl 1 2\n",
    "range.ply": (PLY + PLY_FACE + "0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n").encode(),
    "cut.ply": (PLY + PLY_FACE + "0 0 0\n1 0 0\n").encode(),
    "head.ply": PLY.encode(),
    "odd.ply": b"ply\nformat ascii 1.0\nelement vertex many\nend_header\n",
    "form.ply": b"ply\nformat morse 1.0\nelement vertex 0\nend_header\n",
    "not.ply": b"solid",
    "cut-binary.ply": (PLY.replace("ascii", "binary_little_endian") + PLY_FACE).encode() + bytes(36) + b"\x03\x00",
    "huge.ply": (
        PLY.replace("ascii", "binary_little_endian").replace("vertex 3", "vertex 999999999999") + PLY_FACE
    ).encode(),
    "not.off": b"ply\n",
    "cut.off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n",
    "none.off": b"OFF\n0 0 0\n",
    "short.off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n",
    "columns.xyz": b"1 2 3 4\n",
    "ragged.xyz": b"1 2 3\n1 2\n",
    "zero-normal.xyz": b"1 2 3 0 0 0\n",
    "normals.pc": b"v 0 0 0\nv 1 0 0\nvn 0 0 1\n",
    "bad.glb": b"glTF" + bytes(30),
    "bad.vtp": b"<VTKFile type='PolyData'><PolyData>",
    "kind.vtp": b"<VTKFile type='ImageData'/>",
    "what.iges": b"ISO-10303-21;",
    "none": b"abc",
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_are_refused_by_name(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(DAMAGED[name])
    with refused(sh.errors.SignedHeatError, file=name) as caught:
        sh.read(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value).replace(str(path), "")) < 240


def test_missing_files_and_folders_are_refused(tmp_path):
    with refused(sh.errors.FileFormatError):
        sh.read(tmp_path / "nowhere.stl")
    (tmp_path / "folder.stl").mkdir()
    with refused(sh.errors.FileFormatError):
        sh.read(tmp_path / "folder.stl")


def test_every_prefix_of_a_file_is_read_or_refused(tmp_path):
    """No truncation ends in any other exception, or in part of a shape."""
    for ending in ("stl", "ply", "off", "obj", "vtp"):
        samples.sphere(0).save(tmp_path / f"whole.{ending}")
        data = (tmp_path / f"whole.{ending}").read_bytes()
        for length in range(0, len(data) - 2, 7):
            (tmp_path / f"cut.{ending}").write_bytes(data[:length])
            try:
                mesh = sh.read(tmp_path / f"cut.{ending}")
            except sh.errors.SignedHeatError:
                continue
            if ending != "obj":  # which has no end that could be missing
                same(mesh, sh.read(tmp_path / f"whole.{ending}"))


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "a.ply"
    path.write_text("precious")
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with refused(sh.errors.FileFormatError):
        samples.sphere(0).save(path)
    assert path.read_text() == "precious"
    assert [file.name for file in tmp_path.iterdir()] == ["a.ply"]


def test_what_a_format_cannot_hold_is_refused(tmp_path):
    for shape, name in (
        (POLYGONS, "a.stl"),
        (POINTS, "a.stl"),
        (TRIANGLES, "a.xyz"),
        (TRIANGLES, "a.pc"),
        (POINTS, "a.doc"),
    ):
        with refused(sh.errors.FileFormatError, file=name):
            shape.save(tmp_path / name)
    flat = sh.PointCloud([[0.0, 1.0]], [[1.0, 0.0]])
    for ending in ("ply", "obj", "off", "vtp", "xyz", "pc"):
        with refused(sh.errors.GeometryError, "points"):
            flat.save(tmp_path / f"a.{ending}")
    with refused(sh.errors.FileFormatError):
        TRIANGLES.save(tmp_path / "no" / "such" / "folder.stl")
    assert not list(tmp_path.iterdir())


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("package", ["trimesh", "pyvista", "meshio"])
def test_other_packages_round_trip(package):
    pytest.importorskip(package)
    for shape in (TRIANGLES, POLYGONS, POINTS):
        if package == "trimesh" and shape is POLYGONS:
            with refused(sh.errors.GeometryError):
                shape.to_trimesh()
            continue
        back = getattr(type(shape), f"from_{package}")(getattr(shape, f"to_{package}")())
        same(sh.PointCloud(shape.points) if package == "trimesh" and shape is POINTS else shape, back)


def test_triangles_are_not_made_of_polygons_in_silence():
    pytest.importorskip("meshio")
    with refused(sh.errors.GeometryError, "face 1"):
        sh.TriangleMesh.from_meshio(POLYGONS.to_meshio())


def test_base64_of_vtk_is_decoded_by_hand(tmp_path):
    """Two routes: an inline array made here, without VTK."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4")
    coded = base64.b64encode(np.uint32(points.nbytes).tobytes() + points.tobytes()).decode()
    (tmp_path / "a.vtp").write_text(
        '<VTKFile type="PolyData" byte_order="LittleEndian"><PolyData><Piece NumberOfPoints="3" NumberOfPolys="1">'
        f'<Points><DataArray type="Float32" NumberOfComponents="3" format="binary">{coded}</DataArray></Points>'
        '<Polys><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2</DataArray>'
        '<DataArray type="Int64" Name="offsets" format="ascii">3</DataArray></Polys></Piece></PolyData></VTKFile>'
    )
    assert sh.read(tmp_path / "a.vtp").face_areas.tolist() == [0.5]


def test_off_with_vertices_and_faces_over_several_lines(tmp_path):
    (tmp_path / "a.off").write_text("OFF\n4 2 0\n0 0\n0\n1 0 0\n1 1 0\n0 1 0\n3 0\n1 2\n3\n0 2 3 255 0 0\n")
    assert sh.read(tmp_path / "a.off").faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_negative_ids_of_obj_count_back_from_their_line(tmp_path):
    square = "v 0 0 {z}\nv 1 0 {z}\nv 0 1 {z}\nf -3 -2 -1\n"
    (tmp_path / "two.obj").write_text(square.format(z=0) + square.format(z=1))
    assert sh.read(tmp_path / "two.obj").faces.tolist() == [[0, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize(("place", "loses"), [((0, 0, 0), False), ((431250.1, 5412300.3, 112.2), True)])
def test_stl_says_when_single_precision_is_too_little(tmp_path, place, loses):
    ball = samples.sphere(3)
    house = sh.TriangleMesh(ball.vertices + place, ball.faces)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        house.save(tmp_path / "house.stl")
        house.save(tmp_path / "house.ply")
    assert [issubclass(warning.category, sh.errors.InexactWarning) for warning in caught] == [True] * loses


def test_normals_of_some_pieces_only_are_left_out(tmp_path):
    array = '<DataArray type="Float64" format="ascii" NumberOfComponents="3"{}>0 0 1</DataArray>'
    points = f"<Points>{array.format('')}</Points>"
    normals = "<PointData>{}</PointData>".format(array.format(' Name="Normals"'))
    pieces = "".join(f'<Piece NumberOfPoints="1">{data}{points}</Piece>' for data in ("", normals))
    (tmp_path / "two.vtp").write_text(f'<VTKFile type="PolyData"><PolyData>{pieces}</PolyData></VTKFile>')
    cloud = sh.read(tmp_path / "two.vtp")
    assert cloud.n_points == 2 and cloud.normals is None
