"""What every surface domain must do: one list of cases, run over all of them."""

import warnings
from dataclasses import dataclass

import domain_cases as cases
import numpy as np
import pytest

import signedheat as sh

TILT = np.array([0.3, 0.2, 0.9]) / np.linalg.norm([0.3, 0.2, 0.9])


def globe_triangles(n=24):
    vertices, polygons = cases.globe(n)
    return sh.TriangleMesh(vertices, [t for p in polygons for t in ([p[0], p[1], p[2]], [p[0], *p[2:]]) if len(t) == 3])


def voxels_of_balls(n_balls, n=26):
    volume, spacing, first = cases.ball(n)
    return sh.DigitalSurface(np.concatenate([volume] * n_balls), spacing, first)


def copies(make, n_copies):
    """A domain of vertices and cells, several times, 4 apart along x."""
    vertices, cells = make()
    vertices = np.concatenate([np.add(vertices, [4.0 * k, 0, 0]) for k in range(n_copies)])
    n = len(vertices) // n_copies
    return vertices, [[i + k * n for i in cell] for k in range(n_copies) for cell in cells]


def triangle_balls(n_balls):
    mesh = globe_triangles()
    return sh.TriangleMesh(*copies(lambda: (mesh.vertices, mesh.faces.tolist()), n_balls))


def polygon_balls(n_balls):
    return sh.PolygonMesh(*copies(lambda: cases.globe(24), n_balls))


def cloud_of_balls(n_balls):
    points = cases.sphere_points(1200)
    return sh.PointCloud(np.concatenate([np.add(points, [4.0 * k, 0, 0]) for k in range(n_balls)]))


BALLS = {
    "triangles": triangle_balls,
    "polygons": polygon_balls,
    "points": cloud_of_balls,
    "voxels": voxels_of_balls,
}


def positions(domain):
    return domain.points if isinstance(domain, sh.PointCloud) else domain.vertices


def latitude(domain, height=0.3):
    """Distance to a circle on the unit ball at the origin, growing along `TILT`."""
    unit = positions(domain) / np.linalg.norm(positions(domain), axis=1, keepdims=True)
    return np.arcsin(np.clip(unit @ TILT, -1, 1)) - np.arcsin(height)


@dataclass(frozen=True)
class Ball:
    name: str
    domain: object
    solver: sh.SignedHeatSolver

    def circle(self, height=0.3):
        return self.domain.level_set(latitude(self.domain, height))

    def distance(self, *arguments):
        return self.solver.distance(*arguments).values


@pytest.fixture(scope="module", params=BALLS)
def ball(request):
    domain = BALLS[request.param](1)
    return Ball(request.param, domain, sh.SignedHeatSolver(domain))


def test_a_circle_has_its_distance(ball):
    assert cases.error(ball.distance(ball.circle()), latitude(ball.domain)) < 6e-3


def test_a_reversed_curve_changes_the_sign_alone(ball):
    there = ball.circle()
    back = [curve.reversed() for curve in there]
    assert ball.distance(back) == pytest.approx(-ball.distance(there), abs=1e-9)


def test_the_same_input_gives_the_same_bits(ball):
    again = sh.SignedHeatSolver(BALLS[ball.name](1))
    assert np.array_equal(again.distance(ball.circle()).values, ball.distance(ball.circle()))


def test_a_broken_circle_is_nearly_as_good(ball):
    (whole,) = ball.circle()
    n = whole.n_points
    parts = [slice(0, int(0.3 * n)), slice(int(0.42 * n), int(0.6 * n)), slice(int(0.7 * n), int(0.95 * n))]
    broken = [sh.Curve(whole.faces[p], whole.barycentric[p]) for p in parts]
    assert cases.error(ball.distance(broken), latitude(ball.domain)) < 0.02


@pytest.mark.parametrize(
    "constraint", [sh.Free(), sh.ZeroSet(), sh.ZeroSet(hard=True), sh.EachComponent(), sh.Soft(20.0)]
)
def test_constraints_keep_a_circle_where_it_is(ball, constraint):
    phi = ball.distance(ball.circle(), constraint)
    assert cases.error(phi, latitude(ball.domain)) < 1e-2


