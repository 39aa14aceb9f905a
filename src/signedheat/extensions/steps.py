"""What distance to a solid is made of."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..constraints import Constraint, ZeroSet
from .shape_sharpening import Fit


@dataclass(frozen=True)
class Steps:
    """Which steps of `solid_distance` are taken, and how the method's own are.

    Attributes
    ----------
    orient, unite, sharpen : bool
        Turn faces that face the wrong way; leave out what lies inside other bodies; measure to the shape itself.
    constraint : Constraint
        On φ at the faces.
    diffusion : float
        τ in ``t = τ h²``.
    finest : float, optional
        Spacing of the band that the grid is coarse for, on purpose: what is thinner than its cells counts, and is not
        layered, and faces are cut as finely as that.
    """

    orient: bool = True
    unite: bool = True
    sharpen: bool = True
    constraint: Constraint = field(default_factory=ZeroSet)
    diffusion: float = 1.0
    finest: float | None = None

    @property
    def fit(self) -> Fit:
        """Whether faces of closed shapes that lie in layers are left out: see `assemble`."""
        return "auto" if self.finest is None else "exact"
