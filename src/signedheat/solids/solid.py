"""Solids: completed shapes, to which distance is exact anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..diagnostics import Diagnostics
from ..errors import InexactWarning, SignedHeatError, SourceError, warn_user
from ..exchange import Displayed
from ..foreign import Represented
from ..frozen import Frozen
from ..grids.grid import Grid
from ..grids.grid_field import GridField
from ..grids.solid_queries import Closest
from ..mesh.box_tree import order_in_space
from ..mesh.triangles import area_vectors, face_areas
from ..packages import lazy_module
from ..parallel import in_chunks
from ..progress import Progress
from ..reprs import short
from ..search.face_features import FaceFeatures
from ..search.face_tree import FaceTree, NearestFaces
from ..search.nearest_triangles import weights_in
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import finite_number, flag, positive_number, query_points, shaped
from .contouring import announce_lost, sharp_surface
from .kept_faces import given_surface, outward, unjoined
from .offsets import Offset, Reach
from .sample_set import Samples
from .simplification import simplified
from .stores import Scheduler
from .tiles import band_field, dense_field
from .winding import Windings

booleans: Any = lazy_module("signedheat.solids.booleans", "solids")
files: Any = lazy_module("signedheat.io.solid_files", "files")
morphology: Any = lazy_module("signedheat.morphology", "solids")
sampling: Any = lazy_module("signedheat.solids.sampling", "solids")

if TYPE_CHECKING:
    import pyvista

MANY = 1 << 18
"""Points that are put in order together."""
CLEAR = 1e-9
"""Distance to a surface, over how far from the origin it is, from which on rounding leaves the side clear."""
SLANT = 1e-3
"""Cosine between normal and direction from the foot, above which the side is clear too."""


@dataclass(frozen=True, eq=False, repr=False)
class Solid(Displayed, Represented, Frozen):
    """A shape completed: the faces that were given, and what closes them.

    `complete` makes it. Distance is to the nearest of all triangles; inside is where the winding number is above ½.
    It is taken wherever a shape is, and nothing is completed again.

    ``a | b``, ``a & b`` and ``a - b`` are union, intersection and difference of two solids, as solids: their triangles
    are cut where they cross, and kept where they bound the result; open sheets take no part. With a `GridField` in
    place of one solid they are fields on its grid, no longer exact between nodes.

    Attributes
    ----------
    triangles : (m, 3, 3) float
        Corners of all that distance is measured to, cut where bodies overlap.
    origins : (m,) int
        Face of the shape that each is part of; −1 for the completion.
    confidence : (m,) float
        Of each triangle.
    bounding : (m,) bool
        Whether it is inside behind each and outside in front.
    windings : Windings
        Decides what is inside.
    source : TriangleMesh, optional
        Triangles of the shape that was given, which barycentric coordinates refer to.
    diagnostics : Diagnostics
        Notes on what was turned, left out and completed.

    Examples
    --------
    >>> from signedheat import complete, samples
    >>> solid = complete(samples.without_faces(samples.sphere(3), 0.2))
    >>> solid.distance([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]]).round(1).tolist()
    [-1.0, 2.0]
    >>> solid.inside([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]]).tolist()
    [True, False]
    >>> half = solid - complete(samples.sphere(3, center=(0.0, 0.0, 1.0)))
    >>> half.inside([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]).tolist(), half.volume < solid.volume
    ([True, False], True)
    """

    triangles: NDArray[np.float64]
    origins: NDArray[np.int64]
    confidence: NDArray[np.float32]
    bounding: NDArray[np.bool_]
    windings: Windings
    source: TriangleMesh | None = None
    diagnostics: Diagnostics = field(default_factory=Diagnostics)

    @cached_property
    def features(self) -> FaceFeatures:
        """The triangles, and what lies around each: regular are edges and vertices between those that bound only."""
        corners = np.arange(3 * len(self.triangles)).reshape(-1, 3)
        found = FaceFeatures.of(self.triangles.reshape(-1, 3), corners, self.confidence)
        idle = ~self.bounding[found.ids]
        if not idle.any():
            return found
        edges, vertices = found.edge_regular.copy(), found.vertex_regular.copy()
        edges[found.edges[idle]] = False
        vertices[found.faces[idle]] = False
        return found._replace(edge_regular=edges, vertex_regular=vertices)

    @cached_property
    def tree(self) -> FaceTree:
        """Over the triangles."""
        return FaceTree.of(self.features)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) corners of the box around all triangles."""
        points = self.triangles.reshape(-1, 3)
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @cached_property
    def outward(self) -> NDArray[np.float64]:
        """(k, 3, 3) triangles that bound the inside, each once, corners counter-clockwise as seen from outside."""
        return outward(self)[0]

    @property
    def volume(self) -> float:
        """Of the inside, in cubic units; 0 of sheets.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> ball = complete(samples.sphere(5))
        >>> round(ball.volume, 2), round(ball.area, 2)
        (4.19, 12.56)
        """
        corners = self.outward - self.bounds.mean(axis=0)
        return float(np.einsum("ij,ij->", corners[:, 0], area_vectors(corners)) / 3)

    @property
    def area(self) -> float:
        """Of the surface around the inside, in square units; sheets do not count."""
        return float(face_areas(self.outward).sum())

    @property
    def faces(self) -> TriangleMesh:
        """What was given of the surface, cut where bodies overlap."""
        return _mesh(self.triangles[self.origins >= 0])

    @property
    def completion(self) -> TriangleMesh:
        """What closes it."""
        return _mesh(self.triangles[self.origins < 0])

    @property
    def boundary(self) -> TriangleMesh:
        """All that distance is measured to, as one mesh: faces, completion and sheets."""
        return _mesh(self.triangles)

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Signed distances of points, negative inside: exact, in time O(n log m) on all threads.

        Parameters
        ----------
        points : (..., 3) float
            Positions, in the units of the shape.

        Returns
        -------
        (...) float
            In the shape of the points: one number for one point.

        Raises
        ------
        GeometryError
            If a point is not finite.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> complete(samples.sphere(3)).distance([[0.0, 0.0, 0.5], [0.0, 0.0, 2.0]]).round(2)
        array([-0.5,  1. ])
        """
        places, shape = query_points(points, 3)
        result = np.empty(len(places))
        for begin in range(0, len(places), MANY):
            order = begin + order_in_space(places[begin : begin + MANY])
            (result[order],) = in_chunks(self._distances, places[order])
        return shaped(result, shape)

    def inside(self, points: ArrayLike) -> NDArray[np.bool_]:
        """(...) whether (..., 3) points are inside.

        Parameters
        ----------
        points : (..., 3) float
            Positions, in the units of the shape.

        Returns
        -------
        (...) bool
            True inside.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> complete(samples.without_faces(samples.sphere(3), 0.2)).inside([[0.0, 0.0, 0.5], [0.0, 0.0, 2.0]])
        array([ True, False])
        """
        places, shape = query_points(points, 3)
        return shaped(self.windings.inside(places), shape)

    def closest(self, points: ArrayLike) -> Closest:
        """The nearest place for each of (..., 3) points.

        Parameters
        ----------
        points : (..., 3) float
            Positions, in the units of the shape.

        Returns
        -------
        Closest
            Places, distances, gradients, faces and confidence, an array of the shape (...) or (..., 3) each.

        Raises
        ------
        GeometryError
            If a point is not finite.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> found = complete(samples.sphere(3)).closest([[0.0, 0.0, 2.0]])
        >>> found.points.round(3).tolist(), found.gradients.round(3).tolist()
        ([[0.0, 0.0, 1.0]], [[0.0, 0.0, 1.0]])
        """
        places, shape = query_points(points, 3)
        order = order_in_space(places)
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        results = (
            [part[back] for part in in_chunks(self._closest, places[order])] if len(places) else self._closest(places)
        )
        return Closest(*(shaped(values, shape) for values in results))

    def field(
        self,
        resolution: int = 128,
        *,
        spacing: ArrayLike | None = None,
        padding: float | None = None,
        grid: Grid | None = None,
        band: float | None = None,
        store: str | PathLike[str] | None = None,
        scheduler: Scheduler = None,
        progress: Progress | None = None,
    ) -> GridField[Literal[3]]:
        """Signed distance at the nodes of a grid: that of `distance`, found together.

        Parameters
        ----------
        resolution : int
            Nodes along the longest side of a grid around the solid.
        spacing : float or (3,) float, optional
            Distance between its nodes, in place of `resolution`.
        padding : float, optional
            Room around the solid; by default a fifth of its longest side.
        grid : Grid, optional
            Another one, wherever it is.
        band : float, optional
            Only the nodes in blocks of 8³ that may be as near to the surface as this, in units of length: for grids
            that are too fine to be whole.
        store : str or path, optional
            Folder for the values of a band, which are mapped into memory as they are used. Run again, what was stopped
            goes on. Workers must be able to read and write it.
        scheduler : concurrent.futures.Executor, distributed.Client or str, optional
            Who computes the tiles of a store: by default threads of this process; a pool, such as a
            `ProcessPoolExecutor`; or a Dask cluster, by its client or its address, such as ``"tcp://127.0.0.1:8786"``.
        progress : callable, optional
            Called as ``progress(fraction, step)``; what it raises cancels.

        Returns
        -------
        GridField
            It knows its solid: calls, closest places and contours are exact.

        Raises
        ------
        MemoryLimitError
            If it cannot fit in memory, or on the disk of the store; nothing has been allocated then.
        FileFormatError
            If the store holds something else.
        SourceError
            If a store is named without a band.

        Examples
        --------
        >>> from signedheat import samples
        >>> from signedheat.solids.completion import complete
        >>> field = complete(samples.sphere(3)).field(resolution=32)
        >>> field.values.shape, field([[0.0, 0.0, 0.9]]).round(2)
        ((32, 32, 32), array([-0.1]))
        """
        where = Grid.around(self.bounds, resolution, padding, spacing) if grid is None else grid
        if band is not None:
            return band_field(self, where, band, store, scheduler, progress)
        if store is not None or scheduler is not None:
            raise SourceError("only bands are stored tile by tile", remedy="give a band, or save the field")
        return dense_field(self, where, progress)

    def surface(
        self,
        level: float = 0.0,
        *,
        sharp: bool = True,
        keep_faces: bool = False,
        tolerance: float | None = None,
        resolution: int = 128,
        spacing: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> TriangleMesh:
        """The surface on which distance has a level: closed, manifold, its normals pointing to greater distance.

        Sharp surfaces have the edges and corners of the level, and triangles that do not pass through each other. What
        is thinner than a cell may be missing, with an `InexactWarning` if that is more than edges and tips. Memory
        grows with the surface, not with the grid.

        Parameters
        ----------
        level : float
            Signed distance, in units of length; negative inside.
        sharp : bool
            Dual contouring with exact distances, nearest places and normals; else marching cubes, which cuts edges off.
        keep_faces : bool
            At level 0, the faces that were given, cut where bodies overlap, and what completes them: exact, and of few
            triangles. Edges are divided where those of the completion are finer. Bodies that touch share edges. Where
            faces and completion do not join, the surface is contoured, with an `InexactWarning` that says where.
        tolerance : float, optional
            Simplify the surface, by manifold3d: no point of the result is farther from it than this, nor the converse.
            Where manifold3d has no such result the surface stays as it was, with an `InexactWarning`.
        resolution : int
            Nodes along the longest side of a grid around the solid, and around the surface.
        spacing : float or (3,) float, optional
            Size of the cells, in place of `resolution`.
        progress : callable, optional
            Called as ``progress(fraction, step)``; what it raises cancels.

        Returns
        -------
        TriangleMesh
            Corners of the level are in it, and edges: of turned boxes 98 % of their length to a thousandth of a cell,
            the rest to a tenth.

        Raises
        ------
        OutsideError
            If distance has the level nowhere, or only where it is thinner than a cell.
        GeometryError
            If faces are to be kept and do not join with a contour either; it says where. Or if a surface whose bodies
            touch along edges is to be simplified.
        SignedHeatError
            If faces are to be kept at another level than 0.
        MemoryLimitError
            If marching cubes cannot fit in memory; nothing has been allocated then.

        Examples
        --------
        >>> from signedheat import samples
        >>> from signedheat.solids.completion import complete
        >>> surface = complete(samples.sphere(3)).surface(-0.2, resolution=32)
        >>> bool(np.abs(np.linalg.norm(surface.vertices, axis=1) - 0.8).max() < 0.01)
        True
        """
        sharp, keep_faces = flag(sharp, "sharp"), flag(keep_faces, "keep_faces")
        if tolerance is not None:
            within = positive_number(tolerance, "tolerance")
            whole = self.surface(
                level, sharp=sharp, keep_faces=keep_faces, resolution=resolution, spacing=spacing, progress=progress
            )
            return simplified(whole, within)
        height = finite_number(level, "level")
        if keep_faces:
            if height != 0:
                raise SignedHeatError(
                    "faces that were given are on level 0", remedy="leave out keep_faces or the level"
                )
            cell = float(Grid.around(self.bounds, resolution, None, spacing).spacing.max())
            surface, places = given_surface(
                self, lambda: self.surface(resolution=resolution, spacing=spacing, progress=progress), cell
            )
            if len(places):
                warn_user(f"faces are kept but {unjoined(places)}", InexactWarning)
            return surface
        reach = self.bounds + np.array([[-1.0], [1.0]]) * max(height, 0.0)
        where = Grid.around(reach, resolution, None, spacing)
        if sharp:
            return sharp_surface(Offset(self, height), where, progress)
        contour = dense_field(self, where, progress).contour(height)
        announce_lost(Offset(self, height), where, contour.vertices)
        return contour

    def offset(
        self,
        distance: float | ArrayLike | Reach,
        *,
        corners: Literal["round", "mitre", "sharp"] = "round",
        resolution: int = 128,
        spacing: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> TriangleMesh:
        """The surface at a distance, which may vary, with round or with mitred edges: `signedheat.offset` of this.

        Parameters
        ----------
        distance : float, (n,) float, or callable
            Positive outside, in the units of the shape; as for `signedheat.offset`.
        corners : "round", "mitre" or "sharp"
            What becomes of edges that the surface moves away from.
        resolution : int
            Nodes along the longest side.
        spacing : float or (3,) float, optional
            Distance between nodes, instead of a resolution.
        progress : callable, optional
            Called as ``progress(fraction, text)``.

        Returns
        -------
        TriangleMesh
            Closed and manifold.

        Raises
        ------
        GeometryError
            If nothing of the solid is left at this distance.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> complete(samples.sphere(4)).offset(0.5, resolution=32).bounds.round(1).tolist()
        [[-1.5, -1.5, -1.5], [1.5, 1.5, 1.5]]
        """
        surface: TriangleMesh = morphology.offset(
            self, distance, corners=corners, resolution=resolution, spacing=spacing, progress=progress
        )
        return surface

    def sample(
        self, n: int = 250_000, *, near: float = 0.8, widths: Sequence[float] = (0.05, 0.0158), seed: int = 0
    ) -> Samples:
        """Points with distances and gradients, near the surface and all around it: `signedheat.sample` of this.

        Parameters
        ----------
        n : int
            Number of points.
        near : float
            Share of them near the surface.
        widths : sequence of float
            Standard deviations of the noise, over the radius of the shape.
        seed : int
            Of the random numbers.

        Returns
        -------
        Samples
            The same for the same seed.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> complete(samples.sphere(2)).sample(100, near=0.5)
        Samples(100 points, 50 near the surface, distances from -0.6 to 0.489)
        """
        taken: Samples = sampling.sample(self, n, near=near, widths=widths, seed=seed)
        return taken

    @overload
    def __or__(self, other: Solid) -> Solid: ...
    @overload
    def __or__(self, other: GridField[Literal[3]]) -> GridField[Literal[3]]: ...
    def __or__(self, other: Solid | GridField[Literal[3]]) -> Solid | GridField[Literal[3]]:
        """Union: what lies in one of the two or in both."""
        if isinstance(other, GridField):
            return self.field_on(other) | other
        return booleans.union(self, other) if isinstance(other, Solid) else NotImplemented

    @overload
    def __and__(self, other: Solid) -> Solid: ...
    @overload
    def __and__(self, other: GridField[Literal[3]]) -> GridField[Literal[3]]: ...
    def __and__(self, other: Solid | GridField[Literal[3]]) -> Solid | GridField[Literal[3]]:
        """Intersection: what lies in both."""
        if isinstance(other, GridField):
            return self.field_on(other) & other
        return booleans.intersection(self, other) if isinstance(other, Solid) else NotImplemented

    @overload
    def __sub__(self, other: Solid) -> Solid: ...
    @overload
    def __sub__(self, other: GridField[Literal[3]]) -> GridField[Literal[3]]: ...
    def __sub__(self, other: Solid | GridField[Literal[3]]) -> Solid | GridField[Literal[3]]:
        """Difference: what lies in this and not in the other."""
        if isinstance(other, GridField):
            return self.field_on(other) - other
        return booleans.difference(self, other) if isinstance(other, Solid) else NotImplemented

    def field_on(self, field: GridField[Literal[3]]) -> GridField[Literal[3]]:
        """Distance at the nodes that a field has, in a band or everywhere.

        Parameters
        ----------
        field : GridField
            In space.

        Returns
        -------
        GridField
            With a value at the same nodes.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> ball, cube = complete(samples.sphere(2)), complete(samples.sphere(1, radius=0.5))
        >>> ball.field_on(cube.field(resolution=8)).grid.shape
        (8, 8, 8)
        """
        return self.field(grid=field.grid, band=None if field.blocks is None else field.width)

    def to_pyvista(self) -> pyvista.PolyData:
        """Convert `boundary` to PyVista.

        Returns
        -------
        pyvista.PolyData
            Triangles.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> complete(samples.sphere(1)).to_pyvista().n_cells
        80
        """
        return self.boundary.to_pyvista()

    def __repr__(self) -> str:
        areas, made = face_areas(self.triangles), self.origins < 0
        low, high = (", ".join(short(float(x)) for x in corner) for corner in self.bounds)
        share = float(areas[made].sum() / max(float(areas.sum()), np.finfo(float).tiny))
        notes = "; ".join(str(note) for note in self.diagnostics.important)
        return (
            f"Solid({len(self.triangles)} triangles, {share:.1%} of their area completed,\n"
            f"      box from ({low}) to ({high}),\n"
            f"      {notes or 'as it was given'})"
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write to a file: ``.npz`` has the solid itself, other formats its surface.

        `signedheat.io.load` reads the first, without notes, and nothing is completed again. Formats of shapes, such as
        ``.stl``, have ``surface(keep_faces=True)``: the faces that were given and what completes them, closed.

        Parameters
        ----------
        path : str or path
            ``.npz``, or ``.stl``, ``.obj``, ``.ply``, ``.off``, ``.vtp``.

        Raises
        ------
        FileFormatError
            If the format is unknown, or the file cannot be written.
        GeometryError
            If a surface is to be written, and nothing is inside.

        Examples
        --------
        >>> import tempfile
        >>> from signedheat import complete, io, samples
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     complete(samples.sphere(2)).save(f"{folder}/ball.npz")
        ...     io.load(f"{folder}/ball.npz").inside([[0.0, 0.0, 0.0]])
        array([ True])
        """
        files.save_solid(self, path)

    def _distances(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64]]:
        found = self.tree.search(points)
        return (np.where(self._inside(points, found), -found.distances, found.distances),)

    def _inside(self, points: NDArray[np.float64], found: NearestFaces) -> NDArray[np.bool_]:
        """(n,) whether points are inside, whose nearest faces are known.

        No triangle is between a point and the nearest place, and sides change across triangles only: it is inside where
        it is on that side of this place, by the normal there. Where that is not clear winding numbers are counted.
        """
        clear = found.regular & self.bounding[self.features.ids[found.faces]] & (np.abs(found.cosines) > SLANT)
        clear &= found.distances > CLEAR * float(np.abs(self.tree.tree.bounds[1]).max())
        inside = found.cosines < 0
        if not clear.all():
            inside[~clear] = self.windings.inside(points[~clear])
        return inside

    def _closest(self, points: NDArray[np.float64]) -> tuple[NDArray[Any], ...]:
        found = self.tree.search(points)
        ids = self.features.ids[found.faces]
        signs = np.where(self._inside(points, found), -1.0, 1.0)
        away = points - found.places
        lengths = found.distances
        clear = lengths > 1e-12 * np.abs(points).max(initial=1e-290)
        normals = self.features.face_normals[found.faces]
        gradients = np.where(clear[:, None], away * (signs / np.where(clear, lengths, 1.0))[:, None], normals)
        origins = self.origins[ids]
        weights = np.full((len(points), 3), np.nan)
        if self.source is not None:
            given = origins >= 0
            weights[given] = weights_in(self.source.vertices[self.source.faces[origins[given]]], found.places[given])
        return signs * lengths, found.places, origins, weights, gradients, self.confidence[ids]


def _mesh(triangles: NDArray[np.float64]) -> TriangleMesh:
    if not len(triangles):
        raise SourceError("there is none of it", element="solid")
    points, corners = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return TriangleMesh(points, corners.reshape(-1, 3))
