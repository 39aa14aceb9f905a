"""Nonbounding curves: the fast solution against the exact one, cuts where they must be, bounding curves left alone."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.jump_program import minimize_exactly
from shapes.surface_cases import flipped
from shapes.triangulated import angles, cylinder, moebius
from signedheat.curves import jumping_distance as piecewise
from signedheat.curves.jumps import JumpProblem, minimize
from signedheat.diagnostics import Jumps
from signedheat.discretization import discretize
from signedheat.mesh.intrinsic_mesh import IntrinsicMesh, face_pairs
from signedheat.mesh.polylines import assemble_polylines
from signedheat.samples import sphere, torus


def shaken(mesh: sh.TriangleMesh, amount: float) -> sh.TriangleMesh:
    noise = np.random.default_rng(1).normal(size=mesh.vertices.shape)
    return sh.TriangleMesh(mesh.vertices + amount * noise, mesh.faces)


def arc(mesh: sh.TriangleMesh, angle: float = 2.0) -> sh.Curve:
    """An open arc of a circle of latitude on the unit sphere, through faces."""
    t = np.linspace(0, angle, 40)
    return mesh.polyline(np.stack([0.9 * np.cos(t), 0.9 * np.sin(t), np.full_like(t, 0.4)], axis=1))


CASES = {
    "round the tube": lambda: (m := shaken(torus(n_around=48, n_across=24), 0.005), m.path(range(24), closed=True)),
    "round the hole": lambda: (
        m := shaken(torus(n_around=48, n_across=24), 0.005),
        m.path(np.arange(48) * 24, closed=True),
    ),
    "open arc": lambda: (m := sphere(4), arc(m)),
    "Moebius core": lambda: (m := moebius(), m.path(np.arange(80) * 9 + 4, closed=True)),
}


def exact_distance(*arguments, **options) -> sh.Field:
    """Piecewise distance from the exact solution of the linear program."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(piecewise, "minimize", lambda problem, **_: minimize_exactly(problem))
        return sh.piecewise_distance(*arguments, **options)


@pytest.mark.parametrize("case", CASES)
def test_fast_is_as_good_as_exact(case):
    mesh, curve = CASES[case]()
    fast, exact = (
        way(curve, mesh, intrinsic=False).diagnostics.note(Jumps) for way in (sh.piecewise_distance, exact_distance)
    )
    assert exact.gap < 1e-6
    assert exact.objective * (1 - 1e-6) <= fast.objective <= 1.005 * exact.objective
    assert fast.bound <= exact.objective * (1 + 1e-6)


def test_loop_round_the_tube_is_cut_across_the_tube():
    mesh = torus(n_around=64, n_across=24)
    phi = sh.piecewise_distance(mesh.path(range(24), closed=True), mesh)
    assert len(phi.domain.cuts(phi.values)) == 1
    cut = phi.domain.cuts(phi.values)[0]
    assert cut.vertices[0] == cut.vertices[-1]
    assert cut.length == pytest.approx(2 * np.pi * 0.4, rel=0.03)
    assert 2 * np.pi * 0.6 < cut.height < 2 * np.pi * 1.4  # between the ways round the inner and the outer equator
    ring = np.arctan2(*mesh.vertices[cut.vertices, 1::-1].T)
    assert np.abs(ring).min() > 2 * np.pi / 64  # not at the source
    slope = np.linalg.norm(phi.cell_gradients, axis=1)
    assert np.sqrt(np.average((slope - 1) ** 2, weights=mesh.face_areas)) < 0.08


def test_source_is_cut_only_where_nothing_else_is_possible():
    mesh = torus(n_around=48, n_across=24)  # the inner equator is the shortest loop of all
    ids = np.arange(48) * 24 + 12
    phi = exact_distance(mesh.path(ids, closed=True), mesh)
    assert len(phi.domain.cuts(phi.values)) == 1
    assert not np.isin(phi.domain.cuts(phi.values)[0].vertices, ids).any()


def test_gradient_is_one_and_source_is_zero():
    mesh = sphere(4)
    curve = arc(mesh)
    phi = sh.piecewise_distance(curve, mesh, smooth=False)
    spacing = mesh.edge_lengths.mean()
    assert np.allclose(np.linalg.norm(phi.cell_gradients, axis=1), 1)
    assert np.abs(phi(curve)).max() < spacing
    assert abs(np.median(phi(curve))) < 0.1 * spacing