def test_levels_may_be_given(ball):
    circles = [ball.circle(0.0)[0], ball.circle(0.5)[0]]
    levels = [0.0, np.arcsin(0.5)]
    phi = ball.distance(circles, sh.LevelValues(levels))
    assert cases.error(phi, latitude(ball.domain, 0.0)) < 1e-2


def test_isolated_points_and_unoriented_curves_have_unsigned_distance(ball):
    pole = int(np.argmax(positions(ball.domain) @ TILT))
    phi = ball.distance(ball.domain.points_at(pole))
    exact = np.arccos(
        np.clip((positions(ball.domain) / np.linalg.norm(positions(ball.domain), axis=1)[:, None]) @ TILT, -1, 1)
    )
    assert cases.error(phi, exact) < 0.05
    (circle,) = ball.circle()
    unoriented = sh.Curve(circle.faces, circle.barycentric, closed=circle.closed, oriented=False)
    assert cases.error(ball.distance(unoriented), np.abs(latitude(ball.domain))) < 0.06


def test_scale(ball):
    if ball.name == "voxels":
        large = sh.DigitalSurface(ball.domain.volume, 8 * ball.domain.spacing, 8 * ball.domain.origin)
    elif ball.name == "points":
        large = sh.PointCloud(8 * ball.domain.points)
    elif ball.name == "polygons":
        large = sh.PolygonMesh(8 * ball.domain.vertices, ball.domain.polygons)
    else:
        large = sh.TriangleMesh(8 * ball.domain.vertices, ball.domain.faces)
    phi = sh.SignedHeatSolver(large).distance(ball.circle()).values
    assert phi / 8 == pytest.approx(ball.distance(ball.circle()), abs=1e-9)


def test_fields_have_values_gradients_and_contours_anywhere(ball):
    field = ball.solver.distance(ball.circle())
    assert field(positions(ball.domain)[:9]) == pytest.approx(field.values[:9], abs=1e-9)
    if ball.name != "voxels":  # whose squares are no tangent planes
        assert np.median(np.linalg.norm(field.face_gradients, axis=1)) == pytest.approx(1, abs=0.02)
    (contour,) = field.contour(0.2)
    assert contour.closed
    assert field(contour) == pytest.approx(0.2, abs=1e-9)
    with pytest.raises(sh.OutsideError, match="nowhere"):
        field.contour(9.0)


@pytest.mark.parametrize("name", BALLS)
def test_a_part_without_source_is_nan_with_one_warning_and_the_rest_as_without_it(name):
    one, two = BALLS[name](1), BALLS[name](2)
    first = positions(two)[:, 0] < 1.1
    exact = latitude(two)
    (circle,) = two.level_set(np.where(first, exact, np.nan))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        phi = sh.SignedHeatSolver(two).distance(circle).values
    assert [w.category for w in caught] == [sh.UnreachedWarning]
    assert np.array_equal(np.isnan(phi), ~first)
    alone = sh.SignedHeatSolver(one).distance(one.level_set(latitude(one))).values
    assert cases.error(phi[first], exact[first]) == pytest.approx(cases.error(alone, latitude(one)), abs=2e-3)


@pytest.mark.parametrize(
    ("sources", "match"),
    [
        ([], "no source"),
        (sh.Curve([0, 10**7], np.eye(3)[:2]), "face ids go from 0 to"),
        (sh.PointCloud([[0, 0, 0]]), "Curve or SurfacePoints"),
    ],
)
def test_sources_that_do_not_fit_are_refused(ball, sources, match):
    with pytest.raises(sh.SourceError, match=match):
        ball.solver.distance(sources)


def test_a_vertex_that_does_not_exist_is_refused(ball):
    with pytest.raises(sh.SourceError):
        ball.domain.path([0, 10**7])


