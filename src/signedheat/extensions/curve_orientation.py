"""Orientation of the pieces of broken curves on surfaces: where one ends, another should begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..discretization import discretize
from ..domains.curves import CurveOrPoints
from ..domains.foreign import ForeignShape, converted
from ..domains.kinds import SurfaceDomain
from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError, UnsupportedTypeError
from ..frozen import Frozen
from ..lowering.surface.discretization import SurfaceDiscretization
from ..reprs import ShortRepr
from ..solver import SignedHeatSolver
from .close_curves import for_zero_set
from .curve_votes import Votes
from .piece_directions import directions
from .small_curves import are_small, surface_of, triangulated_once
from .turned_curves import with_turned


@dataclass(frozen=True, eq=False, repr=False)
class CurveOrientation(Frozen, ShortRepr):
    """How the pieces of a broken curve were oriented.

    Attributes
    ----------
    curves : list of Curve and SurfacePoints
        All that was given, in order, some curves turned.
    turned : (k,) bool
        Which of them were turned.
    agreement : (k,) float
        How well each is completed by others: 1 if pieces begin where it ends and end where it begins, about 0 if it
        lies by itself, as spurious pieces often do; 1 for what has no ends of its own.
    """

    curves: list[CurveOrPoints]
    turned: NDArray[np.bool_]
    agreement: NDArray[np.float64]

    def agreeing(self, least: float) -> list[CurveOrPoints]:
        """The curves that agree with others at least that well."""
        return [curve for curve, found in zip(self.curves, self.agreement, strict=True) if found >= least]


def curve_orientation(curves: Sequence[CurveOrPoints], domain: SurfaceDomain | ForeignShape) -> CurveOrientation:
    """Turn the pieces of broken curves so that each begins where another ends.

    The boundary of a region has no ends. What its pieces lack of that is measured by ``⟨q, C⁻¹ q⟩``, where q is +1 at
    the end and −1 at the beginning of every piece and C the Laplacian: the energy of charges, which is small where
    opposite charges are close to each other. Directions s = ±1 that make the energy of ``Σ s_i q_i`` small are found
    from its pairwise terms (`synchronize_signs`), to which every piece adds a weak vote for its own direction. Only
    ends count, so that curves that run beside each other hardly disturb, unless their gaps lie side by side.

    Curves that are closed, those from boundary to boundary of the surface (nonmanifold edges count as boundary),
    unoriented curves and points stay as they are. Pieces of different curves that are far from each other have the
    direction that most of their length was given with.

    What the ends of one curve tell about those of another is little; how they face each other is told by their winding
    numbers, whose sum is the same at all curves that bound one region. Complete curves count there, too.

    Takes one factorisation, and two solves for each piece.

    Parameters
    ----------
    curves : sequence of Curve and SurfacePoints
        The pieces.
    domain : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or IntrinsicTriangulation
        The surface that they lie on, its faces consistently oriented, or the curves with normals.

    Raises
    ------
    SourceError
        If a curve does not fit the surface.
    UnsupportedTypeError
        If the domain is no surface.

    Examples
    --------
    >>> from signedheat.samples import torus
    >>> mesh = torus(n_around=48, n_across=24)
    >>> pieces = [mesh.path(24 * np.arange(begin, begin + 9)) for begin in (0, 12, 24, 36)]
    >>> pieces[1] = pieces[1].reversed()
    >>> curve_orientation(pieces, mesh).turned
    array([False,  True, False, False])
    """
    surface = discretize(converted(domain))
    if not isinstance(surface, SurfaceDiscretization):
        raise UnsupportedTypeError(
            f"curves are oriented on surfaces, not on a {type(domain).__name__}", element="domain"
        )
    listed = list(curves)
    votes = Votes.of(surface, listed)
    turned, agreement = np.zeros(len(listed), dtype=bool), np.ones(len(listed))
    if votes.are_several:
        finer = surface_for(surface, listed)
        seen = votes if finer is surface else Votes.of(finer, listed)
        signs = directions(seen, np.arange(len(votes.pieces)))
        agreement[votes.pieces] = votes.agreement(signs, np.arange(len(votes.pieces)))
        turned[votes.pieces] = signs < 0
    return CurveOrientation(with_turned(listed, turned), turned, agreement)


def surface_for(surface: SurfaceDiscretization, curves: list[CurveOrPoints]) -> SurfaceDiscretization:
    """Triangles on which the curves are seen: those that there are, or smaller ones."""
    mesh = surface.domain
    if not isinstance(mesh, TriangleMesh) or not are_small(SignedHeatSolver(mesh), curves):
        return surface
    try:
        return surface_of(triangulated_once(for_zero_set(mesh, 1.0), curves))
    except GeometryError:  # too thin to be triangulated anew
        return surface