def test_bounding_curve_equals_plain_distance():
    """rms of the difference ≤ integration_error / √λ, λ = 2 on the unit sphere (10 % for the polyhedron's own λ)."""
    mesh = sphere(4)
    t = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    circle = mesh.polyline(np.stack([0.9 * np.cos(t), 0.9 * np.sin(t), np.full_like(t, 0.4)], axis=1), closed=True)
    phi = sh.piecewise_distance(circle, mesh)
    notes = phi.diagnostics.note(Jumps)
    assert notes.continuous and phi.domain.cuts(phi.values) == [] and notes.cut_length == 0
    plain = sh.SignedHeatSolver(mesh).distance(circle, sh.constraints.Free())
    split = phi.expand()
    assert split.domain.n_vertices == mesh.n_vertices
    at_vertices = np.empty(mesh.n_vertices)
    at_vertices[mesh.faces] = split.values[split.domain.faces]
    area = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3, 3))
    difference = at_vertices - plain.values
    difference -= np.average(difference, weights=area)
    assert np.sqrt(np.average(difference**2, weights=area)) <= 1.1 * notes.integration_error / np.sqrt(2)


def test_orientation_of_faces_does_not_matter():
    """The same strip, 30 % of its faces turned over, with the source's normals given: the same field."""
    fields = []
    for flips in (0.0, 0.3):
        mesh = flipped(moebius(), flips)
        ids = np.arange(9) + 9 * 20
        across = mesh.path(ids)
        along = np.cross(np.diff(mesh.vertices[ids], axis=0), [0.0, 0.0, 1.0])
        curve = sh.Curve(across.faces, across.barycentric, normals=along)
        fields.append(exact_distance(curve, mesh))
    assert fields[0].diagnostics.note(Jumps).objective == pytest.approx(
        fields[1].diagnostics.note(Jumps).objective, rel=1e-9
    )
    assert np.ptp(fields[0].values) > 4 and not fields[0].diagnostics.note(Jumps).continuous


def test_reversal_changes_the_sign():
    mesh = torus(n_around=40, n_across=20)
    curve = mesh.path(range(20), closed=True)
    forth, back = (exact_distance(c, mesh, smooth=False) for c in (curve, curve.reversed()))
    assert forth.diagnostics.note(Jumps).objective == pytest.approx(back.diagnostics.note(Jumps).objective, rel=1e-9)
    assert np.allclose(forth.cell_gradients, -back.cell_gradients)


def test_scale():
    mesh, curve = CASES["round the tube"]()
    large = sh.TriangleMesh(1000 * mesh.vertices, mesh.faces)
    small, scaled = sh.piecewise_distance(curve, mesh), sh.piecewise_distance(curve, large)
    assert np.allclose(scaled.values, 1000 * small.values, rtol=0, atol=1e-3)


def test_inconsistently_oriented_curve():
    """Fig. 14: half of an equator runs the wrong way; the cut joins the two places where the orientation changes."""
    mesh = sphere(4)
    t = np.linspace(0, np.pi, 60)
    halves = [mesh.polyline(np.stack([np.cos(t), s * np.sin(t), 0 * t], axis=1)) for s in (1, -1)]
    phi = sh.piecewise_distance(halves, mesh)
    assert not phi.diagnostics.note(Jumps).continuous
    ends = np.concatenate([c.points for c in phi.domain.cuts(phi.values)])
    assert min(np.linalg.norm(ends - [1, 0, 0], axis=1).min(), np.linalg.norm(ends - [-1, 0, 0], axis=1).min()) < 0.5
    for side in (1, -1):
        vertex = np.argmin(np.linalg.norm(mesh.vertices - [0, 0.8 * side, 0.6], axis=1))
        assert phi(mesh.points_at([vertex]))[0] == pytest.approx(side * np.arcsin(0.6), abs=0.1)


