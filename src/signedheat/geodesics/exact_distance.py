"""Distance on a polyhedral surface from line segments and points in its faces: exact, or within a tolerance.

Windows propagate from face to face in order of distance (Mitchell, Mount & Papadimitriou 1987; Chen & Han 1990), and
windows that a path through a vertex undercuts are dropped (Xin & Wang 2009). A window is an interval of an edge whose
points see one source along straight lines: a point, or, since sources here are segments too, a parallel beam at right
angles to a segment. Each vertex splits windows, so that their number per edge would grow with distance; neighbouring
windows that one circular or straight wave front approximates are therefore merged (Surazhsky et al. 2005), and the work
stays in proportion to the number of faces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..mesh.conforming_refinement import cut_along, flip_new_faces
from ..mesh.intrinsic_mesh import IntrinsicMesh
from .geodesic_sources import GeodesicSources, PlacedSegments, as_curve, through_vertices, zero_line
from .initial_windows import MADE, WANTED, Faces, Search
from .propagation_kernels import ROUND, continue_search, start_search

WINDOWS_PER_EDGE, FEW_WINDOWS, ON_SMALL = 100, 4_000_000, 1000
"""A search that makes more windows than this, on average, is cut short; on smooth surfaces ten are usual. Small meshes
of many sheets take more, which is little in all."""
MANY_PER_EDGE, MANY_WINDOWS = 30, 50_000
"""A search that makes more windows than this goes on in Delaunay triangles: through the long edges of slivers every
segment of a curve is seen."""
Report: TypeAlias = Callable[[], None]
"""Called every tenth of a second or so; an exception that it raises ends the search."""
_CHUNK = 1 << 16


def distance_to_zero_line(
    triangles: IntrinsicMesh, values: NDArray[np.float64], tolerance: float = 1e-4, report: Report | None = None
) -> tuple[NDArray[np.float64], int]:
    """Distance of every vertex to the zero set of a function that is linear in every face; and the number of windows.

    Any surface will do, nonmanifold and nonorientable ones too. Faces with a NaN corner contain no part of the zero
    set. Windows are merged where that changes distances by less than `tolerance` of the edge; 0 is exact. `report` is
    called between short stretches of work; an exception that it raises ends the search.

    Distances are inf where the zero set is not connected to the vertex. The number of windows is a measure of the work:
    if it is as large as `window_limit`, the search was cut short, and some distances are lengths of paths that run
    along edges from where it ended.
    """
    values = cleared(triangles, values, 1e-7 * float(triangles.lengths_of_edges.mean()))
    return distance_to_segments(triangles, [zero_line(triangles, values)], tolerance, report)


def distance_to_segments(
    triangles: IntrinsicMesh, placed: Sequence[PlacedSegments], tolerance: float = 1e-4, report: Report | None = None
) -> tuple[NDArray[np.float64], int]:
    """Distance of every vertex to segments and points: inside faces, along edges, at vertices; for the rest see above.

    Examples
    --------
    >>> from signedheat.mesh.curve_segments import CurveSegments
    >>> from signedheat.mesh.surface_points import points_at_vertices
    >>> triangles = IntrinsicMesh.from_lengths(np.array([[0, 1, 2]]), np.array([[4.0, 5.0, 3.0]]), 3)
    >>> point = CurveSegments.of_points(points_at_vertices(triangles, np.array([1])))
    >>> distance_to_segments(triangles, [PlacedSegments.of(triangles, [point])])[0].tolist()
    [4.0, 0.0, 5.0]
    """
    limit = window_limit(triangles)
    placed = [through_vertices(triangles, each) for each in placed]
    many = min(MANY_PER_EDGE * triangles.n_edges + MANY_WINDOWS, limit)
    search = PausedSearch.start(triangles, placed, tolerance).until(many, report)
    better = None if search.has_ended else in_delaunay_triangles(triangles, placed)
    if better is not None:
        other = PausedSearch.start(*better, tolerance).until(limit, report)
        search = other if other.has_ended else search
    search = search.until(limit, report)
    windows = min(search.windows, limit - 1) if search.has_ended else limit
    return search.distance()[: triangles.n_vertices], windows


def cleared(triangles: IntrinsicMesh, values: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Values moved away from zero by `least`, so that the zero set crosses edges and passes no vertex.

    A vertex with value zero gets the sign that fewer of its neighbours have: where both sides of a source have the same
    sign, the zero set then runs around the source.
    """
    near = np.abs(values) < least
    signs = np.where(near | np.isnan(values), 0.0, np.sign(values))
    tail, head = triangles.edges.vertices.T
    around = np.bincount(tail, signs[head], len(values)) + np.bincount(head, signs[tail], len(values))
    return np.where(near, np.where(around > 0, -least, least), values)


def is_pseudosource(triangles: IntrinsicMesh) -> NDArray[np.bool_]:
    """(n,) vertices that shortest paths can pass through: on a boundary, or with a total angle of more than 2π."""
    angles = np.arctan2(1.0, triangles.corner_cotangents)
    total = np.bincount(triangles.corner_vertices.ravel(), angles.ravel(), triangles.n_vertices)
    special = total > 2 * np.pi + 1e-9
    special[triangles.edges.vertices[triangles.edges.face_counts != 2]] = True
    return special


