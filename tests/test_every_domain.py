"""What every domain must do: one list of cases, run over all of them."""

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest
from scipy.spatial import cKDTree

import signedheat as sh
from refusals import refused
from shapes import domain_cases as cases
from shapes import tet_cases
from shapes.domain_kinds import APART, KINDS, TILT, TURN, Kind, Surface, positions


@dataclass(frozen=True)
class Ball:
    name: str
    kind: Kind
    domain: object
    solver: sh.SignedHeatSolver

    def distance(self, sources, constraint=None):
        """At the vertices, or nodes, that have one."""
        return known(self.solver.distance(sources, constraint).values)

    @cached_property
    def source(self):
        return self.kind.source(self.domain)

    @cached_property
    def phi(self):
        """Distance to the source, which many cases are compared with."""
        return self.distance(self.source)

    def exact(self, height=0.3):
        return self.kind.exact(self.domain, height)

    @property
    def is_surface(self):
        return isinstance(self.kind, Surface)


def known(values):
    return values.ravel()[~np.isnan(values.ravel())]


@pytest.fixture(scope="module", params=KINDS)
def ball(request):
    domain = KINDS[request.param].make(1)
    return Ball(request.param, KINDS[request.param], domain, sh.SignedHeatSolver(domain))


def test_the_source_has_its_distance(ball):
    assert cases.error(ball.phi, ball.exact()) < 8e-3


def test_a_reversed_source_changes_the_sign_alone(ball):
    back = ball.kind.reversed(ball.source)
    assert ball.distance(back) == pytest.approx(-ball.phi, abs=1e-8)


def test_the_same_input_gives_the_same_bits(ball):
    again = sh.SignedHeatSolver(ball.kind.make(1))
    assert np.array_equal(known(again.distance(ball.kind.source(ball.domain)).values), ball.phi)


def test_a_broken_source_is_nearly_as_good(ball):
    assert cases.error(ball.distance(ball.kind.broken(ball.domain)), ball.exact()) < 0.02


@pytest.mark.parametrize(
    "constraint",
    [
        sh.constraints.Free(),
        sh.constraints.ZeroSet(),
        sh.constraints.ZeroSet(hard=True),
        sh.constraints.EachComponent(),
        sh.constraints.Soft(20.0),
    ],
)
def test_constraints_keep_a_source_where_it_is(ball, constraint):
    assert cases.error(ball.distance(ball.source, constraint), ball.exact()) < 1e-2


def test_levels_may_be_given(ball):
    heights = (0.0, 0.5)
    sources = [ball.kind.source(ball.domain, height)[0] for height in heights]
    levels = ball.kind.levels(*heights)
    phi = ball.distance(sources, sh.constraints.LevelValues(levels))
    assert cases.error(phi, ball.exact(0.0)) < 1e-2


def test_several_sources_at_once_are_as_one_after_the_other(ball):
    several = [ball.kind.source(ball.domain, height) for height in (0.1, 0.4)]
    together = ball.solver.distance_many(several)
    for field, sources in zip(together, several, strict=True):
        assert known(field.values) == pytest.approx(ball.distance(sources), abs=1e-6)


def test_several_sources_report_what_is_done():
    fractions = []
    lines = [sh.Polyline([[x, -1], [x, 2]]) for x in np.linspace(0.1, 1.9, 20)]
    grid = sh.Grid((0, 0), 0.25, (9, 5))
    sh.SignedHeatSolver(grid, progress=lambda fraction, step: fractions.append(fraction)).distance_many(lines)
    assert len(fractions) > 1 and fractions == sorted(fractions) and fractions[-1] == 1.0


@pytest.mark.parametrize("scale", [1e-3, 8.0])
def test_rigid_motion_and_scale(ball, scale):
    shift = np.array([7.0, -3.0, 5.0]) * scale
    moved = ball.kind.moved(ball.domain, scale, shift)
    phi = sh.SignedHeatSolver(moved).distance(ball.kind.source_moved(moved, scale, shift)).values.ravel()
    there = scale * positions(ball.domain) @ TURN.T + shift
    gap, same = cKDTree(positions(moved)).query(there)
    assert gap.max() < 1e-9 * scale
    if ball.name == "points":  # among points nearly at one distance, rounding says which are neighbours
        assert np.median(np.abs(phi[same] / scale - ball.phi)) < 1e-9
    else:
        assert phi[same] / scale == pytest.approx(ball.phi, abs=ball.kind.deviation)


