"""Distance on tet meshes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay, cKDTree

import signedheat as sh
from refusals import refused
from shapes.domain_cases import fitted_order
from shapes.tet_cases import boxes, lattice, plain_recipe, rectangle, rms, sphere
from signedheat.diagnostics import OutsideMesh
from signedheat.mesh.unit_vectors import unit
from signedheat.tets import tet_discretization as lowering


def distance(mesh, sources, constraint=None, diffusion=1.0):
    return sh.SignedHeatSolver(mesh, diffusion).distance(sources, constraint)


@pytest.fixture(scope="module")
def cube():
    """[0, 2]³, not aligned with anything in it."""
    return boxes((8, 8, 8), 0.25, jitter=0.12)


def tilted(shift: float = 1.0):
    """A plane through the cube, its normal, and the distance from it."""
    normal = np.array([2.0, 1.0, 2.0]) / 3
    u, v = np.array([1.0, -2.0, 0.0]), np.array([4.0, 2.0, -5.0]) / 3
    middle = np.ones(3) * shift
    shape = rectangle(middle - 3 * u - 3 * v, 6 * u, 6 * v)
    normal *= np.sign(shape.face_area_vectors[0] @ normal)
    return shape, lambda x: (x - middle) @ normal


@pytest.mark.parametrize(
    "constraint",
    [
        sh.constraints.Free(),
        sh.constraints.ZeroSet(),
        sh.constraints.ZeroSet(hard=True),
        sh.constraints.EachComponent(),
        sh.constraints.Soft(5.0),
    ],
)
def test_distance_from_a_plane_is_exact(cube, constraint):
    shape, exact = tilted()
    phi = distance(cube, shape, constraint)
    assert np.abs(phi.values - exact(cube.vertices)).max() < 5e-6  # of a cube of side 2; hard rows are near dependent
    assert phi.diagnostics.note(OutsideMesh).sources_outside == [0]


@pytest.mark.parametrize("noise", [0.0, 1e-15, 1e-13, 1e-7, 1e-4])
@pytest.mark.parametrize("when", ["before", "after"])
def test_shaken_lattices_are_as_good_as_lattices(noise, when):
    """Delaunay's tets of a shaken lattice have long flat tets along its sides; shaken later, tets are inside out."""
    side = np.linspace(-1, 1, 8)
    points = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    shaken = points + noise * np.random.default_rng(3).normal(size=points.shape)
    mesh = sh.TetMesh(shaken, Delaunay(shaken if when == "before" else points).simplices)
    phi = distance(mesh, sh.samples.sphere(4, radius=0.5))
    assert np.abs(phi.values - (np.linalg.norm(shaken, axis=1) - 0.5)).max() < 0.06  # a fifth of an edge


@pytest.mark.parametrize("sizes", [(0, 0), (10**9, 10**9)], ids=["conjugate gradients", "direct"])
def test_both_ways_of_solving_agree(cube, sizes, monkeypatch):
    ball = sphere(3, 0.6)
    ball = sh.TriangleMesh(ball.vertices + 1, ball.faces)
    constraints = (
        sh.constraints.ZeroSet(),
        sh.constraints.EachComponent(),
        sh.constraints.LevelValues([2.0]),
        sh.constraints.Soft(3.0),
        sh.constraints.Free(),
    )
    reference = [distance(cube, ball, constraint).values for constraint in constraints]
    monkeypatch.setattr(lowering, "DIRECT_FACES", sizes[0])
    monkeypatch.setattr(lowering, "DIRECT_VERTICES", sizes[1])
    for constraint, values in zip(constraints, reference, strict=True):
        assert np.abs(distance(cube, ball, constraint).values - values).max() < 2e-4


