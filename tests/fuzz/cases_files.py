"""Every reader of files, on files that were right before they were damaged: `files STL`, `files fields`, …"""

from __future__ import annotations

import bz2
import gzip
import tempfile
import zipfile
import zlib
from base64 import b64encode
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import scan_files
import signedheat as sh
from fuzz.frame import Wrong, family
from fuzz.mutations import damaged
from signedheat import samples
from signedheat.io.mesh_files import read_obj_elements

Files = dict[str, bytes]
"""Contents by name; the first is the one that is read."""


@dataclass(frozen=True)
class Damaged:
    """A damaged file, and what reads it."""

    path: Path
    read: Callable[[Path], Any]


def build(kind: str, random: np.random.Generator, folder: Path) -> Damaged:
    """One of the files of a kind, and those beside it: one of them is damaged."""
    read, variants = KINDS[kind]
    files = dict(variants()[int(random.integers(0, len(variants())))])
    hit = list(files)[int(random.integers(0, len(files)))] if random.random() < 0.3 else next(iter(files))
    files[hit] = damaged(random, files[hit])
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return Damaged(folder / next(iter(files)), read)


def check(subject: Damaged) -> str:
    """It is read, and everything in it is finite; or it is refused by an error that names the file."""
    try:
        found = subject.read(subject.path)
    except sh.errors.SignedHeatError as error:
        if error.path is None:
            raise Wrong("refused without the file's name", str(error)) from error
        raise
    for shape in found if isinstance(found, list) else [found]:
        points = getattr(shape, "vertices", getattr(shape, "points", None)) if not isinstance(shape, sh.Grid) else None
        if points is not None and not np.isfinite(points).all():
            raise Wrong("not finite", repr(shape))
    return "read"


def written(save: Callable[[Path], Any], *names: str) -> Files:
    """What a writer writes."""
    with tempfile.TemporaryDirectory() as folder:
        save(Path(folder) / names[0])
        return {name: (Path(folder) / name).read_bytes() for name in names}


BALL = samples.sphere(1)
SQUARES = sh.DigitalSurface(np.ones((2, 2, 2), dtype=bool)).squares
CLOUD = sh.PointCloud(BALL.vertices, BALL.vertices)
TETS = sh.TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], [[0, 1, 2, 3], [1, 2, 3, 4]])
GRID = sh.Grid([0.0, 0.0, 0.0], [0.5, 0.5, 0.25], [3, 4, 5])
FIELD = sh.Field(GRID, np.random.default_rng(0).normal(size=GRID.shape))
CURVES = [BALL.path([0, 1]), sh.SurfacePoints([0, 1], [[0.2, 0.3, 0.5], [0, 0, 1]])]


def shapes(ending: str) -> list[Files]:
    """Triangles, polygons and points, as far as a format holds them."""
    name, found = f"shape.{ending}", []
    for shape in (BALL, SQUARES, CLOUD):
        try:
            found.append(written(shape.save, name))
        except sh.errors.FileFormatError:
            continue
    return found


@cache
def stl() -> list[Files]:
    """Binary and text."""
    facets = BALL.vertices[BALL.faces].tolist()
    corners = ["\n".join(f"vertex {x} {y} {z}" for x, y, z in facet) for facet in facets]
    rows = [f"facet normal 0 0 0\nouter loop\n{three}\nendloop\nendfacet" for three in corners]
    return [*shapes("stl"), {"shape.stl": "\n".join(["solid x", *rows, "endsolid x\n"]).encode()}]


