"""Pictures look as they did: compared, small, with stored ones (`STORE_PICTURES=1` stores them anew)."""

from __future__ import annotations

import os
from pathlib import Path

import matplotlib
import matplotlib.image
import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples, view

STORED = Path(__file__).parent / "pictures"
CELL = 13
"""Pixels averaged along each side, so that fonts and edges of other versions of matplotlib make no difference."""


def slices(path):
    grid = sh.Grid((-1.5, -1.2, -1.2), 0.1, (31, 25, 25))
    values = np.maximum(np.linalg.norm(grid.points, axis=-1) - 1, 0.3 - np.linalg.norm(grid.points - 0.5, axis=-1))
    view.save_slices(sh.Field(grid, values), path, samples.sphere(2), levels=[0.2])


def plane(path):
    grid = sh.Grid((0, 0), 0.1, (41, 31))
    line = sh.Polyline([[1, 1], [1, 2], [3, 2], [3, 1]], closed=True)
    x, y = np.moveaxis(np.abs(grid.points - [2, 1.5]) - [1, 0.5], -1, 0)
    view.save_slices(sh.Field(grid, np.maximum(x, y)), path, [line])


def broken_shape(path):
    view.save_scene(samples.with_flipped_faces(samples.without_patches(samples.torus(1.0, 0.4), 3, 0.4), 0.1), path)


def shape_with_y_upwards(path):
    view.save_scene(samples.torus(1.0, 0.4), path, up=1)


def points(path):
    view.save_scene(samples.oriented_points(samples.torus(1.0, 0.4), 2000), path)


def surface(path):
    ball = samples.sphere(3)
    curve = ball.polyline([[1.0, 0.0, 0.4], [0.0, -1.0, 0.5], [-1.0, 0.0, 0.4]])
    field = sh.Field(ball, np.where(ball.vertices[:, 0] > 0.9, np.nan, ball.vertices[:, 2] - 0.4))
    view.save_surface(field, path, [curve])


@pytest.mark.skipif(
    tuple(map(int, matplotlib.__version__.split(".")[:2])) < (3, 9), reason="older versions lay figures out differently"
)
@pytest.mark.parametrize("draw", [slices, plane, broken_shape, shape_with_y_upwards, points, surface])
def test_pictures_look_as_stored(draw, tmp_path):
    draw(tmp_path / "picture.png")
    picture = matplotlib.image.imread(tmp_path / "picture.png")[..., :3]
    rows, columns = (n - n % CELL for n in picture.shape[:2])
    small = picture[:rows, :columns].reshape(rows // CELL, CELL, columns // CELL, CELL, 3).mean(axis=(1, 3))
    stored = STORED / f"{draw.__name__}.png"
    if os.environ.get("STORE_PICTURES"):
        matplotlib.image.imsave(stored, small)
    known = matplotlib.image.imread(stored)[..., :3]
    assert known.shape == small.shape
    assert np.abs(known - small).mean() < 0.01
    assert (np.abs(known - small).max(axis=-1) > 0.15).mean() < 0.01


def test_a_picture_of_something_else_is_told_apart():
    known = [
        matplotlib.image.imread(STORED / f"{name}.png")[..., :3] for name in ("broken_shape", "shape_with_y_upwards")
    ]
    n = min(len(k) for k in known)
    m = min(k.shape[1] for k in known)
    assert np.abs(known[0][:n, :m] - known[1][:n, :m]).mean() > 0.03


def test_sources_are_drawn_where_they_are_whatever_triangles_the_field_has():
    """A piecewise field on a refinement is painted on other faces than those that its curves refer to."""
    mesh = samples.torus(n_around=32, n_across=16)
    loop = mesh.path(range(16), closed=True)
    fields = [
        sh.SignedHeatSolver(mesh).distance(loop),
        sh.piecewise_distance(loop, mesh),
        sh.piecewise_distance(loop, mesh, intrinsic=True),
    ]
    assert isinstance(fields[2].domain.surface, sh.IntrinsicTriangulation)
    drawn = []
    for field in fields:
        axes = view.figures.new_figure(4, 4).add_subplot()
        view.draw_surface(field, axes, [loop], view=np.array([0.5, -0.3, 0.7]))
        drawn.append(axes.lines[-1].get_xydata())
    assert np.isfinite(drawn[0]).all(axis=1).sum() > 5
    for line in drawn[1:]:
        both = np.isfinite(line).all(axis=1) & np.isfinite(drawn[0]).all(axis=1)
        assert both.sum() > 5
        assert np.abs(line - drawn[0])[both].max() < 1


@pytest.mark.parametrize("thing", [None, sh.Grid((0, 0), 1.0, (2, 2)), samples.sphere(1).points_at(0)])
def test_rows_have_no_empty_panels(tmp_path, thing):
    with refused(sh.errors.UnsupportedTypeError, "odd"):
        view.save_row([("ball", samples.sphere(1)), ("odd", thing)], tmp_path / "row.png")


def test_infinite_values_are_refused(tmp_path):
    grid = sh.Grid((0, 0), 1.0, (3, 3))
    with refused(sh.errors.GeometryError, "field"):
        view.save_slices(sh.Field(grid, [[0.0, 1, 2], [1, 2, np.inf], [3, 4, 5]]), tmp_path / "a.png")


def test_a_single_source_is_drawn_as_a_list_of_it_is(tmp_path):
    ball = samples.sphere(1)
    field, source = sh.Field(ball, ball.vertices[:, 2]), ball.points_at(0)
    for name, given in (("one", source), ("list", [source])):
        view.save_surface(field, tmp_path / f"{name}.png", given)
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "list.png").read_bytes()


def test_angles_and_the_direction_that_they_mean_show_the_same():
    ball = sh.samples.sphere(2)
    field = sh.signed_distance(ball.level_set(ball.vertices[:, 2], 0.2), ball)
    pictures = []
    for seen_from in ((30.0, -60.0), view.surface_pictures.oblique(30.0, -60.0)):
        axes = view.new_figure(2, 2).add_subplot()
        view.draw_surface(field, axes, view=seen_from)
        pictures.append(axes.images[0].get_array())
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize(("name", "things"), [
    ("save_surface", {"mesh": "save_scene", "grid": "save_slices", "array": "signed_distance"}),
    ("save_slices", {"mesh": "save_scene", "surface": "save_surface", "array": "signed_distance"}),
    ("save_row", {"mesh": "title", "grid": "title", "array": "title", "list": "title", "nothing": "title"}),
])  # fmt: skip
def test_what_is_drawn_by_another_function_is_told(tmp_path, name, things):
    ball = samples.sphere(1)
    grid, surface = sh.signed_distance(ball, resolution=8), sh.Field(ball, ball.vertices[:, 2])
    odd = {"mesh": ball, "grid": grid, "surface": surface, "array": grid.values, "list": [grid, ball], "nothing": []}
    for kind, word in things.items():
        with refused(sh.errors.UnsupportedTypeError) as caught:
            getattr(view, name)(odd[kind], tmp_path / "picture.png")
        assert word in caught.value.remedy
        assert not (tmp_path / "picture.png").exists()
