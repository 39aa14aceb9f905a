"""Deviations of a scan from a nominal part."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SourceError
from ..foreign import SurfaceShape, as_shape
from ..frozen import Frozen
from ..joining import joined_shape
from ..kinds import ShapeLike
from ..mesh.edges import orient_faces, pair_halfedges
from ..mesh.triangles import face_areas
from ..mesh.welding import welded_vertices
from ..packages import lazy_module
from ..progress import Progress
from ..search.face_features import FaceFeatures
from ..search.face_tree import FaceTree, NearestFaces
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from .completion import complete
from .solid import Solid

pictures: Any = lazy_module("signedheat.view.deviation_pictures", "pictures")

PERCENTILES = (0.0, 1.0, 5.0, 25.0, 50.0, 75.0, 95.0, 99.0, 100.0)
"""Of deviations, that summaries have."""
EXTREME = 99.0
"""Percentile of absolute deviations at which colours are full and histograms end: few outliers do not wash them out."""
BINS = 40
"""Of histograms."""
OPEN = 0.25
"""Share of the whole surface that is completed, from which a nominal is measured as an open surface."""
TIE = 1e-9
"""Relative difference below which distances are equal."""
STRAIGHT = 1 - 1e-6
"""Cosine to the normal above which a point is straight above its nearest place, or below."""


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
    beyond_rim : (n,) bool
        Whether points are beyond the rim of an open nominal, such as a panel or a terrain: their side is that of the
        surface continued.

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
    beyond_rim: NDArray[np.bool_]

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
        """Share of the points that are as near to the part as a tolerance, on either side.

        Parameters
        ----------
        tolerance : float
            A length.

        Returns
        -------
        float
            From 0 to 1.

        Examples
        --------
        >>> import signedheat as sh
        >>> scan, part = sh.samples.sphere(2, radius=1.1), sh.samples.sphere(4)
        >>> off = sh.deviation(scan, part)
        >>> off.within(0.2)
        1.0
        """
        return float((np.abs(self.of_surface) <= tolerance).mean())

    def percentiles(self, percents: ArrayLike = PERCENTILES) -> NDArray[np.float64]:
        """Deviations that so many per cent of the points are below.

        Parameters
        ----------
        percents : (k,) float
            From 0 to 100.

        Returns
        -------
        (k,) float
            Signed distances to the part, positive outside.

        Examples
        --------
        >>> import signedheat as sh
        >>> scan, part = sh.samples.sphere(2, radius=1.1), sh.samples.sphere(4)
        >>> off = sh.deviation(scan, part)
        >>> off.percentiles([50]).round(2).tolist()
        [0.1]
        """
        return np.asarray(np.percentile(self.of_surface, np.asarray(percents, dtype=np.float64)))

    def histogram(self, bins: int = BINS) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Numbers of points by deviation; those beyond `extreme` count in the first or last bin.

        Parameters
        ----------
        bins : int
            How many.

        Returns
        -------
        counts : (bins,) int
            Numbers of points.
        limits : (bins + 1,) float
            Between the bins, lengths.

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
            "beyond_rim": float(self.beyond_rim.mean()),
        }

    def save(self, path: str | PathLike[str]) -> None:
        """Write to a file, in the format given by its extension.

        Parameters
        ----------
        path : str or path
            ``.ply``: the scan in colours, blue below the part and orange above. ``.png``, ``.pdf``, ``.svg``, ``.jpg``:
            a picture of it with the histogram. ``.csv``: a line for each point with its position, deviation and nearest
            place.

        Raises
        ------
        FileFormatError
            If the format is another, or the file cannot be written.

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
        low, middle, high = self.percentiles((1, 50, 99))
        return f"Deviation({len(self.of_surface)} points, {low:.3g} to {high:.3g}, median {middle:.3g})"


