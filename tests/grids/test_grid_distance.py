import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import (
    assert_closed_manifold,
    box,
    broken_spheres,
    relative_error,
    rms,
    sphere,
    sphere_distance,
    torus_distance,
)
from signedheat import samples
from signedheat.diagnostics import SampledSource
from signedheat.discretization import discretize
from signedheat.grids.grid_discretization import memory_estimate

BROKEN = broken_spheres()


def test_sphere_plain_and_sharpened():
    grid = box(64)
    plain, exact = sh.SignedHeatSolver(grid).distance(sphere(10000)), sphere_distance(grid)
    assert relative_error(plain.values, exact) <= 0.0015
    assert relative_error(sh.sharpen(plain).values, exact) <= 0.0002


def test_points_that_are_lost_in_one_cell_are_refused():
    """Their area, 1e−59 of that of a cell, is no number in single precision."""
    points = sphere(100).vertices
    with refused(sh.errors.SourceError, "source"):
        sh.SignedHeatSolver(sh.Grid((-1, -1, -1), 0.3, (8, 8, 8))).distance(sh.PointCloud(1e-30 * points, points))


@pytest.mark.parametrize("n", [12, 24, 32, 33, 47])
def test_few_nodes(n):
    grid = box(n)
    field = sh.SignedHeatSolver(grid).distance(sphere(10000))
    assert rms(field.values - sphere_distance(grid)) <= 0.06 * grid.spacing[0]


@pytest.mark.parametrize(
    "shape, distance", [(sphere(40000), sphere_distance), (samples.torus(1.0, 0.4, 300, 150), torus_distance)]
)
def test_sharpened_distance_is_second_order(shape, distance):
    nodes = np.array([20, 32, 48])
    errors = [rms(sh.sharpen(sh.SignedHeatSolver(box(n)).distance(shape)).values - distance(box(n))) for n in nodes]
    slope = np.polyfit(np.log(1 / (nodes - 1)), np.log(errors), 1)[0]
    assert slope >= 1.7


@pytest.mark.parametrize("name", BROKEN)
def test_broken_shapes(name):
    grid = box(48)
    exact = sphere_distance(grid)
    field = sh.sharpen(sh.SignedHeatSolver(grid).distance(BROKEN[name]))
    assert np.isfinite(field.values).all()
    assert relative_error(field.values, exact) <= 0.005
    away = np.abs(exact) > 3 * grid.spacing[0]
    assert np.mean((field.values > 0)[away] == (exact > 0)[away]) >= 0.999
    assert_closed_manifold(field.offset(0.2))


def test_sharpening_keeps_signs_and_changes_nothing_it_measured():
    field = sh.sharpen(sh.SignedHeatSolver(box(48)).distance(BROKEN["holes"]))
    again = sh.sharpen(field)
    assert ((field.values > 0) == (again.values > 0)).all()
    assert rms(again.values - field.values) < 0.02 * field.domain.spacing[0]


def test_anisotropic_spacing_and_any_origin():
    shape = sphere(5000, radius=2.0, center=(100.0, -50.0, 7.0))
    grid = sh.Grid((96.8, -53.1, 3.9), (0.1, 0.14, 0.25), (64, 45, 26))
    exact = np.linalg.norm(grid.points - (100.0, -50.0, 7.0), axis=-1) - 2.0
    field = sh.sharpen(sh.SignedHeatSolver(grid).distance(shape))
    assert relative_error(field.values, exact) < 0.002


def test_units_reversal_order_and_repetition():
    shape, grid = BROKEN["noise"], box(40)
    field = sh.SignedHeatSolver(grid).distance(shape).values
    assert np.array_equal(field, sh.SignedHeatSolver(grid).distance(shape).values)
    for scale in (1e-6, 1e6):
        scaled = sh.TriangleMesh(scale * shape.vertices, shape.faces)
        values = (
            sh.SignedHeatSolver(sh.Grid(scale * grid.origin, scale * grid.spacing, grid.shape)).distance(scaled).values
        )
        np.testing.assert_allclose(values / scale, field, atol=2e-5)
    reversed_shape = sh.TriangleMesh(shape.vertices, shape.faces[:, ::-1])
    np.testing.assert_allclose(sh.SignedHeatSolver(grid).distance(reversed_shape).values, -field, atol=2e-5)
    order = np.random.default_rng(0).permutation(shape.n_faces)
    shuffled = sh.SignedHeatSolver(grid).distance(sh.TriangleMesh(shape.vertices, shape.faces[order])).values
    np.testing.assert_allclose(shuffled, field, atol=2e-5)


