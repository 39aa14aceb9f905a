"""Reading and writing of shapes, with one table of formats for each direction; NumPy archives of solids and samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np

from ..errors import FileFormatError
from ..grids.grid import Grid
from ..memory import refuse_beyond_memory
from ..shapes.exchange import Elements
from ..shapes.foreign import ForeignShape, as_shape, elements, shape_of
from ..shapes.kinds import Shape
from ..solids.sample_set import Layout, Samples
from ..solids.solid import Solid
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from ..validation import chosen, public_call
from .drawing_files import POLYLINE_READERS
from .field_files import CONVENTION, read_field
from .files import PathLike, ensure_writable, extension, format_for, reading, replacing
from .image_files import NIFTI
from .mesh_files import read_obj, read_off, read_stl, write_obj, write_off, write_pc, write_stl
from .numpy_files import write_npz
from .ply import read_ply, write_ply
from .point_files import read_e57, read_las, read_pcd, read_xyz, write_xyz
from .scenes import read_3mf, read_dae, read_glb, step_mesh
from .solid_arrays import ARCHIVE_VERSION, arrays_of, holds_solid, read_solid
from .tet_files import TET_FORMATS, read_tets, store_cells
from .voxel_files import read_volume
from .vtk_xml import read_vtp, write_vtp


def read_archive(path: PathLike) -> Solid | TriangleMesh:
    """Read a solid from a NumPy archive, or from a field its solid, or else the zero level set of the field."""
    if holds_solid(path):
        return read_solid(path)
    field = read_field(path)
    if not isinstance(field.domain, Grid) or field.domain.dimension != 3:
        raise FileFormatError("it has no solid, and no field on a grid in space", remedy="load it by `read_field`")
    return field.solid if isinstance(field.solid, Solid) else cast("TriangleMesh", field.offset(0.0))


READERS: dict[str, Callable[[PathLike], Elements | Shape | Solid]] = {
    ".3mf": read_3mf,
    ".dae": read_dae,
    ".e57": read_e57,
    ".glb": read_glb,
    ".gltf": read_glb,
    ".las": read_las,
    ".laz": read_las,
    ".npy": read_volume,
    ".npz": read_archive,
    ".nrrd": read_volume,
    ".obj": read_obj,
    ".off": read_off,
    ".pc": read_obj,
    ".pcd": read_pcd,
    ".ply": read_ply,
    ".step": step_mesh,
    ".stl": read_stl,
    ".stp": step_mesh,
    ".vti": read_volume,
    ".vtp": read_vtp,
    ".xyz": read_xyz,
    **dict.fromkeys(TET_FORMATS, read_tets),
}

WRITERS: dict[str, Callable[[Elements, PathLike], bytes]] = {
    ".obj": write_obj,
    ".off": write_off,
    ".pc": write_pc,
    ".ply": write_ply,
    ".stl": write_stl,
    ".vtp": write_vtp,
    ".xyz": write_xyz,
}

SHAPE_FORMATS = frozenset(WRITERS)

CHECKED_FACES = 100_000
"""Number of faces from which on `read` checks that memory suffices for computations with them."""


def read(path: PathLike) -> Shape | Solid:
    """Read a shape, in the format given by the extension.

    - Surfaces: STL, OBJ, PLY, OFF, VTP, GLB, DAE, 3MF and STEP files.
    - Points: XYZ, PCD, LAS, LAZ, E57 and PC files, and PLY, OBJ, OFF and VTP files without faces.
    - Volumes of voxels, which are booleans or zeros and ones: NPY, NRRD and VTI files.
    - Tets: MESH, MSH, VTU, VTK and TetGen's NODE with ELE.
    - Solids, or fields that have them: NPZ files.

    Vertices and faces keep their number and order, whatever their defects: nothing is merged, dropped, split or
    flipped. Since STL has no vertices, its corners with exactly the same coordinates become one vertex.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    TriangleMesh, PolygonMesh, PointCloud, DigitalSurface, TetMesh or Solid
        A triangle mesh if all faces are triangles, a polygon mesh if some are not, and a point cloud without faces. A
        volume of voxels becomes its boundary, a `DigitalSurface`. A file of tets becomes a `TetMesh`, and one of a
        solid, or of a field that has one, the `Solid`.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, truncated or damaged.
    MemoryLimitError
        If too little memory is free to read the file, or to compute anything with so many faces.
    GeometryError
        If the shape is invalid: no element, NaN or infinite coordinates, a vertex id that does not exist.

    See Also
    --------
    save : Write a shape.
    read_field : Read a field.
    io.read_labels : Read an image of labels.
    io.read_curves : Read curves on a surface.
    as_shape : Convert objects of other packages.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).save(f"{folder}/one.ply")
    ...     sh.read(f"{folder}/one.ply")
    TriangleMesh(3 vertices, 1 face)
    """
    if extension(path) in POLYLINE_READERS:
        raise FileFormatError(
            "a drawing is no shape in space",
            remedy="measure distance to its lines by `volume` or `offset`, in Python by `read_polylines` and "
            "`signed_distance`",
            path=path,
        )
    if extension(path) in NIFTI:
        raise FileFormatError(
            "an image is no shape by itself",
            remedy="read its labels by `sh.io.read_labels`, or a field of distances by `sh.read_field`",
            path=path,
        )
    read_shape = format_for(path, READERS, "a shape")
    with reading(path):
        found = read_shape(path)
        shape = shape_of(found) if isinstance(found, Elements) else found
        faces = getattr(shape, "n_faces", 0) or len(getattr(shape, "corners", ()))
        if faces >= CHECKED_FACES:
            refuse_beyond_memory(
                f"a surface of {faces:,} faces",
                faces,
                lambda n: float(250 * n),  # a lower bound of the bytes that each face takes
                lambda n: f"use at most {n:,} faces, coarsened or in parts",
            )
        return shape


@public_call
def save(shape: Shape | ForeignShape, path: PathLike) -> None:
    """Write a shape, in the format given by the extension.

    OBJ, OFF, PLY, VTP, XYZ and PC keep every bit of the coordinates; STL has single precision. The
    file is written under a temporary name and renamed, so that an existing file survives a failure.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface, TetMesh or Solid
        The shape. A solid is written as its surface, or in ``.npz`` as itself (`Solid.save`).
    path : str or path
        The file.

    Raises
    ------
    FileFormatError
        If the format is unknown, does not support this kind of shape, or the file cannot be written.
    UnsupportedTypeError
        If it is no shape.

    See Also
    --------
    read : Read a shape or a solid.
    Solid.surface : The closed surface.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save(sh.PointCloud([[0, 0, 0], [1, 0, 0]]), f"{folder}/two.xyz")
    ...     read(f"{folder}/two.xyz").n_points
    2
    """
    if isinstance(shape, Solid):
        return shape.save(path)
    shape = as_shape(shape)
    if isinstance(shape, TetMesh):
        return store_cells(shape.to_meshio(), path)
    write = format_for(path, WRITERS, "a shape")
    if isinstance(shape, DigitalSurface):
        shape = shape.squares
    with replacing(path) as temporary:
        temporary.write_bytes(write(elements(shape), path))


SOLID_FORMATS = SAMPLE_FORMATS = frozenset({".npz"})
"""Formats that hold a solid itself, not only its surface; and those of samples."""


def save_solid(solid: Solid, path: PathLike) -> None:
    """Write a solid to a NumPy archive, or its surface in a format of shapes."""
    ensure_writable(path, SOLID_FORMATS | SHAPE_FORMATS, "a solid")
    if extension(path) not in SOLID_FORMATS:
        return save(solid.surface(), path)
    write_npz(path, solid_version=ARCHIVE_VERSION, **arrays_of(solid))


def save_samples(samples: Samples, path: PathLike, layout: Layout) -> None:
    """Write samples to a NumPy archive, in the given layout."""
    chosen(layout, Layout, "layout")
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
