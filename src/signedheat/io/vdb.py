"""Writing of OpenVDB float grids: a tree of blocks of 8³ voxels, in cubes of 16³ blocks, in cubes of 32³ of those.

After the published description of the format, file version 224: a header; for each grid its kind and where it begins;
there metadata, transform, topology from the root down (masks and values of what has no children), and at the end the
voxels of the blocks in the same order. Numbers are little-endian; bit n of a mask is bit n % 8 of its byte n // 8.
"""

from __future__ import annotations

import struct
import uuid
import zlib
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..domains.exchange import NAME
from ..errors import FileFormatError
from ..fields.grid_field import GridField
from ..operators.grid.blocks import CUBE, SIDE, Blocks
from .files import PathLike, format_for, replacing

MAGIC, FILE_VERSION, LIBRARY = 0x56444220, 224, (10, 0)
"""First number of every file, the format's version, and that of a library that writes it so."""
ZIP, ALL_VALUES = 1, 6
"""Codes: values are compressed by zlib; all values are there, whatever the masks."""
TOP = 32
"""Cubes along each edge of the topmost nodes."""
CONVENTION = (
    "signed distance, negative inside, in the units of the shape; voxel (i, j, k) at origin + (i, j, k) * spacing"
)


def write_vdb(field: GridField, path: PathLike, half: bool = False) -> None:
    """Write a field in space as a ``.vdb`` file, single precision, without OpenVDB.

    A field in a band becomes a level set: voxels up to its half width are active, and the others have plus or minus
    that value. Of a field on a grid all nodes are active.

    Parameters
    ----------
    field : GridField in space
        The field. Nodes without a value become inactive.
    path : str or path
        The file; written under a temporary name and renamed.
    half : bool
        Store values in 16 bits: of the size of the band, 3 digits are left.

    Raises
    ------
    FileFormatError
        If the name is no ``.vdb``, the field is not in space, or the file cannot be written.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> from signedheat import samples
    >>> ball = sh.signed_distance(samples.sphere(3), resolution=48, band=0.2)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_vdb(ball, f"{folder}/ball.vdb")
    ...     back = sh.load_field(f"{folder}/ball.vdb")
    >>> bool(abs(back([[1.1, 0, 0]])[0] - 0.1) < 0.02)
    True
    """
    format_for(path, {".vdb": None}, "an OpenVDB grid")
    if field.grid.dimension != 3:
        raise FileFormatError("an OpenVDB grid has three axes", remedy="save the field as .npz", path=path)
    tree = _LevelSet(field) if field.blocks is not None else _dense_tree(field)
    with replacing(path) as temporary, temporary.open("wb") as file:
        _Writer(file, half).write(field, tree)


