"""Distance to the curves themselves: exact where they are there, completed where they are missing."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box
from shapes.domain_cases import ball, error, globe, sphere_points
from shapes.surface_cases import book
from shapes.surfaces import disk
from signedheat.curves.curve_distance import CurvesTaken
from signedheat.diagnostics import SharpenedToCurves, SmallLoops
from signedheat.errors import CancellingNormalsError, InexactWarning
from signedheat.samples import sphere, torus


def to_polygon(points: np.ndarray, corners: np.ndarray, closed: bool) -> np.ndarray:
    """Unsigned distance in the plane."""
    following = np.roll(corners, -1, axis=0) if closed else corners[1:]
    distance = np.full(len(points), np.inf)
    for a, b in zip(corners, following, strict=False):
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        distance = np.minimum(distance, np.linalg.norm(points - a - t[:, None] * (b - a), axis=1))
    return distance


def star(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle = np.sort((np.arange(9) + 0.8 * rng.random(9)) * 2 * np.pi / 9)
    radius = rng.uniform(0.25, 0.75, 9)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)


def inside(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    from matplotlib.path import Path

    return Path(corners[:, :2]).contains_points(points[:, :2])


@pytest.mark.parametrize("rings", [4, 20])
@pytest.mark.parametrize("seed", range(3))
def test_closed_polygons_in_the_plane(rings, seed):
    """However coarse the triangles, and however the polygon crosses them: exact, with the right sides."""
    mesh, corners = disk(rings), star(seed)
    phi = sh.signed_distance(mesh.polyline(corners, closed=True), mesh)
    exact = to_polygon(mesh.vertices, corners, True)
    assert np.abs(np.abs(phi.values) - exact).max() < 2e-5
    clear = exact > 1e-9
    assert ((phi.values > 0) == inside(mesh.vertices, corners))[clear].all()
    assert phi.diagnostics.note(SharpenedToCurves).sides_by_curves > 0.9


@pytest.mark.parametrize("as_oriented", [True, False])
def test_loops_inside_single_faces(as_oriented):
    """The method refuses them, as their heat cancels; the one call gives the faces vertices where they need some."""
    mesh = disk(3)
    center = mesh.vertices[mesh.faces[40]].mean(axis=0)
    size = np.sqrt(mesh.face_areas[40])
    corners = center + 0.15 * size * np.array([[1, 0, 0], [0.3, 1, 0], [-1, 0.4, 0], [-0.2, -1, 0]])
    loop = mesh.polyline(corners, closed=True)
    assert len(np.unique(loop.faces)) == 1
    with refused(CancellingNormalsError, "curves"):
        sh.SignedHeatSolver(mesh).distance(loop)
    phi = sh.signed_distance(loop, mesh, as_oriented=as_oriented)
    assert np.abs(phi.values + to_polygon(mesh.vertices, corners, True)).max() < 2e-5


@pytest.mark.filterwarnings("ignore::signedheat.errors.InexactWarning")  # one of the gaps is wide
@pytest.mark.parametrize("radius", [0.05, 0.3])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_pieces_of_curves_smaller_than_the_triangles_are_completed(radius, seed):
    """Five of every seven points on a circle, in uneven steps, on a cube of twelve triangles: as the whole, all but."""
    cube = box([-2] * 3, [2] * 3)
    angle = np.sort(np.random.default_rng(seed).uniform(0, 2 * np.pi, 28))
    ring = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) + [0.4, -0.1, 2]
    whole = sh.signed_distance(cube.polyline(ring, closed=True), cube).values
    pieces = sh.signed_distance([cube.polyline(ring[7 * k : 7 * k + 5]) for k in range(4)], cube).values
    assert (whole < 0).all()
    assert np.abs(pieces - whole).max() < 6 * radius


def test_loops_smaller_than_triangles_are_told():
    """The method hardly sees them; whoever measures to them, or to triangles made for them, needs no word."""
    mesh = disk(20)
    radius = 20**-1
    angle = np.linspace(0, 2 * np.pi, 9)[:-1] + 0.1
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    loops = [mesh.polyline(r * ring + [0.31, 0.2, 0], closed=True) for r in (0.5 * radius, 6 * radius)]
    solver = sh.SignedHeatSolver(mesh)
    for measured in (
        lambda: solver.distance(loops),
        lambda: solver.distance_many([loops])[0],
        lambda: sh.SignedHeatSolver(mesh).distance(loops),
    ):
        with pytest.warns(sh.errors.InexactWarning, match="closed curves"):
            assert measured().diagnostics.note(SmallLoops).small_loops == 1
    assert solver.distance(loops[1]).diagnostics.note(SmallLoops) is None
    assert solver.distance(mesh.polyline(0.5 * radius * ring[:5])).diagnostics.note(SmallLoops) is None
    sh.SignedHeatSolver(mesh, intrinsic=True).distance(loops)
    phi = sh.signed_distance(loops[0], mesh)
    away = np.linalg.norm(mesh.vertices - [0.31, 0.2, 0], axis=1)
    assert np.abs(phi.values - 0.5 * radius + away).max() < 0.1 * radius


@pytest.mark.parametrize("oriented", [True, False])
def test_open_polygons_and_points(oriented):
    mesh, corners = disk(20), star(5)[:5]
    points = sh.SurfacePoints([3, 40], [[0.2, 0.3, 0.5], [0.0, 0.5, 0.5]])
    places = np.einsum("ij,ijk->ik", points.barycentric, mesh.vertices[mesh.faces[points.faces]])
    curve = mesh.polyline(corners, oriented=oriented)
    plain = sh.SignedHeatSolver(mesh).distance([curve, points])
    phi = sh.sharpen(plain, [curve, points])
    exact = np.minimum(
        to_polygon(mesh.vertices, corners, False),
        np.linalg.norm(mesh.vertices[:, None] - places[None], axis=2).min(axis=1),
    )
    if oriented:  # beyond its ends the zero set goes on
        assert (np.abs(phi.values) < exact + 2e-5).all()
        assert phi.diagnostics.note(SharpenedToCurves).free_ends == 2
    else:
        assert np.abs(phi.values - exact).max() < 2e-5


def test_a_gap_is_completed():
    """A line with a gap: distance to the whole line, which a straight zero set completes."""
    x, y = np.meshgrid(np.arange(31.0), np.arange(21.0), indexing="ij")
    corner = np.arange(31 * 21).reshape(31, 21)[:-1, :-1].ravel()
    faces = np.concatenate([corner[:, None] + [0, 21, 22], corner[:, None] + [0, 22, 1]])
    mesh = sh.TriangleMesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), faces)
    pieces = [mesh.polyline([[0, 10.3, 0], [12, 10.3, 0]]), mesh.polyline([[18, 10.3, 0], [30, 10.3, 0]])]
    phi = sh.signed_distance(pieces, mesh)
    assert np.abs(phi.values - (y.ravel() - 10.3)).max() < 0.3
    note = phi.diagnostics.note(SharpenedToCurves)
    assert note.free_ends == 2
    assert 0.1 < note.completed_length < 0.3


def pieces_of_a_parallel(surface, center, height: float) -> list[sh.Curve]:
    """Twelve arcs of the parallel at this height, with gaps of two fifths between them; every fourth is turned."""
    curves = []
    for k in range(12):
        angle = 2 * np.pi / 12 * (k + np.linspace(0, 0.6, 11))
        arc = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.sqrt(1 - height**2)
        points = np.pad(arc, ((0, 0), (0, 1)), constant_values=height) + center
        curves.append(surface.polyline(points[::-1] if k % 4 == 1 else points))
    return curves


def ball_of_voxels():
    volume, spacing, first = ball(28)
    return sh.DigitalSurface(volume, spacing, first), np.zeros(3)


@pytest.mark.parametrize(
    ("build", "bound"),
    [
        (lambda: (sphere(3), np.zeros(3)), 3e-3),
        (lambda: (sh.PolygonMesh(*globe(24)), np.zeros(3)), 2e-3),
        (lambda: (sh.PointCloud(sphere_points(1500)), np.zeros(3)), 1e-3),
        (ball_of_voxels, 4e-3),
    ],
    ids=["triangles", "polygons", "points", "voxels"],
)
def test_turned_and_lost_pieces_on_every_surface(build, bound):
    """Two fifths of a parallel are missing and a quarter of the rest is turned: still the distance to the parallel."""
    surface, center = build()
    curves = pieces_of_a_parallel(surface, center, 0.3)
    phi = sh.signed_distance(curves, surface).restrict()
    vertices = surface.points if isinstance(surface, sh.PointCloud) else surface.vertices
    out = (vertices - center) / np.linalg.norm(vertices - center, axis=1, keepdims=True)
    exact = np.arcsin(out[:, 2].clip(-1, 1)) - np.arcsin(0.3)
    assert error(phi.values, exact) < bound


@pytest.mark.parametrize("build", [lambda: sphere(3), lambda: torus(n_around=30, n_across=16)])
def test_level_sets_are_measured_to_exactly(build):
    """To a level set of the mesh there are two routes: to the curve, and to the zero line of the function."""
    mesh = build()
    values = mesh.vertices @ [0.3, 0.2, 0.9] - 0.21
    curves = mesh.level_set(values)
    phi = sh.signed_distance(curves, mesh)
    line = sh.sharpen(sh.Field(mesh, values))
    assert np.abs(phi.values - line.values).max() < 1e-3 * mesh.edge_lengths.mean()


def test_turning_a_curve_turns_the_sign():
    mesh = sphere(3)
    curve = mesh.level_set(mesh.vertices[:, 2], 0.31)[0]
    phi, turned = (sh.signed_distance(c, mesh).values for c in (curve, curve.reversed()))
    assert np.abs(phi + turned).max() < 1e-12


def test_a_curve_that_bounds_nothing():
    """Round the tube of a torus: the curve tells no sides, and the method completes it on the far side."""
    mesh = torus(n_around=60, n_across=24)
    with pytest.warns(sh.errors.InexactWarning, match="piecewise_distance"):
        note = sh.signed_distance(mesh.path(np.arange(24), closed=True), mesh).diagnostics.note(SharpenedToCurves)
    assert note.free_ends == 0
    assert note.sides_by_curves < 0.1
    assert note.completed_length > 0.3


def test_a_loop_round_a_small_hole_through_a_plate_bounds_nothing():
    """The sides meet in the hole, whose circumference is a twentieth of the loop's or less."""
    n = 61
    ids = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    x, y = np.unravel_index(ids.ravel(), ids.shape)
    corners = np.stack([ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]], axis=-1).reshape(-1, 4)
    corners = np.delete(corners, len(corners) // 2, axis=0)
    top = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    halfedges = np.concatenate([top[:, [0, 1]], top[:, [1, 2]], top[:, [2, 0]]])
    rim = set(map(tuple, halfedges.tolist())) - set(map(tuple, halfedges[:, ::-1].tolist()))
    (a, b), below = np.array(sorted(rim)).T, ids.size
    walls = np.concatenate([np.stack([b, a, a + below], axis=1), np.stack([b, a + below, b + below], axis=1)])
    positions = np.concatenate([np.stack([x, y, z + 0 * x], axis=1) for z in (0, -1)]) - [n / 2, n / 2, 0]
    plate = sh.TriangleMesh(positions, np.concatenate([top, top[:, ::-1] + below, walls]))
    radius = np.hypot(*positions[:, :2].T)
    loop = plate.level_set(np.where(positions[:, 2] == 0, 24.3 - radius, -1 - radius))[0]
    with pytest.warns(sh.errors.InexactWarning, match="bound no region"):
        note = sh.signed_distance(loop, plate).diagnostics.note(SharpenedToCurves)
    assert 0.001 < note.completed_length < 0.05


def test_levels_of_their_own_are_refused():
    mesh = sphere(2)
    curve = mesh.level_set(mesh.vertices[:, 2], 0.3)
    with pytest.raises(sh.errors.ConstraintError) as caught:
        sh.signed_distance(curve, mesh, constraint=sh.constraints.EachComponent())
    assert caught.value.remedy


@pytest.mark.parametrize("pages", [3, 5])
def test_lines_that_meet_on_a_spine_are_never_turned(pages):
    """No direction goes on from one page of a book to all others, so that the ends of three lines tell nothing."""
    mesh = book(pages, 12)
    height = mesh.vertices[:, 2] - 0.37 - 0.2 * np.hypot(*mesh.vertices[:, :2].T)
    lines = mesh.level_set(height, 0.0)
    assert len(lines) == pages
    phi = sh.signed_distance(lines, mesh)
    assert np.array_equal(np.sign(phi.values), np.sign(height))
    assert np.allclose(phi.values, sh.signed_distance(lines, mesh, as_oriented=True).values, rtol=0, atol=1e-12)


def test_circles_that_bound_together_are_completed_by_nothing():
    """Both circles of a section across a torus: nothing is told."""
    mesh = torus(n_around=48, n_across=16)
    circles = mesh.level_set(mesh.vertices @ [1.0, 0.15, 0.1], 0.1)
    assert len(circles) == 2
    both = sh.signed_distance(circles, mesh).diagnostics.note(SharpenedToCurves)
    assert both.completed_length == 0


def test_pieces_with_normals_on_faces_that_look_either_way():
    """They are not turned: a third of the signs and more were wrong."""
    ball = sphere(3)
    flipped = (np.random.default_rng(0).random(ball.n_faces) < 0.4)[:, None]
    mesh = sh.TriangleMesh(ball.vertices, np.where(flipped, ball.faces[:, ::-1], ball.faces))
    height = mesh.vertices @ [1.0, 0.15, 0.1] + 0.13
    whole = mesh.level_set(height, 0.0)[0]
    assert whole.normals is not None
    step = whole.n_points // 4
    kept = int(0.65 * step)
    pieces = [
        sh.Curve(whole.faces[a : a + kept], whole.barycentric[a : a + kept], normals=whole.normals[a : a + kept - 1])
        for a in range(0, 4 * step, step)
    ]
    phi = sh.signed_distance(pieces, mesh)
    assert np.mean(np.sign(phi.values) != np.sign(height)) < 0.01


@pytest.mark.parametrize("times", [2, 5])
def test_more_points_on_the_same_lines_change_nothing(times):
    """A level set of a ball, in pieces, with further points on each of its segments."""
    mesh = sphere(3)
    whole = mesh.level_set(mesh.vertices @ [0.2, 0.1, 1.0], 0.2)[0]
    n = whole.n_points
    pieces = [sh.Curve(whole.faces[k : k + n // 5], whole.barycentric[k : k + n // 5]) for k in range(0, n - 2, n // 4)]
    finer = []
    for piece in pieces:
        # the points of a level set lie on edges: every two that follow each other are in one face
        at = np.einsum("nk,nkd->nd", piece.barycentric, mesh.vertices[mesh.faces[piece.faces]])
        steps = (np.arange(times) / times)[None, :, None]
        between = np.concatenate([(at[:-1, None] + steps * np.diff(at, axis=0)[:, None]).reshape(-1, 3), at[-1:]])
        finer.append(mesh.polyline(between))
        assert finer[-1].n_points == times * (piece.n_points - 1) + 1
    coarse, fine = (sh.signed_distance(curves, mesh).values for curves in (pieces, finer))
    np.testing.assert_allclose(fine, coarse, atol=1e-6 * np.ptp(coarse))


def at_height(mesh, height):
    return mesh.level_set(mesh.vertices[:, 2], height)


def two_balls():
    ball = sphere(2)
    vertices = np.concatenate([ball.vertices, ball.vertices + np.array([4, 0, 0])])
    return sh.TriangleMesh(vertices, np.concatenate([ball.faces, ball.faces + ball.n_vertices]))


def lower_half():
    """A mesh with vertices that are in no face."""
    ball = sphere(3)
    return sh.TriangleMesh(ball.vertices, ball.faces[ball.vertices[ball.faces].mean(axis=1)[:, 2] < 0.2])


DECIDING = {
    "loop": lambda: (globe := sphere(3), at_height(globe, 0.3)),
    "band": lambda: (globe := sphere(3), [*at_height(globe, 0.4), *(c.reversed() for c in at_height(globe, -0.3))]),
    "loop and point": lambda: (globe := sphere(3), [*at_height(globe, 0.3), globe.points_at(7)]),
    "from rim to rim": lambda: (plate := disk(6), plate.level_set(plate.vertices[:, 1], 0.13)),
    "points alone": lambda: (globe := sphere(3), [globe.points_at([3, 50])]),
    "one of two parts": lambda: (both := two_balls(), at_height(both, 0.3)[:1]),
    "vertices without faces": lambda: (part := lower_half(), at_height(part, -0.3)),
    "along edges": lambda: (globe := sphere(3), [globe.path(globe.faces[0], closed=True)]),
}
"""Curves that lack nothing, and sources without sides, with the mesh that they lie on."""


@pytest.mark.filterwarnings("ignore:no source is connected")
@pytest.mark.parametrize("name", DECIDING)
def test_no_heat_where_curves_decide_all_sides(name, monkeypatch):
    """The same values as after diffusion, up to the rounding of other triangles, without a system that is solved."""
    mesh, curves = DECIDING[name]()
    expected = sh.sharpen(sh.SignedHeatSolver(mesh).distance(curves), curves).values

    def refuse(*_, **__):
        raise AssertionError("a system was solved")

    for step in ("diffuse", "integrate"):
        monkeypatch.setattr(f"signedheat.solver.{step}", refuse)
    np.testing.assert_allclose(sh.signed_distance(curves, mesh).values, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("curves", ["gap", "figure of eight", "loop around a handle"])
def test_heat_where_curves_leave_sides_open(curves, monkeypatch):
    mesh = torus(n_around=48, n_across=24) if curves == "loop around a handle" else disk(12)
    angle = np.linspace(0, 2 * np.pi, 40)[: 30 if curves == "gap" else -1]
    if curves == "gap":
        given = mesh.polyline(0.5 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
    elif curves == "figure of eight":
        given = mesh.polyline(0.6 * np.stack([np.sin(angle), np.sin(2 * angle), 0 * angle], axis=1), closed=True)
    else:
        given = mesh.path(np.arange(24), closed=True)

    def refuse(*_, **__):
        raise InterruptedError

    monkeypatch.setattr("signedheat.solver.diffuse", refuse)
    with pytest.raises(InterruptedError):
        sh.signed_distance(given, mesh)


def test_loops_side_by_side_are_read_as_before():
    """Two loops much less than a triangle apart, which run against each other: a band, or a loop drawn twice."""
    globe = sphere(3)
    curves = [*at_height(globe, 0.1), *(curve.reversed() for curve in at_height(globe, 0.1001))]
    with pytest.warns(InexactWarning, match="ran against"):
        phi = sh.signed_distance(curves, globe)
    assert len(phi.diagnostics.note(CurvesTaken).turned) == 1