def test_sphere_converges_though_no_tet_follows_it():
    """At a diffusion time that outgrows the directions that cubes have; measured: order 1.9."""
    sizes, errors = [], []
    for n in (9, 13, 18):
        mesh = boxes((n, n, n), 3.2 / n, jitter=0.15)
        middle = sh.TriangleMesh(sphere(4).vertices + 1.6, sphere(4).faces)
        phi = distance(mesh, middle, diffusion=n / 3)
        sizes.append(3.2 / n)
        errors.append(rms(phi.values - (np.linalg.norm(mesh.vertices - 1.6, axis=1) - 1)))
    assert fitted_order(sizes, errors) > 1.6
    assert errors[-1] < 0.005


@pytest.fixture(scope="module")
def around_a_ball():
    """A solver on a lattice."""
    return sh.SignedHeatSolver(lattice(9))


@pytest.mark.parametrize(
    "constraint",
    [sh.constraints.Free(), sh.constraints.ZeroSet(), sh.constraints.EachComponent(), sh.constraints.Soft(10.0)],
)
def test_curved_sources_leave_no_offset(constraint, around_a_ball):
    """The interpolant of the distance lies 0.011 above it on the sphere, on average; values and φ itself do not."""
    ball = sphere(4)
    phi = around_a_ball.distance(ball, constraint)
    exact = np.linalg.norm(phi.domain.vertices, axis=1) - 1
    assert abs((phi.values - exact).mean()) < 0.002
    source = around_a_ball.discretization.lower([ball], 1.0)
    above = source.weights @ (source.interpolation @ exact) / source.weights.sum()
    assert above > 0.008
    middles = ball.vertices[ball.faces].mean(axis=1)
    assert abs(phi(middles).mean()) < 0.001
    assert np.abs(np.linalg.norm(phi.contour().vertices, axis=1) - 1).mean() < 0.007


def test_on_faces_of_the_mesh_it_is_the_plain_recipe():
    """Two routes: what bounds the tets of a lattice that lie in a ball, as a source."""
    mesh = lattice(9)
    inside = np.linalg.norm(mesh.tet_barycenters, axis=1) < 1
    shape = sh.TetMesh(mesh.vertices, mesh.tets[inside]).boundary
    gap = distance(mesh, sh.TriangleMesh(mesh.vertices, same_vertices(mesh, shape)), sh.constraints.Free()).values
    gap -= plain_recipe(mesh, sh.TriangleMesh(mesh.vertices, same_vertices(mesh, shape)))
    assert np.ptp(gap) < 1e-4  # directions by conjugate gradients there, by elimination here


def same_vertices(mesh, shape):
    """Faces of a shape by the ids of a mesh that has its vertices."""
    return cKDTree(mesh.vertices).query(shape.vertices)[1][shape.faces]


def test_faint_vectors_point_where_elimination_says():
    found = []
    for direct in (False, True):
        lowered = lowering.TetDiscretization(lattice(14), direct=direct)
        vectors = lowered.diffuse(lowered.lower([sphere(3, 0.2)], 0.3))
        found.append(unit(vectors))
    sizes = np.linalg.norm(vectors, axis=1)
    assert sizes.min() < 1e-20 * sizes.max()
    assert np.linalg.norm(found[0] - found[1], axis=1).max() < np.radians(0.05)


def test_a_source_that_follows_faces_is_pinned_to_their_vertices():
    mesh = boxes((8, 8, 8), 0.25, jitter=0)
    wall = rectangle([0, 0, 0.75], [2, 0, 0], [0, 2, 0])
    phi = distance(mesh, wall)
    assert np.abs(phi.values - (mesh.vertices[:, 2] - 0.75)).max() < 1e-9
    source = sh.SignedHeatSolver(mesh).discretization.lower([wall], 1.0)
    assert source.interpolation.nnz == source.interpolation.shape[0] == 81


