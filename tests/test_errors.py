"""Errors say what is wrong, with what, and what to do: as attributes, so that no one has to read sentences."""

from __future__ import annotations

import ast
import copy
import functools
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import signedheat as sh
from signedheat.cli import main
from signedheat.cli.operands import prefix_errors

TRIANGLE = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
KINDS = [kind for kind in vars(sh.errors).values() if isinstance(kind, type) and issubclass(kind, sh.SignedHeatError)]


@pytest.mark.parametrize("kind", KINDS)
def test_parts_and_text(kind):
    error = kind("point 3 is nowhere", remedy="move it", element="point 3")
    assert (error.cause, error.remedy, error.element, error.path) == ("point 3 is nowhere", "move it", "point 3", None)
    assert str(error) == "point 3 is nowhere: move it"
    for same in (pickle.loads(pickle.dumps(error)), copy.copy(error)):
        assert type(same) is kind and vars(same) == vars(error) and str(same) == str(error)
    there = error.at(Path("a.ply"))
    assert type(there) is kind and (there.path, there.remedy, there.element) == ("a.ply", "move it", "point 3")
    assert str(there) == "a.ply: point 3 is nowhere: move it"


@pytest.mark.parametrize(
    "call, kind, element",
    [
        (lambda: sh.TriangleMesh([[0, 0, np.nan]], [[0, 0, 0]]), sh.errors.GeometryError, "number 0"),
        (
            lambda: sh.PointCloud([[0, 0, 0], [1, 0, 0]], normals=[[0, 0, 1], [0, 0, 0]]),
            sh.errors.GeometryError,
            "point 1",
        ),
        (lambda: TRIANGLE.points_at(7), sh.errors.SourceError, "vertex 7"),
        (lambda: sh.SignedHeatSolver(TRIANGLE).distance([]), sh.errors.SourceError, None),
        (
            lambda: sh.SignedHeatSolver(TRIANGLE).distance(TRIANGLE.path([0, 1]), "free"),
            sh.errors.UnsupportedTypeError,
            None,
        ),
        (lambda: sh.SignedHeatSolver(TRIANGLE.path([0, 1])).discretization, sh.errors.UnsupportedTypeError, "domain"),
        (lambda: sh.sharpen(np.zeros(3)), sh.errors.UnsupportedTypeError, None),
        (lambda: sh.morphology.shell(TRIANGLE, 0.0, 0.1, TRIANGLE), sh.errors.UnsupportedTypeError, None),
    ],
)
def test_cause_element_and_remedy(call, kind, element):
    with pytest.raises(kind) as caught:
        call()
    assert caught.value.remedy and caught.value.element == element
    assert str(caught.value) == f"{caught.value.cause}: {caught.value.remedy}"
    assert element is None or element in caught.value.cause


def test_errors_of_files_name_them(tmp_path):
    for name, content in (("none.stl", None), ("empty.obj", ""), ("folder.unknown", "x")):
        path = tmp_path / name
        if content is not None:
            path.write_text(content)
        with pytest.raises(sh.errors.FileFormatError) as caught:
            sh.read(path)
        assert caught.value.path == str(path) and caught.value.remedy and str(path) not in caught.value.cause


def test_wrong_types_are_type_errors_too():
    with pytest.raises(TypeError), prefix_errors("input.ply"):
        raise sh.errors.UnsupportedTypeError("no")
    with pytest.raises(sh.errors.SignedHeatError) as caught, prefix_errors("input.ply"):
        raise sh.errors.UnsupportedTypeError("no")
    assert caught.value.path == "input.ply"


@functools.cache
def calls_of_errors():
    """(where, text of the cause, names of the keywords) of every error of our own that the package makes."""
    names, found = {kind.__name__ for kind in KINDS}, []
    for path in Path(sh.__file__).parent.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in names and node.args:
                cause = ast.get_source_segment(text, node.args[0]) or ""
                found.append((f"{path.name}:{node.lineno}", cause, {keyword.arg for keyword in node.keywords}))
    return found


