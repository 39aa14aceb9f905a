"""Words, numbers and functions that are given as arguments: refused by name where they are not what they must be."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction
from functools import partial
from typing import get_args

import numpy as np
import pytest

import signedheat as sh
from public_names import PUBLIC, methods
from refusals import refused
from signedheat import batches, constraints, morphology, samples, view
from signedheat.cli import main
from signedheat.errors import GeometryError, SignedHeatError, UnsupportedTypeError
from signedheat.methods import Convex, Extrapolated, Geodesic

BALL = samples.sphere(1)
GRID = sh.Grid((-1.5,) * 3, 0.5, (7, 7, 7))
PLANE = sh.Grid((-1, -1), 0.25, (13, 13))
LINE = sh.Polyline([[0, 0], [1, 0], [1, 1]], closed=True)
CURVE = BALL.path([0, 9, 20])
SOLID = sh.complete(BALL)
TETS = sh.tetrahedralize(BALL, resolution=3)
CLOUD = samples.oriented_points(BALL, 60)
BOWL = samples.without_faces(BALL, 0.3)
VOXELS = sh.DigitalSurface(np.ones((2, 2, 2), dtype=bool))
SQUARES = VOXELS.squares
IMAGE = sh.io.LabelImage(np.pad(np.full((2, 2, 2), 7), 1), np.eye(3), np.zeros(3))
ROUND = np.linalg.norm(GRID.points, axis=-1) - 1
FIELDS = {
    "grid": sh.SignedHeatSolver(GRID).distance(BALL),
    "exact": sh.signed_distance(BALL, GRID),
    "plane": sh.signed_distance(LINE, PLANE),
    "surface": sh.SignedHeatSolver(BALL).distance(CURVE),
    "tets": sh.SignedHeatSolver(TETS).distance(BALL),
}

WORDS = {
    "nested": [partial(sh.orientation, BALL), partial(sh.complete, BALL), partial(sh.signed_distance, BALL, GRID)],
    "lids": [partial(sh.complete, BALL), partial(sh.signed_distance, BALL, GRID), partial(sh.fill_holes, BALL)],
    "completion": [partial(sh.complete, BALL), partial(sh.signed_distance, BALL, GRID)],
    "corners": [partial(sh.offset, BALL, 0.1), partial(SOLID.offset, 0.1)],
    "side": [partial(sh.morphology.thicken, BALL, 0.1)],
    "fill": [partial(sh.signed_distance, LINE, PLANE)],
    "intrinsic": [
        partial(sh.SignedHeatSolver, BALL),
        partial(sh.signed_distance, CURVE, BALL),
        partial(sh.piecewise_distance, CURVE, BALL),
    ],
    "layout": [partial(sh.sample_distances(BALL, 10).save, "a.npz"), batches.Sampling],
}
for name in ("nested", "lids", "completion"):
    WORDS[name].append(partial(batches.Job, volume=".npz"))
"""Calls that take one of some words."""


@pytest.mark.parametrize("name", WORDS)
@pytest.mark.parametrize(
    "word",
    ["abc", "", "Round", None, 3.0, b"round", ["round"], {}, np.zeros(3), np.zeros(2, "f8,f8"), np.nan],
    ids=repr,
)
def test_words(name, word):
    for call in WORDS[name]:
        with refused(SignedHeatError, element=name):
            call(**{name: word})


def parameters():
    """Each public function, class and method with its parameters: names, functions, names and annotations of these."""
    for name, function in [*PUBLIC, *methods()]:
        try:
            listed = inspect.signature(function).parameters.values()
        except (TypeError, ValueError):
            continue
        for parameter in listed:
            yield name, function, parameter.name, str(parameter.annotation)


def test_all_words_of_public_functions_are_tested():
    called = {(getattr(call, "func", call), name) for name, calls in WORDS.items() for call in calls}
    called = {(getattr(function, "__func__", function), name) for function, name in called}
    for name, function, parameter, annotation in parameters():
        kind = vars(inspect.getmodule(function)).get(annotation.rpartition(".")[2])
        if "Literal['auto']" in annotation or (
            get_args(kind) and all(isinstance(word, str) for word in get_args(kind))
        ):
            assert (function, parameter) in called or name.startswith("batches.Outcome"), (name, parameter)


def levelled(mesh):
    return partial(mesh.level_set, np.asarray(mesh.vertices if hasattr(mesh, "vertices") else mesh.points)[:, 2])


BOX = [[-2] * 3, [2] * 3]
RANDOM = [samples.without_faces, samples.with_noise, samples.with_flipped_faces, samples.with_duplicate_faces]
RANDOM += [samples.soup, samples.oriented_points]
NUMBERS = [
    (samples.sphere, "subdivisions"), (partial(samples.sphere, 1), "radius"), (samples.duck, "n"),
    *((samples.torus, name) for name in ("major", "minor", "n_around", "n_across")),
    (partial(samples.without_patches, BALL, radius=0.3), "n_patches"),
    *((partial(samples.without_patches, BALL, 1), name) for name in ("radius",)),
    (partial(samples.without_patches, BALL, 1, 0.3), "seed"),
    *((partial(function, BALL), name) for function, name in zip(
        RANDOM, ("fraction", "amplitude", "fraction", "fraction", "jitter", "n_points"), strict=True)),
    *((partial(function, BALL, 1), "seed") for function in RANDOM),
    *((partial(sh.DigitalSurface, np.ones((2, 2, 2), dtype=bool)), name) for name in ("radius", "spacing")),
    (partial(sh.PointCloud, CLOUD.points), "n_neighbors"), (partial(sh.close_curves, CURVE, BALL), "diffusion"),
    *((partial(sh.complete, BALL), name) for name in ("seal", "smallest", "diffusion")),
    (partial(sh.contour, lambda p: np.linalg.norm(p, axis=-1) - 1, BOX, 0.5), "level"),
    (partial(sh.contour, lambda p: np.linalg.norm(p, axis=-1) - 1, BOX), "resolution"),
    (partial(sh.contour, lambda p: np.linalg.norm(p, axis=-1) - 1, BOX), "spacing"),
    (partial(sh.fill_holes, BALL), "largest"),
    *((partial(sh.intrinsic_delaunay, BALL, refine=True), name) for name in ("angle", "max_vertices")),
    (partial(sh.offset, BALL), "distance"), (partial(sh.offset, BALL, 0.1), "resolution"),
    (partial(sh.piecewise_distance, CURVE, BALL), "diffusion"),
    *((partial(sh.sample_distances, BALL, **({} if name == "n" else {"n": 9})), name)
      for name in ("n", "near", "seed")),
    *((partial(sh.signed_distance, BALL), name) for name in ("resolution", "spacing")),
    *((partial(sh.signed_distance, BALL, resolution=8), name) for name in ("padding", "band")),
    (partial(sh.signed_distance, CURVE, BALL), "diffusion"), (partial(sh.SignedHeatSolver, BALL), "diffusion"),
    (partial(sh.tetrahedralize, BALL), "resolution"), (partial(sh.tetrahedralize, BALL, resolution=3), "padding"),
    (partial(sh.wall_thickness, BALL), "resolution"),
    *((partial(batches.Job, volume=".npz"), name)
      for name in ("resolution", "spacing", "padding", "band", "diffusion")),
    *((batches.Sampling, name) for name in ("n", "near", "seed")),
    *((batches.Watertight, name) for name in (
        "thickness", "tolerance", "resolution", "spacing", "seal", "smallest", "samples", "label")),
    *((partial(batches.run, "a", "b", batches.Watertight()), name) for name in ("workers", "threads", "time_limit")),
    (constraints.Soft, "weight"), (Extrapolated, "tau"), (Geodesic, "tolerance"),
    *((Convex, name) for name in ("tolerance", "max_rounds", "relaxation")),
    *((partial(function, BALL), "distance") for function in (
        morphology.dilate, morphology.erode, morphology.opening, morphology.closing)),
    *((partial(function, BALL, 0.1), "resolution") for function in (
        morphology.dilate, morphology.erode, morphology.opening, morphology.closing)),
    (partial(morphology.extrude, BOWL), "to"), (partial(morphology.shell, BALL, outer=0.5), "inner"),
    (partial(morphology.shell, BALL, 0.0), "outer"), (partial(morphology.shell, BALL, 0.0, 0.5), "drain"),
    (partial(morphology.shell, BALL, 0.0, 0.5), "resolution"), (partial(morphology.thicken, BOWL, 0.2), "resolution"),
    (partial(morphology.thicken, BOWL), "above"), (partial(morphology.thicken, BOWL, 0.2), "below"),
    *((partial(function, FIELDS["grid"], FIELDS["grid"]), "width") for function in (
        morphology.smooth_union, morphology.smooth_intersection, morphology.smooth_difference)),
    *((levelled(domain), "level") for domain in (BALL, CLOUD, VOXELS, SQUARES, sh.intrinsic_delaunay(BALL))),
    *((partial(domain.polyline, BALL.vertices[:3]), "max_distance") for domain in (BALL, CLOUD, VOXELS, SQUARES)),
    (FIELDS["grid"].contour, "level"), (FIELDS["grid"].offset, "distance"), (partial(sh.Field.save_contour,
        FIELDS["grid"], "a.ply"), "level"),
    *((partial(sh.Grid.around, BALL.bounds, **({"resolution": 8} if name == "padding" else {})), name) for name in (
        "resolution", "padding")),
    (partial(sh.Grid, np.zeros(3), shape=(3, 3, 3)), "spacing"), (partial(sh.redistance, ROUND), "spacing"),
    *((SOLID.field, name) for name in ("resolution", "spacing")), (partial(SOLID.field, 16), "padding"),
    (partial(SOLID.field, 16), "band"), (SOLID.offset, "distance"), (partial(SOLID.offset, 0.1), "resolution"),
    (partial(SOLID.surface, resolution=8), "level"), (SOLID.surface, "resolution"),
    (partial(SOLID.surface, resolution=8), "tolerance"), (IMAGE.surface, "label"),
    (partial(sh.sample_distances, BALL, 10), "widths"), (batches.Sampling, "widths"),
    (sh.orientation(CURVE, BALL).agreeing, "least"), (sh.wall_thickness(BALL, resolution=8).below, "least"),
    (sh.deviation(BALL, BALL).histogram, "bins"), (sh.deviation(BALL, BALL).worst, "n"),
    (sh.deviation(BALL, BALL).within, "tolerance"), *((sh.io.Budget, name) for name in (
        "bytes", "elements", "points", "seconds")),
]  # fmt: skip
"""Calls that take a number, and its name."""
PICTURES = [
    (partial(view.save_surface, FIELDS["surface"], "a.png"), "n_contours"),
    (partial(view.save_surface, FIELDS["surface"], "a.png"), "up"), (partial(view.save_scene, BALL, "a.png"), "up"),
    (partial(view.save_slices, FIELDS["grid"], "a.png"), "levels"),
    (partial(view.save_slices, FIELDS["plane"], "a.png"), "levels"),
    *((partial(view.new_figure, **{other: 3.0}), name) for name, other in (("width", "height"), ("height", "width"))),
]  # fmt: skip
UNCHECKED = "results|Solid|IntrinsicTriangulation|batches.Batch|batches.Outcome"
"""Classes that functions of this package make, from numbers of their own."""
ELSEWHERE = {"read_step": {"deflection"}, "read_volume": {"level", "radius"}, "tetrahedralize": {"grading"}}
ELSEWHERE |= {"intrinsic_delaunay": {"coarsest"}, "around": {"resolution", "padding"}}
"""Numbers that files need to be read, that may be infinite, or that a class passes on."""


@pytest.mark.parametrize(("call", "name"), NUMBERS, ids=lambda thing: thing if isinstance(thing, str) else "")
def test_numbers_are_finite_and_real(call, name):
    for number in (np.nan, -np.inf, np.inf, "0.5", b"1", 0.5j, 10**400, 10**5000, object(), {}, np.datetime64("now")):
        with refused(SignedHeatError, element=name):
            call(**{name: number})
    for number in (True, np.True_, [0.5], np.array([0.5])) if name != "widths" else ():
        if name in ("spacing", "distance") and not isinstance(number, bool | np.bool_):
            continue  # one for each axis, or vertex
        with refused(SignedHeatError, element=name):
            call(**{name: number})


@pytest.mark.parametrize(("call", "name"), PICTURES, ids=lambda thing: thing if isinstance(thing, str) else "")
def test_numbers_of_pictures(tmp_path, monkeypatch, call, name):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    wrong = [np.nan, np.inf, "x", 0.5j, -1, 0.5, 1001, 10**400, True, [1]]
    for number in wrong[:4] if name == "levels" else wrong[:5] if name in ("width", "height") else wrong:
        with refused(SignedHeatError, element=name):
            call(**{name: [number] if name == "levels" else number})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "call",
    [
        partial(samples.sphere, 20),
        partial(samples.sphere, 10**6),
        partial(samples.torus, n_around=10**6, n_across=10**6),
        partial(samples.duck, 10**5),
    ],
)
def test_samples_larger_than_memory(call):
    with refused(sh.errors.MemoryLimitError):
        call()


def test_numbers_of_every_kind():
    half = sh.complete(BALL, smallest=0.5).volume
    for number in (Fraction(1, 2), np.float32(0.5), np.array(0.5), np.float64(0.5)):
        assert sh.complete(BALL, smallest=number).volume == half
        assert sh.Grid(np.zeros(3), number, (3, 3, 3)).spacing.tolist() == [0.5] * 3
        assert batches.Job(offsets=number).offsets == (0.5,)
    with refused(SignedHeatError, element="smallest"):
        sh.complete(BALL, smallest=Decimal("0.5"))  # no `numbers.Real`


def test_all_numbers_of_public_functions_are_tested():
    called = set()
    for call, name in NUMBERS:
        function = getattr(call, "func", call)
        called.add((getattr(function, "__func__", function), name))
    for name, function, parameter, annotation in parameters():
        if re.match(r"(float|int)\b", annotation) and not re.match(UNCHECKED, name):
            function = getattr(function, "__func__", function)
            is_elsewhere = parameter in ELSEWHERE.get(function.__name__, ())
            assert is_elsewhere or (function, parameter) in called, (name, parameter)


REPORTING = {
    "volume": partial(sh.signed_distance, BALL, GRID),
    "curves": partial(sh.signed_distance, CURVE, BALL),
    "plane": partial(sh.signed_distance, LINE, PLANE),
    "tets": partial(sh.signed_distance, BALL, TETS),
    "in a band": partial(sh.signed_distance, BALL, resolution=32, band=0.1),
    "points": partial(sh.signed_distance, CLOUD, GRID),
    "unsigned": partial(sh.signed_distance, BALL, GRID, completion="none"),
    "to a solid": partial(sh.signed_distance, SOLID, GRID),
    "complete": partial(sh.complete, BALL),
    "complete points": partial(sh.complete, CLOUD),
    "complete by heat": partial(sh.complete, BOWL, completion="heat"),
    "complete nothing": partial(sh.complete, BALL, completion="none"),
    "complete a solid": partial(sh.complete, SOLID),
    "complete and seal": partial(sh.complete, BALL, seal=0.1),
    "piecewise": partial(sh.piecewise_distance, CURVE, BALL),
    **{f"sharpen {name}": partial(sh.sharpen, field) for name, field in FIELDS.items() if name != "plane"},
    "sharpen by rounds": partial(sh.sharpen, FIELDS["surface"], method=Geodesic()),
    "solver": lambda progress: sh.SignedHeatSolver(BALL, progress=progress).distance(CURVE),
    "solver on a grid": lambda progress: sh.SignedHeatSolver(GRID, progress=progress).distance(BALL),
    "solver on tets": lambda progress: sh.SignedHeatSolver(TETS, progress=progress).distance(BALL),
    "deviation": partial(sh.deviation, BALL, BALL),
    "deviation of points": partial(sh.deviation, CLOUD, SOLID),
    "offset": partial(sh.offset, BALL, 0.1, resolution=8),
    "of solid": partial(SOLID.offset, 0.1, resolution=8),
    "field": partial(SOLID.field, 8),
    "band": partial(SOLID.field, 40, band=0.1),
    "surface": SOLID.surface,
    "contoured": partial(SOLID.surface, spacing=0.3),
    "intrinsic": partial(sh.intrinsic_delaunay, BALL),
}


@pytest.mark.filterwarnings("ignore:the region depends")  # the open curve closes by a guess
@pytest.mark.parametrize("name", REPORTING)
def test_progress_is_called_or_refused(name):
    seen = []
    REPORTING[name](progress=lambda fraction, step: seen.append(fraction))
    assert seen and min(seen) >= 0.0 and seen == sorted(seen) and seen[-1] == 1.0, seen
    for odd in ("x", 3, [print], np.zeros(3), True, lambda: None, lambda fraction: None):
        with refused(UnsupportedTypeError, element="progress"):
            REPORTING[name](progress=odd)


def test_all_public_functions_with_progress_are_tested():
    """Except batches, whose progress has other arguments, and methods, which `sharpen` calls."""
    called = {getattr(call, "func", call) for call in REPORTING.values()}
    called = {getattr(function, "__func__", function) for function in called} | {sh.SignedHeatSolver, batches.run}
    called |= {Geodesic.sharpened, Convex.sharpened}
    assert {function for _, function, parameter, _ in parameters() if parameter == "progress"} <= called


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, np.float32("nan"), 10**400], ids=lambda n: f"{n!r:.9}")
def test_numbers_that_fields_are_combined_with_are_finite(name, number):
    field = FIELDS[name]
    operations = [
        lambda: field + number, lambda: number + field, lambda: field - number, lambda: number - field,
        lambda: field * number, lambda: number * field, lambda: field / number,
    ]  # fmt: skip
    for operation in operations:
        with refused(SignedHeatError):
            operation()


def test_fields_are_not_divided_by_zero():
    for field in FIELDS.values():
        with refused(SignedHeatError):
            _ = field / 0


@pytest.mark.parametrize("domain", [b"x", None, 3, object(), {}, np.nan])
def test_solvers_refuse_at_once_what_is_no_domain(domain):
    with refused(SignedHeatError):
        sh.SignedHeatSolver(domain)


@pytest.mark.parametrize("space", [np.nan, 3, b"left", ["left"]], ids=repr)
def test_spaces_of_images_are_names(space):
    with refused(GeometryError, element="space"):
        sh.io.LabelImage(np.zeros((2, 2, 2)), np.eye(3), np.zeros(3), space)


def test_batches_refuse_what_cannot_be_called(tmp_path):
    with refused(UnsupportedTypeError, element="progress"):
        batches.run(tmp_path, tmp_path / "out", batches.Job(volume=".npz", resolution=8), progress="x")


GONE = """
import os, sys, tempfile
import signedheat as sh
from signedheat import batches, samples
from signedheat.cli import main
ball, kept = samples.sphere(1), sys.argv[1]
ball.save(kept + "/a.stl")
sh.read(kept + "/a.stl")  # imports Numba, which imports coverage where it is installed, which needs a current folder
field, curve = sh.signed_distance(ball, resolution=8), ball.path([0, 9, 20])
folder = tempfile.mkdtemp()
os.chdir(folder)
os.rmdir(folder)
sh.read(kept + "/a.stl").save(kept + "/b.ply")
assert main(["info", kept + "/a.stl", "--quiet"]) == 0
assert main(["volume", kept + "/a.stl", "-o", kept + "/o.npz", "--resolution", "8", "--quiet"]) == 0
job = batches.Job(volume=".npz", resolution=8)
for name, call in {
    "read": lambda: sh.read("a.stl"),
    "read_field": lambda: sh.read_field("f.npz"),
    "read_curves": lambda: sh.io.read_curves("c.json", ball),
    "read_polylines": lambda: sh.io.read_polylines("l.svg"),
    "read_labels": lambda: sh.io.read_labels("l.nrrd"),
    "read_volume": lambda: sh.io.read_volume("v.npy"),
    "save": lambda: ball.save("a.stl"),
    "save field": lambda: field.save("f.npz"),
    "save values": lambda: field.save("f.npy"),
    "save solid": lambda: sh.complete(ball).save("a.npz"),
    "write_curves": lambda: sh.io.write_curves(curve, "c.json", ball),
    "write_vdb": lambda: sh.io.write_vdb(field, "f.vdb"),
    "save_contour": lambda: field.save_contour("c.ply"),
    "samples": lambda: sh.sample_distances(ball, 9).save("s.npz"),
    "tiles": lambda: sh.complete(ball).field(20, band=0.1, store="tiles"),
    "batch": lambda: batches.run("in", "out", job),
    "batch of a folder": lambda: batches.run(".", kept + "/out", job),
    "batch of a pattern": lambda: batches.run("*.stl", kept + "/out", job),
    "batch to a folder": lambda: batches.run(kept + "/a.stl", "out", job),
}.items():
    try:
        call()
        print(name, "did it")
    except sh.errors.FileFormatError as error:
        if "deleted" not in error.cause or error.path is None or not error.remedy:
            print(name, error)
