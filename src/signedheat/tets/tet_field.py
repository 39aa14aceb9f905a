"""Distance on a tet mesh, and its level sets as closed surfaces: marching tetrahedra, with lids along the boundary."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats, Frozen, Ints
from ..diagnostics import Diagnostics
from ..discretization import SourceTerm
from ..errors import GeometryError, OutsideError, UnsupportedTypeError
from ..exchange import Displayed, with_values
from ..field_arithmetic import Combinable
from ..field_levels import refuse_beyond_walls
from ..mesh.components import connected_components
from ..mesh.edges import CLEARANCE
from ..mesh.tet_shapes import TetShapes, face_table
from ..search.nearest_triangles import TriangleTree
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import contiguous, finite_number, query_points, shaped
from .tet_clipping import Planes, barycentric, containing_tets
from .tet_mesh import TetMesh

# By a bit mask of the corners below the level: an even permutation that puts these corners first, and their number.
BELOW_FIRST = np.zeros((16, 4), dtype=np.int64)
N_BELOW = np.array([bin(mask).count("1") for mask in range(16)])
EVEN_PAIRS = {(0, 1): (2, 3), (0, 2): (3, 1), (0, 3): (1, 2), (1, 2): (0, 3), (1, 3): (2, 0), (2, 3): (0, 1)}
for _k, _order in enumerate([(0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)]):
    BELOW_FIRST[1 << _k] = BELOW_FIRST[15 - (1 << _k)] = _order
for (_i, _j), _rest in EVEN_PAIRS.items():
    BELOW_FIRST[(1 << _i) | (1 << _j)] = (_i, _j, *_rest)

# By the number of corners below the level: triangles between crossings, each crossing given by two corners of its edge.
TET_CUTS = {
    1: [[(0, 1), (0, 2), (0, 3)]],
    2: [[(0, 2), (0, 3), (1, 3)], [(0, 2), (1, 3), (1, 2)]],
    3: [[(0, 1), (0, 3), (0, 2)]],
}
# Likewise, triangles of the part of a boundary face below the level; (k, k) is corner k itself.
FACE_LIDS = {
    1: [[(0, 0), (0, 1), (0, 2)]],
    2: [[(0, 0), (1, 1), (1, 2)], [(0, 0), (1, 2), (2, 0)]],
    3: [[(0, 0), (1, 1), (2, 2)]],
}


def closed_level_set(mesh: TetShapes, values: Floats, gradients: Floats, level: float) -> tuple[Floats, Ints]:
    """Return vertices and triangles of the surface around the mesh vertices below a level, closed at the boundary.

    Vertices lie where φ, by values and gradients at the ends of edges, takes the level. Tets with NaN are left out.
    """
    tets = mesh.tets[~np.isnan(values[mesh.tets]).any(axis=1)]
    if not len(tets):
        raise GeometryError("no tet has values at its corners", remedy="compute the field anew", element="values")
    below = values < level
    used = below[tets]
    if not used.any() or used.all():
        low, high = np.nanmin(values), np.nanmax(values)
        raise OutsideError(
            f"level {level:g} is outside the values of the tet mesh, {low:g} to {high:g}",
            remedy="choose another level or a larger mesh",
            element=f"level {level:g}",
        )
    keys, _ = _triangles(tets, used, len(mesh.vertices), TET_CUTS)
    faces = face_table(tets)
    walls = faces.vertices[faces.tet_counts == 1]
    if below[walls].any() and not below[walls].all():
        keys = np.concatenate([keys, _triangles(walls, below[walls], len(mesh.vertices), FACE_LIDS)[0]])
    return manifold(*_crossings(mesh.vertices, values, gradients, level, keys, CLEARANCE))


def level_triangles(vertices: Floats, tets: Ints, values: Floats, level: float) -> tuple[Floats, Ints, Ints]:
    """Return the level set of the linear interpolant, open at the boundary: positions, triangles, their tets."""
    finite = np.flatnonzero(~np.isnan(values[tets]).any(axis=1))
    keys, owners = _triangles(tets[finite], (values < level)[tets[finite]], len(vertices), TET_CUTS)
    return *_crossings(vertices, values, np.zeros_like(vertices), level, keys, 0.0), finite[owners]


def _crossings(
    vertices: Floats, values: Floats, gradients: Floats, level: float, keys: Ints, clearance: float
) -> tuple[Floats, Ints]:
    """Return where edges, given by keys ``smaller · n + larger``, take the level, and the index of each key's place.

    At the fraction s of the edge e from a to b, φ is ``(1 − s) φ_a + s φ_b + ½ s (1 − s) (∇φ_a − ∇φ_b)·e``.
    """
    crossings, triangles = np.unique(keys, return_inverse=True)
    low, high = crossings // len(vertices), crossings % len(vertices)
    edges, below, rise = vertices[high] - vertices[low], level - values[low], values[high] - values[low]
    bend = np.einsum("ei,ei->e", gradients[low] - gradients[high], edges) / 2
    slope = rise + bend
    divisor = slope + np.copysign(np.sqrt(np.maximum(slope**2 - 4 * bend * below, 0)), rise)
    along = np.clip(2 * below / np.where(divisor != 0, divisor, 1), clearance, 1 - clearance)
    return vertices[low] + along[:, None] * edges, triangles.reshape(-1, 3)


def _triangles(
    elements: Ints, below: Bools, n: int, table: dict[int, list[list[tuple[int, int]]]]
) -> tuple[Ints, Ints]:
    """Cut elements by a table: return (k, 3) triangles of keys of edges (see `_crossings`), and their elements."""
    corners = elements.shape[1]
    masks = below @ (1 << np.arange(corners))
    if corners == 4:
        orders, counts = BELOW_FIRST, N_BELOW
    else:
        orders = np.array([[0, 1, 2], [0, 1, 2], [1, 2, 0], [0, 1, 2], [2, 0, 1], [2, 0, 1], [1, 2, 0], [0, 1, 2]])
        counts = N_BELOW[:8]
    keys, owners = [], []
    for count, triangles in table.items():
        chosen = np.flatnonzero(counts[masks] == count)
        ordered = np.take_along_axis(elements[chosen], orders[masks[chosen]], axis=1)
        for triangle in triangles:
            ends = [(ordered[:, a], ordered[:, b]) for a, b in triangle]
            keys.append(np.stack([np.minimum(a, b) * n + np.maximum(a, b) for a, b in ends], axis=1))
            owners.append(chosen)
    return np.concatenate(keys), np.concatenate(owners)


def manifold(positions: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Make a closed oriented surface manifold: split vertices and edges at which it touches itself."""
    m = len(triangles)
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    after = np.roll(np.arange(3 * m).reshape(m, 3), -1, axis=1).ravel()  # corner at the head of each halfedge
    n = len(positions)
    undirected = np.minimum(tails, heads) * n + np.maximum(tails, heads)
    forward = np.flatnonzero(tails < heads)
    backward = np.flatnonzero(tails > heads)
    forward = forward[np.argsort(undirected[forward], kind="stable")]
    backward = backward[np.argsort(undirected[backward], kind="stable")]
    joins = np.concatenate([forward, after[forward]]), np.concatenate([after[backward], backward])
    vertex = connected_components(3 * m, *joins)
    _, first = np.unique(vertex, return_index=True)
    return positions[tails[first]], vertex.reshape(m, 3)