def window_limit(triangles: IntrinsicMesh) -> int:
    """Number of windows after which a search is cut short."""
    return min(ON_SMALL * 3 * triangles.n_faces, WINDOWS_PER_EDGE * triangles.n_edges + FEW_WINDOWS)


@dataclass(frozen=True, eq=False)
class PausedSearch:
    """A search on some triangles, in short calls of kernels between which it can be ended.

    Attributes
    ----------
    triangles : IntrinsicMesh
        The surface.
    search : Search
        What it has found; going on changes it.
    tolerance : float
        See `distance_to_zero_line`.
    """

    triangles: IntrinsicMesh
    search: Search
    tolerance: float

    @classmethod
    def start(cls, triangles: IntrinsicMesh, placed: Sequence[PlacedSegments], tolerance: float) -> PausedSearch:
        """With the windows that leave the sources."""
        each = [part.sources(triangles) for part in placed]
        sources = GeodesicSources(*(np.concatenate(arrays) for arrays in zip(*each, strict=True)))
        pseudosources = is_pseudosource(triangles)
        pseudosources[sources.vertices] = True
        faces, room = Faces.of(triangles), 1024
        while True:
            search = Search.start(triangles.n_faces, pseudosources, room)
            start_search(faces, sources, search, ROUND + 2.0 * tolerance)
            if not search.counts[WANTED]:
                return cls(triangles, search, tolerance)
            room *= 2

    @property
    def has_ended(self) -> bool:
        """Whether no window is left that could go on."""
        return bool(self.search.queue.size[0] == 0)

    @property
    def windows(self) -> int:
        """How many it has made."""
        return int(self.search.counts[MADE])

    def until(self, limit: int, report: Report | None) -> PausedSearch:
        """Go on to the end, or until so many windows have been made; returns the same search."""
        faces, search, slack = Faces.of(self.triangles), self.search, ROUND + 2.0 * self.tolerance
        while search.queue.size[0] > 0 and search.counts[MADE] < limit:
            if report is not None:
                report()
            if search.counts[WANTED]:
                search.larger().counts[WANTED] = 0
            continue_search(faces, search, slack, self.tolerance, min(search.counts[MADE] + _CHUNK, limit))
        return self

    def distance(self) -> NDArray[np.float64]:
        """(n,) of every vertex; along edges from what was reached, where it was not."""
        distance = self.search.distance
        if self.has_ended and np.isfinite(distance).all():
            return distance
        reached = np.flatnonzero(np.isfinite(distance))
        # merged windows may miss zero by their tolerance, and Dijkstra needs it
        along = distances_along_edges(self.triangles, reached, np.maximum(distance[reached], 0.0))
        # where it has ended: on other parts, or past edges so short that windows on them are lost in rounding
        return np.where(np.isinf(distance), along, distance) if self.has_ended else along


def distances_along_edges(
    triangles: IntrinsicMesh, vertices: NDArray[np.int64], offsets: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) distance of every vertex along edges from vertices (k,) that have distances of their own; inf if none.

    A vertex that is given several times starts with the least of its distances.
    """
    n = triangles.n_vertices
    tails, heads = triangles.edges.vertices.T
    rows, columns = np.concatenate([tails, np.full(len(vertices), n)]), np.concatenate([heads, vertices])
    lengths = np.concatenate([triangles.lengths_of_edges, offsets]) + 1e-300  # SciPy drops edges of length 0
    order = np.lexsort([lengths, columns, rows])
    rows, columns, lengths = rows[order], columns[order], lengths[order]
    first = np.ones(len(rows), dtype=bool)  # the shortest of the edges that join two vertices
    first[1:] = (np.diff(rows) != 0) | (np.diff(columns) != 0)
    graph = csr_matrix((lengths[first], (rows[first], columns[first])), shape=(n + 1, n + 1))
    return dijkstra(graph, directed=False, indices=n)[:n]


FLIPPED = 0.05
"""Share of the edges that are not Delaunay from which other triangles are worth their making."""


def in_delaunay_triangles(
    triangles: IntrinsicMesh, placed: Sequence[PlacedSegments]
) -> tuple[IntrinsicMesh, list[PlacedSegments]] | None:
    """The surface in Delaunay triangles along whose edges the sources run; None if there is nothing to gain.

    The triangles are cut where segments cross them, and all edges that are no part of a source are flipped. Distances
    are those on the triangles given, whose vertices come first.
    """
    if not triangles.agree_on_lengths or share_to_flip(triangles) < FLIPPED:
        return None
    parts = [as_curve(triangles, each) for each in placed]
    if any(part is None for part in parts):
        return None
    finer, merged, _, _ = cut_along(triangles, [part for part in parts if part is not None])
    flipped, merged = flip_new_faces(finer, merged, np.ones(finer.n_faces, dtype=bool))
    return flipped, [PlacedSegments.of(flipped, merged.parts([False] * len(parts)))]


def share_to_flip(triangles: IntrinsicMesh) -> float:
    """Share of the edges that have two faces, with opposite angles that sum to more than π."""
    opposite = np.roll(triangles.corner_cotangents, 1, axis=1)  # the corner facing edge k is k + 2
    sums = np.bincount(triangles.edges.face_edges.ravel(), opposite.ravel(), triangles.n_edges)
    return float(((sums < -1e-9) & (triangles.edges.face_counts == 2)).mean())