def test_polygons_equal_triangles():
    mesh = torus(n_around=40, n_across=20)
    polygons = sh.PolygonMesh(mesh.vertices, mesh.faces)
    curve = mesh.path(range(20), closed=True)
    a, b = sh.piecewise_distance(curve, mesh), sh.piecewise_distance(curve, polygons)
    assert np.allclose(a.values, b.values, atol=1e-9)


def test_quads():
    mesh = torus(n_around=40, n_across=20)
    ids = np.arange(800).reshape(40, 20)
    right, up = np.roll(ids, -1, axis=0), np.roll(ids, -1, axis=1)
    quads = np.stack([ids, right, np.roll(right, -1, axis=1), up], axis=-1).reshape(-1, 4)
    phi = sh.piecewise_distance(sh.PolygonMesh(mesh.vertices, quads).path(ids[0]), sh.PolygonMesh(mesh.vertices, quads))
    assert phi.domain.triangulation.n_faces == 4 * len(quads)
    assert phi.domain.cuts(phi.values)[0].length == pytest.approx(2 * np.pi * 0.4, rel=0.05)


def test_intrinsic_triangulation_equals_the_mesh():
    """No flips to do, hence the same triangles: the same field, evaluated on the mesh."""
    mesh = sphere(3)
    curve = arc(mesh)
    domains = mesh, sh.intrinsic_delaunay(mesh)
    h = [discretize(domain).spacing for domain in domains]  # a mean over edges, and over the area
    diffusion = [(h[0] / spacing) ** 2 for spacing in h]
    best = [
        exact_distance(curve, domain, diffusion=tau).diagnostics.note(Jumps).objective
        for domain, tau in zip(domains, diffusion, strict=True)
    ]
    assert best[0] == pytest.approx(best[1], rel=1e-9)  # several fields may reach it
    plain, intrinsic = (
        sh.piecewise_distance(curve, domain, diffusion=tau) for domain, tau in zip(domains, diffusion, strict=True)
    )
    middle = sh.SurfacePoints(np.arange(mesh.n_faces), np.full((mesh.n_faces, 3), 1 / 3))
    assert np.abs(plain(middle) - intrinsic(middle)).max() < 1e-6
    assert np.abs(plain.gradient(middle) - intrinsic.gradient(middle)).max() < 1e-4
    assert intrinsic.diagnostics.note(Jumps).cut_length == pytest.approx(plain.diagnostics.note(Jumps).cut_length)
    split = intrinsic.expand()
    assert split.domain.n_vertices == plain.expand().domain.n_vertices
    with refused(sh.errors.GeometryError):
        _ = intrinsic.cell_gradients


def bad(mesh: sh.TriangleMesh) -> sh.TriangleMesh:
    """The same torus, its vertices drawn together along it so that triangles are obtuse."""
    x, y, z = mesh.vertices.T
    angle = np.arctan2(y, x)
    ring = np.hypot(x, y)
    angle = angle + 0.8 * np.sin(3 * angle) / 3
    return sh.TriangleMesh(np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1), mesh.faces)


@pytest.mark.parametrize("refine", [False, True])
def test_intrinsic_triangulation_of_a_bad_mesh(refine, tmp_path):
    mesh = bad(torus(n_around=40, n_across=20))
    curve = mesh.path(range(20), closed=True)
    better = sh.intrinsic_delaunay(mesh, keep=curve, refine=refine)
    phi = sh.piecewise_distance(curve, better)
    assert phi.diagnostics.note(Jumps).gap < 0.002
    # One loop round the tube, of circumference 0.8 π, with a twig or two at bad triangles. It sits where triangles are
    # longest, and there the way round, from 1.2 π to 2.8 π, is measured with an error of a triangle or so.
    assert 0.97 * 0.8 * np.pi < sum(cut.length for cut in phi.domain.cuts(phi.values)) < 1.3 * 0.8 * np.pi
    assert sum(cut.height * cut.length for cut in phi.domain.cuts(phi.values)) / (0.8 * np.pi) > 1.2 * np.pi - 0.5
    assert np.abs(phi(curve)).max() < mesh.edge_lengths.mean()
    step = 1e-6 * np.array([-1.0, 0.5, 0.5])  # so short that hardly any leads into another triangle
    here, there = (
        sh.SurfacePoints(range(mesh.n_faces), np.full((mesh.n_faces, 3), 1 / 3) + s) for s in (0 * step, step)
    )
    risen = phi.gradient(here) * np.einsum("k,fkd->fd", step, mesh.vertices[mesh.faces])
    assert np.median(np.abs(risen.sum(axis=1) - (phi(there) - phi(here)))) < 1e-10
    split = phi.expand()  # flat, in space, cut open, with slope one
    assert split.domain.triangulation.face_areas.sum() == pytest.approx(mesh.face_areas.sum(), rel=1e-6)
    slope = np.linalg.norm(split.cell_gradients, axis=1)
    area = split.domain.triangulation.face_areas
    assert np.sqrt(np.average((slope - 1) ** 2, weights=area)) < 1.001 * phi.diagnostics.note(Jumps).integration_error
    assert np.ptp(split.values) == pytest.approx(np.ptp(phi.values), rel=0.05)  # means at vertices
    assert len(phi.contour(0.0)) >= 1
    phi.save(tmp_path / "phi.ply")
    assert sh.read(tmp_path / "phi.ply").n_vertices == split.domain.n_vertices


