"""Reading and writing of solids: NumPy archives of what was completed, so that nothing is decided again."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError, GeometryError
from ..solids.files import save_solid
from ..solids.solid import Solid
from ..solids.winding import Windings
from .arrays import read_npz
from .files import PathLike, ensure_writable, replacing

VERSION = 1
"""Of the archive: what a later one writes is refused."""
SOLID_FORMATS = frozenset([".npz"])
_NEEDED = ("triangles", "origins", "confidence", "bounding", "closing")
_SOURCE = ("source_vertices", "source_faces")


@save_solid.provide
def _(solid: object, path: PathLike) -> None:
    assert isinstance(solid, Solid)
    ensure_writable(path, SOLID_FORMATS, "a solid")
    source: dict[str, Any] = {}
    if solid.source is not None:
        source = dict(zip(_SOURCE, (solid.source.vertices, solid.source.faces), strict=True))
    closing = solid.windings.triangles
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(
            file,
            solid_version=np.array(VERSION),
            triangles=solid.triangles,
            origins=solid.origins,
            confidence=solid.confidence,
            bounding=solid.bounding,
            closing=closing,
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
    found = read_npz(path, ("solid_version", *_NEEDED, *_SOURCE))
    version = int(found["solid_version"]) if "solid_version" in found and not found["solid_version"].shape else 0
    if not 0 < version <= VERSION:
        raise FileFormatError(
            f"a later version wrote it ({version})" if version else "it has no solid",
            remedy="install a later version of signedheat"
            if version
            else "read fields by `load_field`, shapes by `read`",
            path=path,
        )
    lacking = [name for name in _NEEDED if name not in found]
    if lacking:
        raise FileFormatError(f"it has no {lacking[0]}", remedy="write it again", element=lacking[0], path=path)
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
