"""Digital surfaces: the boundary of a set of voxels, and smooth surfaces that separate the set from all other voxels.

The faces of voxels that separate inside from outside, called surfels, are squares with six possible normals: as a
surface they overestimate the length of every curve that is not parallel to an axis, however small the voxels. Normals
estimated over a wider neighbourhood approximate those of the surface that was digitised (Coeurjolly & Lachaud 2022).

A surface net has a vertex in each cell between the centres of eight voxels that are not all inside or all outside, and
a quadrilateral around each line between neighbouring centres of which one is inside. It is relaxed while vertices stay
in their cells (Gibson 1998, *Constrained elastic surface nets*), so that the surface still separates the same voxels.
It is the bending of the net that is minimised, ``Σ |x − mean of neighbours|²``; Gibson's length would shrink it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from ..arrays import Bools, Floats, Ints
from ..errors import GeometryError
from ..linear.conjugate_gradients import conjugate_gradients
from ..mesh.components import sums_of
from ..mesh.dual_cells import Crossings, DualCells, crossed_cells, crossings_in, dual_cells, separate_triangles
from ..mesh.edges import EdgeTable
from ..shapes.exchange import Displayed
from ..validation import array_of, finite_number, frozen, numbers, positive_steps, refuse_extreme, refuse_lost_spacing
from .polygon_mesh import PolygonMesh
from .surface import Surface
from .triangle_mesh import TriangleMesh

if TYPE_CHECKING:
    import pyvista


@dataclass(frozen=True, eq=False)
class DigitalSurface(Displayed, Surface):
    """The boundary of a set of voxels, as a domain that approximates the smooth surface that was digitised.

    Parameters
    ----------
    volume : (nx, ny, nz) bool
        True inside. Everything beyond the array is outside.
    spacing : float or (3,) float
        Edge lengths of a voxel along each axis, in units of length; 1 by default.
    origin : (3,) float
        Position of the centre of voxel ``(0, 0, 0)``; zero by default.
    radius : float, optional
        Radius, in units of length, of the neighbourhood over which normals are estimated; with 0 every face has its own
        normal. Small radii keep details, large ones remove the staircase. By default 0.4 · √(voxel size · extent of the
        shape). Under refinement this shrinks, but contains more and more voxels, as convergence requires.

    Raises
    ------
    GeometryError
        If the volume is not a three-dimensional array of booleans (or zeros and ones), is empty, the spacing is not
        positive, or the radius is negative.

    See Also
    --------
    io.LabelImage : An image of labels.
    io.read_volume : Read voxels.
    redistance : Distance from an array of values or signs.

    Notes
    -----
    Voxels that touch along an edge only are connected there; voxels that touch at a corner only are not. `vertices` are
    corners of voxels, at a distance of up to a voxel's diagonal from the surface that was digitised.

    Examples
    --------
    >>> ball = np.linalg.norm(np.indices((9, 9, 9)) - 4.0, axis=0) < 3.5
    >>> surface = DigitalSurface(ball, spacing=0.1)
    >>> surface.n_vertices, len(surface.normals)
    (224, 222)
    """

    volume: Bools
    spacing: Floats
    origin: Floats
    radius: float

    def __init__(
        self,
        volume: ArrayLike,
        spacing: ArrayLike = 1.0,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        radius: float | None = None,
    ) -> None:
        array = array_of(volume, "volume")
        if array.ndim != 3:
            raise GeometryError(f"a volume must be an array with 3 axes, not {array.ndim}", element="volume")
        if array.dtype != bool and not (array.size and array.dtype.kind in "iuf" and np.isin(array, (0, 1)).all()):
            raise GeometryError(
                f"a volume must be boolean, or 0 and 1, not {array.dtype} with other values",
                remedy="threshold it first, for instance volume > 0.5",
            )
        solid = array.astype(bool)
        if not solid.any():
            raise GeometryError("the volume holds no voxel: every entry is False", element="volume")
        steps = positive_steps(spacing, 3)
        start = numbers(origin, "origin")
        if start.shape != (3,) or not np.isfinite(start).all():
            raise GeometryError(
                f"the origin of a volume must be 3 finite numbers, not {start.tolist()}", element="origin"
            )
        refuse_extreme(start, start + steps * array.shape, "voxels")
        refuse_lost_spacing(steps, start, start + steps * array.shape)
        if radius is None:
            spans = [np.flatnonzero(solid.any(axis=tuple({0, 1, 2} - {axis}))) for axis in range(3)]
            extent = max(step * (span[-1] - span[0] + 1) for step, span in zip(steps, spans, strict=True))
            radius = 0.4 * float(np.sqrt(steps.max() * extent))
        radius = finite_number(radius, "radius", 0, GeometryError)
        vars(self).update(volume=frozen(solid), spacing=steps, origin=frozen(start), radius=radius)

    @cached_property
    def surfels(self) -> Surfels:
        """The faces between inside and outside, on the voxel lattice."""
        return boundary_surfels(self.volume)

    @cached_property
    def vertices(self) -> Floats:
        """(n, 3) corners of the faces, where fields live."""
        return frozen(self.origin + (self.surfels.vertices - 0.5) * self.spacing)

    @property
    def n_vertices(self) -> int:
        """Number of vertices."""
        return len(self.surfels.vertices)

    @property
    def bounds(self) -> Floats:
        """(2, 3) lower and upper corner of the box around the surface."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def squares(self) -> PolygonMesh:
        """The faces of the voxels as a polygon mesh, counter-clockwise as seen from outside."""
        return PolygonMesh(self.vertices, self.surfels.corners)

    @cached_property
    def normals(self) -> Floats:
        """(m, 3) estimated unit normal of the digitised surface at each face, outward."""
        return frozen(corrected_normals(self.volume, self.surfels, self.spacing, self.radius))

    @cached_property
    def smooth_vertices(self) -> Floats:
        """(n, 3) vertices, moved so that faces are nearly orthogonal to `normals`; distance is measured on these."""
        return frozen(smoothed_corners(self.vertices, self.surfels.corners, self.normals))

    @cached_property
    def smooth_surface(self) -> TriangleMesh:
        """A smooth surface between the centres of the voxels inside and outside: closed, manifold, facing outwards.

        Along each axis, it stays within half a voxel of the corners of voxels. Signed distance to it is negative at the
        centres of voxels inside, and positive at those of all others.
        """
        vertices, faces = surface_net(self.volume)
        return TriangleMesh(self.origin + vertices * self.spacing, faces)

    @property
    def triangulation(self) -> TriangleMesh:
        """The triangles that curves refer to: four per face, in the order of its sides, around an added vertex."""
        return self.squares.triangulation

    def on_triangulation(self, values: Floats) -> Floats:
        return self.squares.on_triangulation(values)

    def _plain(self, values: Floats) -> tuple[TriangleMesh, Floats]:
        """Return the triangles of the voxels' faces, and (m,) values at their vertices: see `FieldDomain`."""
        return self.triangulation, self.on_triangulation(values)

    def _triangle_mask(self, face_mask: Bools) -> Bools:
        """Convert a mask of the faces to one of the four triangles of each."""
        return self.squares._triangle_mask(face_mask)

    def to_pyvista(self) -> pyvista.PolyData:
        return self.squares.to_pyvista()

    def __repr__(self) -> str:
        return f"DigitalSurface({' × '.join(map(str, self.volume.shape))} voxels, radius={self.radius:.3g})"