@pytest.mark.parametrize("kind", ["triangles", "polygons"])
def test_unoriented_curve_across_faces(kind):
    """Is given edges of its own; φ is the distance to it, without a cut."""
    mesh = sphere(4)
    t = np.linspace(0, 1, 20)
    curve = mesh.polyline(np.stack([np.cos(t), np.sin(t), 0.03 + 0 * t], axis=1), oriented=False)
    domain = mesh if kind == "triangles" else sh.PolygonMesh(mesh.vertices, mesh.faces)
    if kind == "polygons":
        curve = domain.polyline(np.stack([np.cos(t), np.sin(t), 0.03 + 0 * t], axis=1), oriented=False)
    phi = sh.piecewise_distance(curve, domain)
    assert isinstance(phi.domain.surface, sh.IntrinsicTriangulation)
    assert np.abs(phi(curve)).max() < mesh.edge_lengths.mean()  # at its ends, where slopes turn
    poles = domain.points_at([int(np.argmin(np.linalg.norm(mesh.vertices - [0, 0, s], axis=1))) for s in (1, -1)])
    # Truth is π/2 ∓ 0.03. The plain field errs by 0.17, for t = h² and an arc of one radian.
    assert phi(poles) == pytest.approx([np.pi / 2 - 0.03, np.pi / 2 + 0.03], abs=0.16)


def test_smoothing_takes_small_jumps_away_and_leaves_the_cut():
    mesh, curve = CASES["round the tube"]()
    rough, smooth = (sh.piecewise_distance(curve, mesh, smooth=smooth) for smooth in (False, True))
    small = np.abs(rough.domain.jumps(rough.values))[~rough.domain.is_cut]
    assert small.max() > 1e-3
    assert np.abs(smooth.domain.jumps(smooth.values))[~smooth.domain.is_cut].max() < 1e-12
    assert [c.length for c in smooth.domain.cuts(smooth.values)] == pytest.approx(
        [c.length for c in rough.domain.cuts(rough.values)]
    )
    assert np.abs(smooth.values - rough.values).max() < 2 * mesh.edge_lengths.mean()


def test_smooth_is_step_three():
    mesh = sphere(3)
    circle = mesh.level_set(mesh.vertices[:, 2], 0.3)
    plain = sh.SignedHeatSolver(mesh, intrinsic=False, diffusion=1.0).distance(circle, sh.constraints.Free()).values
    smooth = sh.piecewise_distance(circle, mesh, intrinsic=False).expand()
    assert np.ptp(smooth.values[smooth.domain.faces] - plain[mesh.faces]) < 1e-4


def test_smooth_is_nearer_to_the_way_along_a_moebius_strip():
    """Distance on its middle line is the way along that."""
    mesh = moebius(180, 12, 0.35)
    curve = mesh.path(90 * 13 + np.arange(13))
    way = angles(180) - np.pi
    at = np.flatnonzero(np.abs(way) < 0.8)
    middle = mesh.points_at(at * 13 + 6)
    errors = []
    for smooth in (False, True):
        values = sh.piecewise_distance(curve, mesh, smooth=smooth)(middle)
        errors.append(np.abs(np.abs(values) - np.abs(way[at])).max())
    assert errors[1] < 0.5 * errors[0] and errors[1] < 0.002


