"""Sharpening to a shape: exact where faces are, φ's zero set where they are missing or contradict each other."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import scipy

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.diagnostics import SharpenedToShape
from signedheat.extensions.shape_sharpening import confidence_at
from signedheat.geometry.box_tree import BoxTree
from signedheat.geometry.nearest import nearest_on_triangles

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
BOX_FACES = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]])


def box(half=(1.0, 1.0, 1.0), center=(0.0, 0.0, 0.0)):
    return sh.TriangleMesh(CORNERS * half + center, BOX_FACES)


def box_distance(points, half, center=(0.0, 0.0, 0.0)):
    q = np.abs(points - np.array(center)) - np.array(half)
    return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)


def distance_to(mesh, points):
    corners = mesh.vertices[mesh.faces]
    tree = BoxTree.of(corners.min(axis=1), corners.max(axis=1))
    faces, weights = nearest_on_triangles(corners, tree, points.reshape(-1, 3))
    feet = np.einsum("pk,pki->pi", weights, corners[faces])
    return np.linalg.norm(feet - points.reshape(-1, 3), axis=1).reshape(points.shape[:-1])


def sharpened(mesh, grid, **options):
    return sh.sharpen(sh.signed_distance(mesh, grid), mesh, **options)


def note(field):
    return field.diagnostics.note(SharpenedToShape)


def root_mean_square(errors):
    return float(np.sqrt(np.mean(np.square(errors))))


GRID = sh.Grid.around([[-1.0] * 3, [1.0] * 3], resolution=33)
CELL = float(GRID.spacing[0])


@pytest.mark.parametrize("half", [(1.0, 0.8, 0.6), (1.0, 0.9, 0.2 * CELL)])
def test_boxes_have_their_distance(half):
    """Twelve faces, far larger than a cell; the second box is thinner than half a cell."""
    field = sharpened(box(half), GRID)
    np.testing.assert_allclose(field.values, box_distance(GRID.points, half), atol=1e-9)


def test_faces_smaller_than_cells():
    mesh = samples.sphere(5)
    grid = sh.Grid.around(mesh.bounds, resolution=20)
    error = np.abs(np.abs(sharpened(mesh, grid).values) - distance_to(mesh, grid.points)) / grid.spacing[0]
    assert error.max() < 0.05
    assert (error < 1e-6).mean() > 0.9


def test_nodes_miss_few_nearer_faces():
    """A bumpy ball of 5,120 faces, smaller than a cell. Asking neighbours along axes alone, 4.6 and 1.4 % were off."""
    ball = samples.sphere(4)
    x = ball.vertices
    bumpy = sh.TriangleMesh(x * (1 + 0.15 * np.sin(9 * x + 1).prod(axis=1, keepdims=True)), ball.faces)
    grid = sh.Grid.around(bumpy.bounds, resolution=40)
    cell = float(grid.spacing.max())
    distances = distance_to(bumpy, grid.points)
    off = np.abs(sh.solid_distance(bumpy, grid).values) - distances > 0.01 * cell
    for least, most, share in ((0, 1, 0.001), (1, 2, 0.012), (2, 4, 0.006)):
        assert off[(distances >= least * cell) & (distances < most * cell)].mean() <= share


def test_signs_of_a_shape_with_cavities_and_corners():
    mesh = samples.union(samples.torus(), box((0.3, 0.3, 0.5)))
    grid = sh.Grid.around(mesh.bounds, resolution=40)
    points = grid.points
    ring = np.hypot(np.linalg.norm(points[..., :2], axis=-1) - 1.0, points[..., 2]) - 0.4
    truth = np.minimum(ring, box_distance(points, (0.3, 0.3, 0.5)))
    field = sharpened(mesh, grid)
    assert np.abs(field.values - truth).max() < 0.01  # the facets of the torus are off by .0021
    assert ((field.values < 0) == (truth < 0))[np.abs(truth) > 0.0025].all()


def test_turning_the_shape_inside_out_turns_the_signs():
    mesh = box((1.0, 0.7, 0.5))
    turned = sh.TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])
    np.testing.assert_allclose(sharpened(turned, GRID).values, -sharpened(mesh, GRID).values, atol=1e-12)


def test_turned_axes_and_units_do_not_matter():
    mesh = samples.without_patches(samples.torus(n_around=40, n_across=20), 1, 0.3)
    grid = sh.Grid.around(mesh.bounds, resolution=32)
    field = sharpened(mesh, grid)
    turned = sh.TriangleMesh(1000 * mesh.vertices[:, [1, 2, 0]], mesh.faces)
    other = sh.Grid(1000 * grid.origin[[1, 2, 0]], 1000 * grid.spacing[[1, 2, 0]], np.array(grid.shape)[[1, 2, 0]])
    values = np.moveaxis(field.values, 0, -1)
    difference = np.abs(sharpened(turned, other).values / 1000 - values) / CELL
    assert np.quantile(difference, 0.95) < 1e-6  # of φ; between two places, nodes may choose the other
    assert root_mean_square(difference) < 0.02


def test_same_bits_twice():
    mesh = samples.soup(samples.sphere(3), jitter=0.03)
    field = sh.signed_distance(mesh, GRID)
    first, second = (sh.sharpen(field, mesh) for _ in range(2))
    assert (first.values == second.values).all() and (first.confidence == second.confidence).all()


@pytest.fixture(scope="module")
def holed():
    mesh = samples.without_patches(samples.sphere(4), 1, 0.45)
    return mesh, sharpened(mesh, GRID)


def test_holes_are_completed(holed):
    mesh, field = holed
    truth = np.linalg.norm(GRID.points, axis=-1) - 1.0
    faces_alone = np.copysign(distance_to(mesh, GRID.points), truth)
    assert note(field).completed_zero_set > 0.02
    assert root_mean_square(field.values - truth) < 0.7 * root_mean_square(faces_alone - truth)
    assert (np.sign(field.values) == np.sign(truth))[np.abs(truth) > CELL].all()


def test_confidence_tells_where_errors_are(holed):
    _, field = holed
    error = np.abs(field.values - (np.linalg.norm(GRID.points, axis=-1) - 1.0))
    there, completed = field.confidence == 1, field.confidence < 0.9
    assert there.mean() > 0.8 and 0.005 < completed.mean() < 0.2
    assert 0 < field.confidence.min()
    assert error[completed].mean() > 10 * error[there].mean()


def test_faces_gone_here_and_there_do_little_harm():
    whole = samples.sphere(4)
    truth = np.linalg.norm(GRID.points, axis=-1) - 1.0
    errors = [
        root_mean_square(sharpened(mesh, GRID).values - truth) / CELL
        for mesh in (whole, samples.without_faces(whole, 0.15, seed=1))
    ]
    assert errors[0] < 0.02  # the chords of the faces
    assert errors[1] < errors[0] + 0.02


@pytest.mark.parametrize(
    "mesh", [samples.torus(), box(), box((1, 1, 0.1 * CELL)), samples.duck(40)], ids="torus box plate duck".split()
)
def test_clean_shapes_have_no_layers(mesh):
    grid = sh.Grid.around(mesh.bounds, resolution=40)
    assert note(sharpened(mesh, grid)).layered_faces == 0.0


def test_noise_is_told_from_shape():
    """Of faces scattered about a sphere, φ's zero set is nearer the truth; a clean ball beside them stays exact."""
    noisy = samples.soup(samples.sphere(4), jitter=0.04)
    clean = samples.sphere(4, center=(3.0, 0.0, 0.0))
    both = samples.union(noisy, clean)
    grid = sh.Grid.around(both.bounds, resolution=64)
    field = sh.signed_distance(both, grid)
    near = np.linalg.norm(grid.points, axis=-1) < 1.4
    beside = np.linalg.norm(grid.points - (3.0, 0.0, 0.0), axis=-1) < 1.4
    truth = np.minimum(np.linalg.norm(grid.points, axis=-1), np.linalg.norm(grid.points - (3, 0, 0), axis=-1)) - 1.0
    errors = {fit: sh.sharpen(field, both, fit=fit).values - truth for fit in ("auto", "exact", "smooth")}
    assert root_mean_square(errors["auto"][near]) < 1.05 * root_mean_square(errors["smooth"][near])
    assert root_mean_square(errors["auto"][near]) < 0.5 * root_mean_square(errors["exact"][near])
    assert root_mean_square(errors["auto"][beside]) < 1.05 * root_mean_square(errors["exact"][beside])


