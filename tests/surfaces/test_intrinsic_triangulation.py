"""Intrinsic triangulations: the surface stays, the triangles get better, and so does the distance."""

import itertools

import numpy as np
import pytest
from scipy.spatial import Delaunay

import signedheat as sh
from refusals import refused
from shapes.degenerate_meshes import stretched_square, with_caps, with_needles
from shapes.surface_cases import band, book, flipped, sphere, square
from shapes.triangulated import cylinder
from signedheat.diagnostics import IntrinsicTriangles
from signedheat.discretization import discretize
from signedheat.mesh.gluing import flip_all, glue, lay_out
from signedheat.mesh.intrinsic_mesh import IntrinsicMesh
from signedheat.mesh.surface_points import barycentric_in
from signedheat.surfaces import intrinsic_discretization as lowering
from signedheat.surfaces.source_segments import segments_of
from signedheat.surfaces.subdivision import cut


def squashed(mesh, factor=6.0):
    return sh.TriangleMesh(mesh.vertices * [factor, 1, 1], mesh.faces)


SURFACES = {
    "sphere": squashed(sphere(3)),
    "flipped sphere": flipped(squashed(sphere(3))),
    "cylinder": squashed(band(40, 4, twisted=False)),
    "Möbius strip": squashed(band(40, 4, twisted=True)),
    "flipped Möbius strip": flipped(squashed(band(40, 4, twisted=True))),
    "book": squashed(flipped(book(3, 6))),
    "jittered square": squashed(square(16, jitter=0.3)),
}


def angle_sums(triangles):
    angles = np.arctan2(1, triangles.corner_cotangents)
    return np.bincount(triangles.corner_vertices.ravel(), angles.ravel(), triangles.n_vertices)


def opposite_cotangents(triangles):
    """(e,) sum of the cotangents of the angles opposite to every edge: negative where Delaunay is violated."""
    opposite = np.roll(triangles.corner_cotangents, -2, axis=1)
    return np.bincount(triangles.edges.face_edges.ravel(), opposite.ravel(), triangles.n_edges)


@pytest.fixture(params=SURFACES)
def surface(request):
    return SURFACES[request.param]


@pytest.mark.parametrize("refine", [False, True])
def test_the_surface_stays_and_the_triangles_are_delaunay(surface, refine):
    better = sh.intrinsic_delaunay(surface, refine=refine)
    before, after = better.base, better.triangles
    assert after.face_areas.sum() == pytest.approx(before.face_areas.sum(), rel=1e-12)
    sums = angle_sums(after)
    np.testing.assert_allclose(sums[: before.n_vertices], angle_sums(before), atol=1e-10)
    new = sums[before.n_vertices :]
    np.testing.assert_allclose(new / np.pi, np.round(new / np.pi), atol=1e-10)  # flat: 2π, π at a boundary
    interior = (after.edges.face_counts == 2) & ~better.marked
    assert opposite_cotangents(after)[interior].min() > -1e-9
    lengths = np.zeros(after.n_edges)
    for face_lengths in after.edge_lengths.T, np.roll(after.edge_lengths, 1, axis=1).T:
        assert np.isfinite(face_lengths).all()
    lengths[after.edges.face_edges] = after.edge_lengths
    np.testing.assert_allclose(lengths[after.edges.face_edges], after.edge_lengths, rtol=1e-12)
    assert np.bincount(after.edges.face_counts, minlength=4)[3] % 6 == 0  # the spine of the book is still there


def test_refinement_reaches_the_angle(surface):
    better = sh.intrinsic_delaunay(surface, refine=True, angle=28)
    assert better.complete and not len(better.thin_faces)
    assert np.degrees(better.corner_angles.min()) >= 28 - 1e-6
    assert np.degrees(sh.intrinsic_delaunay(surface).corner_angles.min()) < 20
    assert better.n_vertices < 12 * surface.n_vertices


