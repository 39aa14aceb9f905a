"""Solids: completed shapes, to which distance is exact everywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Frozen, Ints, place
from ..diagnostics import CompletedArea, Diagnostics, Note
from ..errors import InexactWarning, SourceError, UnsupportedTypeError, counted, percent, warn_user
from ..fields.field import Field
from ..fields.solid_queries import Closest
from ..grids.band import Band
from ..grids.grid import RESOLUTION, Grid
from ..jobs import Progress, bound_progress
from ..mesh.box_tree import order_in_space
from ..mesh.triangles import face_areas, part_volumes
from ..mesh.welding import indexed
from ..packages import lazy_module
from ..parallel import in_chunks
from ..search.face_tree import FaceFeatures, FaceTree
from ..search.nearest_triangles import weights_in
from ..shapes.exchange import Displayed
from ..shapes.foreign import Represented
from ..shapes.transforms import transformed
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import (
    finite_number,
    flag,
    positive_number,
    public_call,
    query_points,
    refuse_beside,
    shaped,
)
from .contouring import announce_lost, sharp_surface
from .kept_faces import kept_surface
from .offsets import Offset, Reach
from .sample_set import NOISE_WIDTHS, Samples
from .sections import Plane, Section, section_levels, sections
from .simplification import simplified
from .tiles import Scheduler, band_field, dense_field
from .winding import ON_SURFACE, Windings

files: Any = lazy_module("signedheat.io.shape_files", "files")
morphology: Any = lazy_module("signedheat.morphology", "solids")
sampling: Any = lazy_module("signedheat.solids.sampling", "solids")
unions: Any = lazy_module("signedheat.solids.union", "solids")

if TYPE_CHECKING:
    import pyvista
    import trimesh

POINTS_SORTED = 1 << 18
"""Points are sorted in space in batches of this size before they are searched for."""


@dataclass(frozen=True, eq=False, repr=False)
class Solid(Displayed, Represented, Frozen):
    """A completed shape: its given faces, and those that close it.

    `complete` returns solids. Distance is to the nearest triangle. A point is inside if its winding number is above ½,
    which says how often the faces go around it: 1 inside a closed surface, and 0 outside. Every function that takes a
    shape also takes a solid, and does not complete it again.

    ``a | b``, ``a & b`` and ``a - b`` are the union, intersection and difference of two solids. Their triangles are cut
    where they cross and kept where they bound the result; open sheets are ignored. If one of the two is a `Field`,
    the result is a field on its grid, which is not exact between nodes.

    Attributes
    ----------
    triangles : (m, 3, 3) float
        All triangles that distance is measured to, cut where bodies overlap, in the units of the shape.
    origins : (m,) int
        Face of the shape that each triangle is part of; −1 in the completion.
    confidence : (m,) float
        Confidence in each triangle, from 0 to 1: 1 where it was given, less for patches, the farther they are from
        given faces.
    bounding : (m,) bool
        Whether a triangle has the inside behind it and the outside in front.
    windings : Windings
        Evaluates winding numbers of the triangles that bound the inside, at any point.
    source : TriangleMesh, optional
        Triangles of the input, to whose faces `origins` and barycentric coordinates refer; None if it was not a mesh.
    diagnostics : Diagnostics
        Notes on faces that were flipped, left out and added.
    uncrossed : bool
        Whether the triangles are known not to cross each other, so that this need not be checked again.

    See Also
    --------
    complete : Make a solid of a broken shape.
    signed_distance : Distance on a grid, on tets or along a surface.
    offset : The closed surface at a distance.
    deviation : Compare a scan with a part.

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

    triangles: Floats
    origins: Ints
    confidence: NDArray[np.float32]
    bounding: Bools
    windings: Windings
    source: TriangleMesh | None = None
    diagnostics: Diagnostics = field(default_factory=Diagnostics)
    uncrossed: bool = False

    def __post_init__(self) -> None:
        if not len(self.triangles):
            raise SourceError("nothing is left of the shape", element="shape")

    @cached_property
    def features(self) -> FaceFeatures:
        """The triangles with their neighbours across edges and at corners, as the search for nearest points needs."""
        faces = np.arange(3 * len(self.triangles)).reshape(-1, 3)
        return FaceFeatures.of(self.triangles.reshape(-1, 3), faces, self.confidence, self.bounding)

    @cached_property
    def tree(self) -> FaceTree:
        """Search tree over the triangles."""
        return FaceTree.of(self.features)

    @cached_property
    def _given_tree(self) -> FaceTree:
        """Search tree over the triangles that are parts of given faces, or over all if none are."""
        given = self.origins >= 0
        return self.tree if given.all() or not given.any() else FaceTree.of_triangles(self.triangles[given])

    @property
    def bounds(self) -> Floats:
        """(2, 3) lower and upper corner of the box around all triangles, in the units of the shape."""
        points = self.triangles.reshape(-1, 3)
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @cached_property
    def outward(self) -> Floats:
        """(k, 3, 3) triangles that bound the inside, counter-clockwise as seen from outside."""
        return self.triangles[self.bounding]

    @property
    def volume(self) -> float:
        """Volume of the inside, in cubic units; 0 for sheets.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> ball = complete(samples.sphere(5))
        >>> round(ball.volume, 2), round(ball.area, 2)
        (4.19, 12.56)
        """
        return float(part_volumes(*indexed(self.outward))[1].sum()) if self.bounding.any() else 0.0

    @property
    def area(self) -> float:
        """Area of the boundary of the inside, in square units; sheets do not count."""
        return float(face_areas(self.outward).sum())

    @property
    def faces(self) -> TriangleMesh:
        """The faces of the input as a mesh, flipped where needed and cut where bodies overlap, with all sheets."""
        return _mesh(self.triangles[self.origins >= 0])

    @property
    def completion(self) -> TriangleMesh:
        """The faces that were added to close the shape."""
        return _mesh(self.triangles[self.origins < 0])

    @property
    def boundary(self) -> TriangleMesh:
        """All faces, including the completion and sheets, as one mesh."""
        return _mesh(self.triangles)

    @public_call
    def distance(self, points: ArrayLike, *, signed: bool = True) -> Floats:
        """Compute exact signed distances of points, negative inside, in time O(n log m) on all threads.

        Unsigned distance is measured only to faces that were given, not to those that complete them. It suits clothes
        and other open surfaces, and networks that learn these. If no face was given, as in a shape of points, it is
        measured to the completed surface.

        Parameters
        ----------
        points : (..., 3) float
            Positions, in the units of the shape.
        signed : bool
            With True, distances are to the closed surface, and negative inside. With False, they are to given faces,
            and never negative.

        Returns
        -------
        (...) float
            Distances, in the units of the shape.

        Raises
        ------
        GeometryError
            If a point is not finite.

        See Also
        --------
        Solid.closest : Nearest points, gradients and confidence, too.
        complete : With ``completion="none"``, nothing is completed at all.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> complete(samples.sphere(3)).distance([[0.0, 0.0, 0.5], [0.0, 0.0, 2.0]]).round(2)
        array([-0.5,  1. ])
        """
        is_signed = flag(signed, "signed")
        tree = self.tree if is_signed else self._given_tree

        def measured(chunk: Floats) -> tuple[Floats]:
            """(k,) distances of (k, 3) points."""
            nearest = tree.search(chunk)
            inside = is_signed and self.windings.inside_near(chunk, nearest)
            return (np.where(inside, -nearest.distances, nearest.distances),)

        queries, shape = query_points(points, 3)
        result = np.empty(len(queries))
        for begin in range(0, len(queries), POINTS_SORTED):
            order = begin + order_in_space(queries[begin : begin + POINTS_SORTED])
            (result[order],) = in_chunks(measured, queries[order])
        return shaped(result, shape)

    @public_call
    def inside(self, points: ArrayLike) -> Bools:
        """Find which points are inside.

        Parameters
        ----------
        points : (..., 3) float
            Positions, in the units of the shape.

        Returns
        -------
        (...) bool
            True for points inside.

        Raises
        ------
        GeometryError
            If a point is not finite, or does not have three coordinates.

        See Also
        --------
        Solid.distance : The distance, too.
        Solid.closest : The nearest point, too.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> complete(samples.without_faces(samples.sphere(3), 0.2)).inside([[0.0, 0.0, 0.5], [0.0, 0.0, 2.0]])
        array([ True, False])
        """
        queries, shape = query_points(points, 3)
        return shaped(self.windings.inside(queries), shape)

    @public_call
    def closest(self, points: ArrayLike) -> Closest:
        """Find the nearest point of the surface for each point.

        Parameters
        ----------
        points : (..., 3) float
            Positions, in the units of the shape.

        Returns
        -------
        Closest
            Nearest points, signed distances, gradients and confidence, in arrays of shape (...) or (..., 3). Also the
            faces of the given shape on which the nearest points lie, −1 on the completion, and barycentric coordinates
            there, NaN on the completion and in faces other than triangles.

        Raises
        ------
        GeometryError
            If a point is not finite.

        See Also
        --------
        Solid.distance : The distance alone.
        Solid.inside : The side alone.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> found = complete(samples.sphere(3)).closest([[0.0, 0.0, 2.0]])
        >>> found.points.round(3).tolist(), found.gradients.round(3).tolist()
        ([[0.0, 0.0, 1.0]], [[0.0, 0.0, 1.0]])
        """
        queries, shape = query_points(points, 3)
        order = order_in_space(queries)
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        return Closest(*(shaped(values[back], shape) for values in in_chunks(self._closest, queries[order])))

    @public_call
    def field(
        self,
        resolution: int | None = None,
        *,
        spacing: ArrayLike | None = None,
        padding: float | None = None,
        grid: Grid | None = None,
        band: float | None = None,
        store: str | PathLike[str] | None = None,
        scheduler: Scheduler = None,
        progress: Progress | None = None,
    ) -> Field[Grid[Literal[3]]]:
        """Compute the signed distance at the nodes of a grid.

        Parameters
        ----------
        resolution : int, optional
            Number of nodes along the longest side of a grid around the solid; 128 by default.
        spacing : float or (3,) float, optional
            Distance between nodes, in place of `resolution`, in the units of the shape; by default it follows from it.
        padding : float, optional
            Distance between the solid and the boundary of the grid, in the units of the shape; by default a fifth of
            the solid's longest side.
        grid : Grid, optional
            A grid of your own, in place of the default one around the solid.
        band : float, optional
            Compute only blocks of 8³ nodes that may be within this distance of the surface, in the units of the shape,
            for very fine grids. By default all nodes are computed.
        store : str or path, optional
            Folder for the values of a band, which are mapped into memory as they are used. By default they are in
            memory. A second run resumes where the first was stopped. Workers must be able to read and write it.
        scheduler : concurrent.futures.Executor, distributed.Client or str, optional
            What computes the tiles of a store: a pool, such as a `ProcessPoolExecutor`, or a Dask cluster, by its
            client or its address, such as ``"tcp://127.0.0.1:8786"``. By default, threads of this process.
        progress : callable, optional
            Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
            begins. An exception that it raises cancels.

        Returns
        -------
        Field
            Signed distances on the grid, or on a `Band` of it. Interpolation, closest points and contours of it are
            exact, since it keeps the solid.

        Raises
        ------
        MemoryLimitError
            If the field does not fit in memory, or on the disk of the store. Raised before anything is allocated.
        FileFormatError
            If the store holds another field.
        SourceError
            If a store is named without a band, or a scheduler without a store.
        UnsupportedTypeError
            If a grid is given, and options for the one around the solid, too.

        See Also
        --------
        signed_distance : The same of a shape that is not completed yet.
        Solid.distance : Distance at points, without a grid.

        Examples
        --------
        >>> from signedheat import samples
        >>> from signedheat.solids.completion import complete
        >>> field = complete(samples.sphere(3)).field(resolution=32)
        >>> field.values.shape, field([[0.0, 0.0, 0.9]]).round(2)
        ((32, 32, 32), array([-0.1]))
        """
        if grid is None:
            where = Grid.around(self.bounds, RESOLUTION if resolution is None else resolution, padding, spacing)
        else:
            refuse_beside("a grid", resolution=resolution, spacing=spacing, padding=padding)
            where = grid.grid if isinstance(grid, Band) else grid
        if scheduler is not None and store is None:
            raise SourceError("a scheduler computes the tiles of a store", remedy="name a store", element="scheduler")
        if band is not None:
            return band_field(self, where, band, store, scheduler)
        if store is not None:
            raise SourceError("only bands are stored tile by tile", remedy="give a band, or save the field")
        return dense_field(self, where)

    @public_call
    def surface(
        self,
        level: float | None = None,
        *,
        spacing: ArrayLike | None = None,
        resolution: int | None = None,
        sharp: bool = True,
        tolerance: float | None = None,
        progress: Progress | None = None,
    ) -> TriangleMesh:
        """Return the closed surface of the solid: the input's faces and their completion, or a contour.

        Without a level, a spacing or a resolution, the faces are kept, and cut where bodies overlap. This is exact and
        has few triangles. Edges are divided where the completion is finer. Where faces and completion do not join, the
        surface is contoured, with an `InexactWarning` that says where.

        With a level, a spacing or a resolution, the result is a contour: triangles of even size in the cells of a grid,
        with normals towards greater distance. A sharp contour keeps edges and corners, and does not intersect itself.
        Parts thinner than a cell may be missing, with an `InexactWarning` if they are more than edges and tips. Memory
        grows with the surface, not with the grid.

        Parameters
        ----------
        level : float, optional
            Contour the surface at this signed distance, in units of length, negative inside. By default
            0, if there is a spacing or a resolution.
        spacing : float or (3,) float, optional
            Contour with cells of this size, in units of length. By default it follows from `resolution`.
        resolution : int, optional
            Contour with this number of nodes along the longest side of a grid that contains the solid and the surface;
            128 if only a level is given.
        sharp : bool
            Whether to contour by dual contouring with exact distances and normals, the default, or else by marching
            cubes, which cut edges off.
        tolerance : float, optional
            Simplify the surface with manifold3d, by a length: no point of either surface is farther than this from the
            other. If manifold3d finds no such surface, it is not simplified, with an `InexactWarning`.
        progress : callable, optional
            Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
            begins. An exception that it raises cancels.

        Returns
        -------
        TriangleMesh
            A closed mesh with an inside, in which each edge has two faces. A sharp contour has the corners and edges of
            the level: on rotated boxes, 98 % of the length of edges is exact to a thousandth of a cell, and the rest to
            a tenth.

        Raises
        ------
        OutsideError
            If the distance takes this value nowhere, or only in parts thinner than a cell.
        GeometryError
            If faces are to be kept but bound nothing; or if a surface whose bodies touch along edges is to be
            simplified.
        MemoryLimitError
            If the cells do not fit in memory. Raised before they are allocated.

        See Also
        --------
        offset : Round, mitred or sharp corners, and distances that vary.
        Solid.to_trimesh : The same surface as an object of trimesh.

        Examples
        --------
        >>> from signedheat import samples
        >>> from signedheat.solids.completion import complete
        >>> open_ball = samples.without_faces(samples.sphere(3), 0.01)
        >>> solid = complete(open_ball)
        >>> kept, contour = solid.surface(), solid.surface(-0.2, resolution=32)
        >>> kept.n_faces == open_ball.n_faces + solid.completion.n_faces
        True
        >>> bool(np.abs(np.linalg.norm(contour.vertices, axis=1) - 0.8).max() < 0.02)
        True
        """
        smooth = not flag(sharp, "sharp")
        if tolerance is not None:
            within = positive_number(tolerance, "tolerance")
            whole = self.surface(level, spacing=spacing, resolution=resolution, sharp=sharp, progress=bound_progress())
            return simplified(whole, within)
        if level is None and spacing is None and resolution is None and not smooth:
            kept = kept_surface(self)
            if kept.note:
                warn_user(kept.note, InexactWarning)
            return kept.mesh
        height = 0.0 if level is None else finite_number(level, "level")
        reach = self.bounds + np.array([[-1.0], [1.0]]) * max(height, 0.0)
        where = Grid.around(reach, RESOLUTION if resolution is None else resolution, None, spacing)
        if not smooth:
            return sharp_surface(Offset(self, height), where)
        contour = dense_field(self, where).contour(height)
        announce_lost(Offset(self, height), where, contour.vertices)
        return contour

    def offset(
        self,
        distance: float | ArrayLike | Reach,
        *,
        corners: morphology.Corners = "round",
        resolution: int = 128,
        spacing: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> TriangleMesh:
        """Extract the surface at a distance, with round, mitred or sharp edges: see `signedheat.offset`.

        Parameters
        ----------
        distance : float, (n,) float, or callable
            Distance of the surface from the solid, positive outside, in the units of the shape; see
            `signedheat.offset` for arrays and functions.
        corners : "round", "mitre" or "sharp"
            Shape of edges where offset faces move apart, as for `signedheat.offset`; by default they are rounded.
        resolution : int
            Number of nodes along the longest side of the grid, 128 by default.
        spacing : float or (3,) float, optional
            Distance between nodes, in the units of the shape. By default it follows from `resolution`.
        progress : callable, optional
            Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
            begins. An exception that it raises cancels.

        Returns
        -------
        TriangleMesh
            The surface, closed and manifold, with normals that point away from the inside.

        Raises
        ------
        GeometryError
            If nothing is left of the solid at this distance.

        See Also
        --------
        offset : All options, and shapes that are not completed yet.
        Solid.surface : The surface itself.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> complete(samples.sphere(4)).offset(0.5, resolution=32).bounds.round(1).tolist()
        [[-1.5, -1.5, -1.5], [1.5, 1.5, 1.5]]
        """
        return morphology.offset(
            self, distance, corners=corners, resolution=resolution, spacing=spacing, progress=progress
        )

    def sample(
        self, n: int = 250_000, *, near: float = 0.8, widths: Sequence[float] = NOISE_WIDTHS, seed: int = 0
    ) -> Samples:
        """Sample points with distances and gradients, near the surface and around it: see `sample_distances`.

        Parameters
        ----------
        n : int
            Number of points, 250,000 by default.
        near : float
            Fraction of the points that are drawn near the surface, from 0 to 1.
        widths : sequence of float
            Standard deviations of the noise that moves those points off the surface, relative to the radius of the
            shape.
        seed : int
            Seed of the random numbers.

        Returns
        -------
        Samples
            Points, distances and gradients, with the centre and radius of the shape.

        See Also
        --------
        sample_distances : All options, and shapes that are not completed yet.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> complete(samples.sphere(2)).sample(100, near=0.5)
        Samples(100 points, 50 near the surface, distances from -0.6 to 0.489)
        """
        return sampling.sample_distances(self, n, near=near, widths=widths, seed=seed)

    @overload
    def section(self, origin: ArrayLike, normal: ArrayLike = (0.0, 0.0, 1.0), *, heights: None = None) -> Section: ...
    @overload
    def section(
        self, origin: ArrayLike, normal: ArrayLike = (0.0, 0.0, 1.0), *, heights: ArrayLike
    ) -> list[Section]: ...
    @public_call
    def section(
        self, origin: ArrayLike, normal: ArrayLike = (0.0, 0.0, 1.0), *, heights: ArrayLike | None = None
    ) -> Section | list[Section]:
        """Cut the solid by a plane, or by parallel planes, and return closed outlines.

        The outlines are exact, and closed even if the plane passes through vertices and edges. Where faces lie in the
        plane, the solid on either side of it counts.

        Parameters
        ----------
        origin : (3,) float
            A point of the plane, in the units of the shape.
        normal : (3,) float
            Its normal, of any length; z by default.
        heights : (k,) float, optional
            Cut by k planes at these distances from the origin along the normal, in one pass. By default there is one
            plane, through `origin`.

        Returns
        -------
        Section, or list of Section if heights are given
            The outlines in each plane, none where it misses the solid.

        Raises
        ------
        GeometryError
            If the normal has no length, or a number is not finite.

        See Also
        --------
        Solid.cut : Both halves of a solid, closed.
        to_shapely : The outlines as polygons with holes.
        io.write_polylines : Write the outlines to a drawing.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> ball = complete(samples.without_faces(samples.sphere(5), 0.1))
        >>> round(ball.section((0, 0, 0.6)).area, 2)  # a circle of radius 0.8
        2.01
        >>> [round(cut.area, 2) for cut in ball.section((0, 0, 0), (1, 1, 0), heights=[-0.8, 0.0, 2.0])]
        [1.13, 3.14, 0.0]
        """
        plane, levels = Plane.of(origin, normal), section_levels(heights)
        surface = self.surface() if self.bounding.any() else None
        cuts = sections(surface, self.triangles[~self.bounding], plane, levels)
        return cuts[0] if heights is None else cuts

    @public_call
    def cut(self, origin: ArrayLike, normal: ArrayLike = (0.0, 0.0, 1.0)) -> tuple[Solid, Solid]:
        """Cut the solid in two by a plane, and close both halves by flat caps; sheets are left out.

        Parameters
        ----------
        origin : (3,) float
            A point of the plane, in the units of the shape.
        normal : (3,) float
            Its normal, of any length; z by default.

        Returns
        -------
        tuple of Solid
            The part that the normal points to, and the part behind the plane. Caps are part of their completion.

        Raises
        ------
        GeometryError
            If the normal has no length, a number is not finite, or nothing is inside.
        OutsideError
            If the plane leaves all of the solid on one side.

        See Also
        --------
        Solid.section : The outlines of the cut.
        fill_holes : Close holes, and leave the rest of a mesh as it is.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> above, below = complete(samples.sphere(5)).cut((0, 0, 0.5))
        >>> round(above.volume, 2), round(below.volume, 2)  # of the segment, π h² (1 - h / 3) for h = 0.5
        (0.65, 3.53)
        """
        return unions.halves(self, Plane.of(origin, normal))

    @overload
    def __or__(self, other: Solid) -> Solid: ...
    @overload
    def __or__(self, other: Field[Grid[Literal[3]]]) -> Field[Grid[Literal[3]]]: ...
    def __or__(self, other: Solid | Field[Grid[Literal[3]]]) -> Solid | Field[Grid[Literal[3]]]:
        """Union: points in either of the two."""
        if isinstance(other, Field):
            return self.field_on(other) | other
        return unions.union(self, other) if isinstance(other, Solid) else NotImplemented

    @overload
    def __and__(self, other: Solid) -> Solid: ...
    @overload
    def __and__(self, other: Field[Grid[Literal[3]]]) -> Field[Grid[Literal[3]]]: ...
    def __and__(self, other: Solid | Field[Grid[Literal[3]]]) -> Solid | Field[Grid[Literal[3]]]:
        """Intersection: points in both."""
        if isinstance(other, Field):
            return self.field_on(other) & other
        return unions.intersection(self, other) if isinstance(other, Solid) else NotImplemented

    @overload
    def __sub__(self, other: Solid) -> Solid: ...
    @overload
    def __sub__(self, other: Field[Grid[Literal[3]]]) -> Field[Grid[Literal[3]]]: ...
    def __sub__(self, other: Solid | Field[Grid[Literal[3]]]) -> Solid | Field[Grid[Literal[3]]]:
        """Difference: points in this and not in the other."""
        if isinstance(other, Field):
            return self.field_on(other) - other
        return unions.difference(self, other) if isinstance(other, Solid) else NotImplemented

    def field_on(self, field: Field[Grid[Literal[3]]]) -> Field[Grid[Literal[3]]]:
        """Compute the signed distance to this solid at the nodes of another field.

        Parameters
        ----------
        field : Field
            A field on a grid in space, or in a band of one. Its values are not used.

        Returns
        -------
        Field
            On the same grid, or in a band of the same width around this solid.

        Raises
        ------
        UnsupportedTypeError
            If the field is not on a grid.

        See Also
        --------
        Solid.field : A grid around the solid.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> ball, cube = complete(samples.sphere(2)), complete(samples.sphere(1, radius=0.5))
        >>> ball.field_on(cube.field(resolution=8)).domain.shape
        (8, 8, 8)
        """
        domain = field.domain
        if not isinstance(domain, Grid):
            raise UnsupportedTypeError(
                f"a solid is not combined with a field on a {type(domain).__name__}",
                remedy="combine it with one on a grid",
                element=type(domain).__name__,
            )
        if isinstance(domain, Band):
            return self.field(grid=domain.grid, band=domain.width)
        return self.field(grid=domain)

    def _surface_on(self, field: Field[Grid[Literal[3]]], level: float) -> TriangleMesh:
        """Contour this solid at a level with sharp edges, from a field of its distances that was computed before."""
        # as blocks of the grid hold them, so that both ways give the same mesh
        heights = field.values.astype(np.float32).astype(np.float64) - level
        rounded = heights.astype(np.float32).astype(np.float64)
        return sharp_surface(Offset(self, level), field.domain, heights=rounded)

    def to_pyvista(self) -> pyvista.PolyData:  # described in `Displayed`
        return self.boundary.to_pyvista()

    def to_trimesh(self) -> trimesh.Trimesh:
        """Convert the surface to trimesh.

        Returns
        -------
        trimesh.Trimesh
            All faces, including the completion and sheets (`boundary`), in the units of the shape.

        Raises
        ------
        MissingPackageError
            If trimesh is not installed.

        See Also
        --------
        Solid.surface : The closed surface, without sheets.

        Examples
        --------
        >>> import signedheat as sh
        >>> sh.complete(sh.samples.without_faces(sh.samples.sphere(1), 0.1)).to_trimesh().is_watertight
        True
        """
        return self.boundary.to_trimesh()

    def __repr__(self) -> str:
        areas, made = face_areas(self.triangles), self.origins < 0
        low, high = (place(corner, self.bounds) for corner in self.bounds)
        share = float(areas[made].sum() / max(float(areas.sum()), np.finfo(float).tiny))
        notes = "; ".join(str(note) for note in self.diagnostics.important)
        return (
            f"Solid({counted(len(self.triangles), 'triangle')}, {percent(share)} of their area completed,\n"
            f"      box from {low} to {high},\n"
            f"      {notes or 'as it was given'})"
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write the solid to a ``.npz`` file, or its surface to another format.

        `signedheat.read` reads a ``.npz`` file, without notes, and does not complete the shape again. Formats of
        shapes, such as ``.stl``, hold ``surface()``.

        Parameters
        ----------
        path : str or path
            ``.npz``, or ``.stl``, ``.obj``, ``.ply``, ``.off``, ``.vtp``.

        Raises
        ------
        FileFormatError
            If the format is unknown, or the file cannot be written.
        GeometryError
            If a surface is to be written, but nothing is inside.

        See Also
        --------
        read : Read a solid or a surface.
        Solid.surface : The surface that is written.

        Examples
        --------
        >>> import tempfile
        >>> from signedheat import complete, io, samples
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     complete(samples.sphere(2)).save(f"{folder}/ball.npz")
        ...     io.read(f"{folder}/ball.npz").inside([[0.0, 0.0, 0.0]])
        array([ True])
        """
        files.save_solid(self, path)

    def _closest(self, points: Floats) -> tuple[NDArray[Any], ...]:
        """Return what `Closest` holds, in order, for (n, 3) points.

        That is (n,) signed distances, (n, 3) nearest points, (n,) faces or −1, (n, 3) barycentric coordinates or NaN,
        (n, 3) gradients and (n,) confidence.
        """
        nearest = self.tree.search(points)
        ids = self.features.ids[nearest.faces]  # of triangles of the solid; `origins` are faces of its source
        signs = np.where(self.windings.inside_near(points, nearest), -1.0, 1.0)
        away = points - nearest.places
        lengths = nearest.distances
        off = lengths > ON_SURFACE * np.abs(points).max(initial=1e-290)  # `initial` keeps this above 0 for points at 0
        normals = self.features.face_normals[nearest.faces]
        gradients = np.where(off[:, None], away * (signs / np.where(off, lengths, 1.0))[:, None], normals)
        origins = self.origins[ids]
        weights = np.full((len(points), 3), np.nan)
        if self.source is not None:
            given = origins >= 0
            weights[given] = weights_in(self.source.vertices[self.source.faces[origins[given]]], nearest.places[given])
        return signs * lengths, nearest.places, origins, weights, gradients, self.confidence[ids]


def completed_area(triangles: Floats, made: Bools) -> list[Note]:
    """Return a note on how much of the area of (m, 3, 3) triangles was completed, and where; none if nothing was.

    `made` tells which of the (m,) triangles were.
    """
    if not made.any():
        return []
    areas, corners = face_areas(triangles), triangles[made].reshape(-1, 3)
    area, box = float(areas[made].sum()), np.stack([corners.min(axis=0), corners.max(axis=0)])
    total = max(float(areas.sum()), np.finfo(float).tiny)  # avoids a division by 0
    return [CompletedArea(area, area / total, [box.tolist()])]


def still_true(notes: Sequence[Note], triangles: Floats, made: Bools) -> tuple[Note, ...]:
    """Return the notes of solids that were moved or combined, with a new one on the completed area of the result."""
    others = [note for note in notes if not isinstance(note, CompletedArea)]
    return (*others, *completed_area(triangles, made))


def _mesh(triangles: Floats) -> TriangleMesh:
    """Make a mesh of (m, 3, 3) triangles, with one vertex for each position."""
    if not len(triangles):
        raise SourceError("this part of the solid has no triangles", element="solid")
    return TriangleMesh(*indexed(triangles))


@transformed.register
def _(shape: Solid, linear: Floats, move: Floats) -> Solid:
    """Transform a solid by a (3, 3) linear map, then a (3,) translation; its diagnostics are kept as far as true."""
    corners = slice(None, None, 1 if np.linalg.det(linear) > 0 else -1)

    def moved(triangles: Floats) -> Floats:
        """(m, 3, 3) transformed triangles; corners that are equal stay equal to the last bit."""
        points = sum((triangles[..., k, None] * linear[:, k] for k in range(3)), start=np.zeros(3)) + move
        return np.ascontiguousarray(points[:, corners])

    triangles, closing = moved(shape.triangles), moved(shape.windings.triangles)
    source = None if shape.source is None else cast("TriangleMesh", transformed(shape.source, linear, move))
    notes = still_true(shape.diagnostics.notes, triangles, shape.origins < 0)
    diagnostics = replace(shape.diagnostics, notes=notes)
    return replace(
        shape,
        triangles=triangles,
        windings=Windings(closing),
        source=source,
        diagnostics=diagnostics,
        uncrossed=False,
    )
