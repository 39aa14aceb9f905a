"""Convert solids to arrays and back, for archives of solids and of the fields that hold them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import fingerprint
from ..errors import FileFormatError, GeometryError
from ..mesh.triangles import face_areas
from ..solids.solid import Solid
from ..solids.winding import Windings
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import refuse_extreme
from .files import PathLike, reading
from .numerals import integers
from .numpy_files import names_in_npz, read_npz

SOLID_ARRAYS = ("triangles", "origins", "confidence", "bounding", "closing", "key")
"""Names of the arrays that each solid has in an archive."""
SOURCE_ARRAYS = ("source_vertices", "source_faces")
"""Names of the arrays of the shape that was completed to a solid, if the solid has it."""
ARCHIVE_VERSION = 2
"""Version of the format of archives. Archives of other versions are refused."""


def arrays_of(solid: Solid) -> dict[str, NDArray[Any]]:
    """Return the arrays of a solid by name, with a key that tells whether they have been changed."""
    arrays: dict[str, NDArray[Any]] = {
        "triangles": solid.triangles,
        "origins": solid.origins,
        "confidence": solid.confidence,
        "bounding": solid.bounding,
        "closing": solid.windings.triangles,
    }
    if solid.source is not None:
        arrays |= dict(zip(SOURCE_ARRAYS, (solid.source.vertices, solid.source.faces), strict=True))
    return {**arrays, "key": _key(arrays)}


def solid_of(arrays: Mapping[str, NDArray[Any]]) -> Solid:
    """Make the solid from which `arrays_of` made these arrays, without diagnostics. Damaged arrays are refused."""
    triangles, closing, origins = arrays["triangles"], arrays["closing"], arrays["origins"]
    confidence, bounding, n = arrays["confidence"], arrays["bounding"], len(triangles) if triangles.ndim else 0
    kinds = (triangles, "f", (n, 3, 3)), (closing, "f", (len(closing) if closing.ndim else 0, 3, 3))
    kinds += (origins, "iu", (n,)), (confidence, "f", (n,)), (bounding, "b", (n,))  # type: ignore[assignment]
    if not n or any(array.dtype.kind not in kind or array.shape != shape for array, kind, shape in kinds):
        raise _damaged("its arrays do not fit each other")
    if not all(np.isfinite(array).all() for array in (triangles, closing, confidence)):
        raise _damaged("its arrays are not finite")
    source = None
    try:
        for corners in (triangles.reshape(-1, 3), closing.reshape(-1, 3)):
            refuse_extreme(corners.min(axis=0, initial=0.0), corners.max(axis=0, initial=0.0), "triangles")
        if all(name in arrays for name in SOURCE_ARRAYS):
            source = TriangleMesh(*(arrays[name] for name in SOURCE_ARRAYS))
        windings = Windings(np.ascontiguousarray(closing, dtype=np.float64))
    except GeometryError as error:
        raise FileFormatError(error.cause, remedy=error.remedy, element=error.element) from error
    last = int(origins.max()) if source is None else source.n_faces - 1
    if origins.min() < -1 or origins.max() > last or confidence.min() < 0 or confidence.max() > 1:
        raise _damaged("it refers to faces that do not exist, or its confidence is not from 0 to 1")
    if not face_areas(triangles).any():
        raise _damaged("all its triangles have zero area")
    if not np.array_equal(arrays["key"], _key({name: arrays[name] for name in arrays if name != "key"})):
        raise _damaged("its arrays were changed after it was written")
    return Solid(
        np.ascontiguousarray(triangles, dtype=np.float64),
        origins.astype(np.int64),
        confidence.astype(np.float32),
        bounding.astype(np.bool_),
        windings,
        source,
    )


def holds_solid(path: PathLike) -> bool:
    """Whether a NumPy archive holds a solid, not a field."""
    return "solid_version" in names_in_npz(path)


def read_solid(path: PathLike) -> Solid:
    """Read a solid that `Solid.save` has written, with the same distances to the last bit.

    Parameters
    ----------
    path : str or path
        A ``.npz`` file.

    Returns
    -------
    Solid
        The solid, with empty diagnostics.

    Raises
    ------
    FileFormatError
        If the file is missing, truncated or damaged, has no solid, was changed, or was written by another version.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> from signedheat import samples
    >>> solid = sh.complete(samples.without_faces(samples.sphere(2), 0.2))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     solid.save(f"{folder}/ball.npz")
    ...     again = sh.read(f"{folder}/ball.npz")
    >>> bool(again.distance([[0.1, 0.2, 0.3]]) == solid.distance([[0.1, 0.2, 0.3]]))
    True
    """
    with reading(path):
        held = read_npz(path, ("solid_version",)).get("solid_version")
        if held is None or held.shape:
            raise FileFormatError("it has no solid", remedy="read fields by `read_field`, shapes by `read`")
        [version] = integers(held.reshape(1), "solid_version", 1).tolist()
        if version != ARCHIVE_VERSION:
            is_later = version > ARCHIVE_VERSION
            remedy = "install a later version of signedheat" if is_later else "complete the shape again"
            raise FileFormatError(f"another version wrote it ({version}, not {ARCHIVE_VERSION})", remedy=remedy)
        return solid_of(read_npz(path, SOURCE_ARRAYS, SOLID_ARRAYS))


def _key(arrays: Mapping[str, NDArray[Any]]) -> NDArray[np.uint8]:
    """Return a fingerprint of the arrays of a solid, as bytes, which later changes of the arrays do not match."""
    held = (arrays[name] for name in (*SOLID_ARRAYS, *SOURCE_ARRAYS) if name in arrays)
    return np.frombuffer(fingerprint(*held), dtype=np.uint8)


def _damaged(cause: str) -> FileFormatError:
    """Return the error for arrays that are not those of a solid."""
    return FileFormatError(cause, remedy="write the solid again", element="solid")
