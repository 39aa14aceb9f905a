"""Sample points with distances and gradients, as training data; and points on surfaces, as 3-D generators want them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import OutsideError, SignedHeatError, SourceError
from ..fields.field import Field
from ..grids.grid import Grid
from ..memory import refuse_beyond_memory
from ..mesh.triangles import bent_edges, face_areas
from ..mesh.unit_vectors import unit
from ..shapes.kinds import Shapes
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import finite_number, numbers, public_call, whole_number
from .completion import complete
from .sample_set import NOISE_WIDTHS, Samples

BYTES_PER_SAMPLE = 165
"""Peak memory per sample, including the search for its nearest face."""


@public_call
def sample_distances(
    shape: Field[Grid] | Shapes,
    n: int = 250_000,
    *,
    near: float = 0.8,
    widths: Sequence[float] = NOISE_WIDTHS,
    seed: int = 0,
) -> Samples:
    """Sample points with distances and gradients, near the surface of a shape and around it.

    Points near the surface are drawn uniformly on it and then moved by Gaussian noise along each axis. The others are
    uniform in the cube around the bounding sphere. Distances are exact (`Solid.closest`), not interpolated.

    Parameters
    ----------
    shape : Field, Solid or shape
        A shape, which is completed to a solid, or a solid, or a field on a grid that has one, such as those that
        `signed_distance` and ``sharpen(field, shape)`` return.
    n : int
        Number of points, 250,000 by default.
    near : float
        Fraction of the points that are drawn near the surface, from 0 to 1; 0.8 by default.
    widths : sequence of float
        Standard deviations of the noise, relative to the radius of the bounding sphere. Each is used for an equal
        number of points. By default 0.05 and 0.0158.
    seed : int
        Seed of the random numbers. The same seed gives the same points.

    Returns
    -------
    Samples
        Points, distances and gradients, with the centre and radius of the shape. Distances are in the units of the
        shape, and negative inside.

    Raises
    ------
    SourceError
        If the field does not hold its solid, because it was not sharpened to a shape or results from arithmetic.
    MemoryLimitError
        If the samples do not fit in memory.
    SignedHeatError
        If n is not positive, the seed or a width is negative, the fraction is not from 0 to 1, or there is no width for
        points near the surface.

    See Also
    --------
    Solid.sample : The same for a solid.
    results.Samples : Points with their distances.
    batches.run : Run a job on many shapes.
    torch.distance : Distances that PyTorch differentiates.

    Examples
    --------
    >>> from signedheat import samples, signed_distance
    >>> field = signed_distance(samples.without_faces(samples.sphere(3), 0.3), resolution=32)
    >>> drawn = sample_distances(field, 2000, near=0.5, widths=[0.1, 0.01], seed=7)
    >>> away = np.abs(drawn.distances - (np.linalg.norm(drawn.points, axis=1) - 1))
    >>> bool(np.quantile(away, 0.9) < 0.01 and away.max() < 0.1)
    True
    """
    n, scales, seed = refuse_odd_sampling(n, near, widths, seed)
    refuse_beyond_memory(f"{n} samples", n, lambda k: BYTES_PER_SAMPLE * k, lambda k: f"take {k} at a time")
    n_near = round(near * n)
    solid = shape.solid if isinstance(shape, Field) else complete(shape)
    if solid is None or solid.triangles.shape[-1] != 3:
        raise SourceError(
            "the field does not hold its solid",
            remedy="take it from signed_distance or Solid.field, or pass the solid",
            element="field",
        )
    triangles = solid.triangles
    if not len(triangles):
        raise OutsideError("the field has no zero set to sample", remedy="compute it on a finer grid", element="field")
    lower, upper = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    center = (lower + upper) / 2
    radius = float(np.linalg.norm(triangles - center, axis=2).max())
    random = np.random.default_rng(seed)
    points = np.empty((n, 3))
    ends = np.rint(np.linspace(0, n_near, len(scales) + 1)).astype(int)
    for start, stop, width in zip(ends[:-1], ends[1:], scales, strict=True):
        on_surface, _ = evenly_on(triangles, stop - start, random)
        points[start:stop] = on_surface + random.normal(scale=width * radius, size=on_surface.shape)
    points[n_near:] = center + radius * random.uniform(-1.0, 1.0, (n - n_near, 3))
    closest = solid.closest(points)
    is_near = np.arange(n) < n_near
    return Samples(points, closest.distances, closest.gradients, is_near, closest.completed, center, radius)


def refuse_odd_sampling(n: object, near: object, widths: object, seed: object) -> tuple[int, list[float], int]:
    """Return the number of samples, widths and seed of `sample_distances`; raise an error if one is out of range."""
    counts = whole_number(n, "n", 1, SignedHeatError), whole_number(seed, "seed", 0, SignedHeatError)
    share, scales = finite_number(near, "near"), np.atleast_1d(numbers(widths, "widths", SignedHeatError))
    if not 0 <= share <= 1:
        raise SignedHeatError(f"near must be a share from 0 to 1, not {share:g}", element="near")
    if share and not scales.size:
        raise SignedHeatError(
            "points near the surface need a width of noise", remedy="give widths, or near=0", element="widths"
        )
    return counts[0], [finite_number(width, "widths", least=0) for width in scales.ravel()], counts[1]


def evenly_on(triangles: Floats, n: int, random: np.random.Generator) -> tuple[Floats, Ints]:
    """Sample n points on (m, 3, 3) triangles, stratified by area: (n, 3) positions, and (n,) triangles they are on."""
    a, b, c = triangles.transpose(1, 0, 2)
    areas = np.cumsum(face_areas(triangles))
    marks = (np.arange(n) + random.random(n)) / max(n, 1) * areas[-1]
    faces = np.minimum(np.searchsorted(areas, marks, side="right"), len(triangles) - 1)
    u, v = random.random((2, n))
    over = u + v > 1
    u, v = np.where(over, 1 - u, u)[:, None], np.where(over, 1 - v, v)[:, None]
    a, b, c = a[faces], b[faces], c[faces]
    return a + u * (b - a) + v * (c - a), faces


SHARP_ANGLE = np.deg2rad(30.0)
"""Angle between two faces above which their edge is sharp."""


def training_points(
    surface: TriangleMesh, n: int, normalize: bool = False
) -> tuple[dict[str, NDArray[np.float32]], dict[str, NDArray[np.float32]]]:
    """Sample float32 training data from a closed surface: arrays of points on it, and of points around it.

    The first dict has (n, 6) positions and normals: ``random_surface`` uniform by area, ``sharp_surface`` along sharp
    edges. The second has (n, 3) points in the cube around the bounding sphere, ``vol_points``, and near the points of
    the first dict, ``random_near_points`` and ``sharp_near_points``. Their (n,) signed distances are named ``…_label``
    instead. With `normalize`, the surface is scaled to the unit sphere first.
    """
    random = np.random.default_rng(0)
    lower, upper = surface.bounds
    center = 0.5 * (lower + upper)
    radius = float(np.linalg.norm(surface.vertices - center, axis=1).max())
    if normalize:
        surface = TriangleMesh((surface.vertices - center) / radius, surface.faces)
        center, radius = np.zeros(3), 1.0
    solid = complete(surface, as_oriented=True)
    points_on, faces = evenly_on(surface.vertices[surface.faces], n, random)
    normals = unit(surface.face_area_vectors)[faces]
    on_surface = {"random_surface": (points_on, normals), "sharp_surface": _on_sharp_edges(surface, n, random)}
    around_surface = {"vol": center + radius * random.uniform(-1.0, 1.0, (n, 3))}
    for name, (middles, _) in zip(("random_near", "sharp_near"), on_surface.values(), strict=True):
        widths = radius * np.resize(NOISE_WIDTHS, len(middles))
        around_surface[name] = middles + widths[:, None] * random.normal(size=middles.shape)
    with_distances: dict[str, Floats] = {}
    for name, points in around_surface.items():
        with_distances |= {f"{name}_points": points, f"{name}_label": solid.distance(points)}
    single_precision = {name: np.concatenate(both, axis=1).astype(np.float32) for name, both in on_surface.items()}
    return single_precision, {name: values.astype(np.float32) for name, values in with_distances.items()}


def _on_sharp_edges(surface: TriangleMesh, n: int, random: np.random.Generator) -> tuple[Floats, Floats]:
    """(n, 3) points uniform along sharp edges, and (n, 3) mean unit normals there; empty if no edge is sharp."""
    _, normals, pairs = bent_edges(surface.vertices, surface.faces, SHARP_ANGLE)
    if not len(pairs):
        return np.zeros((0, 3)), np.zeros((0, 3))
    tails, heads = surface.vertices[surface.faces.ravel()[pairs]].swapaxes(0, 1)  # halfedges run opposite ways
    ends = np.cumsum(np.linalg.norm(heads - tails, axis=1))
    marks = (np.arange(n) + random.random(n)) / n * ends[-1]
    edges = np.minimum(np.searchsorted(ends, marks, side="right"), len(ends) - 1)
    points = tails[edges] + random.random((n, 1)) * (heads - tails)[edges]
    return points, unit(normals[pairs // 3].sum(axis=1))[edges]
