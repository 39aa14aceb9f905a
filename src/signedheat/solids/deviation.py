"""Deviations of a scan from a nominal part."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..domains.foreign import as_shape
from ..domains.kinds import ShapeLike
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import SourceError
from ..frozen import Frozen
from ..packages import lazy_module
from ..progress import Progress
from .complete import complete
from .solid import Solid

pictures: Any = lazy_module("signedheat.view.deviations", "pictures")

PERCENTILES = (0.0, 1.0, 5.0, 25.0, 50.0, 75.0, 95.0, 99.0, 100.0)
"""Of deviations, that summaries have."""
EXTREME = 99.0
"""Percentile of absolute deviations at which colours are full and histograms end: few outliers do not wash them out."""
BINS = 40
"""Of histograms."""


@dataclass(frozen=True, eq=False)
class Deviation(Frozen):
    """Signed distances of a scan's points to a nominal part: positive where there is too much material.

    Statistics leave out vertices that no face uses.

    Attributes
    ----------
    scan : PointCloud, TriangleMesh or PolygonMesh
        What was scanned.
    distances : (n,) float
        Of its points or vertices, in their units.
    nearest : (n, 3) float
        The nearest places of the part.
    completed : (n,) bool
        Whether these lie on surface that the nominal part did not have, and that closes it.

    Examples
    --------
    >>> import signedheat as sh
    >>> found = sh.deviation(np.array([[0.0, 0.0, 1.1], [0.0, 0.9, 0.0]]), sh.samples.sphere(5))
    >>> found.distances.round(2), round(found.rms, 2), found.within(0.05)
    (array([ 0.1, -0.1]), 0.1, 0.0)
    """

    scan: PointCloud | TriangleMesh | PolygonMesh
    distances: NDArray[np.float64]
    nearest: NDArray[np.float64]
    completed: NDArray[np.bool_]

    @property
    def points(self) -> NDArray[np.float64]:
        """(n, 3) positions of the scan's points or vertices."""
        return self.scan.points if isinstance(self.scan, PointCloud) else self.scan.vertices

    @cached_property
    def of_surface(self) -> NDArray[np.float64]:
        """(m,) the distances of all points, or of the vertices that faces use."""
        if isinstance(self.scan, PointCloud):
            return self.distances
        corners = self.scan.faces if isinstance(self.scan, TriangleMesh) else self.scan.corners
        return self.distances[np.unique(corners)]

    @property
    def rms(self) -> float:
        """Root mean square."""
        return float(np.sqrt(np.mean(self.of_surface**2)))

    @property
    def extreme(self) -> float:
        """What 99 % of the absolute deviations are below."""
        return float(np.percentile(np.abs(self.of_surface), EXTREME))

    def within(self, tolerance: float) -> float:
        """Share of the points that are as near to the part as a tolerance, on either side."""
        return float((np.abs(self.of_surface) <= tolerance).mean())

    def percentiles(self, percents: ArrayLike = PERCENTILES) -> NDArray[np.float64]:
        """Deviations that so many per cent of the points are below."""
        return np.asarray(np.percentile(self.of_surface, np.asarray(percents, dtype=np.float64)))

    def histogram(self, bins: int = BINS) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """(bins,) numbers of points and (bins + 1,) limits; what is beyond `extreme` counts in the first or last."""
        reach = self.extreme if self.extreme > 0 else 1.0
        inside = np.clip(self.of_surface, -reach, reach)
        counts, limits = np.histogram(inside, bins, (-reach, reach))
        return counts.astype(np.int64), limits

    @property
    def figures(self) -> dict[str, object]:
        """What sums it up, ready for JSON."""
        return {
            "points": len(self.of_surface),
            "mean": float(self.of_surface.mean()),
            "rms": self.rms,
            "percentiles": {f"{p:g}": v for p, v in zip(PERCENTILES, self.percentiles().tolist(), strict=True)},
            "on_completion": float(self.completed.mean()),
        }

    def save(self, path: str | PathLike[str]) -> None:
        """Write to a file: ``.ply`` has the scan in colours, blue below the part and orange above.

        A picture (``.png``, ``.pdf``, ``.svg`` or ``.jpg``) has the scan in colours and the histogram. A ``.csv`` has a
        line for each point: position, deviation, the nearest place.

        Raises
        ------
        FileFormatError
            If the format is another, or the file cannot be written.
        """
        pictures.save_deviation(self, path)

    def __repr__(self) -> str:
        low, middle, high = self.percentiles((1, 50, 99))
        return f"Deviation({len(self.of_surface)} points, {low:.3g} to {high:.3g}, median {middle:.3g})"


def deviation(
    scan: ShapeLike | NDArray[np.floating], nominal: ShapeLike | Solid, progress: Progress | None = None
) -> Deviation:
    """Signed deviations of a scan from a nominal part, at the scan's points or vertices.

    Both are in one place already: nothing is aligned. The nominal part may be broken; its faces decide what is outside.
    The scan's faces are not looked at, so it does not matter how they are turned.

    Parameters
    ----------
    scan : shape, or (n, 3) points
        Mesh or points.
    nominal : shape or Solid
        What it should be; completed here, unless it is a solid already.
    progress : callable, optional
        Called as ``progress(fraction, step)``; what it raises cancels.

    Returns
    -------
    Deviation
        Positive outside of the part, where there is too much.

    Raises
    ------
    SourceError
        If the scan has no points, or is no mesh and no points in space.

    Examples
    --------
    >>> import signedheat as sh
    >>> from signedheat import samples
    >>> found = sh.deviation(samples.sphere(2, 1.1), samples.sphere(5))
    >>> found.percentiles((0, 50, 100)).round(2).tolist(), found.within(0.2)
    ([0.1, 0.1, 0.1], 1.0)
    """
    shape = PointCloud(scan) if isinstance(scan, np.ndarray) and scan.ndim == 2 else as_shape(scan)  # type: ignore[arg-type]
    if isinstance(shape, TetMesh):
        shape = shape.boundary
    if not isinstance(shape, PointCloud | TriangleMesh | PolygonMesh):
        raise SourceError(f"a {type(shape).__name__} is no scan", remedy="pass a mesh or points", element="scan")
    solid = nominal if isinstance(nominal, Solid) else complete(nominal, progress=progress)
    points = shape.points if isinstance(shape, PointCloud) else shape.vertices
    if points.shape[1] != 3:
        raise SourceError("the scan lies in the plane", remedy="pass a shape in space", element="scan")
    found = solid.closest(points)
    return Deviation(shape, found.distances, found.points, found.completed)