def test_level_values_and_groups(cube):
    low, high = (tilted(shift)[0] for shift in (0.8, 1.2))
    exact = tilted(0.8)[1]
    gap = exact(np.full(3, 1.2))
    phi = distance(cube, [low, high], sh.constraints.LevelValues([0.0, gap]))
    assert np.abs(phi.values - exact(cube.vertices)).max() < 0.05
    shifted = distance(cube, [low, high], sh.constraints.LevelValues([5.0, 5.0 + gap]))
    assert np.abs(shifted.values - phi.values - 5).max() < 1e-6
    grouped = distance(cube, [low, high], sh.constraints.EachComponent())
    middle = exact(cube.vertices) - gap / 2  # the mean over both sheets is zero
    inner = (cube.vertices > 0.5).all(axis=1) & (cube.vertices < 1.5).all(axis=1)
    assert np.abs(grouped.values - middle)[inner].max() < 0.1
    with refused(sh.errors.ConstraintError):
        distance(cube, [low, high], sh.constraints.LevelValues([0.0, 1.0, 2.0]))


def test_invariances(cube):
    ball = sphere(3, 0.6)
    ball = sh.TriangleMesh(ball.vertices * [1, 0.8, 1.1] + 1, ball.faces)
    phi = distance(cube, ball).values
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))

    def moved(shape, scale):
        return type(shape)(
            scale * shape.vertices @ turn.T + [7, -3, 5],
            getattr(shape, "faces", None) if isinstance(shape, sh.TriangleMesh) else shape.tets,
        )

    assert distance(moved(cube, 1.0), moved(ball, 1.0)).values == pytest.approx(phi, abs=2e-5)
    assert distance(moved(cube, 1e-4), moved(ball, 1e-4)).values == pytest.approx(1e-4 * phi, abs=2e-9)
    flipped = sh.TriangleMesh(ball.vertices, ball.faces[:, ::-1])
    assert distance(cube, flipped).values == pytest.approx(-phi, abs=1e-9)
    order = np.random.default_rng(1).permutation(cube.n_tets)
    mixed = cube.tets[order][:, [1, 0, 3, 2]]
    assert distance(sh.TetMesh(cube.vertices, mixed), ball).values == pytest.approx(phi, abs=2e-5)
    assert (distance(cube, ball).values == phi).all()  # the same bits again


def test_polygons_and_points_are_sources(cube):
    steps = np.linspace(-0.5, 2.5, 25)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    vertices = np.stack([x, y, 0.9 + 0.1 * x], axis=-1).reshape(-1, 3)
    ids = np.arange(625).reshape(25, 25)
    quads = np.stack([ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]], axis=-1).reshape(-1, 4)
    normal = np.array([-0.1, 0, 1]) / np.hypot(0.1, 1)
    exact = (cube.vertices - vertices[0]) @ normal
    phi = distance(cube, sh.PolygonMesh(vertices, quads.tolist()))
    assert np.abs(phi.values - exact).max() < 1e-7
    cloud = sh.PointCloud(vertices, normals=np.tile(normal, (625, 1)))
    assert np.abs(distance(cube, cloud).values - exact).max() < 1e-7
    with refused(sh.errors.SourceError):
        distance(cube, sh.PointCloud(vertices))


def test_wide_gaps_between_points_lengthen_the_diffusion(cube):
    points = sphere(1, 0.7).vertices  # 42 points, much farther apart than faces of tets
    coarse = distance(cube, sh.PointCloud(points + 1, normals=points))
    fine = distance(cube, sphere_at_one(0.7))
    assert coarse.diagnostics.time > 4 * fine.diagnostics.time
    exact = np.linalg.norm(cube.vertices - 1, axis=1) - 0.7
    assert rms(coarse.values - exact) < 0.05


def sphere_at_one(radius):
    ball = sphere(3, radius)
    return sh.TriangleMesh(ball.vertices + 1, ball.faces)


