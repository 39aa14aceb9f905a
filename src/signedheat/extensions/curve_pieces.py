"""Pieces of broken curves, turned until they agree, and without those that belong to no other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..constraints import Constraint
from ..diagnostics import Note
from ..domains.curves import CurveOrPoints, CurvesAndPoints
from ..domains.kinds import SurfaceDomain
from ..domains.level_sets import is_consistent
from ..domains.triangle_mesh import TriangleMesh
from ..errors import InexactWarning, warn_user
from ..fields.vertex_field import VertexField
from ..solver import SignedHeatSolver, distance_unwarned
from .curve_votes import Votes
from .piece_directions import directions
from .small_curves import flattened, surface_of, triangulated_once
from .turned_curves import with_turned

STRANGE = 0.12
"""Agreement below which a piece may belong to none of the others. On five surfaces 1 % of those that did had less."""
WHOLE = 0.45
"""Median agreement of the others from which they tell what belongs to them: about a third of the length may be gone."""
MOST = 0.5
"""Fraction of the length of all pieces that may be left out."""
ASTRAY = 0.5
"""Distance from the zero set of the others, relative to its length, within which a piece belongs to them."""
NEAR = 8.0
"""The same, relative to h."""

Surface = TypeVar("Surface", bound=SurfaceDomain)


@dataclass(frozen=True, eq=False, repr=False)
class CurvesTaken(Note):
    """Which of the curves given were turned, and which were left out.

    Attributes
    ----------
    turned : (j,) int
        Curves whose positive side was made negative, since each piece should begin where another ends.
    left_out : (k,) int
        Curves that neither continue others nor lie on what completes these.
    """

    turned: NDArray[np.int64]
    left_out: NDArray[np.int64]

    def __str__(self) -> str:
        told = [
            f"{name}: {len(which)}, the first of them number {which[0]}"
            for name, which in (("curves turned", self.turned), ("curves left out", self.left_out))
            if len(which)
        ]
        return "; ".join(told) or "curves are taken as given"


def distance_to_pieces(
    solver: SignedHeatSolver[Surface], curves: CurvesAndPoints, constraint: Constraint | None, every_piece: bool
) -> tuple[VertexField[Surface], list[CurveOrPoints]]:
    """Distance to curves that may be pieces of broken ones, and the curves that it was measured to.

    The pieces are turned until they agree (`curve_orientation`). Then those that agree with none, one after the
    other, are suspected. Where faces look either way, as on surfaces with one side, pieces are taken as they are:
    left of a curve is another side from face to face. If the others agree well, so that most of a shape is there,
    suspects are left out that lie away from the zero set of the others.

    Parameters
    ----------
    solver : SignedHeatSolver
        Of a surface.
    curves : Curve, SurfacePoints or a sequence of them
        The pieces.
    constraint : Constraint, optional
        As in `SignedHeatSolver.distance`.
    every_piece : bool
        Leave none out.
    """
    listed = flattened(curves)
    surface = surface_of(solver)
    votes = Votes.of(surface, listed)
    if not votes.are_several or (isinstance(solver.domain, TriangleMesh) and not is_consistent(solver.domain)):
        return distance_unwarned(solver, listed, constraint), listed
    suspects = np.empty(0, dtype=np.int64) if every_piece else suspected(votes)
    once = triangulated_once(solver, listed)
    if once is not solver:  # what pieces agree is measured on triangles of one size, how they run where they are seen
        solver, votes = once, Votes.of(surface_of(once), listed)
    field, taken = without(solver, listed, votes, suspects, constraint)
    lengths = dict(zip(votes.pieces.tolist(), votes.lengths.tolist(), strict=True))
    near = {k: max(ASTRAY * lengths[k], NEAR * surface.spacing) for k in suspects.tolist()}
    astray = np.array([k for k in near if is_astray(field, listed[k], near[k])], dtype=np.int64)
    if len(astray) < len(suspects):
        field, taken = without(solver, listed, votes, astray, constraint)
    turned = np.array([k for k, curve in taken.items() if curve is not listed[k]], dtype=np.int64)
    note = CurvesTaken(turned, astray)
    if len(astray):
        warn_user(
            f"{len(astray)} of {len(listed)} curves, the first of them number {astray[0]}, neither continue others nor "
            "lie on what completes these, and were left out. every_piece=True measures to all",
            InexactWarning,
        )
    if len(astray) or len(turned):
        field = replace(field, diagnostics=field.diagnostics.noting(note))
    return field, list(taken.values())


def without(
    solver: SignedHeatSolver[Surface],
    curves: Sequence[CurveOrPoints],
    votes: Votes,
    out: NDArray[np.int64],
    constraint: Constraint | None,
) -> tuple[VertexField[Surface], dict[int, CurveOrPoints]]:
    """Distance to the curves without some, and these by number; those that then disagree with the others are turned."""
    among = np.flatnonzero(~np.isin(votes.pieces, out))
    turn = np.zeros(len(curves), dtype=bool)
    if len(among):
        turn[votes.pieces[among]] = directions(votes, among) < 0
    made = with_turned(curves, turn)
    taken = {k: curve for k, curve in enumerate(made) if k not in set(out.tolist())}
    return distance_unwarned(solver, list(taken.values()), constraint), taken


def suspected(votes: Votes) -> NDArray[np.int64]:
    """Numbers of curves that agree with none of the others, if these agree well with each other."""
    none = np.empty(0, dtype=np.int64)
    left = np.arange(len(votes.pieces))
    while True:
        agreement = np.where(votes.inner[left], votes.counted(left)[1], 1.0)
        worst = int(agreement.argmin())
        if agreement[worst] >= STRANGE:
            break
        order = np.argsort(agreement, kind="stable")
        several = order[: max(1, len(left) // 32)]
        left = np.delete(left, several[agreement[several] < STRANGE])
        if len(left) < 3 or votes.lengths[left].sum() < (1 - MOST) * votes.lengths.sum():
            return none
    if len(left) == len(votes.pieces) or np.median(agreement) < WHOLE:
        return none
    return np.delete(votes.pieces, left)


def is_astray(field: VertexField, curve: CurveOrPoints, near: float) -> bool:
    """Whether a curve goes farther from the zero set of a field."""
    return float(np.nanmax(np.abs(field(curve)), initial=0.0)) > near
