"""Distance to curves on meshes with seams, copies, fins, turned faces, and parts that cannot be oriented."""

import warnings

import numpy as np
import pytest
from scipy.spatial import cKDTree

import signedheat as sh
from shapes.surface_cases import band
from shapes.triangulated import klein_bottle
from signedheat.diagnostics import VerticesJoined
from signedheat.errors import InexactWarning, UnreachedWarning
from signedheat.samples import sphere, union
from signedheat.surfaces.repaired_mesh import MeshRepaired

BALL = sphere(3)
ANGLES = np.linspace(0, 2 * np.pi, 121)
PARALLEL = np.stack([np.sqrt(0.96) * np.cos(ANGLES), np.sqrt(0.96) * np.sin(ANGLES), 0 * ANGLES + 0.2], axis=1)
FAR, NEAR = (int(np.argmax(BALL.vertices[BALL.faces].mean(axis=1) @ way)) for way in ([0, 0, 1], [0.98, 0, 0.2]))


CROSSED = np.unique(np.concatenate([BALL.polyline(PARALLEL[k : k + 12]).faces for k in range(0, 120, 15)]))[::7]


def strokes(mesh, turned=(15, 75)):
    """Pieces of a parallel, some of which run the other way."""
    return [mesh.polyline(PARALLEL[k : k + 12][:: -1 if k in turned else 1]) for k in range(0, 120, 15)]


def turned_face(face):
    faces = BALL.faces.copy()
    faces[face] = faces[face][::-1]
    return sh.TriangleMesh(BALL.vertices, faces)


def with_fin(face=FAR):
    corner = np.vstack([BALL.vertices, [[0, 0, 1.5]]])
    return sh.TriangleMesh(corner, np.vstack([BALL.faces, [[*BALL.faces[face][:2], BALL.n_vertices]]]))


def with_tent(faces):
    """Three faces over each of some, which an apex joins to its corners."""
    a, b, c = BALL.faces[faces].T
    apex = BALL.n_vertices + np.arange(len(faces))
    tents = np.concatenate([np.stack([tail, head, apex], axis=1) for tail, head in ((a, b), (b, c), (c, a))])
    tips = 0.8 * BALL.vertices[BALL.faces[faces]].mean(axis=1)
    return sh.TriangleMesh(np.vstack([BALL.vertices, tips]), np.vstack([BALL.faces, tents]))


def with_seam(lift=0.0):
    """Each half has vertices of its own, which may differ in the last places."""
    half = BALL.vertices[BALL.faces].mean(axis=1)[:, 0] > 0.3
    own = BALL.faces + np.where(half, BALL.n_vertices, 0)[:, None]
    used, faces = np.unique(own, return_inverse=True)
    return sh.TriangleMesh(np.vstack([BALL.vertices, BALL.vertices * (1 + lift)])[used], faces.reshape(-1, 3))


BROKEN = {
    "turned far away": lambda: turned_face(FAR),
    "turned below a stroke": lambda: turned_face(NEAR),
    "doubled": lambda: sh.TriangleMesh(BALL.vertices, np.vstack([BALL.faces, BALL.faces[[FAR, NEAR]]])),
    "doubled and turned": lambda: sh.TriangleMesh(BALL.vertices, np.vstack([BALL.faces[[FAR], ::-1], BALL.faces])),
    "fin": with_fin,
    "fin below a stroke": lambda: with_fin(NEAR),
    "fins like tents below all strokes": lambda: with_tent(CROSSED),
    "seam": with_seam,
    "seam but for rounding": lambda: with_seam(2.0**-52),
}


@pytest.fixture(scope="module")
def whole():
    """Distance on the ball itself."""
    return sh.signed_distance(strokes(BALL), BALL).values


@pytest.mark.parametrize("name", BROKEN)
def test_strokes_are_repaired_on_broken_meshes(name, whole):
    mesh = BROKEN[name]()
    field = sh.signed_distance(strokes(mesh), mesh)
    assert field.values.shape == (mesh.n_vertices,)
    away, same = cKDTree(BALL.vertices).query(mesh.vertices)
    on_ball = away < 1e-9
    np.testing.assert_allclose(field.values[on_ball], whole[same[on_ball]], atol=1e-3 if "tents" not in name else 0.02)
    assert (field.diagnostics.note(MeshRepaired) is None) == name.startswith(("fin", "seam"))


