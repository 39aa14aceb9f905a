"""Deviations of a scan from a nominal part."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Frozen, Ints
from ..errors import SourceError, counted
from ..jobs import Progress, Stopwatch, bound_progress, part_of_work, run_cancellable
from ..mesh.triangles import face_areas
from ..packages import lazy_module
from ..search.face_tree import EQUALLY_NEAR, FaceFeatures, FaceTree, NearestFaces
from ..shapes.foreign import SurfaceShape, as_shape, what_to_pass
from ..shapes.kinds import ShapeLike
from ..shapes.transforms import joined_shape
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from ..validation import finite_number, percentages, public_call, whole_number
from .completion import complete
from .mesh_orientation import agreeing_faces, owners_of
from .solid import Solid

pictures: Any = lazy_module("signedheat.view.surface_pictures", "pictures")

SUMMARY_PERCENTILES = (0.0, 1.0, 5.0, 25.0, 50.0, 75.0, 95.0, 99.0, 100.0)
"""Percentiles of deviations in summaries."""
HISTOGRAM_BINS = 40
"""Default number of bins of histograms."""
OPEN_SHARE = 0.25
"""A nominal part counts as an open surface if a larger share of its surface is completed."""
WORST_SPACING = 0.05
"""Least distance between the points that `Deviation.worst` returns, relative to the diagonal of the scan's box."""
STRAIGHT_ABOVE = 1 - 1e-6
"""A point is straight above or below the nearest point of the part if the cosine to the normal is larger than this."""


