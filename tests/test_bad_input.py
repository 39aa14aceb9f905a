"""What every extension says of bad input: one documented exception, or one line and a status, and nothing is lost."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.tet_cases import boxes
from signedheat import samples
from signedheat.cli import main

BALL = samples.sphere(2)
RING = BALL.level_set(BALL.vertices[:, 2], 0.2)
GRID = sh.Grid((-2, -2, -2), 0.25, (17, 17, 17))
PLANE = sh.Grid((0, 0), 1.0, (8, 8))
BOX = boxes((2, 2, 2), 1.0)
POINTS = samples.oriented_points(BALL, 50)
HEIGHT = sh.Field(BALL, BALL.vertices[:, 2])
NAN, INF = float("nan"), float("inf")


def case(name, *arguments, error=sh.errors.SignedHeatError, **keywords):
    return pytest.param(arguments, keywords, error, id=name)


@pytest.mark.parametrize(
    "operation", [sh.morphology.dilate, sh.morphology.erode, sh.morphology.opening, sh.morphology.closing]
)
@pytest.mark.parametrize(
    ("arguments", "keywords", "error"),
    [
        case("distance must be finite and not negative here|finite and not negative", BALL, NAN),
        case("finite and not negative, not inf", BALL, INF),
        case("not negative, not -1", BALL, -1),
        case("must be a number, not 'x'", BALL, "x"),
        case("must be a number, not None", BALL, None),
        case("must be a number", BALL, [0.1, 0.2]),
        case("no source was given", [], 0.1, error=sh.errors.SourceError),
        case("no source was given", [], 0.1, BALL, error=sh.errors.SourceError),
        case("not to a NoneType", None, 0.1, error=sh.errors.SourceError),
        case("not to a Field", HEIGHT, 0.1, error=sh.errors.SourceError),
        case("pass that surface as the domain", RING, 0.1, error=sh.errors.SourceError),
        case("whole number of at least 2", BALL, 0.1, resolution=1, error=sh.errors.GeometryError),
        case("lower resolution", BALL, 0.1, resolution=100_000, error=sh.errors.MemoryLimitError),
        case("is not a domain", BALL, 0.1, "grid", error=sh.errors.UnsupportedTypeError),
        case("3 dimensions, and the grid in 2", BALL, 0.1, PLANE, error=sh.errors.SourceError),
        case("measured to a Curve", BALL, 0.1, BALL, error=sh.errors.SourceError),
        case("not to a Curve", RING, 0.1, GRID, error=sh.errors.SourceError),
        case("level -?9", RING, 9.0, BALL, error=sh.errors.OutsideError),
        case("leaves the grid|level -?5", BALL, 5.0, GRID, error=sh.errors.OutsideError),
    ],
)
def test_growing_and_shrinking(operation, arguments, keywords, error):
    with refused(error):
        operation(*arguments, **keywords)


@pytest.mark.parametrize(
    ("arguments", "keywords", "error"),
    [
        case("inner distance must be finite", BALL, NAN, 1),
        case("outer distance must be finite", BALL, 0, INF),
        case("inner distance must be a number", BALL, "a", 1),
        case("inner < outer, not 1 and 0: swap", BALL, 1, 0),
        case("inner < outer", BALL, 0, 0),
        case("raise the resolution", BALL, 0, 0.01, resolution=24),
        case("not to a NoneType", None, 0, 0.3, error=sh.errors.SourceError),
        case("no source was given", [], 0, 0.3, error=sh.errors.SourceError),
        case("pass that surface", RING[0], 0, 0.3, error=sh.errors.SourceError),
        case("not on a TriangleMesh", BALL, 0, 0.3, BALL, error=sh.errors.UnsupportedTypeError),
        case("not on a TetMesh", BALL, 0, 0.3, BOX, error=sh.errors.UnsupportedTypeError),
        case("3 dimensions, and the grid in 2", BALL, 0, 0.3, PLANE, error=sh.errors.SourceError),
    ],
)
def test_shell(arguments, keywords, error):
    with refused(error):
        sh.morphology.shell(*arguments, **keywords)


@pytest.mark.parametrize(
    ("arguments", "keywords", "error"),
    [
        case("reach above must be finite and not negative, not nan", BALL, NAN),
        case("reach above must be finite and not negative, not -1", BALL, -1),
        case("reach below must be finite and not negative, not inf", BALL, 0.1, INF),
        case("reach above must be a number", BALL, None),
        case("by nothing", BALL, 0),
        case("raise the resolution", BALL, 0.01, resolution=24),
        case("no source was given", [], 0.3, error=sh.errors.SourceError),
        case("rows differ in length", BALL, 0.3, faces=[[1], [2, 3]], error=sh.errors.SourceError),
        case("a PointCloud has none", POINTS, 0.3, resolution=24, error=sh.errors.SourceError),
        case("a Polyline has none", sh.Polyline([[0, 0], [1, 0]]), 0.3, resolution=24, error=sh.errors.SourceError),
        case("not on a TetMesh", BALL, 0.3, None, BOX, error=sh.errors.UnsupportedTypeError),
        case("2 dimensions of the grid", BALL, 1.0, None, PLANE, error=sh.errors.SourceError),
    ],
)
def test_thicken(arguments, keywords, error):
    with refused(error):
        sh.morphology.thicken(*arguments, **keywords)


@pytest.mark.parametrize(
    ("arguments", "keywords", "error"),
    [
        *(
            case(f"not a {type(domain).__name__}", domain, RING, error=sh.errors.UnsupportedTypeError)
            for domain in (None, POINTS, GRID, BOX, sh.DigitalSurface(np.ones((2, 2, 2), bool)))
        ),
        case("no source was given", BALL, [], error=sh.errors.SourceError),
        case("no empty lists", BALL, [[]], error=sh.errors.SourceError),
        case("source 0 is a NoneType", BALL, None, error=sh.errors.SourceError),
        case("source 0 is a TriangleMesh", BALL, BALL, error=sh.errors.SourceError),
        case("another mesh", BALL, sh.Curve([9999, 9999], [[1, 0, 0], [0, 1, 0]]), error=sh.errors.SourceError),
        case("diffusion must be finite", BALL, RING, diffusion=NAN),
        case("diffusion must be positive", BALL, RING, diffusion=-1),
        case("diffusion must be a number", BALL, RING, diffusion="x"),
        case("smooth must be True or False", BALL, RING, smooth="x"),
        case(
            "no area",
            sh.TriangleMesh([[0, 0, 0]] * 3, [[0, 1, 2]]),
            sh.Curve([0, 0], [[1, 0, 0], [0, 1, 0]]),
            error=sh.errors.GeometryError,
        ),
    ],
)
def test_piecewise_distance(arguments, keywords, error):
    domain, sources = arguments
    with refused(error):
        sh.piecewise_distance(sources, domain, **keywords)


@pytest.mark.parametrize(
    ("arguments", "keywords", "error"),
    [
        case("not on a NoneType", None, RING, error=sh.errors.UnsupportedTypeError),
        case("not on a Grid", GRID, RING, error=sh.errors.UnsupportedTypeError),
        case("curves first", RING, BALL, error=sh.errors.UnsupportedTypeError),
        case("no source was given", BALL, [], error=sh.errors.SourceError),
        case("source 0 is a NoneType", BALL, None, error=sh.errors.SourceError),
        case("source 0 is a TriangleMesh", BALL, BALL, error=sh.errors.SourceError),
        case("orient the curves", BALL, BALL.path([0, 5], oriented=False), error=sh.errors.SourceError),
        case("orient the curves", BALL, BALL.points_at([3]), error=sh.errors.SourceError),
        case("diffusion must be finite", BALL, RING, diffusion=NAN),
        case("is not a constraint", BALL, RING, constraint="zero", error=sh.errors.UnsupportedTypeError),
        case(
            "is not a constraint", BALL, RING, constraint=sh.constraints.ZeroSet, error=sh.errors.UnsupportedTypeError
        ),
        case(
            "3 level values",
            BALL,
            RING,
            constraint=sh.constraints.LevelValues([0, 1, 2]),
            error=sh.errors.ConstraintError,
        ),
    ],
)
def test_close_curves(arguments, keywords, error):
    domain, sources = arguments
    with refused(error):
        sh.close_curves(sources, domain, **keywords)


SOLID = sh.complete(BALL)


@pytest.mark.parametrize(
    "distance",
    [["a"] * BALL.n_vertices, [0.1, [0.2]], np.full(BALL.n_vertices, 1j), [None] * BALL.n_vertices, np.array("1"),
     np.array(True), np.ma.masked_less(np.full(BALL.n_vertices, 0.1), 1)],
)  # fmt: skip
def test_distances_of_an_offset(distance):
    with refused(sh.errors.SignedHeatError):
        sh.offset(SOLID, distance, resolution=12)


@pytest.mark.parametrize("sources", [RING[0], BALL, None, 3])
def test_several_sources_are_a_list(sources):
    with refused(sh.errors.SourceError):
        sh.SignedHeatSolver(BALL).distance_many(sources)


def test_numbers_are_not_missing_or_text():
    for value in (None, "1"):
        with refused(sh.errors.GeometryError, element="values"):
            sh.Field(sh.Grid(0.0, 1.0, 2), np.array([0.0, value], dtype=object))


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: sh.complete(BALL, lids="round"), "lids"),
        (lambda: sh.sample_distances(BALL, 10).save("samples.npz", layout="columns"), "layout"),
        (lambda: sh.signed_distance(sh.Polyline([[0, 0], [1, 0], [0, 1]], closed=True), PLANE, fill="odd"), "fill"),
    ],
)
def test_words_are_those_of_a_list(call, name):
    with refused(sh.errors.SignedHeatError) as caught:
        call()
    assert caught.value.element == name and " or " in str(caught.value)


@pytest.mark.parametrize("value", ["yes", 2**70, 1.0, None, np.zeros(3)], ids=lambda value: type(value).__name__)
@pytest.mark.parametrize(
    ("call", "name"),
    [
        *((lambda **flags: sh.complete(BALL, **flags), name) for name in ("as_oriented", "keep_overlaps")),
        *((lambda **flags: sh.signed_distance(RING, BALL, **flags), name) for name in ("as_oriented", "every_piece")),
        *((lambda **flags: sh.close_curves(RING, BALL, **flags), name) for name in ("as_oriented", "every_piece")),
        (lambda **flags: SOLID.surface(resolution=8, **flags), "sharp"),
        (lambda **flags: sh.intrinsic_delaunay(BALL, **flags), "refine"),
    ],
)
def test_flags_are_true_or_false(call, name, value):
    with refused(sh.errors.SignedHeatError, element=name):
        call(**{name: value})


def with_one(values, value):
    values = np.array(values, dtype=float)
    values.ravel()[5] = value
    return values


ROUND = np.linalg.norm(GRID.points, axis=-1) - 1


@pytest.mark.parametrize(
    ("arguments", "keywords", "error"),
    [
        case("a NoneType cannot be sharpened", None, error=sh.errors.UnsupportedTypeError),
        case("a TriangleMesh cannot be sharpened", BALL, error=sh.errors.UnsupportedTypeError),
        case(
            "on a CutSurface cannot be sharpened",
            sh.piecewise_distance(RING, BALL),
            error=sh.errors.UnsupportedTypeError,
        ),
        case("cannot be sharpened", sh.Field(GRID, with_one(ROUND, INF)), error=sh.errors.GeometryError),
        case("one sign", sh.Field(GRID, 0 * ROUND + 1), error=sh.errors.OutsideError),
        case(
            "infinite at vertex 5",
            sh.Field(BALL, with_one(BALL.vertices[:, 2], INF)),
            error=sh.errors.GeometryError,
        ),
        case("no value anywhere", sh.Field(BALL, np.full(BALL.n_vertices, NAN)), error=sh.errors.OutsideError),
        case("one sign", sh.Field(BALL, np.zeros(BALL.n_vertices)), error=sh.errors.OutsideError),
        case("infinite at vertex 5", sh.Field(BOX, with_one(BOX.vertices[:, 2], INF)), error=sh.errors.GeometryError),
        case("no value anywhere", sh.Field(BOX, np.full(BOX.n_vertices, NAN)), error=sh.errors.OutsideError),
        case("one sign", sh.Field(BOX, np.zeros(BOX.n_vertices)), error=sh.errors.OutsideError),
        case("comes without one", HEIGHT, method=sh.methods.Convex(), error=sh.errors.SourceError),
        case(
            "comes without one",
            sh.Field(BOX, BOX.vertices[:, 0]),
            method=sh.methods.Convex(),
            error=sh.errors.SourceError,
        ),
        case("not a method of sharpening", HEIGHT, method="convex", error=sh.errors.UnsupportedTypeError),
        case("not a method of sharpening", HEIGHT, method=sh.methods.Convex, error=sh.errors.UnsupportedTypeError),
    ],
)
def test_sharpen(arguments, keywords, error):
    with refused(error):
        sh.sharpen(*arguments, **keywords)


def test_methods_are_for_surfaces_and_tets():
    with refused(sh.errors.UnsupportedTypeError):
        sh.sharpen(sh.Field(GRID, ROUND), method=sh.methods.Convex())


@pytest.mark.parametrize(
    "make",
    [
        lambda: sh.methods.Convex(tolerance=NAN),
        lambda: sh.methods.Convex(tolerance=0),
        lambda: sh.methods.Convex(max_rounds=0),
        lambda: sh.methods.Convex(max_rounds=2.5),
        lambda: sh.methods.Convex(relaxation=2.0),
        lambda: sh.methods.Geodesic(-1),
        lambda: sh.methods.Geodesic(NAN),
        lambda: sh.methods.Geodesic("x"),
    ],
)
def test_methods(make):
    with refused(sh.errors.SignedHeatError):
        make()


@pytest.fixture
def folder(tmp_path):
    BALL.save(tmp_path / "ball.ply")
    sh.io.write_curves(RING, tmp_path / "ring.json", BALL)
    sh.io.write_curves([BALL.points_at([3])], tmp_path / "points.json", BALL)
    for name in ("ball.ply", "ring.json"):
        whole = (tmp_path / name).read_bytes()
        (tmp_path / f"cut-{name}").write_bytes(whole[: len(whole) * 2 // 3])
        (tmp_path / f"empty-{name}").write_bytes(b"")
    header = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    faces = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "nan.ply").write_bytes(header + faces + b"0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n")
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    (tmp_path / "bare.xyz").write_text("0 0 0\n1 0 0\n0 1 0\n")
    (tmp_path / "arc.csv").write_text("0,0\n1,0\n1,1\n")
    BOX.save(tmp_path / "box.mesh")
    (tmp_path / "folder").mkdir()
    return tmp_path


MORPH = [
    ("dilate missing.ply 0.1 -o out.stl", 1, "missing.ply: there is no such file"),
    ("dilate cut-ball.ply 0.1 -o out.stl", 1, "cut-ball.ply"),
    ("dilate empty-ball.ply 0.1 -o out.stl", 1, "the file is empty"),
    ("dilate nan.ply 0.1 -o out.stl", 1, "nan.ply: 1 of 3 vertices hold NaN"),
    ("dilate ring.json 0.1 -o out.stl", 1, "not a known format"),
    ("dilate folder 0.1 -o out.stl", 1, "no extension"),
    ("dilate ball.ply 0.1 -o out.docx", 1, "not a known format"),
    ("dilate ball.ply 0.1 -o nowhere/out.stl", 1, "cannot be written"),
    ("dilate ball.ply 0.1 -o out.xyz", 1, "not a known format"),
    ("dilate ball.ply -0.1 -o out.stl", 1, "not negative"),
    ("dilate ball.ply nan -o out.stl", 2, "not a finite number"),
    ("dilate ball.ply inf -o out.stl", 2, "not a finite number"),
    ("dilate ball.ply -o out.stl", 2, "DISTANCE"),
    ("dilate ball.ply 0.1 0.2 -o out.stl", 2, "takes 1, not 2"),
    ("grow ball.ply 0.1 -o out.stl", 2, "invalid choice"),
    ("dilate ball.ply 0.1", 2, "--output"),
    ("dilate ball.ply 0.1 -o out.stl --resolution 1", 2, "whole number"),
    ("erode ball.ply 3 -o out.stl --resolution 16", 1, "ball.ply: "),
    ("shell ball.ply 0.3 0.1 -o out.stl", 1, "inner < outer"),
    ("thicken ball.ply 0 -o out.stl", 1, "thickness"),
    ("thicken ball.ply 0.1 -0.2 -o out.stl", 1, "not negative"),
]
CLOSE = [
    ("missing.ply ring.json -o out.obj", 1, "missing.ply: there is no such file"),
    ("ball.ply missing.json -o out.obj", 1, "missing.json: there is no such file"),
    ("cut-ball.ply ring.json -o out.obj", 1, "cut-ball.ply"),
    ("ball.ply cut-ring.json -o out.obj", 1, "cut-ring.json"),
    ("ball.ply empty-ring.json -o out.obj", 1, "the file is empty"),
    ("nan.ply ring.json -o out.obj", 1, "nan.ply: 1 of 3 vertices hold NaN"),
    ("ball.ply points.json -o out.obj", 1, "points.json: curves without sides"),
    ("ball.ply ring.json -o out.stl", 1, "not a known format"),
    ("ball.ply ring.json -o nowhere/out.obj", 1, "cannot be written"),
    ("ball.ply ring.json -o out.obj --preview out.docx", 1, "not a known format"),
    ("ball.ply ring.json", 2, "--output"),
    ("ball.ply ring.json -o out.obj --diffusion -1", 2, "not positive"),
    ("ball.ply ring.json -o out.obj --diffusion nan", 2, "not a finite number"),
    ("ball.ply ring.json -o out.obj --constraint hopeful", 2, "not one of"),
    ("ball.ply ring.json -o out.obj --constraint each-component --every-piece", 2, "do not go together"),
    ("ball.ply ring.json -o out.obj --constraint levels:1,2,3", 1, "ring.json: 3 level values"),
]

SURFACE = [
    ("missing.ply ring.json -o out.ply", 1, "there is no such file"),
    ("ball.ply missing.json -o out.ply", 1, "there is no such file"),
    ("box.mesh ring.json -o out.ply", 1, "not on a TetMesh"),
    ("ball.ply ring.json -o out.docx", 1, "use one of"),
    ("ball.ply ring.json -o out.ply --diffusion=-1", 2, "not positive"),
    ("ball.ply ring.json -o out.ply --up x", 2, "--up goes with --preview"),
    ("ball.ply ring.json -o out.ply --plain --as-oriented", 2, "--as-oriented and --plain do not go together"),
    ("ball.ply ring.json -o out.ply --constraint levels:1 --every-piece", 2, "do not go together"),
    ("ball.ply ring.json -o out.ply --constraint levels:a", 2, "not a finite number"),
    ("ball.ply ring.json -o out.ply --constraint soft:-1", 2, "argument --constraint: -1 is not positive ("),
    (
        "ball.ply ring.json -o out.ply --constraint zero",
        2,
        "free, zero-set, hard, each-component, soft, soft:WEIGHT, l",
    ),
]
VOLUME = [
    ("ball.ply", 2, "--output"),
    ("flat.obj -o out.npz --resolution 16", 1, "flat.obj"),
    ("bare.xyz -o out.npz --resolution 16", 1, "bare.xyz"),
    ("ball.ply -o out.npz --spacing 0", 2, "not positive"),
    ("ball.ply -o out.npz --spacing 0.1 0.1", 2, "--spacing: 1 or 3"),
    ("ball.ply -o out.npz --resolution 1_6", 2, "whole number"),
    ("ball.ply -o out.npz --resolution １６", 2, "whole number"),
    ("ball.ply -o out.npz --spacing 1_0", 2, "not a finite number"),
    ("ball.ply -o out.npz --spacing １", 2, "not a finite number"),
    ("ball.ply -o out.npz --spacing -１e-1", 2, "--spacing"),
    ("ball.ply -o out.npz --transform 1_0 0 0 0 0 1 0 0 0 0 1 0", 1, "a transform has 16 numbers"),
    ("ball.ply -o out.npz --resolution 16 --spacing 0.1", 2, "do not go together"),
    ("ball.ply -o out.npz --origin 0 0 0", 2, "--origin, --spacing and --shape"),
    ("ball.ply -o out.npz --diffusion 0", 2, "not positive"),
    ("ball.ply -o out.npz --constraint loose", 2, "not one of"),
    ("ball.ply -o out.npz --constraint soft:-1", 2, "not positive"),
    ("arc.csv -o out.npz --spacing 0.1 0.1 0.1", 2, "--spacing: 1 or 2"),
    ("arc.csv -o out.npz --origin 0 --spacing 1 --shape 5 5", 2, "--origin: 2"),
    ("arc.csv -o out.npz --origin 0 0 --spacing 1 --shape 5", 2, "--shape: 2"),
    ("ball.ply -o out.vtu --tets --spacing 0.1", 2, "--tets"),
    ("ball.ply -o out.npz --format vti", 2, "--format is the format of standard output"),
    ("ball.ply -o out.npz --from ply", 2, "--from is the format of standard input"),
    ("ball.ply -o out.npz --tiles folder", 2, "--tiles goes with --band"),
    ("ball.ply -o out.npz --band 1 --workers 2", 2, "--workers goes with --tiles"),
    ("ball.ply -o out.vtu --tets ball.ply", 1, "holds no tets"),
]
OTHERS = [
    ("inflate", 2, "invalid choice"),
    ("offset arc.csv 0.1 -o out.stl", 1, "lines in the plane"),
    ("morph dilate ball.ply 0.1 -o out.stl --spacing 0.1 --resolution 20", 2, "do not go together"),
    ("morph dilate ball.ply 0.1 -o out.stl --spacing 0.1 0.1", 2, "--spacing"),
    ("morph dilate ball.ply 0.1 -o out.stl --drain 1", 2, "for shells"),
    ("morph thicken ball.ply 0.1 -o out.stl --plain", 2, "for solids"),
    ("morph thicken ball.ply 0.1 -o out.stl --diffusion 2", 2, "--diffusion is for solids"),
    ("sample ball.ply -o out.npz --near 2", 2, "more than 1"),
    ("sample ball.ply -o out.npz --widths=-1", 2, "negative"),
    ("sample ball.ply -o out.npz -n 0", 2, "whole number"),
    ("sample ball.ply -o out.npz --mask a.npy", 2, "sample: unrecognized"),
    ("sample ball.ply -o out.npz --constraint each-component", 1, "distance to a shape is zero on all of it"),
    ("sample ball.ply -o out.txt", 1, "not a known format"),
    ("batch ball.ply -o made", 2, "no results"),
    ("batch ball.ply -o made --sample --plain", 2, "plain"),
    ("batch ball.ply -o made --info --workers 2 --scheduler tcp://localhost:1", 2, "do not go together"),
    ("batch ball.ply -o made --volume --spacing 0.1 --resolution 16", 2, "do not go together"),
    ("batch ball.ply -o made --volume --spacing 0.1 0.1", 2, "--spacing"),
    ("batch ball.ply -o made --volume stl", 2, "invalid choice"),
    ("batch ball.ply -o made --volume --seed 3", 2, "--seed goes with --sample"),
    ("batch ball.ply -o made --info --band 1", 2, "--band goes with --volume, --offset or --sample"),
    ("batch ball.ply -o made --volume --surface ply", 2, "--surface goes with --offset"),
    ("watertight ball.ply -o made.stl --label 2", 1, "only images have labels"),
    ("watertight ball.ply -o made --resolution 9 --spacing 1", 2, "do not go together"),
    ("watertight ball.ply -o made --thickness=-1", 2, "not positive"),
    ("watertight ball.ply -o made.glb", 2, "closed meshes are written as"),
    ("watertight ball.ply -o made --surface txt", 2, "invalid choice"),
]
TABLES = {"morph ": MORPH, "close ": CLOSE, "surface ": SURFACE, "volume ": VOLUME, "": OTHERS}


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [(command + words, *ends) for command, table in TABLES.items() for words, *ends in table],
)
def test_commands(folder, monkeypatch, capsys, words, status, message):
    """One line that names the file, a status, and an output that was there before is still there."""
    monkeypatch.chdir(folder)
    for name in ("out.stl", "out.obj"):
        (folder / name).write_text("precious")
    before = sorted(path.name for path in folder.iterdir())
    try:
        found = main(words.split())
    except SystemExit as end:
        found = end.code
    said = capsys.readouterr().err
    assert found == status
    assert message in said and said.count("\n") == 1 and "Traceback" not in said
    assert sorted(path.name for path in folder.iterdir()) == before
    assert all((folder / name).read_text() == "precious" for name in ("out.stl", "out.obj"))


def test_curves_are_not_measured_on_grids():
    with refused(sh.errors.SourceError, "source 0"):
        sh.signed_distance(RING, GRID)