def test_smooth_is_sharpening_to_the_zero_set():
    mesh = samples.sphere(3)
    field = sh.signed_distance(mesh, GRID)
    smooth = sh.sharpen(field, mesh, fit="smooth")
    np.testing.assert_allclose(smooth.values, sh.sharpen(field).values, atol=1e-6 * CELL)
    assert note(smooth).layered_faces == 1.0


def test_sides_from_elsewhere():
    """A function with the right signs and a zero set replaces φ where the shape does not tell."""
    mesh = samples.without_patches(samples.sphere(4), 1, 0.6)
    truth = np.linalg.norm(GRID.points, axis=-1) - 1.0
    field = sh.signed_distance(mesh, GRID)
    told = sh.sharpen(field, mesh, sides=truth)
    assert root_mean_square(told.values - truth) < 0.03 * CELL
    assert root_mean_square(told.values - truth) < 0.2 * root_mean_square(sh.sharpen(field, mesh).values - truth)


def test_offsets_lie_on_their_level_at_creases_too():
    """Between two boxes the level sets of distance have creases."""
    halves, centers = (0.4, 0.5, 0.45), ((-0.6, 0.0, 0.05), (0.6, 0.1, 0.0))
    mesh = samples.union(*(box(halves, center) for center in centers))
    grid = sh.Grid.around(mesh.bounds, resolution=40)
    field = sharpened(mesh, grid)
    for distance in (0.3, -0.1):
        vertices = field.offset(distance).vertices
        rough = sh.GridField(grid, field.values).offset(distance).vertices
        off, before = (
            np.abs(np.min([box_distance(points, halves, center) for center in centers], axis=0) - distance)
            / grid.spacing[0]
            for points in (vertices, rough)
        )
        assert before.max() > 0.02
        assert off.max() < 0.1 * before.max() and off.mean() < 2e-3