def circumradii(triangles):
    return triangles.edge_lengths.prod(axis=1) / (4 * triangles.face_areas)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_large_triangles_are_split(scale):
    """A fan of slivers: refinement makes many small triangles at its rim and few large ones between."""
    around = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    rim = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    fan = sh.TriangleMesh(scale * rim, [[0, k, k + 1] for k in range(1, 89)])
    graded = sh.intrinsic_delaunay(fan, refine=True).triangles
    largest = np.sqrt(4 / 27**0.5 * graded.face_areas.mean())  # circumradius if equilateral and of the mean area
    assert circumradii(graded).max() > 2.5 * largest
    better = sh.intrinsic_delaunay(fan, refine=True, coarsest=1.25)
    assert better.complete and not len(better.thin_faces)
    assert circumradii(better.triangles).max() <= 1.25 * largest * (1 + 1e-9)
    assert better.triangles.face_areas.sum() == pytest.approx(fan.face_areas.sum(), rel=1e-12)


def test_euler_characteristic_and_gluing(surface):
    better = sh.intrinsic_delaunay(surface, refine=True)

    def euler(t):
        return len(np.unique(t.corner_vertices)) - t.n_edges + t.n_faces

    assert euler(better.triangles) == euler(better.base)
    ends = better.triangles.edges.vertices[better.triangles.edges.face_edges]
    forward = better.triangles.edges.forward[..., None]
    corners = np.stack([better.faces, np.roll(better.faces, -1, axis=1)], axis=-1)
    np.testing.assert_array_equal(np.where(forward, ends, ends[..., ::-1]), corners)


def test_flat_flips_are_the_planar_delaunay_triangulation():
    mesh = stretched_square(1500, 40.0)
    better = sh.intrinsic_delaunay(mesh)
    edges = {tuple(sorted(e)) for e in better.triangles.edges.vertices.tolist()}
    planar = Delaunay(mesh.vertices[:, :2]).simplices
    expected = {tuple(sorted(e)) for f in planar.tolist() for e in itertools.combinations(f, 2)}
    assert len(edges ^ expected) <= 4  # where the rim's collinear points leave a choice


def test_flips_do_not_depend_on_the_numbering_of_faces():
    mesh = SURFACES["sphere"]
    order = np.random.default_rng(3).permutation(mesh.n_faces)
    turned = np.roll(mesh.faces[order], 1, axis=1)
    one, two = (sh.intrinsic_delaunay(m).triangles.edge_lengths for m in (mesh, sh.TriangleMesh(mesh.vertices, turned)))
    np.testing.assert_allclose(np.sort(one.ravel()), np.sort(two.ravel()), atol=1e-12)


def test_a_delaunay_mesh_gives_the_very_same_distance():
    mesh = sphere(3)
    curve = mesh.level_set(mesh.vertices[:, 2] + 0.3 * mesh.vertices[:, 0], 0.2)
    better = sh.intrinsic_delaunay(mesh)
    assert {*map(frozenset, better.faces.tolist())} == {*map(frozenset, mesh.faces.tolist())}
    plain = sh.SignedHeatSolver(mesh, diffusion=2.0).distance(curve, constraint=sh.constraints.Free())
    h = sh.SignedHeatSolver(mesh).discretization.spacing
    own = sh.SignedHeatSolver(better).discretization.spacing
    intrinsic = sh.SignedHeatSolver(better, diffusion=2.0 * (h / own) ** 2).distance(
        curve, constraint=sh.constraints.Free()
    )
    np.testing.assert_allclose(intrinsic.restrict().values, plain.values, atol=1e-11)


@pytest.mark.parametrize("change", ["order", "scale", "noise"])
def test_refinement_hangs_on_no_order_and_no_rounding(change):
    """A band round an icosphere, whose triangles are mirrored in many ways, with pieces of a curve to be followed."""
    rng, ball = np.random.default_rng(1), sphere(2)
    moved, faces, size = ball.vertices, ball.faces, 1.0
    if change == "order":
        turns = (rng.integers(3, size=ball.n_faces)[:, None] + np.arange(3)) % 3
        faces = np.take_along_axis(ball.faces, turns, axis=1)[rng.permutation(ball.n_faces)]
    elif change == "scale":
        size = 0.37
    else:
        moved = moved * (1 + 2e-16 * rng.choice([-1, 0, 1], moved.shape))
    found = []
    for mesh, scale in ((ball, 1.0), (sh.TriangleMesh(size * moved, faces), size)):
        angle = np.linspace(0, 4.5, 30)
        line = 0.6 * scale * np.stack([np.cos(angle), np.sin(angle), 1.3 + 0 * angle], axis=1)
        better = sh.intrinsic_delaunay(mesh, mesh.polyline(line), refine=True)
        found.append(better.vertices / scale)
    assert len(found[0]) == len(found[1]) > ball.n_vertices + 100
    np.testing.assert_allclose(found[1], found[0], atol=1e-9)