"""
LINES_GONE = [
    "info a.stl", "volume KEPT/a.stl -o o.npz", "volume a.stl -o KEPT/o.npz", "offset KEPT/a.stl 0.1 -o o.stl",
    "batch KEPT/a.stl -o out --info", "batch . -o KEPT/out --info", "batch *.stl -o KEPT/out --info",
    "view KEPT/a.stl -o p.png", "sample KEPT/a.stl -o s.npz", "surface KEPT/a.stl c.json -o KEPT/s.ply",
    "section KEPT/a.stl -o s.svg", "union KEPT/a.stl KEPT/a.stl -o s.stl", "watertight KEPT/a.stl -o s",
    "demo -o made", "volume KEPT/a.stl -o KEPT/o.npz --transform m.txt",
]  # fmt: skip


def test_a_working_folder_that_was_deleted_is_named(tmp_path):
    done = subprocess.run([sys.executable, "-c", GONE, str(tmp_path)], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, ""), done


@pytest.mark.parametrize("line", LINES_GONE)
def test_commands_in_a_working_folder_that_was_deleted(tmp_path, line, monkeypatch, capfd):
    BALL.save(tmp_path / "a.stl")
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert main([word.replace("KEPT", str(tmp_path)) for word in line.split()]) == 1
    said = capfd.readouterr().err
    assert "deleted" in said and said.count("\n") == 1


@pytest.mark.parametrize("option", [{"lids": "".join(["be", "nt"])}, {"nested": "".join(["gi", "ven"])}])
def test_options_that_are_given_as_their_defaults_are_accepted_where_they_do_not_apply(option):
    assert sh.signed_distance(LINE, PLANE, **option).values.shape == PLANE.shape
    with refused(UnsupportedTypeError, element=next(iter(option))):
        sh.signed_distance(LINE, PLANE, **dict.fromkeys(option, "flat"))