@pytest.mark.parametrize("name", [name for name, kind in KINDS.items() if kind.mixed])
def test_the_order_of_vertices_and_cells_does_not_matter(name):
    kind = KINDS[name]
    domain = kind.make(1)
    mixed, order = kind.mixed(domain, np.random.default_rng(0))
    phi = sh.SignedHeatSolver(domain).distance(kind.source(domain)).values
    again = sh.SignedHeatSolver(mixed).distance(kind.source(mixed)).values
    assert again == pytest.approx(phi[order], abs=1e-4)


def test_fields_have_values_gradients_and_contours_anywhere(ball):
    field = ball.solver.distance(ball.source)
    places = positions(ball.domain)[100:109]
    assert field(places) == pytest.approx(known(field.values)[100:109], abs=1e-9)
    level = 0.2
    if not ball.is_surface:
        assert np.median(np.linalg.norm(field.gradient(places), axis=1)) == pytest.approx(1, abs=0.03)
        surface = field.contour(level)
        assert np.linalg.norm(surface.vertices, axis=1) == pytest.approx(1.2, abs=0.05)
        assert field(surface.vertices) == pytest.approx(level, abs=0.02)
    else:
        if ball.name != "voxels":  # whose squares are no tangent planes
            assert np.median(np.linalg.norm(field.cell_gradients, axis=1)) == pytest.approx(1, abs=0.02)
        (contour,) = field.contour(level)
        assert contour.closed
        assert field(contour) == pytest.approx(level, abs=1e-9)
    with refused(sh.errors.OutsideError, "level 9"):
        field.contour(9.0)


@pytest.mark.parametrize("name", [name for name in KINDS if name != "grid"])  # which is one part
def test_a_part_without_source_is_nan_with_one_warning_and_the_rest_as_without_it(name):
    kind = KINDS[name]
    one, two = kind.make(1), kind.make(2)
    first = positions(two)[:, 0] < APART / 2
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        phi = sh.SignedHeatSolver(two).distance(kind.source(two)).values.ravel()
    assert [w.category for w in caught] == [sh.errors.UnreachedWarning]
    assert np.array_equal(np.isnan(phi), ~first)
    alone = known(sh.SignedHeatSolver(one).distance(kind.source(one)).values)
    exact = kind.exact(two)
    assert cases.error(phi[first], exact[first]) == pytest.approx(cases.error(alone, kind.exact(one)), abs=2e-3)


@pytest.mark.parametrize(
    "sources", [[], sh.Curve([0, 10**7], np.eye(3)[:2]), sh.PointCloud([[0, 0, 0]]), "a circle", None]
)
def test_sources_that_do_not_fit_are_refused(ball, sources):
    with refused(sh.errors.SourceError):
        ball.solver.distance(sources)


def test_a_vertex_that_does_not_exist_is_refused(ball):
    if ball.is_surface:
        with pytest.raises(sh.errors.SourceError):
            ball.domain.path([0, 10**7])


def test_level_values_must_be_as_many_as_the_sources(ball):
    with refused(sh.errors.ConstraintError):
        ball.distance(ball.source, sh.constraints.LevelValues([0.0, 1.0, 2.0]))


def test_isolated_points_and_unoriented_curves_have_unsigned_distance_on_surfaces(ball):
    if not ball.is_surface:
        return
    unit = positions(ball.domain) / np.linalg.norm(positions(ball.domain), axis=1, keepdims=True)
    pole = int(np.argmax(positions(ball.domain) @ TILT))
    phi = ball.distance(ball.domain.points_at(pole))
    assert cases.error(phi, np.arccos(np.clip(unit @ TILT, -1, 1))) < 0.05
    (circle,) = ball.source
    unoriented = sh.Curve(circle.faces, circle.barycentric, closed=circle.closed, oriented=False)
    assert cases.error(ball.distance(unoriented), np.abs(ball.exact())) < 0.06