@cache
def ply() -> list[Files]:
    """Binary of both orders, and text."""
    body = "".join(" ".join(map(str, p)) + "\n" for p in BALL.vertices.tolist())
    faces = "".join("3 " + " ".join(map(str, f)) + "\n" for f in BALL.faces.tolist())
    head = f"ply\nformat {{}} 1.0\nelement vertex {BALL.n_vertices}\n"
    head += "property float x\nproperty float y\nproperty float z\n"
    head += f"element face {BALL.n_faces}\nproperty list uchar int vertex_indices\nend_header\n"
    mixed = b"".join(bytes([len(p)]) + np.array(p, ">i4").tobytes() for p in [*SQUARES.polygons, [0, 1, 2]])
    big = head.replace(f"vertex {BALL.n_vertices}", f"vertex {SQUARES.n_vertices}")
    big = big.replace(f"face {BALL.n_faces}", f"face {len(SQUARES.polygons) + 1}").format("binary_big_endian")
    strips = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement "
    strips += "tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n4 0 1 2 3\n"
    return [
        *shapes("ply"),
        {"shape.ply": (head.format("ascii") + body + faces).encode()},
        {"shape.ply": big.encode() + SQUARES.vertices.astype(">f4").tobytes() + mixed},
        {"shape.ply": strips.encode()},
    ]


@cache
def texts() -> list[Files]:
    """OBJ, OFF, XYZ, PC."""
    return [file for ending in ("obj", "off", "xyz", "pc") for file in shapes(ending)]


@cache
def vtp() -> list[Files]:
    """Appended, and packed in base 64."""
    points = vtk_array("P", np.array(TETS.vertices))
    cells = vtk_array("connectivity", np.array([0, 1, 2, 1, 2, 3])) + vtk_array("offsets", np.array([3, 6]))
    text = (
        '<VTKFile type="PolyData" byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor">'
        f'<PolyData><Piece NumberOfPoints="5" NumberOfPolys="2"><Points>{points}</Points><Polys>{cells}</Polys>'
        "</Piece></PolyData></VTKFile>"
    )
    return [*shapes("vtp"), {"shape.vtp": text.encode()}]


def vtk_array(name: str, values: np.ndarray) -> str:
    """A packed array of VTK."""
    data, kind = values.tobytes(), {"f": "Float64", "i": "Int64"}[values.dtype.kind]
    packed = zlib.compress(data)
    head = np.array([1, len(data), len(data), len(packed)], "<u4").tobytes()
    text = b64encode(head).decode() + b64encode(packed).decode()
    return f'<DataArray type="{kind}" Name="{name}" format="binary">{text}</DataArray>'


@cache
def gltf() -> list[Files]:
    """GLB, and glTF with its buffers."""
    scene = sh.samples.sphere(1).to_trimesh().scene()
    files = {name: bytes(data) for name, data in scene.export(file_type="gltf").items()}
    main = files.pop("model.gltf")
    return [{"shape.glb": scene.export(file_type="glb")}, {"model.gltf": main, **files}]


@cache
def tets() -> list[Files]:
    """Every format of tets, in text and binary."""
    mesh, found = TETS.to_meshio({"signed_distance": np.arange(5.0)}), []
    for ending, options in (
        ("mesh", {}), ("meshb", {}), ("vtu", {}), ("vtu", {"binary": False}), ("vtu", {"compression": None}),
        ("vtk", {}), ("vtk", {"binary": False}), ("msh", {"file_format": "gmsh"}), ("msh", {"file_format": "gmsh22"}),
        ("msh", {"file_format": "gmsh", "binary": False}), ("msh", {"file_format": "gmsh22", "binary": False}),
    ):  # fmt: skip
        text_of_gmsh = options.get("binary") is False and ending == "msh"  # meshio cannot read values from it
        one = TETS.to_meshio() if text_of_gmsh else mesh
        found.append(written(lambda path, one=one, options=options: one.write(path, **options), f"shape.{ending}"))
    pair = written(TETS.save, "shape.node", "shape.ele")
    return [*found, pair, dict(reversed(pair.items()))]


@cache
def fields() -> list[Files]:
    """Every format of fields on grids and surfaces."""
    raw = written(FIELD.save, "field.nrrd")["field.nrrd"]
    head, _, values = raw.partition(b"\n\n")
    packed = {name: head.replace(b"raw", name.encode()) + b"\n\n" for name in ("gzip", "bzip2", "ascii")}
    numbers = " ".join(map(str, FIELD.values.ravel(order="F").tolist())).encode()
    on_ball = sh.Field(BALL, BALL.vertices[:, 0])
    apart = head + b"\ndata file: field.raw\n\n"
    return [
        *[written(FIELD.save, f"field.{ending}") for ending in ("npz", "vti", "nrrd")],
        written(FIELD.save, "field.npy", "field.json"),
        written(on_ball.save, "field.npz"),
        {"field.nrrd": packed["gzip"] + gzip.compress(values)},
        {"field.nrrd": packed["bzip2"] + bz2.compress(values)},
        {"field.nrrd": packed["ascii"] + numbers},
        {"field.nrrd": apart, "field.raw": values},
    ]


