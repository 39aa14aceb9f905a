"""Sharpening on tets: closed forms, walls, both methods, parts without a zero set, bad input."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.domain_cases import fitted_order
from shapes.tet_cases import boxes, ell, lattice, rectangle, rms, round_ball, sphere
from signedheat.diagnostics import ConvexRounds, RoundCorners, SlopeErrors


def ball_around(mesh: sh.TetMesh) -> np.ndarray:
    return np.linalg.norm(mesh.vertices, axis=1) - 1


def test_distance_from_a_plane_is_exact_to_rounding():
    """Whatever the scale and the slope of what vanishes on it."""
    mesh = boxes((8, 8, 8), 0.25, jitter=0.1)
    line = (mesh.vertices - [0.9, 1.1, 1.0]) @ [0.6, 0.0, 0.8]
    sharp = sh.sharpen(sh.Field(mesh, 3 * line))
    inner = np.abs(mesh.vertices - 1).max(axis=1) < 0.55  # whose foot on the plane lies in the cube
    assert inner.sum() > 20
    assert np.abs(sharp.values - line)[inner].max() < 1e-12
    large = sh.sharpen(sh.Field(sh.TetMesh(1e4 * mesh.vertices, mesh.tets), line))
    assert large.values == pytest.approx(1e4 * sharp.values, abs=1e-7)


@pytest.mark.parametrize("diffusion", [1.0, 10.0])
def test_sphere_gains_much_and_converges(diffusion):
    """Measured: order 1.7, and 2.5 (diffused for long, coarse) to 20 times (briefly, fine) less error than before."""
    sizes, errors = [], []
    for n in (6, 8, 11):
        mesh = lattice(n)
        plain = sh.SignedHeatSolver(mesh, diffusion).distance(round_ball())
        sharp = sh.sharpen(plain)
        before, after = (rms(phi.values - ball_around(mesh)) for phi in (plain, sharp))
        assert after < 0.5 * before
        assert np.array_equal(np.sign(sharp.values), np.sign(plain.values))
        sizes.append(1 / n)
        errors.append(after)
    assert fitted_order(sizes, errors) > 1.5


def test_lines_bend_round_a_corner():
    """Beyond the inner corner of an L; measured: 100 to 400 times less error than before, falling like h²."""
    sizes, errors = [], []
    for n in (6, 10, 14):
        mesh, wall, exact = ell(n)
        used = np.unique(mesh.tets)
        plain = sh.SignedHeatSolver(mesh).distance(wall)
        sharp = sh.sharpen(plain)
        slopes = sharp.diagnostics.note(SlopeErrors)
        assert sharp.diagnostics.note(RoundCorners).round_corners > 0.05 * mesh.n_vertices
        assert slopes.slope_error_after < slopes.slope_error_before
        before, after = (rms((phi.values - exact)[used]) for phi in (plain, sharp))
        assert after < 0.05 * before
        sizes.append(1 / n)
        errors.append(after)
    assert fitted_order(sizes, errors) > 1.3


def test_walls_without_thickness_between_are_not_seen_through():
    """A slit half way up a box, two tets of vertices apart: what lies above it is reached round its edge."""
    n = 12
    keep = lambda c: ~((c[:, 0] < 1.0) & (np.abs(c[:, 2] - 1) < 1 / n))  # noqa: E731
    mesh = boxes((2 * n, 4, 2 * n), 1 / n, keep=keep)
    x, _, z = mesh.vertices.T
    sharp = sh.sharpen(sh.Field(mesh, z - 0.55)).values
    above = (z >= 1.0) & (x < 0.9) & np.isin(np.arange(mesh.n_vertices), mesh.tets)
    edge = 1.0
    low = np.hypot(edge - x, 0) + (z - 0.55)  # the way is at least so long as over the edge of the slit …
    assert (sharp[above] > z[above] - 0.55 + 1e-3).all()
    assert (sharp[above] <= low[above] + 1e-9).all()  # … and no longer than along axes


def test_a_zero_set_beyond_a_gap_does_not_count():
    """Two slabs with a narrow gap between; the zero set of the other one is nearer to every vertex of the upper."""
    one = boxes((6, 6, 2), 0.25)
    n = one.n_vertices
    two = sh.TetMesh(
        np.concatenate([one.vertices, one.vertices + np.array([0, 0, 0.51])]), np.concatenate([one.tets, one.tets + n])
    )
    x, z = two.vertices[:, 0], two.vertices[:, 2]
    own = np.arange(2 * n) >= n
    sharp = sh.sharpen(sh.Field(two, np.where(own, x - 0.3, z - 0.48))).values
    assert sharp[own] == pytest.approx((x - 0.3)[own], abs=1e-9)
    assert sharp[~own] == pytest.approx((z - 0.48)[~own], abs=1e-9)


def test_broken_source_is_measured_to_its_completion():
    whole = sphere(4)
    broken = sh.TriangleMesh(whole.vertices, whole.faces[np.random.default_rng(0).random(whole.n_faces) > 0.2])
    mesh = lattice(14)
    plain = sh.SignedHeatSolver(mesh).distance(broken)
    before, after = (rms(phi.values - ball_around(mesh)) for phi in (plain, sh.sharpen(plain)))
    assert after < before


def test_convex_method_holds_slopes_and_signs():
    """It is no better than the plain field here (biased low), but it is what it says: |∇φ| ≤ 1."""
    mesh = lattice(12)
    plain = sh.SignedHeatSolver(mesh).distance(sphere(4))
    seen = []
    sharp = sh.sharpen(plain, method=sh.methods.Convex(), progress=lambda *step: seen.append(step))
    ended = sharp.diagnostics.note(ConvexRounds)
    assert ended.residual <= 2e-3 and ended.rounds <= 200 and ended.rounds < len(seen)
    excess = np.maximum(np.linalg.norm(sharp.cell_gradients, axis=1) - 1, 0)
    assert np.sqrt(np.average(excess**2, weights=mesh.tet_volumes)) <= 2e-3
    assert (np.abs(sharp.values) <= np.abs(ball_around(mesh)) + 0.05).all()
    assert rms(sharp.values - ball_around(mesh)) < 0.05


def test_convex_method_leaves_an_exact_distance_alone():
    mesh = boxes((6, 6, 6), 1 / 3, jitter=0.1)
    wall = rectangle([-1, -1, 0.9], [4, 0, 0], [0, 4, 0])
    plain = sh.SignedHeatSolver(mesh).distance(wall)
    assert np.abs(plain.values - (mesh.vertices[:, 2] - 0.9)).max() < 1e-5
    assert np.abs(sh.sharpen(plain, method=sh.methods.Convex()).values - plain.values).max() < 0.02


def test_what_is_unknown_stays_unknown():
    one = boxes((4, 4, 4), 0.5)
    two = sh.TetMesh(np.concatenate([one.vertices, one.vertices + 10]), np.concatenate([one.tets, one.tets + 125]))
    values = np.concatenate([one.vertices[:, 0] - 0.9, np.full(125, np.nan)])
    sharp = sh.sharpen(sh.Field(two, values))
    assert np.isfinite(sharp.values[:125]).all() and np.isnan(sharp.values[125:]).all()
    values[125:] = 4.0  # a part without a zero set keeps what it has
    assert (sh.sharpen(sh.Field(two, values)).values[125:] == 4.0).all()


def test_fields_from_files_can_be_sharpened(tmp_path):
    mesh, wall, _ = ell(6)
    plain = sh.SignedHeatSolver(mesh).distance(wall)
    plain.save(tmp_path / "phi.vtu")
    loaded = sh.read_field(tmp_path / "phi.vtu")
    assert np.array_equal(sh.sharpen(loaded).values, sh.sharpen(plain).values)
    with refused(sh.errors.SourceError):
        sh.sharpen(loaded, method=sh.methods.Convex())


def test_one_sign_is_refused():
    mesh = boxes((2, 2, 2), 1.0)
    with refused(sh.errors.OutsideError):
        sh.sharpen(sh.Field(mesh, 1 + mesh.vertices[:, 0]))


def test_progress_can_cancel():
    class Stop(Exception):
        pass

    def progress(fraction, step):
        if 0 < fraction < 1:
            raise Stop

    mesh = lattice(8)
    plain = sh.SignedHeatSolver(mesh).distance(sphere(3))
    with pytest.raises(Stop):
        sh.sharpen(plain, method=sh.methods.Convex(), progress=progress)
