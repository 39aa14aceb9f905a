"""Orientation of the pieces of broken curves on surfaces: where one ends, another should begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Bools, Floats
from ..errors import UnsupportedTypeError
from ..foreign import ForeignShape, converted
from ..frozen import Frozen, ShortRepr
from ..kinds import SurfaceDomain
from ..solver import SignedHeatSolver
from ..surfaces.surface_curves import Curve, CurveOrPoints
from .resolution import on_resolving_triangles, surface_of, triangulated_once
from .stroke_directions import Pieces, decide


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
        How much of each bounds what all of them bound together: 1 all of it, 0 nothing, as spurious pieces often do; 1
        for what has no ends of its own.

    Examples
    --------
    >>> from signedheat import samples
    >>> mesh = samples.sphere(3)
    >>> equator, = mesh.level_set(mesh.vertices[:, 2], 0.01)
    >>> curve_orientation([equator], mesh).turned
    array([False])
    """

    curves: list[CurveOrPoints]
    turned: Bools
    agreement: Floats

    def agreeing(self, least: float) -> list[CurveOrPoints]:
        """Return the curves that agree with the others at least that well.

        Parameters
        ----------
        least : float
            Agreement, from 0 to 1.

        Returns
        -------
        list of Curve or SurfacePoints
            Those of `curves` with at least this `agreement`.

        Examples
        --------
        >>> import signedheat as sh
        >>> mesh = sh.samples.sphere(2)
        >>> equator = mesh.level_set(mesh.vertices[:, 2])
        >>> len(sh.curve_orientation(equator, mesh).agreeing(0.5))
        1
        """
        return [curve for curve, found in zip(self.curves, self.agreement, strict=True) if found >= least]


def curve_orientation(curves: Sequence[CurveOrPoints], domain: SurfaceDomain | ForeignShape) -> CurveOrientation:
    """Turn the pieces of broken curves so that together they bound something.

    Of all sets of vertices of the surface and all directions of the pieces those are taken that have the least energy:
    the length of the boundary of the set where no piece is, less the length of the pieces that bound it the right way
    round, and half of the length that is turned. For given directions the set is a minimum cut. Where most of the
    length bounds no set, as a loop round a torus does not, pieces that follow each other are made to face the same way.

    Curves that are closed, those from boundary to boundary of the surface (nonmanifold edges count as boundary),
    unoriented curves and points stay as they are. Curves that bound nothing together keep the direction that they were
    given with.

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
    Quarters of a loop round a torus, of which one runs backwards.

    >>> from signedheat.samples import torus
    >>> mesh = torus(n_around=48, n_across=24)
    >>> pieces = [mesh.path(24 * np.arange(begin, begin + 9)) for begin in (0, 12, 24, 36)]
    >>> pieces[1] = pieces[1].reversed()
    >>> curve_orientation(pieces, mesh).turned
    array([False,  True, False, False])
    """
    surface = converted(domain)
    if not isinstance(surface, SurfaceDomain):
        raise UnsupportedTypeError(
            f"curves are oriented on surfaces, not on a {type(domain).__name__}", element="domain"
        )
    listed = list(curves)
    turned, agreement = np.zeros(len(listed), dtype=bool), np.ones(len(listed))

    def seen(solver: SignedHeatSolver[SurfaceDomain]) -> Pieces | None:
        return Pieces.of(surface_of(triangulated_once(solver, listed)), listed)

    pieces = on_resolving_triangles(seen, SignedHeatSolver(surface), listed)
    if pieces is not None:
        decision = decide(pieces)
        turned = decision.turned(len(listed))
        explained = np.where(pieces.movable, np.clip(decision.best.explained, 0.0, 1.0), 1.0)
        agreement[pieces.numbers] = explained[pieces.stroke]
    return CurveOrientation(with_turned(listed, turned), turned, agreement)


def with_turned(curves: Sequence[CurveOrPoints], turned: Bools) -> list[CurveOrPoints]:
    """Return the curves, some with their positive side negative."""
    return [_turned(curve) if turn else curve for curve, turn in zip(curves, turned, strict=True)]


def _turned(curve: CurveOrPoints) -> CurveOrPoints:
    assert isinstance(curve, Curve)
    if curve.normals is None:
        return curve.reversed()
    return Curve(curve.faces, curve.barycentric, curve.closed, curve.oriented, -curve.normals)
