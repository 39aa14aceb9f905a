"""NumPy archives of solids, so that nothing is decided again, and of samples to learn from."""

from __future__ import annotations

import numpy as np

from ..errors import FileFormatError
from ..solids.sample_set import Layout, Samples
from ..solids.solid import Solid
from .field_files import CONVENTION
from .files import PathLike, ensure_writable, extension, format_for, reading
from .numpy_files import read_npz, write_npz
from .shape_files import SHAPE_FORMATS, save
from .solid_arrays import NEEDED, SOURCE, arrays_of, solid_of

VERSION = 2
"""Of the archive: what another one has written is refused."""
SOLID_FORMATS = SAMPLE_FORMATS = frozenset({".npz"})


def save_solid(solid: Solid, path: PathLike) -> None:
    """Write a solid; to formats of shapes its surface."""
    ensure_writable(path, SOLID_FORMATS | SHAPE_FORMATS, "a solid")
    if extension(path) not in SOLID_FORMATS:
        return save(solid.surface(keep_faces=True), path)
    write_npz(path, solid_version=VERSION, **arrays_of(solid))


def load(path: PathLike) -> Solid:
    """Read a solid that `Solid.save` has written: distances are the same to the last bit.

    Parameters
    ----------
    path : str or path
        A ``.npz`` file.

    Returns
    -------
    Solid
        Its diagnostics are empty.

    Raises
    ------
    FileFormatError
        If the file is missing, truncated or damaged, has no solid, was changed, or was written by another version.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> from signedheat import samples
    >>> solid = sh.complete(samples.broken_duck())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     solid.save(f"{folder}/duck.npz")
    ...     again = sh.io.load(f"{folder}/duck.npz")
    >>> bool(again.distance([[0.1, 0.2, 0.3]]) == solid.distance([[0.1, 0.2, 0.3]]))
    True
    """
    version = read_npz(path, ("solid_version",)).get("solid_version", np.zeros(1))
    if version.shape or version.dtype.kind not in "iuf" or not 0 < version < np.inf:
        raise FileFormatError("it has no solid", remedy="read fields by `load_field`, shapes by `read`", path=path)
    if int(version) != VERSION:
        remedy = "install a later version of signedheat" if int(version) > VERSION else "complete the shape again"
        raise FileFormatError(f"another version wrote it ({int(version)}, not {VERSION})", remedy=remedy, path=path)
    with reading(path):
        return solid_of(read_npz(path, SOURCE, NEEDED))


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