class _Writer:
    """Writes one field to one file."""

    def __init__(self, file: BinaryIO, half: bool) -> None:
        self.file, self.half = file, half
        self.kind = np.dtype("<f2" if half else "<f4")

    def write(self, field: GridField, tree: _Tree) -> None:
        """Header, description, transform, topology and voxels."""
        write = self.file.write
        write(struct.pack("<qIIIB", MAGIC, FILE_VERSION, *LIBRARY, 1))
        write(str(uuid.uuid4()).encode())
        self.metadata({})
        write(struct.pack("<I", 1))
        self.text(NAME)
        self.text("Tree_float_5_4_3" + ("_HalfFloat" if self.half else ""))
        self.text("")
        places = self.file.tell()
        write(struct.pack("<qqq", 0, 0, 0))
        begin = self.file.tell()
        write(struct.pack("<I", ZIP))
        self.metadata(
            {
                "name": NAME,
                "class": "level set" if field.blocks is not None else "unknown",
                "creator": "signedheat",
                "convention": CONVENTION,
                "spacing": " ".join(map(repr, field.grid.spacing.tolist())),
                "shape": " ".join(map(str, field.grid.shape)),
                "is_saved_as_half_float": self.half,
            }
        )
        self.transform(field.grid.origin, field.grid.spacing)
        self.topology(tree)
        voxels = self.file.tell()
        for mask, values in zip(tree.active, tree.values, strict=True):
            write(mask.tobytes())
            self.compressed(values)
        end = self.file.tell()
        self.file.seek(places)
        write(struct.pack("<qqq", begin, voxels, end))

    def text(self, word: str) -> None:
        """A string after its length."""
        data = word.encode()
        self.file.write(struct.pack("<I", len(data)) + data)

    def metadata(self, entries: dict[str, str | bool]) -> None:
        """Named values with their types."""
        self.file.write(struct.pack("<I", len(entries)))
        for name, value in entries.items():
            self.text(name)
            if isinstance(value, bool):
                self.text("bool")
                self.file.write(struct.pack("<IB", 1, value))
            else:
                self.text("string")
                self.text(value)

    def transform(self, origin: NDArray[np.float64], spacing: NDArray[np.float64]) -> None:
        """Translation, scale, voxel size, and what the library keeps of the scale's inverse."""
        uniform = bool((spacing == spacing[0]).all())
        self.text("UniformScaleTranslateMap" if uniform else "ScaleTranslateMap")
        rows = [origin, spacing, spacing, 1 / spacing, 1 / spacing**2, 0.5 / spacing]
        self.file.write(np.concatenate(rows).astype("<f8").tobytes())

    def topology(self, tree: _Tree) -> None:
        """The nodes from the root down, each before its children."""
        write = self.file.write
        tops = list(tree.tops())
        background = np.float32(np.float16(tree.background) if self.half else tree.background)
        write(struct.pack("<I", 1))  # one buffer of values
        write(np.array([background], dtype="<f4").tobytes() + struct.pack("<II", 0, len(tops)))
        for top, cubes in tops:
            write((top * TOP * CUBE * SIDE).astype("<i4").tobytes())
            inner = cubes - top * TOP
            self.node(inner, tree.outer(top * TOP + np.indices((TOP,) * 3).reshape(3, -1).T, CUBE * SIDE), TOP)
            for cube in cubes:
                rows = tree.rows(cube)
                leaves = tree.places[rows] - cube * CUBE
                self.node(leaves, tree.outer(cube * CUBE + np.indices((CUBE,) * 3).reshape(3, -1).T, SIDE), CUBE)
                write(tree.active[rows].tobytes())

    def node(self, children: NDArray[np.int64], values: NDArray[np.float32], size: int) -> None:
        """Which places have children, that no others are active, and the values of the others."""
        mask = np.zeros((size,) * 3, dtype=bool)
        mask[tuple(children.T)] = True
        self.file.write(np.packbits(mask, bitorder="little").tobytes() + bytes(size**3 // 8))
        self.compressed(np.where(mask.ravel(), np.float32(0), values))

    def compressed(self, values: NDArray[np.float32]) -> None:
        """All values, by zlib where that is shorter."""
        data = values.astype(self.kind).tobytes()
        small = zlib.compress(data, 1)
        short = len(small) < len(data)
        self.file.write(
            struct.pack("<Bq", ALL_VALUES, len(small) if short else -len(data)) + (small if short else data)
        )


class _Tree:
    """Blocks in the order of the file, and the values of what is not there."""

    def __init__(
        self, blocks: Blocks, values: NDArray[np.float32], active: NDArray[np.bool_], background: float
    ) -> None:
        places = blocks.places.astype(np.int64)
        keys = np.concatenate([places // (CUBE * TOP), places // CUBE, places], axis=1)
        order = np.lexsort(keys.T[::-1])
        self.places, self.background = places[order], background
        self.values = values[order].reshape(len(order), -1)
        self.active = np.packbits(active[order].reshape(len(order), -1), axis=1, bitorder="little")
        self._cubes, self._starts = np.unique(self.places // CUBE, axis=0, return_index=True)
        self._stops = np.zeros_like(self._starts)
        ranked = np.argsort(self._starts)
        self._stops[ranked] = np.append(self._starts[ranked][1:], len(order))

    def outer(self, places: NDArray[np.int64], size: int) -> NDArray[np.float32]:
        """(k,) values of cubes of `size` voxels that are not there."""
        return np.full(len(places), self.background, dtype=np.float32)

    def tops(self) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """Each topmost node, and its cubes in order."""
        tops = self._cubes // TOP
        for top in np.unique(tops, axis=0):
            yield top, self._cubes[(tops == top).all(axis=1)]

    def rows(self, cube: NDArray[np.int64]) -> slice:
        """The blocks of a cube."""
        at = int(np.flatnonzero((self._cubes == cube).all(axis=1))[0])
        return slice(int(self._starts[at]), int(self._stops[at]))


class _LevelSet(_Tree):
    """Blocks of a band: what is not there is plus or minus the background, as in the coarse field."""

    def __init__(self, field: GridField) -> None:
        self.field = field
        assert field.blocks is not None
        background = np.float32(field.width)
        known = ~np.isnan(field.values)
        values = np.where(known, np.clip(field.values, -background, background), background)
        super().__init__(field.blocks, values, known & (np.abs(field.values) < background), float(background))

    def outer(self, places: NDArray[np.int64], size: int) -> NDArray[np.float32]:
        grid = self.field.grid
        middle = places * size + 0.5 * (size - 1)
        on_grid = (middle < np.array(grid.shape)).all(axis=1)
        result = super().outer(places, size)
        inside = self.field(grid.origin + middle[on_grid] * grid.spacing) < 0
        result[np.flatnonzero(on_grid)[inside]] *= -1
        return result


def _dense_tree(field: GridField) -> _Tree:
    """All nodes of a grid in blocks; those without a value, and what fills the last blocks, are inactive."""
    shape = field.grid.shape
    counts = -(-np.array(shape) // SIDE)
    background = float(np.nextafter(np.float32(np.nanmax(field.values)), np.float32(np.inf)))
    padded = np.full(counts * SIDE, np.nan, dtype=np.float32)
    padded[tuple(slice(0, n) for n in shape)] = field.values
    a, b, c = counts
    values = padded.reshape(a, SIDE, b, SIDE, c, SIDE).transpose(0, 2, 4, 1, 3, 5).reshape(-1, SIDE, SIDE, SIDE)
    blocks = Blocks.of(np.argwhere(np.ones(counts, dtype=bool)), shape)
    values = values[np.ravel_multi_index(tuple(blocks.places.astype(np.int64).T), tuple(counts))]
    active = ~np.isnan(values)
    return _Tree(blocks, np.where(active, values, np.float32(background)), active, background)