def circle_on(mesh, radius=0.55, n=150):
    angle = np.arange(n) * 2 * np.pi / n
    return mesh.polyline(radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), closed=True)


def error(mesh, field, radius=0.55):
    exact = radius - np.linalg.norm(mesh.vertices[:, :2], axis=1)
    used = np.bincount(mesh.faces.ravel(), minlength=mesh.n_vertices) > 0
    return np.sqrt(np.mean((field.values - exact)[used] ** 2)) / np.ptp(exact)


@pytest.mark.parametrize("stretch", [10.0, 100.0])
def test_bad_triangles_do_not_matter_any_more(stretch):
    mesh = stretched_square(1000, stretch)
    curve = circle_on(mesh)
    plain = error(mesh, sh.SignedHeatSolver(mesh, intrinsic=False).distance(curve, constraint=sh.constraints.Free()))
    robust = sh.SignedHeatSolver(mesh, intrinsic=True).distance(curve)
    assert robust.domain is mesh and robust.values.shape == (mesh.n_vertices,)
    assert robust.diagnostics.note(IntrinsicTriangles) is not None
    assert error(mesh, robust) < 2e-3
    assert error(mesh, robust) < 0.05 * plain
    usual = sh.SignedHeatSolver(mesh).distance(curve)
    assert usual.diagnostics.note(IntrinsicTriangles) is not None
    assert error(mesh, usual) < 0.1 * plain
    assert usual.finest.domain.n_vertices > mesh.n_vertices


@pytest.mark.parametrize("spoil", [with_needles, with_caps])
def test_aspect_ratios_of_a_million(spoil):
    sound = square(12, jitter=0.2)
    mesh = spoil(sound, 1e-6)
    curve = circle_on(mesh)
    better = sh.intrinsic_delaunay(mesh, keep=curve, refine=True)
    assert better.complete
    assert better.close[better.thin_faces].all()
    assert better.triangles.face_areas[better.close].sum() < 1e-4 < better.close.mean()
    n_sound = sh.intrinsic_delaunay(sound, keep=circle_on(sound), refine=True).n_vertices
    assert better.n_vertices < n_sound + 1.2 * mesh.n_faces  # and not hundreds for each needle
    assert better.triangles.face_areas.sum() == pytest.approx(4.0, rel=1e-9)
    assert better.transfer(curve).lengths.sum() == pytest.approx(150 * 2 * 0.55 * np.sin(np.pi / 150), rel=1e-6)
    assert error(mesh, sh.SignedHeatSolver(better).distance(curve).restrict()) < 5e-3


def test_kept_curves_run_along_edges_and_boundaries_stay():
    mesh = flipped(square(14, jitter=0.3))
    curve = circle_on(mesh)
    better = sh.intrinsic_delaunay(mesh, keep=[curve], refine=True)
    lengths = np.zeros(better.triangles.n_edges)
    lengths[better.triangles.edges.face_edges] = better.triangles.edge_lengths
    polygon = 150 * 2 * 0.55 * np.sin(np.pi / 150)
    assert lengths[better.marked].sum() == pytest.approx(polygon, rel=1e-9)
    assert lengths[better.triangles.edges.face_counts == 1].sum() == pytest.approx(8.0, rel=1e-12)
    brought = better.transfer(curve)
    assert (brought.edges >= 0).all() and better.marked[brought.edges].all()
    assert brought.lengths.sum() == pytest.approx(polygon, rel=1e-9)


def test_only_the_kept_curve_is_marked_on_a_closed_surface():
    mesh = sphere(3)
    north = mesh.polyline([[np.cos(a), np.sin(a), 0.4] for a in np.arange(40) * np.pi / 20], closed=True)
    better = sh.intrinsic_delaunay(mesh, keep=north, refine=True)
    assert better.n_vertices > 1.3 * mesh.n_vertices
    lengths = np.zeros(better.triangles.n_edges)
    lengths[better.triangles.edges.face_edges] = better.triangles.edge_lengths
    assert lengths[better.marked].sum() == pytest.approx(better.transfer(north).lengths.sum(), rel=1e-9)


