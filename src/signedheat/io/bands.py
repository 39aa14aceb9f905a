"""Reading and writing of fields in bands: NumPy archives of their blocks."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..domains.display import NAME
from ..domains.grid import Grid
from ..errors import FileFormatError, GeometryError
from ..fields.grid_field import GridField
from ..lowering.grid.discretization import refuse_beyond_memory
from ..operators.grid.blocks import SIDE, Blocks
from .files import PathLike, extension
from .vdb import write_vdb
from .vtk_xml import write_vti

CONVENTION = (
    "signed distance, negative inside; values[n, i, j, k] at origin + (8 * places[n] + (i, j, k)) * spacing, axes "
    "x, y, z, in the units of the shape; elsewhere coarse_values[i, j, k] at origin + (i, j, k) * coarse_spacing"
)

CLIPPED = "signed distance, negative inside, in the units of the shape; beyond the band plus or minus its half width"
BYTES_PER_NODE = 20.0
"""Of grids written whole: values, their copy in the order of the file, and what is written."""


def load_band_field(path: PathLike) -> GridField:
    """Read a ``.npz`` file of a field in a band.

    Raises
    ------
    FileFormatError
        If the file is damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            grid = Grid(file["origin"], file["spacing"], file["shape"])
            far = file["coarse_values"]
            coarse = GridField(Grid(file["origin"], file["coarse_spacing"], far.shape), far)
            blocks = Blocks.of(file["places"], grid.shape)
            confidence = file["confidence"] if "confidence" in file else None
            values = file["values"]
            if not np.array_equal(blocks.places, file["places"]):
                raise GeometryError("its blocks are not in order", element="places")
            return GridField(
                grid, values, confidence=confidence, blocks=blocks, coarse=coarse, width=float(file["width"])
            )
    except (KeyError, ValueError, OSError, zipfile.BadZipFile, GeometryError) as error:
        raise FileFormatError(
            f"it is no field in a band, or is truncated ({error})", remedy="write it again", path=path
        ) from error


def is_band_field(path: PathLike) -> bool:
    """Whether a file is an archive of blocks."""
    if extension(path) != ".npz" or not zipfile.is_zipfile(path):
        return False
    with zipfile.ZipFile(path) as file:
        return "coarse_values.npy" in file.namelist()


def _write_npz(field: GridField, path: Path) -> None:
    assert field.blocks is not None
    some: dict[str, Any] = {} if field.confidence is None else {"confidence": field.confidence}
    with path.open("wb") as file:
        np.savez(
            file,
            places=field.blocks.places,
            values=field.values,
            origin=field.grid.origin,
            spacing=field.grid.spacing,
            shape=np.array(field.grid.shape),
            width=np.array(field.width),
            coarse_values=field.whole.values,
            coarse_spacing=field.whole.grid.spacing,
            convention=np.array(CONVENTION),
            **some,
        )


def _write_vti(field: GridField, path: Path) -> None:
    """All nodes of the grid, for ParaView and solvers: those beyond the band have plus or minus its half width."""
    refuse_beyond_memory(field.grid, BYTES_PER_NODE, 0.0)
    path.write_bytes(write_vti(whole_values(field), field.grid.origin, field.grid.spacing, NAME, CLIPPED))


def whole_values(field: GridField) -> NDArray[np.float32]:
    """Values of a band at all nodes of its grid; beyond it, plus or minus its half width."""
    assert field.blocks is not None
    grid, width = field.grid, np.float32(field.width)
    counts = -(-np.array(grid.shape) // SIDE)
    places = np.argwhere(np.ones(counts, dtype=bool))
    rows = field.blocks.rows(places)
    middles = np.minimum(places[rows < 0] * SIDE + 0.5 * (SIDE - 1), np.array(grid.shape) - 1)
    parts = np.full((len(places), SIDE, SIDE, SIDE), width, dtype=np.float32)
    parts[rows < 0] *= np.where(field(grid.origin + middles * grid.spacing) < 0, -1, 1)[:, None, None, None]
    parts[rows >= 0] = np.clip(field.values[rows[rows >= 0]], -width, width)
    a, b, c = counts
    whole = parts.reshape(a, b, c, SIDE, SIDE, SIDE).transpose(0, 3, 1, 4, 2, 5).reshape(a * SIDE, b * SIDE, c * SIDE)
    return np.ascontiguousarray(whole[tuple(slice(0, n) for n in grid.shape)])


BAND_WRITERS: dict[str, Callable[[GridField, Path], None]] = {".npz": _write_npz, ".vdb": write_vdb, ".vti": _write_vti}

BAND_FORMATS = frozenset(BAND_WRITERS)