if TYPE_CHECKING:
    import pyvista


@dataclass(frozen=True, eq=False)
class TetField(Displayed, Combinable, Frozen):
    """Signed distance at the vertices of a tet mesh, linear on every tet.

    Parameters
    ----------
    mesh : TetMesh
        The domain.
    values : (n_vertices,) float
        φ at the vertices, in the units of the mesh. Positive on the side that the source normals point to, so negative
        inside a shape with outward normals. NaN on parts of the mesh that are connected to no source.
    diagnostics : Diagnostics
        Timings, diffusion time, and notes on the computation.
    source : SourceTerm, optional
        The lowered source, which `sharpen` needs.

    Raises
    ------
    GeometryError
        If there is not one value per vertex.

    See Also
    --------
    signed_distance : Distance on a grid, on tets or along a surface.
    TetMesh : Tetrahedra.

    Examples
    --------
    >>> mesh = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    >>> phi = TetField(mesh, [-0.5, 0.5, -0.5, -0.5])
    >>> phi([[0.25, 0.25, 0.25], [-1.0, 0.0, 0.0]])
    array([-0.25, -1.5 ])
    >>> phi.gradient([[0.25, 0.25, 0.25]])
    array([[1., 0., 0.]])
    >>> phi.contour().n_faces
    8
    """

    mesh: TetMesh
    values: Floats
    diagnostics: Diagnostics = field(default_factory=Diagnostics, repr=False)
    source: SourceTerm | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, TetMesh):
            raise UnsupportedTypeError(f"{self.mesh!r:.80} is not a TetMesh", element="mesh")
        values = contiguous(self.values, "values")
        if values.shape != (self.mesh.n_vertices,):
            raise GeometryError(
                f"values have shape {values.shape}, but the mesh has {self.mesh.n_vertices} vertices", element="values"
            )
        object.__setattr__(self, "values", values)

    @property
    def domain(self) -> TetMesh:
        """The mesh."""
        return self.mesh

    def __call__(self, points: ArrayLike) -> Floats:
        """φ at points in space, to second order, from values and gradients at the corners of their tets.

        Outside the mesh φ is extrapolated linearly from the nearest point of the boundary, along the gradient there.

        Parameters
        ----------
        points : (..., 3) float
            Positions, in the units of the mesh.

        Returns
        -------
        (...) float
            Signed distances, in the shape of the points; NaN where the nearest tet has a vertex without a value.
        """
        places, shape = query_points(points, 3)
        corners, weights, away = self._place(places)
        steps = (places - away)[:, None] - self.mesh.vertices[corners]
        tangents = self.values[corners] + np.einsum("pki,pki->pk", self._vertex_gradients[corners], steps) / 2
        values = np.einsum("pk,pk->p", weights, tangents)
        outside = np.flatnonzero(away.any(axis=1))
        if len(outside):
            slopes = np.einsum("pk,pki->pi", weights[outside], self._vertex_gradients[corners[outside]])
            values[outside] += np.einsum("pi,pi->p", slopes, away[outside])
        return shaped(values, shape)

    def gradient(self, points: ArrayLike) -> Floats:
        """∇φ at points in space: volume-weighted means at the vertices, interpolated.

        Outside the mesh it is the gradient at the nearest point of the boundary.

        Parameters
        ----------
        points : (..., 3) float
            Positions, in the units of the mesh.

        Returns
        -------
        (..., 3) float
            Gradients; of length about 1, since φ is a distance.

        Examples
        --------
        >>> mesh = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
        >>> TetField(mesh, [0.0, 1.0, 2.0, 3.0]).gradient([0.2, 0.2, 0.2])
        array([1., 2., 3.])
        """
        places, shape = query_points(points, 3)
        corners, weights, _ = self._place(places)
        return shaped(np.einsum("pk,pki->pi", weights, self._vertex_gradients[corners]), shape)

    @property
    def tet_gradients(self) -> Floats:
        """(m, 3) ∇φ of the linear interpolant in every tet."""
        return self.mesh.geometry.gradients(self.values[self.mesh.tets])

    def contour(self, level: float = 0.0) -> TriangleMesh:
        """Extract the surface φ = level: closed, manifold, with normals pointing to greater φ.

        Where the surface leaves the mesh, it is closed along the boundary of the mesh.

        Parameters
        ----------
        level : float
            The level, in the units of the mesh.

        Returns
        -------
        TriangleMesh
            The surface.

        Raises
        ------
        OutsideError
            If φ does not take the level anywhere in the mesh.
        GeometryError
            If no tet has a value at all its corners.

        Examples
        --------
        >>> mesh = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
        >>> TetField(mesh, [0.0, 0.0, 0.0, 1.0]).contour(0.5).bounds[:, 2].tolist()
        [0.0, 0.5]
        """
        level = finite_number(level, "level")
        return TriangleMesh(*closed_level_set(self.mesh.geometry, self.values, self._vertex_gradients, level))

    def offset(self, distance: float) -> TriangleMesh:
        """Offset the shape by a signed distance: `contour`, but refused if the mesh is too small for it.

        Parameters
        ----------
        distance : float
            Signed distance, positive outward, in the units of the mesh.

        Returns
        -------
        TriangleMesh
            As `contour`.

        Raises
        ------
        OutsideError
            If φ does not take the value in the mesh, or the offset leaves the mesh although the shape itself does not.

        Examples
        --------
        >>> mesh = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
        >>> TetField(mesh, [-0.5, -0.5, -0.5, 0.5]).offset(0.25).bounds[:, 2].tolist()
        [0.0, 0.75]
        """
        distance = finite_number(distance, "distance")
        remedy = f"use a mesh that reaches more than {abs(distance):g} beyond the shape"
        refuse_beyond_walls(self.values[np.unique(self.mesh.boundary.faces)], distance, "tet mesh", remedy)
        return self.contour(distance)

    def to_pyvista(self) -> pyvista.UnstructuredGrid:
        return with_values(self.mesh.to_pyvista(), self.values)

    @cached_property
    def _vertex_gradients(self) -> Floats:
        return self.mesh.geometry.mean_gradients(self.values, self.mesh.tets, self.mesh.n_vertices)

    @cached_property
    def _planes(self) -> Planes:
        return Planes.of(self.mesh.geometry)

    @cached_property
    def _wall_tree(self) -> TriangleTree:
        return TriangleTree.of(self.mesh.vertices[self.mesh.boundary.faces])

    def _place(self, points: Floats) -> tuple[Ints, Floats, Floats]:
        """Return (k, 4) vertices and their weights at the closest point of the mesh, and (k, 3) vectors from there."""
        tets = containing_tets(self.mesh.geometry, self._planes, points)
        inside, outside = np.flatnonzero(tets >= 0), np.flatnonzero(tets < 0)
        corners = np.zeros((len(points), 4), dtype=np.int64)
        weights, away = np.zeros((len(points), 4)), np.zeros((len(points), 3))
        corners[inside] = self.mesh.tets[tets[inside]]
        weights[inside] = barycentric(self.mesh.geometry, tets[inside], points[inside])
        if len(outside):
            walls = self.mesh.boundary
            faces, coordinates = self._wall_tree.nearest(points[outside])
            corners[outside, :3], weights[outside, :3] = walls.faces[faces], coordinates
            corners[outside, 3] = corners[outside, 0]
            nearest = np.einsum("pk,pki->pi", coordinates, walls.vertices[walls.faces[faces]])
            away[outside] = points[outside] - nearest
        return corners, weights, away

    def __repr__(self) -> str:
        low, high = (float(f.reduce(self.values)) for f in (np.fmin, np.fmax))
        return f"TetField({self.mesh!r}, values from {low:.4g} to {high:.4g})"
