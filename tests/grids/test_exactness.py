"""Fields on grids stay exact between nodes where they are saved, loaded, negated and multiplied, and say it."""

import numpy as np
import pytest

import signedheat as sh
from shapes.bodies import box
from signedheat import samples

PLATE = sh.complete(box((-10, -10, -0.5), (10, 10, 0.5)))  # thinner than a cell
FIELD = PLATE.field(resolution=16)
BAND = PLATE.field(spacing=1.3, band=2.0)
POINTS = np.random.default_rng(0).uniform([-11, -11, -1], [11, 11, 1], (500, 3))
EXACT = PLATE.distance(POINTS)
SCALED = {
    "-f": (lambda f: -f, -1),
    "~f": (lambda f: ~f, -1),
    "2 f": (lambda f: 2 * f, 2),
    "f / 4": (lambda f: f / 4, 0.25),
    "1 (-f) (-1)": (lambda f: -f * -1, 1),
    "f + 0": (lambda f: f + 0.0, 1),
    "f - 0": (lambda f: f - 0, 1),
    "-3 (f / 2)": (lambda f: -3 * (f / 2), -1.5),
}


@pytest.mark.parametrize("name", SCALED)
@pytest.mark.parametrize("field", [FIELD, BAND], ids=["grid", "band"])
def test_multiples_are_exact(tmp_path, name, field):
    change, factor = SCALED[name]
    changed = change(field)
    changed.save(tmp_path / "f.npz")
    for result in (changed, sh.read_field(tmp_path / "f.npz")):
        np.testing.assert_array_equal(result(POINTS), factor * EXACT)
        np.testing.assert_allclose(result.values, factor * field.values, rtol=1e-6)
        np.testing.assert_array_equal(result.gradient(POINTS), factor * PLATE.closest(POINTS).gradients)
        np.testing.assert_array_equal(result.closest(POINTS).points, PLATE.closest(POINTS).points)
        assert "exact" in repr(result)
        if field is BAND:
            assert result.domain.width == abs(factor) * field.domain.width


def test_levels_of_multiples_are_exact():
    ball = sh.complete(samples.sphere(4)).field(resolution=20)
    for level, radius, field in ((0.2, 1.2, ball), (0.4, 1.2, 2 * ball), (-0.2, 1.2, -ball)):
        surface = field.contour(level)
        assert np.abs(np.linalg.norm(surface.vertices, axis=1) - radius).max() < 0.004
        assert (surface.to_trimesh().volume > 0) == (field is not ball * 1 and level > 0)


def test_saved_fields_are_the_same_to_the_last_bit(tmp_path):
    broken = samples.with_flipped_faces(samples.without_patches(samples.sphere(3), 3, 0.3), 0.1)
    field = sh.signed_distance(broken, resolution=16)
    field.save(tmp_path / "ball.npz")
    again = sh.read_field(tmp_path / "ball.npz")
    points = np.random.default_rng(1).uniform(*field.solid.bounds, (300, 3))
    for one, other in zip(vars(field.closest(points)).values(), vars(again.closest(points)).values(), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(again.values, field.values)
    assert sh.sample_distances(again, 10).distances.tolist() == sh.sample_distances(field, 10).distances.tolist()


@pytest.mark.parametrize(
    "change", [lambda f: f + 0.1, lambda f: f | -f, lambda f: f & -f, lambda f: 1 - f, lambda f: 0 * f, lambda f: f - f]
)
def test_what_is_not_exact_any_more_says_so(change):
    result = change(FIELD)
    assert result.solid is None and "interpolated" in repr(result)
    np.testing.assert_array_equal(result(POINTS), result.interpolate(POINTS))


@pytest.mark.parametrize("ending", [".vti", ".npy", ".nrrd"])
def test_formats_of_values_alone_say_so(tmp_path, ending):
    FIELD.save(tmp_path / f"f{ending}")
    assert "interpolated" in repr(sh.read_field(tmp_path / f"f{ending}"))