STAYING = 0.003
"""Weight that keeps vertices near the middle of their cells. With it, stairs some four voxels long become slopes. The
mean error of normals of a ball, an ellipsoid and a torus of 96 voxels is 1.0° to 1.4°, with 0.01 1.8° to 2.1°, and with
0.001 0.8° to 1.3°. Of a box along the axes, whose sides bend outwards, it is 5.5°, 4.4° and 6.5°."""
LARGEST_MOVE = 0.49
"""Largest move of a vertex along each axis, in voxels. Below a half, no two coincide, even in single precision."""


def surface_net(volume: Bools) -> tuple[Floats, Ints]:
    """Make a smooth closed surface between voxels inside and outside: (n, 3) vertices, in voxels, and (m, 3) faces."""
    padded = np.pad(volume, 2)
    crossings = crossings_in(np.where(padded, -1.0, 1.0), np.zeros(3, dtype=np.int64))
    around = crossed_cells(crossings, padded.shape)
    cells = dual_cells(crossings, around, padded.shape, lambda places: np.ones(len(places), dtype=bool))
    middles, room = _middles(cells, crossings)
    relaxed = _relaxed(cells.quads, middles, room)
    rows, along = np.arange(len(crossings.axes)), crossings.axes
    shares = relaxed[cells.quads, along[:, None]].mean(axis=1) - crossings.nodes[rows, along]
    choices = np.stack([relaxed, 0.5 * (relaxed + middles), middles])
    crossings = replace(crossings, shares=np.clip(shares, 0.5 - LARGEST_MOVE, 0.5 + LARGEST_MOVE))
    vertices, faces = separate_triangles(cells, crossings, choices)
    return vertices - 2, faces


