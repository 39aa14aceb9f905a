"""Numbers of extreme size, nonsense instead of numbers, shapes without area: a right answer or one clear refusal."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.degenerate_meshes import with_caps, with_needles
from shapes.surface_cases import sphere, square
from shapes.tet_cases import boxes
from signedheat import samples
from signedheat.solids.completion import complete

BALL = samples.sphere(1)
BOW_TIE = [[0, 1, 2], [0, 3, 4]]
NONSENSE = [
    None,
    "three",
    b"abc",
    object(),
    1 + 2j,
    {},
    [[1, 2, 3], [4, 5]],
    [["a", "b", "c"]],
    np.zeros((2, 3), dtype=complex),
    np.zeros((2, 3), dtype="datetime64[s]"),
    np.array([[1, 2, object()]], dtype=object),
    np.ma.masked_array(np.zeros((2, 3)), mask=True),
    np.zeros(3, dtype=[("a", float)]),
    [[10**400, 0, 0]],
    iter([1, 2]),
]
KINDS = [f"{number}-{type(thing).__name__}" for number, thing in enumerate(NONSENSE)]
"""Names without addresses, which are the same in every process."""


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", UserWarning)  # words to the user; NumPy's are none
        yield


@pytest.mark.parametrize("scale", [1e150, 1e300, 1e-150, 1e-300])
@pytest.mark.parametrize(
    "make",
    [
        lambda s: sh.TriangleMesh(s * BALL.vertices, BALL.faces),
        lambda s: sh.PolygonMesh(s * BALL.vertices, BALL.faces.tolist()),
        lambda s: sh.PointCloud(s * BALL.vertices),
        lambda s: sh.TetMesh(s * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]), [[0, 1, 2, 3]]),
        lambda s: sh.Polyline([[0, 0], [s, s]]),
        lambda s: sh.Grid((0, 0, 0), s, (4, 4, 4)),
        lambda s: sh.DigitalSurface(np.ones((2, 2, 2), dtype=bool), spacing=s),
    ],
)
def test_sizes_beyond_computing_are_refused(make, scale):
    with pytest.raises(sh.errors.GeometryError) as caught:
        make(scale)
    assert caught.value.remedy or f"{scale:g}" in caught.value.cause


@pytest.mark.parametrize("scale", [1e30, 1e12, 1e-12, 1e-30])
def test_sizes_within_give_the_same_distances(scale):
    mesh = sh.TriangleMesh(scale * BALL.vertices, BALL.faces)
    ring = BALL.level_set(BALL.vertices[:, 2], 0.1)
    one, other = sh.SignedHeatSolver(BALL).distance(ring), sh.SignedHeatSolver(mesh).distance(ring)
    np.testing.assert_allclose(other.values / scale, one.values, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("thing", NONSENSE, ids=KINDS)
@pytest.mark.parametrize(
    "make",
    [
        lambda x: sh.TriangleMesh(x, BALL.faces),
        lambda x: sh.TriangleMesh(BALL.vertices, x),
        lambda x: sh.PolygonMesh(x, [[0, 1, 2]]),
        lambda x: sh.PolygonMesh(BALL.vertices, x),
        lambda x: sh.PointCloud(x),
        lambda x: sh.PointCloud(BALL.vertices, normals=x) if x is not None else sh.PointCloud(x),
        lambda x: sh.TetMesh(x, [[0, 1, 2, 3]]),
        lambda x: sh.TetMesh(BALL.vertices, x),
        lambda x: sh.Polyline(x),
        lambda x: sh.Grid(x, 1.0, (4, 4)),
        lambda x: sh.Grid((0, 0), x, (4, 4)),
        lambda x: sh.Grid((0, 0), 1.0, x),
        lambda x: sh.Grid.around(x),
        lambda x: sh.DigitalSurface(x),
        lambda x: sh.DigitalSurface(np.ones((2, 2, 2), dtype=bool), spacing=x),
        lambda x: sh.Curve(x, [[1, 0, 0], [0, 1, 0]]),
        lambda x: sh.Curve([0, 0], x),
        lambda x: sh.SurfacePoints(x, [[1, 0, 0]]),
        lambda x: sh.SurfacePoints([0], x),
        lambda x: BALL.path(x),
        lambda x: BALL.polyline(x),
        lambda x: BALL.level_set(x),
        lambda x: BALL.region_boundary(x),
        lambda x: sh.constraints.LevelValues(x),
        lambda x: sh.constraints.Soft(-1.0 if x is None else x),
        lambda x: sh.tetrahedralize(BALL, resolution=x),
        lambda x: sh.Field(x, np.zeros((3, 3))),
        lambda x: sh.Field(sh.Grid((0, 0), 1.0, (3, 3)), x),
        lambda x: sh.Field(sh.Grid((0, 0), 1.0, (3, 3)), np.zeros((3, 3)))(x),
        lambda x: sh.Polyline([[0, 0], [1, 1]], closed=x),
    ],
)
def test_what_holds_no_numbers_is_refused(make, thing):
    with pytest.raises(sh.errors.SignedHeatError) as caught:
        make(thing)
    assert len(caught.value.cause) > 15


@pytest.mark.parametrize("radius", [5.0, 1e3, 1e9, 1e30])
def test_wide_neighbourhoods_of_voxels_cost_no_memory(radius):
    """Normals under a blur much wider than the shape tend to those of its first moments."""
    index = np.stack(np.indices((9, 9, 9)), axis=-1) - 4.0
    surface = sh.DigitalSurface(np.linalg.norm(index, axis=-1) < 4, radius=radius)
    outward = surface.vertices[surface.surfels.corners].mean(axis=1)
    outward -= outward.mean(axis=0)
    assert ((surface.normals * outward).sum(axis=1) / np.linalg.norm(outward, axis=1)).min() > 0.9
    field = sh.SignedHeatSolver(surface).distance(surface.points_at(0))
    assert np.isfinite(field.values).all()


def test_anisotropic_voxels_need_no_cube_of_padding():
    surface = sh.DigitalSurface(np.ones((3, 3, 3), dtype=bool), spacing=(1.0, 1e-3, 1e-3), radius=4.0)
    assert np.isfinite(surface.normals).all()


@pytest.mark.parametrize(
    "make", [lambda: sh.DigitalSurface(np.ones((2, 2, 2), bool)), lambda: sh.PointCloud(BALL.vertices)]
)
def test_level_sets_need_a_value_for_each_vertex(make):
    surface = make()
    with pytest.raises(sh.errors.SourceError):
        surface.level_set(np.zeros(surface.n_vertices + 1))


@pytest.mark.parametrize("points", [np.ones((3, 3)), [[0, 0, 0], [1, 0.1, 0.3], [2, 0.2, 0.6]], np.eye(3) + 1e18])
def test_no_distance_without_area(points):
    mesh = sh.TriangleMesh(points, [[0, 1, 2]])
    for use in (
        lambda: sh.SignedHeatSolver(mesh).distance(mesh.points_at(0)),
        lambda: sh.SignedHeatSolver(mesh, intrinsic=True).distance(mesh.points_at(0)),
        lambda: mesh.polyline([points[0], points[1]]),
    ):
        with pytest.raises(sh.errors.GeometryError):
            use()


def test_weights_of_soft_constraints_have_limits_on_both_ends():
    mesh = sphere(2)
    ring = mesh.level_set(mesh.vertices[:, 2], 0.15)
    solver = sh.SignedHeatSolver(mesh)
    free, held = (
        solver.distance(ring, sh.constraints.Free()).values,
        solver.distance(ring, sh.constraints.ZeroSet(hard=True)).values,
    )
    for weak in (1e-300, 1e-12):
        np.testing.assert_allclose(solver.distance(ring, sh.constraints.Soft(weak)).values, free, atol=1e-8)
    for strong in (1e12, 1e300):
        np.testing.assert_allclose(solver.distance(ring, sh.constraints.Soft(strong)).values, held, atol=1e-5)


@pytest.mark.parametrize("flatness", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 0.0])
@pytest.mark.parametrize("refine", [False, True])
def test_intrinsic_triangulations_keep_the_area_or_refuse(flatness, refine):
    """One cap or needle in every face changes less than 1e-6; a shape that is squashed altogether may be refused."""
    for mesh in (with_needles(square(5, 0.2), flatness), with_caps(square(5, 0.2), flatness)):
        made = sh.intrinsic_delaunay(mesh, refine=refine)
        assert made.triangles.face_areas.sum() == pytest.approx(mesh.face_areas.sum(), rel=1e-6)
    try:
        squashed = sh.TriangleMesh(square(5, 0.2).vertices * [1.0, flatness, 1.0], square(5).faces)
        made = sh.intrinsic_delaunay(squashed, refine=refine, max_vertices=500)
    except sh.errors.GeometryError as error:
        assert flatness <= 1e-6 and error.element == "faces"  # rims as near as that are joined
    else:
        assert made.triangles.face_areas.sum() == pytest.approx(squashed.face_areas.sum(), rel=1e-4)


@pytest.mark.parametrize("flatness", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_intrinsic_triangulations_lose_no_more_area_than_cancels_in_heron_s_formula(flatness):
    """Height over longest side f: the area's square is a difference of numbers f⁻² times as large."""
    ball, turn = sphere(3), np.linalg.qr(np.arange(9.0).reshape(3, 3) + np.eye(3))[0]
    squashed = sh.TriangleMesh(ball.vertices * [1.0, flatness, 0.7 * flatness] @ turn, ball.faces)
    for refine in (False, True):
        made = sh.intrinsic_delaunay(squashed, refine=refine).triangles.face_areas.sum()
        assert made == pytest.approx(squashed.face_areas.sum(), rel=np.finfo(float).eps / flatness**2)


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_the_convex_method_stays_bounded_where_the_field_is_constant(scale):
    """Sources on all sides cancel: φ is rounding alone, and tells no scale."""
    mesh = sh.TriangleMesh(scale * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0.3]]), BOW_TIE)
    for constraint in (None, sh.constraints.Free()):
        field = sh.SignedHeatSolver(mesh).distance(mesh.points_at([0, 1, 2, 3, 4]), constraint)
        assert np.abs(field.values).max() < scale
        tiny = sh.Field(mesh, np.array([0, 1, -1, 2, -2]) * 1e-95 * scale, source=field.source)
        for made in (field, tiny):
            assert np.abs(sh.sharpen(made, method=sh.methods.Convex()).values).max() < 10 * scale