@cache
def solids() -> list[Files]:
    """Solids: whole, broken, of bodies that overlap."""
    shapes = BALL, samples.without_faces(BALL, 0.2), samples.union(BALL, samples.sphere(1, center=(1, 0, 0)))
    return [written(sh.complete(shape).save, "solid.npz") for shape in shapes]


def load_and_ask(path: Path) -> np.ndarray:
    """A solid from a file answers points, whatever numbers it holds."""
    return sh.read(path).distance([[0.1, 0.2, 0.3], [2.0, 0.0, 0.0]])


@cache
def scans() -> list[Files]:
    """LAS, LAZ and E57, of those that can be written."""
    found = []
    with suppress(ImportError):
        import laspy

        for ending in ("las", "laz") if laspy.LazBackend.detect_available() else ("las",):
            header = laspy.LasHeader(point_format=3, version="1.2")
            cloud = laspy.LasData(header)
            cloud.x, cloud.y, cloud.z = CLOUD.points.T
            found.append(written(cloud.write, f"scan.{ending}"))
    with suppress(ImportError):
        found.append(written(lambda path: scan_files.write_e57(path, np.array(CLOUD.points)), "scan.e57"))
    return found


@cache
def scenes() -> list[Files]:
    """COLLADA, and 3MF packages."""
    mesh = samples.sphere(1).to_trimesh()
    corners = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*p) for p in BALL.vertices.tolist())
    faces = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in BALL.faces.tolist())
    model = (
        '<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
        f'<object id="1"><mesh><vertices>{corners}</vertices><triangles>{faces}</triangles></mesh></object>'
        '<object id="2"><components><component objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/></components></object>'
        '</resources><build><item objectid="1"/><item objectid="2"/></build></model>'
    )

    def package(path: Path) -> None:
        with zipfile.ZipFile(path, "w") as file:
            file.writestr("3D/3dmodel.model", model)

    found = [written(package, "scene.3mf")]
    with suppress(ImportError):
        import collada  # noqa: F401

        found.append({"scene.dae": mesh.export(file_type="dae")})
    return found


