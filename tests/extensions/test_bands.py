import re

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import signedheat as sh
from refusals import refused
from shapes.bodies import box
from shapes.grid_cases import assert_closed_manifold, sphere, torus
from signedheat import samples
from signedheat.extensions import band_memory, bands
from signedheat.extensions.band_plan import plan_band
from signedheat.extensions.bands import band_around


def compared(shape, resolution, cells, **options):
    """A band, the dense field on the same grid, and the band's values on it, NaN where there are none."""
    dense = sh.solid_distance(shape, resolution=resolution, **options)
    h, shape_of_coarse = dense.grid.spacing, [1 - (-(n - 1) // 4) for n in dense.grid.shape]
    coarse = sh.solid_distance(shape, sh.Grid(dense.grid.origin, 4 * h, shape_of_coarse), **options)
    band = band_around(coarse, dense.grid, cells * float(h.max()))
    return band, dense, band.blocks.window(band.values, np.zeros(3, dtype=int), dense.grid.shape)


@pytest.mark.parametrize("shape", [sphere(2000), torus(60, 30), box([0, 0, 0], [1.0, 0.6, 0.3])])
def test_around_whole_shapes_a_band_has_the_exact_distance(shape):
    band, dense, values = compared(shape, 60, 3.0)
    h = float(dense.grid.spacing[0])
    there = ~np.isnan(values)
    assert there[np.abs(dense.values) <= 3 * h].all()
    assert 0 < there.mean() < 0.95
    assert ((values < 0) == (dense.values < 0))[there].all()
    assert np.abs(values - dense.values)[there].max() < 0.25 * h  # the dense field's nearest face is not always it
    rng = np.random.default_rng(0)
    lower, upper = dense.grid.origin, dense.grid.upper
    points = rng.uniform(lower, upper, (2000, 3))
    np.testing.assert_allclose(band(points), dense(points), atol=2 * h)  # coarse beyond the band
    near = np.abs(dense(points)) < 2 * h
    np.testing.assert_allclose(band(points[near]), dense(points[near]), atol=0.1 * h)
    assert np.abs(np.linalg.norm(band.gradient(points[near]), axis=1) - 1).mean() < 0.1
    for level in (0.0, 2 * h, -2 * h):
        assert_closed_manifold(band.contour(level))
        assert band.contour(level).n_faces == pytest.approx(dense.contour(level).n_faces, rel=0.01)
    with pytest.raises(sh.OutsideError) as caught:
        band.contour(4 * h)
    assert caught.value.remedy


def test_a_band_is_as_near_the_truth_as_the_dense_field_where_surface_is_missing():
    whole = sphere(2000)
    centres = whole.vertices[whole.faces].mean(axis=1)
    holes = np.random.default_rng(1).normal(size=(5, 3))
    holes /= np.linalg.norm(holes, axis=1)[:, None]
    broken = sh.TriangleMesh(whole.vertices, whole.faces[(centres @ holes.T < 0.95).all(axis=1)])
    band, dense, values = compared(broken, 100, 3.0)
    h = float(dense.grid.spacing[0])
    truth = np.linalg.norm(dense.grid.points, axis=-1) - 1
    near = ~np.isnan(values) & (np.abs(truth) < 3 * h)
    error, other = (np.sqrt(np.mean((v - truth)[near] ** 2)) for v in (values, dense.values))
    assert error < 1.15 * other  # 1.09
    for level in (0.0, 1.5 * h):
        assert_closed_manifold(band.contour(level))
    wrong = ~np.isnan(values) & ((values < 0) != (dense.values < 0))
    assert not (wrong & (np.abs(dense.values) > 2.5 * h)).any()
    confidence = band.blocks.window(band.confidence.astype(np.float32), np.zeros(3, dtype=int), dense.grid.shape)
    assert np.nanmin(confidence) < 1.0 == np.nanmax(confidence)


def test_features_that_the_coarse_grid_misses_are_found():
    # a plate, a gap and a ball far thinner than a coarse cell, which is four times the fine one
    big = sphere(1500)
    h = 2.8 / 100
    plate = box([1.6, -0.8, -0.8], [1.6 + 1.6 * h, 0.8, 0.8])
    other = box([1.6 + 3.4 * h, -0.8, -0.8], [2.2, 0.8, 0.8])
    ball = sphere(100, 1.2 * h, (-1.4, 0.0, 0.0))
    grid = sh.Grid((-2.2, -1.8, -1.8), h, (257, 129, 129))  # the coarse cell is four of its
    band = sh.solid_distance([big, plate, other, ball], grid, band=3 * h)
    assert band.coarse.grid.spacing[0] == pytest.approx(4 * h)
    middles = [[1.6 + 0.8 * h, 0.1, 0.2], [1.6 + 2.5 * h, 0.1, 0.2], [-1.4, 0.0, 0.0]]
    assert np.sign(band(middles)).tolist() == [-1, 1, -1]
    surface = band.contour()
    assert_closed_manifold(surface)
    a, b = surface.faces[:, [0, 1, 1, 2]].reshape(-1, 2).T
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(surface.n_vertices,) * 2)
    assert connected_components(graph, directed=False)[0] == 4


def test_bodies_that_overlap_by_less_than_a_coarse_cell_are_united():
    big, small = sphere(3000), sphere(300, 0.125, (1.06, 0.0, 0.0))
    grid = sh.Grid((-1.4,) * 3, 2.8 / 128, (129,) * 3)
    h = float(grid.spacing[0])
    band = sh.solid_distance([big, small], grid, band=3 * h)
    nodes = grid.origin + (band.blocks.places[:, None] * 8 + np.argwhere(np.ones((8, 8, 8)))).reshape(-1, 3) * h
    values = band.values.ravel()
    near = np.isfinite(values) & (np.linalg.norm(nodes - [1.0, 0, 0], axis=1) < 0.25)
    to_big = np.linalg.norm(nodes[near], axis=1) - 1
    to_small = np.linalg.norm(nodes[near] - [1.06, 0, 0], axis=1) - 0.125
    truth = np.minimum(to_big, to_small)
    clear = np.abs(truth) > 0.2 * h  # what the facets are off the spheres
    assert ((values[near] < 0) == (truth < 0))[clear].all()
    outside = truth > 0
    assert np.abs(values[near] - truth)[outside].max() < 0.6 * h  # half a cell at the cut
    deep = (to_small < -0.8 * h) & (to_big < -0.8 * h)  # inside both: faces in there were left out
    assert deep.any() and (values[near][deep] < -2.6 * h).all()


def test_walls_that_the_coarse_grid_misses_have_an_inside_though_they_are_open():
    grid = sh.Grid((-0.8, -0.8, -0.1), 1.6 / 256, (257, 257, 33))
    h = float(grid.spacing[0])
    thick, angle = 1.4 * h, 2 * np.pi * np.arange(48) / 48
    ring = 0.3 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rim = [np.column_stack([np.vstack([ring, [[0, 0]]]), np.full(49, z)]) for z in (0.1 * h, 0.1 * h + thick)]
    fan = np.stack([np.full(48, 48), np.arange(48), (np.arange(48) + 1) % 48], axis=1)
    # two discs that face away from each other, without the wall between their rims
    plate = sh.TriangleMesh(np.concatenate(rim), np.concatenate([fan[:, ::-1], 49 + fan]))
    band = sh.solid_distance(plate, grid, band=3 * h)
    nodes = grid.origin + (band.blocks.places[:, None] * 8 + np.argwhere(np.ones((8, 8, 8)))).reshape(-1, 3) * h
    values = band.values.ravel()
    over = (np.linalg.norm(nodes[:, :2], axis=1) < 0.24) & np.isfinite(values)
    below = nodes[over, 2] - 0.1 * h
    np.testing.assert_allclose(values[over], np.maximum(-below, below - thick), atol=1e-3 * h)
    assert (values[over] < 0).any()


def test_what_leaves_the_grid_is_closed_at_its_walls():
    whole = sphere(1500)
    half = sh.TriangleMesh(whole.vertices, whole.faces[whole.vertices[whole.faces][:, :, 2].mean(axis=1) < 0.3])
    band = sh.solid_distance(half, resolution=70, band=0.12)
    for level in (0.0, 0.1):
        assert_closed_manifold(band.contour(level))


def test_points_are_measured_to_what_is_fitted_to_them():
    rng = np.random.default_rng(5)
    normals = rng.normal(size=(4000, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    band = sh.solid_distance(sh.PointCloud(normals, normals), resolution=96, band=0.08)
    assert_closed_manifold(band.contour())
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    assert np.abs(band(directions * 1.03) - 0.03).max() < 0.01


def test_bands_that_make_no_sense_are_refused():
    ball = sphere(200)
    for band in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(sh.GeometryError):
            sh.solid_distance(ball, resolution=32, band=band)
    with pytest.raises(sh.UnsupportedTypeError):
        sh.solid_distance(ball, resolution=32, band=0.1, plain=True)


def test_files_keep_a_band_to_the_last_bit(tmp_path):
    band = sh.solid_distance(sphere(300), resolution=40, band=0.2)
    band.save(tmp_path / "band.npz")
    back = sh.load_field(tmp_path / "band.npz")
    np.testing.assert_array_equal(back.values, band.values)
    np.testing.assert_array_equal(back.blocks.places, band.blocks.places)
    points = np.random.default_rng(0).normal(size=(300, 3))
    np.testing.assert_array_equal(back(points), band(points))
    data = (tmp_path / "band.npz").read_bytes()
    (tmp_path / "band.npz").write_bytes(data[: len(data) // 2])
    with pytest.raises(sh.FileFormatError):
        sh.load_field(tmp_path / "band.npz")


@pytest.fixture(scope="module")
def holed_band():
    mesh = samples.without_faces(samples.sphere(3), 0.15, seed=1)
    return sh.solid_distance(mesh, resolution=72, band=0.2)


def test_the_nearest_places_of_a_band_are_exact_and_know_what_was_completed(holed_band):
    points = np.random.default_rng(0).uniform(-1.3, 1.3, (3000, 3))
    found = holed_band.closest_points(points)
    truth = np.linalg.norm(points, axis=1) - 1
    assert np.abs(found.distances - truth).max() < 0.04
    np.testing.assert_allclose(np.linalg.norm(points - found.points, axis=1), np.abs(found.distances), atol=1e-12)
    reached = found.points + found.gradients * found.distances[:, None]
    np.testing.assert_allclose(reached, points, atol=2e-3)
    there = ~found.completed  # on faces, whose corners lie on the sphere
    assert (np.abs(np.linalg.norm(found.points[there], axis=1) - 1) < 0.02).all()
    assert 0.001 < found.completed.mean() < 0.3


def test_confidence_is_that_of_the_nodes_and_goes_on_beyond_the_band(holed_band):
    band, cell = holed_band, float(holed_band.grid.spacing[0])
    inner = band.blocks.places.astype(int) * 8 + 3
    at_nodes = band.confidence_at(band.grid.origin + inner * cell)
    np.testing.assert_allclose(at_nodes, band.confidence[:, 3, 3, 3], atol=1e-3)
    surface = band.contour(0.1)
    confidence = band.confidence_at(surface.vertices)
    near = band.closest_points(surface.vertices)
    assert (confidence[near.completed].mean() < confidence[~near.completed].mean()) and confidence.max() == 1
    np.testing.assert_allclose(band.confidence_at([[0.0, 0, 0]]), band.coarse.confidence_at([[0.0, 0, 0]]))
    assert 0 < band.surface_confidence < 1


def test_samples_of_a_band_have_exact_distances(holed_band):
    taken = sh.sample(holed_band, 4000, near=0.75, widths=[0.02, 0.1], seed=3)
    truth = np.linalg.norm(taken.points, axis=1) - 1
    assert taken.near.sum() == 3000
    assert np.quantile(np.abs(taken.distances - truth), 0.9) < 0.02
    assert np.abs(truth[:1500]).std() < np.abs(truth[1500:3000]).std()


def test_many_points_get_the_values_of_few(holed_band):
    points = np.random.default_rng(2).uniform(-1.3, 1.3, (70_000, 3))
    some = np.r_[0:50, 65_500:65_600]
    np.testing.assert_array_equal(holed_band(points)[some], holed_band(points[some]))
    np.testing.assert_array_equal(holed_band.gradient(points)[some], holed_band.gradient(points[some]))


def test_a_band_beyond_memory_is_refused_with_a_spacing_that_fits(monkeypatch):
    class ReachedError(Exception):
        pass

    def reached(*_):
        raise ReachedError

    monkeypatch.setattr(band_memory, "available_memory", lambda: 115_000_000)
    monkeypatch.setattr(band_memory, "libraries", lambda: 0)
    monkeypatch.setattr(bands, "in_threads", reached)
    ball = sphere(2000)
    with refused(sh.MemoryLimitError) as caught:
        sh.solid_distance(ball, spacing=0.01, band=0.04)
    spacing = float(re.search(r"spacing of ([0-9.e-]+)", caught.value.remedy).group(1))
    assert 0.01 < spacing <= 0.02
    with pytest.raises(ReachedError):
        sh.solid_distance(ball, spacing=spacing, band=0.04)


@pytest.mark.parametrize("spacing", [1e-4, 1e-9, 1e-12])
@pytest.mark.parametrize("band", [1e-3, 3.0])
def test_a_band_far_beyond_memory_is_refused_before_a_coarser_one_is_computed(monkeypatch, spacing, band):
    monkeypatch.setattr(band_memory, "available_memory", lambda: 400_000_000)
    monkeypatch.setattr(bands, "joined_band", lambda *_: pytest.fail("a band was computed"))
    with refused(sh.MemoryLimitError) as caught:
        sh.solid_distance(sphere(500), spacing=spacing, band=band)
    assert float(re.search(r"spacing of ([0-9.e-]+)", caught.value.remedy).group(1)) > spacing


def test_the_volume_beside_a_surface_is_that_of_its_shell():
    coarse = sh.solid_distance(sphere(5000), resolution=64)
    for reach in (0.3, 0.1, 0.001):
        shell = 4 / 3 * np.pi * ((1 + reach) ** 3 - (1 - reach) ** 3)
        assert band_memory.volume_within(coarse, reach) == pytest.approx(shell, rel=0.05)
    assert band_memory.volume_within(coarse, 9.0) == pytest.approx(np.prod(coarse.grid.spacing) * coarse.grid.n_nodes)


def half_sphere():
    whole = sphere(2000)
    return sh.TriangleMesh(whole.vertices, whole.faces[whole.vertices[whole.faces, 2].mean(axis=1) < 0.3])


def test_bands_over_open_surface_wider_than_a_tile_need_memory_for_all_of_it():
    coarse = sh.solid_distance(half_sphere(), resolution=65)
    grid = sh.Grid(coarse.grid.origin, coarse.grid.spacing / 8, [8 * (n - 1) + 1 for n in coarse.grid.shape])
    narrow, wide = (band_memory.memory_of_band(plan_band(coarse, grid, band))[1] for band in (0.03, 0.6))
    assert narrow < 0.5e9 < 1.5e9 < wide
