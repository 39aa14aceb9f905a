"""Writing of samples to learn from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import SignedHeatError
from ..solids.sampling import Layout, Samples, save_samples
from .fields import CONVENTION
from .files import PathLike, extension, replacing, unknown_extension

SAMPLE_FORMATS = frozenset({".npz"})


@save_samples.provide
def _(samples: object, path: PathLike, layout: Layout) -> None:
    if extension(path) not in SAMPLE_FORMATS:
        raise unknown_extension(path, SAMPLE_FORMATS, "samples")
    if not isinstance(samples, Samples):
        raise SignedHeatError(f"a {type(samples).__name__} is no set of samples", remedy="pass what `sample` returned")
    arrays = deepsdf_arrays(samples) if layout == "deepsdf" else plain_arrays(samples)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)


def deepsdf_arrays(samples: Samples) -> dict[str, NDArray[np.float32]]:
    """``pos`` and ``neg``, (k, 4) in single precision: x, y, z and distance of the points outside and inside."""
    rows = np.column_stack([samples.points, samples.distances]).astype(np.float32)
    inside = samples.distances < 0
    return {"pos": rows[~inside], "neg": rows[inside]}


def plain_arrays(samples: Samples) -> dict[str, NDArray[np.generic]]:
    """One array for each attribute, and the convention of signs in words."""
    return {
        "points": samples.points,
        "distances": samples.distances,
        "gradients": samples.gradients,
        "near": samples.near,
        "completed": samples.completed,
        "center": samples.center,
        "radius": np.array(samples.radius),
        "convention": np.array(CONVENTION.partition(";")[0]),
    }
