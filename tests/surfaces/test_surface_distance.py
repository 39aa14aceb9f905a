"""Distance on surfaces: what may not matter does not, and what is asked for comes out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import sparse

import signedheat as sh
from refusals import refused
from shapes.surface_cases import book, flipped, sphere, square
from shapes.surfaces import FlatGluing
from signedheat.diagnostics import EdgesLengthened
from signedheat.linear import available_backends, whole
from signedheat.method import diffuse, integrate, normalize
from signedheat.surfaces.repaired_mesh import MeshRepaired
from signedheat.surfaces.surface_discretization import SurfaceDiscretization
from signedheat.surfaces.vector_heat import vector_heat_forces, vector_heat_matrix

CONSTRAINTS = [
    sh.constraints.Free(),
    sh.constraints.ZeroSet(),
    sh.constraints.EachComponent(),
    sh.constraints.LevelValues([0.3]),
    sh.constraints.Soft(2.0),
]
every_constraint = pytest.mark.parametrize("constraint", CONSTRAINTS, ids=repr)


def bumpy(subdivisions=3):
    """A sphere without symmetry."""
    mesh = sphere(subdivisions)
    x, y, z = mesh.vertices.T
    return sh.TriangleMesh(mesh.vertices * (1 + 0.2 * np.sin(5 * x + y) * np.cos(4 * y + z))[:, None], mesh.faces)


def loops(mesh):
    """Three closed curves that cross faces, but not each other."""
    height = mesh.vertices @ [0.1, -0.05, 1.0]
    return [max(mesh.level_set(height, level), key=lambda c: c.n_points) for level in (-0.45, 0.1, 0.5)]


def distance(mesh, sources, constraint=None, diffusion=1.0):
    return sh.SignedHeatSolver(mesh, diffusion, intrinsic=False).distance(sources, constraint).values


# --- invariances ------------------------------------------------------------------------------------------------------


@every_constraint
def test_scale_and_rigid_motion(constraint):
    mesh, scale = bumpy(), 1e-3
    turn, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    moved = sh.TriangleMesh(scale * mesh.vertices @ turn.T + [5, -3, 1], mesh.faces)
    scaled = {
        sh.constraints.Soft: lambda c: sh.constraints.Soft(c.weight / scale),
        sh.constraints.LevelValues: lambda c: sh.constraints.LevelValues([0.3 * scale]),
    }
    other = scaled.get(type(constraint), lambda c: c)(constraint)
    points = mesh.points_at([17])
    phi = distance(
        mesh, [*loops(mesh)[:1], points][: 1 if type(constraint) is sh.constraints.LevelValues else 2], constraint
    )
    same = distance(
        moved, [*loops(mesh)[:1], points][: 1 if type(constraint) is sh.constraints.LevelValues else 2], other
    )
    np.testing.assert_allclose(same, scale * phi, atol=1e-9 * scale)


@every_constraint
def test_reversed_curves_change_the_sign(constraint):
    mesh = bumpy()
    curve = loops(mesh)[0]
    back = sh.Curve(curve.faces[::-1], curve.barycentric[::-1], closed=curve.closed)
    other = sh.constraints.LevelValues([-0.3]) if isinstance(constraint, sh.constraints.LevelValues) else constraint
    np.testing.assert_allclose(distance(mesh, back, other), -distance(mesh, curve, constraint), atol=1e-11)


@every_constraint
def test_numbering_does_not_matter(constraint):
    mesh, rng = bumpy(), np.random.default_rng(1)
    vertex, face = rng.permutation(mesh.n_vertices), rng.permutation(mesh.n_faces)
    shuffled = sh.TriangleMesh(mesh.vertices[vertex], np.argsort(vertex)[mesh.faces][face])
    curve = loops(mesh)[0]
    same = sh.Curve(np.argsort(face)[curve.faces], curve.barycentric, closed=True)
    phi = distance(mesh, curve, constraint)
    np.testing.assert_allclose(distance(shuffled, same, constraint), phi[vertex], atol=1e-10)


@every_constraint
def test_flipped_faces_do_not_matter_where_normals_are_given(constraint):
    mesh = bumpy()
    curve = loops(mesh)[0]
    after = np.r_[1 : curve.n_points, 0]
    ends = np.einsum("nk,nkd->nd", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]])
    normals = mesh.face_area_vectors[curve.faces]
    left = np.cross(normals, ends[after] - ends)
    turned = np.random.default_rng(2).random(mesh.n_faces) < 0.4
    faces = np.where(turned[:, None], mesh.faces[:, [0, 2, 1]], mesh.faces)
    barycentric = np.where(turned[curve.faces][:, None], curve.barycentric[:, [0, 2, 1]], curve.barycentric)
    phi = distance(mesh, sh.Curve(curve.faces, curve.barycentric, closed=True, normals=left), constraint)
    broken = sh.TriangleMesh(mesh.vertices, faces)
    same = distance(broken, sh.Curve(curve.faces, barycentric, closed=True, normals=left), constraint)
    np.testing.assert_allclose(same, phi, atol=1e-10)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("along_edges", [False, True])
def test_left_is_carried_along_a_curve_where_faces_are_turned(along_edges, seed):
    """Without normals the first segment tells the side, and the turned faces along the curve do not change it."""
    mesh = bumpy()
    turned = np.random.default_rng(seed).random(mesh.n_faces) < 0.4
    faces = np.where(turned[:, None], mesh.faces[:, [0, 2, 1]], mesh.faces)
    curve = mesh.path([0, 40, 90]) if along_edges else loops(mesh)[0]
    barycentric = np.where(turned[curve.faces][:, None], curve.barycentric[:, [0, 2, 1]], curve.barycentric)
    phi = distance(mesh, curve, sh.constraints.ZeroSet())
    other = distance(
        sh.TriangleMesh(mesh.vertices, faces),
        sh.Curve(curve.faces, barycentric, curve.closed),
        sh.constraints.ZeroSet(),
    )
    np.testing.assert_allclose(other * np.sign(phi @ other), phi, atol=1e-10)


@pytest.mark.parametrize("closed", [False, True], ids=["Möbius strip", "Klein bottle"])
def test_nonorientable_surfaces_equal_their_double_cover(closed):
    gluing = FlatGluing(14, 5, closed)
    base, cover = gluing.surface, gluing.cover
    assert not base.is_consistently_oriented
    rng = np.random.default_rng(0)
    in_faces = np.where(rng.random(base.n_faces) < 0.1, rng.normal(size=base.n_faces) + 1j, 0)
    fields = []
    for triangles, laps in ((base, 1), (cover, 2)):
        surface = SurfaceDiscretization(None, triangles, np.arange(triangles.n_vertices))
        vectors = np.zeros(triangles.n_edges, dtype=complex)
        np.add.at(vectors, triangles.edges.face_edges, triangles.in_edge_frames(np.tile(in_faces, laps)[:, None]))
        samples = np.eye(base.n_vertices)[:1] if laps == 1 else np.eye(cover.n_vertices)[gluing.below == 0]
        source = SimpleNamespace(
            extrapolated=False,
            vectors=sparse.csr_array(vectors[None]),
            time=0.25,
            interpolation=sparse.csr_matrix(samples),
            weights=np.ones(len(samples)),
        )
        directions = normalize(surface, diffuse(surface, source))
        fields.append((directions, integrate(surface, directions, source, sh.constraints.Free())))
    np.testing.assert_allclose(np.tile(fields[0][0], 2), fields[1][0], atol=1e-11)
    np.testing.assert_allclose(fields[0][1][gluing.below], fields[1][1], atol=1e-11)


# --- constraints ------------------------------------------------------------------------------------------------------


def test_constraints_hold_at_every_sample():
    mesh = bumpy()
    curves = loops(mesh)
    solver = sh.SignedHeatSolver(mesh, intrinsic=False)
    tolerance = 1e-8 * solver.discretization.spacing
    field = solver.distance(curves, sh.constraints.ZeroSet(hard=True))
    assert np.abs(field.source.interpolation @ field.values).max() < tolerance
    field = solver.distance(curves, sh.constraints.LevelValues(range(len(curves)), hard=True))
    assert np.abs(field.source.interpolation @ field.values - field.source.source_ids).max() < tolerance
    field = solver.distance(curves, sh.constraints.EachComponent(hard=True))
    levels = field.source.interpolation @ field.values
    means = np.bincount(field.source.components, levels) / np.bincount(field.source.components)
    assert np.abs(levels - means[field.source.components]).max() < tolerance
    assert np.ptp(means) > 1e-3
    assert abs(field.source.weights @ levels) < tolerance


def test_each_component_is_the_minimum_over_all_constants():
    """No other constants, imposed as levels, leave less of ∫|∇φ − Y|²."""
    mesh = bumpy()
    curves, solver = loops(mesh), sh.SignedHeatSolver(mesh, intrinsic=False)
    surface = solver.discretization
    source = surface.lower(surface.adapt(curves)[1], 1.0)
    load = surface.divergence(normalize(surface, diffuse(surface, source)))

    def energy(phi):
        stiffness = surface.stiffness
        return 0.5 * (2 * phi @ (stiffness @ phi) - stiffness.diagonal() @ phi**2) - load @ phi

    best = solver.distance(curves, sh.constraints.EachComponent())
    levels = best.source.interpolation @ best.values
    constants = np.array([levels[best.source.components == k][0] for k in range(len(curves))])
    assert energy(best.values) < energy(solver.distance(curves).values)
    for k in range(len(curves)):
        nudge = 1e-3 * (np.arange(len(curves)) == k)
        assert energy(best.values) < energy(
            solver.distance(curves, sh.constraints.LevelValues(constants + nudge)).values
        )


def test_single_points_at_levels_of_their_own_constrain_nothing():
    """Each takes the level that φ has there anyway, beside a curve or alone."""
    mesh = bumpy()
    solver, points = sh.SignedHeatSolver(mesh, intrinsic=False), sh.SurfacePoints([3, 80, 200], np.full((3, 3), 1 / 3))
    alone, free = (
        solver.distance(points, each).values for each in (sh.constraints.EachComponent(), sh.constraints.Free())
    )
    assert np.abs(alone - free).max() < 1e-13
    curve = loops(mesh)[1]
    beside = solver.distance([curve, points], sh.constraints.EachComponent())
    rows, single = beside.source.interpolation, beside.source.source_ids == 1
    phi = rows @ beside.values
    level = np.average(phi[~single], weights=beside.source.weights[~single])
    held = solver.distance([curve, points], sh.constraints.LevelValues([0.0, *(phi[single] - level)])).values
    assert np.ptp(held - beside.values) < 1e-6 * np.ptp(held)


def test_dependent_rows_are_no_obstacle():
    """Two crossings of one edge, a curve given twice, and all corners of a face through its inside."""
    mesh = bumpy()
    curve = loops(mesh)[0]
    twice = [curve, curve, mesh.points_at(mesh.faces[100]), sh.SurfacePoints([100], [[0.2, 0.3, 0.5]])]
    field = sh.SignedHeatSolver(mesh, intrinsic=False).distance([curve, curve], sh.constraints.ZeroSet(hard=True))
    assert np.abs(field.source.interpolation @ field.values).max() < 1e-8 * 0.05
    field = sh.SignedHeatSolver(mesh, intrinsic=False).distance(twice, sh.constraints.ZeroSet(hard=True))
    assert np.abs(field.source.interpolation @ field.values).max() < 1e-8 * 0.05
    wave = mesh.vertices[:, 2] + 1e-7 * np.sin(1e3 * mesh.vertices[:, 0])
    close = mesh.level_set(mesh.vertices[:, 2], 0.2) + mesh.level_set(wave, 0.2)
    field = sh.SignedHeatSolver(mesh, intrinsic=False).distance(close, sh.constraints.ZeroSet(hard=True))
    assert np.abs(field.source.interpolation @ field.values).max() < 1e-8 * 0.05


def level_sets(mesh, rng):
    heights = mesh.vertices @ rng.normal(size=3)
    return mesh.level_set(heights, float(np.median(heights)))


def zigzag(mesh, rng):
    """Nine crossings of one edge, back and forth between its faces."""
    edge = rng.integers(len(mesh.edges.vertices))
    face, side = np.argwhere(mesh.edges.face_edges == edge)[0]
    other = np.flatnonzero((mesh.edges.face_edges == edge).any(axis=1))[1]
    crossings = np.zeros((9, 3))
    crossings[:, (side + 1) % 3] = np.linspace(0.1, 0.9, 9)
    crossings[:, side] = 1 - crossings[:, (side + 1) % 3]
    weights = np.stack([crossings, np.tile([0.3, 0.3, 0.4], (9, 1))], axis=1).reshape(-1, 3)
    return sh.Curve(np.ravel([[face, (face, other)[k % 2]] for k in range(9)]), weights)


def there_and_back(mesh, rng):
    return [
        level_sets(mesh, rng)[0],
        mesh.path(mesh.edges.vertices[rng.integers(len(mesh.edges.vertices))], closed=True),
    ]


def round_a_vertex(mesh, rng):
    vertex = rng.integers(mesh.n_vertices)
    around = np.flatnonzero((mesh.faces == vertex).any(axis=1))
    corner = np.eye(3)[(mesh.faces[around] == vertex).argmax(axis=1)]
    loop = sh.Curve(around, corner + 1e-7 * (1 / 3 - corner), closed=True)
    return [level_sets(mesh, rng)[0], loop]


def random_polyline(mesh, rng):
    return mesh.polyline(mesh.vertices[rng.integers(mesh.n_vertices, size=40)] + 0.02 * rng.normal(size=(40, 3)))


def almost_the_same(mesh, rng):
    points = mesh.vertices[rng.integers(mesh.n_vertices, size=5)]
    curve = mesh.polyline(points)
    return [curve, curve, mesh.polyline(points + 1e-6)]


@pytest.mark.filterwarnings("ignore:closed curves smaller:signedheat.errors.InexactWarning")  # round_a_vertex
@pytest.mark.parametrize("make", [level_sets, zigzag, there_and_back, round_a_vertex, random_polyline, almost_the_same])
@pytest.mark.parametrize("seed", range(3))
def test_the_zero_set_holds_however_curves_cross_the_mesh(make, seed):
    mesh = sphere(3)
    curve = make(mesh, np.random.default_rng(seed))
    solver = sh.SignedHeatSolver(mesh, intrinsic=False)
    usual, hard = (
        solver.distance(curve, constraint)
        for constraint in (sh.constraints.ZeroSet(), sh.constraints.ZeroSet(hard=True))
    )
    tolerance = 1e-8 * solver.discretization.spacing
    missed = np.abs(usual.source.interpolation @ usual.values)
    assert np.average(missed, weights=usual.source.weights) < 0.1 * solver.discretization.spacing
    assert np.abs(hard.source.interpolation @ hard.values).max() < tolerance
    assert np.ptp(usual.values) > 0.1


def test_levels_that_contradict_each_other_are_refused():
    mesh = bumpy()
    x, y, _ = mesh.vertices.T
    crossing = [mesh.level_set(x, 0.1)[0], mesh.level_set(y, 0.1)[0], mesh.level_set(x, 0.1)[0]]
    with refused(sh.errors.ConstraintError, "vertex 281"):
        sh.SignedHeatSolver(mesh, intrinsic=False).distance(crossing, sh.constraints.LevelValues([0.0, 0.0, 1.0]))


def test_a_zero_set_at_every_vertex_leaves_zero():
    square = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    assert np.abs(sh.SignedHeatSolver(square, intrinsic=False).distance(square.boundary_curves()).values).max() < 1e-15


def test_soft_lies_between_free_and_zero_set():
    mesh = bumpy()
    solver, curves = (
        sh.SignedHeatSolver(mesh, intrinsic=False),
        [mesh.region_boundary(mesh.vertices[mesh.faces[:, 0], 2] > 0.2)[0]],
    )
    free, hard = (solver.distance(curves, c).values for c in (sh.constraints.Free(), sh.constraints.ZeroSet()))
    np.testing.assert_allclose(solver.distance(curves, sh.constraints.Soft(1e-7)).values, free, atol=1e-5)
    np.testing.assert_allclose(solver.distance(curves, sh.constraints.Soft(1e8)).values, hard, atol=1e-5)
    assert np.abs(free - hard).max() > 1e-3


# --- parts, and what is broken ----------------------------------------------------------------------------------------


@every_constraint
def test_parts_do_not_know_of_each_other(constraint):
    one = bumpy()
    both = sh.TriangleMesh(
        np.concatenate([one.vertices, 2 * one.vertices + [9, 0, 0], [[7, 7, 7]]]),
        np.concatenate([one.faces, one.faces + one.n_vertices]),
    )
    curve = loops(one)[0]
    with pytest.warns(sh.errors.UnreachedWarning, match=f"{one.n_vertices + 1}"):
        field = sh.SignedHeatSolver(both, 1.0, intrinsic=False).distance(curve, constraint)
    assert np.array_equal(field.diagnostics.unreached, np.arange(one.n_vertices, both.n_vertices))
    assert np.isnan(field.values[one.n_vertices :]).all()
    solver = sh.SignedHeatSolver(
        one, (sh.SignedHeatSolver(both).discretization.spacing / spacing(one)) ** 2, intrinsic=False
    )
    if isinstance(
        constraint, sh.constraints.ZeroSet | sh.constraints.EachComponent | sh.constraints.LevelValues
    ):  # springs are measured in h
        constraint = replace(constraint, hard=True)
        with pytest.warns(sh.errors.UnreachedWarning):
            field = sh.SignedHeatSolver(both, 1.0, intrinsic=False).distance(curve, constraint)
    np.testing.assert_allclose(field.values[: one.n_vertices], solver.distance(curve, constraint).values, atol=1e-10)


def spacing(mesh):
    return sh.SignedHeatSolver(mesh, intrinsic=False).discretization.spacing


def test_parts_that_meet_in_a_vertex_only_are_not_reached():
    """No vector crosses a single vertex: what lies beyond has no distance rather than a wrong one."""
    mesh = square(5)
    first = mesh.n_vertices - 1
    ids = np.concatenate([[first], np.arange(mesh.n_vertices, 2 * mesh.n_vertices - 1)])
    bow = sh.TriangleMesh(
        np.concatenate([mesh.vertices, mesh.vertices[1:] + np.array([2, 2, 0])]),
        np.concatenate([mesh.faces, ids[mesh.faces]]),
    )
    with pytest.warns(sh.errors.UnreachedWarning, match=f"{mesh.n_vertices - 1}"):
        field = sh.SignedHeatSolver(bow, intrinsic=False).distance(bow.path([0, 1, 2, 3, 4]))
    assert np.isfinite(field.values[: mesh.n_vertices]).all() and np.isnan(field.values[mesh.n_vertices :]).all()


@pytest.mark.parametrize("collapse", ["needle", "cap", "point", "repeated"])
def test_degenerate_triangles_are_mollified(collapse):
    mesh = square(9, jitter=0.2)
    points, faces = np.array(mesh.vertices), np.array(mesh.faces)
    a, b, c = faces[60]
    if collapse == "needle":
        points[a] = points[b]
    elif collapse == "cap":
        points[a] = 0.5 * (points[b] + points[c])
    elif collapse == "point":
        points[[a, b]] = points[c]
    else:
        faces = np.concatenate([faces, [[a, a, b], [c, c, c]]])
    broken = sh.TriangleMesh(points, faces)
    field = sh.SignedHeatSolver(broken, intrinsic=False).distance(broken.level_set(points[:, 0], -0.6))
    if collapse == "repeated":  # faces between fewer than three vertices are left out
        assert field.diagnostics.note(MeshRepaired).copies == 2
    else:
        assert field.diagnostics.note(EdgesLengthened).added_to_edge_lengths > 0
    far = np.linalg.norm(points - points[c], axis=1) > 0.6
    np.testing.assert_allclose(field.values[far], points[far, 0] + 0.6, atol=0.06)


@every_constraint
@pytest.mark.parametrize("pages", [3, 4])
def test_the_pages_of_a_book(pages, constraint):
    """A line parallel to the spine, on one page: distance goes on alike over all the other pages."""
    mesh = book(pages, 6)
    radius = np.linalg.norm(mesh.vertices[:, :2], axis=1)  # larger than on the line further out on its page
    signed = np.where((mesh.vertices[:, 0] > 1e-9) & (np.abs(mesh.vertices[:, 1]) < 1e-9), radius, -radius)
    (line,) = mesh.level_set(signed, 0.45)
    line = sh.Curve(line.faces, line.barycentric, normals=np.tile([1.0, 0.0, 0.0], (line.n_segments, 1)))
    expected = signed - 0.45 + (0.3 if isinstance(constraint, sh.constraints.LevelValues) else 0)
    np.testing.assert_allclose(distance(mesh, line, constraint), expected, atol=1e-8)


# --- reuse, batches, back ends ----------------------------------------------------------------------------------------


def test_nothing_is_factorised_twice(monkeypatch):
    from signedheat.linear import direct_integration
    from signedheat.surfaces import surface_discretization as surface
    from signedheat.surfaces import vector_heat

    made = []
    for module in (direct_integration, surface, vector_heat):
        original = module.factorize
        monkeypatch.setattr(
            module, "factorize", lambda matrix, *a, f=original, **k: made.append(matrix.shape[0]) or f(matrix, *a, **k)
        )
    mesh = bumpy()
    curves, solver = loops(mesh), sh.SignedHeatSolver(mesh, intrinsic=False)
    solver.distance(curves[0], sh.constraints.Free())
    vertices, edges = mesh.n_vertices, len(mesh.edges.vertices)
    assert sorted(made) == [vertices, edges]
    solver.distance(curves[1], sh.constraints.Free())
    assert len(made) == 2
    solver.distance(curves)
    assert made[2:] == [vertices]
    solver.distance(curves, sh.constraints.EachComponent())
    solver.distance(curves, sh.constraints.LevelValues([0, 1, 2]))
    solver.distance_many(curves, sh.constraints.Free())
    assert len(made) == 3
    other = solver.with_diffusion(9.0)
    np.testing.assert_allclose(other.distance(curves).values, distance(mesh, curves, diffusion=9.0), atol=1e-12)
    assert made[3:] == [edges, edges, vertices]  # the last two belong to the solver made anew


@every_constraint
def test_many_at_once_equal_one_by_one(constraint):
    mesh = bumpy()
    entries = [*loops(mesh), mesh.points_at([5]), mesh.path([0, 40])]
    solver = sh.SignedHeatSolver(mesh, intrinsic=False)
    together = solver.distance_many(entries, constraint)
    assert len(together) == len(entries)
    for field, entry in zip(together, entries, strict=True):
        np.testing.assert_allclose(field.values, solver.distance(entry, constraint).values, atol=1e-12)


@pytest.mark.parametrize("backend", available_backends())
@every_constraint
@pytest.mark.parametrize("broken", [False, True], ids=["complex", "real"])
def test_every_back_end_gives_the_same_distance(backend, constraint, broken, monkeypatch):
    mesh = bumpy(2)
    (curve,) = mesh.boundary_curves() or [loops(mesh)[0]]
    if broken:
        mesh = flipped(mesh, 0.4)
        curve = mesh.points_at([0, 50])
    monkeypatch.delenv("SIGNEDHEAT_BACKEND", raising=False)
    expected = distance(mesh, curve, constraint)
    monkeypatch.setenv("SIGNEDHEAT_BACKEND", backend)
    np.testing.assert_allclose(distance(mesh, curve, constraint), expected, atol=1e-11)


def test_the_same_bits_every_time():
    mesh = bumpy()
    for constraint in CONSTRAINTS:
        assert np.array_equal(distance(mesh, loops(mesh)[0], constraint), distance(mesh, loops(mesh)[0], constraint))


@pytest.mark.parametrize("broken", [False, True], ids=["complex", "real"])
def test_vector_heat_by_faces_equals_the_matrix(broken):
    mesh = flipped(bumpy(2)) if broken else bumpy(2)
    triangles = sh.SignedHeatSolver(mesh, intrinsic=False).discretization.triangles
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=triangles.n_edges) + 1j * rng.normal(size=triangles.n_edges)
    matrix = whole(vector_heat_matrix(triangles, 0.3))
    expected = (matrix @ vectors.view(float)).view(complex) if broken else matrix @ vectors
    forces = vector_heat_forces(triangles, 0.3, vectors, np.arange(triangles.n_faces))
    np.testing.assert_allclose(forces, expected, atol=1e-12)


def test_points_inside_faces_are_interpolated_when_asked_for_and_cost_accuracy():
    mesh = sphere(4)
    angles = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    circle = np.stack([np.sin(0.8) * np.cos(angles), np.sin(0.8) * np.sin(angles), np.full(100, np.cos(0.8))], axis=1)
    curve = mesh.polyline(circle, closed=True)
    solver = sh.SignedHeatSolver(mesh, intrinsic=False)
    inside = (curve.barycentric > 1e-9).all(axis=1)
    assert inside.any()
    height = 0.5 * mesh.edge_lengths.mean()
    hard, usual = (
        solver.distance(curve, constraint)
        for constraint in (sh.constraints.ZeroSet(hard=True), sh.constraints.ZeroSet())
    )
    assert np.abs(hard(curve)).max() < 1e-8 * height
    assert np.abs(usual(curve)).max() < 0.1 * height
    exact = 0.8 - np.arccos(np.clip(mesh.vertices[:, 2], -1, 1))
    error = [np.sqrt(np.mean((phi.values - exact) ** 2)) for phi in (usual, hard)]
    assert error[0] < error[1] < 0.1