@cache
def step() -> list[Files]:
    """A cone by Open CASCADE, which is where it is installed."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCone
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    writer = STEPControl_Writer()
    writer.Transfer(BRepPrimAPI_MakeCone(10.0, 5.0, 8.0).Shape(), STEPControl_StepModelType.STEPControl_AsIs)
    return [written(lambda path: writer.Write(str(path)), "part.step")]


@cache
def volumes() -> list[Files]:
    """Voxels."""
    voxels = np.zeros((3, 3, 3), dtype=np.uint8)
    voxels[1, 1, 1] = 1
    field = sh.Field(sh.Grid([0, 0, 0], 1, voxels.shape), voxels.astype(float))
    array = written(lambda path: np.save(path, voxels), "voxels.npy")
    return [array, *[written(field.save, f"voxels.{ending}") for ending in ("vti", "nrrd")]]


@cache
def labels() -> list[Files]:
    """Images of labels: NRRD with turned axes, raw and packed, NIfTI of both versions, VTI and NPY."""
    head = "NRRD0005\ntype: uint8\ndimension: 3\nspace: LPS\nsizes: 3 2 4\nencoding: {}\n"
    head += "space directions: (0,2,0) (-0.5,0,0) (0,0,-1)\nspace origin: (1,-2,3)\n\n"
    values = np.array([0, 1, 3, 3, 0, 1] * 4, dtype=np.uint8)
    image = values.reshape((3, 2, 4), order="F")
    affine = np.array([[0, -0.5, 0, 1], [2, 0, 0, -2], [0, 0, -1, 3], [0, 0, 0, 1.0]])
    found = [
        {"labels.nrrd": head.format("raw").encode() + values.tobytes()},
        {"labels.nrrd": head.format("gzip").encode() + gzip.compress(values.tobytes(), mtime=0)},
        written(lambda path: np.save(path, image), "labels.npy"),
        written(sh.Field(sh.Grid([0, 0, 0], 1, image.shape), image.astype(float)).save, "labels.vti"),
    ]
    with suppress(ImportError):
        import nibabel

        for kind in (nibabel.Nifti1Image, nibabel.Nifti2Image):
            packed = kind(image, affine).to_bytes()
            found += [{"labels.nii": packed}, {"labels.nii.gz": gzip.compress(packed, mtime=0)}]
    return found


def read_labelled(path: Path) -> sh.io.LabelImage:
    """An image of labels, which has a place."""
    image = sh.io.read_labels(path)
    if not (np.isfinite(image.matrix).all() and (image.spacing > 0).all() and image.labels.ndim == 3):
        raise Wrong("not finite", repr(image))
    return image


@cache
def lines() -> list[Files]:
    """Polylines in the plane."""
    square = sh.Polyline([[0, 0], [0, 1], [1, 1], [1, 0]], closed=True)
    drawing = """<svg xmlns="http://www.w3.org/2000/svg"><g transform="translate(3 4) rotate(30)"><path
    d="M0 0 C 1 2 3 4 5 6 A 3 4 5 0 1 7 8 Q 1 1 2 2 Z m 3 3 h 4 v -5"/><rect x="1" y="2" width="3" height="4"/></g>
    <circle cx="1" cy="2" r="3"/><ellipse cx="0" cy="0" rx="2" ry="1"/><polyline points="0,0 1,1 2,0"/></svg>"""
    files = [written(lambda path: sh.io.write_polylines([square, square], path), f"lines.{e}") for e in ("svg", "csv")]
    return [*files, {"lines.svg": drawing.encode()}]


@cache
def curves() -> list[Files]:
    """Curves and points on a surface."""
    files = [written(lambda path: sh.io.write_curves(CURVES, path, BALL), f"curves.{e}") for e in ("json", "obj")]
    table = "x,y,z\n" + "".join(",".join(map(str, p)) + "\n" for p in BALL.vertices[[0, 1, 2]].tolist())
    return [
        *files,
        {"curves.csv": table.encode()},
        {"curves.json": b'{"polylines": [{"points": [[0, 0, 1], [0, 1, 0], [1, 0, 0]], "closed": true}]}'},
    ]


KINDS: dict[str, tuple[Callable[[Path], Any], Callable[[], list[Files]]]] = {
    "STL": (sh.read, stl),
    "PLY": (sh.read, ply),
    "texts": (sh.read, texts),
    "VTP": (sh.read, vtp),
    "glTF": (sh.read, gltf),
    "scenes": (sh.read, scenes),
    "tets": (sh.read, tets),
    "tet fields": (sh.read_field, lambda: [f for f in tets() if b"signed_distance" in next(iter(f.values()))]),
    "fields": (sh.read_field, fields),
    "solids": (load_and_ask, solids),
    "volumes": (sh.read, volumes),
    "labels": (read_labelled, labels),
    "lines": (sh.io.read_polylines, lines),
    "curves": (lambda path: sh.io.read_curves(path, BALL), curves),
    "line elements": (read_obj_elements, lambda: [f for f in curves() if "curves.obj" in f]),
}

if find_spec("laspy") is not None or find_spec("pye57") is not None:
    KINDS["scans"] = sh.read, scans
if find_spec("OCP") is not None:
    KINDS["STEP"] = sh.read, step

for _kind in KINDS:
    family(
        f"files {_kind}",
        lambda random, folder, kind=_kind: build(kind, random, folder),
        check,
        memory=1 << (30 if _kind == "STEP" else 28),  # Open CASCADE takes a third of a gigabyte where files are made
    )