def _middles(cells: DualCells, crossings: Crossings) -> tuple[Floats, Floats]:
    """(v, 3) middles of pieces of the surface in cells, and (v, 1) largest moves of their vertices.

    A piece that shares its cell with others must not move.
    """
    count = len(cells.owners)
    crossed = crossings.nodes + 0.5 * np.eye(3)[crossings.axes]
    degrees = np.bincount(cells.quads.ravel(), minlength=count)
    sums = sums_of(np.repeat(crossed, 4, axis=0), cells.quads.ravel(), count)
    alone = (np.bincount(cells.owners)[cells.owners] == 1)[:, None]
    middles = np.where(alone, cells.places[cells.owners] + 0.5, sums / degrees[:, None])
    return middles, np.where(alone, LARGEST_MOVE, 0.0)


def _relaxed(quads: NDArray[np.int32], middles: Floats, room: Floats) -> Floats:
    """(v, 3) vertices at which a net of quads bends least, at most `room` from their middles along each axis.

    They are found by accelerated gradient descent with restarts (O'Donoghue & Candès 2015).
    """
    count = len(middles)
    tails, heads = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    links = sparse.coo_array((np.ones(len(tails)), (tails, heads)), shape=(count, count)).tocsr()
    links = links + links.T
    links.data[:] = 1
    weights = 1 / links.sum(axis=1)
    bending = sparse.csr_array(sparse.eye_array(count) - sparse.diags_array(weights) @ links)
    transposed = bending.T.tocsr()
    positions, extrapolated, momentum = middles, middles, 1.0
    for _ in range(200):  # the slowest modes that `STAYING` allows need about 4 / √STAYING = 73 steps
        slope = transposed @ (bending @ extrapolated) + STAYING * (extrapolated - middles)
        # every bending mode decays with a step below 2 / (2² + `STAYING`)
        new = np.clip(extrapolated - 0.24 * slope, middles - room, middles + room)
        restart = ((extrapolated - new) * (new - positions)).sum() > 0
        next_momentum = 1.0 if restart else 0.5 * (1 + np.sqrt(1 + 4 * momentum**2))
        extrapolated = new + (0.0 if restart else (momentum - 1) / next_momentum) * (new - positions)
        moved = float(np.abs(new - positions).max())
        positions, momentum = new, next_momentum
        if moved < 1e-4:  # voxels
            break
    return positions


ATTACHMENT = 0.1
"""Weight that keeps corners near their positions: they move by averages over 1/√0.1, about 3 voxels, as staircases
need."""


def smoothed_corners(vertices: Floats, corners: Ints, normals: Floats) -> Floats:
    """(n, 3) vertices p, moved from v so that squares f with sides ij are nearly orthogonal to their normals n_f.

    `corners` are (m, 4), `normals` (m, 3). The result minimises ``Σ (n_f · (p_j − p_i))² + ATTACHMENT Σ |p_i − v_i|²``
    (Coeurjolly, Lachaud & Gueth, *Digital surface regularization with guarantees*, 2021).
    """
    m, n = len(corners), len(vertices)
    row, tails, heads = np.arange(4 * m), corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    along = np.repeat(normals, 4, axis=0).ravel()
    axes = np.arange(3)
    columns = np.concatenate([(3 * heads[:, None] + axes).ravel(), (3 * tails[:, None] + axes).ravel()])
    rows = np.tile(np.repeat(row, 3), 2)
    heights = sparse.csr_matrix((np.concatenate([along, -along]), (rows, columns)), shape=(4 * m, 3 * n))
    matrix = sparse.csr_matrix(heights.T @ heights + ATTACHMENT * sparse.identity(3 * n))
    center = vertices.mean(axis=0)
    moved = conjugate_gradients(
        lambda x: matrix @ x, -(heights.T @ (heights @ (vertices - center).ravel())), tolerance=1e-8
    )
    return vertices + moved.reshape(n, 3)


STEEPEST_NORMAL = 0.05
"""Least cosine between a corrected normal and the square's own, before normals are scaled to length 1."""
WIDEST_BLUR, NARROWEST_BLUR = 1e3, 1e-3
"""Largest radius of a blur, in extents of the volume, and least width, in voxels: beyond these no normal changes."""


@dataclass(frozen=True, eq=False)
class Surfels:
    """Boundary squares of a set of voxels."""

    corners: Ints  # (m, 4) vertex ids, counter-clockwise seen from outside
    vertices: Ints  # (n, 3) lattice points: corner ``(i, j, k)`` is where voxel ``(i, j, k)`` begins
    voxels: Ints  # (m, 3) the voxel inside each surfel
    axes: Ints  # (m,) axis to which the surfel is orthogonal
    signs: Ints  # (m,) 1 where the outward normal points along the positive axis, −1 where along the negative one

    @property
    def outward(self) -> Ints:
        """(m, 3) outward unit normals, which are also the steps from voxels inside to those outside."""
        return np.eye(3, dtype=np.int64)[self.axes] * self.signs[:, None]