@pytest.mark.parametrize("name", [name for name in BROKEN if "tents" not in name])  # lines branch where those stand
def test_strokes_are_completed_on_broken_meshes(name):
    mesh = BROKEN[name]()
    [line] = sh.close_curves(strokes(mesh), mesh)
    assert line.closed
    np.testing.assert_allclose(mesh.positions(line)[:, 2], 0.2, atol=0.02)


def with_rounded_seam(units, seed):
    """The ball with a seam, all vertices moved at random by up to some units of single precision of its size."""
    mesh = with_seam()
    random = np.random.default_rng(seed)
    noise = units * 2.0**-23 * random.uniform(-1, 1, mesh.vertices.shape)
    return sh.TriangleMesh((mesh.vertices + noise).astype(np.float32), mesh.faces)


def moved(mesh, scale, offset, order):
    vertices = np.empty_like(mesh.vertices)
    vertices[order] = scale * mesh.vertices + offset
    return sh.TriangleMesh(vertices, order[mesh.faces])


@pytest.mark.parametrize("units", [1, 4, 16])
@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1 / 3, 0.0), (1e-3, 0.0), (1.0, 1e6), (7e4, 1e6)])
def test_seams_are_joined_whatever_rounded_them(units, scale, offset, whole):
    mesh = with_rounded_seam(units, units)
    order = np.random.default_rng(0).permutation(mesh.n_vertices)
    given = moved(mesh, scale, offset, order)
    # places on faces, which do not depend on how far away the surface is
    curves = [sh.Curve(curve.faces, curve.barycentric) for curve in strokes(mesh)]
    field = sh.signed_distance(curves, given)
    same = cKDTree(BALL.vertices).query(mesh.vertices)[1]
    np.testing.assert_allclose(field.values[order] / scale, whole[same], atol=1e-3)
    assert field.diagnostics.note(VerticesJoined).vertices_joined == mesh.n_vertices - BALL.n_vertices


@pytest.mark.parametrize(
    "measured",
    [
        lambda mesh, curves: sh.SignedHeatSolver(mesh).distance(curves),
        lambda mesh, curves: sh.SignedHeatSolver(mesh, intrinsic=True).distance(curves),
        lambda mesh, curves: sh.SignedHeatSolver(sh.intrinsic_delaunay(mesh, refine=True)).distance(curves).restrict(),
        lambda mesh, curves: sh.sharpen(sh.SignedHeatSolver(mesh).distance(curves), method=sh.methods.Convex()),
    ],
    ids=["solver", "intrinsic", "triangulation", "sharpen"],
)
@pytest.mark.parametrize("lift", [0.0, 2.0**-52])
def test_seams_are_joined_for_the_method_alone(measured, lift):
    mesh, same = with_seam(lift), cKDTree(BALL.vertices).query(with_seam(lift).vertices)[1]
    field = measured(mesh, strokes(mesh, turned=()))
    assert field.diagnostics.note(VerticesJoined).vertices_joined == mesh.n_vertices - BALL.n_vertices
    np.testing.assert_allclose(field.values, measured(BALL, strokes(BALL, turned=())).values[same], atol=1e-6)


def test_level_sets_pass_through_seams_on_both_sides_of_which_the_function_is_the_same():
    mesh = with_seam()
    height = mesh.vertices[:, 2]
    assert [line.closed for line in mesh.level_set(height, 0.2)] == [True]
    half = mesh.faces[mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0.3]
    higher = height + np.isin(np.arange(mesh.n_vertices), half)
    assert not any(line.closed for line in mesh.level_set(higher, 0.2))
    assert [line.closed for line in sh.signed_distance(strokes(mesh), mesh).contour(0.1)] == [True]


def test_curves_are_closed_across_seams():
    mesh = with_seam()
    [whole] = sh.close_curves(strokes(mesh), mesh)
    assert whole.closed
    np.testing.assert_allclose(mesh.positions(whole)[:, 2], 0.2, atol=0.05)
    phi = sh.piecewise_distance(strokes(mesh, turned=()), mesh)
    assert len(phi.domain.cuts(phi.values)) == 0


@pytest.mark.parametrize("units", [36, 100, 300])
def test_seams_that_are_not_joined_wholly_are_announced(units):
    mesh = with_rounded_seam(units, 0)
    with pytest.warns(InexactWarning, match="distance goes round the gap"):
        sh.signed_distance(mesh.level_set(mesh.vertices[:, 2], 0.1), mesh)