@pytest.mark.parametrize("origin", [1e16, -1e16, 1e20])
def test_grids_whose_spacing_is_lost_in_rounding_are_refused(origin):
    with pytest.raises(sh.errors.GeometryError) as caught:
        sh.Grid((0, origin, 0), 1.0, (4, 4, 4))
    assert caught.value.element == "spacing" and caught.value.remedy
    with refused(sh.errors.GeometryError, "spacing"):
        sh.DigitalSurface(np.ones((2, 2, 2), dtype=bool), origin=(0, origin, 0))
    with pytest.raises(sh.errors.GeometryError):
        sh.SignedHeatSolver(sh.Grid.around(sh.TriangleMesh(BALL.vertices + origin, BALL.faces), 16)).distance(
            sh.TriangleMesh(BALL.vertices + origin, BALL.faces)
        )


def test_flat_tets_among_others_do_no_harm():
    lattice = boxes((2, 2, 2), 1.0)
    vertices = lattice.vertices * [1.0, 1.0, 1e-17] + [0.0, 0.0, 0.0]
    vertices[0, 2] = 0.5
    flat = sh.TetMesh(vertices, lattice.tets)
    source = sh.TriangleMesh([[0.2, 0.3, -1], [1.6, 0.4, -1], [0.9, 0.8, 1]], [[0, 1, 2]])
    try:
        field = sh.SignedHeatSolver(flat).distance(source)
        sharp = sh.sharpen(field)
    except sh.errors.SignedHeatError as error:
        assert error.remedy or error.element
    else:
        assert np.isfinite(field.values).all() and np.isfinite(sharp.values).all()