def test_sources_that_were_not_kept_are_carried_over():
    mesh = flipped(stretched_square(600, 30.0))
    curve = circle_on(mesh)
    outward = sh.Curve(curve.faces, curve.barycentric, closed=True, normals=None)
    for better in sh.intrinsic_delaunay(mesh), sh.intrinsic_delaunay(mesh, refine=True):
        brought = better.transfer(outward)
        assert brought.lengths.sum() == pytest.approx(150 * 2 * 0.55 * np.sin(np.pi / 150), rel=1e-9)
        nodes = better.vertices[better.faces[brought.nodes.faces]]
        radius = np.linalg.norm(np.einsum("nk,nkd->nd", brought.nodes.barycentric, nodes), axis=1)
        assert radius.min() > 0.55 * np.cos(np.pi / 150) - 1e-9 and radius.max() < 0.55 + 1e-9
        degree = np.bincount(brought.ends.ravel())
        assert (degree == 2).all()  # still one closed curve


def test_distance_along_the_sides_does_not_change_when_faces_are_turned_over():
    mesh = square(20, jitter=0.3)
    angle = np.arange(60) * 2 * np.pi / 60
    points = 0.5 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    middle = 0.5 * (points + np.roll(points, -1, axis=0))
    values = []
    for domain in mesh, flipped(mesh):
        traced = domain.polyline(points, closed=True)
        ends = np.einsum("nk,nkd->nd", traced.barycentric, domain.vertices[domain.faces[traced.faces]])
        middle = 0.5 * (ends + np.roll(ends, -1, axis=0))
        curve = sh.Curve(traced.faces, traced.barycentric, closed=True, normals=middle)
        values.append(sh.SignedHeatSolver(domain, intrinsic=True).distance(curve).values)
        outside = np.linalg.norm(mesh.vertices, axis=1) > 0.55
        assert (values[-1][outside] > 0).all() and (values[-1][np.linalg.norm(mesh.vertices, axis=1) < 0.45] < 0).all()
    np.testing.assert_allclose(values[0], values[1], atol=0.02)


def test_points_and_unoriented_curves_on_an_intrinsic_triangulation():
    mesh = stretched_square(800, 30.0)
    curve = circle_on(mesh)
    solver = sh.SignedHeatSolver(mesh, intrinsic=True)
    open_sided = sh.Curve(curve.faces, curve.barycentric, closed=True, oriented=False)
    radius = np.linalg.norm(mesh.vertices[:, :2], axis=1)
    assert np.abs(solver.distance(open_sided).values - np.abs(radius - 0.55)).max() < 0.05
    point = mesh.polyline([[0.21, 0.12, 0.0], [0.3, 0.12, 0.0]])
    alone = solver.distance(sh.SurfacePoints(point.faces[:1], point.barycentric[:1])).values
    away = np.linalg.norm(mesh.vertices - [0.21, 0.12, 0.0], axis=1)
    assert np.abs(alone - away)[radius < 0.9].max() < 0.07
    both = solver.distance([sh.SurfacePoints(point.faces[:1], point.barycentric[:1]), curve])
    assert np.isfinite(both.values).all()


def test_points_go_back_and_forth(surface):
    better = sh.intrinsic_delaunay(surface, refine=True)
    rng = np.random.default_rng(0)
    faces, weights = rng.integers(0, surface.n_faces, 300), rng.dirichlet([1, 1, 1], 300)
    there = better.locate(faces, weights)
    assert (there[1] >= 0).all() and np.allclose(there[1].sum(axis=1), 1)
    back = better.refinement.pull_back(*better.history.backward(*there)[:2])
    np.testing.assert_allclose(better.in_space(*back), better.in_space(faces, weights), atol=1e-9)


