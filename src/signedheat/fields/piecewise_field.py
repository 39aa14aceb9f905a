"""Distance that may jump across edges."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..discretization import Diagnostics
from ..domains.curves import SurfacePoints
from ..domains.triangle_mesh import TriangleMesh
from ..geometry.components import connected_components
from ..geometry.face_pairs import FacePairs, face_pairs
from ..geometry.intrinsic_mesh import IntrinsicMesh
from ..geometry.surface_points import locate_points
from .vertex_field import VertexField

if TYPE_CHECKING:
    from os import PathLike


FAR = 3.0
"""A cut has a jump of at least this many times the longest side of a typical triangle."""


@dataclass(frozen=True, eq=False)
class Cut:
    """A line along edges of the surface across which a field jumps.

    Attributes
    ----------
    vertices : (k,) int
        Vertices in order, those of `PiecewiseField.surface`; the first again at the end if the line is closed.
    points : (k, 3) float
        Where they are.
    jumps : (k - 1, 2) float
        How much higher the field is on one side of each edge than on the other, at the edge's two ends. Not negative.
    steps : (k - 1,) float
        Length of each edge, along the surface.
    """

    vertices: NDArray[np.int64]
    points: NDArray[np.float64]
    jumps: NDArray[np.float64]
    steps: NDArray[np.float64]

    @property
    def length(self) -> float:
        """Length of the line."""
        return float(self.steps.sum())

    @property
    def height(self) -> float:
        """Mean jump along the line."""
        return float(np.average(self.jumps.mean(axis=1), weights=self.steps))

    def __repr__(self) -> str:
        return f"Cut({len(self.vertices)} vertices, length {self.length:g}, mean jump {self.height:g})"


@dataclass(frozen=True, eq=False)
class PiecewiseField:
    """Signed distance, linear in every triangle, that may jump from triangle to triangle.

    Attributes
    ----------
    domain : TriangleMesh, PolygonMesh or IntrinsicTriangulation
        What distance was measured on.
    surface : TriangleMesh or IntrinsicTriangulation
        Its triangles: the domain itself, or the virtual refinement of its polygons.
    values : (m, 3) float
        φ at the corners of the triangles, in the units of the vertices; NaN where no source is connected.
    triangles : IntrinsicMesh
        The triangles as the method saw them.
    diagnostics : Diagnostics
        What happened on the way; see `signedheat.piecewise_distance`.
    """

    domain: Any
    surface: Any
    values: NDArray[np.float64]
    triangles: IntrinsicMesh = field(repr=False)
    diagnostics: Diagnostics = field(default_factory=Diagnostics, repr=False)

    @property
    def gradient(self) -> NDArray[np.float64]:
        """(m, 3) slope of φ in each triangle, in space."""
        a, b, c = (self.surface.vertices[self.surface.faces[:, k]] for k in range(3))
        first, second = b - a, c - a
        rise_first, rise_second = self.values[:, 1] - self.values[:, 0], self.values[:, 2] - self.values[:, 0]
        e, f, g = (np.einsum("ij,ij->i", u, v) for u, v in ((first, first), (first, second), (second, second)))
        area = e * g - f * f
        area = np.where(area > 0, area, np.inf)
        along_first = (g * rise_first - f * rise_second) / area
        along_second = (e * rise_second - f * rise_first) / area
        return along_first[:, None] * first + along_second[:, None] * second

    def __call__(self, points: SurfacePoints) -> NDArray[np.float64]:
        """φ at points of the surface: on an edge or at a vertex, as seen from the face through which it is given.

        Raises
        ------
        SourceError
            If a point names a face that does not exist.
        """
        places = locate_points(self.triangles, points.faces, points.barycentric)
        return (self.values[places.faces] * places.barycentric).sum(axis=1)

    @cached_property
    def jumps(self) -> NDArray[np.float64]:
        """(p, 2) jump at both ends of the edge between each of `pairs`."""
        return self.pairs.ends(self.values)

    @cached_property
    def pairs(self) -> FacePairs:
        """The triangles that meet, edge by edge."""
        return face_pairs(self.triangles)

    @cached_property
    def is_cut(self) -> NDArray[np.bool_]:
        """(p,) where φ jumps by more than it changes within a triangle, along lines on which it somewhere jumps by far.

        Bad triangles err by about their size, which is no jump.
        """
        longest = self.triangles.edge_lengths.max(axis=1)
        typical = float(np.average(longest, weights=self.triangles.face_areas))
        height = np.abs(self.jumps).max(axis=1)
        high = np.flatnonzero(height > np.maximum(longest[self.pairs.faces].max(axis=1), typical))
        ends = self.triangles.edges.vertices[self.pairs.edges[high]]
        n = self.triangles.n_vertices
        line = connected_components(n, *ends.T)[ends[:, 0]]
        far = np.zeros(n, dtype=bool)
        far[line[height[high] > FAR * typical]] = True
        result = np.zeros(len(height), dtype=bool)
        result[high[far[line]]] = True
        return result

    @cached_property
    def cut(self) -> list[Cut]:
        """The lines across which φ jumps, longest first; none if it is continuous."""
        pairs = np.flatnonzero(self.is_cut)
        edges = self.pairs.edges[pairs]
        height = np.abs(self.jumps[pairs])
        edges, first, which = np.unique(edges, return_index=True, return_inverse=True)
        largest = np.zeros((len(first), 2))
        np.maximum.at(largest, which, height)
        lengths = self.triangles.lengths_of_edges
        lines = []
        for chain, forward in chains(self.triangles.edges.vertices[edges]):
            ends = self.triangles.edges.vertices[edges[chain]]
            ends = np.where(forward[:, None], ends, ends[:, ::-1])
            vertices = np.concatenate([ends[:, 0], ends[-1:, 1]])
            jumps = np.where(forward[:, None], largest[chain], largest[chain][:, ::-1])
            lines.append(Cut(vertices, self.surface.vertices[vertices], jumps, lengths[edges[chain]]))
        return sorted(lines, key=lambda line: -line.length)

    def split(self) -> VertexField:
        """The same field on a mesh whose vertices are doubled along the cut, for viewers and for contours.

        Away from the cut, corners that meet take their mean. Faces keep their numbers.
        """
        owner, vertices = self.glued
        count = np.bincount(owner)
        values = np.bincount(owner, self.values.ravel()) / count
        mesh = TriangleMesh(self.surface.vertices[vertices], owner.reshape(-1, 3))
        return VertexField(mesh, values, self.diagnostics)

    @cached_property
    def glued(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(3m,) who is who among corners that no cut parts, and the vertex at which each of them lies."""
        whole = ~self.is_cut
        ends = np.concatenate([self.pairs.tails[whole], self.pairs.heads[whole]])
        owner = connected_components(self.values.size, *ends.T)
        _, first = np.unique(owner, return_index=True)
        return owner, self.surface.faces.ravel()[first]

    def contour(self, level: float = 0.0) -> list[Any]:
        """The lines φ = level, as curves on the surface with higher values on their left; they end at the cut."""
        return self.split().contour(level)

    def save(self, path: str | PathLike[str]) -> None:
        """Write `split`, so that viewers show the jump; the extension says the format."""
        self.split().save(path)

    def __repr__(self) -> str:
        low, high = (float(f.reduce(self.values, axis=None)) for f in (np.fmin, np.fmax))
        return f"PiecewiseField({self.domain!r}, values from {low:g} to {high:g}, {len(self.cut)} cuts)"


