"""Digital surfaces: the boundary of a set of voxels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GeometryError
from ..exchange import Displayed
from ..validation import array_of, finite_number, frozen, numbers, positive_steps, refuse_extreme, refuse_lost_spacing
from .polygon_mesh import PolygonMesh
from .surface import Surface
from .surface_nets import surface_net
from .surfel_smoothing import smoothed_corners
from .surfels import Surfels, boundary_surfels, corrected_normals
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
        Edge lengths of a voxel.
    origin : (3,) float
        Position of the centre of voxel ``(0, 0, 0)``.
    radius : float, optional
        Radius, in units of length, of the neighbourhood over which normals are estimated; with 0 every face has its own
        normal. Small radii keep details, large ones remove the staircase. By default 0.4 times the square root of voxel
        size times diameter of the shape: under refinement it shrinks, but contains ever more voxels, which convergence
        requires.

    Raises
    ------
    GeometryError
        If the volume is not a three-dimensional array of booleans (or zeros and ones), is empty, the spacing is not
        positive, or the radius is negative.

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

    volume: NDArray[np.bool_]
    spacing: NDArray[np.float64]
    origin: NDArray[np.float64]
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
    def vertices(self) -> NDArray[np.float64]:
        """(n, 3) corners of the faces, where fields live."""
        return frozen(self.origin + (self.surfels.vertices - 0.5) * self.spacing)

    @property
    def n_vertices(self) -> int:
        """Number of vertices."""
        return len(self.surfels.vertices)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) lower and upper corner of the box around the surface."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def squares(self) -> PolygonMesh:
        """The faces of the voxels as a polygon mesh, counter-clockwise as seen from outside."""
        return PolygonMesh(self.vertices, self.surfels.corners)

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """(m, 3) estimated unit normal of the digitised surface at each face, outward."""
        return frozen(corrected_normals(self.volume, self.surfels, self.spacing, self.radius))

    @cached_property
    def smooth_vertices(self) -> NDArray[np.float64]:
        """(n, 3) the vertices moved so that faces are nearly orthogonal to `normals`: what distance is measured on."""
        return frozen(smoothed_corners(self.vertices, self.surfels.corners, self.normals))

    @cached_property
    def smooth_surface(self) -> TriangleMesh:
        """A smooth surface between the centres of the voxels inside and those outside: closed, manifold, outward.

        It stays within half a voxel, along each axis, of the corners of voxels, and has all voxels on their sides:
        signed distance to it is negative at the centres of those inside, and at no others.
        """
        vertices, faces = surface_net(self.volume)
        return TriangleMesh(self.origin + vertices * self.spacing, faces)

    @property
    def triangulation(self) -> TriangleMesh:
        """The triangles that curves refer to: four per face, in the order of its sides, around a virtual vertex."""
        return self.squares.triangulation

    def on_triangulation(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at the vertices of `triangulation`, from values at the vertices of the surface.

        Parameters
        ----------
        values : (n,) float
            One for each vertex.

        Returns
        -------
        (m,) float
            One for each vertex of the triangulation.

        Examples
        --------
        >>> cube = DigitalSurface(np.ones((1, 1, 1), dtype=bool))
        >>> cube.on_triangulation(np.ones(cube.n_vertices)).max().item()
        1.0
        """
        return self.squares.on_triangulation(values)

    def _triangle_mask(self, face_mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        return self.squares._triangle_mask(face_mask)

    def to_pyvista(self) -> pyvista.PolyData:
        """Convert the faces of the voxels to PyVista.

        Returns
        -------
        pyvista.PolyData
            Squares.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed.

        Examples
        --------
        >>> DigitalSurface(np.ones((1, 1, 1), dtype=bool)).to_pyvista().n_cells
        6
        """
        return self.squares.to_pyvista()

    def __repr__(self) -> str:
        return f"DigitalSurface({' × '.join(map(str, self.volume.shape))} voxels, radius={self.radius:.3g})"