def test_triangles_quadrilaterals_and_points_agree():
    tube = samples.torus(1.0, 0.4, 80, 40)
    quads = np.concatenate([tube.faces[: 80 * 40], tube.faces[80 * 40 :, 2:]], axis=1)
    grid = box(36)
    triangles = sh.SignedHeatSolver(grid).distance(tube).values
    polygons = sh.SignedHeatSolver(grid).distance(sh.PolygonMesh(tube.vertices, quads)).values
    points = tube.vertices[tube.faces].mean(axis=1)
    normals = tube.face_area_vectors
    cloud = sh.SignedHeatSolver(grid).distance(sh.PointCloud(points, normals, tube.face_areas)).values
    guessed = sh.SignedHeatSolver(grid).distance(sh.PointCloud(points, normals)).values
    h = grid.spacing[0]
    assert rms(polygons - triangles) < 0.01 * h
    assert rms(cloud - triangles) < 0.02 * h
    assert rms(guessed - triangles) < 0.15 * h  # two centroids of a quadrilateral lie closer than the next


def test_nonconvex_polygons_act_by_their_vector_area():
    outline = np.array([[0, 0], [2, 0], [2, 2], [1, 0.4], [0, 2]]) - (1, 0.8)
    corners = np.c_[outline, np.zeros(5)]
    whole = sh.PolygonMesh(corners, [[0, 1, 2, 3, 4]])
    split = sh.TriangleMesh(corners, [[0, 1, 3], [1, 2, 3], [0, 3, 4]])
    grid = box(40)
    a, b = (sh.SignedHeatSolver(grid).distance(shape).values for shape in (whole, split))
    near = np.abs(grid.points).max(axis=-1) < 1.2
    assert rms((a - b)[near]) < 0.1 * grid.spacing[0]


def test_faces_of_any_size_beside_the_cells():
    # one plane of two huge triangles, and the same plane of many tiny ones
    corners = np.array([[-50.0, -60, 0.2], [70, -50, 0.2], [60, 60, 0.2], [-60, 50, 0.2]])
    grid = box(32)
    field = sh.SignedHeatSolver(grid).distance(sh.TriangleMesh(corners, [[0, 1, 2], [0, 2, 3]]))
    # the box ends before the plane does, and the stencil's walls let nothing out: straight up to there
    np.testing.assert_allclose(field.values, grid.points[..., 2] - 0.2, atol=1e-4)
    assert field.diagnostics.note(SampledSource).area_outside > 0.99
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-1.6, 1.6, 300), np.linspace(-1.6, 1.6, 300), indexing="ij"))
    i = np.arange(299 * 300).reshape(299, 300)[:, :-1].ravel()
    faces = np.concatenate([np.stack([i, i + 300, i + 301], 1), np.stack([i, i + 301, i + 1], 1)])
    tiny = sh.SignedHeatSolver(grid).distance(sh.TriangleMesh(np.c_[x, y, np.full(len(x), 0.2)], faces))
    assert tiny.diagnostics.note(SampledSource).samples < 2 * 32 * 32
    np.testing.assert_allclose(tiny.values, field.values, atol=1e-3)


def test_needles_duplicates_and_degenerate_faces_do_no_harm():
    whole = sphere(2000)
    vertices = np.concatenate([whole.vertices, [[0, 0, 5.0]], whole.vertices[:3]])
    n = whole.n_vertices
    faces = np.concatenate([whole.faces, [[n + 1, n + 2, n + 2], [5, 5, 5], [0, 1, n + 1]], whole.faces[:50]])
    grid = box(40)
    field = sh.SignedHeatSolver(grid).distance(sh.TriangleMesh(vertices, faces))
    assert rms(field.values - sh.SignedHeatSolver(grid).distance(whole).values) < 0.2 * grid.spacing[0]


def level_at(field, shape):
    values = field(shape.vertices)
    return float(values.mean()), float(np.abs(values - values.mean()).max())


