"""Volumes of voxels from files."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..domains.digital_surface import DigitalSurface
from ..errors import FileFormatError
from .fields import _read_npy, _read_nrrd
from .files import PathLike, contents, extension, unknown_extension
from .vtk_xml import read_vti


def read_volume(path: PathLike, level: float | None = None, radius: float | None = None) -> DigitalSurface:
    """Read the boundary of a set of voxels from an image.

    Parameters
    ----------
    path : str or path
        ``.npy`` (voxels of size 1, or with origin and spacing in a ``.json`` of the same name), ``.nrrd`` or ``.vti``.
    level : float, optional
        Voxels with larger values are inside. Without it the image must be boolean, or of zeros and ones.
    radius : float, optional
        Passed to `DigitalSurface`.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown kind, truncated or damaged.
    GeometryError
        If what it holds is no set of voxels.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/one.npy", np.ones((1, 1, 1), dtype=bool))
    ...     read_volume(f"{folder}/one.npy").n_vertices
    8
    """
    reader = VOLUME_READERS.get(extension(path))
    if reader is None:
        raise unknown_extension(path, VOLUME_READERS, "a volume")
    values, origin, spacing = reader(path)
    if np.iscomplexobj(values) or values.dtype.kind not in "biuf":
        raise FileFormatError(f"{path}: the values are no real numbers but {values.dtype}: it holds no volume")
    return DigitalSurface(values if level is None else values > level, spacing, origin, radius)


def _read_plain_npy(path: PathLike) -> tuple[NDArray[Any], NDArray[np.float64], NDArray[np.float64]]:
    """An array, with origin and spacing where they are given beside it."""
    if Path(path).with_suffix(".json").exists():
        return _read_npy(path)
    try:
        values = np.load(io.BytesIO(contents(path)), allow_pickle=False)
    except ValueError as error:
        raise FileFormatError(f"{path}: it is no .npy file, or is truncated ({error}): write it again") from error
    return values, np.zeros(3), np.ones(3)


VOLUME_READERS = {".npy": _read_plain_npy, ".nrrd": _read_nrrd, ".vti": read_vti}