def test_polygons_and_several_shapes():
    quads = sh.PolygonMesh(CORNERS * (1.0, 0.7, 0.5), list(QUADS))
    field = sh.sharpen(sh.signed_distance(quads, GRID), quads)
    np.testing.assert_allclose(field.values, box_distance(GRID.points, (1.0, 0.7, 0.5)), atol=1e-9)
    two = [box((0.3, 0.9, 0.9), (-0.6, 0, 0)), box((0.3, 0.9, 0.9), (0.6, 0, 0))]
    field = sh.sharpen(sh.signed_distance(two, GRID), two)
    truth = np.minimum(*(box_distance(GRID.points, (0.3, 0.9, 0.9), (x, 0, 0)) for x in (-0.6, 0.6)))
    np.testing.assert_allclose(field.values, truth, atol=1e-9)


def test_a_shape_that_leaves_the_grid():
    grid = sh.Grid((-0.5, -0.5, -0.5), 0.05, (24, 24, 24))
    mesh = box((1.0, 0.9, 0.3), (0.4, 0.3, 0.0))
    field = sharpened(mesh, grid)
    truth = box_distance(grid.points, (1.0, 0.9, 0.3), (0.4, 0.3, 0.0))
    assert np.abs(np.abs(field.values) - np.abs(truth)).max() < 1e-9


def test_points_are_fitted():
    """The fit is nearer the truth than φ's own zero set."""
    for mesh in (samples.torus(), samples.sphere(4)):
        cloud = samples.oriented_points(mesh, 1000, seed=3)
        grid = sh.Grid.around(mesh.bounds, resolution=40)
        field = sh.signed_distance(cloud, grid)
        truth = np.copysign(distance_to(mesh, grid.points), sharpened(mesh, grid).values)
        errors = [root_mean_square(made.values - truth) for made in (sh.sharpen(field), sh.sharpen(field, cloud))]
        assert errors[1] < 0.7 * errors[0]
        assert (sh.sharpen(field, cloud).confidence > 0.8).all()


def test_bad_input_is_refused():
    mesh = box((0.8, 0.8, 0.8))
    field = sh.signed_distance(mesh, GRID)
    with refused(sh.SignedHeatError, "fit"):
        sh.sharpen(field, mesh, fit="sharp")
    with refused(sh.GeometryError, "sides"):
        sh.sharpen(field, mesh, sides=np.zeros(3))
    with refused(sh.SourceError):
        sh.sharpen(field, sides=field.values)
    with refused(sh.SourceError, "shape"):
        sh.sharpen(field, sh.Polyline([[0, 0], [1, 0], [0, 1]], closed=True))
    with refused(sh.SourceError):
        sh.sharpen(field, sh.PointCloud(mesh.vertices))
    flat = sh.Grid((-1, -1), 0.1, (20, 20))
    with refused(sh.SourceError):
        sh.sharpen(sh.GridField(flat, np.linalg.norm(flat.points, axis=-1) - 0.5), mesh)
    with refused(sh.OutsideError, "shape"):
        sh.sharpen(sh.GridField(GRID, np.ones(GRID.shape)), sh.TriangleMesh([[0, 0, 0], [1, 0, 0]], [[0, 1, 1]]))