def test_save_and_contour_show_the_jump(tmp_path):
    mesh, curve = CASES["round the tube"]()
    phi = sh.piecewise_distance(curve, mesh)
    split = phi.expand()
    (cut,) = phi.domain.cuts(phi.values)  # closed, and doubled
    assert split.domain.n_vertices == mesh.n_vertices + len(cut.vertices) - 1
    assert np.array_equal(split.domain.vertices[split.domain.faces], mesh.vertices[mesh.faces])
    lines = phi.contour(0.0)
    assert np.abs(phi(lines[0])).max() < mesh.edge_lengths.mean()
    phi.save(tmp_path / "phi.ply")
    assert sh.read(tmp_path / "phi.ply").n_vertices == split.domain.n_vertices


def test_parts_without_source_are_nan():
    mesh = torus(n_around=40, n_across=20)
    both = sh.TriangleMesh(
        np.concatenate([mesh.vertices, mesh.vertices + 5]), np.concatenate([mesh.faces, mesh.faces + mesh.n_vertices])
    )
    with pytest.warns(sh.errors.UnreachedWarning):
        phi = sh.piecewise_distance(both.path(range(20), closed=True), both)
    assert np.isnan(phi.values[mesh.n_faces :]).all() and np.isfinite(phi.values[: mesh.n_faces]).all()
    assert np.array_equal(phi.diagnostics.unreached, np.arange(mesh.n_faces, 2 * mesh.n_faces))
    assert len(phi.domain.cuts(phi.values)) == 1


def test_single_face():
    mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    curve = sh.Curve([0, 0], [[0.5, 0.5, 0.0], [0.5, 0.0, 0.5]])
    for way in (sh.piecewise_distance, exact_distance):
        phi = way(curve, mesh)
        assert np.allclose(phi.values, np.sqrt(0.125) * np.array([1, -1, -1]))


def test_nonmanifold_edge():
    """Three half planes at one edge; each pair of pages is joined, and the source on one of them reaches all."""
    angles = 2 * np.pi * np.arange(3) / 3
    pages = [[np.cos(a) * r, np.sin(a) * r, z] for a in angles for r in (1, 2) for z in (0, 1)]
    vertices = np.array([[0, 0, 0], [0, 0, 1], *pages], dtype=float)
    faces = []
    for k in range(3):
        a, b, c, d = 2 + 4 * k + np.arange(4)
        faces += [[0, a, b], [0, b, 1], [a, c, d], [a, d, b]]
    mesh = sh.TriangleMesh(vertices, faces)
    pairs = face_pairs(IntrinsicMesh.from_lengths(mesh.faces, np.ones((12, 3)), 14, mesh.edges))
    spine = np.flatnonzero(pairs.shares == 0.5)
    assert len(spine) == 3 and len(np.unique(pairs.faces[spine])) == 3
    phi = sh.piecewise_distance(mesh.path([2, 3]), mesh)
    assert np.isfinite(phi.values).all()


def test_certificate_against_brute_force():
    """Two faces and one edge: the minimum is the floor. Three faces in a ring: the cheapest edge takes the jump."""
    ring = JumpProblem(
        np.array([[0, 1], [1, 2], [2, 0]]), np.array([1.0, 1, 1]), np.array([1.0, 1, 1]), np.array([3.0, 1, 2]), 3
    )
    for solve in (minimize, minimize_exactly):
        solution = solve(ring)
        assert solution.objective == pytest.approx(6.0, rel=3e-3)
        assert solution.bound <= 6.0 * (1 + 1e-9)
        assert solution.bound == pytest.approx(6.0, rel=3e-3)


def test_polylines_close_and_end_at_forks():
    edges = np.array([[0, 1], [1, 2], [2, 0], [5, 6], [6, 7], [6, 8]])
    lines = assemble_polylines(*edges.T, directed=False)
    assert sorted((len(line), closed) for line, _, closed in lines) == [(1, False)] * 3 + [(3, True)]


