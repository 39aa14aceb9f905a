"""Directions extrapolated in the diffusion time, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat.discretization import discretize
from signedheat.surfaces.extrapolation import default_diffusion
from signedheat.surfaces.vector_heat import TIME_EXPONENTS, extrapolated

ROUND = (1.2, 0.6)  # half axes of an ellipse


def lattice(n, shear):
    """A square in right triangles, or its sheared image, in which heat decays faster along some directions."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-2, 2, n + 1), np.linspace(-2, 2, n + 1)))
    low = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :-1].ravel()
    up = low + n + 1
    faces = np.concatenate([np.stack([low, low + 1, up + 1], 1), np.stack([low, up + 1, up], 1)])
    return sh.TriangleMesh(np.stack([x + shear * y, y, 0 * x], 1), faces)


def relative_error(n, shear, diffusion):
    """Distance to an ellipse: root mean square error over the range."""
    mesh = lattice(n, shear)
    points = mesh.vertices[:, :2]
    angle = np.linspace(0, 2 * np.pi, 3000, endpoint=False)
    ellipse = np.stack([np.cos(angle), np.sin(angle)], 1) * ROUND
    outside = ((points / ROUND) ** 2).sum(1) - 1
    exact = np.sign(outside) * np.sqrt(((points[:, None] - ellipse[None]) ** 2).sum(2).min(1))
    field = sh.SignedHeatSolver(mesh, diffusion).distance(mesh.level_set(outside, 0.0))
    return np.sqrt(np.mean((field.values - exact) ** 2)) / np.ptp(exact)


@pytest.mark.parametrize("shear", [0.0, 0.5])
def test_error_falls_like_the_triangles_size(shear):
    coarse, fine = (relative_error(n, shear, sh.methods.Extrapolated()) for n in (12, 36))
    assert np.log(coarse / fine) / np.log(3) > 0.7
    assert fine < 0.5 * min(relative_error(36, shear, tau) for tau in (1.0, 4.0))


@pytest.mark.parametrize("power", TIME_EXPONENTS)
def test_errors_of_both_kinds_cancel(power):
    """X = exp(i (.3 + ε tᵉ)) at t = 1, of whose two changes with t the columns are made."""
    slope = 1j * 0.02 * power
    first, second = slope, slope * power + slope**2  # D X / X and D² X / X
    columns = np.exp(0.32j) * np.array([[1.0, 1.0 + first, 0.5 * (second - 1.0 + 3.0 * (1.0 + first))]])
    assert np.angle(extrapolated(columns)) == pytest.approx(0.3, abs=0.02**2)
    assert np.angle(extrapolated(1e-280 * columns)) == pytest.approx(0.3, abs=0.02**2)


def test_changes_with_time_are_those_of_other_times():
    """Directions far from and near a curve, from factors of one time and of times close to it."""
    mesh = lattice(24, 0.5)
    surface = discretize(mesh)
    curve = mesh.level_set(np.hypot(*mesh.vertices[:, :2].T), 0.9)
    source = surface.lower(curve, 2.0)
    x, once, twice = surface.triangles.sums_in_faces(replaced(surface, source, extrapolated=True)).T
    step = 1e-3
    early, late = (
        surface.triangles.sums_in_faces(replaced(surface, source, time=source.time * np.exp(s)))[:, 0]
        for s in (-step, step)
    )
    turned, now, later = np.angle(early / x), np.angle(x / x), np.angle(late / x)
    first = once / x - 1.0
    assert np.allclose(first.imag, (later - turned) / (2 * step), atol=1e-4)
    second = (1.0 - 3.0 * once / x + 2.0 * twice / x - first**2).imag
    assert np.allclose(second, (later - 2 * now + turned) / step**2, atol=1e-2 * max(1.0, np.abs(second).max()))


def replaced(surface, source, **changes):
    """X of the source with something else about it."""
    (stage,) = surface.diffuse(replace(source, **changes))
    return stage


def test_directions_are_extrapolated_beyond_the_range_of_numbers_too():
    """A strip so long that X underflows on it: what follows is solved for in stages, changes with t included."""
    n = 700
    x, y = (a.ravel() for a in np.meshgrid(np.arange(n + 1.0), np.arange(3.0), indexing="ij"))
    low = np.arange(3 * n).reshape(n, 3)[:, :-1].ravel()
    faces = np.concatenate([np.stack([low, low + 3, low + 4], 1), np.stack([low, low + 4, low + 1], 1)])
    mesh = sh.TriangleMesh(np.stack([x, y, 0 * x], 1), faces)
    surface = discretize(mesh)
    source = surface.lower(mesh.level_set(x, 0.5), 1.0)
    stages = surface.diffuse(replace(source, extrapolated=True))
    assert len(stages) > 1
    directions = surface.to_cells(stages)
    assert np.allclose(np.abs(directions), 1, atol=1e-6)
    field = sh.SignedHeatSolver(mesh, sh.methods.Extrapolated(1.0)).distance(mesh.level_set(x, 0.5))
    assert np.allclose(field.values, x - 0.5, atol=1e-6)