def test_every_error_says_what_it_is_about_or_what_to_do():
    """Readers of files leave the path to `reading`, in which they run."""
    readers = {path.name for path in (Path(sh.__file__).parent / "io").glob("*.py")}
    found = [where for where, _, given in calls_of_errors() if not given & {"element", "remedy", "path"}]
    assert len(KINDS) > 10 and [where for where in found if where.split(":")[0] not in readers] == []


def test_no_remedy_hides_in_a_cause():
    """Where errors are raised, what to do is an argument of its own."""
    verbs = "use pass give choose write save raise lower remove check convert move turn orient leave make try add"
    remedy = rf"[:;] ({verbs.replace(' ', '|')}) "
    found = [
        where for where, cause, _ in calls_of_errors() if re.search(remedy, cause) or cause.startswith('f"{path}: ')
    ]
    assert found == []


def test_what_is_quoted_keeps_errors_to_one_line():
    assert (
        str(sh.errors.SignedHeatError(f"no {np.zeros((2, 2))!r}", remedy="none"))
        == "no array([[0., 0.], [0., 0.]]): none"
    )


@pytest.mark.parametrize("call", [sh.complete, lambda mesh: sh.signed_distance(mesh, resolution=16)])
def test_warnings_name_the_line_of_the_caller(call):
    ball = sh.samples.sphere(2)
    upper = ball.faces[ball.vertices[ball.faces].mean(axis=1)[:, 2] > 0]
    with pytest.warns(sh.errors.InexactWarning) as caught:
        call((ball.vertices, upper))
    assert {Path(warning.filename).name for warning in caught} == {Path(__file__).name}


LONG = 100_000 * "a"


@pytest.mark.parametrize(
    "call",
    [
        lambda: sh.read(f"{LONG}.stl"),
        lambda: sh.read(LONG),
        lambda: sh.read("/".join(1000 * [200 * "a"]) + ".stl"),
        lambda: sh.read(f"{LONG}.stl\n\0"),
        lambda: TRIANGLE.save(f"{LONG}.ply"),
        lambda: sh.complete(TRIANGLE, lids=LONG),
        lambda: sh.complete({LONG: LONG}),
        lambda: sh.Grid((0, 0, 0), LONG, (3, 3, 3)),
        lambda: sh.Grid((0, 0, 0), 10**10_000, (3, 3, 3)),
        lambda: sh.complete(TRIANGLE, seal=[LONG]),
        lambda: sh.Field(LONG, [1]),
        lambda: sh.orient(TRIANGLE, *[LONG]),
        lambda: sh.io.LabelImage(np.zeros((2, 2, 2)), np.eye(3), np.zeros(3), [LONG]),
    ],
)
def test_messages_quote_no_more_than_some_characters(call):
    with pytest.raises((sh.SignedHeatError, TypeError)) as caught:
        call()
    assert len(str(caught.value)) < 1000 and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "line",
    [
        [LONG], ["info", LONG], ["info", f"{LONG}.stl"], ["info", "x.stl", f"--{LONG}"], ["info", "-", "--from", LONG],
        ["volume", "x.stl", "-o", f"{LONG}.npz"], ["volume", "x.stl", "-o", "-", "--format", LONG],
        *(["volume", "x.stl", "-o", "o.npz", option, LONG] for option in ("--resolution", "--spacing", "--constraint",
          "--lids", "--transform", "--units", "--diffusion")),
        ["batch", LONG, "-o", "out", "--info"], ["batch", "x.stl", "-o", LONG, "--info"],
        ["batch", "x.stl", "-o", "out", "--volume", LONG], ["info", *(1000 * ["x.stl"]), f"--{LONG}", *(999 * ["-z"])],
    ],
    ids=lambda line: f"{line[0]:.9} {line[-2][:12] if len(line) > 1 else ''}",
)  # fmt: skip
def test_lines_of_commands_quote_no_more_than_some_characters(line, capfd, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(line) in (1, 2)
    said = capfd.readouterr().err
    assert len(said) < 1000 and said.count("\n") == 1
