"""Shapes from files and back: one table of formats for each direction."""

from __future__ import annotations

from collections.abc import Callable

from ..domains.digital_surface import DigitalSurface
from ..domains.exchange import save_shape
from ..domains.kinds import Shape
from ..domains.tet_mesh import TetMesh
from ..errors import GeometryError
from .elements import SurfaceShape
from .files import PathLike, extension, replacing, unknown_extension
from .glb import read_glb
from .obj import read_obj, write_obj, write_pc
from .off import read_off, write_off
from .ply import read_ply, write_ply
from .stl import read_stl, write_stl
from .tets import MODULES as TET_FORMATS
from .tets import read_tets, write_tets
from .volumes import read_volume
from .vtk_xml import read_vtp, write_vtp
from .xyz import read_xyz, write_xyz

READERS: dict[str, Callable[[PathLike], Shape]] = {
    ".glb": read_glb,
    ".gltf": read_glb,
    ".npy": read_volume,
    ".nrrd": read_volume,
    ".obj": read_obj,
    ".off": read_off,
    ".pc": read_obj,
    ".ply": read_ply,
    ".stl": read_stl,
    ".vti": read_volume,
    ".vtp": read_vtp,
    ".xyz": read_xyz,
    **dict.fromkeys(TET_FORMATS, read_tets),
}

WRITERS: dict[str, Callable[[SurfaceShape, PathLike], bytes]] = {
    ".obj": write_obj,
    ".off": write_off,
    ".pc": write_pc,
    ".ply": write_ply,
    ".stl": write_stl,
    ".vtp": write_vtp,
    ".xyz": write_xyz,
}

SHAPE_FORMATS = frozenset(WRITERS)


def read(path: PathLike) -> Shape:
    """Read a shape; the extension says the format.

    STL, OBJ, PLY, OFF, VTP and GLB hold surfaces; PLY, XYZ, PC, OBJ, OFF and VTP without faces hold points. Vertices
    and faces keep their number and order, whatever is wrong with them: nothing is merged, dropped, split or turned.
    In STL, which knows no vertices, corners with the same coordinates to the last bit are one vertex. NPY, NRRD and VTI
    hold volumes of voxels, boolean or of zeros and ones. MESH, MSH, VTU, VTK and TetGen's NODE with ELE hold tets.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or TetMesh
        A triangle mesh if every face is a triangle, a polygon mesh if not, a point cloud if there is no face; of a
        volume, the boundary of its voxels.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown kind, truncated or damaged.
    GeometryError
        If what it holds is no shape: no element, NaN or infinite coordinates, a vertex id that does not exist.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).save(f"{folder}/one.ply")
    ...     sh.read(f"{folder}/one.ply")
    TriangleMesh(3 vertices, 1 faces)
    """
    reader = READERS.get(extension(path))
    if reader is None:
        raise unknown_extension(path, READERS, "a shape")
    try:
        return reader(path)
    except GeometryError as error:
        raise error.at(path) from error


def save(shape: Shape, path: PathLike) -> None:
    """Write a shape; the extension says the format.

    OBJ, OFF, PLY, VTP, XYZ and PC keep every bit of the coordinates; STL holds single precision. The file is written
    under a temporary name and then renamed: one that was there before survives a failure.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud or TetMesh
        What to write.
    path : str or path
        Where to.

    Raises
    ------
    FileFormatError
        If the format is unknown, cannot hold this kind of shape, or the file cannot be written.
    """
    if isinstance(shape, TetMesh):
        return write_tets(shape, path)
    writer = WRITERS.get(extension(path))
    if writer is None:
        raise unknown_extension(path, WRITERS, "a shape")
    if isinstance(shape, DigitalSurface):
        shape = shape.squares
    with replacing(path) as temporary:
        temporary.write_bytes(writer(shape, path))


@save_shape.provide
def _(shape: object, path: PathLike) -> None:
    save(shape, path)  # type: ignore[arg-type]  # methods of shapes call it, and nothing else
