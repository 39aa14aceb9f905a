"""Curves as lists of elements; curves without length; their positions; what is misplaced or masked."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat.curves.curve_distance import CurvesTaken
from signedheat.diagnostics import WithoutLength
from signedheat.samples import sphere
from signedheat.surfaces.source_segments import curve_of_elements

BALL = sphere(3)
RING = BALL.level_set(BALL.vertices[:, 2], 0.1)[0]


def edges(mesh):
    seen = {}
    for face in mesh.faces.tolist():
        for k in range(3):
            seen.setdefault(frozenset((face[k], face[(k + 1) % 3])), (face[k], face[(k + 1) % 3]))
    return np.array(list(seen.values()))


def as_elements(mesh, vertex, edge, face):
    """A vertex, the middle of an edge's first quarter, a place in a face; and where these are."""
    ends = mesh.vertices[edges(mesh)[edge]]
    corners = mesh.vertices[mesh.faces[face]]
    places = [mesh.vertices[vertex], 0.75 * ends[0] + 0.25 * ends[1], np.array([0.2, 0.3, 0.5]) @ corners]
    return [(vertex, []), (edge, [0.25]), (face, [0.2, 0.3])], places


@pytest.mark.filterwarnings("ignore::signedheat.errors.InexactWarning")  # its gap is wide
def test_elements_are_numbered_as_potpourri3d_does():
    pp3d = pytest.importorskip("potpourri3d")
    np.testing.assert_array_equal(edges(BALL), pp3d.edges(BALL.vertices, BALL.faces))
    curve = [(5, []), (17, [0.3]), (40, [0.2, 0.5, 0.3]), (9, [])]
    solver = pp3d.MeshSignedHeatSolver(BALL.vertices, BALL.faces)
    path = [(int(v), []) for v in pp3d_path(pp3d)]
    theirs = solver.compute_distance([path], preserve_source_normals=False, level_set_constraint="ZeroSet")
    ours = sh.SignedHeatSolver(BALL, 1.0, intrinsic=False).distance(path, sh.constraints.ZeroSet(hard=True)).values
    np.testing.assert_allclose(ours, theirs, atol=1e-8)
    assert sh.signed_distance([curve], BALL).values.shape == (BALL.n_vertices,)


def pp3d_path(pp3d):
    """Vertices along edges, around the ball."""
    neighbours = {}
    for a, b in edges(BALL):
        neighbours.setdefault(a, set()).add(b)
        neighbours.setdefault(b, set()).add(a)
    at, path = 0, [0]
    while len(path) < 12:
        at = max(neighbours[at] - set(path), key=lambda v: BALL.vertices[v] @ [0.3, 1.0, 0.2])
        path.append(at)
        if BALL.vertices[at] @ [0.3, 1.0, 0.2] > 0.95:
            break
    return path


def test_points_of_elements_lie_where_they_should():
    elements, places = as_elements(BALL, 7, 33, 100)
    np.testing.assert_allclose(BALL.positions(curve_of_elements(BALL, elements)), places, atol=1e-15)
    one = sh.signed_distance(elements, BALL, as_oriented=True)
    for same in ([elements], curve_of_elements(BALL, elements)):
        np.testing.assert_array_equal(one.values, sh.signed_distance(same, BALL, as_oriented=True).values)
    for measure in (sh.SignedHeatSolver(BALL).distance, partial(sh.piecewise_distance, domain=BALL)):
        np.testing.assert_array_equal(measure(elements).values, measure(curve_of_elements(BALL, elements)).values)
    for missing in ((10**6, []), (10**6, [0.5]), (10**6, [0.2, 0.3]), (-1, [])):
        kind = ("vertex", "edge", "face")[len(missing[1])]
        with refused(sh.errors.SourceError, f"{kind} {missing[0]}") as caught:
            sh.signed_distance([(3, []), missing], BALL)
        assert "point 1" in str(caught.value)
    with refused(sh.errors.SourceError, "point 1"):  # three coordinates that do not add up
        sh.signed_distance([(3, []), (40, [0.2, 0.5, 0.9])], BALL)


