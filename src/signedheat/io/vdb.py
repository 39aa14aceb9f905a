"""Write OpenVDB float grids: trees of blocks of 8³ voxels, in cubes of 16³ blocks, in nodes of 32³ cubes.

Files follow the published description of the format, version 224: a header; the grid's kind and where it begins;
metadata, transform, topology from the root down (masks and values of what has no children), and at the end the voxels
of the blocks in the same order. Numbers are little-endian; bit n of a mask is bit n % 8 of its byte n // 8.
"""

from __future__ import annotations

import struct
import uuid
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..errors import FileFormatError
from ..fields.field import Field
from ..grids.band import Band
from ..grids.blocks import BLOCK, Blocks
from ..grids.grid import Grid
from ..shapes.exchange import VALUES_NAME
from .files import PathLike, format_for, replacing

VDB_MAGIC, VDB_VERSION, VDB_LIBRARY = 0x56444220, 224, (10, 0)
"""Magic number, version of the format, and version of a library that writes it."""
ZIP_FLAG, ALL_VALUES_BYTE = 1, 6
"""Flag of values packed by zlib; byte before values that says that all of them are there."""
MOST_HALF = float(np.finfo(np.float16).max)
"""Largest number of 16 bits. Fields with larger values are not written with `half`."""
CHILDREN_PER_EDGE, VOXELS_PER_CHILD = (32, 16), (128, BLOCK)
"""Numbers for top nodes and for cubes: children along each edge of a node, and voxels along each edge of a child."""
VDB_CONVENTION = (
    "signed distance, negative inside, in the units of the shape; voxel (i, j, k) at origin + (i, j, k) * spacing"
)
Outside = Callable[[Ints, int], NDArray[np.float32]]
"""Function that returns (k,) values of cubes without voxels, given (k, 3) first voxels and voxels along each edge."""


@dataclass(frozen=True, eq=False)
class _Tree:
    """A float grid as the file has it."""

    background: np.float32  # value of voxels that the tree does not contain
    places: Ints  # (n, 3) first voxels of the blocks, in the order of the file
    values: NDArray[np.floating]  # (n, 8, 8, 8) values of the voxels of the blocks
    active: Bools  # (n, 8, 8, 8) which voxels have a distance
    outside: Outside  # values of nodes where there are no blocks


def write_vdb(field: Field[Grid], path: PathLike, half: bool = False) -> None:
    """Write a field in space as a ``.vdb`` file, single precision, without OpenVDB.

    A field in a band becomes a level set. Its voxels up to the half width of the band are active, and the others have
    plus or minus that value. All nodes of a field on a grid are active. Keep a ``.npz`` too, since `read_field` does
    not read such files.

    Parameters
    ----------
    field : Field
        The field, on a grid in space or in a band. Nodes without a value become inactive.
    path : str or path
        The file; written under a temporary name and renamed.
    half : bool
        Whether to store values in 16 bits, with about three digits. By default they have 32 bits.

    Raises
    ------
    FileFormatError
        If the name does not end in ``.vdb``, the field is not on a grid in space, its values are too large for 16
        bits, or the file cannot be written.

    See Also
    --------
    Field : Values on a domain.
    read_field : Read a field.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> from signedheat import samples
    >>> ball = sh.signed_distance(samples.sphere(3), resolution=48, band=0.2)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_vdb(ball, f"{folder}/ball.vdb")
    """
    format_for(path, {".vdb": None}, "an OpenVDB grid")
    if not isinstance(field, Field) or not isinstance(field.domain, Grid) or field.domain.dimension != 3:
        raise FileFormatError("an OpenVDB grid has three axes", remedy="save the field by its own `save`", path=path)
    tree = _band(cast("Field[Band]", field)) if isinstance(field.domain, Band) else _whole(field)
    largest = float(np.abs(tree.values).max())
    if half and largest > MOST_HALF:
        raise FileFormatError(
            f"numbers of 16 bits reach to {MOST_HALF:g}, and the values to {largest:g}",
            remedy="leave out half",
            path=path,
        )
    metadata: dict[str, str | bool] = {
        "name": VALUES_NAME,
        "class": "level set" if isinstance(field.domain, Band) else "unknown",
        "creator": "signedheat",
        "convention": VDB_CONVENTION,
        "spacing": " ".join(map(repr, field.domain.spacing.tolist())),
        "shape": " ".join(map(str, field.domain.shape)),
        "is_saved_as_half_float": half,
    }
    with replacing(path) as temporary, temporary.open("wb") as file:
        _write_file(file, tree, metadata, field.domain.origin, field.domain.spacing, half)


