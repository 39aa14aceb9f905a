"""Tet meshes around broken shapes: graded lattices, fine near the shape and coarse away from it.

The mesh need not conform to the shape, since sources are clipped against the tets. So it can be made for every shape.
Across every face that two leaves of an octree share, their centres are joined by one tet for each edge of the face
(edges are split where a smaller leaf splits them). Equal leaves give the body-centred cubic lattice, with dihedral
angles of 60° and 90°. Where sizes change, angles stay between 30° and 135°.

Unstructured tets have no preferred directions: at the same size the unsharpened error is half as large, or less
(``benchmarks/tets.py``).
"""

from __future__ import annotations

import itertools
import math
from typing import Any, cast

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..errors import GeometryError, MemoryLimitError
from ..memory import refuse_beyond_memory
from ..mesh.box_tree import room_around
from ..mesh.components import places_among
from ..parallel import PointTree
from ..shapes.area_elements import area_elements, bounds_around
from ..shapes.foreign import converted
from ..shapes.kinds import Shape, ShapeLike
from ..surfaces.point_cloud import PointCloud
from ..validation import finite_number, public_call, refuse_extreme
from .tet_mesh import TetMesh

FINEST_LATTICE = 1e9
"""Largest resolution that is accepted; smaller ones may need too much memory."""
MOST_TETS = 50_000_000
"""Largest number of tets; distance on more would need over 70 GB."""
BYTES_PER_LATTICE_TET = 350
"""Measured peak memory of meshing per tet; distance takes more."""


@public_call
def tetrahedralize(
    shape: ShapeLike, *, resolution: int = 32, padding: float | None = None, grading: float = 3.0
) -> TetMesh:
    """Fill a box around a shape with tets of good angles, whose size grows with the distance from the shape.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh or PointCloud
        Any shape, however broken.
    resolution : int
        Number of cells near the shape along the longest side of its box; 32 by default.
    padding : float, optional
        Least distance between shape and box, in the units of the shape; by default a fifth of its longest side.
    grading : float
        Away from the shape, cells are no larger than their distance from it divided by `grading`, which is at least 2.7
        and by default 3. ``inf`` gives a uniform lattice.

    Returns
    -------
    TetMesh
        Tets that fill the box. All dihedral angles are between 30° and 135°.

    Raises
    ------
    GeometryError
        If the shape has no extent, or a parameter is out of range.
    SourceError
        If the argument is not a shape in space.
    MemoryLimitError
        If the lattice would have more than 50 million tets.

    See Also
    --------
    TetMesh : Tetrahedra.
    signed_distance : Distance on a grid, on tets or along a surface.

    Notes
    -----
    On lattices, heat decays slightly faster along some directions than others. `sharpen` removes the resulting error; a
    four times larger diffusion time (``diffusion=4``) halves it on smooth shapes. On unstructured tets it is smaller:
    see `signedheat.tets.lattice` for TetGen and fTetWild.

    Examples
    --------
    >>> import signedheat as sh
    >>> shape = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> mesh = sh.tetrahedralize(shape, resolution=8)
    >>> float(mesh.tet_volumes.min()) > 0
    True
    """
    own = cast("Shape", converted(shape))
    lower, sides, spacing = _box_around(own, resolution, padding)
    if not (isinstance(grading, float) and grading == np.inf):
        # g/2 must exceed √3·¾: neighbouring leaves then differ by a factor of two in size at most
        grading = finite_number(grading, "grading", 2.7, GeometryError)
    size = float(resolution)
    depth = int(np.clip(np.floor(np.log2(np.maximum(sides.max() / spacing / 4, 1))), 0, 16))
    if np.isinf(grading):
        depth = 0
    coarse = spacing * 2**depth
    counts = np.maximum(np.ceil(sides / coarse - 1e-9).astype(np.int64), 1)
    area = 0.0 if isinstance(own, PointCloud) else float(area_elements(own).weights.sum())
    volume_cells = float(counts.astype(np.float64).prod())
    surface_cells = 2 * grading * area / spacing**2 if depth else 0.0
    if surface_cells > volume_cells:
        # there are 2.4 to 2.8 times as many cells of all levels, as measured
        _refuse_too_many(12 * surface_cells, 12 * 2.7 * surface_cells, size, 2)
    else:
        _refuse_too_many(12 * volume_cells, 12 * volume_cells, size, 3)
    origin = lower - (counts * coarse - sides) / 2
    samples = PointTree(sample_points(own, spacing))
    corners, sizes = _octree(samples, origin, spacing, counts, depth, grading, size)
    points, tets = _join_leaves(corners, sizes, counts * 2 ** (depth + 1))
    return TetMesh(origin + points * (spacing / 2), tets)