@dataclass(frozen=True, eq=False)
class Deviation(Frozen):
    """Signed distances of a scan's points to a nominal part, positive where there is too much material.

    Vertices of the scan that no face uses do not count in statistics.

    Attributes
    ----------
    scan : PointCloud, TriangleMesh or PolygonMesh
        The scan.
    distances : (n,) float
        Distances of its points or vertices, in their units.
    nearest : (n, 3) float
        The nearest points of the part, in the units of the scan.
    completed : (n,) bool
        Whether the nearest points lie on the completion of the nominal part.
    beyond_rim : (n,) bool
        Whether points lie beyond the boundary of an open part, such as a panel or a terrain. Their sign is the side of
        its surface, continued beyond the boundary.

    See Also
    --------
    deviation : Compare a scan with a part.

    Examples
    --------
    >>> import signedheat as sh
    >>> off = sh.deviation(np.array([[0.0, 0.0, 1.1], [0.0, 0.9, 0.0]]), sh.samples.sphere(5))
    >>> off.distances.round(2), round(off.rms, 2), off.within(0.05)
    (array([ 0.1, -0.1]), 0.1, 0.0)
    """

    scan: PointCloud | TriangleMesh | PolygonMesh
    distances: Floats
    nearest: Floats
    completed: Bools
    beyond_rim: Bools

    @property
    def points(self) -> Floats:
        """(n, 3) positions of the scan's points or vertices, in its units."""
        return self.scan.points if isinstance(self.scan, PointCloud) else self.scan.vertices

    @cached_property
    def of_surface(self) -> Floats:
        """(m,) distances of all points, or of vertices that faces use, in the units of the scan; positive outside."""
        return self.distances[self._ids]

    @cached_property
    def _ids(self) -> Ints:
        """(m,) all points, or the vertices that faces use."""
        if isinstance(self.scan, PointCloud):
            return np.arange(len(self.distances))
        return np.unique(self.scan.faces if isinstance(self.scan, TriangleMesh) else self.scan.corners)

    @property
    def rms(self) -> float:
        """Root mean square of the deviations, in the units of the scan."""
        return float(np.sqrt(np.mean(self.of_surface**2)))

    @property
    def extreme(self) -> float:
        """The 99th percentile of the absolute deviations, in the units of the scan: colour scales end there."""
        return float(np.percentile(np.abs(self.of_surface), 99.0))

    def within(self, tolerance: float) -> float:
        """Compute the share of points within a tolerance of the part, on either side.

        Parameters
        ----------
        tolerance : float
            A length, in the units of the scan.

        Returns
        -------
        float
            Share of the points, from 0 to 1.

        See Also
        --------
        results.Deviation.worst : The points farthest off.

        Examples
        --------
        >>> import signedheat as sh
        >>> scan, part = sh.samples.sphere(2, radius=1.1), sh.samples.sphere(4)
        >>> off = sh.deviation(scan, part)
        >>> off.within(0.2)
        1.0
        """
        return float((np.abs(self.of_surface) <= finite_number(tolerance, "tolerance", least=0)).mean())

    def percentiles(self, percents: ArrayLike = SUMMARY_PERCENTILES) -> Floats:
        """Compute percentiles of the deviations.

        Parameters
        ----------
        percents : (k,) float
            Percentages from 0 to 100. By default 0, 1, 5, 25, 50, 75, 95, 99 and 100.

        Returns
        -------
        (k,) float
            Signed distances to the part, in the units of the scan; positive outside.

        See Also
        --------
        results.Deviation.histogram : Counts by deviation.

        Examples
        --------
        >>> import signedheat as sh
        >>> scan, part = sh.samples.sphere(2, radius=1.1), sh.samples.sphere(4)
        >>> off = sh.deviation(scan, part)
        >>> off.percentiles([50]).round(2).tolist()
        [0.1]
        """
        return np.asarray(np.percentile(self.of_surface, percentages(percents)))

    def histogram(self, bins: int = HISTOGRAM_BINS) -> tuple[Ints, Floats]:
        """Count points by deviation, in bins of equal width from −`extreme` to `extreme`.

        Points beyond count in the first or last bin. If `extreme`, the 99th percentile of the absolute deviations, is
        0, bins go from −1 to 1.

        Parameters
        ----------
        bins : int
            Number of bins, 40 by default.

        Returns
        -------
        counts : (bins,) int
            Numbers of points.
        limits : (bins + 1,) float
            Limits between the bins, in the units of the scan.

        See Also
        --------
        results.Deviation.percentiles : Percentiles.
        results.Deviation.within : The share within a tolerance.

        Examples
        --------
        >>> import signedheat as sh
        >>> scan, part = sh.samples.sphere(2, radius=1.1), sh.samples.sphere(4)
        >>> off = sh.deviation(scan, part)
        >>> counts, limits = off.histogram(10)
        >>> bool(counts.sum() == len(off.of_surface))
        True
        """
        reach = self.extreme if self.extreme > 0 else 1.0
        inside = np.clip(self.of_surface, -reach, reach)
        counts, limits = np.histogram(inside, whole_number(bins, "bins", 1), (-reach, reach))
        return counts.astype(np.int64), limits

    def worst(self, n: int = 10) -> Ints:
        """Find the points with the largest deviations, more than a twentieth of the scan's size apart.

        The size is the diagonal of its bounding box. Vertices of the scan that no face uses do not count.

        Parameters
        ----------
        n : int
            Largest number of points to return, 10 by default.

        Returns
        -------
        (k,) int
            Indices of points or vertices of the scan, in order of decreasing absolute deviation.

        See Also
        --------
        results.Deviation.within : The share within a tolerance.

        Examples
        --------
        >>> import signedheat as sh
        >>> scan, part = sh.samples.sphere(2, radius=1.1), sh.samples.sphere(4)
        >>> off = sh.deviation(scan, part)
        >>> len(off.worst(3)), bool(abs(off.distances[off.worst(1)[0]]) == abs(off.distances).max())
        (3, True)
        """
        n = whole_number(n, "n", 0)
        ids = self._ids[np.argsort(-np.abs(self.of_surface), kind="stable")]
        reach = WORST_SPACING * float(np.linalg.norm(np.ptp(self.points[ids], axis=0)))
        chosen: list[int] = []
        while len(ids) and len(chosen) < n:
            chosen.append(int(ids[0]))
            ids = ids[np.linalg.norm(self.points[ids] - self.points[ids[0]], axis=1) > reach]
        return np.array(chosen, dtype=np.int64)

    @property
    def figures(self) -> dict[str, object]:
        """Summary figures by name, ready for JSON; deviations are in the units of the scan, positive outside.

        "points" is the number of points that count, "mean" their mean deviation and "rms" the root mean square.
        "percentiles" holds the percentiles "0", "1", "5", "25", "50", "75", "95", "99" and "100". "on_completion" and
        "beyond_rim" are the shares of points, from 0 to 1, whose nearest point lies on the completion of the part, and
        that lie beyond the boundary of an open part.
        """
        return {
            "points": len(self.of_surface),
            "mean": float(self.of_surface.mean()),
            "rms": self.rms,
            "percentiles": {f"{p:g}": v for p, v in zip(SUMMARY_PERCENTILES, self.percentiles().tolist(), strict=True)},
            "on_completion": float(self.completed[self._ids].mean()),
            "beyond_rim": float(self.beyond_rim[self._ids].mean()),
        }

    def save(self, path: str | PathLike[str]) -> None:
        """Write the deviations, in the units of the scan, to a file in the format given by its extension.

        Parameters
        ----------
        path : str or path
            ``.ply`` for the scan in colours, blue below the part and orange above. ``.png``, ``.pdf``, ``.svg`` or
            ``.jpg`` for a picture of it with a histogram. ``.csv`` for a line for each point with its position,
            deviation and nearest point.

        Raises
        ------
        FileFormatError
            If the format is unknown, or the file cannot be written.

        See Also
        --------
        deviation : Compare a scan with a part.

        Examples
        --------
        >>> import tempfile
        >>> import signedheat as sh
        >>> scan, part = sh.samples.sphere(2, radius=1.1), sh.samples.sphere(4)
        >>> off = sh.deviation(scan, part)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     off.save(f"{folder}/off.csv")
        """
        pictures.save_deviation(self, path)

    def __repr__(self) -> str:
        low, median, high = self.percentiles((1, 50, 99))
        return f"Deviation({counted(len(self.of_surface), 'point')}, {low:.3g} to {high:.3g}, median {median:.3g})"