@pytest.mark.parametrize("n", [8, 16])
def test_distance_goes_round_a_corner(n):
    """An L: behind the corner the exact distance is that to the corner, plus one half."""
    mesh = boxes((2 * n, 2 * n, max(n // 4, 2)), 1 / n, lambda c: ~((c[:, 0] > 1) & (c[:, 1] > 1)), jitter=0.1)
    wall = rectangle([1.5, -0.5, -0.5], [0, 0, 2], [0, 2, 0])
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    exact = np.where(y <= 1, 1.5 - x, 0.5 + np.hypot(x - 1, y - 1))
    phi = distance(mesh, wall)
    assert rms(phi.values - exact) < 0.12 / np.sqrt(n)
    farthest = np.flatnonzero((x == 0) & (y == 2))
    assert np.abs(phi.values[farthest] - 0.5 - np.sqrt(2)).max() < 0.2 / np.sqrt(n)
    straight = y < 0.75
    assert np.abs(phi.values - exact)[straight].max() < 0.1 / np.sqrt(n)


def test_distance_turns_right_back_in_a_u():
    """Round two corners, to the other arm: the normals that were carried there point the wrong way."""
    mesh = boxes((12, 8, 2), 0.25, lambda c: ~((c[:, 0] > 1) & (c[:, 0] < 2) & (c[:, 1] > 1)), jitter=0.08)
    wall = rectangle([-0.5, 1.5, -0.5], [0, 0, 3], [1.5, 0, 0])  # across the left arm, facing down
    sign = -np.sign(wall.face_area_vectors[0, 1])
    phi = distance(mesh, wall)
    end = (mesh.vertices[:, 0] == 3) & (mesh.vertices[:, 1] == 2)
    exact = 0.5 + 1.0 + np.sqrt(2)  # to the first corner, to the second, to the end of the other arm
    assert sign * phi.values[end] == pytest.approx(np.full(end.sum(), exact), rel=0.08)


def test_parts_without_a_source_are_nan_with_one_warning():
    left = boxes((4, 4, 4), 0.25)
    right = sh.TetMesh(
        np.concatenate([left.vertices, left.vertices + np.array([5, 0, 0])]),
        np.concatenate([left.tets, left.tets + left.n_vertices]),
    )
    wall = rectangle([0.4, -1, -1], [0, 3, 0], [0, 0, 3])
    with pytest.warns(sh.errors.UnreachedWarning, match="384") as record:
        phi = distance(right, wall)
    assert len(record) == 1
    assert np.isnan(phi.values).sum() == left.n_vertices
    assert (phi.diagnostics.unreached >= left.n_vertices).all()
    assert phi.values[: left.n_vertices] == pytest.approx(left.vertices[:, 0] - 0.4, abs=1e-7)
    assert np.isnan(phi([[5.5, 0.5, 0.5]])).all()
    assert phi.contour().n_faces > 0


@pytest.mark.parametrize("shared", [1, 2], ids=["a vertex", "an edge"])
def test_tets_that_share_no_face_are_not_connected(shared):
    near = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0]], dtype=float)
    far = near * [-1, -1, -1 if shared == 1 else 1]
    mesh = sh.TetMesh(np.concatenate([near, far[shared:]]), [[0, 1, 2, 3], [*range(shared), *range(4, 8 - shared)]])
    cut = rectangle([-3, -3, 0.25], [6, 0, 0], [0, 6, 0])
    keep = rectangle([0.1, 0.1, 0.25], [0.3, 0, 0], [0, 0.3, 0])
    with pytest.warns(sh.errors.UnreachedWarning, match=r"\b1\b"):
        phi = distance(mesh, keep)
    assert phi.values[:4] == pytest.approx(near[:, 2] - 0.25, abs=1e-9)
    assert np.isnan(phi.values[4:]).all()
    if shared == 2:
        assert distance(mesh, cut).values == pytest.approx(mesh.vertices[:, 2] - 0.25, abs=1e-9)


def test_faces_of_three_tets(cube):
    """Two tets on the same side of a face, overlapping: nonmanifold, and no reason to fail."""
    extra = cube.vertices[cube.tets[100]].mean(axis=0)
    mesh = sh.TetMesh(
        np.concatenate([cube.vertices, [extra]]), np.concatenate([cube.tets, [[*cube.tets[100, :3], cube.n_vertices]]])
    )
    assert (mesh.faces.tet_counts == 3).any()
    shape, exact = tilted()
    assert np.isfinite(distance(mesh, shape).values).all()
    assert np.abs(distance(mesh, shape).values - exact(mesh.vertices))[: cube.n_vertices].max() < 0.05