def test_edges_run_straight_on_the_mesh(surface):
    better = sh.intrinsic_delaunay(surface, refine=True)
    owners, starts, ends = better.edge_lines()
    lengths = np.zeros(better.triangles.n_edges)
    lengths[better.triangles.edges.face_edges] = better.triangles.edge_lengths
    traced = np.bincount(owners, np.linalg.norm(ends - starts, axis=1))
    np.testing.assert_allclose(traced, lengths, atol=1e-9)
    first = np.searchsorted(owners, np.arange(len(lengths)))
    tails = better.vertices[better.triangles.edges.vertices[:, 0]]
    np.testing.assert_allclose(starts[first], tails, atol=1e-9)


def test_both_triangulations_are_linear_on_the_common_subdivision(surface):
    for better in sh.intrinsic_delaunay(surface), sh.intrinsic_delaunay(surface, refine=True):
        polygons, interpolate = sh.common_subdivision(better)
        areas = np.linalg.norm(polygons.polygon_area_vectors, axis=1)  # they are flat
        assert areas.sum() == pytest.approx(surface.face_areas.sum(), rel=1e-9)
        assert polygons.n_polygons >= better.n_faces
        np.testing.assert_allclose(interpolate.sum(axis=1), 1.0, atol=1e-12)
        if not np.ptp(surface.vertices[:, 2]):
            np.testing.assert_allclose(interpolate @ better.vertices, polygons.vertices, atol=1e-9)


def test_small_angles_that_must_stay_are_told():
    spike = np.array([[0, 0, 30.0], *[[np.cos(a), np.sin(a), 0] for a in np.arange(8) * np.pi / 4]])
    faces = [[0, 1 + k, 1 + (k + 1) % 8] for k in range(8)]
    better = sh.intrinsic_delaunay(sh.TriangleMesh(spike, faces), refine=True)
    assert better.complete and len(better.thin_faces)
    assert "less than 60°" in better.summary
    limited = sh.intrinsic_delaunay(squashed(sphere(2)), refine=True, max_vertices=200)
    assert not limited.complete and limited.n_vertices == 200 and "max_vertices" in limited.summary


def test_small_angles_between_kept_curves_end_the_splitting():
    mesh = square(15, jitter=0.3)
    ends = [[0.8 * np.cos(a), 0.8 * np.sin(a), 0] for a in np.radians([0, 9, 25, 70])]
    rays = [mesh.polyline([[0, 0, 0], end]) for end in ends]
    across = mesh.polyline([[0.41, -0.3, 0], [0.43, 0.6, 0]])
    better = sh.intrinsic_delaunay(mesh, keep=[*rays, across], refine=True)
    assert better.complete and better.n_vertices < 20 * mesh.n_vertices
    assert 0 < len(better.thin_faces) < 0.03 * better.n_faces
    tips = better.vertices[better.faces[better.thin_faces]]
    assert np.linalg.norm(tips, axis=2).min(axis=1).max() < 0.2  # all of them where the rays come together


def test_faces_that_have_an_edge_twice_along_a_nonmanifold_edge():
    corners = [[0, 0, 0], [1, 0, 0], [0.5, 0.05, 0], [0.5, 0.05, 1], [0.5, -0.04, 0.3]]
    folded = sh.TriangleMesh(corners, [[0, 1, 0], [0, 1, 2], [1, 0, 3], [0, 1, 4]])
    better = sh.intrinsic_delaunay(folded, refine=True)
    assert better.complete and np.isfinite(better.vertices).all()
    areas = folded.face_areas.sum()
    assert better.triangles.face_areas.sum() == pytest.approx(areas, abs=1e-6)


def test_degenerate_faces_are_flipped_away():
    corners = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 0, 0], [1, 1, 0], [1, 1, 0]]
    faces = [[0, 1, 4], [0, 4, 5], [4, 1, 5], [1, 2, 5], [2, 3, 6], [3, 0, 6], [0, 5, 6], [5, 2, 6]]
    better = sh.intrinsic_delaunay(sh.TriangleMesh(corners, faces))
    assert np.isfinite(better.triangles.corner_cotangents).all()
    assert better.triangles.face_areas.sum() == pytest.approx(4.0, abs=1e-4)