def test_constraints():
    shape, grid = samples.torus(1.0, 0.4, 100, 50), box(40)
    solver, h = sh.SignedHeatSolver(grid), box(40).spacing[0]
    source = discretize(grid).lower([shape], 1.0)

    def off(constraint):
        return source.at_samples(solver.distance(shape, constraint).values)

    free = off(sh.constraints.Free())
    assert abs(np.average(free, weights=source.weights)) < 1e-10
    soft = [rms(off(sh.constraints.Soft(weight / h))) for weight in (1e-4, 0.1, 10.0)]
    assert rms(free) == pytest.approx(soft[0], rel=1e-2)
    assert soft[0] > soft[1] > soft[2]
    assert rms(off(sh.constraints.ZeroSet())) < 0.25 * rms(free)
    assert np.abs(off(sh.constraints.ZeroSet(hard=True))).max() < 1e-8 * h


def test_levels_of_several_sources_and_components():
    left, right = sphere(800, 0.4, (-0.6, 0, 0)), sphere(800, 0.4, (0.8, 0, 0))
    both = sh.TriangleMesh(
        np.concatenate([left.vertices, right.vertices]), np.concatenate([left.faces, right.faces + left.n_vertices])
    )
    solver, h = sh.SignedHeatSolver(box(40)), box(40).spacing[0]
    for sources in ([left, right], both):
        field = solver.distance(sources, sh.constraints.LevelValues([0.0, 0.1]))
        for shape, level in ((left, 0.0), (right, 0.1)):
            mean, spread = level_at(field, shape)
            assert mean == pytest.approx(level, abs=0.05 * h)
            assert spread < 0.3 * h
    free = solver.distance(both, sh.constraints.EachComponent())
    assert max(level_at(free, left)[1], level_at(free, right)[1]) < 0.3 * h
    with refused(sh.errors.ConstraintError):
        solver.distance([left, right], sh.constraints.LevelValues([0, 1, 2]))


def test_levels_of_sources_outside_of_the_grid_do_not_move_those_of_the_others():
    apart, one, outside = ([samples.sphere(1, 0.3, (x, 0, 0)) for x in xs] for xs in ((-1.0, 0.0), (1.0,), (50.0,)))
    solver = sh.SignedHeatSolver(sh.Grid((-1.5, -0.5, -0.5), 0.1, (31, 11, 11)))
    pair = samples.union(*apart)  # with as many components in all as there are sources
    alone = solver.distance([pair, *one], sh.constraints.LevelValues([0.0, 0.1]))
    beside = solver.distance([pair, *one, *outside], sh.constraints.LevelValues([0.0, 0.1, 5.0]))
    assert np.array_equal(alone.values, beside.values)


def test_sides_that_coincide_are_told_and_refused_when_nothing_is_left():
    thin = sh.TriangleMesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1e-4]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    )
    field = sh.SignedHeatSolver(sh.Grid.around(thin, 32)).distance(thin)
    assert 0.99 < field.diagnostics.note(SampledSource).area_cancelled < 1
    outside = np.abs(field.domain.points[..., 2]) > 0.1
    assert (field.values[outside] > 0).all()
    twice = sh.TriangleMesh(thin.vertices, np.concatenate([thin.faces, thin.faces[:, ::-1]]))
    with refused(sh.errors.SourceError):
        sh.SignedHeatSolver(sh.Grid.around(twice, 32)).distance(twice)


def test_what_cannot_be_done_is_refused_with_the_remedy():
    shape = sphere(300)
    with refused(sh.errors.SourceError):
        sh.SignedHeatSolver(box(16)).distance(sh.PointCloud(shape.vertices))
    with refused(sh.errors.SourceError):
        sh.SignedHeatSolver(sh.Grid((5, 5, 5), 0.1, (9, 9, 9))).distance(shape)
    with refused(sh.errors.SourceError, "source"):
        sh.SignedHeatSolver(box(16)).distance(sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]))
    with refused(sh.errors.SourceError, "source 0"):
        sh.SignedHeatSolver(box(16)).distance(sh.PointCloud([[0, 0]], [[0, 1]]))
    with refused(sh.errors.SourceError, "source"):
        sh.SignedHeatSolver(box(16)).distance(box(4))
    with refused(sh.errors.MemoryLimitError):
        sh.SignedHeatSolver(sh.Grid.around(shape, 20000)).distance(shape)
    with refused(sh.errors.OutsideError, "values"):
        sh.sharpen(sh.Field(box(8), np.ones((8, 8, 8))))
    assert memory_estimate(box(512)) < 10e9