def test_one_time_in_space():
    with refused(sh.errors.UnsupportedTypeError, "diffusion"):
        sh.SignedHeatSolver(sh.Grid((0, 0), 1.0, (8, 8)), sh.methods.Extrapolated()).distance(
            sh.Polyline([[2.0, 2.0], [5.0, 5.0]])
        )


def test_many_sources_give_what_each_gives():
    mesh = lattice(10, 0.3)
    curves = [mesh.level_set(mesh.vertices[:, k], level) for k, level in ((0, 0.3), (1, -0.2))]
    solver = sh.SignedHeatSolver(mesh, sh.methods.Extrapolated())
    for constraint in (sh.constraints.Free(), sh.constraints.ZeroSet()):
        for together, curve in zip(solver.distance_many(curves, constraint), curves, strict=True):
            assert np.allclose(together.values, solver.distance(curve, constraint).values, rtol=0, atol=1e-9)


def test_scale_and_side():
    mesh = lattice(10, 0.3)
    curve = mesh.level_set(np.hypot(*mesh.vertices[:, :2].T), 0.9)
    values = sh.SignedHeatSolver(mesh, sh.methods.Extrapolated()).distance(curve).values
    turned = sh.SignedHeatSolver(mesh, sh.methods.Extrapolated()).distance([c.reversed() for c in curve]).values
    larger = sh.SignedHeatSolver(sh.TriangleMesh(1e3 * mesh.vertices, mesh.faces), sh.methods.Extrapolated()).distance(
        curve
    )
    assert np.allclose(turned, -values, atol=1e-9)
    assert np.allclose(larger.values, 1e3 * values, atol=1e-6)


@pytest.mark.parametrize("tau", [0.0, -1.0, np.nan, np.inf])
def test_times_that_make_no_sense_are_refused(tau):
    with refused(sh.errors.SignedHeatError, "tau"):
        sh.methods.Extrapolated(tau)


def test_the_default_is_extrapolated_on_surfaces_alone():
    mesh = lattice(10, 0.3)
    for surface in (mesh, sh.PointCloud(mesh.vertices)):
        assert default_diffusion(discretize(surface)) == sh.methods.Extrapolated()
    assert default_diffusion(discretize(sh.Grid((0, 0), 1.0, (8, 8)))) == 1.0
    curve = mesh.level_set(np.hypot(*mesh.vertices[:, :2].T), 0.9)
    values = sh.SignedHeatSolver(mesh).distance(curve).values
    assert np.array_equal(values, sh.SignedHeatSolver(mesh, sh.methods.Extrapolated()).distance(curve).values)
    assert not np.allclose(values, sh.SignedHeatSolver(mesh, 1.0).distance(curve).values, atol=1e-6)
    assert np.array_equal(values, sh.SignedHeatSolver(mesh).distance(curve).values)


def test_times_of_fine_surfaces_grow_so_that_their_error_falls():
    """That of fixed times does not: what they leave of h²/t is a fraction of the distance, whatever h."""
    mesh = lattice(270, 0.5)
    radius = np.hypot(*mesh.vertices[:, :2].T)
    curve = mesh.level_set(radius, 0.6)
    solver = sh.SignedHeatSolver(mesh)
    grown, fixed = (s.distance(curve).values for s in (solver, solver.with_diffusion(sh.methods.Extrapolated())))
    errors = [np.sqrt(np.mean((values - radius + 0.6) ** 2)) for values in (grown, fixed)]
    assert errors[0] < 0.85 * errors[1]


def test_times_depend_on_the_extent_of_a_part_in_h_alone():
    """They grow like its power 2/5, whatever the unit, and whatever other parts there are."""
    coarse, fine = lattice(200, 0.5), lattice(300, 0.5)
    copies = 1e3 * (coarse.vertices + np.arange(3)[:, None, None])
    faces = coarse.faces + coarse.n_vertices * np.arange(3)[:, None, None]
    parts = sh.TriangleMesh(copies.reshape(-1, 3), faces.reshape(-1, 3))
    one, three, finer = (default_diffusion(discretize(mesh)).tau for mesh in (coarse, parts, fine))
    assert one > sh.methods.Extrapolated().tau
    assert three == pytest.approx(one, rel=1e-9)
    assert finer / one == pytest.approx(1.5 ** (2 / 5), rel=1e-3)  # but for the edges of the boundary


@pytest.mark.parametrize("rim", [True, False])
def test_where_curves_end_inside_one_time_is_taken(rim):
    """Beyond an end heat completes what is missing; at the boundary of the surface nothing is."""
    mesh = lattice(16, 0.3)
    line = mesh.level_set(mesh.vertices[:, 1] - 0.4 * np.sin(mesh.vertices[:, 0]), 0.1)
    if not rim:
        line = [sh.Curve(c.faces[3:], c.barycentric[3:]) for c in line]
    solver = sh.SignedHeatSolver(mesh)
    found, one = (s.distance(line).values for s in (solver, solver.with_diffusion(1.0)))
    assert np.allclose(found, one, rtol=0, atol=1e-9) is not rim
    together = solver.distance_many([line, mesh.points_at(3), line])
    for curves, field in zip([line, mesh.points_at(3), line], together, strict=True):
        assert np.allclose(field.values, solver.distance(curves).values, rtol=0, atol=1e-9)
