"""Fields of solids: one function, at the nodes of any grid."""

import errno
import multiprocessing
import pickle
import re
import shutil
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import signedheat as sh
from refusals import refused
from shapes.bodies import box, sheet
from shapes.grid_cases import assert_closed_manifold, enclosed_volume
from signedheat import memory, samples
from signedheat.search.nearest_triangles import away_from_triangle
from signedheat.solids.completion import complete


def cup():
    """A ball without its top."""
    ball = samples.sphere(3)
    return sh.TriangleMesh(ball.vertices, ball.faces[ball.vertices[ball.faces].mean(axis=1)[:, 2] < 0.3])


def beside(*, ball):
    """A ball, and a sheet that bounds nothing."""
    return samples.union(samples.sphere(ball), sheet([[1.2, -1, -1], [1.3, 1, -1], [1.2, 1, 1], [1.2, -1, 1]]))


SHAPES = {
    "ball": lambda: samples.sphere(3),
    "holes": lambda: samples.without_patches(samples.sphere(3), 4, 0.4, seed=1),
    "cup": cup,
    "brick": lambda: box((-1.0, -0.7, -0.2), (1.0, 0.6, 0.3)),
    "sheet": lambda: sheet([[0, 0, 0], [1, 0, 0.2], [1.2, 1, 0], [0, 1, 0.1]]),
    "two bodies": lambda: samples.union(samples.sphere(3), samples.sphere(2, 0.6, (0.9, 0.2, 0))),
    "ball and sheet": lambda: beside(ball=2),
    "noise": lambda: samples.with_noise(samples.sphere(3), 0.03),
}


@pytest.fixture(scope="module", params=SHAPES)
def solid(request):
    return complete(SHAPES[request.param]())


def assert_exact(field, solid):
    exact = solid.distance(field.domain.points.reshape(-1, 3)).reshape(field.values.shape)
    rounding = 1e-12 * float(np.ptp(solid.bounds, axis=0).max())
    np.testing.assert_allclose(field.values, exact, rtol=0, atol=rounding)


def test_nodes_have_the_distance_of_the_solid(solid):
    assert_exact(solid.field(resolution=45), solid)


def test_on_grids_that_cut_the_solid_or_miss_it(solid):
    lower, upper = solid.bounds
    step = float((upper - lower).max()) / 20
    for corner in (lower + 0.4 * (upper - lower), upper + 3 * step):
        assert_exact(solid.field(grid=sh.Grid(corner, (step, 1.3 * step, 0.8 * step), (13, 10, 9))), solid)


def test_on_coarse_grids_around_many_faces():
    solid = complete(samples.sphere(5))
    assert_exact(solid.field(resolution=12), solid)
    assert_exact(solid.field(spacing=0.15, padding=0.4), solid)


def test_gaps_beside_what_was_given_do_not_leak():
    """Between faces and the zero set of φ they are wider than these steps."""
    solid = complete(samples.without_faces(samples.sphere(2), 0.75, seed=1), completion="heat")
    rim = solid.faces.vertices[0]
    field = solid.field(grid=sh.Grid(1.02 * rim - 0.12, 0.01, (24, 24, 24)))
    assert_exact(field, solid)
    assert 0.2 < (field.values < 0).mean() < 0.8


def test_places_between_nodes_are_exact_too(solid):
    field = solid.field(resolution=24)
    points = np.random.default_rng(0).uniform(solid.bounds[0] - 0.5, solid.bounds[1] + 0.5, (300, 3))
    np.testing.assert_array_equal(field(points), solid.distance(points))
    closest = field.closest(points)
    np.testing.assert_allclose(closest.points + closest.distances[:, None] * field.gradient(points), points, atol=1e-12)
    off = np.abs(field.interpolate(points) - field(points))[field.domain.contains(points)]
    assert 0 < off.max() < np.linalg.norm(field.domain.spacing)


@pytest.mark.parametrize("level", [0.0, 0.11, -0.11])
def test_contours_lie_on_the_level(level):
    solid = complete(SHAPES["holes"]())
    field = solid.field(resolution=30)
    surface = field.contour(level)
    assert_closed_manifold(surface)
    off = np.abs(solid.distance(surface.vertices) - level) / field.domain.spacing[0]
    assert np.quantile(off, 0.99) < 2e-3  # but for the few points that marching cubes puts inside cells
    assert off.max() < 0.5


def test_offsets_of_a_field_have_the_edges_of_the_offset():
    """As those of its solid have; contours of the same field cut them off."""
    turn = Rotation.from_euler("xyz", [0.3, 0.5, 0.7]).as_matrix()
    cube = box((-1, -1, -1), (1, 1, 1))
    field = sh.signed_distance(sh.TriangleMesh(cube.vertices @ turn.T, cube.faces), resolution=24)
    assert enclosed_volume(field.offset(-0.2)) == pytest.approx(1.6**3, rel=1e-4)  # most edges exact to 1e-3 of a cell
    assert enclosed_volume(field.contour(-0.2)) < 0.999 * 1.6**3