@pytest.mark.parametrize("missing", [0.0, 0.05])
def test_folded_faces_make_no_specks(missing):
    """Noise turns some faces over: the nearest face then tells the wrong side, the shape as a whole does not."""
    ball = samples.sphere(4)
    noisy = samples.without_faces(samples.with_noise(ball, 0.025, seed=1), missing, seed=1)
    field = sh.solid_distance(noisy, resolution=48)
    _, bodies = scipy.ndimage.label(field.values < 0)
    _, rest = scipy.ndimage.label(field.values >= 0)
    assert (bodies, rest) == (1, 1)
    away = 0.3
    vertices = field.offset(away).vertices
    off = np.abs(distance_to(noisy, vertices) - away) / field.grid.spacing.max()
    assert np.quantile(off, 0.99) < 0.01 and off.max() < 0.3  # nodes may have a face that is but nearly the nearest


def test_noise_is_told_from_shape_beside_open_sheets():
    """Layers of sheets are no noise, those of loose triangles around a body are."""
    noisy = samples.soup(samples.sphere(4), jitter=0.04)
    corners = np.array([[2.0, -1, -1], [4, -1, -1], [4, 1, -1], [2, 1, -1]])
    two = np.concatenate([corners + np.array([0, 0, height]) for height in (0, 0.02, 0.04)])
    sheets = sh.TriangleMesh(two, np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + k for k in (0, 4, 8)]))
    both = samples.union(noisy, sheets)
    grid = sh.Grid.around(both.bounds, resolution=64)
    field = sh.solid_distance(both, grid, as_oriented=True)
    near = np.linalg.norm(grid.points, axis=-1) < 1.4
    truth = np.linalg.norm(grid.points, axis=-1) - 1.0
    assert root_mean_square((field.values - truth)[near]) < 0.5 * root_mean_square(
        (distance_to(noisy, grid.points) * np.sign(truth) - truth)[near]
    )
    beside = np.abs(grid.points - (3, 0, -0.98)).max(axis=-1) < 0.6
    np.testing.assert_allclose(field.values[beside], distance_to(sheets, grid.points[beside]), atol=1e-9)


def scattered(mesh, scale):
    """Its triangles, each corner of each moved for itself."""
    corners = mesh.vertices[mesh.faces]
    corners = corners + np.random.default_rng(2).normal(scale=scale, size=corners.shape)
    return sh.TriangleMesh(corners.reshape(-1, 3), np.arange(3 * mesh.n_faces).reshape(-1, 3))


def test_large_loose_triangles_are_noise_where_their_corners_are_scattered():
    """Faces of ten cells hardly overlap; what sticks out of them brings the distance outside too near."""
    ball = samples.sphere(1)
    noisy = scattered(ball, 0.025)
    grid = sh.Grid.around(noisy.bounds, resolution=48)
    truth = sh.solid_distance(ball, grid).values
    errors = {
        fit: root_mean_square(sharpened(noisy, grid, fit=fit).values - truth) for fit in ("auto", "exact", "smooth")
    }
    assert errors["auto"] < 1.05 * errors["smooth"] < 0.9 * errors["exact"]


def test_thin_plates_of_loose_triangles_stay():
    noisy = scattered(box((1.0, 1.0, 0.03)), 0.01)
    grid = sh.Grid.around(noisy.bounds, resolution=48)
    field = sh.solid_distance(noisy, grid)
    truth = box_distance(grid.points, (1.0, 1.0, 0.03))
    assert root_mean_square(field.values - truth) < 0.03


def test_shapes_whose_extent_is_lost_in_rounding_are_refused_without_a_warning():
    """On a grid that is 1e20 times as large, all vertices lie in one place."""
    holed = samples.without_faces(samples.sphere(2), 0.1)
    with warnings.catch_warnings(), pytest.raises(sh.SignedHeatError):
        warnings.simplefilter("error", RuntimeWarning)
        sh.solid_distance(holed, sh.Grid.around(holed.bounds, 8, padding=1e20))


def test_confidence_is_whole_at_a_shape_of_one_point():
    place = np.ones((1, 3))
    trust = confidence_at(np.array([[1.0, 1, 1], [2, 1, 1]]), [], [place])
    assert trust.tolist() == [1.0, 0.0]
