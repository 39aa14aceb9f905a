"""Sample points with signed distances to a shape."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, Literal

from ..arrays import Bools, Floats
from ..errors import counted
from ..packages import lazy_module

files: Any = lazy_module("signedheat.io.shape_files", "files")

NOISE_WIDTHS = (0.05, 0.0158)
"""Default widths of the noise, relative to the radius of the shape: variances 0.0025 and 0.00025 (Park et al. 2019)."""
Layout = Literal["arrays", "deepsdf"]
"""Layout of files of samples: an array for each attribute, or ``pos`` and ``neg`` with x, y, z and distance."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Points with the signed distances to a shape.

    Attributes
    ----------
    points : (n, 3) float
        Positions: those near the surface first, width by width, then those spread over the cube.
    distances : (n,) float
        Signed distances to the shape and its completion, in the units of the shape, negative inside.
    gradients : (n, 3) float
        Gradients of the distance, of length 1.
    near : (n,) bool
        Whether a point was sampled near the surface.
    completed : (n,) bool
        Whether the nearest point lies on the completion.
    center : (3,) float
        Centre of the box around the surface, in the units of the shape.
    radius : float
        Distance from the centre to the farthest point of the surface, in the units of the shape.

    See Also
    --------
    sample_distances : Points with their distances, to learn from.
    batches.Sampling : How points are sampled.

    Examples
    --------
    >>> import numpy as np
    >>> from signedheat import sample_distances, samples, signed_distance
    >>> drawn = sample_distances(signed_distance(samples.sphere(2, radius=5.0), resolution=24), 1000, near=0.8)
    >>> drawn
    Samples(1000 points, 800 near the surface, distances from -3.82 to 3.07)
    >>> bool(np.abs(drawn.normalized().points).max() < 1.3)
    True
    """

    points: Floats
    distances: Floats
    gradients: Floats
    near: Bools
    completed: Bools
    center: Floats
    radius: float

    def normalized(self) -> Samples:
        """Move and scale the samples so that the shape fits the unit sphere; `center` and `radius` stay as they are.

        Returns
        -------
        Samples
            Points and distances in units of the radius.

        See Also
        --------
        results.Samples.save : Write the samples.

        Examples
        --------
        >>> import numpy as np
        >>> import signedheat as sh
        >>> drawn = sh.complete(sh.samples.sphere(2, radius=5.0)).sample(10)
        >>> bool(np.abs(drawn.normalized().points).max() < 2 < np.abs(drawn.points).max())
        True
        """
        points, distances = (self.points - self.center) / self.radius, self.distances / self.radius
        return replace(self, points=points, distances=distances)

    @property
    def figures(self) -> dict[str, float | list[float]]:
        """A summary of the samples by name, ready for JSON.

        "samples" is the number of points, and "near" that of those sampled near the surface. "inside_share" and
        "completed_share" are the shares of points, from 0 to 1, that are inside, and whose nearest point lies on the
        completion. "center" is that of the bounding box of the surface, and "radius" the distance from it to the
        farthest point of the surface, in the units of the shape.
        """
        return {
            "samples": len(self.points),
            "near": int(self.near.sum()),
            "inside_share": float((self.distances < 0).mean()),
            "completed_share": float(self.completed.mean()),
            "center": [float(x) for x in self.center],
            "radius": self.radius,
        }

    def save(self, path: str | PathLike[str], layout: Layout = "arrays") -> None:
        """Write the samples to a ``.npz`` file.

        Parameters
        ----------
        path : str or path
            The file. An existing file survives a failure.
        layout : "arrays" or "deepsdf"
            An array for each attribute, in full precision; or, as in DeepSDF, the (k, 4) arrays ``pos`` and ``neg`` in
            single precision, with x, y, z and distance of the points outside and inside.

        Raises
        ------
        FileFormatError
            If the name does not end with ``.npz``, or the file cannot be written.

        See Also
        --------
        sample_distances : Make samples.

        Examples
        --------
        >>> import numpy as np
        >>> import tempfile
        >>> from signedheat import sample_distances, samples, signed_distance
        >>> drawn = sample_distances(signed_distance(samples.sphere(2), resolution=16), 10)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     drawn.save(f"{folder}/ball.npz")
        ...     np.load(f"{folder}/ball.npz")["points"].shape
        (10, 3)
        """
        files.save_samples(self, path, layout)

    def __repr__(self) -> str:
        low, high = self.distances.min(), self.distances.max()
        count = f"{counted(len(self.points), 'point')}, {int(self.near.sum())} near the surface"
        return f"Samples({count}, distances from {low:.3g} to {high:.3g})"