@public_call
def deviation(
    scan: ShapeLike | NDArray[np.floating], nominal: ShapeLike, *, progress: Progress | None = None
) -> Deviation:
    """Measure signed deviations of a scan from a nominal part, at the scan's points or vertices.

    The scan must be aligned with the part. The part may be broken; its faces decide what is outside. Only the points or
    vertices of the scan are used, so the orientation of its faces does not matter.

    Open parts, such as panels, facades and terrains, are measured without completion: deviations are positive on the
    side to which most of the area of each component faces. A component is open if it encloses nothing. If completion
    would add more than a quarter of the area, all of them count as open. Scan and part have the same units.

    Parameters
    ----------
    scan : shape or Solid, or (n, 3) points
        The scan, a mesh or points.
    nominal : shape or Solid
        The part as it should be. Unless it is a solid, it is completed first.
    progress : callable, optional
        Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
        begins. An exception that it raises cancels.

    Returns
    -------
    Deviation
        Distances in the units of the scan, positive outside the part or in front of it, where there is too much
        material.

    Raises
    ------
    SourceError
        If the scan is neither a mesh nor points in space, or has no points.

    See Also
    --------
    results.Deviation : Deviations of a scan.
    wall_thickness : How thick walls are.
    Solid.closest : Nearest points on the surface.

    Examples
    --------
    >>> import signedheat as sh
    >>> from signedheat import samples
    >>> off = sh.deviation(samples.sphere(2, 1.1), samples.sphere(5))
    >>> off.percentiles((0, 50, 100)).round(2).tolist(), off.within(0.2)
    ([0.1, 0.1, 0.1], 1.0)
    """
    shape = PointCloud(scan) if isinstance(scan, np.ndarray) and scan.ndim == 2 else as_shape(scan)  # type: ignore[arg-type]
    if isinstance(shape, TetMesh):
        shape = shape.boundary
    if not isinstance(shape, PointCloud | TriangleMesh | PolygonMesh):
        raise SourceError(f"a {type(shape).__name__} is not a scan", remedy=what_to_pass(shape), element="scan")
    points = shape.points if isinstance(shape, PointCloud) else shape.vertices
    if points.shape[1] != 3:
        raise SourceError("the scan lies in the plane", remedy="pass a shape in space", element="scan")
    with part_of_work(0.0, 0.5):
        solid = complete(nominal, progress=bound_progress())
    with part_of_work(0.5, 1.0), Stopwatch(1)("measure"):
        return run_cancellable(partial(_measured, shape, points, solid, nominal))