PLATES = {
    "triangles": lambda: sh.TriangleMesh(*cases.triangles(20)),
    "polygons": lambda: sh.PolygonMesh(*cases.bricks(20)),
    "points": lambda: sh.PointCloud(cases.quads(20, 0.3)[0], np.tile([0.0, 0, 1], (441, 1))),
}


@pytest.mark.parametrize("name", PLATES)
def test_distance_runs_straight_into_a_boundary(name):
    plate = PLATES[name]()
    line = plate.polyline([[-1, 0.21, 0], [1, 0.21, 0]])
    phi = sh.SignedHeatSolver(plate).distance(line).values
    assert phi == pytest.approx(positions(plate)[:, 1] - 0.21, abs=0.01)


def ugly_triangles():
    """A plate with a fin on it, faces of no area, double faces, a flipped face, and a vertex that no face uses."""
    vertices, faces = cases.triangles(8)
    fin = [[36, 44, 81], [36, 81, 44]]
    faces = [*faces, *fin, [0, 1, 1], [5, 6, 7], faces[3], faces[9][::-1]]
    return sh.TriangleMesh(np.concatenate([vertices, [[-0.1, 0.1, 0.7], [5, 5, 5]]]), faces)


def ugly_polygons():
    """A plate of bricks with a fin of quads, a polygon of no area, a star, and a polygon that repeats a corner."""
    vertices, polygons = cases.bricks(8)
    top = np.add(vertices[36:45], [0, 0, 0.3])
    fins = [[36 + k, 37 + k, 82 + k, 81 + k] for k in range(8)]
    angle = np.arange(10) * np.pi / 5
    star = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) * np.where(np.arange(10) % 2, 0.2, 0.6)[:, None]
    star += vertices[0] - star[0]
    more = [[0, *range(90, 99)], [0, 1, 2, 3], [10, 10, 11, 12]]
    return sh.PolygonMesh(np.concatenate([vertices, top, star[1:]]), [*polygons, *fins, *more])


def ugly_points():
    """A noisy plate with double points, a bundle of points nearly at one place, and a far one."""
    rng = np.random.default_rng(0)
    points = np.column_stack([2 * rng.random((700, 2)) - 1, 0.01 * rng.normal(size=700)])
    bundle = points[:1] + 1e-9 * rng.normal(size=(40, 3))
    return sh.PointCloud(np.concatenate([points, points[:50], bundle, [[0, 0, 40.0]]]))


def ugly_voxels():
    """A plate of voxels with bumps that touch it along edges and at corners, and a hole."""
    volume = np.zeros((20, 20, 6), dtype=bool)
    volume[:, :, 1:3] = True
    volume[9:11, 9:11] = False
    volume[4, 4, 3], volume[5, 5, 3], volume[6, 5, 4], volume[7, 6, 5] = True, True, True, True
    return sh.DigitalSurface(volume, 0.1, (-0.95, -0.95, -0.15))


@pytest.mark.parametrize("make", [ugly_triangles, ugly_polygons, ugly_points, ugly_voxels], ids=lambda f: f.__name__)
def test_ugly_but_valid_surfaces_work(make):
    domain = make()
    line = domain.polyline([[-0.9, 0.33, 0], [0.9, 0.33, 0]], max_distance=1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sh.UnreachedWarning)
        phi = sh.SignedHeatSolver(domain).distance(line, sh.Free()).values
    place = positions(domain)
    plate = (np.abs(place) < 0.8).all(axis=1) & (np.abs(place[:, 2]) < 0.2)
    assert np.isfinite(phi[plate]).mean() > 0.98
    beside = plate & np.isfinite(phi) & (np.abs(place[:, 1] - 0.33) < 0.5) & (np.abs(place[:, 1] - 0.33) > 0.2)
    if not isinstance(domain, sh.DigitalSurface):  # whose plate has two sides
        right = np.sign(phi[beside]) == np.sign(place[beside, 1] - 0.33)
        assert max(right.mean(), 1 - right.mean()) > 0.9