def test_moves_with_the_solid():
    shift, mesh = np.array([3.0, -2.0, 0.5]), SHAPES["two bodies"]()
    grid = sh.Grid((-1.5, -1.5, -1.5), 0.125, (25, 25, 25))
    there = sh.Grid(grid.origin + shift, grid.spacing, grid.shape)
    here = complete(mesh).field(grid=grid)
    moved = complete(sh.TriangleMesh(mesh.vertices + shift, mesh.faces)).field(grid=there)
    np.testing.assert_allclose(moved.values, here.values, atol=1e-9)


def test_confidence_is_that_of_the_nearest_triangle():
    solid = complete(cup())
    field = solid.field(resolution=24)
    points = field.domain.points.reshape(-1, 3)
    confidence, found = field.confidence.ravel(), solid.closest(points)
    low = found.points[:, 2] < 0.1
    assert (confidence[low] == 1.0).all() and (found.confidence[low] == 1.0).all() and confidence.min() < 0.7
    some = np.flatnonzero(~low)[::20]
    ways = np.empty((len(solid.triangles), 4, len(some)))
    for face in range(len(ways)):
        away_from_triangle(solid.features.rows, face, points[some].T.copy(), face, ways)
    distances = np.sqrt(ways[:, 0])
    near = distances < distances.min(axis=0) + 1e-9  # one, two at an edge, many at a vertex
    for of in (confidence, found.confidence):
        assert (near & (solid.features.trusted[:, None] == of[some])).any(axis=0).all()


def test_a_copy_that_was_sent_away_is_the_same_field():
    field = complete(SHAPES["brick"]()).field(resolution=16)
    twin = pickle.loads(pickle.dumps(field))
    points = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    np.testing.assert_array_equal(twin(points), field(points))


def test_what_cannot_fit_is_refused_before_it_is_allocated():
    with refused(sh.errors.MemoryLimitError):
        complete(SHAPES["brick"]()).field(resolution=30_000)


def assert_same_nodes(band, whole):
    """Where a band has a node, it has the value of the whole grid; and all nodes as near as its width are there."""
    held = np.full(whole.domain.shape, np.nan)
    for place, block in zip(band.domain.blocks.places * 8, band.values, strict=True):
        a, b, c = (slice(p, min(p + 8, n)) for p, n in zip(place, whole.domain.shape, strict=True))
        held[a, b, c] = block[: a.stop - a.start, : b.stop - b.start, : c.stop - c.start]
    there = ~np.isnan(held)
    np.testing.assert_array_equal(held[there], whole.values[there].astype(np.float32))
    assert there[np.abs(whole.values) <= band.domain.width].all()


def test_bands_are_the_whole_grid_near_the_surface(solid):
    whole = solid.field(resolution=50)
    band = solid.field(grid=whole.domain, band=2.5 * float(whole.domain.spacing[0]))
    assert_same_nodes(band, whole)
    points = np.random.default_rng(2).uniform(solid.bounds[0] - 0.2, solid.bounds[1] + 0.2, (200, 3))
    np.testing.assert_array_equal(band(points), whole(points))
    near = np.abs(band(points)) < 0.5 * band.domain.width
    np.testing.assert_allclose(band.interpolate(points[near]), whole.interpolate(points[near]), atol=1e-6)
    dense = band.expand()
    assert (np.sign(dense.values) == np.sign(whole.values)).mean() > 0.98


def test_contours_of_bands_are_those_of_whole_grids():
    solid = complete(SHAPES["holes"]())
    whole = solid.field(resolution=44)
    band = solid.field(grid=whole.domain, band=4 * float(whole.domain.spacing[0]))
    for level in (0.0, 0.9 * band.domain.width, -band.domain.width):
        ours, theirs = band.offset(level), whole.contour(level)
        assert_closed_manifold(ours)
        assert (ours.n_vertices, ours.n_faces) == (theirs.n_vertices, theirs.n_faces)
        np.testing.assert_allclose(np.sort(ours.vertices, axis=0), np.sort(theirs.vertices, axis=0), atol=1e-5)
    with refused(sh.errors.OutsideError):
        band.contour(1.1 * band.domain.width)


def test_grids_are_as_asked_for_or_have_128_nodes_along_the_longest_side():
    solid = complete(SHAPES["brick"]())
    assert max(solid.field().domain.shape) == 128 and max(solid.field(resolution=9).domain.shape) == 9
    padded = solid.field(spacing=0.15, padding=0.4).domain
    assert (padded.spacing == 0.15).all() and (padded.origin <= solid.bounds[0] - 0.4).all()
    for name, value in (("resolution", 9), ("spacing", 0.1), ("padding", 1.0)):
        with refused(sh.errors.UnsupportedTypeError, element=name):
            solid.field(grid=padded, **{name: value})