def test_elements_are_curves_whatever_is_done_with_them():
    ring = [(int(face), place[:2].tolist()) for face, place in zip(RING.faces, RING.barycentric, strict=True)]
    same, click = curve_of_elements(BALL, ring), sh.Curve([0, 0], [[1, 0, 0], [1, 0, 0]])
    for given in (ring, [ring], [click, ring]):
        same_segments = sh.intrinsic_delaunay(BALL).transfer(ring), sh.intrinsic_delaunay(BALL).transfer([same])[0]
        np.testing.assert_array_equal(*(segments.vectors for segments in same_segments))
        kept, whole = sh.intrinsic_delaunay(BALL, keep=given), sh.intrinsic_delaunay(BALL, keep=same)
        np.testing.assert_array_equal(kept.triangles.corner_vertices, whole.triangles.corner_vertices)
        for as_oriented in (False, True):
            closed, theirs = (sh.close_curves(each, BALL, as_oriented=as_oriented) for each in (given, same))
            np.testing.assert_array_equal(closed[0].barycentric, theirs[0].barycentric)
    for given in (ring, [ring], [[ring, same.reversed()]]):  # those of a group one by one
        found = sh.orientation(given, BALL)
        assert found.turned.shape == (len(found.curves),) and all(isinstance(each, sh.Curve) for each in found.curves)


@pytest.mark.parametrize("faces", [[0, 9999], [-1, 0]])
def test_a_missing_face_is_one_error_wherever_it_is_met(faces, tmp_path):
    """Curves are numbered as they were given, whatever is left out."""
    wrong, click = sh.Curve(faces, np.eye(3)[:2]), sh.Curve([0, 0], [[1, 0, 0], [1, 0, 0]])
    phi, better = sh.signed_distance(RING, BALL), sh.intrinsic_delaunay(BALL)
    cut, finer = sh.piecewise_distance(RING, BALL), sh.piecewise_distance(RING, better)
    of_sources = [
        lambda given: sh.signed_distance(given, BALL),
        lambda given: sh.signed_distance(given, better),
        sh.SignedHeatSolver(BALL).distance,
        lambda given: sh.SignedHeatSolver(BALL).distance_many([given]),
        partial(sh.piecewise_distance, domain=BALL),
        partial(sh.close_curves, domain=BALL),
        partial(sh.intrinsic_delaunay, BALL),
        partial(sh.sharpen, phi),
    ]
    of_points = [
        BALL.positions, phi, phi.gradient, cut, cut.gradient, finer, finer.gradient, better.transfer,
        lambda given: sh.io.write_curves(given, tmp_path / "a.json", BALL),
        lambda given: sh.io.write_curves(given, tmp_path / "a.obj", BALL),
        lambda given: better.in_space(given.faces, given.barycentric),
    ]  # fmt: skip
    for measure in of_sources:
        with refused(sh.errors.SourceError, f"face {faces[0] or faces[1]}") as caught:
            measure([click, RING, wrong])
        assert "curve 2: point" in str(caught.value)
    for evaluate in of_points:
        with refused(sh.errors.SourceError, f"face {faces[0] or faces[1]}"):
            evaluate(wrong)


def test_levels_are_those_of_the_curves_given():
    low, click = BALL.level_set(BALL.vertices[:, 2], -0.4)[0], sh.Curve([0, 0], [[1, 0, 0], [1, 0, 0]])
    solver, levels = sh.SignedHeatSolver(BALL), sh.constraints.LevelValues([9.0, 0.0, 0.5])
    right = solver.distance([RING, low], sh.constraints.LevelValues([0.0, 0.5])).values
    np.testing.assert_array_equal(solver.distance([click, RING, low], levels).values, right)
    np.testing.assert_allclose(solver.distance_many([[click, RING, low]], levels)[0].values, right, atol=1e-12)