@pytest.mark.parametrize("scale", [1e-300, 1e-160, 1e160, 1e300])
def test_only_the_directions_of_normals_of_curves_count(scale):
    mesh = sphere(2)
    ring = mesh.level_set(mesh.vertices[:, 2], 0.15)[0]
    normals = np.random.default_rng(0).normal(size=(ring.n_segments, 3)) * 0.1 + [0, 0, 1]
    fields = [
        sh.SignedHeatSolver(mesh)
        .distance(sh.Curve(ring.faces, ring.barycentric, True, normals=factor * normals))
        .values
        for factor in (1.0, scale)
    ]
    np.testing.assert_allclose(fields[1], fields[0], atol=1e-12)


@pytest.mark.parametrize("area", [1e-2, 1e-6, 1e-10])
def test_convex_sharpening_on_tets_holds_sources_of_any_size(area):
    mesh = boxes((2, 2, 2), 1.0)
    size = np.sqrt(area)
    middle = mesh.vertices.mean(axis=0) + np.array([0.01, 0.02, 0.03])
    patch = sh.TriangleMesh(middle + size * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.1]]), [[0, 1, 2]])
    phi = sh.SignedHeatSolver(mesh).distance(patch)
    sharp = sh.sharpen(phi, method=sh.methods.Convex(max_rounds=20))
    assert np.abs(sharp.values).max() < 3 * np.linalg.norm(np.ptp(mesh.vertices, axis=0))