def test_fixed_edges_keep_their_numbers():
    mesh = stretched_square(200, 20.0)
    triangles = sh.intrinsic_delaunay(mesh).base
    fixed = np.random.default_rng(0).random(triangles.n_edges) < 0.3
    after = lay_out(flip_all(glue(triangles, fixed)))
    before = np.sort(triangles.edges.vertices[fixed], axis=1)
    np.testing.assert_array_equal(np.sort(after.edges.vertices[fixed], axis=1), before)
    assert isinstance(after, IntrinsicMesh) and after.n_edges == triangles.n_edges


def test_vertices_that_all_but_coincide():
    from signedheat.surfaces.intrinsic_refinement import coinciding

    places = np.array(
        [0.0, 1e-3, 2e-3, 1.0, 1.5, 1.5 + 1e-3, 9.0, 9.0 + 1e-5, 9.001]
    )  # and the last three hang together
    tail = np.arange(8)
    length = np.diff(places)
    group, extent = coinciding(tail, tail + 1, length, np.argsort(length), 9)
    np.testing.assert_array_equal(group, [0, 0, 0, -1, 4, 4, 6, 6, 6])
    np.testing.assert_allclose(extent[[0, 4, 6]], [2e-3, 1e-3, 1e-3])
    group, _ = coinciding(tail[:2], tail[:2] + 1, length[:2], np.arange(2), 3)
    assert (group < 0).all()  # there is nothing else that they would be close in comparison with


def test_vertices_all_but_on_a_boundary_do_not_need_hundreds_of_others():
    for height in 1e-3, 1e-6, 1e-9:
        corners = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0.7, height, 0], [1.3, 1 - height, 0]]
        faces = [[0, 1, 4], [1, 5, 4], [1, 2, 5], [2, 3, 5], [3, 4, 5], [3, 0, 4]]
        better = sh.intrinsic_delaunay(sh.TriangleMesh(corners, faces), refine=True)
        assert better.complete and better.close[better.thin_faces].all()
        assert better.n_vertices < 40


