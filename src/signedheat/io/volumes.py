"""Reading of voxel volumes, and of grids with solid nodes, from images."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..domains.digital_surface import DigitalSurface
from ..domains.grid import Grid
from ..errors import FileFormatError
from ..packages import lazy_module
from .arrays import read_npy
from .fields import _read_npy, _read_nrrd
from .files import PathLike, contents, ensure_fits, extension, reading, unknown_extension, with_messages
from .vtk_xml import read_vti

Image = lazy_module("PIL.Image", "pictures as masks")


def read_volume(path: PathLike, level: float | None = None, radius: float | None = None) -> DigitalSurface:
    """Read a set of voxels from an image, as a digital surface.

    Parameters
    ----------
    path : str or path
        ``.npy`` (voxels of size 1, or with origin and spacing in a ``.json`` of the same name), ``.nrrd`` or ``.vti``.
    level : float, optional
        Voxels with larger values are inside. Without it the image must have booleans, or zeros and ones.
    radius : float, optional
        Passed to `DigitalSurface`.

    Returns
    -------
    DigitalSurface
        The boundary of the voxels.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, truncated or damaged.
    GeometryError
        If the image is not a set of voxels.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/one.npy", np.ones((1, 1, 1), dtype=bool))
    ...     read_volume(f"{folder}/one.npy").n_vertices
    8
    """
    values, origin, spacing = _read(path, VOLUME_READERS, "a volume")
    if values.ndim != 3:
        raise FileFormatError(f"the image has {values.ndim} axes, and a volume has 3", path=path)
    with reading(path):
        return DigitalSurface(values if level is None else values > level, spacing, origin, radius)


def read_mask(
    path: PathLike, level: float = 0.5, origin: ArrayLike | None = None, spacing: ArrayLike | None = None
) -> Grid:
    """Read a grid with walls from an image: every voxel or pixel becomes a node, solid or free.

    Parameters
    ----------
    path : str or path
        ``.npy``, ``.nrrd`` or ``.vti`` in the plane or in space, as for `read_volume`; pictures (``.png``, ``.bmp``,
        ``.tif``), whose first node is the lower left pixel, with y pointing up.
    level : float
        Voxels with larger values are solid. In pictures, pixels darker than this are, with 0 black and 1 white.
    origin, spacing : (d,) float, optional
        Position of the first node, and distance between nodes, instead of those in the file; for pictures by default 0
        and 1.

    Returns
    -------
    Grid
        With solid nodes.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, truncated or damaged.
    GeometryError
        If all nodes are solid, or origin or spacing are invalid.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/wall.npy", np.array([[0, 0, 0], [0, 1, 1]]))
    ...     read_mask(f"{folder}/wall.npy", spacing=0.5)
    Grid(origin=[0, 0], spacing=0.5, shape=(2, 3), 2 solid nodes)
    """
    values, first, steps = _read(path, MASK_READERS, "a mask")
    solid = values < level if extension(path) in PICTURES else values > level
    with reading(path):
        return Grid(first if origin is None else origin, steps if spacing is None else spacing, solid.shape, solid)


def _read(
    path: PathLike, readers: dict[str, Any], what: str
) -> tuple[NDArray[Any], NDArray[np.float64], NDArray[np.float64]]:
    reader = readers.get(extension(path))
    if reader is None:
        raise unknown_extension(path, readers, what)
    with reading(path):
        values, origin, spacing = reader(path)
    if values.dtype.kind not in "biuf":
        raise FileFormatError(f"the values are no real numbers but {values.dtype}: it holds no image", path=path)
    return values, origin, spacing


def _read_plain_npy(path: PathLike) -> tuple[NDArray[Any], NDArray[np.float64], NDArray[np.float64]]:
    """An array, with origin and spacing from the ``.json`` of the same name, if there is one."""
    if Path(path).with_suffix(".json").exists():
        return _read_npy(path)
    values = read_npy(path)
    return values, np.zeros(values.ndim), np.ones(values.ndim)


def _read_picture(path: PathLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Brightness from 0 to 1, indexed [x, y]; transparent pixels count as white."""
    data = contents(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about pictures that are large: they are compared with the memory
        opened = Image.open(io.BytesIO(data))
        _refuse_missing_pixels(opened, len(data), path)
        ensure_fits(16 * opened.width * opened.height, path)
        picture, told = with_messages(lambda: opened.convert("RGBA"))
    if told.strip() and opened.format == "TIFF":  # libtiff goes on after errors, with what it makes of the rest
        raise FileFormatError(
            f"it is damaged ({told.splitlines()[0]:.200})", remedy="write or download it again", path=path
        )
    white = Image.new("RGBA", picture.size, "white")
    brightness = np.asarray(Image.alpha_composite(white, picture).convert("L")) / 255
    return brightness[::-1].T, np.zeros(2), np.ones(2)


def _refuse_missing_pixels(picture: Any, size: int, path: PathLike) -> None:
    """Check that the parts of a picture cover it, and that its bytes are not too few for its pixels, in any packing."""
    n_pixels = picture.width * picture.height
    covered = sum((right - left) * (upper - lower) for _, (left, lower, right, upper), *_ in picture.tile)
    if covered < n_pixels or n_pixels > 8 * MOST_PACKED * size:
        raise FileFormatError(
            f"it announces {picture.width} × {picture.height} pixels, and has fewer",
            remedy="write or download it again",
            path=path,
        )


MOST_PACKED = 1 << 14
"""Bytes that a byte of a picture may stand for: pages without a mark, line by line, some thousands."""

VOLUME_READERS = {".npy": _read_plain_npy, ".nrrd": _read_nrrd, ".vti": read_vti}

PICTURES = frozenset({".bmp", ".png", ".tif", ".tiff"})

MASK_READERS = {**VOLUME_READERS, **dict.fromkeys(sorted(PICTURES), _read_picture)}
