"""NumPy archives of solids, so that nothing is decided again, and of samples to learn from."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError, GeometryError
from ..solids.sample_set import Layout, Samples
from ..solids.solid import Solid
from ..solids.winding import Windings
from .arrays import read_npz, write_npz
from .fields import CONVENTION
from .files import PathLike, ensure_writable, extension, format_for
from .shapes import SHAPE_FORMATS, save

VERSION = 1
"""Of the archive: what a later one writes is refused."""
SOLID_FORMATS = SAMPLE_FORMATS = frozenset({".npz"})
_NEEDED = ("triangles", "origins", "confidence", "bounding", "closing")
_SOURCE = ("source_vertices", "source_faces")


def save_solid(solid: Solid, path: PathLike) -> None:
    """Write a solid; to formats of shapes its surface."""
    ensure_writable(path, SOLID_FORMATS | SHAPE_FORMATS, "a solid")
    if extension(path) not in SOLID_FORMATS:
        return save(solid.surface(keep_faces=True), path)
    source: dict[str, Any] = {}
    if solid.source is not None:
        source = dict(zip(_SOURCE, (solid.source.vertices, solid.source.faces), strict=True))
    write_npz(
        path,
        solid_version=VERSION,
        triangles=solid.triangles,
        origins=solid.origins,
        confidence=solid.confidence,
        bounding=solid.bounding,
        closing=solid.windings.triangles,
        **source,
    )


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
        If the file is missing, truncated or damaged, has no solid, or was written by a later version.

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
    if version.shape or int(version) <= 0:
        raise FileFormatError("it has no solid", remedy="read fields by `load_field`, shapes by `read`", path=path)
    if int(version) > VERSION:
        cause, remedy = f"a later version wrote it ({int(version)})", "install a later version of signedheat"
        raise FileFormatError(cause, remedy=remedy, path=path)
    found = read_npz(path, _SOURCE, _NEEDED)
    triangles, closing = found["triangles"], found["closing"]
    n = len(triangles)
    alike = triangles.shape == (n, 3, 3) and closing.shape == (len(closing), 3, 3) and n > 0
    alike &= all(found[name].shape == (n,) for name in ("origins", "confidence", "bounding"))
    if not alike or not (np.isfinite(triangles).all() and np.isfinite(closing).all()):
        raise FileFormatError(
            "its arrays do not fit to each other, or are not finite", remedy="write it again", path=path
        )
    try:
        source = TriangleMesh(*(found[name] for name in _SOURCE)) if all(name in found for name in _SOURCE) else None
    except GeometryError as error:
        raise FileFormatError(error.cause, remedy="write it again", element=error.element, path=path) from error
    if source is not None and int(found["origins"].max()) >= source.n_faces:
        raise FileFormatError("it names faces that are not there", remedy="write it again", path=path)
    return Solid(
        triangles.astype(np.float64),
        found["origins"].astype(np.int64),
        found["confidence"].astype(np.float32),
        found["bounding"].astype(np.bool_),
        Windings(closing.astype(np.float64)),
        source,
    )


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
