"""Diffusion times: one, or Richardson's extrapolation from it, which cancels the errors of short and long times."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import NDArray

from ..discretization import Discretization, SourceTerm
from ..errors import UnsupportedTypeError
from ..validation import positive_number
from .surface_discretization import SurfaceDiscretization
from .surface_source import SurfaceSource

FINE_EXTENT = 263.0
"""τ grows on surfaces with a larger extent than this, in h: that of 20,000 vertices in equilateral triangles."""


@dataclass(frozen=True)
class Extrapolated:
    """Directions extrapolated from one diffusion time and from how they change with it: the default on surfaces.

    Normals of the source are diffused like heat for a time ``t = τ h²``, with h the mean distance between unknowns.
    Heat falls by the factor e within √t. At τ = 1 that is about a cell, which the cells do not resolve. So directions
    keep an error of the size h²/t, which does not fall as the cells get smaller. A larger τ smooths the source, with an
    error of the size √t. Both errors cancel in a combination of the directions Y and their first two derivatives by t.
    On triangles the error then falls about like their size, and is less than half as large on fine meshes; on the
    coarsest there is little to gain. The derivatives need no other matrix: the linear system of step 1 is factorised
    once, and solved three times. `SignedHeatSolver` by default takes a τ of 3 up to about 20,000 vertices, and beyond
    one that grows with the fifth root of their number.

    Where an oriented curve ends, away from the boundary of the surface, heat completes it, and Y depends on t by more
    than an error. In that connected part of the surface the directions of τ/3 are used unchanged.

    Parameters
    ----------
    tau : float
        Factor τ of the time ``t = τ h²``, from which directions are extrapolated; 3 by default.

    Raises
    ------
    ValueError
        If `tau` is not positive and finite.

    See Also
    --------
    SignedHeatSolver : The signed heat method alone.

    Examples
    --------
    >>> import numpy as np
    >>> import signedheat as sh
    >>> from signedheat.samples import sphere
    >>> ball = sphere(3)
    >>> solver = sh.SignedHeatSolver(ball, sh.methods.Extrapolated(tau=4))
    >>> equator = ball.level_set(ball.vertices[:, 2], 0.0)
    >>> bool(abs(solver.distance(equator).values - np.arcsin(ball.vertices[:, 2])).max() < 0.05)
    True
    """

    tau: float = 3.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "tau", positive_number(self.tau, "tau"))


Diffusion = float | Extrapolated
"""τ in ``t = τ h²``, or one to extrapolate from."""


def default_diffusion(discretization: Discretization) -> Diffusion:
    """Return `Extrapolated` on surfaces, where directions limit the accuracy, and 1 in space.

    Extrapolation leaves an error like 1/τ², and Y is smoothed over h √τ where it changes abruptly. With τ like h^(−2/5)
    both errors fall at the same rate.
    """
    if not isinstance(discretization, SurfaceDiscretization):
        return 1.0
    fineness = max(discretization.extent / FINE_EXTENT, 1.0)
    return Extrapolated(tau=Extrapolated.tau * fineness ** (2 / 5))


def lowered_for_times(discretization: Discretization, sources: Sequence[Any], diffusion: Diffusion) -> list[SourceTerm]:
    """Lower the sources for a diffusion time, and once more with a shorter time for components in which curves end.

    With `Extrapolated` there are one or two results. The first covers the whole surface, and its directions are to be
    extrapolated in time. The second has a third of the time, and its directions replace those of the first on the faces
    of components of the surface in which a curve ends (`blended`). Either is left out if it is used on no face.
    """
    if not isinstance(diffusion, Extrapolated):
        return [discretization.lower(sources, diffusion)]
    source = discretization.lower(sources, diffusion.tau)
    if not isinstance(source, SurfaceSource):
        raise UnsupportedTypeError(
            "directions are extrapolated in time on surfaces only", remedy="pass a number", element="diffusion"
        )
    at_ends = replace(source, time=source.time / Extrapolated.tau)  # by default τ is then 1, as in the paper
    if all(source.ending[curve.nodes.faces].all() for curve in source.parts):  # in all components with a source
        return [at_ends]
    everywhere = replace(source, extrapolated=True)
    return [everywhere, at_ends] if source.ending.any() else [everywhere]


def blended(sources: Sequence[SourceTerm], directions: Iterable[NDArray[Any]]) -> NDArray[Any]:
    """Return Y on all faces, (m,), from the directions, (m,), computed for each source of `lowered_for_times`.

    Components of the surface in which curves end have the directions of the last source, the others those of the first.
    """
    everywhere, *at_ends = directions
    for ending in at_ends:
        assert isinstance(sources[0], SurfaceSource)
        everywhere[sources[0].ending] = ending[sources[0].ending]
    return everywhere
