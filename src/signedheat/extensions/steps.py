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
    closed : {"auto", "exact"}
        Whether faces of closed shapes that lie in layers are left out (`assemble`); a grid that is coarse on purpose
        takes thin walls for layers.
    """

    orient: bool = True
    unite: bool = True
    sharpen: bool = True
    constraint: Constraint = field(default_factory=ZeroSet)
    diffusion: float = 1.0
    closed: Fit = "auto"