@pytest.mark.parametrize(
    ("keywords", "error"),
    [({"smooth": 1.0}, ValueError), ({"diffusion": 0.0}, ValueError), ({"intrinsic": "yes"}, ValueError)],
)
def test_bad_options(keywords, error):
    mesh = sphere(1)
    with pytest.raises(error):
        sh.piecewise_distance(mesh.path([0, mesh.faces[0, 1]]), mesh, **keywords)


def test_bad_domain_and_source():
    with refused(TypeError, "domain"):
        sh.piecewise_distance([], sh.PointCloud(np.eye(3)))
    square = sh.PolygonMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    with refused(sh.errors.GeometryError, "domain"):  # which has no intrinsic triangulation
        sh.piecewise_distance(square.path([0, 2]), square, intrinsic=True)
    mesh = sphere(1)
    with pytest.raises(sh.errors.SourceError):
        sh.piecewise_distance([], mesh)
    across = sh.Curve([0, 0], [[0.2, 0.3, 0.5], [0.5, 0.3, 0.2]], oriented=False)
    with refused(sh.errors.SourceError):
        sh.piecewise_distance(across, sh.intrinsic_delaunay(mesh))


@pytest.mark.parametrize(("step", "above"), [("integrate", 0.4), ("cut", 0.6)])
def test_progress_can_cancel(step, above):
    class Stop(Exception):
        pass

    def progress(fraction, now):
        if now == step and above <= fraction < 0.8:  # amid the rounds
            raise Stop

    mesh, curve = CASES["open arc"]()
    with pytest.raises(Stop):
        sh.piecewise_distance(curve, mesh, progress=progress)


def test_progress_grows():
    told = []
    mesh, curves = CASES["open arc"]()
    sh.piecewise_distance(curves, mesh, progress=lambda fraction, step: told.append((fraction, step)))
    steps = ["prepare", "diffuse", "integrate", "cut", "finish"]
    assert {step for _, step in told} == {*steps, "done"}
    assert 0 <= min(told)[0] and max(told)[0] == 1 and told[-1] == (1.0, "done")
    first = [
        min(f for f, step in told if step == each) for each in ("prepare", "diffuse", "integrate", "cut", "finish")
    ]
    assert np.allclose(first, [0, 0.2, 0.4, 0.6, 0.8])


@pytest.mark.parametrize("build", [lambda: sphere(4), lambda: torus(n_around=96, n_across=48)])
def test_curves_that_bound_take_few_rounds(build):
    """Without a cut, nothing larger than the triangles is left to find; it used to take more than a thousand rounds."""
    mesh = build()
    heights = np.linalg.norm(mesh.vertices - mesh.vertices[7], axis=1) - 0.8
    curve = mesh.level_set(heights)
    phi = sh.piecewise_distance(curve, mesh)
    assert phi.diagnostics.note(Jumps).rounds <= 200 and phi.diagnostics.note(Jumps).continuous
    plain = sh.SignedHeatSolver(mesh).distance(curve, sh.constraints.Free()).values
    difference = phi.values.mean(axis=1) - plain[mesh.faces].mean(axis=1)
    assert np.sqrt(np.mean(difference**2)) < 0.02 * np.ptp(plain)


@pytest.mark.parametrize("n_around", [40, 120])
def test_a_cut_spread_over_many_edges_is_no_continuity(n_around):
    """Round the tube of a torus all cuts cost the same, on the way to the solution φ jumps a little everywhere."""
    mesh = torus(n_around=n_around, n_across=24)
    phi = sh.piecewise_distance(mesh.path(range(24), closed=True), mesh)
    assert len(phi.domain.cuts(phi.values)) == 1 and phi.diagnostics.note(Jumps).gap < 0.01


