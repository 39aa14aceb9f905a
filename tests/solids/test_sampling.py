"""Samples to learn from: where they are taken, what their distances are, how they are kept."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes import bodies
from signedheat import samples
from signedheat.solids.sample_set import NOISE_WIDTHS


@pytest.fixture(scope="module")
def box():
    """A cuboid of 1 × 2 × 3, away from the origin, turned by nothing: its distance has a closed form."""
    mesh = bodies.box(CORNER, CORNER + SIZE)
    return sh.signed_distance(mesh, resolution=32)


CORNER, SIZE = np.array([5.0, -3.0, 1.0]), np.array([1.0, 2.0, 3.0])


def exact_distance(points):
    return bodies.distance_to_box(points, CORNER, CORNER + SIZE)


@pytest.fixture(scope="module")
def holed():
    return sh.complete(samples.without_patches(samples.sphere(3), 3, 0.4)).field(resolution=8)


def test_distances_are_exact_and_gradients_theirs(box):
    taken = sh.sample_distances(box, 20_000, near=0.5, widths=[0.2, 0.01])
    np.testing.assert_allclose(taken.distances, exact_distance(taken.points), atol=1e-12)
    assert not taken.completed.any()
    np.testing.assert_allclose(np.linalg.norm(taken.gradients, axis=1), 1, atol=1e-12)
    step = 1e-5
    smooth = np.abs(exact_distance(taken.points + step) - exact_distance(taken.points)) < np.inf
    for axis in range(3):
        move = step * np.eye(3)[axis]
        slope = (exact_distance(taken.points + move) - exact_distance(taken.points - move)) / (2 * step)
        smooth &= np.abs(slope - taken.gradients[:, axis]) < 1e-4
    assert smooth.mean() > 0.999  # all but what lies within a step of the medial axis


def test_shares_and_widths(box):
    widths = [0.3, 0.02, 0.0]
    taken = sh.sample_distances(box, 30_000, near=0.75, widths=widths)
    assert taken.near.sum() == 22_500 and taken.near[:22_500].all()
    assert taken.center == pytest.approx(CORNER + SIZE / 2)
    assert taken.radius == pytest.approx(np.linalg.norm(SIZE) / 2)
    # beside a plane the noise moves a point by a normal deviate along the normal: half the normal law's mean is 0.798 σ
    fine = taken.distances[7500:15_000]
    assert np.abs(fine).mean() == pytest.approx(0.798 * 0.02 * taken.radius, rel=0.05)
    assert np.abs(taken.distances[15_000:22_500]).max() < 1e-12
    everywhere = (taken.points[22_500:] - taken.center) / taken.radius
    assert np.abs(everywhere).max() <= 1 and np.abs(everywhere.mean(axis=0)).max() < 0.02
    assert np.abs(everywhere.std(axis=0) - 3**-0.5).max() < 0.01


def test_places_are_even_by_area(box):
    taken = sh.sample_distances(box, 11_000, near=1.0, widths=[0.0])
    on = [np.abs(taken.points[:, axis] - CORNER[axis]) < 1e-9 for axis in range(3)]
    # 22 units of area, of which the lowest faces along x, y, z have 6, 3, 2; one point in each 11,000th of it
    assert [int(side.sum()) for side in on] == pytest.approx([3000, 1500, 1000], abs=4)


def test_missing_surface_is_sampled_on_the_completed_one():
    ball = samples.sphere(4)
    solid = sh.complete(sh.TriangleMesh(ball.vertices, ball.faces[_above(ball, 0.6)]))
    made, given = solid.completion.face_areas.sum(), solid.faces.face_areas.sum()
    # the lid over the hole is at least the flat disk of radius .8, at most the cap that is missing, 2π · .4
    assert 0.9 * np.pi * 0.64 < made < 1.1 * 2 * np.pi * 0.4
    taken = sh.sample_distances(solid.field(40), 4000, near=1.0, widths=[0.0])
    assert taken.completed.mean() == pytest.approx(made / (made + given), rel=0.1)
    assert np.abs(taken.distances).max() < 1e-12


def _above(mesh, height):
    return mesh.vertices[mesh.faces].mean(axis=1)[:, 2] < height


def test_an_open_sheet_has_one_sign():
    sheet = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    taken = sh.sample_distances(sh.signed_distance(sheet, resolution=24), 2000)
    assert (taken.distances >= 0).all()
    np.testing.assert_allclose(
        taken.distances, np.linalg.norm(taken.points - np.clip(taken.points, 0, [1, 1, 0]), axis=1), atol=1e-12
    )


def test_the_same_seed_gives_the_same_bits(box, holed):
    one, other, third = (
        sh.sample_distances(holed, 500, seed=1),
        sh.sample_distances(holed, 500, seed=1),
        sh.sample_distances(holed, 500, seed=2),
    )
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.distances, other.distances)
    assert not np.isin(one.points, third.points).any()


@pytest.mark.parametrize("layout", ["arrays", "deepsdf"])
def test_files(tmp_path, box, layout):
    taken = sh.sample_distances(box, 3000, near=0.9).normalized()
    taken.save(tmp_path / "box.npz", layout)
    with np.load(tmp_path / "box.npz", allow_pickle=False) as file:
        arrays = dict(file)
    if layout == "arrays":
        np.testing.assert_array_equal(arrays["points"], taken.points)
        np.testing.assert_array_equal(arrays["distances"], taken.distances)
        np.testing.assert_array_equal(
            arrays["points"] * arrays["radius"] + arrays["center"] < CORNER, taken_below(taken)
        )
        return
    assert set(arrays) == {"pos", "neg"}
    assert arrays["pos"].dtype == arrays["neg"].dtype == np.float32
    assert (arrays["pos"][:, 3] >= 0).all() and (arrays["neg"][:, 3] < 0).all()
    assert len(arrays["pos"]) + len(arrays["neg"]) == 3000
    rows = np.concatenate([arrays["pos"], arrays["neg"]]).astype(float)
    scale = np.linalg.norm(SIZE) / 2
    exact = exact_distance(rows[:, :3] * scale + CORNER + SIZE / 2) / scale
    np.testing.assert_allclose(rows[:, 3], exact, atol=1e-6)


def taken_below(taken):
    return taken.points * taken.radius + taken.center < CORNER


def test_what_cannot_be_sampled_says_so(tmp_path, box):
    plain = sh.Field(box.domain, box.values)
    with pytest.raises(sh.errors.SourceError) as caught:
        sh.sample_distances(plain, 10)
    assert "signed_distance" in caught.value.remedy
    for wrong in (
        {"n": 0},
        {"near": 1.5},
        {"widths": [-0.1]},
        {"widths": [np.nan]},
        {"widths": []},
        {"widths": None},
        {"near": "most"},
        {"seed": -1},
        {"seed": 1.5},
        {"seed": "one"},
    ):
        with pytest.raises(sh.errors.SignedHeatError):
            sh.sample_distances(box, **{"n": 10, **wrong})
    assert not sh.sample_distances(box, 10, near=0, widths=[]).near.any()
    with pytest.raises(sh.errors.FileFormatError):
        sh.sample_distances(box, 10).save(tmp_path / "samples.txt")
    assert NOISE_WIDTHS[0] ** 2 == pytest.approx(10 * NOISE_WIDTHS[1] ** 2, rel=0.01)


def test_numbers_of_samples_that_make_no_sense_or_do_not_fit_are_refused(box):
    for n in (0, -3, 2.5, "many", None, np.nan, True):
        with refused(sh.errors.SignedHeatError, "n"):
            sh.sample_distances(box, n)
    for n in (10**15, 10**30):
        with pytest.raises(sh.errors.MemoryLimitError):
            sh.sample_distances(box, n)
