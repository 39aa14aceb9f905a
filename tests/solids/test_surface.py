"""Surfaces of solids: closed, manifold, with sharp edges, and without triangles that pass through each other."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

import signedheat as sh
from refusals import refused
from shapes.bodies import box, finer
from shapes.grid_cases import assert_closed_manifold
from signedheat import samples
from signedheat.errors import InexactWarning, OutsideError
from signedheat.mesh.self_intersections import self_intersections
from signedheat.solids import contouring, kept_faces, simplification
from signedheat.solids.bodies import crossing_faces
from signedheat.solids.completion import complete
from signedheat.solids.contouring import sharp_surface
from signedheat.solids.offsets import Offset
from signedheat.solids.simplification import is_within


def turned(mesh, seed=0):
    turn = scipy.spatial.transform.Rotation.random(random_state=seed).as_matrix()
    return sh.TriangleMesh(mesh.vertices @ turn.T, mesh.faces)


def crumpled(seed):
    ball = samples.sphere(2)
    return sh.TriangleMesh(
        ball.vertices * np.random.default_rng(seed).normal(1, 0.35, (len(ball.vertices), 1)), ball.faces
    )


SHAPES = {
    "box": lambda: turned(box((-1.0, -0.7, -0.2), (1.0, 0.6, 0.3))),
    "box on nodes": lambda: box((-1.0, -0.5, -0.25), (1.0, 0.5, 0.25)),
    "plate thinner than two cells": lambda: turned(box((-1.0, -0.8, 0.0), (1.0, 0.7, 0.1)), 3),
    "torus with holes": lambda: samples.without_patches(samples.torus(n_around=48, n_across=24), 3, 0.3, seed=1),
    "two bodies": lambda: samples.union(samples.sphere(3), turned(box((0.2, -0.3, -0.3), (1.5, 0.4, 0.3)))),
    "crumpled": lambda: crumpled(1),
}


@pytest.fixture(scope="module", params=SHAPES)
def solid(request):
    return complete(SHAPES[request.param]())


@pytest.mark.filterwarnings("ignore:cells of")  # .04 below the faces of the plate are .02 left, a third of a cell
@pytest.mark.parametrize("level", [0.0, 0.06, -0.04])
def test_closed_and_apart(solid, level):
    surface = solid.surface(level, resolution=28)
    assert_closed_manifold(surface)
    assert not len(self_intersections(surface.vertices, surface.faces))


WIRE = box((-1.0, -0.012, -0.012), (1.0, 0.012, 0.012))
BALL_AND_GRAIN = samples.union(samples.sphere(3, 0.25), samples.sphere(2, 0.01, (0.1, 0.6, 0.05)))


@pytest.mark.parametrize("sharp", [True, False])
@pytest.mark.parametrize(("shape", "level"), [(WIRE, 0.0), (WIRE, 0.005), (BALL_AND_GRAIN, 0.0)])
def test_what_is_thinner_than_a_cell_is_announced(shape, level, sharp):
    solid = complete(turned(shape))
    with pytest.warns(InexactWarning, match="smaller"):
        solid.surface(level, sharp=sharp, spacing=0.07)
    solid.surface(level, sharp=sharp, spacing=0.012)


def test_tips_and_edges_are_not_announced():
    """Every cone is thinner than a cell at its tip, and every wedge along its edge."""
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    rim = np.c_[0.3 * np.cos(angles), 0.3 * np.sin(angles), np.zeros(40)]
    next_ones = np.roll(np.arange(40), -1)
    sides = [np.c_[np.arange(40), next_ones, np.full(40, tip)] for tip in (40, 41)]
    cone = sh.TriangleMesh(np.vstack([rim, [[0, 0, 1.5]], [[0, 0, 0]]]), np.vstack([sides[0], sides[1][:, ::-1]]))
    for shape in (cone, box((-1.0, -1.0, 0.0), (1.0, 1.0, 0.2))):
        complete(turned(shape)).surface(resolution=40)


@pytest.mark.parametrize("seed", range(4))
def test_corners_and_edges_of_boxes_are_exact(seed):
    """Marching cubes cuts them off by .2 cells at the median and up to .7."""
    rng = np.random.default_rng(seed)
    shape = turned(box(rng.uniform(-1, -0.3, 3), rng.uniform(0.3, 1, 3)), seed)
    solid = complete(shape)
    spacing = float(np.ptp(solid.bounds, axis=0).max()) / 35
    surface = complete(solid.surface(spacing=spacing), as_oriented=True)
    assert np.abs(surface.distance(shape.vertices)).max() < 1e-6 * spacing
    a, b = shape.vertices[
        np.unique(np.sort(shape.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    ].swapaxes(0, 1)
    along = (a[:, None] + np.linspace(0, 1, 50)[:, None] * (b - a)[:, None]).reshape(-1, 3)  # diagonals of sides, too
    off = np.abs(surface.distance(along)) / spacing
    assert np.quantile(off, 0.95) < 1e-3
    assert off.max() < 0.15


def test_edges_that_cut_creases_off_are_divided(monkeypatch):
    """Notches, some of whose creases pass through cells without crossing their edges: sums of the largest distances."""
    body, notch = box((-1.0, -0.7, -0.3), (1.0, 0.6, 0.3)), box((-0.4, -0.2, -0.1), (0.5, 0.9, 0.9))
    solids = [complete(turned(body, seed)) - complete(turned(notch, seed)) for seed in range(6)]
    largest = []
    for divisions in (contouring.DIVISIONS, 0):
        monkeypatch.setattr(contouring, "DIVISIONS", divisions)
        largest.append(0.0)
        for solid in solids:
            surface = solid.surface(spacing=0.1)
            assert_closed_manifold(surface)
            assert not len(self_intersections(surface.vertices, surface.faces))
            middles = surface.vertices[surface.faces] + surface.vertices[np.roll(surface.faces, 1, axis=1)]
            largest[-1] += np.abs(solid.distance(0.5 * middles.reshape(-1, 3))).max() / 0.1
    assert largest[0] < 0.85 * largest[1]


def test_the_offset_of_a_field_is_the_surface_in_its_cells_to_the_last_bit():
    solid = sh.complete(samples.with_noise(samples.torus(n_around=48, n_across=24), 0.01, seed=1))
    field = solid.field(resolution=80)
    offset, surface = field.offset(0.05), sharp_surface(Offset(solid, 0.05), field.domain)
    np.testing.assert_array_equal(offset.vertices, surface.vertices)
    np.testing.assert_array_equal(offset.faces, surface.faces)


def test_inner_offsets_have_edges_and_outer_ones_are_round():
    solid = complete(turned(box((-1.0, -0.7, -0.5), (1.0, 0.6, 0.5))))
    inner, outer = (solid.surface(level, spacing=0.05) for level in (-0.15, 0.15))
    for surface, level in ((inner, -0.15), (outer, 0.15)):
        off = np.abs(solid.distance(surface.vertices) - level)
        assert np.quantile(off, 0.99) < 1e-3 * 0.05
    volumes = [each.vertices[each.faces] for each in (inner, outer)]
    inside, outside = (np.einsum("ij,ij->i", v[:, 0], np.cross(v[:, 1], v[:, 2])).sum() / 6 for v in volumes)
    assert inside == pytest.approx(1.7 * 1.0 * 0.7, rel=2e-4)
    a, b, c, d = 2.0, 1.3, 1.0, 0.15  # Steiner's formula
    steiner = a * b * c + 2 * d * (a * b + b * c + c * a) + np.pi * d**2 * (a + b + c) + 4 / 3 * np.pi * d**3
    assert outside == pytest.approx(steiner, rel=2e-3)


def test_balls_are_as_good_as_their_grid():
    surface = complete(samples.sphere(5)).surface(0.2, resolution=40)
    assert np.abs(np.linalg.norm(surface.vertices, axis=1) - 1.2).max() < 1e-3


def test_turning_and_scaling_turn_and_scale():
    """Cells do not turn, so that it is the surface that is the same, not its triangles."""
    shape = box((-1.0, -0.7, -0.2), (1.0, 0.6, 0.3))
    volumes = []
    for scale in (1e-6, 1.0, 1e6):
        large = sh.TriangleMesh(scale * turned(shape).vertices, shape.faces)
        surface = complete(large).surface(resolution=30)
        corners = surface.vertices[surface.faces] / scale
        volumes.append(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6)
    np.testing.assert_allclose(volumes, 2 * 1.3 * 0.5, rtol=1e-3)


def test_smooth_surfaces_are_those_of_the_field():
    solid = complete(samples.sphere(3))
    surface = solid.surface(0.1, sharp=False, resolution=24)
    assert_closed_manifold(surface)
    assert np.abs(solid.distance(surface.vertices) - 0.1).max() < 1e-3


def test_levels_that_are_not_taken():
    with refused(OutsideError):
        complete(samples.sphere(2)).surface(-2.0, resolution=16)
    with refused(OutsideError):
        complete(turned(box((0, 0, 0), (1, 1, 1e-6)))).surface(resolution=16)


def test_triangles_that_meet_are_found():
    flat = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]])
    through = np.array([[0.5, 0.5, -1], [0.6, 0.5, 1], [0.5, 0.6, 1]])
    for other, meets in (
        (through, True),
        (through + np.array([5, 0, 0]), False),
        (0.5 * flat + np.array([0.1, 0.1, 0]), True),  # covers a part
        (flat + np.array([0, 0, 1e-3]), False),
        (flat * np.array([-1, 0.5, 1]) + np.array([0, 0.2, 0]), True),  # touches along a part of an edge
        (flat * np.array([-1, 1, 1]) - np.array([1e-3, 0, 0]), False),
    ):
        pairs = self_intersections(np.concatenate([flat, other]), np.arange(6).reshape(2, 3))
        assert len(pairs) == meets
    folded = np.array([[0, 1, 2], [2, 1, 3]])
    assert len(self_intersections(np.concatenate([flat, [[0.2, 0.2, 0]]]), folded)) == 1
    assert len(self_intersections(np.concatenate([flat, [[2.0, 2, 0]]]), folded)) == 0


def broken():
    """Shapes, and the volumes of the solids that they are pictures of."""
    plank, post = box((-1, -0.7, -0.2), (1, 0.6, 0.3)), box((-0.3, -0.3, -0.9), (0.2, 0.3, 0.8))
    whole = 2 * 1.3 * 0.5
    yield "box", plank, whole
    yield "a face gone", sh.TriangleMesh(plank.vertices, plank.faces[1:]), whole
    yield "a side gone", sh.TriangleMesh(plank.vertices, plank.faces[2:]), whole
    yield "a cross", samples.union(plank, post), whole + 0.5 * 0.6 * (1.7 - 0.5)
    yield "touching", samples.union(plank, box((1, -0.3, -0.1), (1.5, 0.3, 0.2))), whole + 0.5 * 0.6 * 0.3
    yield "sides in one plane", samples.union(plank, box((-0.3, -0.7, -0.2), (1.8, 0.6, 0.3))), 2.8 * 1.3 * 0.5
    yield "turned faces", samples.with_flipped_faces(plank, 0.3, seed=1), whole
    yield "soup", samples.soup(plank), whole


@pytest.mark.parametrize(("shape", "volume"), [pytest.param(*rest, id=name) for name, *rest in broken()])
def test_given_faces_are_kept(shape, volume):
    surface = complete(shape).surface()
    assert_closed_edges(surface)
    assert not len(self_intersections(surface.vertices, surface.faces))
    corners = surface.vertices[surface.faces]
    found = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert found == pytest.approx(volume, rel=1e-3)


def test_gaps_between_sheets_are_closed_and_all_faces_kept():
    """A box of six sheets with gaps between them."""
    plank = box((-1, -0.7, -0.2), (1, 0.6, 0.3))
    triangles = plank.vertices[plank.faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    sides = [triangles[(normals @ axis) > 0] for axis in (*np.eye(3), *-np.eye(3))]
    middles = [side.reshape(-1, 3).mean(axis=0) for side in sides]
    shrunk = [middle + 0.99 * (side - middle) for side, middle in zip(sides, middles, strict=True)]
    sheets = sh.TriangleMesh(np.concatenate(shrunk).reshape(-1, 3), np.arange(36).reshape(-1, 3))
    surface = complete(turned(sheets)).surface()
    assert_closed_edges(surface)
    assert not len(self_intersections(surface.vertices, surface.faces))
    corners = surface.vertices[surface.faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(2 * 1.3 * 0.5, rel=0.01)
    middle = turned(sh.TriangleMesh(np.array(middles), [[0, 1, 2], [3, 4, 5]])).vertices
    flat = complete(surface, as_oriented=True)
    np.testing.assert_allclose(flat.distance(middle), 0, atol=1e-9)


def test_faces_are_kept_where_heat_completes_them():
    """What φ completes joins the rims by seams."""
    ball = samples.without_patches(samples.sphere(3), 2, 0.5)
    surface = complete(ball, completion="heat").surface()
    assert_closed_edges(surface)
    there = {tuple(corners) for corners in np.round(surface.vertices[surface.faces].reshape(-1, 9), 12).tolist()}
    given = np.round(ball.vertices[ball.faces].reshape(-1, 9), 12).tolist()
    assert np.mean([tuple(corners) in there for corners in given]) > 0.1


def test_loose_faces_join_with_what_heat_completes():
    solid = complete(samples.without_faces(samples.sphere(3), 0.75, 1), completion="heat")
    surface = solid.surface()
    assert_closed_edges(surface)
    corners = surface.vertices[surface.faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volume == pytest.approx(solid.volume, rel=1e-6)
    assert np.abs(solid.distance(surface.vertices)).max() < 1e-5


def assert_closed_edges(surface):
    """As many faces run along each edge one way as the other."""
    tails, heads = surface.faces.ravel(), np.roll(surface.faces, -1, axis=1).ravel()
    there = scipy.sparse.coo_array((np.ones(len(tails)), (tails, heads))).tocsr()
    assert abs(there - there.T).sum() == 0


def test_whole_shapes_keep_their_faces_as_they_are():
    torus = samples.torus()
    surface = complete(torus).surface()
    given, kept = (np.sort(each.vertices[each.faces].reshape(-1, 9), axis=0) for each in (torus, surface))
    np.testing.assert_array_equal(kept, given)


@pytest.mark.parametrize("apart", [3.0, 1.0])
def test_crossings_are_not_looked_for_twice(apart, monkeypatch):
    """Where completing found none, the surface is the same as where it looks again; what was cut is looked at."""
    solid = sh.complete([samples.sphere(2), samples.sphere(2, center=(apart, 0.1, 0.2))])
    assert solid.uncrossed == (apart > 2) and not sh.transform(solid, np.eye(4)).uncrossed
    again = replace(solid, uncrossed=False).surface()
    searched = []
    monkeypatch.setattr(kept_faces, "crossing_faces", lambda *given: searched.append(1) or crossing_faces(*given))
    made = solid.surface()
    assert len(searched) == (apart < 2)
    np.testing.assert_array_equal(made.vertices, again.vertices)
    np.testing.assert_array_equal(made.faces, again.faces)


def test_a_level_or_a_grid_asks_for_a_contour_and_nothing_else_does():
    ball = samples.sphere(2)
    solid = complete(ball)
    assert solid.surface().n_faces == solid.surface(tolerance=1e-9).n_faces == ball.n_faces
    for asked in ({"level": 0.0}, {"spacing": 0.2}, {"resolution": 12}, {"sharp": False}):
        assert solid.surface(**asked).n_faces != ball.n_faces


def test_sheets_have_no_surface():
    sheet = sh.TriangleMesh([[0, 0, 0], [1, 0, 0.1], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    with refused(sh.errors.GeometryError):
        complete(sheet).surface()


@pytest.mark.parametrize("name", ["box", "torus with holes", "two bodies"])
def test_simplified_surfaces_are_closed_and_within_the_tolerance(name):
    solid = complete(SHAPES[name]())
    plain, simple = solid.surface(resolution=28), solid.surface(resolution=28, tolerance=0.01)
    assert_closed_manifold(simple)
    assert not len(self_intersections(simple.vertices, simple.faces))
    assert simple.n_faces < (50 if name == "box" else 0.9 * plain.n_faces)
    for one, other in ((simple, plain), (plain, simple)):
        places = np.concatenate([one.vertices, one.vertices[one.faces].mean(axis=1)])
        assert np.abs(complete(other).distance(places)).max() <= 0.01 * (1 + 1e-9)
    with refused(sh.errors.SignedHeatError):
        solid.surface(tolerance=-1)


def test_tolerances_larger_than_the_shape_leave_something():
    solid = complete(samples.sphere(2))
    made = solid.surface(tolerance=10.0)
    assert 0 < made.n_faces < len(solid.triangles) and complete(made).volume > 0


def test_distances_between_surfaces_are_proven_whichever_way_they_are_divided():
    coarse = SHAPES["box"]()
    fine = coarse
    for _ in range(4):
        fine = sh.TriangleMesh(*finer(fine.vertices, fine.faces))
    up = np.array([0.0, 0.0, 0.01])
    for one, other in ((fine, coarse), (coarse, fine)):
        assert is_within(one, other, 1e-9)
        moved = sh.TriangleMesh(other.vertices + up, other.faces)
        assert is_within(one, moved, 0.0101)
        assert not is_within(one, moved, 0.005)
    lost = sh.TriangleMesh(fine.vertices, fine.faces[4:])  # a hole of some triangles
    assert is_within(lost, fine, 1e-9)
    assert not is_within(fine, lost, 1e-3)
    assert not is_within(coarse, lost, 1e-3)


def test_surfaces_that_are_not_simplified_are_returned_with_a_warning(monkeypatch):
    monkeypatch.setattr(simplification, "TOLERANCE_ATTEMPTS", 0)  # as where none of them succeeds
    surface = samples.sphere(2)
    with pytest.warns(sh.errors.InexactWarning, match="not simplified"):
        assert simplification.simplified(surface, 0.08) is surface