def chains(edges: NDArray[np.int64]) -> list[tuple[NDArray[np.int64], NDArray[np.bool_]]]:
    """Put edges in line, end to end; lines end where not exactly two edges meet.

    Parameters
    ----------
    edges : (k, 2) int
        Vertex ids.

    Returns
    -------
    list of ((j,) int, (j,) bool)
        Edges of each line in order, and whether each is run from its first vertex to its second.

    Examples
    --------
    >>> [(edges.tolist(), forward.tolist()) for edges, forward in chains(np.array([[5, 7], [9, 7], [9, 2]]))]
    [([0, 1, 2], [True, False, True])]
    """
    at: dict[int, list[int]] = {}
    for k, (tail, head) in enumerate(edges.tolist()):
        at.setdefault(tail, []).append(k)
        at.setdefault(head, []).append(k)
    left = np.ones(len(edges), dtype=bool)
    ends = [v for v, incident in at.items() if len(incident) != 2]
    starts = [(v, k) for v in ends for k in at[v]] + [(int(tail), k) for k, tail in enumerate(edges[:, 0])]
    found = []
    for vertex, edge in starts:
        line, forward = [], []
        while left[edge]:
            left[edge] = False
            line.append(edge)
            forward.append(bool(edges[edge, 0] == vertex))
            vertex = int(edges[edge, 1] if forward[-1] else edges[edge, 0])
            if len(at[vertex]) == 2:
                edge = at[vertex][0] if at[vertex][1] == edge else at[vertex][1]
        if line:
            found.append((np.array(line), np.array(forward)))
    return found