def deviation(
    scan: ShapeLike | NDArray[np.floating], nominal: ShapeLike, progress: Progress | None = None
) -> Deviation:
    """Signed deviations of a scan from a nominal part, at the scan's points or vertices.

    Both are in one place already: nothing is aligned. The nominal part may be broken; its faces decide what is outside.
    The scan's faces are not looked at, so it does not matter how they are turned.

    Open nominals, such as panels, facades and terrains, are measured as they are: deviations are positive on the side
    to which most of the area of each of their parts faces as given. A part is open if it bounds nothing, and all of
    them are if a quarter of the surface would have to be completed.

    Parameters
    ----------
    scan : shape or Solid, or (n, 3) points
        Mesh or points.
    nominal : shape or Solid
        What it should be; completed here, unless it is a solid already.
    progress : callable, optional
        Called as ``progress(fraction, step)``; what it raises cancels.

    Returns
    -------
    Deviation
        Positive outside of the part or in front of it, where there is too much.

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
    solid = complete(nominal, progress=progress)
    points = shape.points if isinstance(shape, PointCloud) else shape.vertices
    if points.shape[1] != 3:
        raise SourceError("the scan lies in the plane", remedy="pass a shape in space", element="scan")
    found = solid.closest(points)
    distances, nearest, completed = found.distances, found.points, found.completed
    beyond_rim = np.zeros(len(points), dtype=bool)
    part = solid if isinstance(nominal, Solid) else joined_shape(nominal)
    is_open, surface = _open_surface(solid, part)
    if surface is not None:
        front = FaceTree.of(surface).search(points)
        by_side = is_open | ((distances > 0) & (front.distances <= (1 + TIE) * distances))
        signed = np.where(front.cosines < 0, -front.distances, front.distances)
        distances, completed = np.where(by_side, signed, distances), completed & ~by_side
        nearest = np.where(by_side[:, None], front.places, nearest)
        beyond_rim = by_side & _beyond_rim(surface, front)
    return Deviation(shape, distances, nearest, completed, beyond_rim)


def _open_surface(solid: Solid, given: SurfaceShape | Solid) -> tuple[bool, FaceFeatures | None]:
    """Whether a nominal is open as a whole; and those of its faces that have sides only, turned to agree."""
    if isinstance(given, PointCloud):
        return False, None
    areas, was_given = face_areas(solid.triangles), solid.origins >= 0
    is_open = bool(areas[~was_given].sum() > OPEN * areas.sum())
    has_sides = was_given.copy()
    if not is_open:
        behind, ahead = solid.windings.sides(solid.triangles)
        has_sides &= ~(behind | ahead)
    if not has_sides.any():
        return False, None
    if isinstance(given, Solid):
        given = solid.faces if solid.source is None else solid.source
    mesh = given.triangulation
    owners = given.refinement.face_polygons if isinstance(given, PolygonMesh) else np.arange(mesh.n_faces)
    return is_open, FaceFeatures.of(mesh.vertices, _agreeing(mesh)[np.isin(owners, solid.origins[has_sides])])


def _agreeing(mesh: TriangleMesh) -> NDArray[np.int64]:
    """(m, 3) faces, turned where most of the area of their part faces the other way."""
    heads = np.roll(mesh.faces, -1, axis=1).ravel()
    ids = welded_vertices(mesh.vertices, mesh.faces.ravel(), heads)
    tails, owners = ids[mesh.faces.ravel()], np.repeat(np.arange(mesh.n_faces), 3)
    pairs = pair_halfedges(tails, ids[heads], mesh.n_vertices)
    turned = orient_faces(pairs, tails, owners, face_areas(mesh.vertices[mesh.faces])).turned
    faces = tails.reshape(-1, 3)
    return np.where(turned[:, None], faces[:, ::-1], faces)


def _beyond_rim(surface: FaceFeatures, front: NearestFaces) -> NDArray[np.bool_]:
    """(n,) whether points are neither above nor below a surface: the nearest place is on its rim, and not straight."""
    rim_edges = np.bincount(surface.edges.ravel()) == 1
    rim_vertices = np.zeros(len(surface.vertices), dtype=bool)
    on_rim = rim_edges[surface.edges]
    rim_vertices[surface.faces[on_rim]] = rim_vertices[np.roll(surface.faces, -1, axis=1)[on_rim]] = True
    features, faces = front.features, front.faces
    corners = (features - 1) % 3
    is_beyond = np.where(features > 3, rim_vertices[surface.faces[faces, corners]], on_rim[faces, corners])
    return is_beyond & (features > 0) & (front.distances > 0) & (np.abs(front.cosines) < STRAIGHT)
