"""Unions, intersections and differences of fields with rounded seams."""

from __future__ import annotations

import numpy as np

from ..validation import finite_number
from .field import Domain, Field, checked, combined
from .field_domain import FieldDomain


def smooth_union(a: Field[Domain], b: Field[FieldDomain], width: float) -> Field[Domain]:
    """Unite two solids, with a rounded seam where their surfaces meet.

    Where the two fields differ by less than the width w, the result φ is the polynomial smooth minimum
    ``min(a, b) − (w − |a − b|)² / 4w``. Elsewhere it is the smaller of the two. The concave edge where the surfaces
    meet becomes a fillet of about that width.

    Parameters
    ----------
    a, b : Field
        Fields on the same domain, negative inside the solids.
    width : float
        Width of the rounded seam, in the units of the domain. With 0, φ is the smaller of the two everywhere.

    Returns
    -------
    Field
        Negative inside the union and zero on its surface. Elsewhere it is only about the distance; `sharpen` makes it
        the distance.

    Raises
    ------
    GeometryError
        If the fields lie on different domains.
    SignedHeatError
        If the width is negative or not finite.

    See Also
    --------
    morphology.smooth_intersection : Intersection with a rounded seam.
    morphology.smooth_difference : Difference with a rounded seam.
    Field : Values on a domain.

    Examples
    --------
    >>> import signedheat as sh
    >>> grid = sh.Grid((-2, -2), 0.5, (9, 9))
    >>> left, right = (sh.Field(grid, np.linalg.norm(grid.points - [x, 0], axis=-1) - 1) for x in (-1, 1))
    >>> float((left | right)([0.0, 0.5]).round(3)), float(smooth_union(left, right, 0.4)([0.0, 0.5]).round(3))
    (0.118, 0.018)
    """
    return combined(a, b, np.less_equal, -finite_number(width, "width", least=0))


def smooth_intersection(a: Field[Domain], b: Field[FieldDomain], width: float) -> Field[Domain]:
    """Intersect two solids, with a rounded edge where their surfaces meet.

    Where the two fields differ by less than the width w, the result φ is the polynomial smooth maximum
    ``max(a, b) + (w − |a − b|)² / 4w``. Elsewhere it is the greater of the two.

    Parameters
    ----------
    a, b : Field
        Fields on the same domain, negative inside the solids.
    width : float
        Width of the rounded edge, in the units of the domain. With 0, φ is the greater of the two everywhere.

    Returns
    -------
    Field
        Negative inside the intersection and zero on its surface. Elsewhere it is only about the distance; `sharpen`
        makes it the distance.

    Raises
    ------
    GeometryError
        If the fields lie on different domains.
    SignedHeatError
        If the width is negative or not finite.

    See Also
    --------
    morphology.smooth_union : Union with a rounded seam.
    morphology.smooth_difference : Difference with a rounded seam.
    Field : Values on a domain.

    Examples
    --------
    >>> import signedheat as sh
    >>> grid = sh.Grid((-2, -2), 0.5, (9, 9))
    >>> left, right = (sh.Field(grid, np.linalg.norm(grid.points - [x, 0], axis=-1) - 1) for x in (-0.5, 0.5))
    >>> float((left & right)([0.0, 0.5]).round(3)), float(smooth_intersection(left, right, 0.4)([0.0, 0.5]).round(3))
    (-0.293, -0.193)
    """
    return combined(a, b, np.greater_equal, finite_number(width, "width", least=0))


def smooth_difference(a: Field[Domain], b: Field[FieldDomain], width: float) -> Field[Domain]:
    """Subtract the second solid from the first, with a rounded edge where their surfaces meet.

    The result is ``smooth_intersection(a, -b, width)``.

    Parameters
    ----------
    a, b : Field
        Fields on the same domain, negative inside the solids.
    width : float
        Width of the rounded edge, in the units of the domain.

    Returns
    -------
    Field
        Negative inside the difference and zero on its surface. Elsewhere it is only about the distance; `sharpen`
        makes it the distance.

    Raises
    ------
    GeometryError
        If the fields lie on different domains.
    SignedHeatError
        If the width is negative or not finite.

    See Also
    --------
    morphology.smooth_union : Union with a rounded seam.
    morphology.smooth_intersection : Intersection with a rounded seam.
    Field : Values on a domain.

    Examples
    --------
    >>> import signedheat as sh
    >>> grid = sh.Grid((-2, -2), 0.5, (9, 9))
    >>> disk = sh.Field(grid, np.linalg.norm(grid.points, axis=-1) - 1)
    >>> half = smooth_difference(disk, sh.Field(grid, grid.points[..., 0]), 0.2)  # without the left side
    >>> half([[0.5, 0.0], [-0.5, 0.0]]).round(2)
    array([-0.45,  0.5 ])
    """
    return smooth_intersection(a, checked(a, b)._mapped(np.negative), width)
