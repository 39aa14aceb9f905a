"""What people get by default: distance that is exact where the shape is there, and completed where it is missing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal, overload

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..constraints import Constraint
from ..diagnostics import Diagnostics, LeftOut, Note, OrientedPoints, SharpenedToShape
from ..discretization import discretize
from ..domains.grid import Grid
from ..domains.kinds import ShapeLike
from ..domains.point_cloud import PointCloud
from ..domains.tet_mesh import TetMesh
from ..domains.validation import positive_number
from ..errors import CancellingNormalsError, UnsupportedTypeError
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..fields.tet_field import TetField
from ..fields.to_field import sampled
from ..lowering.area_elements import AreaSamples, bounds_around, sample_on_grid
from ..lowering.grid.source import GridSource
from ..method import diffuse, integrate, normalize
from ..operators.grid.fitted_points import mean_gap
from ..operators.grid.line_winding import closed_winding_numbers
from ..progress import Progress, Stopwatch, within
from ..solver import SignedHeatSolver, checked
from .band_grids import coarse_grid
from .bands import band_around
from .exact_uniting import Overlaps, exactly_without_covered, overlaps_of
from .face_density import as_if_whole
from .inside import Sides, closed_sides
from .joining import Shape, joined_shape
from .orientation import orientation
from .point_orientation import orient_points
from .restoring import as_found, restored
from .shape_sharpening import Assembled, Fit, assemble, triangles_of
from .shape_sides import sides_of_shape
from .sharpening import sharpen
from .sides import FAR
from .solid_memory import refuse_even_if_closed, refuse_if_open
from .steps import Steps
from .thin_walls import telling_at, with_thin_walls
from .uniting import SAMPLE_SIZE, Merged, merge_duplicates, union_of, without_covered, wound

STEPS = 7
"""Steps that are timed."""
GAPS = 1.5
"""Mean gaps between points, besides `FAR` cells, within which φ tells the sides of a cloud."""


@overload
def solid_distance(
    shape: ShapeLike | Sequence[ShapeLike],
    domain: Grid | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    plain: bool = False,
    progress: Progress | None = None,
) -> GridField: ...
@overload
def solid_distance(
    shape: ShapeLike | Sequence[ShapeLike],
    domain: Grid | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    band: float,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    progress: Progress | None = None,
) -> BandField: ...
@overload
def solid_distance(
    shape: ShapeLike | Sequence[ShapeLike],
    domain: TetMesh,
    *,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    plain: bool = False,
    progress: Progress | None = None,
) -> TetField: ...
def solid_distance(
    shape: ShapeLike | Sequence[ShapeLike],
    domain: Grid | TetMesh | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    band: float | None = None,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    plain: bool = False,
    progress: Progress | None = None,
) -> GridField | TetField | BandField:
    """Signed distance to a solid: to the shape where it is there, to what completes it where surface is missing.

    Orient the shape, put back faces that it lost between vertices which are there, unite its bodies, compute its
    generalized signed distance φ, decide what is inside, and measure distance anew: to the faces, exactly, and to those
    parts of the completed surface that stand in for what is missing.
    Around open sheets that bound nothing distance is positive on both sides.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud or TetMesh; or several meshes
        Broken or not; points with normals or without. Objects of trimesh, PyVista, meshio and Open3D and pairs
        (vertices, faces) are taken wherever a shape is.
    domain : Grid or TetMesh, optional
        Where to measure; by default a grid of cubic cells around the shape.
    resolution : int
        Nodes along the longest side of that grid.
    spacing : float or (3,) float, optional
        Distance between its nodes, in place of `resolution`.
    padding : float, optional
        Room around the shape, in its units; by default a fifth of its longest side.
    band : float, optional
        Compute nodes of the grid only where distance is at most this, in units of length, and a coarse grid elsewhere:
        for grids that are too fine to be computed whole.
    constraint : Free, ZeroSet, EachComponent, LevelValues or Soft, optional
        What is imposed on φ at the faces; `ZeroSet` by default.
    diffusion : float
        τ in ``t = τ h²``.
    as_oriented : bool
        Take faces as they are, whichever way they face, and put back none that were lost.
    keep_overlaps : bool
        Count what lies inside other bodies as surface.
    plain : bool
        Return φ as the method gives it: no distance to the shape itself, no choice of sides.
    progress : callable, optional
        Called as ``progress(fraction, step)``; what it raises cancels.

    Returns
    -------
    GridField or TetField; BandField with a `band`
        φ < 0 inside. ``diagnostics.notes`` tells what was done, where there is something to tell: `ShapeOriented` or
        `OrientedPoints`, `FacesRestored`, `LeftOut`, `CompletedArea`, `ReachesBox`, `BoundsNothing`.

    Raises
    ------
    SourceError
        If the shape cannot be a source, for instance points without normals, or does not fit the domain.
    GeometryError
        If resolution, spacing or padding make no grid.
    MemoryLimitError
        If the grid cannot fit in memory; nothing has been allocated then.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball, other = samples.sphere(3), samples.sphere(3, center=(1.0, 0, 0))
    >>> field = solid_distance(samples.union(ball, other), resolution=32)
    >>> bool(np.abs(field([[0.5, 0, 0]]) + np.sqrt(0.75)) < 0.05)
    True
    """
    solid = joined_shape(shape)
    if domain is None:
        bounds = bounds_around([solid])
        domain = Grid.around(bounds, resolution, padding, spacing)
    diffusion = positive_number(diffusion, "diffusion")
    steps = Steps(not as_oriented, not keep_overlaps, not plain, checked(constraint), diffusion)
    if band is not None:
        if not isinstance(domain, Grid) or domain.dimension != 3 or domain.mask is not None or plain:
            raise UnsupportedTypeError(
                "a band is computed around solids, on a grid in space without walls", remedy="leave out the band"
            )
        coarse = coarse_distance(solid, domain, steps, within(progress, 0.0, 0.5))
        return band_around(coarse, domain, band, within(progress, 0.5, 1.0))
    if isinstance(domain, Grid) and domain.dimension == 3 and domain.mask is None:
        return _on_grid(solid, domain, steps, progress)
    return _elsewhere(solid, domain, steps, progress)


def coarse_distance(shape: Shape, domain: Grid, steps: Steps, progress: Progress | None) -> GridField:
    """Distance on the coarse grid of a band; cells of its size do not tell thin walls from layers of noise."""
    return _on_grid(shape, coarse_grid(domain), replace(steps, finest=float(domain.spacing.min())), progress)


def _oriented(shape: Shape, steps: Steps, notes: list[Note]) -> tuple[Merged, bool]:
    """The shape as `orient` leaves it, which knows its duplicates, and whether it is closed; points get normals.

    Faces that it lost are put back where distance is measured to faces: the method completes by itself.
    """
    if isinstance(shape, PointCloud):
        oriented = orient_points(shape)
        notes.append(OrientedPoints(oriented.n_fitted, oriented.n_turned))
        return merge_duplicates(oriented.cloud), False
    found = orientation(shape)
    whole = restored(found) if steps.sharpen else as_found(found)
    notes += [note for note in (found.note, whole.note) if note is not None]
    return Merged(whole.shape, whole.walls, 0, whole.restored), whole.closed


def _elsewhere(shape: Shape, domain: Grid | TetMesh, steps: Steps, progress: Progress | None) -> GridField | TetField:
    """On tets, and on grids with solid nodes: the method, and distance to the shape where that can be."""
    notes: list[Note] = []
    if steps.orient:
        shape = _oriented(shape, steps, notes)[0].shape
    if steps.unite and not isinstance(domain, Grid):
        united = union_of(shape)
        shape = united.shape
        notes.append(united.left_out)
    phi = SignedHeatSolver(domain, steps.diffusion, progress).distance(shape, steps.constraint)
    if not isinstance(phi, GridField | TetField):
        kind = type(domain).__name__
        raise UnsupportedTypeError(f"a solid is measured on a Grid or a TetMesh, not on a {kind}", element="domain")
    if steps.sharpen and not (isinstance(domain, Grid) and domain.mask is not None):
        phi = sharpen(phi) if isinstance(shape, PointCloud) or isinstance(phi, GridField) else sharpen(phi, shape)
    return replace(phi, diagnostics=phi.diagnostics.noting(*notes))


def _on_grid(shape: Shape, grid: Grid, steps: Steps, progress: Progress | None) -> GridField:
    """Each step, timed, on a grid in space."""
    notes: list[Note] = []
    stopwatch = Stopwatch(progress, STEPS)
    refuse_even_if_closed(shape, grid, steps)
    with stopwatch("orient"):
        merged, closed = _oriented(shape, steps, notes) if steps.orient else (merge_duplicates(shape), False)
    overlaps = overlaps_of(merged, grid, steps.finest) if steps.unite else None
    if closed and steps.sharpen:
        field = _bounded(merged, grid, steps, overlaps, notes, stopwatch)
        if field is not None:
            return field
    refuse_if_open(merged.shape, grid, steps)
    discretization = discretize(grid)
    with stopwatch("unite"):
        merged, samples, winding = _united(merged, grid, steps, overlaps, notes)
        del overlaps
    if samples is None:  # doubled walls alone: there is no φ
        phi, time = None, float("nan")
    else:
        source = GridSource(samples, grid, steps.diffusion)
        notes.append(sampled(source))
        with stopwatch("diffuse"):
            vectors = diffuse(discretization, source)
        with stopwatch("normalize"):
            directions = normalize(discretization, vectors)
            del vectors
        with stopwatch("integrate"):
            phi, time = integrate(discretization, directions, source, steps.constraint), source.time
            del directions
    if not steps.sharpen and phi is not None:
        return GridField(grid, phi, _diagnostics(notes, stopwatch, time))
    with stopwatch("sides"):
        share = 1.0
        if samples is not None and not closed:
            winding, samples, share = as_if_whole(winding, samples)
        cell = float(grid.spacing.max())
        sides = closed_sides(winding, cell) if closed else sides_of_shape(merged.shape, phi, winding, samples, grid)
        known = None if phi is None else _known(phi) if closed else sides.phi
        del phi
    with stopwatch("sharpen"):
        sharpened = _sharpened(merged, known, sides, closed, winding, share, grid, steps)
    notes += [note for note in (sides.completed, sides.reaches_box, sides.bounds_nothing) if note is not None]
    return _solid(sharpened, grid, notes, stopwatch, time)


def _bounded(
    merged: Merged, grid: Grid, steps: Steps, overlaps: Overlaps | None, notes: list[Note], stopwatch: Stopwatch
) -> GridField | None:
    """A shape whose parts are all closed, and do not overlap: there is nothing to complete, and lines tell its inside.

    None if it is not so. φ is needed where its faces lie in layers, only.
    """
    shape = merged.shape
    if isinstance(shape, PointCloud) or not shape.triangulation.face_areas.any():
        return None
    with stopwatch("unite"):
        vertices, faces = triangles_of(shape)
        winding = closed_winding_numbers(((vertices - grid.origin) / grid.spacing)[faces], grid.shape)
        if winding is None or (steps.unite and winding.max() > 1):
            return None
        if overlaps is not None and overlaps.of_faces.any():  # between the nodes
            return None
    if merged.count:
        notes.append(LeftOut(merged_faces=merged.count))
    if not grid.contains(shape.bounds).all():
        notes.append(sampled(GridSource(sample_on_grid([shape], grid, SAMPLE_SIZE), grid, steps.diffusion)))
    cell = float(grid.spacing.max())
    function = np.where(winding > 0, -cell, cell)
    del winding

    def phi() -> NDArray[np.float64]:
        try:
            source = GridSource(sample_on_grid([shape], grid, SAMPLE_SIZE), grid, steps.diffusion)
        except CancellingNormalsError:
            return function
        discretization = discretize(grid)
        directions = normalize(discretization, diffuse(discretization, source))
        return integrate(discretization, directions, source, steps.constraint)

    stopwatch.skip(4)
    with stopwatch("sharpen"):
        sharpened = _closed(assemble([shape], grid, function, steps.fit, phi, restored=merged.restored), steps)
    return _solid(sharpened, grid, notes, stopwatch, float("nan"))


def _solid(sharpened: Assembled, grid: Grid, notes: list[Note], stopwatch: Stopwatch, time: float) -> GridField:
    notes.append(SharpenedToShape(sharpened.layered, sharpened.completed))
    diagnostics = _diagnostics(notes, stopwatch, time)
    return GridField(grid, sharpened.values, diagnostics, sharpened.confidence, sharpened.surface)


def _diagnostics(notes: list[Note], stopwatch: Stopwatch, time: float) -> Diagnostics:
    return Diagnostics(timings=dict(stopwatch.seconds), time=time, notes=tuple(notes))


def _sharpened(
    merged: Merged,
    phi: Callable[[], NDArray[np.float64]] | None,
    sides: Sides,
    closed: bool,
    winding: NDArray[np.float64],
    share: float,
    grid: Grid,
    steps: Steps,
) -> Assembled:
    """Distance to the shape, of whose surface a share is there; faces beside which nothing is solid tell no sides."""
    shape = merged.shape
    if isinstance(shape, PointCloud) and phi is not None:  # no faces: φ is fitted to the points
        return assemble([shape], grid, _guarded(phi(), sides, shape, grid), "auto")
    if phi is not None and closed:
        return _closed(assemble([shape], grid, sides.function, steps.fit, phi, restored=merged.restored), steps)
    refused = _widened(sides.refused)

    def accepted() -> NDArray[np.float64]:
        given = sides.phi()
        np.copyto(given, sides.function, where=refused)
        return given

    layers: Fit | Literal["alone"] = "auto"
    if sides.open_sheets:  # layers of sheets are no noise
        layers = "exact" if sides.bounds_nothing else "alone"
    given = None if phi is None else accepted
    tells = telling_at(winding, refused)
    assembled = assemble([shape], grid, sides.function, layers, given, tells, merged.restored)
    if steps.finest is None:
        return assembled
    return replace(assembled, surface=with_thin_walls(assembled.surface, refused, share))


def _closed(assembled: Assembled, steps: Steps) -> Assembled:
    """The distance to closed bodies: bands may rely on it where no faces lie in layers."""
    if steps.finest is None or assembled.layered:
        return assembled
    return replace(assembled, surface=replace(assembled.surface, closed=True))


def _guarded(phi: NDArray[np.float64], sides: Sides, cloud: PointCloud, grid: Grid) -> NDArray[np.float64]:
    """φ of points, without the solids that it invents: farther from points than the gaps between them, sides tell."""
    doubtful = (phi < 0) != sides.inside
    if not doubtful.any():
        return phi
    nodes = np.argwhere(doubtful)
    reach = GAPS * mean_gap(cloud.points) + FAR * float(grid.spacing.max())
    away, _ = scipy.spatial.cKDTree(cloud.points).query(grid.origin + nodes * grid.spacing, workers=-1)
    doubtful[tuple(nodes[away <= reach].T)] = False
    return np.where(_widened(doubtful), sides.function, phi)


def _known(phi: NDArray[np.float64]) -> Callable[[], NDArray[np.float64]]:
    return lambda: phi


def _widened(nodes: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Nodes and the two layers around them."""
    return np.asarray(scipy.ndimage.binary_dilation(nodes, iterations=2)) if nodes.any() else nodes


def _united(
    merged: Merged, grid: Grid, steps: Steps, overlaps: Overlaps | None, notes: list[Note]
) -> tuple[Merged, AreaSamples | None, NDArray[np.float64]]:
    """The shape, its samples and its winding numbers, without what lies inside other bodies."""
    samples, winding = wound(merged.shape, grid)
    if not steps.unite:
        return merged, samples, winding
    united = without_covered(merged, winding, grid) if overlaps is None else exactly_without_covered(overlaps)
    if united.left_out.merged_faces or united.left_out.covered_faces:
        notes.append(united.left_out)
    is_same = united.shape is merged.shape
    return (merged, samples, winding) if is_same else (merged.without(united), *wound(united.shape, grid))
