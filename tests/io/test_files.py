"""Where files are opened, sized and replaced: what is no regular file, permissions, references, bombs, time."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import os
import stat
import struct
import threading
import time
import zlib
from base64 import b64encode
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.io import budgets, files
from signedheat.io.files import ensure_writable, replacing
from signedheat.search import nearest_triangles as nearest

BALL = samples.sphere(1)
posix = pytest.mark.skipif(os.name != "posix", reason="pipes and permissions of POSIX")


def leftovers(folder):
    return [path.name for path in folder.iterdir() if path.name.startswith(".")]


@posix
@pytest.mark.parametrize("ending", ["stl", "npz", "nrrd", "msh", "svg", "glb", "node"])
def test_pipes_and_devices_are_not_read(tmp_path, ending):
    pipe = tmp_path / f"pipe.{ending}"
    os.mkfifo(pipe)
    read = {"npz": sh.read_field, "nrrd": sh.read_field, "svg": sh.io.read_polylines}.get(ending, sh.read)
    with pytest.raises(sh.errors.FileFormatError) as caught:
        read(pipe)
    assert caught.value.path is not None and caught.value.remedy
    device = tmp_path / f"device.{ending}"
    device.symlink_to("/dev/zero")
    with pytest.raises(sh.errors.FileFormatError):
        read(device)


@posix
@pytest.mark.parametrize("kind", ["device", "pipe", "folder"])
def test_what_is_no_regular_file_is_not_replaced(tmp_path, kind):
    target, link = tmp_path / "target.stl", tmp_path / "link.stl"
    if kind == "pipe":
        os.mkfifo(target)
    elif kind == "folder":
        target.mkdir()
    link.symlink_to(target if kind != "device" else "/dev/null")
    for path in (link, *([target] if kind != "device" else [])):
        before = stat.S_IFMT(path.stat().st_mode)
        with pytest.raises(sh.errors.FileFormatError):
            sh.save(BALL, path)
        with pytest.raises(sh.errors.FileFormatError):
            ensure_writable(path, {".stl"}, "a shape")
        assert stat.S_IFMT(path.stat().st_mode) == before
    assert not leftovers(tmp_path)


@posix
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664])
def test_permissions_stay(tmp_path, mode):
    path = tmp_path / "ball.stl"
    path.touch()
    path.chmod(mode)
    with replacing(path) as temporary:
        assert stat.S_IMODE(temporary.stat().st_mode) == mode
        temporary.write_bytes(b"new")
    assert stat.S_IMODE(path.stat().st_mode) == mode and path.read_bytes() == b"new"


@posix
def test_new_files_obey_the_mask(tmp_path):
    before = os.umask(0o077)
    try:
        sh.save(BALL, tmp_path / "ball.stl")
        sh.Field(sh.Grid([0, 0], 1.0, [2, 2]), np.eye(2)).save(tmp_path / "phi.nrrd")
    finally:
        os.umask(before)
    assert {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()} == {0o600}


@posix
def test_links_lead_to_the_file_that_is_replaced(tmp_path):
    (tmp_path / "there").mkdir()
    real, link = tmp_path / "there" / "ball.ply", tmp_path / "ball.ply"
    link.symlink_to(real)
    sh.save(BALL, link)
    assert link.is_symlink() and real.is_file() and not real.is_symlink()
    assert sh.read(real).n_faces == BALL.n_faces and not leftovers(tmp_path)


def test_an_interrupt_leaves_nothing(tmp_path):
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path / "ball.stl") as temporary:
        temporary.write_bytes(b"half")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_names_as_long_as_they_may_be(tmp_path):
    path = tmp_path / ("x" * 251 + ".stl")
    sh.save(BALL, path)
    assert sh.read(path).n_faces == BALL.n_faces


def nrrd(folder, name, extra, data=b""):
    path = folder / name
    head = "NRRD0004\ntype: double\ndimension: 3\nsizes: 2 2 2\nendian: little\n" + extra + "\n"
    path.write_bytes(head.encode() + data)
    return path


@pytest.mark.parametrize(("encoding", "pack"), [("gzip", gzip.compress), ("bzip2", bz2.compress)])
def test_packed_files_of_several_members_are_read_to_the_end(tmp_path, encoding, pack):
    data = np.arange(8.0).tobytes()
    path = nrrd(tmp_path, "packed.nrrd", f"encoding: {encoding}\n", pack(data[:20]) + pack(b"") + pack(data[20:]))
    assert sh.read_field(path).values.ravel(order="F").tolist() == list(range(8))


@posix
def test_an_image_names_files_in_its_folder_only(tmp_path):
    values = np.arange(8.0)
    inner = tmp_path / "inner"
    inner.mkdir()
    for folder in (tmp_path, inner):
        (folder / "data.raw").write_bytes(values.tobytes())
    os.mkfifo(inner / "pipe.raw")
    (inner / "link.raw").symlink_to(tmp_path / "data.raw")
    good = nrrd(inner, "good.nrrd", "encoding: raw\ndata file: data.raw\n")
    np.testing.assert_array_equal(sh.read_field(good).values.ravel(order="F"), values)
    for name in (tmp_path / "data.raw", "../data.raw", "pipe.raw", "link.raw", "absent.raw"):
        with pytest.raises(sh.errors.FileFormatError):
            sh.read_field(nrrd(inner, "bad.nrrd", f"encoding: raw\ndata file: {name}\n"))


def packed_vtk(n_bytes):
    """A VTK array of zeros in one block, which announces as many bytes as it has."""
    data = zlib.compress(bytes(n_bytes), 9)
    head = struct.pack("<4I", 1, n_bytes, n_bytes, len(data))
    return f"{b64encode(head).decode()}{b64encode(data).decode()}"


def bomb(folder, ending, size=1 << 27):
    """A small file that becomes `size` bytes when it is unpacked, though it announces 8 numbers or points."""
    path = folder / f"bomb.{ending}"
    array = f'<DataArray type="Float64" NumberOfComponents="%d" format="binary" Name="x">{packed_vtk(size)}</DataArray>'
    head = '<VTKFile type="%s" byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor">'
    if ending == "vti":
        body = f'<ImageData WholeExtent="0 1 0 1 0 1"><Piece Extent="0 1 0 1 0 1"><PointData>{array % 1}</PointData>'
        path.write_text(head % "ImageData" + body + "</Piece></ImageData></VTKFile>")
    elif ending in ("vtp", "vtu"):
        kind = {"vtp": "PolyData", "vtu": "UnstructuredGrid"}[ending]
        body = f'<{kind}><Piece NumberOfPoints="8" NumberOfPolys="0" NumberOfCells="0"><Points>{array % 3}</Points>'
        path.write_text(head % kind + body + f"</Piece></{kind}></VTKFile>")
    elif ending == "nrrd":
        nrrd(folder, path.name, "encoding: gzip\n", gzip.compress(bytes(size)))
    elif ending == "npz":
        with ZipFile(path, "w", ZIP_DEFLATED) as file:
            for name in ("values", "origin", "spacing"):
                buffer = io.BytesIO()
                np.save(buffer, np.zeros((2, 2, 2)))
                file.writestr(f"{name}.npy", buffer.getvalue() + bytes(size))
    return path


@posix
@pytest.mark.parametrize("ending", ["vti", "vtp", "vtu", "nrrd", "npz"])
def test_no_more_is_unpacked_than_is_announced(tmp_path, ending):
    import resource

    path = bomb(tmp_path, ending)
    assert path.stat().st_size < 1_500_000
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    read = sh.read if ending in ("vtp", "vtu") else sh.read_field
    try:
        read(path)
    except sh.errors.SignedHeatError as error:
        assert error.path is not None
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    assert grown < 1 << 26


@pytest.mark.parametrize("ending", ["vti", "nrrd", "npy"])
def test_what_is_announced_is_compared_with_the_memory_that_is_free(tmp_path, ending, monkeypatch):
    field = sh.Field(sh.Grid([0, 0, 0], 1.0, [40, 40, 40]), np.zeros((40, 40, 40)))
    field.save(tmp_path / f"phi.{ending}")
    monkeypatch.setattr(budgets, "available_memory", lambda: 8 * 40**3 - 1)
    with pytest.raises(sh.errors.MemoryLimitError) as caught:
        sh.read_field(tmp_path / f"phi.{ending}")
    assert caught.value.remedy and caught.value.path


@pytest.mark.parametrize("shape", ["(1099511627776,)", "(2, -4)", "(1099511627776, 0)", "(2**40,)"])
def test_arrays_that_announce_more_than_there_is(tmp_path, shape):
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    (tmp_path / "phi.npy").write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + head.encode() + bytes(64))
    (tmp_path / "phi.json").write_text(json.dumps({"origin": [0, 0], "spacing": [1, 1]}))
    with pytest.raises(sh.errors.SignedHeatError) as caught:
        sh.read_field(tmp_path / "phi.npy")
    assert caught.value.path


HEADER = "ply\nformat binary_little_endian 1.0\n{}end_header\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"


@pytest.mark.parametrize(
    "header, body",
    [
        (
            f"element vertex 1\n{XYZ}element face 4294967295\nproperty list char int vertex_indices\n",
            bytes(12) + b"\xff",
        ),
        (f"element vertex 1\n{XYZ}element face 2\nproperty list char int vertex_indices\n", bytes(12) + b"\xff\xff"),
        (f"element vertex 99999999999999999\n{XYZ}", bytes(12)),
        (f"element vertex -1\n{XYZ}", bytes(12)),
        (f"element vertex 1\n{XYZ}property float x\n", bytes(16)),
        (f"element vertex 1\n{XYZ}element nothing 99999999999999\n", bytes(12)),
        ("element vertex 1\nproperty list uchar float x\nproperty float y\nproperty float z\n", bytes(9)),
        (f"element vertex 1\n{XYZ}element face 1\nproperty float vertex_indices\n", bytes(16)),
        (f"element vertex 1\n{XYZ}element face 1\nproperty list float int vertex_indices\n", bytes(20)),
    ],
)
def test_odd_headers_of_ply(tmp_path, header, body):
    (tmp_path / "odd.ply").write_bytes(HEADER.format(header).encode() + body)
    begin = time.process_time()
    try:
        assert isinstance(sh.read(tmp_path / "odd.ply"), sh.PointCloud)
    except sh.errors.SignedHeatError as error:
        assert error.path
    assert time.process_time() - begin < 2


@pytest.mark.parametrize("ending", ["node", "ele"])
def test_tetgen_files_with_comments_and_ids_from_one(tmp_path, ending):
    (tmp_path / "one.node").write_text("# points\n\n4 3 1 0\n1 0 0 0 .5\n2 1 0 0 .5\n3 0 1 0 .5\n4 0 0 1 .5\n# end\n")
    (tmp_path / "one.ele").write_text("1 4 0\n1 1 2 3 4\n")
    mesh = sh.read(tmp_path / f"one.{ending}")
    assert mesh.tets.tolist() == [[0, 1, 2, 3]] and mesh.vertices[3].tolist() == [0, 0, 1]
    mesh.save(tmp_path / f"two.{ending}")
    again = sh.read(tmp_path / f"two.{ending}")
    np.testing.assert_array_equal(again.vertices, mesh.vertices)
    np.testing.assert_array_equal(again.tets, mesh.tets)


@pytest.mark.parametrize(
    "content", ["# nothing\n", "# a\n# b", "3 3\n", "x y\n", "1 3 0 0\n0 1 1\n", "-1 3 0 0\n", "1 2 0 0\n0 1 1 1"]
)
def test_damaged_tetgen_files(tmp_path, content):
    (tmp_path / "bad.node").write_text(content)
    (tmp_path / "bad.ele").write_text("1 4 0\n0 0 1 2 3\n")
    with pytest.raises(sh.errors.SignedHeatError) as caught:
        sh.read(tmp_path / "bad.ele")
    assert caught.value.path and caught.value.path.endswith(("bad.node", "bad.ele"))


def test_concurrent_writers_of_one_file(tmp_path):
    path = tmp_path / "ball.ply"
    shapes = [samples.sphere(n) for n in (1, 2)]

    def write(k):
        for _ in range(20):
            sh.save(shapes[k], path)

    writers = [threading.Thread(target=write, args=(k,)) for k in (0, 1)]
    sh.save(shapes[0], path)
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        assert sh.read(path).n_faces in {shape.n_faces for shape in shapes}
    for writer in writers:
        writer.join()
    assert [p.name for p in tmp_path.iterdir()] == ["ball.ply"]


ODD_CURVES = {
    "two.obj": "v 0 0\nl 1 1\n",
    "large.json": '{"index_base": 1e400, "groups": []}',
    "ragged.json": '{"polylines": [{"points": [[0, 0, 1], [0, 1]]}]}',
    "deep.json": "[" * 100_000,
    "list.json": "[]",
    "weights.json": '{"groups": [{"kind": "signed_curve", "nodes": [{"v": [0], "w": [1e999]}], "segments": [[0, 5]]}]}',
    "ids.json": '{"groups": [{"kind": "signed_curve", "nodes": [{"v": [1e30], "w": [1]}], "segments": [[0, 0]]}]}',
    "none.csv": "\x00\x01",
}


@pytest.mark.parametrize("name", ODD_CURVES)
def test_odd_curves(tmp_path, name):
    (tmp_path / name).write_text(ODD_CURVES[name])
    with pytest.raises(sh.errors.SignedHeatError) as caught:
        sh.io.read_curves(tmp_path / name, BALL)
    assert caught.value.path == str(tmp_path / name)


def vti(header_type="UInt32", body=""):
    return f'<VTKFile type="ImageData" byte_order="LittleEndian" header_type="{header_type}">{body}</VTKFile>'


ODD_FIELDS = {
    "type.vti": vti("UInt7"),
    "empty.vti": vti(),
    "extent.vti": vti(
        body='<ImageData WholeExtent="0 -5 0 1 0 1"><Piece Extent="0 -5 0 1 0 1"><PointData/></Piece></ImageData>'
    ),
    "header.npy": "\x93NUMPY\x01\x00\x76\x00{'descr': '<f8', 'fortran_order': False, 'shape': (3,",
    "objects.npz": None,
    "zip.npz": "PK\x05\x06" + "\x00" * 18,
    "cut.npz": None,
    "head.nrrd": "NRRD0004\ntype: double\ndimension: 3\nsizes: 2 2\nendian: little\nencoding: raw\n\n",
}


@pytest.mark.parametrize("name", ODD_FIELDS)
def test_odd_fields(tmp_path, name):
    content = ODD_FIELDS[name]
    if name == "objects.npz":
        np.savez(tmp_path / name, values=np.array([{}], dtype=object), origin=[0], spacing=[1])
    elif name == "cut.npz":
        np.savez(tmp_path / name, values=np.zeros((3, 3)), origin=[0, 0], spacing=[1, 1])
        (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:-30])
    else:
        (tmp_path / name).write_bytes(content.encode("latin-1"))
    with pytest.raises(sh.errors.FileFormatError) as caught:
        sh.read_field(tmp_path / name)
    assert caught.value.path == str(tmp_path / name)


def test_what_cannot_be_compiled_says_nothing_about_the_file(tmp_path, monkeypatch):
    def broken(*arguments):
        raise TypeError("the compiler failed")

    path = tmp_path / "curves.json"
    path.write_text(json.dumps({"polylines": [{"points": [[1.0, 0.1, 0.2], [0.0, 1.0, -0.1]]}]}))
    assert len(sh.io.read_curves(path, BALL)) == 1
    monkeypatch.setattr(type(nearest.foot_on_triangle), "__call__", broken)
    with pytest.raises(TypeError, match="compiler"):
        sh.io.read_curves(path, samples.sphere(1))
    monkeypatch.undo()
    path.write_text(json.dumps({"polylines": [{"points": [[1.0, "a", 0.2], [0.0, 1.0, -0.1]]}]}))
    with pytest.raises(sh.errors.FileFormatError):
        sh.io.read_curves(path, BALL)


@pytest.mark.parametrize("where", ["signedheat.grids.grid", "signedheat.compiled", "signedheat.io.ply", "meshio"])
def test_faults_of_parsers_are_damage_and_our_own_are_not(where):
    def read():
        namespace = {"__name__": where}
        exec("def parse():\n    raise IndexError('out of bounds')", namespace)
        with files.reading("shape.ply"):
            namespace["parse"]()

    with pytest.raises(sh.errors.FileFormatError if where in ("signedheat.io.ply", "meshio") else IndexError):
        read()


@pytest.mark.parametrize("ending", [".json", ".obj", ".csv"])
def test_curves_larger_than_memory_are_told_as_that(tmp_path, ending):
    path = tmp_path / f"curves{ending}"
    with path.open("wb") as file:
        file.truncate(1 << 40)  # without any block on the disk
    with refused(sh.errors.MemoryLimitError, file=path.name):
        sh.io.read_curves(path, samples.sphere(1))