def test_triangles_on_which_slopes_mean_nothing_are_told():
    """A cylinder as programs for construction make it: two triangles from end to end for every side, fans as caps."""
    n, height = 96, 6.0
    angle = 2 * np.pi * np.arange(n) / n
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    i, caps = np.arange(n), np.stack([np.zeros(n - 2, int), np.arange(1, n - 1), np.arange(2, n)], axis=1)
    j = np.roll(i, -1)
    sides = [np.stack([i, j, n + j], axis=1), np.stack([i, n + j, n + i], axis=1)]
    mesh = sh.TriangleMesh(
        np.concatenate([points, points + np.array([0, 0, height])]), np.concatenate([*sides, caps[:, ::-1], caps + n])
    )
    section = mesh.level_set(mesh.vertices @ [0.3, 0, 1], 0.45 * height)
    with pytest.warns(sh.errors.InexactWarning):
        rough = sh.piecewise_distance(section, mesh, intrinsic=False, smooth=False)
    fine = sh.piecewise_distance(section, mesh)
    errors = [phi.diagnostics.note(Jumps).integration_error for phi in (rough, fine)]
    assert errors[0] > 1 and errors[1] < 0.1
    assert fine.diagnostics.note(Jumps).continuous


def test_line_along_a_cylinder_is_distance_on_the_strip_cut_open():
    """φ is the way round, with one straight cut from rim to rim, at which it falls by all of the way round."""
    mesh = cylinder(64, 32)
    phi = sh.piecewise_distance(mesh.path(range(32)), mesh)
    (cut,) = phi.domain.cuts(phi.values)
    around = 64 * 2 * np.sin(np.pi / 64)
    assert cut.length == pytest.approx(2.0)
    assert np.allclose(cut.jumps, around, rtol=0.01)
    assert np.ptp(phi.values, axis=None) == pytest.approx(around, rel=0.01)
    assert phi.diagnostics.note(Jumps).integration_error < 0.012  # .017 where jumps are not smoothed


def sheared(mesh: sh.TriangleMesh) -> sh.TriangleMesh:
    """The same torus, its vertices moved along it, further on the inside than on the outside: triangles lean."""
    x, y, z = mesh.vertices.T
    ring = np.hypot(x, y)
    angle = np.arctan2(y, x) + 0.25 * np.sin(np.arctan2(z, ring - 1) + 0.5)
    points = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
    return sh.TriangleMesh(points, mesh.faces)


def test_bad_triangles_are_retriangulated():
    mesh = sheared(torus(n_around=48, n_across=16))
    loop = mesh.level_set(mesh.vertices[:, 0] + 0.1 * mesh.vertices[:, 2], 0.1)[0]  # one of the two
    phi, rough = (sh.piecewise_distance(loop, mesh, intrinsic=i) for i in ("auto", False))
    assert isinstance(phi.domain.surface, sh.IntrinsicTriangulation)
    assert not isinstance(rough.domain.surface, sh.IntrinsicTriangulation)
    errors = [field.diagnostics.note(Jumps).integration_error for field in (phi, rough)]
    assert errors[0] < 0.7 * errors[1]
    assert len(phi.domain.cuts(phi.values)) == 1
    assert phi.domain.cuts(phi.values)[0].length == pytest.approx(2 * np.pi * 0.4, rel=0.1)


def test_unoriented_curve_along_edges_of_bad_triangles():
    """Refined for their angles, the triangles keep the edges along which the curve runs: φ is zero on it, no less."""
    mesh = sheared(torus(n_around=48, n_across=16))
    ids = np.arange(16) + 160
    curve = mesh.path(ids, oriented=False)
    phi = sh.piecewise_distance(curve, mesh)
    assert isinstance(phi.domain.surface, sh.IntrinsicTriangulation)
    assert np.abs(phi(mesh.points_at(ids))).max() < 0.5 * mesh.edge_lengths.mean()
    assert phi(mesh.points_at((ids + 384) % 768)).min() > 1.0


def test_arithmetic_keeps_the_triangles_on_which_the_field_is_linear():
    """Points are given on the mesh, also for fields that are made of one on another triangulation of it."""
    strip = sh.TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    line = strip.polyline([[4, 0, 0], [4, 1, 0]])
    phi = sh.piecewise_distance(line, strip, intrinsic=True)
    places = sh.SurfacePoints([0, 1], np.full((2, 3), 1 / 3))
    for changed in (-phi, 2 * phi - phi(places)[0], phi + 0):
        assert type(changed) is type(phi)
    np.testing.assert_allclose((-phi)(places), -phi(places), atol=1e-12)
    np.testing.assert_allclose((2 * phi + 1).gradient(places), 2 * phi.gradient(places), atol=1e-9)