LINE = [[-1, 0.21, 0], [1, 0.21, 0]]
SHEET = sh.TriangleMesh(np.array([[-1, 0.21, -1], [-1, 0.21, 1], [1, 0.21, 1], [1, 0.21, -1]]), [[0, 1, 2], [0, 2, 3]])


def tet_plate(n=(10, 10, 3)):
    mesh = tet_cases.boxes(n, 0.2, jitter=0.1)
    return sh.TetMesh(mesh.vertices - [1, 1, 0.3], mesh.tets)


PLATES = {
    "triangles": lambda: sh.TriangleMesh(*cases.triangles(20)),
    "polygons": lambda: sh.PolygonMesh(*cases.bricks(20)),
    "points": lambda: sh.PointCloud(cases.quads(20, 0.3)[0], np.tile([0.0, 0, 1], (441, 1))),
    "tets": tet_plate,
    "grid": lambda: sh.Grid((-1, -1, -0.3), 0.1, (21, 21, 7)),
}


@pytest.mark.parametrize("name", PLATES)
def test_distance_runs_straight_into_a_boundary(name):
    plate = PLATES[name]()
    line = SHEET if name in ("tets", "grid") else plate.polyline(LINE)
    phi = known(sh.SignedHeatSolver(plate).distance(line).values)
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


def ugly_tets():
    """A plate of tets with flat, double and overlapping ones, others inside out, a vertex that none uses, and more tets
    that hang on an edge and on a vertex."""
    plate = tet_plate()
    vertices, tets = plate.vertices.copy(), plate.tets.tolist()
    middle = vertices[tets[300]].mean(axis=0)
    flat = int(np.argmin(np.linalg.norm(vertices - [0.6, -0.6, 0], axis=1)))
    vertices[flat] = vertices[plate.tets[(plate.tets == flat).any(axis=1)][0]].mean(axis=0)
    n = len(vertices)
    more = [
        [1, 5, 9, 9],
        tets[50],
        tets[51][::-1],
        [*tets[300][:3], n],
        [0, 1, n + 1, n + 2],
        [3, *range(n + 3, n + 6)],
    ]
    hanging = [[-1.5, -1, -1], [-1.5, -0.8, -1], [-1.5, -1.3, -0.3], [-1.3, -1.5, -0.3], [-1.3, -1.3, -0.5]]
    return sh.TetMesh(np.concatenate([vertices, [middle], hanging, [[9, 9, 9]]]), [*tets, *more])


UGLY = [ugly_triangles, ugly_polygons, ugly_points, ugly_voxels, ugly_tets]


@pytest.mark.parametrize("make", UGLY, ids=lambda f: f.__name__)
def test_ugly_but_valid_domains_work(make):
    domain = make()
    if isinstance(domain, sh.TetMesh):
        line = sh.TriangleMesh(SHEET.vertices * [2, 1, 2] + [0, 0.12, 0], SHEET.faces)
    else:
        line = domain.polyline([[-0.9, 0.33, 0], [0.9, 0.33, 0]], max_distance=1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sh.errors.UnreachedWarning)
        phi = sh.SignedHeatSolver(domain).distance(line, sh.constraints.Free()).values.ravel()
    place = positions(domain)
    plate = (np.abs(place) < 0.8).all(axis=1) & (np.abs(place[:, 2]) < 0.2)
    assert np.isfinite(phi[plate]).mean() > 0.98
    beside = plate & np.isfinite(phi) & (np.abs(place[:, 1] - 0.33) < 0.5) & (np.abs(place[:, 1] - 0.33) > 0.2)
    if not isinstance(domain, sh.DigitalSurface):  # whose plate has two sides
        right = np.sign(phi[beside]) == np.sign(place[beside, 1] - 0.33)
        assert max(right.mean(), 1 - right.mean()) > 0.9
