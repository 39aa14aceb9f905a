"""Calls as people write them who come from other packages: errors say how it is done here."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.cli import main
from signedheat.cli.options import COMMANDS_OF_OTHERS
from signedheat.cli.shell import COMMANDS

BALL = samples.sphere(1)
V, F = BALL.vertices, BALL.faces
CURVE = BALL.path([0, 5])
POINTS = np.array([[0.1, 0.2, 0.3], [2.0, 0.0, 0.0]])
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]

TAKE_SHAPES = [
    sh.complete, sh.signed_distance, sh.fill_holes, sh.SignedHeatSolver, sh.orient, sh.orientation, sh.offset,
    sh.wall_thickness, sh.sample_distances, sh.deviation, sh.transform, sh.as_shape, sh.tetrahedralize,
    sh.intrinsic_delaunay, sh.save, sh.morphology.dilate, sh.morphology.closing, sh.morphology.shell,
    sh.morphology.thicken,
]  # fmt: skip


@pytest.mark.parametrize("function", TAKE_SHAPES, ids=lambda function: function.__name__)
@pytest.mark.parametrize("faces", [F, F.tolist(), [[0, 1, 2, 3], [4, 5, 6]]], ids=["array", "lists", "polygons"])
def test_vertices_and_faces_as_two_arguments(function, faces):
    for more in ((), (0.1,)):
        with refused(sh.errors.UnsupportedTypeError, element="argument 0") as caught:
            function(V, faces, *more)
        assert f"{function.__name__}((vertices, faces))" in str(caught.value)


def test_pairs_themselves_are_taken():
    assert sh.complete((V, F)).volume == sh.complete(BALL).volume
    assert sh.signed_distance((V, F), sh.Grid((-1, -1, -1), 1.0, (3, 3, 3)))([[0, 0, 0]]) < 0


@pytest.mark.parametrize("shape", [BALL, (V, F), sh.complete(BALL)], ids=["mesh", "pair", "solid"])
@pytest.mark.parametrize("points", [POINTS, POINTS.tolist()], ids=["array", "lists"])
def test_distance_of_points(shape, points):
    for arguments in ((points, shape), (shape, points)):
        with refused(sh.errors.UnsupportedTypeError) as caught:
            sh.signed_distance(*arguments)
        assert "sh.complete(mesh).distance(points)" in str(caught.value)
    for arguments in ((points, V, F), (V, F, points)):
        with refused(sh.errors.UnsupportedTypeError) as caught:
            sh.signed_distance(*arguments)
        assert "sh.complete((vertices, faces)).distance(points)" in str(caught.value)


@pytest.mark.parametrize("function", [sh.close_curves, sh.piecewise_distance, sh.signed_distance])
@pytest.mark.parametrize("curves", [CURVE, [CURVE]], ids=["one", "list"])
def test_surface_before_curves(function, curves):
    with refused(sh.errors.UnsupportedTypeError, element="domain") as caught:
        function(BALL, curves)
    assert "first" in caught.value.remedy


LAYOUTS = {
    "quads": (lambda: sh.TriangleMesh(SQUARE, [[0, 1, 2, 3]]), "sh.PolygonMesh(vertices, polygons)"),
    "counts, one row a face": (lambda: sh.TriangleMesh(V, np.insert(F, 0, 3, axis=1)), "faces[:, 1:]"),
    "counts, flat": (lambda: sh.TriangleMesh(V, np.insert(F, 0, 3, axis=1).ravel()), "faces.reshape(-1, 4)[:, 1:]"),
    "columns": (lambda: sh.TriangleMesh(V, F.T), "faces.T"),
    "columns of coordinates": (lambda: sh.TriangleMesh(V.T, F), "vertices.T"),
    "floats": (lambda: sh.TriangleMesh(V, F.astype(float)), "faces.astype(int)"),
    "faces before vertices": (lambda: sh.TriangleMesh(F, V), "vertices first"),
    "triangles from 1": (lambda: sh.TriangleMesh(V, F + 1), "faces - 1"),
    "pair from 1": (lambda: sh.complete((V, F + 1)), "faces - 1"),
    "polygons from 1": (lambda: sh.PolygonMesh(SQUARE, [[1, 2, 3, 4]]), "polygons - 1"),
    "tets from 1": (lambda: sh.TetMesh(SQUARE, [[1, 2, 3, 4]]), "tets - 1"),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_other_layouts_of_faces(name):
    call, remedy = LAYOUTS[name]
    with refused(sh.errors.GeometryError) as caught:
        call()
    assert remedy in caught.value.remedy


def test_what_the_remedies_say_works():
    flat = np.insert(F, 0, 3, axis=1).ravel()
    for faces in (flat.reshape(-1, 4)[:, 1:], F.T.T, F.astype(float).astype(int), F + 1 - 1):
        assert np.array_equal(sh.TriangleMesh(V, faces).faces, F)
    with refused(sh.errors.GeometryError) as caught:  # a wrong id alone is not a matter of counting
        sh.TriangleMesh(V, np.append(F, [[0, 1, len(V)]], axis=0))
    assert caught.value.remedy is None


def test_medical_images(tmp_path):
    (tmp_path / "scan.nii.gz").write_bytes(b"")
    with refused(sh.errors.FileFormatError, file="scan.nii.gz") as caught:
        sh.read(tmp_path / "scan.nii.gz")
    assert "read_labels" in caught.value.remedy


@pytest.mark.parametrize("progress", ["x", np.zeros(3), 1], ids=repr)
def test_progress_must_be_a_function(progress):
    field = sh.Field(BALL, V[:, 2])
    for call in (
        lambda: sh.complete(BALL, progress=progress),
        lambda: sh.signed_distance(BALL, resolution=4, progress=progress),
        lambda: sh.complete(BALL).field(4, progress=progress),
        lambda: sh.offset(BALL, 0.1, resolution=8, progress=progress),
        lambda: sh.SignedHeatSolver(BALL, progress=progress),
        lambda: sh.sharpen(field, progress=progress),
        lambda: sh.deviation(BALL, BALL, progress=progress),
    ):
        with refused(sh.SignedHeatError, element="progress"):
            call()


def test_commands_of_other_programs(capsys):
    names = {command.name for command in COMMANDS}
    for word, ours in COMMANDS_OF_OTHERS.items():
        assert word not in names and set(ours.replace(",", "").replace(" or", "").split()) <= names
    assert main(["repair", "part.stl"]) == 2
    assert "watertight" in capsys.readouterr().err


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, np.float32("nan")], ids=str)
def test_fields_are_not_combined_with_what_is_no_number(number):
    for field in (sh.Field(BALL, V[:, 2]), sh.Field(sh.Grid(0.0, 1.0, 3), [-1.0, 0.0, 1.0])):
        for operation in (
            lambda phi: phi + number,
            lambda phi: number + phi,
            lambda phi: phi - number,
            lambda phi: number - phi,
            lambda phi: phi * number,
            lambda phi: phi / number,
            lambda phi: phi / 0.0,
        ):
            with refused(sh.SignedHeatError, element="number"):
                operation(field)


def test_other_kinds_of_things():
    with refused(sh.errors.UnsupportedTypeError):
        sh.SignedHeatSolver(b"x")
    with refused(sh.errors.GeometryError, element="space"):
        sh.io.LabelImage(np.ones((2, 2, 2), int), np.eye(3), np.zeros(3), space=np.nan)
    with refused(sh.SignedHeatError, element="nested"):
        sh.orientation(BALL, nested="abc")
    with refused(sh.errors.GeometryError, element="values") as caught:
        sh.redistance(np.pad(np.ones((5, 5), np.uint8), 3))
    assert "numpy.where" in caught.value.remedy


def test_progress_of_sharpening_ends_whatever_the_field_is():
    for field in (sh.complete(BALL).field(4), sh.Field(BALL, V[:, 2])):
        told = []
        sh.sharpen(field, progress=lambda fraction, step, told=told: told.append(fraction))
        assert told[-1] == 1.0