def _measured(
    scan: PointCloud | TriangleMesh | PolygonMesh, points: Floats, solid: Solid, nominal: ShapeLike
) -> Deviation:
    """Measure the deviations of the (n, 3) points or vertices of a scan from a part and the solid made of it."""
    closest = solid.closest(points)
    distances, nearest, completed = closest.distances, closest.points, closest.completed
    beyond_rim = np.zeros(len(points), dtype=bool)
    part = solid if isinstance(nominal, Solid) else joined_shape(nominal)
    is_open, surface = _open_surface(solid, part)
    if surface is not None:
        front = FaceTree.of(surface).search(points)
        by_side = is_open | ((distances > 0) & (front.distances <= (1 + EQUALLY_NEAR) * distances))
        signed = np.where(front.cosines < 0, -front.distances, front.distances)
        distances, completed = np.where(by_side, signed, distances), completed & ~by_side
        nearest = np.where(by_side[:, None], front.places, nearest)
        beyond_rim = by_side & _beyond_rim(surface, front)
    return Deviation(scan, distances, nearest, completed, beyond_rim)


def _open_surface(solid: Solid, given: SurfaceShape | Solid) -> tuple[bool, FaceFeatures | None]:
    """Return whether a part is open as a whole, and its faces, oriented consistently, whose sides give the sign.

    These are all given faces if it is open, and otherwise those of its sheets outside of bodies; None without any.
    """
    if isinstance(given, PointCloud):
        return False, None
    areas, was_given = face_areas(solid.triangles), solid.origins >= 0
    is_open = bool(areas[~was_given].sum() > OPEN_SHARE * areas.sum())
    has_sides = was_given.copy()
    if not is_open:
        has_sides &= ~solid.bounding
        behind, ahead = solid.windings.sides(solid.triangles[has_sides])
        has_sides[has_sides] = ~(behind | ahead)
    if not has_sides.any():
        return False, None
    if not isinstance(given, Solid):
        mesh, chosen = given.triangulation, np.isin(owners_of(given), solid.origins[has_sides])
    elif solid.source is not None:
        mesh, chosen = solid.source, np.isin(np.arange(solid.source.n_faces), solid.origins[has_sides])
    else:  # origins are faces of a mesh that is not known any more
        mesh, chosen = solid.faces, has_sides[was_given]
    return is_open, FaceFeatures.of(mesh.vertices, agreeing_faces(mesh)[chosen])


def _beyond_rim(surface: FaceFeatures, front: NearestFaces) -> Bools:
    """(n,) whether the nearest point is on the boundary, and a point not straight above or below it.

    `front` are the nearest points on the surface.
    """
    rim_edges = np.bincount(surface.edges.ravel()) == 1
    rim_vertices = np.zeros(len(surface.vertices), dtype=bool)
    on_rim = rim_edges[surface.edges]
    rim_vertices[surface.faces[on_rim]] = rim_vertices[np.roll(surface.faces, -1, axis=1)[on_rim]] = True
    features, faces = front.features, front.faces  # features: 0 within a face, 1 to 3 on its sides, 4 to 6 at corners
    corners = (features - 1) % 3
    is_beyond = np.where(features > 3, rim_vertices[surface.faces[faces, corners]], on_rim[faces, corners])
    return is_beyond & (features > 0) & (front.distances > 0) & (np.abs(front.cosines) < STRAIGHT_ABOVE)