def test_positions_of_curves():
    np.testing.assert_allclose(BALL.positions(RING)[:, 2], 0.1, atol=1e-12)
    np.testing.assert_array_equal(BALL.positions(BALL.points_at([4, 9])), BALL.vertices[[4, 9]])
    cloud = sh.PointCloud(BALL.vertices)
    np.testing.assert_array_equal(cloud.positions(cloud.path([4, 9])), BALL.vertices[[4, 9]])


@pytest.mark.parametrize("click", [
    sh.Curve([3, 3], [[0.2, 0.3, 0.5]] * 2), BALL.path([5, 5]), BALL.polyline([[0, 0, 1], [0, 0, 1]]),
])  # fmt: skip
@pytest.mark.parametrize(
    "measure",
    [
        lambda mesh, curves: sh.signed_distance(curves, mesh),
        lambda mesh, curves: sh.SignedHeatSolver(mesh).distance(curves),
        lambda mesh, curves: sh.SignedHeatSolver(mesh).distance_many([curves])[0],
        lambda mesh, curves: sh.SignedHeatSolver(sh.intrinsic_delaunay(mesh)).distance(curves),
        lambda mesh, curves: sh.sharpen(sh.SignedHeatSolver(mesh).distance(curves), curves),
        lambda mesh, curves: sh.piecewise_distance(curves, mesh),
    ],
)
def test_a_click_among_strokes_is_left_out_with_a_note(measure, click):
    alone, with_click = measure(BALL, [RING]), measure(BALL, [RING, click])
    np.testing.assert_array_equal(alone.values, with_click.values)
    assert with_click.diagnostics.note(WithoutLength).without_length == [1]
    assert alone.diagnostics.note(WithoutLength) is None
    with refused(sh.errors.SourceError):
        measure(BALL, click)


def test_curves_are_named_by_their_number_among_all_that_were_given():
    """Whatever is left out before them, or put in their place."""
    n, click = RING.n_points, sh.Curve([0, 0], [[1, 0, 0], [1, 0, 0]])
    parts = [slice(0, n // 3), slice(n // 3, 2 * n // 3), slice(2 * n // 3, n)]
    first, second, third = (sh.Curve(RING.faces[part], RING.barycentric[part]) for part in parts)
    given = [click, first, second.reversed(), third]
    assert sh.signed_distance(given, BALL).diagnostics.note(CurvesTaken).turned == [2]
    arcs = [np.linspace(middle - 1.4, middle + 1.4, 20) for middle in (0, np.pi)]
    right, left = (sh.Polyline(np.stack([np.cos(arc), np.sin(arc)], axis=1)) for arc in arcs)
    dot = sh.Polyline([[0.1, 0], [0, 0.1], [-0.1, 0]], closed=True)
    for lines, number in (([right, left.reversed(), dot], 1), ([dot, right, left.reversed()], 2)):
        with pytest.warns(sh.errors.InexactWarning, match=f"curve number {number}"):
            sh.signed_distance(lines, resolution=24)


def test_what_is_misplaced_is_named():
    with refused(sh.errors.UnsupportedTypeError):
        sh.signed_distance(BALL, RING)
    with refused(sh.errors.UnsupportedTypeError, "band"):
        sh.signed_distance(RING, BALL, band=0.1)
    for intrinsic in ("yes", 3, None):
        with refused(sh.errors.SignedHeatError, "intrinsic"):
            sh.signed_distance(RING, BALL, intrinsic=intrinsic)


def test_masks_are_not_ignored():
    hidden = np.ma.masked_greater(BALL.vertices, 0.9)
    with refused(sh.errors.GeometryError):
        sh.as_shape((hidden, BALL.faces))
    with refused(sh.errors.GeometryError):
        sh.signed_distance((BALL.vertices, np.ma.masked_equal(BALL.faces, 3)), resolution=8)
    with refused(sh.errors.GeometryError):
        sh.Field(BALL, hidden[:, 0])
