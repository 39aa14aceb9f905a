"""Reading and writing of fields on grids, exact to the last bit: values, origin, spacing, order of axes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..domains.display import NAME
from ..domains.grid import Grid
from ..errors import FileFormatError, GeometryError
from ..fields.files import save_field as save_any_field
from ..fields.grid_field import GridField
from ..fields.tet_field import TetField
from ..fields.to_field import Field
from ..fields.vertex_field import VertexField
from ..packages import require
from .arrays import read_npy, read_npz
from .bands import BAND_FORMATS, BAND_WRITERS, is_band_field, load_band_field
from .files import PathLike, contents, ensure_writable, extension, reading, replacing, unknown_extension
from .nrrd_files import read_image, write_image
from .surface_fields import is_vertex_field, load_vertex_field, save_vertex_field
from .tets import TET_FIELD_FORMATS, load_tet_field, save_tet_field
from .vdb import write_vdb
from .vdb_reader import read_vdb_image
from .vtk_xml import read_vti_with, write_vti

_NEEDED = {".nrrd": ("nrrd", "NRRD files")}

CONVENTION = (
    "signed distance, positive on the side that the normals point to (negative inside an outward-oriented shape); "
    "values[i, j, k] at origin + (i, j, k) * spacing, axes x, y, z, in the units of the shape"
)
CONFIDENCE = "confidence"

Parts = tuple[Any, ...]
"""Values, origin, spacing; then the mask and the confidence, or None, as far as the format has them."""


@save_any_field.provide
def _(field: object, path: PathLike) -> None:
    if isinstance(field, GridField):
        save_field(field, path)
    elif isinstance(field, TetField):
        save_tet_field(field, path)
    elif isinstance(field, VertexField):
        save_vertex_field(field, path)
    else:
        raise FileFormatError(f"a {type(field).__name__} is no field", remedy="pass what a solver returned", path=path)


def save_field(field: GridField, path: PathLike) -> None:
    """Write a field on a grid, in the format given by the extension.

    ``.npz`` (NumPy), ``.vti`` (VTK, ParaView), ``.nrrd`` (3D Slicer, medical imaging), ``.npy`` with a ``.json`` of the
    same name beside it, ``.vdb`` (OpenVDB; single precision).

    Parameters
    ----------
    field : GridField
        The field.
    path : str or path
        The file. It is written under a temporary name and renamed, so that an existing file survives a failure.

    Raises
    ------
    FileFormatError
        If the format is unknown, does not support the dimension of the field, or the file cannot be written.
    """
    if not isinstance(field, GridField):
        raise FileFormatError(f"a {type(field).__name__} is no field on a grid: it has formats of its own", path=path)
    if field.grid.dimension not in _DIMENSIONS.get(extension(path), (field.grid.dimension,)):
        raise FileFormatError(
            f"the field has {field.grid.dimension} axes, too many or few", remedy="save it as .npz", path=path
        )
    ensure_field_writable(path, in_band=field.blocks is not None)
    write = BAND_WRITERS[extension(path)] if field.blocks is not None else _FORMATS[extension(path)][0]
    if extension(path) == ".npy":
        with replacing(Path(path).with_suffix(".json")) as beside, replacing(path) as temporary:
            beside.write_text(json.dumps(_description(field.grid), indent=1) + "\n")
            write(field, temporary)
    else:
        with replacing(path) as temporary:
            write(field, temporary)


def ensure_field_writable(path: PathLike, in_band: bool = False) -> None:
    """Check before a long computation that a field can be written, in a band or whole.

    Raises
    ------
    FileFormatError
        If the format is unknown, or no file can be made there.
    MissingPackageError
        If the format needs a package that is not installed.
    """
    ensure_writable(path, BAND_FORMATS if in_band else _FORMATS, "a field in a band" if in_band else "a field")
    if extension(path) in _NEEDED:
        require(*_NEEDED[extension(path)])


def load_field(path: PathLike) -> Field:
    """Read a field, exactly as it was written: values and transform.

    Parameters
    ----------
    path : str or path
        A ``.npz``, ``.vti``, ``.nrrd``, ``.npy`` (with its ``.json``) or ``.vdb`` file; images of other programs can be
        read if their axes are x, y, z. A ``.vtu``, ``.vtk`` or ``.msh`` file has a field on tets; ``.ply``, ``.vtp``,
        or ``.npz`` with vertices, one on a surface; ``.npz`` with blocks one in a band.

    Returns
    -------
    GridField, TetField or VertexField
        The field; its diagnostics are empty.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, truncated, damaged, or has no scalar image along x, y, z.

    Examples
    --------
    >>> import tempfile, numpy as np, signedheat as sh
    >>> phi = GridField(sh.Grid((0, 0, 0), (0.1, 0.2, 0.3), (2, 3, 4)), np.random.default_rng(0).random((2, 3, 4)))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_field(phi, f"{folder}/phi.vti")
    ...     bool((load_field(f"{folder}/phi.vti").values == phi.values).all())
    True
    """
    if extension(path) in TET_FIELD_FORMATS:
        return load_tet_field(path)
    if is_vertex_field(path):
        return load_vertex_field(path)
    if is_band_field(path):
        return load_band_field(path)
    if extension(path) not in _FORMATS:
        raise unknown_extension(path, _FORMATS, "a field")
    _, read = _FORMATS[extension(path)]
    with reading(path):
        return _field_of(read(path), path)


def _field_of(parts: Parts, path: PathLike) -> GridField:
    values, origin, spacing, mask, confidence = (*parts, None, None)[:5]
    try:
        if not np.issubdtype(values.dtype, np.number) or np.iscomplexobj(values):
            raise FileFormatError(f"the values are no real numbers but {values.dtype}: it holds no field", path=path)
        grid = Grid(origin, spacing, values.shape, mask)
        return GridField(grid, np.ascontiguousarray(values), confidence=confidence)
    except GeometryError as error:
        raise FileFormatError(error.cause, remedy=error.remedy, element=error.element, path=path) from error


def _description(grid: Grid) -> dict[str, Any]:
    return {"origin": grid.origin.tolist(), "spacing": grid.spacing.tolist(), "convention": CONVENTION}


def _write_npz(field: GridField, path: Path) -> None:
    optional: dict[str, Any] = {"mask": field.grid.mask, CONFIDENCE: field.confidence}
    with path.open("wb") as file:
        np.savez(
            file,
            values=field.values,
            origin=field.grid.origin,
            spacing=field.grid.spacing,
            convention=np.array(CONVENTION),
            **{name: values for name, values in optional.items() if values is not None},
        )


def _read_npz(path: PathLike) -> Parts:
    found = read_npz(path, ("values", "origin", "spacing", "mask", CONFIDENCE))
    lacking = [name for name in ("values", "origin", "spacing") if name not in found]
    if lacking:
        raise FileFormatError(
            f"it has no {lacking[0]}: a field has values, origin and spacing", element=lacking[0], path=path
        )
    return found["values"], found["origin"], found["spacing"], found.get("mask"), found.get(CONFIDENCE)


def _write_npy(field: GridField, path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, field.values, allow_pickle=False)


def _read_npy(path: PathLike) -> Parts:
    values, beside = read_npy(path), Path(path).with_suffix(".json")
    text = contents(beside)
    with reading(beside):
        about = json.loads(text)
        return values, np.array(about["origin"], dtype=np.float64), np.array(about["spacing"], dtype=np.float64)


def _write_vti(field: GridField, path: Path) -> None:
    others = {} if field.confidence is None else {CONFIDENCE: field.confidence}
    path.write_bytes(write_vti(field.values, field.grid.origin, field.grid.spacing, NAME, CONVENTION, others))


def _read_vti(path: PathLike) -> Parts:
    values, origin, spacing, confidence = read_vti_with(path, CONFIDENCE)
    return values, origin, spacing, None, confidence


def _write_nrrd(field: GridField, path: Path) -> None:
    axes = np.diag(field.grid.spacing)
    write_image(path, field.values, axes, field.grid.origin, content=NAME, convention=CONVENTION)


def _read_nrrd(path: PathLike) -> Parts:
    values, header = read_image(path)
    directions = np.atleast_2d(header.get("space directions", np.diag(header.get("spacings", np.ones(values.ndim)))))
    spacing = np.diag(directions) if directions.shape == (values.ndim, values.ndim) else np.zeros(values.ndim)
    if not np.array_equal(directions, np.diag(spacing)):
        raise FileFormatError("its axes are not x, y, z", remedy="resample the image along them", path=path)
    return values, np.asarray(header.get("space origin", np.zeros(values.ndim))), spacing


_FORMATS: dict[str, tuple[Callable[[GridField, Path], None], Callable[[PathLike], Parts]]] = {
    ".npy": (_write_npy, _read_npy),
    ".npz": (_write_npz, _read_npz),
    ".nrrd": (_write_nrrd, _read_nrrd),
    ".vdb": (write_vdb, read_vdb_image),
    ".vti": (_write_vti, _read_vti),
}

_DIMENSIONS = {".vti": (1, 2, 3), ".vdb": (3,)}
"""Numbers of axes that a format supports; the others support any number."""

FIELD_FORMATS = frozenset(_FORMATS)