def sample_points(shape: Shape, spacing: float) -> Floats:
    """(n, 3) points on a shape such that none of its points is farther than `spacing` from the nearest of them."""
    if isinstance(shape, PointCloud):
        return shape.points
    triangles = area_elements(shape).corners
    sides = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    pieces = np.maximum(np.ceil(sides / spacing), 1).astype(np.int64)
    points = []
    for k in np.unique(pieces):
        i, j = np.meshgrid(np.arange(k + 1), np.arange(k + 1), indexing="ij")
        i, j = i[i + j <= k], j[i + j <= k]
        weights = np.stack([i, j, k - i - j], axis=1) / k
        points.append(np.einsum("wc,mcd->mwd", weights, triangles[pieces == k]).reshape(-1, 3))
    return np.concatenate(points)


def _refuse_too_many(least: float, expected: float, resolution: float, power: int) -> None:
    """Raise `MemoryLimitError` if a lattice has too many tets, and name a resolution that fits.

    It has at least `least` tets, and probably `expected`, whose number grows with this `power` of the resolution.
    """

    def lower(fitting: int) -> str:
        """Return the remedy: a lower resolution, with which there are about `fitting` tets."""
        most = resolution * (fitting / expected) ** (1 / power)
        return (
            f"lower the resolution from {resolution:g} to at most {math.floor(most) if most >= 2 else round(most, 2)}"
        )

    count = math.ceil(min(least, 1e18))
    refuse_beyond_memory(f"a lattice of {least:,.3g} tets", count, lambda number: BYTES_PER_LATTICE_TET * number, lower)
    if least > MOST_TETS:
        raise MemoryLimitError(f"the lattice would have over {least:,.0f} tets", remedy=lower(MOST_TETS))


def _octree(
    samples: Any, origin: Floats, spacing: float, counts: Ints, depth: int, grading: float, resolution: float
) -> tuple[Ints, Ints]:
    """(n, 3) lower corners and (n,) sizes of the leaves of an octree, in half cells of the finest level.

    Cells are split up to `depth` times if they are nearer to the samples (a tree of points) than `grading` times their
    size. The coarsest level has (3,) `counts` of cells from `origin`, (3,), on, the finest has cells of size `spacing`.
    Leaves need no balancing. `resolution` is for the error if there are too many.
    """
    size = 2 ** (depth + 1)
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(-1, 3) * size
    octants = np.array(list(itertools.product((0, 1), repeat=3)))
    corners, sizes = [], []
    while size > 2:
        centers = origin + (cells + size / 2) * (spacing / 2)
        split = samples.query(centers)[0] < grading * size * spacing / 2
        corners.append(cells[~split])
        sizes.append(np.full(len(corners[-1]), size))
        size //= 2
        cells = (cells[split][:, None] + octants * size).reshape(-1, 3)
        least = 12.0 * len(cells)
        _refuse_too_many(least, least * 4 / 3 * (size / 2) ** 2, resolution, 2)  # each level has four times as many
    corners.append(cells)
    sizes.append(np.full(len(cells), size))
    return np.concatenate(corners), np.concatenate(sizes)


