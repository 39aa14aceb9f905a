"""Read and write fields on grids, in bands, on surfaces and on tets, without loss."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError, GeometryError
from ..fields.field import Field
from ..fields.solid_queries import Scaled, SolidQueries, scaled
from ..grids.band import Band
from ..grids.blocks import BLOCK, Blocks
from ..grids.grid import Grid
from ..grids.grid_discretization import refuse_large_grid
from ..shapes.exchange import VALUES_NAME, Elements
from ..shapes.foreign import SurfaceShape, elements, shape_of
from ..solids.solid import Solid
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from .files import PathLike, contents, damaged, ensure_writable, extension, format_for, reading, replacing
from .image_files import CONFIDENCE, read_image, write_nrrd
from .mesh_files import write_obj
from .numerals import integers
from .numpy_files import names_in_npz, read_npz, write_npz
from .ply import read_ply, write_ply
from .solid_arrays import SOLID_ARRAYS, SOURCE_ARRAYS, arrays_of, solid_of
from .tet_files import TET_FIELD_FORMATS, load_cells, store_cells
from .vdb import write_vdb
from .vtk_xml import read_vtp, write_vti, write_vtp

PREFIX = "solid_"
"""Prefix of the arrays of a solid in the archive of its field."""
CONVENTION = (
    "signed distance, positive on the side that the normals point to (negative inside an outward-oriented shape); "
    "values[i, j, k] at origin + (i, j, k) * spacing, axes x, y, z, in the units of the shape"
)
"""Note in files of fields on grids that says what the values mean."""
OF_BANDS = (
    "signed distance, negative inside; values[n, i, j, k] at origin + (8 * places[n] + (i, j, k)) * spacing, axes "
    "x, y, z, in the units of the shape; elsewhere coarse_values[i, j, k] at origin + (i, j, k) * coarse_spacing"
)
"""The same note in archives of fields in bands."""
CLIPPED = "signed distance, negative inside, in the units of the shape; beyond the band plus or minus its half width"
"""The same note in files that hold a field in a band as values at all nodes."""
OF_CLOUDS = ("normals", "areas", "n_neighbors")
"""Arrays of the archive of a field on a point cloud, besides its points."""
_DIMENSIONS = {".vti": (1, 2, 3), ".vdb": (3,)}
"""Numbers of axes that a format of fields supports. Formats that are not named support any number."""


def write_field(field: Field[Any], path: PathLike) -> None:
    """Write a field of any kind, in the format given by the extension."""
    if isinstance(field.domain, Grid):
        save_field(field, path)
    elif isinstance(field.domain, TetMesh):
        format_for(path, dict.fromkeys(TET_FIELD_FORMATS), "a field on tets")
        store_cells(field.domain.to_meshio({VALUES_NAME: field.values}), path)
    else:
        write = format_for(path, {".npz": None, ".obj": write_obj, **VALUE_FORMATS}, "a field on a surface")
        simple: Field[Any] = field.plain()
        if write is None:
            return _write_vertex_npz(simple, path)
        with replacing(path) as temporary:
            temporary.write_bytes(write(elements(simple.domain, {VALUES_NAME: simple.values}), path))


def save_field(field: Field[Any], path: PathLike) -> None:
    """Write a field on a grid or in a band, in the format given by the extension.

    Parameters
    ----------
    field : Field
        A field on a grid, or in a band of one.
    path : str or path
        ``.npz`` (NumPy), ``.vti`` (VTK, ParaView), ``.nrrd`` (3D Slicer, medical imaging), ``.npy`` with a ``.json`` of
        the same name next to it, or ``.vdb`` (OpenVDB, in single precision, which is not read back). For bands
        ``.npz``, ``.vti`` or ``.vdb``. The file is replaced only after the new one is complete.

    Raises
    ------
    FileFormatError
        If the field is not on a grid, the format is unknown or does not support it, or the file cannot be written.

    See Also
    --------
    Field.save : The same for fields on any domain.
    """
    if not isinstance(field.domain, Grid):
        raise FileFormatError(f"the field lies on a {type(field.domain).__name__}, not on a grid", path=path)
    if field.domain.dimension not in _DIMENSIONS.get(extension(path), (field.domain.dimension,)):
        raise FileFormatError(
            f"the field has {field.domain.dimension} axes, which the format does not support",
            remedy="save it as .npz",
            path=path,
        )
    ensure_field_writable(path, in_band=isinstance(field.domain, Band))
    write = (_GRID_WRITERS if not isinstance(field.domain, Band) else _BAND_WRITERS)[extension(path)]
    if extension(path) == ".npy":
        about = {
            "origin": field.domain.origin.tolist(),
            "spacing": field.domain.spacing.tolist(),
            "convention": CONVENTION,
        }
        with replacing(Path(path).with_suffix(".json")) as companion, replacing(path) as temporary:
            companion.write_text(json.dumps(about, indent=1) + "\n")
            write(field, temporary)
    else:
        with replacing(path) as temporary:
            write(field, temporary)


def ensure_field_writable(path: PathLike, in_band: bool = False) -> None:
    """Raise an error if a field cannot be written to a file, before a long computation.

    Parameters
    ----------
    path : str or path
        The file, whose extension gives the format.
    in_band : bool
        Whether the field will lie in a band, which fewer formats support.

    Raises
    ------
    FileFormatError
        If the format is unknown or does not support such fields, or the folder is not writable.
    """
    ensure_writable(path, BAND_FORMATS if in_band else FIELD_FORMATS, "a field in a band" if in_band else "a field")


def read_field(path: PathLike) -> Field:
    """Read a field exactly as it was written, with values and transform.

    Parameters
    ----------
    path : str or path
        A ``.npz``, ``.vti``, ``.nrrd`` or ``.npy`` (with its ``.json``) file; images of other programs can be read if
        their axes are x, y, z. A ``.vtu``, ``.vtk`` or ``.msh`` file has a field on tets, a ``.ply``, ``.vtp``
        or ``.npz`` file with vertices one on a surface, and an ``.npz`` file with blocks one in a band.

    Returns
    -------
    Field
        The field, with empty diagnostics. From ``.npz`` it has its solid again, if it had one, so that it is as exact
        between nodes as before. From all other formats, values between nodes are interpolated.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, truncated, damaged, or has no scalar image along x, y, z.

    See Also
    --------
    read : Read a shape or a solid.
    signed_distance : Distance on a grid, on tets or along a surface.

    Examples
    --------
    >>> import tempfile, numpy as np, signedheat as sh
    >>> phi = Field(sh.Grid((0, 0, 0), (0.1, 0.2, 0.3), (2, 3, 4)), np.random.default_rng(0).random((2, 3, 4)))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_field(phi, f"{folder}/phi.vti")
    ...     bool((read_field(f"{folder}/phi.vti").values == phi.values).all())
    True
    """
    if extension(path) in TET_FIELD_FORMATS:
        return _load_tet_field(path)
    names = names_in_npz(path) if extension(path) == ".npz" else set()
    if extension(path) in _VALUES or {"values", "vertices"} <= names:
        return load_vertex_field(path)
    if "coarse_values" in names:
        return _load_band(path)
    if extension(path) == ".vdb":
        raise FileFormatError(
            "OpenVDB files are written and not read",
            remedy="keep the field as .npz too; of others' files, read the values by OpenVDB, which Blender's Python "
            "has, and pass them to sh.Field",
            path=path,
        )
    image = read_image(path, FIELD_FORMATS - {".vdb"}, "a field")
    if extension(path) == ".npy":
        contents(Path(path).with_suffix(".json"))  # refuse values without the file of their grid
    with reading(path):
        if image.values.dtype == bool:
            raise FileFormatError("the values are booleans, not real numbers: this is not a field")
        grid = made(Grid, image.origin, image.spacing, image.values.shape)
        solid = _held_solid(path) if extension(path) == ".npz" else None
        return made(Field, grid, np.ascontiguousarray(image.values), confidence=image.confidence, solid=solid)


def made(kind: Callable[..., Any], *parts: Any, **options: Any) -> Any:
    """Call `kind` with parts of a file, such as a class; raise a `FileFormatError` where it raises `GeometryError`."""
    try:
        return kind(*parts, **options)
    except GeometryError as error:
        raise FileFormatError(error.cause, remedy=error.remedy, element=error.element) from error


def load_vertex_field(path: PathLike) -> Field[SurfaceShape]:
    """Read a field on a surface that `Field.save` has written, in any of its formats but ``.obj``."""
    with reading(path):
        if extension(path) in _VALUES:
            shape = _VALUES[extension(path)](path, (VALUES_NAME,))
            if VALUES_NAME not in shape.values:
                raise FileFormatError(f"its vertices have no {VALUES_NAME}: it holds a shape, not a field")
            return Field(cast("SurfaceShape", shape_of(shape)), np.asarray(shape.values[VALUES_NAME], np.float64))
        arrays = read_npz(path, ("faces", "offsets", *OF_CLOUDS), needed=("vertices", "values"))
        vertices, values = arrays["vertices"], arrays["values"]
        if "offsets" in arrays:
            offsets = integers(arrays["offsets"], "offsets", 0)
            if offsets.ndim != 1 or (np.diff(offsets, prepend=0, append=arrays["faces"].size) < 0).any():
                raise damaged("its offsets decrease, or go beyond its faces", element="offsets")
            domain: SurfaceShape = PolygonMesh(vertices, np.split(arrays["faces"], offsets[1:-1]))
        elif "faces" in arrays:
            domain = TriangleMesh(vertices, arrays["faces"])
        else:
            given: dict[str, Any] = {name: arrays[name] for name in OF_CLOUDS if name in arrays}
            domain = PointCloud(vertices, **given)
        if values.shape != (len(vertices),):
            raise damaged(f"{values.shape} values for {len(vertices)} vertices: the file is damaged")
        return Field(domain, values)


def _load_tet_field(path: PathLike) -> Field[TetMesh]:
    """Read a field on a tet mesh, whose values are point data named `VALUES_NAME`."""
    with reading(path):
        cells = load_cells(path)
        if VALUES_NAME not in cells.point_data:
            raise FileFormatError(f"it has no point data '{VALUES_NAME}': it was not written as a field")
        values = np.asarray(cells.point_data[VALUES_NAME], dtype=np.float64)
        return made(Field, made(TetMesh.from_meshio, cells), values)


def _load_band(path: PathLike) -> Field[Band]:
    """Read a field in a band from an archive, and refuse blocks that lie outside of its grid or are not in order."""
    needed = ("places", "values", "origin", "spacing", "shape", "width", "coarse_values", "coarse_spacing")
    with reading(path):
        arrays = read_npz(path, (CONFIDENCE,), needed)
        grid = made(Grid, arrays["origin"], arrays["spacing"], arrays["shape"])
        far = arrays["coarse_values"]
        coarse = made(Field, made(Grid, arrays["origin"], arrays["coarse_spacing"], far.shape), far)
        positions = arrays["places"]
        if positions.ndim != 2 or positions.dtype.kind not in "iu" or positions.shape[1] != len(grid.shape):
            raise damaged("its blocks have no positions", element="places")
        if len(positions) and not ((positions >= 0) & (positions * BLOCK < grid.shape)).all():
            raise damaged("its blocks lie outside of the grid", element="places")
        blocks = Blocks.of(positions, grid.shape)
        if not np.array_equal(blocks.places, positions):
            raise damaged("its blocks are not in order", element="places")
        band = made(Band, grid, blocks, float(arrays["width"]))
        options = {"confidence": arrays.get(CONFIDENCE), "solid": _held_solid(path)}
        return made(Field, band, arrays["values"], coarse=coarse, **options)


def _write_npz(field: Field[Grid], path: Path) -> None:
    """Write a field to an archive, with its solid; a band is written as its blocks and the coarse field around them."""
    arrays: dict[str, Any] = {"values": field.values, "origin": field.domain.origin, "spacing": field.domain.spacing}
    arrays |= {CONFIDENCE: field.confidence, "convention": CONVENTION}
    if isinstance(field.domain, Band) and field.coarse is not None:
        arrays |= {"places": field.domain.blocks.places, "shape": field.domain.shape, "width": field.domain.width}
        arrays |= {"coarse_values": field.coarse.values, "coarse_spacing": field.coarse.domain.spacing}
        arrays["convention"] = OF_BANDS
    solid = field.solid.solid if isinstance(field.solid, Scaled) else field.solid
    if isinstance(solid, Solid):
        arrays["solid_factor"] = field.solid.factor if isinstance(field.solid, Scaled) else 1.0
        arrays |= {PREFIX + name: array for name, array in arrays_of(solid).items()}
    write_npz(path, **arrays)


def _held_solid(path: PathLike) -> SolidQueries | None:
    """Read what a field in an archive is the distance to, or return None if the archive holds no solid."""
    if "solid_factor" not in names_in_npz(path):
        return None
    arrays = read_npz(
        path, [PREFIX + name for name in SOURCE_ARRAYS], ["solid_factor", *(PREFIX + name for name in SOLID_ARRAYS)]
    )
    factor = arrays.pop("solid_factor")
    if factor.shape or not np.isfinite(factor) or not factor:
        raise damaged("the scale of its solid is not a number", element="solid_factor")
    return scaled(solid_of({name.removeprefix(PREFIX): array for name, array in arrays.items()}), float(factor))


def _write_npy(field: Field[Grid], path: Path) -> None:
    """Write the values of a field; origin and spacing go to another file."""
    with path.open("wb") as file:
        np.save(file, field.values, allow_pickle=False)


def _write_for_vtk(field: Field[Any], path: Path) -> None:
    """Write values at all nodes of the grid, also for a band, for ParaView and solvers."""
    grid, convention = field.domain, CONVENTION
    values: dict[str, NDArray[np.floating]] = {VALUES_NAME: field.values}
    if isinstance(field.domain, Band):
        refuse_large_grid(grid, 20.0, 0.0)  # bytes for each node
        values, convention = {VALUES_NAME: whole_values(field)}, CLIPPED
    elif field.confidence is not None:
        values[CONFIDENCE] = field.confidence
    path.write_bytes(write_vti(grid.origin, grid.spacing, values, convention))


def _write_nrrd(field: Field[Grid], path: Path) -> None:
    """Write a field on a grid as an image along x, y and z."""
    axes = np.diag(field.domain.spacing)
    write_nrrd(path, field.values, axes, field.domain.origin, content=VALUES_NAME, convention=CONVENTION)


def whole_values(field: Field[Band]) -> NDArray[np.float32]:
    """Return (nx, ny, nz) values of a field in a band, clipped to plus or minus the half width of the band."""
    grid, width = field.domain, np.float32(field.domain.width)
    counts = -(-np.array(grid.shape) // BLOCK)
    positions = np.argwhere(np.ones(counts, dtype=bool))
    rows = field.domain.blocks.rows(positions)
    middles = np.minimum(positions[rows < 0] * BLOCK + 0.5 * (BLOCK - 1), np.array(grid.shape) - 1)
    parts = np.full((len(positions), BLOCK, BLOCK, BLOCK), width, dtype=np.float32)
    parts[rows < 0] *= np.where(field(grid.origin + middles * grid.spacing) < 0, -1, 1)[:, None, None, None]
    parts[rows >= 0] = np.clip(field.values[rows[rows >= 0]], -width, width)
    a, b, c = counts
    whole = (
        parts.reshape(a, b, c, BLOCK, BLOCK, BLOCK).transpose(0, 3, 1, 4, 2, 5).reshape(a * BLOCK, b * BLOCK, c * BLOCK)
    )
    return np.ascontiguousarray(whole[tuple(slice(0, n) for n in grid.shape)])


def save_with_values(shape: SurfaceShape, path: PathLike, name: str, values: NDArray[np.floating]) -> None:
    """Write a surface with a named value at each vertex, in a format of `VALUE_FORMATS`."""
    with replacing(path) as temporary:
        temporary.write_bytes(VALUE_FORMATS[extension(path)](elements(shape, {name: values}), path))


def _write_vertex_npz(field: Field[SurfaceShape], path: PathLike) -> None:
    """Write a field on a mesh or a point cloud to an ``.npz`` file, with the arrays of its domain."""
    domain = field.domain
    arrays: dict[str, Any] = {"values": field.values, "vertices": elements(domain).points}
    if isinstance(domain, TriangleMesh):
        arrays["faces"] = domain.faces
    elif isinstance(domain, PolygonMesh):
        arrays |= {"faces": domain.corners, "offsets": domain.offsets}
    else:
        arrays |= {"normals": domain.normals, "areas": domain.areas, "n_neighbors": domain.n_neighbors}
    write_npz(path, **arrays)


_VALUES: dict[str, Callable[[PathLike, tuple[str, ...]], Elements]] = {".ply": read_ply, ".vtp": read_vtp}
"""Readers of surfaces with values at their vertices, which take the names of these, by extension."""
VALUE_FORMATS: dict[str, Callable[[Elements, PathLike], bytes]] = {".ply": write_ply, ".vtp": write_vtp}
"""Writers of surfaces with values at their vertices, by extension."""
_GRID_WRITERS: dict[str, Callable[[Field[Any], Path], None]] = {
    ".npy": _write_npy,
    ".npz": _write_npz,
    ".nrrd": _write_nrrd,
    ".vdb": write_vdb,
    ".vti": _write_for_vtk,
}
_BAND_WRITERS = {ending: _GRID_WRITERS[ending] for ending in (".npz", ".vdb", ".vti")}
FIELD_FORMATS, BAND_FORMATS = frozenset(_GRID_WRITERS), frozenset(_BAND_WRITERS)
VERTEX_FIELD_FORMATS = frozenset({".npz", ".obj", *VALUE_FORMATS})