def test_stores_hold_the_same_bits_whoever_computes_them(tmp_path):
    solid = complete(SHAPES["two bodies"]())
    options = {"resolution": 80, "band": 0.05}
    band = solid.field(**options)
    assert band.values.size < 0.4 * band.domain.n_nodes
    by_threads = solid.field(**options, store=tmp_path / "new" / "threads")
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        by_processes = solid.field(**options, store=tmp_path / "processes", scheduler=pool)
    for stored in (by_threads, by_processes):
        np.testing.assert_array_equal(stored.values, band.values)
        np.testing.assert_array_equal(stored.confidence, band.confidence)
        np.testing.assert_array_equal(stored.domain.blocks.places, band.domain.blocks.places)


def test_options_of_stores_need_a_store(tmp_path):
    solid = sh.complete(samples.sphere(1))
    with ThreadPoolExecutor() as pool, refused(sh.errors.SourceError, element="scheduler"):
        solid.field(resolution=8, band=0.1, scheduler=pool)
    with refused(sh.errors.SourceError):
        solid.field(resolution=8, store=tmp_path / "dense")


def test_stopped_runs_go_on_and_other_runs_are_refused(tmp_path):
    solid, options = complete(SHAPES["ball"]()), {"resolution": 100, "band": 0.03, "store": tmp_path}

    def stop(share, step):
        if share > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solid.field(**options, progress=stop)
    done = np.load(tmp_path / "done.npy")
    assert 0 < done.sum() < len(done)
    whole = solid.field(**options)
    assert np.load(tmp_path / "done.npy").all()
    np.testing.assert_array_equal(whole.values, solid.field(resolution=100, band=0.03).values)
    with refused(sh.errors.FileFormatError):
        solid.field(resolution=100, band=0.04, store=tmp_path)


def test_bands_survive_files(tmp_path):
    band = complete(SHAPES["brick"]()).field(resolution=60, band=0.1)
    band.save(tmp_path / "band.npz")
    again = sh.read_field(tmp_path / "band.npz")
    np.testing.assert_array_equal(again.values, band.values)
    assert again.domain.width == band.domain.width
    points = np.random.default_rng(3).uniform(-1, 1, (100, 3))
    np.testing.assert_array_equal(again(points), band(points))
    np.testing.assert_array_equal(again.closest(points).distances, band(points))


def test_bands_too_fine_for_the_memory_are_refused_with_a_spacing_that_fits(monkeypatch):
    solid = complete(SHAPES["brick"]())
    monkeypatch.setattr(memory, "_free", lambda: memory.libraries() + 60_000_000)
    with pytest.raises(sh.errors.MemoryLimitError) as told:
        solid.field(spacing=0.002, band=0.02)
    solid.field(spacing=float(re.search(r"spacing of ([0-9.e-]+)", told.value.remedy)[1]), band=0.02)


def test_bands_of_any_width_are_refused_after_few_distances(monkeypatch):
    solid, asked = complete(SHAPES["ball"]()), []
    search = type(solid.tree).distances
    monkeypatch.setattr(type(solid.tree), "distances", lambda *given: asked.append(len(given[1])) or search(*given))
    for width in (1e-3, 1.0):
        with refused(sh.errors.MemoryLimitError):
            solid.field(spacing=1e-5, band=width)
    assert 0 < sum(asked) < 1_000_000


def test_progress_goes_up_and_cancels():
    told = []
    complete(SHAPES["brick"]()).field(resolution=40, progress=lambda share, step: told.append(share))
    assert told == sorted(told) and told[-1] == 1.0

    def stop(share, step):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        complete(SHAPES["brick"]()).field(resolution=40, progress=stop)


def test_a_store_has_its_room_before_anything_is_computed(tmp_path, monkeypatch):
    """Pages of mapped files for which the disk has no room end the process; a store that is whole needs no more."""
    solid, options = complete(SHAPES["ball"]()), {"resolution": 60, "band": 0.05}
    band = solid.field(**options, store=tmp_path / "whole")
    for name in ("values", "confidence"):
        file = (tmp_path / "whole" / f"{name}.npy").stat()
        assert 512 * file.st_blocks >= file.st_size
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage._replace(free=0))
    again = solid.field(**options, store=tmp_path / "whole")
    np.testing.assert_array_equal(again.values, band.values)
    with refused(sh.errors.MemoryLimitError):
        solid.field(**options, store=tmp_path / "other")
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", full)
    with refused(sh.errors.FileFormatError):
        solid.field(**options, store=tmp_path / "full")
    assert not list((tmp_path / "full").iterdir())
