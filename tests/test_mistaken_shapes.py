"""The commonest mistakes in passing a shape: what is wrong is said, and what to pass instead."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box
from signedheat import samples

BALL = samples.sphere(2)
V, F = BALL.vertices, BALL.faces
MISTAKES = {
    "float faces": ((V, F.astype(float)), "integers"),
    "faces first": ((F, V), "(vertices, faces)"),
    "vertices in the plane": ((V[:, :2], F), "z = 0"),
    "vertices in columns": ((V.T, F), "vertices.T"),
    "six numbers for each vertex": ((np.hstack([V, V]), F), "3 for each"),
    "faces in columns": ((V, F.T), "faces.T"),
    "faces as in PyVista": ((V, np.insert(F, 0, 3, axis=1)), "faces[:, 1:]"),
    "faces as in PyVista, in one row": ((V, np.insert(F, 0, 3, axis=1).ravel()), "faces.reshape(-1, 4)[:, 1:]"),
    "quads as in PyVista": ((V, np.array([[4, 0, 1, 4, 2], [4, 5, 6, 7, 8]])), "faces[:, 1:]"),
    "points alone": ([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], "PointCloud"),
    "an array of points": (V, "PointCloud"),
}
CALLS = {
    "complete": sh.complete,
    "signed_distance": lambda shape: sh.signed_distance(shape, resolution=8),
    "as_shape": sh.as_shape,
}


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("name", MISTAKES)
def test_arrays_that_are_no_shape_say_what_is_wrong(name, call):
    shape, word = MISTAKES[name]
    with refused(sh.SignedHeatError) as caught:
        CALLS[call](shape)
    if name != "float faces":
        assert word in str(caught.value)
    else:
        assert "int" in str(caught.value)


@pytest.mark.parametrize("quads", [
    [[3, 0, 1, 2]], [[3, 0, 1, 2], [3, 2, 4, 5]], [[0, 1, 2, 2], [0, 2, 4, 4], [0, 4, 5, 5]],
])  # fmt: skip
def test_quads_around_one_vertex_and_quads_that_are_triangles_are_quads(quads):
    assert sh.as_shape((V, np.array(quads))).n_polygons == len(quads)


@pytest.mark.parametrize(("points", "make", "remedy"), [
    ([[0, 1], [1, 0], [1, 1]], BALL.polyline, "3 coordinates"),
    ([[0, 1, 2], [1, 0, 2]], sh.Polyline, "2 coordinates"),
    ([[0, 1, 2, 3], [1, 0, 2, 3]], sh.Polyline, "points.T"),
])  # fmt: skip
def test_points_of_another_dimension_are_not_columns(points, make, remedy):
    with refused(sh.SignedHeatError) as caught:
        make(np.array(points, dtype=float))
    assert remedy in caught.value.remedy


@pytest.mark.parametrize("lines", [1, 2])
def test_lines_in_the_plane_are_no_solid(lines):
    with refused(sh.errors.SourceError) as caught:
        sh.complete([sh.Polyline([[0, 0], [1, 0], [0, 1]], closed=True)] * lines)
    assert "lines in the plane" in str(caught.value)


@pytest.mark.parametrize("take", [
    sh.complete, lambda voxels: sh.complete([BALL, voxels]), lambda voxels: sh.deviation(voxels, BALL),
    lambda voxels: sh.morphology.dilate(voxels, 0.1), sh.SignedHeatSolver(sh.Grid.around(BALL.bounds, 8)).distance,
])  # fmt: skip
def test_voxels_are_measured_to_by_their_smooth_surface(take):
    with refused(sh.errors.SourceError) as caught:
        take(sh.DigitalSurface(np.pad(np.ones((2, 2, 2), bool), 1)))
    assert "smooth_surface" in str(caught.value)


@pytest.mark.parametrize("source", [BALL, sh.complete(BALL), (V, F)], ids=["mesh", "solid", "pair"])
def test_grids_of_another_dimension(source):
    with refused(sh.errors.SourceError, element="source 0") as caught:
        sh.signed_distance(source, sh.Grid((0, 0), 1, (3, 3)))
    assert "2" in caught.value.cause and "3" in caught.value.cause
    line = sh.Polyline([[0, 0], [0, 1], [1, 1], [1, 0]], closed=True)
    with refused(sh.errors.SourceError, element="source 0"):
        sh.signed_distance(line, sh.Grid((0, 0, 0), 1, (3, 3, 3)))


def test_thin_parts_need_smaller_cells():
    plate = sh.complete(box((-10, -10, -0.1), (10, 10, 0.1)))
    with pytest.raises(sh.errors.OutsideError) as caught:
        plate.field(grid=sh.Grid((-14, -14, -4.5), 1.0, (29, 29, 10))).contour()
    assert "smaller cells" in caught.value.remedy
    with pytest.raises(sh.errors.OutsideError) as caught:
        sh.complete(BALL).field(16).contour(50.0)
    assert "larger grid" in caught.value.remedy


@pytest.mark.parametrize("options", [{}, {"keep_outside": True}])
def test_a_shell_deeper_than_the_part_says_that_nothing_is_hollow(options):
    cube = box((0, 0, 0), (2, 2, 2))
    with pytest.warns(sh.errors.InexactWarning, match="hollow"):
        full = sh.morphology.shell(cube, -1.5, 0.0, resolution=32, **options)
    assert full.to_trimesh().volume == pytest.approx(8, rel=0.06)  # contours cut edges off
    hollow = sh.morphology.shell(cube, -0.5, 0.0, resolution=32, **options)
    assert hollow.to_trimesh().volume == pytest.approx(7, rel=0.06)
