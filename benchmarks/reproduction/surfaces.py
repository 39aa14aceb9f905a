"""Figures on triangle meshes: constraints, curves that bound nothing, bad domains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import signedheat as sh
from shapes.triangulated import flat
from signedheat import samples
from signedheat.view import draw_surface, new_figure

from . import baselines, shapes
from .pages import Page, figure

Array = NDArray[np.float64]
FROM_ABOVE = np.array([0.0, 0.0, 1.0])


def circle(radius: float, center: tuple[float, float] = (0.0, 0.0), n: int = 120) -> sh.Polyline:
    """A clockwise circle: distance grows outwards."""
    angle = -np.linspace(0, 2 * np.pi, n, endpoint=False)
    return sh.Polyline(np.stack([center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)], axis=1), True)


@figure("8", "No bias at the boundary")
def no_bias_at_the_boundary(page: Page) -> None:
    """A circle of radius 0.7 around (0.8, 0) in a disk of radius 2, t = 100 h². The unsigned heat method (Crane et al.
    2013) bends isolines near the rim; vectors diffused with natural conditions do not.
    """
    mesh, line = shapes.flat_disk(4000), circle(0.7, (0.8, 0.0))
    curve = shapes.placed(mesh, line)
    exact = np.linalg.norm(mesh.vertices[:, :2] - [0.8, 0], axis=1) - 0.7
    sign = np.sign(exact)
    signed = sh.SignedHeatSolver(mesh, diffusion=100.0, intrinsic=False).distance(curve, sh.constraints.Free())
    unsigned = baselines.unsigned_heat(mesh, [curve], diffusion=100.0)
    fields = {"unsigned heat method × sign": sign * unsigned, "signed heat method": signed.values}
    rim = np.linalg.norm(mesh.vertices[:, :2], axis=1) > 1.7
    picture = new_figure(12, 5)
    for k, (name, values) in enumerate(fields.items()):
        page.add(
            method=name,
            **{"ε %": baselines.error(values, exact), "ε % near the rim": baselines.error(values[rim], exact[rim])},
        )
        axes = picture.add_subplot(1, 2, k + 1)
        draw_surface(sh.Field(mesh, values), axes, [curve], view=FROM_ABOVE)
        axes.set_title(name)
    page.draw(picture)


@figure("9", "Signed and unsigned sources together")
def mixed_sources(page: Page) -> None:
    """Oriented arcs of a broken boundary, an open curve and a point: φ is negative inside the region, positive around
    the others, and about 0 on each.
    """
    ball = samples.sphere(5)
    angle = np.linspace(0, 2 * np.pi, 61)
    ring = np.stack([0.55 * np.cos(angle), 0.55 * np.sin(angle), np.full(61, np.sqrt(1 - 0.55**2))], axis=1)
    arcs = [ball.polyline(ring[k : k + 15][::-1]) for k in (0, 20, 40)]
    line = np.linspace(-0.9, 0.3, 30)
    open_curve = ball.polyline(
        np.stack([np.cos(line), np.sin(line), np.full(30, -0.35)], axis=1) / np.hypot(1, 0.35), oriented=False
    )
    point = ball.points_at([int(np.argmax(ball.vertices @ [-0.2, -1, -0.3]))])
    sources = [*arcs, open_curve, point]
    field = sh.SignedHeatSolver(ball, 1.0, intrinsic=False).distance(sources)
    for name, items in (("arcs", arcs), ("open curve", [open_curve]), ("point", [point])):
        values = np.concatenate([np.atleast_1d(field(item)) for item in items])
        page.add(source=name, **{"mean |φ|": float(np.abs(values).mean()), "largest |φ|": float(np.abs(values).max())})
    picture = new_figure(7, 6)
    draw_surface(field, picture.add_subplot(), sources, view=np.array([0.75, -0.75, 0.45]))
    page.draw(picture)


@figure("10", "Level set constraints")
def level_set_constraints(page: Page) -> None:
    """Three concentric circles, given as partial level sets of one distance: constant along each is right, zero along
    all contradicts the distance. *Spread* is the largest difference of φ along one circle, *slope error* the mean of
    |1 − |∇φ||.
    """
    mesh = shapes.flat_disk(3000)
    curves = [shapes.placed(mesh, circle(radius)) for radius in (0.6, 1.0, 1.5)]
    solver = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False)
    picture = new_figure(15, 4.4)
    constraints = {
        "none": sh.constraints.Free(),
        "zero on all": sh.constraints.ZeroSet(),
        "constant on each": sh.constraints.EachComponent(),
    }
    for k, (name, constraint) in enumerate(constraints.items()):
        field = solver.distance(curves, constraint)
        spread = max(float(np.ptp(field(curve))) for curve in curves)
        slope = float(np.mean(np.abs(1 - np.linalg.norm(field.cell_gradients, axis=1))))
        page.add(constraint=name, spread=spread, **{"slope error": slope})
        axes = picture.add_subplot(1, 3, k + 1)
        draw_surface(field, axes, curves, view=FROM_ABOVE)
        axes.set_title(name)
    page.draw(picture)


@figure("11", "Soft constraints at crossings")
def soft_constraints(page: Page) -> None:
    """A curve that crosses itself cannot be a zero set with normals along it: a soft constraint keeps φ near zero with
    less distortion than a hard one. Default is `ZeroSet()`, soft `Soft(1 / h)`.
    """
    mesh = shapes.flat_disk(3000)
    t = np.linspace(0, 2 * np.pi, 160, endpoint=False)
    eight = sh.Polyline(np.stack([1.2 * np.sin(t), 0.75 * np.sin(2 * t)], axis=1), True)
    curve = shapes.placed(mesh, eight)
    solver = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False)
    spacing = shapes.mean_edge(mesh)
    constraints = {
        "none": sh.constraints.Free(),
        "exact": sh.constraints.ZeroSet(hard=True),
        "default": sh.constraints.ZeroSet(),
    }
    constraints["soft"] = sh.constraints.Soft(1 / spacing)
    picture = new_figure(20, 4.4)
    for k, (name, constraint) in enumerate(constraints.items()):
        field = solver.distance(curve, constraint)
        slope = float(np.mean(np.abs(1 - np.linalg.norm(field.cell_gradients, axis=1))))
        page.add(constraint=name, **{"mean |φ| on the curve": float(np.abs(field(curve)).mean()), "slope error": slope})
        axes = picture.add_subplot(1, 4, k + 1)
        draw_surface(field, axes, [curve], view=FROM_ABOVE)
        axes.set_title(name)
    page.draw(picture)


@figure("12-14", "Curves that bound nothing")
def curves_that_bound_nothing(page: Page) -> None:
    """A loop around the tube of a torus, one around its hole, and an equator whose halves face against each other: φ
    jumps across the shortest cut (Eq. 16). That of the first is a meridian, 2π · 0.4 = 2.51.
    """
    ring, ball = samples.torus(n_around=96, n_across=40), samples.sphere(4)
    half = np.linspace(0, np.pi, 60)
    equator = [ball.polyline(np.stack([np.cos(half), side * np.sin(half), 0 * half], axis=1)) for side in (1, -1)]
    cases = {
        "around the tube": (ring, [ring.path(np.arange(40), closed=True)]),
        "around the hole": (ring, [ring.path(np.arange(96) * 40 + 6, closed=True)]),
        "halves against each other": (ball, equator),
    }
    picture = new_figure(15, 4.6)
    for k, (name, (mesh, curves)) in enumerate(cases.items()):
        continuous = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(curves, sh.constraints.Free())
        field = sh.piecewise_distance(curves, mesh)
        slopes = [
            float(np.mean(np.abs(1 - np.linalg.norm(gradient, axis=1))))
            for gradient in (continuous.cell_gradients, field.expand().cell_gradients)
        ]
        page.add(
            curve=name,
            **{"length of the cut": float(sum(part.length for part in field.domain.cuts(field.values)))},
            **{"slope error, continuous": slopes[0], "piecewise": slopes[1]},
        )
        axes = picture.add_subplot(1, 3, k + 1)
        view = np.array([0.2, -0.8, 0.7]) if mesh is ring else np.array([0.9, 0.3, 0.5])
        draw_surface(field, axes, curves, view=view)
        axes.set_title(name)
    page.draw(picture)


@figure("17", "Failing gracefully")
def failing_gracefully(page: Page) -> None:
    """One closed curve on a bumpy sphere, damaged more and more. The last column is a baseline that nobody can have:
    exact distance to what is left, with the true sign.
    """
    mesh = shapes.subdivided(shapes.organic(4, 700), 1)
    heights = shapes.height(mesh.vertices, 4)
    solver = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False)
    whole = mesh.level_set(heights, 0.0)
    exact = sh.sharpen(solver.distance(whole)).values
    weights = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3, 3), mesh.n_vertices)
    rng = np.random.default_rng(0)
    spacing = shapes.mean_edge(mesh)
    cases: dict[str, list[sh.Curve]] = {"whole": whole}
    for lost in (0.2, 0.5, 0.8):
        cases[f"{lost:.0%} gone"] = shapes.pieces(mesh, heights, lost, 1)
    for jitter in (1, 3):
        moved = [mesh.level_set(heights + jitter * spacing * rng.normal(), 0.0) for _ in range(3)]
        cases[f"copies shifted by {jitter} h"] = [curve for some in moved for curve in some]
    parts = shapes.pieces(mesh, heights, 0.2, 2)
    for turned in (0.1, 0.3):
        flip = rng.random(len(parts)) < turned
        flip[0] |= not flip.any()
        cases[f"{flip.sum()} of {len(parts)} pieces flipped"] = [
            sh.Curve(c.faces[::-1], c.barycentric[::-1]) if f else c for c, f in zip(parts, flip, strict=True)
        ]
    picture = new_figure(15, 8)
    for k, (name, curves) in enumerate(cases.items()):
        field = solver.distance(curves)
        found = {
            "heat ε %": field.values,
            "signed_distance ε %": sh.signed_distance(curves, mesh).values,
            "exact to what is left, true sign ε %": np.copysign(baselines.to_curves(mesh, curves), exact),
        }
        page.add(damage=name, **{way: baselines.error(values, exact, weights) for way, values in found.items()})
        axes = picture.add_subplot(2, 4, k + 1)
        draw_surface(field, axes, curves, view=np.array([0.3, -1.0, 0.25]))
        axes.set_title(name)
    page.draw(picture)


@figure("21", "Curves drawn on a surface of higher genus")
def drawn_on_higher_genus(page: Page) -> None:
    """Strokes around a torus with bumps, with gaps and overlaps, completed to closed curves (`sh.close_curves`).
    Triangles refined in another order give 0.11 to 0.18 h.
    """
    mesh = shapes.subdivided(shapes.organic(3, 500, handles=1), 1)
    heights = shapes.height(mesh.vertices, 3)
    strokes = shapes.pieces(mesh, heights, 0.4, 5)
    closed = sh.close_curves(strokes, mesh)
    solver = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False)
    exact = sh.sharpen(solver.distance(mesh.level_set(heights, 0.0)))
    away = np.concatenate([np.abs(exact(curve)) for curve in closed])
    spacing = shapes.mean_edge(mesh)
    page.add(
        strokes=len(strokes),
        **{"closed curves": len(closed), "all closed": all(curve.closed for curve in closed)},
        **{"mean distance from the whole curve, in h": float(away.mean() / spacing)},
    )
    picture = new_figure(12, 5)
    for k, (name, curves) in enumerate({"strokes": strokes, "closed": closed}.items()):
        axes = picture.add_subplot(1, 2, k + 1)
        draw_surface(solver.distance(strokes), axes, curves, view=np.array([0.3, -0.6, 0.8]))
        axes.set_title(name)
    page.draw(picture)


@figure("22", "Intrinsic triangulations")
def intrinsic_triangulations(page: Page) -> None:
    """A disk of slivers, made in a plane stretched more and more: ε of the distance from a circle, on the mesh as it
    is and on an intrinsic Delaunay refinement of it, whose largest triangles are limited. Means of eight meshes.
    """
    picture = new_figure(12, 5)
    for stretch in (1.0, 4.0, 10.0, 25.0):
        errors: dict[str, list[float]] = {"as it is ε %": [], "refined ε %": []}
        for seed in range(8):
            mesh, curve = sheared_square(1200, stretch, seed)
            exact = np.linalg.norm(mesh.vertices[:, :2], axis=1) - 0.55
            fields = {
                "as it is": sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(curve, sh.constraints.Free()),
                "refined": sh.SignedHeatSolver(mesh, 1.0, intrinsic=True).distance(curve, sh.constraints.Free()),
            }
            for name, field in fields.items():
                errors[f"{name} ε %"].append(baselines.error(field.restrict().values, exact))
        page.add(stretch=f"{stretch:g}", **{name: float(np.mean(of)) for name, of in errors.items()})
    for k, (name, field) in enumerate(fields.items()):
        axes = picture.add_subplot(1, 2, k + 1)
        draw_surface(field, axes, [curve], view=FROM_ABOVE)
        axes.set_title(f"stretched {stretch:g} times, {name}")
    page.draw(picture)


def sheared_square(n: int, stretch: float, seed: int) -> tuple[sh.TriangleMesh, sh.Curve]:
    """A square whose vertices are joined as if it were `stretch` times as wide, and a circle on it."""
    inner = np.random.default_rng(seed).uniform(-0.98, 0.98, (n, 2))
    side = np.linspace(-1, 1, 24)
    points = np.unique(
        np.concatenate([inner, np.reshape([[(x, s), (s, x)] for x in side for s in (-1, 1)], (-1, 2))]), axis=0
    )
    mesh = flat(points, stretch)
    return mesh, shapes.placed(mesh, circle(0.55))