@pytest.mark.parametrize("seed", range(12))
def test_refinement_ends_on_anything(seed):
    rng = np.random.default_rng(seed)
    for _ in range(5):
        n, m = rng.integers(4, 60), rng.integers(2, 150)
        vertices = rng.standard_normal((n, 3)) * 10.0 ** rng.integers(-8, 2, 3)
        vertices[rng.integers(0, n, n // 3)] = vertices[rng.integers(0, n, n // 3)]
        soup = sh.TriangleMesh(vertices, rng.integers(0, n, (m, 3)))  # some faces with a corner twice
        try:
            better = sh.intrinsic_delaunay(soup, refine=True, max_vertices=800, coarsest=[1.4, np.inf][seed % 2])
        except sh.errors.GeometryError as refusal:  # lengths of edges no longer tell the area of the thinnest
            assert refusal.remedy
            continue
        area, size = better.base.face_areas.sum(), better.base.edge_lengths.max()
        assert better.triangles.face_areas.sum() == pytest.approx(area, rel=1e-5, abs=1e-9 * size**2 * better.n_faces)
        assert np.isfinite(better.vertices).all() and (better.triangles.edge_lengths > 0).all()


def test_progress_and_cancelling():
    mesh = squashed(sphere(5))
    seen = []
    better = sh.intrinsic_delaunay(mesh, refine=True, progress=lambda *report: seen.append(report))
    shares = [share for share, _ in seen]
    assert shares == sorted(shares) and shares[0] == 0.0 and shares[-1] == 1.0
    assert sum(2 / 3 < share < 1 for share in shares) > 0  # within refinement
    assert [step for _, step in seen][:3] == ["embed curves", "flip", "refine"]
    quiet = sh.intrinsic_delaunay(mesh, refine=True)
    np.testing.assert_array_equal(better.triangles.edge_lengths, quiet.triangles.edge_lengths)

    def cancel(share, step):
        if step == "refine":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sh.intrinsic_delaunay(mesh, refine=True, progress=cancel)
    seen.clear()
    curve = mesh.level_set(mesh.vertices[:, 2], 0.1)
    sh.SignedHeatSolver(mesh, progress=lambda *report: seen.append(report), intrinsic=True).distance(curve)
    shares = [share for share, _ in seen]
    assert shares == sorted(shares) and shares[-1] == 1.0 and "refine" in [step for _, step in seen]


def test_what_cannot_be_done_is_said():
    mesh = square(4)
    for angle in 45, 0, -3, np.nan, np.inf, "28", [20]:
        with refused(sh.errors.GeometryError, "angle"):
            sh.intrinsic_delaunay(mesh, refine=True, angle=angle)
    for coarsest in 0.9, -1, np.nan, "fine", [2]:
        with refused(sh.errors.GeometryError, "coarsest"):
            sh.intrinsic_delaunay(mesh, refine=True, coarsest=coarsest)
    for limit in 0, -1, np.nan, np.inf, "many", [9]:
        with refused(sh.errors.GeometryError, "max_vertices"):
            sh.intrinsic_delaunay(mesh, refine=True, max_vertices=limit)
    for domain in sh.PolygonMesh(mesh.vertices, mesh.faces.tolist()), sh.intrinsic_delaunay(mesh), None:
        with refused(sh.errors.GeometryError, "domain"):
            sh.intrinsic_delaunay(domain)
        with refused(sh.errors.SignedHeatError, "domain"):
            sh.SignedHeatSolver(domain, intrinsic=True).distance(mesh.path([0, 1]))
    for nothing in (np.ones((3, 3)), [[0, 0, 0], [1, 0.1, 0.3], [2, 0.2, 0.6]], np.eye(3) + 1e18):
        with refused(sh.errors.GeometryError, "faces"):
            sh.intrinsic_delaunay(sh.TriangleMesh(nothing, [[0, 1, 2]]))
    with refused(sh.errors.SourceError, "face 1000"):
        sh.intrinsic_delaunay(mesh, keep=sh.Curve([1000, 0], np.eye(3)[:2]))
    for keep in "curve", np.zeros(3), [None], 3:
        with refused(sh.errors.SourceError, "source 0"):
            sh.intrinsic_delaunay(mesh, keep=keep)
    with refused(sh.errors.GeometryError):
        sh.common_subdivision(mesh)
    better = sh.intrinsic_delaunay(mesh)
    with refused(sh.errors.GeometryError, "number 0"):
        better.locate([0], [[np.nan, 0, 1]])
    for face in -1, mesh.n_faces:
        with refused(sh.errors.SourceError, f"face {face}"):
            better.locate([face], [[1, 0, 0]])
        with refused(sh.errors.SourceError, f"face {face}"):
            better.in_space([face], [[1, 0, 0]])
    with refused(sh.errors.GeometryError, "faces"):
        better.locate([0.7], [[1, 0, 0]])
    heights = better.vertices[:, 0].tolist()  # lists are taken, as by the mesh
    assert len(better.level_set(heights, 0.1)) == 1
    with refused(sh.errors.SignedHeatError, "level"):
        better.level_set(heights, np.nan)


@pytest.mark.parametrize("seed", range(5))
def test_polygons_are_cut_along_all_chords(seed):
    """Random chords that do not cross: the parts are joined along each of them, and have the sides of the polygon."""
    random = np.random.default_rng(seed)
    n, waiting, chords = 40, [list(range(40))], []
    while waiting:
        part = waiting.pop()
        if len(part) > 3:
            i, j = sorted(random.choice(len(part), 2, replace=False).tolist())
            if 1 < j - i < len(part) - 1:
                chords.append((part[i], part[j])[:: random.choice([-1, 1])])
                waiting += [part[i : j + 1], part[j:] + part[: i + 1]]
    chords = [chords[k] for k in random.permutation(len(chords))]
    ignored = [(3, 4), (0, n - 1), chords[0], (5, 99)]
    parts = cut(list(range(n)), chords + ignored)
    sides = sorted((a, b) for part in parts for a, b in zip(part, part[1:] + part[:1], strict=True))
    expected = [(k, (k + 1) % n) for k in range(n)] + [ends for a, b in chords for ends in ((a, b), (b, a))]
    assert sides == sorted(expected)


def test_cutting_takes_time_that_grows_with_the_chords():
    n = 20_000
    parts = cut(list(range(2 * n)), [(k, 2 * n - 1 - k) for k in range(1, n - 1)])
    assert len(parts) == n - 1
    assert {len(part) for part in parts} == {4}


def test_of_chords_that_cross_the_shorter_is_taken():
    parts = cut([7, 8, 9, 10, 11, 12], [(7, 10), (8, 11), (9, 11)])
    assert sorted(map(sorted, parts)) == [[7, 8, 11, 12], [8, 9, 11], [9, 10, 11]]


def test_frames_of_edges_stay_where_flat_triangles_are_thickened(monkeypatch):
    """The first face of an edge, by whose layout its frame is, is not always the lowest one."""
    monkeypatch.setattr(lowering, "MOLLIFIED_MARGIN", 1.0)
    made = sh.intrinsic_delaunay(squashed(sphere(3)), refine=True)
    lowered = discretize(made).triangles
    assert not np.allclose(lowered.edge_lengths, made.triangles.edge_lengths)
    assert (lowered.first_halfedges == made.triangles.first_halfedges).all()
    assert not lowered.reflected.any()


def with_more_points(mesh, curve, random):
    """The same line, with up to three more points on each of its segments."""
    part = segments_of(curve, mesh.intrinsic)
    faces, places = [], []
    for face, segment in zip(part.faces, part.ends, strict=True):
        a, b = (barycentric_in(mesh.intrinsic, np.array([face]), part.nodes[segment[k : k + 1]])[0] for k in (0, 1))
        for share in [0.0, *np.sort(random.random(random.integers(4)))]:
            faces.append(face)
            places.append((1 - share) * a + share * b)
    faces.append(part.faces[-1])
    places.append(b)
    return sh.Curve(faces, places)


def test_points_on_straight_lines_make_no_triangles():
    random = np.random.default_rng(3)
    mesh = sphere(3)
    whole = mesh.level_set(mesh.vertices @ [0.3, 0.4, 0.7] + 0.1)[0]
    half = sh.Curve(whole.faces[:40], whole.barycentric[:40])
    along = mesh.path([0, 60, 80])
    for curves in ([half, along], [half, half, half.reversed()]):
        made = sh.intrinsic_delaunay(mesh, curves, refine=True)
        again = sh.intrinsic_delaunay(mesh, [with_more_points(mesh, c, random) for c in curves], refine=True)
        assert again.n_vertices == made.n_vertices
        assert np.linalg.norm(again.vertices - made.vertices, axis=1).max() < 1e-7
        values = [sh.SignedHeatSolver(t).distance(half).restrict().values for t in (made, again)]
        assert values[1] == pytest.approx(values[0], abs=1e-8)


def test_points_at_which_lines_bend_meet_or_end_become_vertices():
    """Tiny bends, as of fine arcs within a face, are none at any single point, but are all together."""
    mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    angle = np.linspace(0, 4e-4, 500)
    arc = 0.4 * np.column_stack([np.cos(angle), np.sin(angle)])
    across = sh.Curve([0, 0, 0], [[0.3, 0.3, 0.4], [0.4, 0.4, 0.2], [0.45, 0.45, 0.1]])
    from_its_middle = sh.Curve([0, 0], [[0.4, 0.4, 0.2], [0.8, 0.1, 0.1]])
    for curves, n in (
        ([sh.Curve(np.zeros(len(arc), int), np.column_stack([1 - arc.sum(axis=1), arc]))], len(arc)),
        ([across], 2),
        ([across, from_its_middle], 4),
        ([across, sh.SurfacePoints([0], [[0.4, 0.4, 0.2]])], 3),
    ):
        assert sh.intrinsic_delaunay(mesh, curves).n_vertices == 3 + n


@pytest.mark.parametrize("sections", [24, 96])
def test_a_refinement_for_each_curve_is_better_than_one_for_all_on_slender_triangles(sections):
    """A tall cylinder as CAD programs make it, in triangles from rim to rim: large ones must not stay."""
    mesh = cylinder(sections, 2, height=6.0)
    curves = mesh.level_set(mesh.vertices @ [1.5, 0.0, 1.0], 3.0)
    exact = np.abs(sh.signed_distance(curves, mesh, as_oriented=True).values)
    fields = [sh.SignedHeatSolver(mesh, intrinsic=way).distance(curves) for way in (True, "auto")]
    errors = [np.sqrt(np.mean((np.abs(field.values) - exact) ** 2)) for field in fields]
    assert errors[0] < 0.8 * errors[1] and errors[1] < 0.1 * exact.max()