def _band(field: Field[Band]) -> _Tree:
    """Return the tree of a field in a band. Outside the blocks, values are plus or minus the half width of the band."""
    grid, background = field.domain, np.float32(field.domain.width)
    finite = ~np.isnan(field.values)
    values = np.where(finite, np.clip(field.values, -background, background), background)

    def outside(voxels: Ints, size: int) -> NDArray[np.float32]:
        middle = voxels + 0.5 * (size - 1)
        on_grid = (middle < np.array(grid.shape)).all(axis=1)
        result = np.full(len(voxels), background, dtype=np.float32)
        inside = field(grid.origin + middle[on_grid] * grid.spacing) < 0
        result[np.flatnonzero(on_grid)[inside]] *= -1
        return result

    active = finite & (np.abs(field.values) < background)
    return _in_order(field.domain.blocks, values, active, background, outside)


def _whole(field: Field[Grid]) -> _Tree:
    """Return the tree of a field at all nodes of its grid. Nodes without a value and padding of blocks are inactive."""
    shape = field.domain.shape
    counts = -(-np.array(shape) // BLOCK)
    background = np.nextafter(np.float32(np.nanmax(field.values)), np.float32(np.inf))
    padded = np.full(counts * BLOCK, np.nan, dtype=np.float32)
    padded[tuple(slice(0, n) for n in shape)] = field.values
    a, b, c = counts
    values = padded.reshape(a, BLOCK, b, BLOCK, c, BLOCK).transpose(0, 2, 4, 1, 3, 5).reshape(-1, BLOCK, BLOCK, BLOCK)
    blocks = Blocks.of(np.argwhere(np.ones(counts, dtype=bool)), shape)
    values = values[np.ravel_multi_index(tuple(blocks.places.astype(np.int64).T), tuple(counts))]
    active = ~np.isnan(values)

    def outside(voxels: Ints, size: int) -> NDArray[np.float32]:
        return np.full(len(voxels), background, dtype=np.float32)

    return _in_order(blocks, np.where(active, values, background), active, background, outside)


def _in_order(
    blocks: Blocks, values: NDArray[np.floating], active: Bools, background: np.float32, outside: Outside
) -> _Tree:
    """Return the tree with its blocks in the order of the file, which is by top node, then by cube, then by position.

    Values and activity are (n, 8, 8, 8) arrays in the order of `blocks`.
    """
    voxels = BLOCK * blocks.places.astype(np.int64)
    top, cube = CHILDREN_PER_EDGE[0] * VOXELS_PER_CHILD[0], VOXELS_PER_CHILD[0]
    order = np.lexsort(np.concatenate([voxels // top, voxels // cube, voxels], axis=1).T[::-1])
    return _Tree(background, voxels[order], values[order], active[order], outside)


def _write_file(
    file: BinaryIO, tree: _Tree, metadata: dict[str, str | bool], origin: Floats, spacing: Floats, half: bool
) -> None:
    """Write a file: the header, the offsets of the grid, of its voxels and of its end, and the grid.

    `origin` is the position of voxel (0, 0, 0). Voxels lie `spacing` apart. Values have 16 bits if `half`, else 32.
    """
    kind = np.dtype("<f2" if half else "<f4")
    file.write(struct.pack("<qIIIB", VDB_MAGIC, VDB_VERSION, *VDB_LIBRARY, 1) + str(uuid.uuid4()).encode())
    file.write(struct.pack("<II", 0, 1))  # numbers of metadata of the file, and of grids
    file.write(_text(VALUES_NAME) + _text("Tree_float_5_4_3" + ("_HalfFloat" if half else "")) + _text(""))
    offsets = file.tell()
    file.write(struct.pack("<qqq", 0, 0, 0))
    begin = file.tell()
    file.write(struct.pack("<I", ZIP_FLAG) + _metadata(metadata) + _transform(origin, spacing))
    file.write(struct.pack("<I", 1) + np.float32(kind.type(tree.background)).tobytes())  # number of buffers of values
    _write_topology(file, tree, kind)
    voxels = file.tell()
    for active, values in zip(tree.active, tree.values, strict=True):
        file.write(_mask(active.ravel()) + _packed(values.ravel(), kind))
    end = file.tell()
    file.seek(offsets)
    file.write(struct.pack("<qqq", begin, voxels, end))


def _write_topology(file: BinaryIO, tree: _Tree, kind: np.dtype) -> None:
    """Write the nodes from the root down, with values of type `kind`, and the masks of active voxels of the blocks."""
    cube, top_size = VOXELS_PER_CHILD[0], CHILDREN_PER_EDGE[0] * VOXELS_PER_CHILD[0]
    cubes_of = _by_parent(tree.places // cube * cube, top_size)
    blocks_of = _by_parent(tree.places, cube)
    file.write(struct.pack("<II", 0, len(cubes_of)))  # numbers of tiles and of children of the root
    masks = iter(tree.active)
    for top, cubes in cubes_of.items():
        file.write(struct.pack("<iii", *top) + _node(np.array(top), 0, cubes, tree.outside, kind))
        for first_voxel in cubes:
            blocks = blocks_of[tuple(first_voxel.tolist())]
            file.write(_node(first_voxel, 1, blocks, tree.outside, kind))
            for _ in blocks:
                file.write(_mask(next(masks).ravel()))


def _node(first_voxel: Ints, level: int, children: Ints, outside: Outside, kind: np.dtype) -> bytes:
    """Return a node as bytes: masks of cubes that have children and that are active (none), and values of the cubes.

    Parameters
    ----------
    first_voxel : (3,) int
        The first voxel of the node.
    level : int
        0 for a top node, whose children are cubes of blocks, and 1 for such a cube, whose children are blocks.
    children : (k, 3) int
        The first voxels of its children.
    outside : callable
        Values of cubes that have no children; the others get 0.
    kind : dtype
        The type of the values in the file.
    """
    size, shape = VOXELS_PER_CHILD[level], (CHILDREN_PER_EDGE[level],) * 3
    cubes = first_voxel + size * np.indices(shape).reshape(3, -1).T
    has_child = np.zeros(shape, dtype=bool)
    has_child[tuple((children - first_voxel).T // size)] = True
    values = np.where(has_child.ravel(), np.float32(0), outside(cubes, size))
    return _mask(has_child) + _mask(np.zeros(shape, dtype=bool)) + _packed(values, kind)


def _transform(origin: Floats, step: Floats) -> bytes:
    """Return the map from voxels to positions as bytes, with powers of the inverse scale, as OpenVDB stores them."""
    uniform = "Uniform" if bool((step == step[0]).all()) else ""
    rows = np.concatenate([origin, step, step, 1 / step, 1 / step**2, 0.5 / step])
    return _text(f"{uniform}ScaleTranslateMap") + rows.astype("<f8").tobytes()


def _metadata(metadata: dict[str, str | bool]) -> bytes:
    """Return the number of named values, and each with its name, type and length, as bytes."""
    result = struct.pack("<I", len(metadata))
    for name, value in metadata.items():
        data = value.encode() if isinstance(value, str) else bytes([value])
        result += _text(name) + _text("string" if isinstance(value, str) else "bool")
        result += struct.pack("<I", len(data)) + data
    return result


def _text(given: str) -> bytes:
    """Return the length of a string in bytes, followed by the string in UTF-8."""
    return struct.pack("<I", len(given.encode())) + given.encode()


def _mask(chosen: Bools) -> bytes:
    """Return a mask as bytes, with bit n % 8 of byte n // 8 for entry n."""
    return np.packbits(chosen, bitorder="little").tobytes()


def _packed(values: NDArray[np.floating], kind: np.dtype) -> bytes:
    """Return the size of values in bytes and the values of type `kind`, packed by zlib if that is shorter.

    The size is negative if they are not packed.
    """
    data = values.astype(kind).tobytes()
    packed = zlib.compress(data, 1)
    is_shorter = len(packed) < len(data)
    size = struct.pack("<q", len(packed) if is_shorter else -len(data))
    return bytes([ALL_VALUES_BYTE]) + size + (packed if is_shorter else data)


def _by_parent(voxels: Ints, size: int) -> dict[tuple[int, ...], Ints]:
    """Return the sorted distinct first voxels of nodes, (k, 3), by the first voxel of their parent.

    Parents have `size` voxels along each edge.
    """
    nodes = np.unique(voxels, axis=0)
    parents, rows = np.unique(nodes // size * size, axis=0, return_inverse=True)
    order = np.argsort(rows.ravel(), kind="stable")
    parts = np.split(nodes[order], np.cumsum(np.bincount(rows.ravel()))[:-1])
    return dict(zip(map(tuple, parents.tolist()), parts, strict=False))