def test_narrow_strips_stay():
    """Edges across the strip are as long as rounding of seams is wide."""
    along, width = np.linspace(0, 1, 5), 2e-6
    points = np.array([[x, y, 0] for x in along for y in (0, width)])
    at = 2 * np.arange(4)[:, None]
    strip = sh.TriangleMesh(points, np.concatenate([at + np.array([0, 2, 1]), at + np.arange(1, 4)]))
    end = strip.path([0, 1])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        values = sh.signed_distance(end, strip).values
    np.testing.assert_allclose(np.abs(values), np.repeat(along, 2), atol=1e-9)


def test_parts_with_one_side_do_not_matter_elsewhere(whole):
    strip = band(20, 2, twisted=True)
    both = union(BALL, sh.TriangleMesh(strip.vertices + 5, strip.faces))
    with pytest.warns(UnreachedWarning, match="no source"):
        field = sh.signed_distance(strokes(both), both)
    np.testing.assert_allclose(field.values[: BALL.n_vertices], whole, atol=1e-4)
    assert np.isnan(field.values[BALL.n_vertices :]).all()


def test_pieces_on_a_klein_bottle_are_announced():
    bottle = klein_bottle(48, 24)
    path = bottle.path(np.arange(30) * 24 + 6)
    with pytest.warns(InexactWarning, match="one side"):
        pieces = sh.signed_distance(path, bottle)
    with pytest.warns(InexactWarning, match="bound no region"):
        loop = sh.signed_distance(bottle.path(np.arange(24) + 240, closed=True), bottle)
    assert np.isfinite(pieces.values).all() and np.isfinite(loop.values).all()
    near = np.linalg.norm(bottle.vertices - bottle.vertices[20 * 24 + 6], axis=1)
    circle = sh.signed_distance(bottle.level_set(near, 1.0), bottle)  # bounds a disk: no warning
    inside, outside = np.sign(circle.values[near < 0.6]), np.sign(circle.values[near > 1.4])
    assert np.all(inside == inside[0]) and np.all(outside == -inside[0])


def test_pieces_across_three_pages_are_announced():
    """Left of a curve from page to page is above one and below another."""
    pages = [[0, 1, 0], [0, 0, 1], [0, -1, -1]]
    mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], *pages], [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    across = mesh.polyline([[0.3, 0.2, 0.0], [0.5, 0.0, 0.0], [0.3, 0.0, 0.2]])
    with pytest.warns(InexactWarning, match="more than two faces"):
        sh.signed_distance(across, mesh)


def test_polygons_have_seams():
    side = np.arange(5.0)
    x, y = np.meshgrid(side, side, indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    ids = np.arange(25).reshape(5, 5)
    quads = np.stack([ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]], axis=-1).reshape(-1, 4)
    apart = sh.PolygonMesh(points[quads].reshape(-1, 3), np.arange(64).reshape(16, 4))
    ends = [[0, 1.5, 0], [4, 2.5, 0]]
    values = sh.signed_distance(apart.polyline(ends), apart).values
    whole = sh.PolygonMesh(points, quads)
    expected = sh.signed_distance(whole.polyline(ends), whole).values
    np.testing.assert_allclose(values, expected[quads.ravel()], atol=1e-9)


@pytest.mark.parametrize("copies", ["all", "all_turned", "one", "without_area"])
def test_the_method_alone_leaves_copies_out_too(copies):
    mesh = sphere(3)
    circle = 2 * np.pi * np.arange(120) / 120
    ring = np.stack([0.8 * np.cos(circle), 0.8 * np.sin(circle), 0.6 + 0 * circle], axis=1)
    far = mesh.faces[mesh.vertices[mesh.faces].mean(axis=1)[:, 2].argmin()]
    added = {
        "all": mesh.faces,
        "all_turned": mesh.faces[:, ::-1],
        "one": far[None],
        "without_area": far[None, [0, 1, 0]],
    }[copies]
    double = sh.TriangleMesh(mesh.vertices, np.concatenate([mesh.faces, added]))

    def values(surface):
        pieces = [mesh.polyline(ring[k : k + 22]) for k in range(0, 120, 30)]  # the first faces are the same
        solver = sh.SignedHeatSolver(surface)
        one, [many] = solver.distance(pieces), solver.distance_many([pieces])
        np.testing.assert_allclose(many.values, one.values, atol=1e-12)
        assert one.domain is surface
        return one.values

    np.testing.assert_allclose(values(double), values(mesh), atol=1e-9)