def _join_leaves(corners: Ints, sizes: Ints, upper: Ints) -> tuple[Ints, Ints]:
    """Make the tets that join the centres of leaves that share a face: (k, 3) points, and (m, 4) tets.

    Leaves have (n, 3) lower `corners` and (n,) `sizes`, powers of two. These, points, and the upper corner of the
    lattice, `upper`, (3,), are in half cells of the finest level.
    """
    stride = np.array([(upper[1] + 1) * (upper[2] + 1), upper[2] + 1, 1])
    # sorted keys of leaves: the corner, and the binary logarithm of the size, below 32
    leaves = np.sort((corners * 32 + np.log2(sizes).astype(np.int64)[:, None] * [0, 0, 1]) @ stride)

    def is_leaf(corner: Ints, size: Ints) -> Bools:
        """(n,) whether there is a leaf of the given size at each of (n, 3) lower corners."""
        keys = (corner * 32 + np.log2(size).astype(np.int64)[:, None] * [0, 0, 1]) @ stride
        return places_among(leaves, keys) >= 0

    octants = np.array(list(itertools.product((0, 1), repeat=3)))
    occupied = np.unique((corners[:, None] + octants * sizes[:, None, None]).reshape(-1, 3) @ stride)
    joined = []
    for axis, side in itertools.product(range(3), (0, 1)):
        step = np.zeros(3, dtype=np.int64)
        step[axis] = 2 * side - 1
        beyond = corners + step * sizes[:, None]
        outside = (beyond[:, axis] < 0) | (beyond[:, axis] >= upper[axis])
        equal = ~outside & is_leaf(beyond, sizes)
        parent = beyond - beyond % (2 * sizes[:, None])
        larger = ~outside & ~equal & is_leaf(parent, 2 * sizes)
        half = (sizes // 2)[:, None]
        center = corners + half
        opposite = np.where(larger[:, None], parent + 2 * half, beyond + half)
        opposite = np.where(outside[:, None], center + step * half, opposite)
        chosen = np.flatnonzero(outside | larger | (equal if side else False))  # count pairs of equal leaves once
        u, v = np.roll(np.eye(3, dtype=np.int64), -axis, axis=0)[1:]
        square = np.array([0 * u, u, u + v, v])
        face = corners[chosen, None] + (square + side * np.eye(3, dtype=np.int64)[axis]) * sizes[chosen, None, None]
        for k in range(4):
            start, end = face[:, k], face[:, (k + 1) % 4]
            middle = (start + end) // 2
            is_split = places_among(occupied, middle @ stride) >= 0  # by a corner of a smaller leaf
            for ends, rows in (((start, end), ~is_split), ((start, middle), is_split), ((middle, end), is_split)):
                tet_corners = (center[chosen], opposite[chosen], *ends)
                joined.append(np.stack([corner[rows] @ stride for corner in tet_corners], axis=1))
    keys, ids = np.unique(np.concatenate(joined), return_inverse=True)
    points = np.stack([keys // stride[0], keys % stride[0] // stride[1], keys % stride[1]], axis=1)
    tets = ids.reshape(-1, 4)
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    negative = np.einsum("mi,mi->m", np.cross(b - a, c - a), d - a) < 0
    tets[negative] = tets[negative][:, [0, 1, 3, 2]]
    return points, tets


def _box_around(shape: Any, resolution: int, padding: float | None) -> tuple[Floats, Floats, float]:
    """Return the (3,) lower corner and (3,) sides of the padded box of a shape, and the size of cells near the shape.

    Raise `GeometryError` if a parameter is out of range.
    """
    lower, upper = bounds_around([shape])
    longest = float((upper - lower).max())
    if len(lower) != 3 or not longest > 0:
        raise GeometryError(
            f"{shape!r} has no extent in space of three dimensions to put a mesh around", element="shape"
        )
    size = finite_number(resolution, "resolution", 1, GeometryError)
    if size > FINEST_LATTICE:
        raise GeometryError(f"resolution must be at most {FINEST_LATTICE:g}, not {size:g}", element="resolution")
    padding = room_around((lower, upper)) if padding is None else finite_number(padding, "padding", 0, GeometryError)
    refuse_extreme(lower - padding, upper + padding, "padding")
    return lower - padding, upper - lower + 2 * padding, longest / size