def boundary_surfels(volume: Bools) -> Surfels:
    """Return the boundary squares of a volume, in order of their voxels; all beyond the array is outside."""
    parts, directions = [], [(axis, sign) for axis in range(3) for sign in (-1, 1)]
    for axis, sign in directions:
        beyond = np.zeros_like(volume)
        near, far = [slice(None)] * 3, [slice(None)] * 3
        near[axis], far[axis] = (slice(None, -1), slice(1, None))[::sign]
        beyond[tuple(near)] = volume[tuple(far)]
        parts.append(np.argwhere(volume & ~beyond))
    voxel = np.concatenate(parts)
    along, towards = np.repeat(directions, [len(part) for part in parts], axis=0).T
    order = np.lexsort((towards, along, *voxel.T[::-1]))
    voxel, along, towards = voxel[order], along[order], towards[order]

    unit = np.eye(3, dtype=np.int64)
    first, second = unit[(along + 1) % 3], unit[(along + 2) % 3]
    forward = (towards > 0)[:, None]
    first, second = np.where(forward, first, second), np.where(forward, second, first)
    start = voxel + unit[along] * forward
    corners = np.stack([start, start + first, start + first + second, start + second], axis=1)
    shape = np.array(volume.shape) + 1
    keys = np.ravel_multi_index(tuple(corners.reshape(-1, 3).T), tuple(shape))
    distinct, ids = np.unique(keys, return_inverse=True)
    vertices = np.stack(np.unravel_index(distinct, tuple(shape)), axis=1)
    return Surfels(ids.reshape(-1, 4), vertices, voxel, along, towards)


def count_surfels(volume: Bools) -> int:
    """Return the number of boundary squares of a set of voxels."""
    return sum(int(np.diff(volume, axis=axis, prepend=False, append=False).sum()) for axis in range(3))


def corrected_normals(volume: Bools, surfels: Surfels, spacing: Floats, radius: float) -> Floats:
    """(m, 3) unit normals of surfels: the negative gradient of the volume after a blur of standard deviation radius/2.

    Those too far from the surfel's own normal are tilted towards it.
    """
    own = surfels.outward.astype(np.float64)
    if radius == 0:
        return own
    extent = spacing * volume.shape
    width = np.maximum(0.5 * min(radius, WIDEST_BLUR * float(extent.max())) / spacing, NARROWEST_BLUR)
    padded = np.pad(volume, 1).astype(np.float32)
    reach = [min(int(4 * w + 0.5), n) for w, n in zip(width, padded.shape, strict=True)]  # beyond is nothing
    inside = tuple((surfels.voxels + 1).T)
    outside = tuple((surfels.voxels + surfels.outward + 1).T)
    gradient = np.empty_like(own)
    for axis in range(3):
        order = [int(a == axis) for a in range(3)]
        slope = scipy.ndimage.gaussian_filter(padded, width, order=order, mode="constant", radius=reach)
        gradient[:, axis] = (slope[inside].astype(np.float64) + slope[outside]) / spacing[axis]
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    normals = np.divide(-gradient, length, out=own.copy(), where=length > 0)
    steep = STEEPEST_NORMAL - (normals * own).sum(axis=1)
    normals += np.maximum(steep, 0)[:, None] * own
    return normals / np.linalg.norm(normals, axis=1)[:, None]


def separated_edges(edges: EdgeTable, surfels: Surfels) -> EdgeTable:
    """Replace each edge along which two voxels touch by two, one for the surfels that face each voxel outside.

    Triangles are four per surfel; the first side of each is that of the surfel. Of the two edges, one keeps the id of
    the edge that they replace.
    """
    triangles = np.flatnonzero(edges.face_counts[edges.face_edges[:, 0]] > 2)  # those at an edge of two voxels
    surfel, old_ids = triangles // 4, edges.face_edges[triangles, 0]
    outside = (surfels.voxels + surfels.outward)[surfel]
    _, first, group = np.unique(np.column_stack([old_ids, outside]), axis=0, return_index=True, return_inverse=True)
    group = group.ravel()  # of the triangles; each group has an edge of its own
    kept = np.isin(first, np.unique(old_ids, return_index=True)[1])
    n_edges = len(edges.vertices)
    group_ids = np.where(kept, old_ids[first], n_edges + np.cumsum(~kept) - 1)

    leading = triangles[first[~kept]]  # the first triangle of each new edge determines its direction
    direction = edges.vertices[edges.face_edges[leading, 0]]
    direction = np.where(edges.forward[leading, 0, None], direction, direction[:, ::-1])
    face_edges, forward = edges.face_edges.copy(), edges.forward.copy()
    face_edges[triangles, 0] = group_ids[group]
    renamed = triangles[~kept[group]]
    forward[renamed, 0] ^= ~edges.forward[leading, 0][face_edges[renamed, 0] - n_edges]
    return EdgeTable(np.concatenate([edges.vertices, direction]), face_edges, forward)