def test_voxels_whose_corners_fall_together_are_refused():
    volume = np.random.default_rng(0).random((4, 4, 4)) < 0.5
    with refused(sh.errors.GeometryError, "spacing"):
        sh.DigitalSurface(volume, 1e-12, [1e6, 1e6, 1e6])


@pytest.mark.parametrize("name", ["closed", "oriented"])
@pytest.mark.parametrize("value", [None, 1, "yes", np.zeros((2, 2, 2)), np.ma.masked_array([True], mask=True)])
def test_flags_are_refused_in_one_line(name, value):
    mesh = sphere(1)
    with refused(sh.errors.SignedHeatError, name) as caught:
        mesh.polyline(mesh.vertices[:3], **{name: value})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("scale", [1e-30, 1e-15, 1e15, 1e30, 3.4e38])
@pytest.mark.parametrize("whole", [True, False])
def test_solids_of_any_size_are_the_same_or_refused(scale, whole):
    """Squares in single precision left its range: wrong distances, and at last a crash."""
    ball = sphere(2)
    faces = ball.faces if whole else ball.faces[np.arange(ball.n_faces) % 7 > 0]
    one = sh.signed_distance(sh.TriangleMesh(ball.vertices, faces), resolution=16)
    try:
        other = sh.signed_distance(sh.TriangleMesh(scale * ball.vertices, faces), resolution=16)
    except sh.errors.GeometryError as error:
        assert error.remedy and not 1e-15 <= scale <= 1e15
    else:
        np.testing.assert_allclose(other.values / scale, one.values, atol=1e-3)


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e20])
@pytest.mark.parametrize("times", [10.0, 1e6, 1e9, 1e15, 1e19])
def test_the_nearest_place_is_right_however_far_a_point_is(size, times):
    ball = sphere(2)
    ways = np.random.default_rng(0).normal(size=(30, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    closest = complete(sh.TriangleMesh(size * ball.vertices, ball.faces)).closest(size * times * ways)
    np.testing.assert_allclose(np.linalg.norm(closest.points, axis=1) / size, 1, atol=0.1)
    farthest = (ways @ ball.vertices.T).max(axis=1)
    np.testing.assert_allclose((closest.points * ways).sum(axis=1) / size, farthest, atol=1e-6 + 0.01 / times)
    np.testing.assert_allclose(closest.distances / size, times - farthest, rtol=1e-2 if times < 100 else 1e-6)


def test_points_whose_squares_cannot_be_computed_are_refused():
    ball = sphere(2)
    field = sh.signed_distance(ball, resolution=12)
    for measure in (complete(ball).closest, complete(ball).distance, field.closest):
        with pytest.raises(sh.errors.GeometryError):
            measure([[1e160, 0.0, 0.0]])
