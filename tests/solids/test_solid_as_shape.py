"""A solid is taken wherever a shape is, and nothing of it is completed again."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box, sheet
from signedheat import samples

BROKEN = samples.without_patches(samples.sphere(3), 3, 0.4)
SOLID = sh.complete(BROKEN)
POINTS = np.random.default_rng(0).uniform(-1.5, 1.5, (50, 3))


def test_completing_a_solid_gives_it_back():
    assert sh.complete(SOLID) is SOLID
    assert sh.signed_distance(SOLID, resolution=9).solid is SOLID


@pytest.mark.parametrize("options", [{"resolution": 12}, {"spacing": 0.1}, {"resolution": 12, "padding": 0.3}])
def test_signed_distance_is_the_field_of_the_solid(options):
    np.testing.assert_array_equal(sh.signed_distance(SOLID, **options).values, SOLID.field(**options).values)
    band = sh.signed_distance(SOLID, spacing=0.05, band=0.1)
    np.testing.assert_array_equal(band.values, SOLID.field(spacing=0.05, band=0.1).values)


def test_options_of_completion_are_refused():
    with refused(sh.errors.UnsupportedTypeError, element="completion"):
        sh.signed_distance(SOLID, completion="heat", resolution=9)


def test_on_tets_it_is_measured_to_as_it_is():
    tets = sh.tetrahedralize(SOLID, resolution=8)
    found = sh.signed_distance(SOLID, tets)
    exact = SOLID.distance(tets.vertices)
    assert np.abs(found.values - exact).max() < 0.2 and ((found.values < 0) == (exact < 0)).mean() > 0.98


def test_a_solid_among_several_shapes_is_united_with_them():
    both = sh.complete([SOLID, box((1.5, -1, -1), (3, 1, 1))])
    assert both.inside([[0, 0, 0], [2, 0, 0], [1.2, 0, 0]]).tolist() == [True, True, False]


def test_tets_among_several_shapes_are_their_boundary():
    tets = sh.TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    both, same = (sh.complete([part, box((2, 0, 0), (3, 1, 1))]) for part in (tets, tets.boundary))
    np.testing.assert_array_equal(both.triangles, same.triangles)


def test_a_grid_that_is_given_leaves_nothing_to_choose():
    grid = sh.Grid.around(SOLID.bounds, 8)
    for source, domain in (
        (BROKEN, grid),
        (SOLID, grid),
        (sh.Polyline([[0, 0], [1, 1]]), sh.Grid((0, 0), 1.0, (3, 3))),
    ):
        for option in ("resolution", "spacing", "padding"):
            with refused(sh.errors.UnsupportedTypeError, element=option):
                sh.signed_distance(source, domain, **{option: 9})
    for option in ("resolution", "spacing", "padding"):
        with refused(sh.errors.UnsupportedTypeError, element=option):
            SOLID.field(grid=grid, **{option: 9})
    for made in (
        lambda: sh.morphology.dilate(BROKEN, 0.1, grid, resolution=9),
        lambda: sh.morphology.shell(BROKEN, -0.1, 0.0, grid, resolution=9),
        lambda: sh.morphology.thicken(BROKEN, 0.1, domain=grid, resolution=9),
    ):
        with refused(sh.errors.UnsupportedTypeError, element="resolution"):
            made()


def test_methods_are_the_functions():
    np.testing.assert_array_equal(
        SOLID.offset(0.1, resolution=20).vertices, sh.offset(BROKEN, 0.1, resolution=20).vertices
    )
    np.testing.assert_array_equal(
        SOLID.sample(100, seed=3).distances, sh.sample_distances(SOLID, 100, seed=3).distances
    )
    np.testing.assert_array_equal(
        sh.sample_distances(BROKEN, 100).points, sh.sample_distances(SOLID.field(16), 100).points
    )
    np.testing.assert_array_equal(sh.deviation(POINTS, SOLID).distances, SOLID.distance(POINTS))
    assert len(sh.deviation(SOLID, SOLID).distances) == SOLID.boundary.n_vertices
    grown = sh.morphology.dilate(SOLID, 0.2, resolution=20)
    np.testing.assert_array_equal(grown.vertices, sh.morphology.dilate(BROKEN, 0.2, resolution=20).vertices)
    assert sh.as_shape(SOLID).n_faces == len(SOLID.triangles)


@pytest.mark.parametrize("place", [0.0, 1e6])
def test_volume_and_area(place):
    cube = sh.complete(box((place,) * 3, (place + 2,) * 3))
    assert cube.volume == pytest.approx(8, rel=1e-9) and cube.area == pytest.approx(24, rel=1e-9)
    hollow = sh.complete(
        [
            box((0, 0, 0), (3, 3, 3)),
            sh.TriangleMesh((inner := box((1, 1, 1), (2, 2, 2))).vertices, inner.faces[:, ::-1]),
        ]
    )
    assert hollow.volume == pytest.approx(26) and hollow.area == pytest.approx(60)
    overlapping = sh.complete(samples.union(box((0, 0, 0), (1, 1, 1)), box((0.5, 0, 0), (1.5, 1, 1))))
    assert overlapping.volume == pytest.approx(1.5) and overlapping.area == pytest.approx(8)
    flat = sh.complete(sheet([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]))
    assert flat.volume == 0 and flat.area == 0


@pytest.mark.parametrize("save", [lambda solid, path: solid.save(path), sh.save], ids=["method", "function"])
def test_files_have_the_solid_or_its_surface(tmp_path, save):
    save(SOLID, tmp_path / "ball.ply")
    surface = sh.read(tmp_path / "ball.ply")
    assert surface.to_trimesh().is_watertight
    assert surface.to_trimesh().volume == pytest.approx(SOLID.volume, rel=1e-6)
    save(SOLID, tmp_path / "ball.npz")
    np.testing.assert_array_equal(sh.read(tmp_path / "ball.npz").distance(POINTS), SOLID.distance(POINTS))
    with refused(sh.errors.FileFormatError, file="ball.xyzw"):
        save(SOLID, tmp_path / "ball.xyzw")


def test_three_lines_say_what_it_is():
    first, second, third = repr(SOLID).splitlines()
    assert str(len(SOLID.triangles)) in first and "-1" in second
    assert str(SOLID.diagnostics.important[0]) in third
    assert len(repr(sh.complete(samples.sphere(2))).splitlines()) == 3


def test_notebooks_show_it():
    page = SOLID._repr_html_()
    assert "<img" in page and "triangles" in page


def test_unsigned_distances_are_to_what_was_given():
    """Positive inside, not to lids; and to sheets, which have no inside."""
    mesh = samples.without_patches(samples.sphere(3), 3, 0.4)
    solid = sh.complete(mesh)
    points = np.random.default_rng(0).normal(size=(2, 30, 3))
    found = solid.distance(points, signed=False)
    sheets = sh.complete(mesh, completion="none").distance(points)
    np.testing.assert_allclose(found, sheets, rtol=1e-12)
    nearest = solid.closest(points)
    assert nearest.completed.any() and (found >= np.abs(nearest.distances) - 1e-12).all()
    np.testing.assert_allclose(found[~nearest.completed], np.abs(nearest.distances)[~nearest.completed], rtol=1e-12)
    assert found.shape == (2, 30) and solid.distance([0.0, 0.0, 0.0], signed=False) > 0.9
    whole = sh.complete(samples.sphere(3))
    np.testing.assert_allclose(whole.distance(points, signed=False), np.abs(whole.distance(points)), rtol=1e-12)
    cloud = sh.complete(sh.PointCloud(samples.sphere(3).vertices, samples.sphere(3).vertices))
    np.testing.assert_allclose(cloud.distance(points, signed=False), np.abs(cloud.distance(points)), rtol=1e-12)
    flat = sh.complete(sheet([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]))
    assert flat.distance([0.5, 0.5, -0.25], signed=False) == pytest.approx(0.25)
