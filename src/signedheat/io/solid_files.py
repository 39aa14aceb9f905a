"""NumPy archives of solids, so that nothing is decided again, and of samples to learn from."""

from __future__ import annotations

import numpy as np

from ..solids.sample_set import Layout, Samples
from ..solids.solid import Solid
from .field_files import CONVENTION
from .files import PathLike, ensure_writable, extension, format_for
from .numpy_files import write_npz
from .shape_files import SHAPE_FORMATS, save
from .solid_arrays import VERSION, arrays_of

SOLID_FORMATS = SAMPLE_FORMATS = frozenset({".npz"})


def save_solid(solid: Solid, path: PathLike) -> None:
    """Write a solid; to formats of shapes its surface."""
    ensure_writable(path, SOLID_FORMATS | SHAPE_FORMATS, "a solid")
    if extension(path) not in SOLID_FORMATS:
        return save(solid.surface(keep_faces=True), path)
    write_npz(path, solid_version=VERSION, **arrays_of(solid))


def save_samples(samples: Samples, path: PathLike, layout: Layout) -> None:
    """Write samples."""
    format_for(path, dict.fromkeys(SAMPLE_FORMATS), "samples")
    if layout == "deepsdf":  # (k, 4) in single precision: x, y, z and distance of the points outside and inside
        rows = np.column_stack([samples.points, samples.distances]).astype(np.float32)
        return write_npz(path, pos=rows[samples.distances >= 0], neg=rows[samples.distances < 0])
    write_npz(
        path,
        points=samples.points,
        distances=samples.distances,
        gradients=samples.gradients,
        near=samples.near,
        completed=samples.completed,
        center=samples.center,
        radius=samples.radius,
        convention=CONVENTION.partition(";")[0],
    )
