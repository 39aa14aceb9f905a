"""Directions of the pieces of broken curves, checked by the distance that they give."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..discretization import discretize
from ..errors import SignedHeatError
from ..fields.vertex_field import VertexField
from ..lowering.surface.discretization import SurfaceDiscretization
from ..operators.linear_elements import LinearElements
from .curve_votes import Votes
from .vertex_sharpening import at_triangles

GOOD = 0.1
"""Slope error up to which no directions are tried but those that the ends of pieces and what was given suggest."""
BAD = 0.25
"""Slope error from which many others are tried."""
FEW, MANY = 6, 16
"""How many are tried."""
RESOLVED = 2.0
"""Mean length of pieces, relative to h, from which slopes tell anything of them."""
EVIDENCE = 0.5
"""Area without slope that turning a piece must save, relative to its length squared."""
HARDLY = 0.2
"""What ends may tell about others, relative to their own energy, to tell hardly anything."""

Field = TypeVar("Field", bound=VertexField)


@dataclass(frozen=True)
class Directed(Generic[Field]):
    """Directions ±1 of pieces, relative to those given; the distance that they give; and where it has no slope of one.

    Attributes
    ----------
    uneven : float
        Integral of ``min((|∇φ| − 1)², 1)``, in units of area.
    area : float
        Of the surface where φ is known.
    """

    signs: NDArray[np.float64]
    field: Field
    uneven: float
    area: float

    @classmethod
    def of(cls, signs: NDArray[np.float64], field: Field) -> Directed[Field]:
        """What the slopes of a field tell."""
        surface = discretize(field.finest.domain)
        assert isinstance(surface, SurfaceDiscretization)
        elements = LinearElements.on_triangles(surface.triangles)
        slopes = np.linalg.norm(elements.slopes(at_triangles(surface, field.finest)), axis=1)
        known = np.isfinite(slopes)
        sizes = elements.sizes[known]
        return cls(signs, field, float(sizes @ np.minimum((slopes[known] - 1.0) ** 2, 1.0)), float(sizes.sum()))

    @property
    def slope_error(self) -> float:
        """Root mean square."""
        return float(np.sqrt(self.uneven / self.area)) if self.area > 0 else 0.0

    def gives_way(self, other: Directed[Field], lengths: NDArray[np.float64]) -> bool:
        """Whether others are so much better that pieces of these lengths are to be turned for it."""
        turned = lengths[self.signs != other.signs]
        return other.uneven < self.uneven - EVIDENCE * float((turned**2).sum())


def directed(
    votes: Votes,
    among: NDArray[np.int64],
    alone: bool,
    spacing: float,
    distance: Callable[[NDArray[np.float64]], Field],
) -> Directed[Field]:
    """The directions of pieces that give the most even distance.

    Ends of pieces tell how the pieces of one curve follow each other, and nearly nothing of how two curves face. If
    curves disagree, no function has slope one between them. So if the ends tell to turn some, directions are tried in
    which the pieces are as given, altogether or for the most part in each group of pieces that follow each other, or
    with single groups turned back. They are taken where they are clearly more even or, of groups whose ends tell hardly
    anything about each other, where they are not clearly less so.

    Parameters
    ----------
    votes : Votes
        Of the pieces.
    among : (k,) int
        Which of them are to be directed.
    alone : bool
        Whether there is no other oriented curve, so that turning all of them tells nothing.
    spacing : float
        h.
    distance : callable
        The field of (k,) directions.
    """
    by_ends, _ = votes.counted(among)
    lengths = votes.lengths[among]
    best = Directed.of(by_ends, distance(by_ends))
    if undisputed(by_ends, lengths, spacing):
        return best
    groups = votes.groups(among)
    tried = {by_ends.tobytes()}
    most = FEW if best.slope_error < BAD else MANY

    def better(best: Directed[Field], signs: NDArray[np.float64]) -> Directed[Field]:
        """The better ones; if neither is clearly better, those of whose ends others tell more."""
        if alone and lengths @ signs < 0:
            signs = -signs
        if len(tried) > most or signs.tobytes() in tried:
            return best
        tried.add(signs.tobytes())
        try:
            other = Directed.of(signs, distance(signs))
        except SignedHeatError:  # no directions at all
            return best
        if votes.told(among, best.signs, signs) < HARDLY:
            return best if other.gives_way(best, lengths) else other
        return other if best.gives_way(other, lengths) else best

    for signs in reversed(list(as_given_mostly(by_ends, groups, lengths))):
        best = better(best, signs)
    if best.slope_error <= GOOD:
        return best
    for level in groups:
        for group in range(int(level.max()) + 1):
            if lengths[level == group] @ best.signs[level == group] < 0:  # towards how they were given
                best = better(best, np.where(level == group, -best.signs, best.signs))
    return best


def undisputed(by_ends: NDArray[np.float64], lengths: NDArray[np.float64], spacing: float) -> bool:
    """Whether what the ends of pieces tell is taken as it is: nothing is turned, or too small for slopes to tell."""
    return bool((by_ends > 0).all() or lengths.mean() < RESOLVED * spacing)


def as_given_mostly(
    signs: NDArray[np.float64], groups: list[NDArray[np.int64]], lengths: NDArray[np.float64]
) -> Iterator[NDArray[np.float64]]:
    """Directions as given, and with each group turned as most of its length was given."""
    yield np.ones(len(signs))
    for level in groups:
        as_given = np.bincount(level, lengths * signs)
        yield np.where(as_given[level] < 0, -signs, signs)
