"""How single steps of the method are done: extrapolation in diffusion time, and ways to sharpen a field."""

from .sharpening_methods import Convex, Geodesic
from .surfaces.extrapolation import Extrapolated

__all__ = ["Convex", "Extrapolated", "Geodesic"]
