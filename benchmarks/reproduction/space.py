"""Figures in the plane and in space, on grids and tets."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import signedheat as sh
from signedheat import samples
from signedheat.view import draw_plane, draw_shape, new_figure

from . import baselines, shapes
from .pages import Page, figure

Array = NDArray[np.float64]
SIDE = 161


def plane(half: float = 2.0, side: int = SIDE) -> sh.Grid:
    return sh.Grid((-half, -half), 2 * half / (side - 1), (side, side))


def exact_in_plane(grid: sh.Grid, line: sh.Polyline) -> Array:
    """Signed distance to a closed clockwise curve, negative inside."""
    points = grid.points.reshape(-1, 2)
    distance, _, _ = baselines.to_segments(points, [line])
    return distance * np.where(baselines.planar_winding(points, [line]) > 0.5, -1.0, 1.0)


def to_duck(points: Array) -> Array:
    """Unsigned distance to the whole duck, exactly: to what bounds the union of its two bodies."""
    union = trimesh.boolean.union(samples.duck().to_trimesh().split(), engine="manifold")
    return baselines.to_faces(points, sh.TriangleMesh.from_trimesh(union))


def scanned_duck() -> sh.TriangleMesh:
    """The duck with holes and noise."""
    return samples.with_noise(samples.without_patches(samples.duck(), 8, 0.2), 0.006)


def n_parts(mesh: sh.TriangleMesh) -> int:
    """Number of connected components."""
    tails, heads = mesh.edges.vertices.T
    graph = coo_matrix((np.ones(len(tails)), (tails, heads)), (mesh.n_vertices, mesh.n_vertices))
    return len(np.unique(connected_components(graph)[1][np.unique(mesh.faces)]))


@figure("3", "Completed surfaces")
def completed_surfaces(page: Page) -> None:
    """Generalized winding numbers (GWN) and generalized signed distance (GSD) complete a noisy surface with holes. GWN
    jumps at every face and follows the noise; GSD may interpolate (`ZeroSet`) or approximate (`Free`). Deviation of
    the completed vertices from the whole duck, in per cent of its length.
    """
    broken = scanned_duck()
    grid = sh.Grid.around(broken.bounds, resolution=72, padding=0.3)
    winding = baselines.solid_winding(grid.points.reshape(-1, 3), broken).reshape(grid.shape)
    fields = {
        "GWN, level ½": sh.Field(grid, 0.5 - winding),
        "GSD, interpolating": sh.SignedHeatSolver(grid).distance(broken, sh.constraints.ZeroSet()),
        "GSD, approximating": sh.SignedHeatSolver(grid).distance(broken, sh.constraints.Free()),
    }
    picture = new_figure(15, 4.2)
    draw_shape(broken, picture.add_subplot(1, 4, 1))
    for k, (name, field) in enumerate(fields.items()):
        surface = field.contour(0.0)
        axes = picture.add_subplot(1, 4, k + 2)
        draw_shape(surface, axes)
        axes.set_title(name)
        deviation = 100 * np.sqrt(np.mean(to_duck(surface.vertices) ** 2)) / 2
        page.add(method=name, **{"deviation %": float(deviation)}, parts=n_parts(surface))
    page.draw(picture)


@figure("4-19", "Offsets of badly broken surfaces")
def offsets_of_broken_surfaces(page: Page) -> None:
    """The duck has holes, noise, flipped and duplicate faces. Error of an offset: root mean square difference between
    exact distance from the whole duck and the level, in per cent of its length. The last rows sign exact distance
    by winding numbers.
    """
    broken = samples.broken_duck()
    grid = sh.Grid.around(broken.bounds, resolution=80, padding=0.45)
    points = grid.points.reshape(-1, 3)
    winding = baselines.solid_winding(points, broken)
    signed = baselines.to_faces(points, broken) * np.where(winding > 0.5, -1, 1)
    fields = {
        "method alone": sh.SignedHeatSolver(grid).distance(broken),
        "sh.signed_distance": sh.signed_distance(broken, grid),
        "winding sign × exact distance": sh.Field(grid, signed.reshape(grid.shape)),
    }
    picture = new_figure(15, 4.2)
    draw_shape(broken, picture.add_subplot(1, 4, 1))
    for k, (name, field) in enumerate(fields.items()):
        for level in (0.1, 0.3):
            surface = field.contour(level)
            away = 100 * np.sqrt(np.mean((to_duck(surface.vertices) - level) ** 2)) / 2
            closed = bool((surface.edges.face_counts == 2).all())
            bodies = n_parts(surface)
            page.add(method=name, level=level, **{"error %": float(away)}, closed=closed, bodies=bodies)
        axes = picture.add_subplot(1, 4, k + 2)
        draw_shape(field.contour(0.1), axes)
        axes.set_title(f"{name}: level 0.1")
    page.draw(picture)


@figure("5", "From linear to harmonic completion")
def diffusion_times(page: Page) -> None:
    """For a short time φ continues a curve straight, as pseudonormals do; the longer the time, the rounder. Areas by
    which the completed shape differs from others, in per cent of the whole shape's area. We do not find winding
    numbers as the limit for long times.
    """
    lines, grid = shapes.broken_blob(gaps=3, share=0.45), plane()
    points = grid.points.reshape(-1, 2)
    straight = baselines.pseudonormal_distance(points, lines) < 0
    harmonic = baselines.planar_winding(points, lines) > 0.5
    whole = exact_in_plane(grid, shapes.blob()) < 0
    picture = new_figure(15, 4.2)
    for k, diffusion in enumerate((1.0, 30.0, 1000.0)):
        field = sh.SignedHeatSolver(grid, diffusion=diffusion).distance(lines)
        inside = field.values.ravel() < 0
        share = [100 * float(np.mean(inside ^ other) / np.mean(whole)) for other in (straight, harmonic, whole)]
        names = ("from pseudonormals %", "from winding numbers %", "from the whole shape %")
        page.add(**{"t / h²": f"{diffusion:g}"}, **dict(zip(names, share, strict=True)))
        axes = picture.add_subplot(1, 3, k + 1)
        draw_plane(field, axes, lines)
        axes.set_title(f"t = {diffusion:g} h²")
    page.draw(picture)


@figure("6", "Signing unsigned distance is not enough")
def signing_unsigned_distance(page: Page) -> None:
    """Level sets of signed unsigned distance wrap around every gap, and its sign tears. ε against the whole curve:
    with few small gaps the baselines are as good in the mean, with wide gaps they are not.
    """
    grid = plane()
    points = grid.points.reshape(-1, 2)
    exact = exact_in_plane(grid, shapes.blob())
    picture = new_figure(13, 5)
    for gaps, share in ((5, 0.2), (5, 0.35), (3, 0.5), (2, 0.6)):
        lines = shapes.broken_blob(gaps, share)
        distance, _, _ = baselines.to_segments(points, lines)
        signed = distance * np.where(baselines.planar_winding(points, lines) > 0.5, -1, 1)
        field = sh.SignedHeatSolver(grid).distance(lines)
        ways = {
            "winding sign": signed,
            "pseudonormal sign": baselines.pseudonormal_distance(points, lines),
            "GSD": field.values.ravel(),
            "GSD, sharpened": sh.sharpen(field).values.ravel(),
        }
        errors = {f"{name} ε %": baselines.error(values, exact) for name, values in ways.items()}
        page.add(input=f"{gaps} gaps, {share:.0%} gone", **errors)
    for k, (name, values) in enumerate({"unsigned distance × winding sign": signed, "GSD": ways["GSD"]}.items()):
        axes = picture.add_subplot(1, 2, k + 1)
        draw_plane(sh.Field(grid, values.reshape(grid.shape)), axes, lines)
        axes.set_title(name)
    page.draw(picture)


@figure("18", "Joins of strokes")
def joins_of_strokes(page: Page) -> None:
    """The sides of a letter, cut short at its corners: sharp joins for a short time, round ones for a long time. Cut:
    how far the outline passes from the letter's corner.
    """
    corners = np.array(
        [[0, 0], [0, 5], [3, 5], [3, 4], [1, 4], [1, 3], [2.5, 3], [2.5, 2], [1, 2], [1, 0]], dtype=float
    )
    ends = np.roll(corners, -1, axis=0)
    along = (ends - corners) / np.linalg.norm(ends - corners, axis=1, keepdims=True)
    sides = [sh.Polyline([a + 0.3 * t, b - 0.3 * t]) for a, b, t in zip(corners, ends, along, strict=True)]
    picture = new_figure(15, 6)
    for k, diffusion in enumerate((1.0, 10.0, 100.0)):
        field = sh.SignedHeatSolver(sh.Grid.around(sides, 140, padding=0.8), diffusion=diffusion).distance(sides)
        outline = max(field.contour(0.0), key=lambda line: line.length)
        page.add(
            **{"t / h²": f"{diffusion:g}"},
            cut=float(np.linalg.norm(outline.points - corners[1], axis=1).min()),
            **{"area (8.5)": float(abs(outline.signed_area))},
        )
        axes = picture.add_subplot(1, 3, k + 1)
        draw_plane(field, axes, sides)
        axes.set_title(f"t = {diffusion:g} h²")
    page.draw(picture)


@figure("20", "Simplified by offsets")
def simplified_by_offsets(page: Page) -> None:
    """Closing fills narrow gaps and opening removes thin parts of broken shapes as if they were whole. Area of the
    result, and its distance from the whole duck's surface.
    """
    broken = samples.broken_duck()
    grid = sh.Grid.around(broken.bounds, resolution=72, padding=0.6)
    results = {
        "closing by 0.15": sh.morphology.closing(broken, 0.15, grid),
        "opening by 0.1": sh.morphology.opening(broken, 0.1, grid),
    }
    picture = new_figure(13, 4.2)
    draw_shape(broken, picture.add_subplot(1, 3, 1))
    area = float(samples.duck().face_areas.sum())
    for k, (name, surface) in enumerate(results.items()):
        change = 100 * float(surface.face_areas.sum()) / area - 100
        farthest = float(to_duck(surface.vertices).max())
        closed = bool((surface.edges.face_counts == 2).all())
        page.add(operation=name, closed=closed, **{"area %": f"{change:+.1f}"}, **{"farthest from the duck": farthest})
        axes = picture.add_subplot(1, 3, k + 2)
        draw_shape(surface, axes)
        axes.set_title(name)
    page.draw(picture)


@figure("26", "Broken geometry on tets")
def broken_geometry_on_tets(page: Page) -> None:
    """GWN and GSD at the vertices of one tet mesh, against exact distance to the whole duck, whose beak and head are
    united: winding sign × exact distance to what is there measures to the walls inside, too.
    """
    duck = samples.duck()
    for name, broken in (
        ("8 holes, noise", scanned_duck()),
        ("30 % of the faces missing", samples.without_faces(duck, 0.3)),
        ("10 % of the faces flipped", samples.with_flipped_faces(duck, 0.1)),
    ):
        mesh = sh.tetrahedralize(broken, resolution=24)
        points = mesh.vertices
        inside = baselines.solid_winding(points, duck) > 0.5
        exact = to_duck(points) * np.where(inside, -1, 1)
        near = baselines.to_faces(points, broken)
        signed = near * np.where(baselines.solid_winding(points, broken) > 0.5, -1, 1)
        field = sh.SignedHeatSolver(mesh).distance(broken)
        page.add(
            input=name,
            tets=mesh.n_tets,
            **{"GSD ε %": baselines.error(field.values, exact)},
            **{"sharpened ε %": baselines.error(sh.sharpen(field).values, exact)},
            **{"solid distance ε %": baselines.error(sh.signed_distance(broken, mesh).values, exact)},
            **{"GWN sign × distance ε %": baselines.error(signed, exact)},
        )
        if name.startswith("8 holes"):
            levels = {"GSD, level 0": field.contour(0.0), "level 0.15": field.contour(0.15)}
            sides = sh.Field(mesh, 0.5 - baselines.solid_winding(points, broken))
            picture = new_figure(15, 4.2)
            for k, (title, shape) in enumerate({name: broken, "GWN, level ½": sides.contour(0.0), **levels}.items()):
                axes = picture.add_subplot(1, 4, k + 1)
                draw_shape(shape, axes)
                axes.set_title(title)
            page.draw(picture)


@figure("27", "Completion that continues positions and normals")
def natural_completion(page: Page) -> None:
    """A sphere without a cap. Height of the completion over the plane of the rim: the cap's own is 0.25, straight
    extension gives 0.58. GSD continues positions and normals, GWN closes flat.
    """
    ball, rim = samples.sphere(5), 0.75
    centers = ball.vertices[ball.faces].mean(axis=1)
    cup = sh.TriangleMesh(ball.vertices, ball.faces[centers[:, 2] < rim])
    grid = sh.Grid.around(ball.bounds, resolution=96, padding=0.7)
    winding = baselines.solid_winding(grid.points.reshape(-1, 3), cup).reshape(grid.shape)
    fields = {"GWN, level ½": sh.Field(grid, 0.5 - winding)}
    for diffusion in (1.0, 10.0, 100.0):
        fields[f"GSD, t = {diffusion:g} h²"] = sh.SignedHeatSolver(grid, diffusion=diffusion).distance(cup)
    picture = new_figure(15, 4)
    for k, (name, field) in enumerate(fields.items()):
        surface = field.contour(0.0)
        near = np.linalg.norm(surface.vertices[:, :2], axis=1) < 0.1
        rise = float(surface.vertices[near, 2].max() - rim) if near.any() else float("nan")
        page.add(method=name, **{"height (0.25)": rise})
        axes = picture.add_subplot(1, 4, k + 1)
        middle = grid.shape[1] // 2
        cut = sh.Grid(grid.origin[[0, 2]], grid.spacing[[0, 2]], (grid.shape[0], grid.shape[2]))
        draw_plane(sh.Field(cut, field.values[:, middle]), axes)
        axes.set_title(name)
    page.draw(picture)
