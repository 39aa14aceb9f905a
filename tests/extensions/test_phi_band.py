import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import assert_closed_manifold, rms, sphere


def holed(mesh, cosine):
    """A sphere without the caps around two directions."""
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    axes = np.array([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])
    return sh.TriangleMesh(mesh.vertices, mesh.faces[(centres @ axes.T < cosine).all(axis=1)])


@pytest.mark.parametrize("shape", [sphere(1500), holed(sphere(1500), 0.95)], ids=["whole", "holed"])
def test_phi_of_a_band_is_that_of_the_whole_grid(shape):
    dense = sh.signed_distance(shape, resolution=80)
    h = float(dense.grid.spacing[0])
    band = sh.signed_distance(shape, resolution=80, band=4 * h)
    values = band.blocks.window(band.values, np.zeros(3, dtype=int), dense.grid.shape)
    there = ~np.isnan(values)
    assert there[np.abs(dense.values) < 3 * h].all() and there.mean() < 0.95
    near = there & (np.abs(dense.values) < 3 * h)
    assert rms((values - dense.values)[near]) < 0.06 * h
    truth = np.linalg.norm(dense.grid.points, axis=-1) - 1
    assert rms((values - truth)[near]) < 1.15 * rms((dense.values - truth)[near])
    for level in (0.0, -3 * h):
        assert_closed_manifold(band.contour(level))
    far = np.array([[0.0, 0.0, 0.0], [1.3, 1.3, 1.3]])
    np.testing.assert_allclose(band(far), dense(far), atol=h)


def test_turning_the_shape_over_turns_the_sign_and_scale_scales():
    shape = holed(sphere(400), 0.9)
    band = sh.signed_distance(shape, resolution=48, band=0.2)
    over = sh.signed_distance(sh.TriangleMesh(shape.vertices, shape.faces[:, ::-1]), resolution=48, band=0.2)
    large = sh.signed_distance(sh.TriangleMesh(7 * shape.vertices, shape.faces), resolution=48, band=1.4)
    points = np.random.default_rng(0).normal(size=(200, 3)) * 0.6
    np.testing.assert_allclose(over(points), -band(points), atol=2e-3)
    np.testing.assert_allclose(large(7 * points), 7 * band(points), atol=1e-2)


def test_what_has_no_band_is_refused():
    ball, line = sphere(100), sh.Polyline([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], closed=True)
    with refused(sh.UnsupportedTypeError):
        sh.signed_distance(line, resolution=32, band=0.1)
    with refused(sh.UnsupportedTypeError):
        sh.signed_distance(ball, resolution=32, band=0.1, constraint=sh.Free())
    with pytest.raises(sh.SignedHeatError):
        sh.signed_distance(ball, resolution=32, band=-1.0)