def test_flat_tets_do_no_harm():
    mesh = boxes((8, 8, 8), 0.25, jitter=0.05)
    vertices, rng = mesh.vertices.copy(), np.random.default_rng(0)
    boundary = np.unique(mesh.boundary.faces)
    moved: set[int] = set(boundary.tolist())
    for tet in rng.permutation(mesh.n_tets)[:200]:  # a corner moved onto the opposite face makes a flat tet
        if moved.isdisjoint(mesh.tets[tet].tolist()):
            vertices[mesh.tets[tet, 0]] = rng.dirichlet([3, 3, 3]) @ vertices[mesh.tets[tet, 1:]]
            moved.update(mesh.tets[(mesh.tets == mesh.tets[tet, 0]).any(axis=1)].ravel().tolist())
    flat = sh.TetMesh(vertices, mesh.tets)
    assert (flat.geometry.thickness < 1e-12).sum() >= 5
    shape, exact = tilted()
    assert np.abs(distance(flat, shape).values - exact(vertices)).max() < 5e-3
    exact_ball = np.linalg.norm(vertices - 1, axis=1) - 0.6
    assert rms(distance(flat, sphere_at_one(0.6)).values - exact_ball) < 0.03


def test_directions_survive_beyond_the_range_of_numbers():
    """A bar 700 cells long: X falls by 1e−600 along it."""
    mesh = boxes((700, 1, 1), 1.0)
    wall = rectangle([3.3, -1, -1], [0, 3, 0], [0, 0, 3])
    phi = distance(mesh, wall, diffusion=0.5)
    assert phi.values == pytest.approx(mesh.vertices[:, 0] - 3.3, abs=1e-5)


def test_bad_sources_are_named(cube):
    far = rectangle([10, 10, 10], [1, 0, 0], [0, 1, 0])
    with refused(sh.errors.SourceError, "source 1"):
        distance(cube, [tilted()[0], far])
    with refused(sh.errors.SourceError):
        distance(cube, [])
    with refused(sh.errors.SourceError, "source 0"):
        distance(cube, sh.TriangleMesh([[1, 1, 1], [1.5, 1, 1], [0.5, 1, 1]], [[0, 1, 2]]))
    with refused(sh.errors.SourceError, "source 0"):
        distance(cube, sh.PointCloud([[1.0, 1.0], [0.5, 1.0]], normals=[[0, 1], [0, 1]], areas=[1, 1]))
    with pytest.raises(sh.errors.SourceError):
        distance(cube, sh.Curve([0], [[1, 0, 0]]))
    wall = tilted()[0]
    both = sh.TriangleMesh(wall.vertices, np.concatenate([wall.faces, wall.faces[:, ::-1]]))
    with refused(sh.errors.SourceError):
        distance(cube, both)


def test_components_are_numbered_as_sources_name_them(cube):
    two = sh.TriangleMesh(
        np.concatenate([tilted(0.7)[0].vertices, tilted(1.3)[0].vertices]), [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    )
    source = sh.SignedHeatSolver(cube).discretization.lower([tilted(1.0)[0], two], 1.0)
    assert sorted(set(source.components.tolist())) == [0, 1, 2]
    assert (source.source_ids == (source.components > 0)).all()
    assert np.asarray(source.interpolation.sum(axis=1)).ravel() == pytest.approx(np.ones(len(source.weights)))
    areas = np.bincount(source.components, source.weights)
    assert areas[0] > areas[1]  # the section through the middle is the largest


def test_progress_of_distance_to_a_solid_ends_at_one_and_cancels():
    seen = []

    def cancel(fraction, step):
        seen.append(fraction)
        if fraction > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sh.signed_distance(sphere(2), lattice(8), progress=cancel)
    sh.signed_distance(sphere(2), lattice(8), progress=lambda fraction, step: seen.append(fraction))
    assert seen[-1] == 1
