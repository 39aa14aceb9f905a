"""OpenVDB float grids: a tree of blocks of 8³ voxels, in cubes of 16³ blocks, in cubes of 32³ of those.

After the published description of the format, file version 224: a header; for each grid its kind and where it begins;
there metadata, transform, topology from the root down (masks and values of what has no children), and at the end the
voxels of the blocks in the same order. Numbers are little-endian; bit n of a mask is bit n % 8 of its byte n // 8.
It is described once (`_Stream`), for writing and reading. Other programs may pack with zlib or not at all, and leave
inactive values out: a byte before the values says what these are.
"""

from __future__ import annotations

import io
import struct
import uuid
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..domains.exchange import NAME
from ..errors import FileFormatError
from ..fields.grid_field import GridField
from ..operators.grid.blocks import SIDE, Blocks
from .files import PathLike, contents, ensure_fits, format_for, replacing

MAGIC, FILE_VERSION, LIBRARY = 0x56444220, 224, (10, 0)
"""First number of every file, the format's version, and that of a library that writes it so."""
ZIP, ACTIVE_MASK, BLOSC, ALL_VALUES = 1, 2, 4, 6
"""How values are compressed, three flags; and the byte before values that says that all are there."""
SIDES, SIZES = (32, 16), (128, SIDE)
"""Of the nodes above the blocks, from the top: children along each edge, and voxels along each edge of a child."""
CONVENTION = (
    "signed distance, negative inside, in the units of the shape; voxel (i, j, k) at origin + (i, j, k) * spacing"
)
Outside = Callable[[NDArray[np.int64], int], NDArray[np.float32]]
"""Values of cubes of some number of voxels along each edge in which there are no blocks, from their first voxels."""


@dataclass
class VdbGrid:
    """What a file holds of a float grid.

    Attributes
    ----------
    metadata : dict of str
        Its strings; and, for writing, truth values.
    origin, spacing : (3,) float
        Position of voxel (0, 0, 0), and distance between voxels.
    background : float
        Of voxels that are nowhere.
    places : (n, 3) int
        First voxels of the blocks.
    values, active : (n, 8, 8, 8)
        Of their voxels.
    tiles : list of (place, size, value)
        Cubes of equal inactive or active voxels that are no background.
    """

    metadata: dict[str, str | bool] = field(default_factory=dict)
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    spacing: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))
    background: float = 0.0
    places: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    values: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 8, 8, 8), dtype=np.float32))
    active: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 8, 8, 8), dtype=bool))
    tiles: list[tuple[NDArray[np.int64], int, float]] = field(default_factory=list)


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
    grid, outside = _band(field) if field.blocks is not None else _whole(field)
    grid.metadata = {
        "name": NAME,
        "class": "level set" if field.blocks is not None else "unknown",
        "creator": "signedheat",
        "convention": CONVENTION,
        "spacing": " ".join(map(repr, field.grid.spacing.tolist())),
        "shape": " ".join(map(str, field.grid.shape)),
        "is_saved_as_half_float": half,
    }
    with replacing(path) as temporary, temporary.open("wb") as file:
        _Stream(file, grid, outside).file("Tree_float_5_4_3" + ("_HalfFloat" if half else ""))


def read_vdb(path: PathLike) -> VdbGrid:
    """The first float grid of a file.

    Raises
    ------
    FileFormatError
        If the file is no OpenVDB file with a float grid, is truncated, or is compressed in a way that is not supported.
    """
    data = contents(path)
    try:
        return _Stream(io.BytesIO(data), VdbGrid()).file()
    except (struct.error, IndexError, ValueError, zlib.error, UnicodeDecodeError, OverflowError, MemoryError) as error:
        raise FileFormatError(
            f"it is no OpenVDB file with a float grid, or is truncated ({error})", remedy="write it again", path=path
        ) from error


def read_vdb_image(path: PathLike) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.float64]]:
    """Values of all voxels in a box, its first voxel's position, and the spacing.

    The box is that of the grid if the file says so, as ours do, or else that of the active voxels.

    Raises
    ------
    FileFormatError
        If the file is no OpenVDB file with a float grid, or has no voxels.
    MemoryLimitError
        If the box does not fit in memory.
    """
    grid = read_vdb(path)
    used = grid.places[grid.active.any(axis=(1, 2, 3))]
    if not len(used):
        raise FileFormatError("its grid is empty", remedy="write it again", path=path)
    counts = np.array(str(grid.metadata.get("shape", "")).split(), dtype=np.int64)
    first = np.zeros(3, dtype=np.int64)
    if counts.shape != (3,):
        rows, *inner = np.nonzero(grid.active)
        voxels = grid.places[rows] + np.stack(inner, axis=1)
        first = voxels.min(axis=0)
        counts = voxels.max(axis=0) + 1 - first
    ensure_fits(12 * int(np.prod(counts)), path, "save bands as .npz, which stay bands")
    values = np.full(counts, grid.background, dtype=np.float32)
    for place, size, value in grid.tiles:
        _fill(values, place - first, size, np.float32(value))
    for place, block in zip(grid.places, grid.values, strict=True):
        _fill(values, place - first, SIDE, block)
    written = np.array(str(grid.metadata.get("spacing", "")).split(), dtype=np.float64)
    same = written.shape == (3,) and np.allclose(written, grid.spacing, rtol=1e-9, atol=0)
    return values, grid.origin + first * grid.spacing, written if same else grid.spacing


def _fill(
    values: NDArray[np.float32], place: NDArray[np.int64], size: int, block: NDArray[np.float32] | np.float32
) -> None:
    """Write a cube of voxels, as far as it lies in the box."""
    low, high = np.maximum(place, 0), np.minimum(place + size, values.shape)
    if (low < high).all():
        inner = tuple(slice(a, b) for a, b in zip(low - place, high - place, strict=True))
        part = block[inner] if isinstance(block, np.ndarray) else block
        values[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = part


def _band(field: GridField) -> tuple[VdbGrid, Outside]:
    """The blocks of a band; what is not there is plus or minus the background, as in the coarse field."""
    assert field.blocks is not None
    grid, background = field.grid, np.float32(field.width)
    finite = ~np.isnan(field.values)
    values = np.where(finite, np.clip(field.values, -background, background), background)

    def outside(places: NDArray[np.int64], size: int) -> NDArray[np.float32]:
        middle = places + 0.5 * (size - 1)
        on_grid = (middle < np.array(grid.shape)).all(axis=1)
        result = np.full(len(places), background, dtype=np.float32)
        inside = field(grid.origin + middle[on_grid] * grid.spacing) < 0
        result[np.flatnonzero(on_grid)[inside]] *= -1
        return result

    active = finite & (np.abs(field.values) < background)
    return _in_blocks(field, field.blocks, values, active, float(background)), outside


def _whole(field: GridField) -> tuple[VdbGrid, Outside]:
    """All nodes of a grid in blocks; those without a value, and what fills the last blocks, are inactive."""
    shape = field.grid.shape
    counts = -(-np.array(shape) // SIDE)
    background = np.nextafter(np.float32(np.nanmax(field.values)), np.float32(np.inf))
    padded = np.full(counts * SIDE, np.nan, dtype=np.float32)
    padded[tuple(slice(0, n) for n in shape)] = field.values
    a, b, c = counts
    values = padded.reshape(a, SIDE, b, SIDE, c, SIDE).transpose(0, 2, 4, 1, 3, 5).reshape(-1, SIDE, SIDE, SIDE)
    blocks = Blocks.of(np.argwhere(np.ones(counts, dtype=bool)), shape)
    values = values[np.ravel_multi_index(tuple(blocks.places.astype(np.int64).T), tuple(counts))]
    active = ~np.isnan(values)
    grid = _in_blocks(field, blocks, np.where(active, values, background), active, float(background))
    return grid, lambda places, size: np.full(len(places), background, dtype=np.float32)


def _in_blocks(
    field: GridField, blocks: Blocks, values: NDArray[np.floating], active: NDArray[np.bool_], background: float
) -> VdbGrid:
    """A grid to be written, with its blocks in the order of the file."""
    places = SIDE * blocks.places.astype(np.int64)
    top, cube = SIDES[0] * SIZES[0], SIZES[0]
    order = np.lexsort(np.concatenate([places // top, places // cube, places], axis=1).T[::-1])
    grid = VdbGrid({}, field.grid.origin, field.grid.spacing, background)
    grid.places, grid.values, grid.active = places[order], values[order].astype(np.float32), active[order]
    return grid


class _Stream:
    """What is in a file, one thing after another. The same description serves for writing and for reading.

    The file is written if `outside` is given, and read otherwise. Each method takes what to write, or None to read it,
    and returns what it has written or read.
    """

    def __init__(self, file: BinaryIO, grid: VdbGrid, outside: Outside | None = None) -> None:
        self.stream, self.grid, self.outside = file, grid, outside
        self.flags, self.kind = ZIP, np.dtype("<f4")

    def raw(self, n: int, given: bytes | None = None) -> bytes:
        """The next n bytes."""
        if given is not None:
            self.stream.write(given)
            return given
        data = self.stream.read(n) if n >= 0 else b""
        if len(data) != n:
            raise ValueError("it ends too soon")
        return data

    def numbers(self, form: str, *given: int) -> tuple[int, ...]:
        """Whole numbers of the given form."""
        data = struct.pack(f"<{form}", *given) if given else None
        return struct.unpack(f"<{form}", self.raw(struct.calcsize(f"<{form}"), data))

    def array(self, kind: str, n: int, given: NDArray[np.floating] | None = None) -> NDArray[np.float64]:
        """n numbers of one kind."""
        data = None if given is None else given.astype(kind).tobytes()
        return np.frombuffer(self.raw(n * np.dtype(kind).itemsize, data), dtype=kind).astype(np.float64)

    def sized(self, given: bytes | None = None) -> bytes:
        """Bytes after their number."""
        (length,) = self.numbers("I", *([] if given is None else [len(given)]))
        return self.raw(length, given)

    def text(self, given: str | None = None) -> str:
        """A string after its length."""
        return self.sized(None if given is None else given.encode()).decode()

    def mask(self, n: int, given: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
        """n bits."""
        if given is not None:
            self.raw(n // 8, np.packbits(given, bitorder="little").tobytes())
            return given
        return np.unpackbits(np.frombuffer(self.raw(n // 8), dtype=np.uint8), bitorder="little").astype(bool)

    def metadata(self, given: dict[str, str | bool] | None = None) -> dict[str, str | bool]:
        """Named values with their types, of which strings are kept."""
        (n,) = self.numbers("I", *([] if given is None else [len(given)]))
        found: dict[str, str | bool] = {}
        for name, value in [*given.items()] if given is not None else [(None, None)] * n:
            kind = None if value is None else "bool" if isinstance(value, bool) else "string"
            data = value.encode() if isinstance(value, str) else None if value is None else bytes([value])
            key, kind, data = self.text(name), self.text(kind), self.sized(data)
            if kind == "string":
                found[key] = data.decode()
        return found

    def file(self, kind: str | None = None) -> VdbGrid:
        """The whole file. With a kind, a header and this grid as a grid of that kind are written.

        Without, the header is read, and then grids, until one holds floats; this is returned.
        """
        is_written = kind is not None
        magic, version = self.numbers("qI", *([MAGIC, FILE_VERSION] if is_written else []))
        if magic != MAGIC or version < 222:
            raise ValueError(f"version {version}" if magic == MAGIC else "another format")
        *_, has_offsets = self.numbers("IIB", *([*LIBRARY, 1] if is_written else []))
        self.raw(36, str(uuid.uuid4()).encode() if is_written else None)
        self.metadata({} if is_written else None)
        for _ in range(*self.numbers("I", *([1] if is_written else []))):
            self.text(NAME if is_written else None)
            found, parent = self.text(kind), self.text("" if is_written else None)
            places = self.stream.tell()
            begin, _, end = self.numbers("qqq", *([0, 0, 0] if is_written else []))
            if found.startswith("Tree_float_5_4_3") and not parent:
                self.kind = np.dtype("<f2" if found.endswith("_HalfFloat") else "<f4")
                begin = begin if has_offsets and not is_written else self.stream.tell()
                self.stream.seek(begin)
                voxels = self.volume()
                if is_written:
                    end = self.stream.tell()
                    self.stream.seek(places)
                    self.numbers("qqq", begin, voxels, end)
                return self.grid
            self.stream.seek(end)
        raise ValueError("it has no float grid")

    def volume(self) -> int:
        """Metadata, transform, topology and voxels of the grid; where its voxels begin."""
        grid, is_written = self.grid, self.outside is not None
        (self.flags,) = self.numbers("I", *([ZIP] if is_written else []))
        if self.flags & BLOSC:
            raise ValueError("its values are compressed by Blosc; write it with zlib")
        grid.metadata = self.metadata(grid.metadata if is_written else None)
        self.transform()
        self.numbers("I", *([1] if is_written else []))  # buffers of values
        background = np.array([grid.background]).astype(self.kind)
        grid.background = float(self.array("<f4", 1, background if is_written else None)[0])
        cube, size = SIZES[0], SIDES[0] * SIZES[0]
        cubes_of, blocks_of = _by_parent(grid.places // cube * cube, size), _by_parent(grid.places, cube)
        tops = [*cubes_of]
        n_tiles, n_tops = self.numbers("II", *([0, len(tops)] if is_written else []))
        for _ in range(n_tiles):
            place, value = np.array(self.numbers("iii")), self.array("<f4", 1)[0]
            grid.tiles.append((place, size, float(value)))
            self.raw(1)
        leaves: list[NDArray[np.int64]] = []
        for number in range(n_tops):
            top = np.array(self.numbers("iii", *(tops[number] if is_written else [])), dtype=np.int64)
            for corner in self.node(top, 0, cubes_of):
                leaves += self.node(corner, 1, blocks_of, grid.active[len(leaves) :])
        if not is_written:
            grid.places = np.array(leaves, dtype=np.int64).reshape(-1, 3)
            grid.values = np.empty((len(leaves), 8, 8, 8), dtype=np.float32)
            grid.active = np.empty((len(leaves), 8, 8, 8), dtype=bool)
        voxels = self.stream.tell()
        for active, values in zip(grid.active.reshape(-1, SIDE**3), grid.values.reshape(-1, SIDE**3), strict=True):
            active[:] = self.mask(SIDE**3, active if is_written else None)
            values[:] = self.values(active, values if is_written else None)
        return voxels

    def transform(self) -> None:
        """Translation, scale, voxel size, and what the library keeps of the scale's inverse."""
        grid, is_written = self.grid, self.outside is not None
        uniform = "Uniform" if bool((grid.spacing == grid.spacing[0]).all()) else ""
        kind = self.text(f"{uniform}ScaleTranslateMap" if is_written else None)
        n_rows = {"ScaleMap": 5, "ScaleTranslateMap": 6}.get(kind.removeprefix("Uniform"), 0)
        if not n_rows:
            raise ValueError(f"its axes are not x, y, z but a {kind}")
        step = grid.spacing
        given = np.concatenate([grid.origin, step, step, 1 / step, 1 / step**2, 0.5 / step])
        rows = self.array("<f8", 3 * n_rows, given if is_written else None).reshape(n_rows, 3)
        grid.origin, grid.spacing = (rows[0], rows[1]) if n_rows == 6 else (np.zeros(3), rows[0])

    def node(
        self,
        place: NDArray[np.int64],
        level: int,
        below: dict[tuple[int, ...], NDArray[np.int64]],
        active: NDArray[np.bool_] | None = None,
    ) -> list[NDArray[np.int64]]:
        """A node: which places have children, which others are active, their values. Returns its children's places.

        Those of the second level are blocks, of which a mask follows that says which of their voxels are `active`.
        """
        side, size, is_written = SIDES[level], SIZES[level], self.outside is not None
        n = side**3
        inner = place + size * np.stack(np.unravel_index(np.arange(n), (side,) * 3), axis=1)
        given = values = None
        if self.outside is not None:
            given = np.zeros(n, dtype=bool)
            given[np.ravel_multi_index(tuple((below[tuple(place.tolist())] - place).T // size), (side,) * 3)] = True
            values = np.where(given, np.float32(0), self.outside(inner, size))
        children = self.mask(n, given)
        values = self.values(self.mask(n, np.zeros(n, dtype=bool) if is_written else None), values)
        if not is_written:
            tiles = np.flatnonzero(~children & (values != np.float32(self.grid.background)))
            self.grid.tiles += [(inner[k], size, float(values[k])) for k in tiles]
        if active is not None:
            for number in range(int(children.sum())):
                self.mask(SIDE**3, active[number] if is_written else None)
        return [*inner[children]]

    def values(self, active: NDArray[np.bool_], given: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Values of all places of a node: all are written; where the file leaves out inactive ones, it says which."""
        n, kind = len(active), self.kind
        (code,) = self.numbers("B", *([] if given is None else [ALL_VALUES]))
        if given is not None:
            self.block(n * kind.itemsize, given.astype(kind).tobytes())
            return given
        outside = np.float32(self.grid.background)
        inside = -outside
        if code in (2, 4, 5):
            outside = np.frombuffer(self.raw(kind.itemsize), dtype=kind)[0].astype(np.float32)
        if code == 5:
            inside = np.frombuffer(self.raw(kind.itemsize), dtype=kind)[0].astype(np.float32)
        elif code == 4:
            inside = np.float32(self.grid.background)
        elif code == 1:
            outside, inside = inside, outside
        picked = self.mask(n) if code in (3, 4, 5) else np.zeros(n, dtype=bool)
        masked = bool(self.flags & ACTIVE_MASK) and code != ALL_VALUES
        data = np.frombuffer(self.block(kind.itemsize * (int(active.sum()) if masked else n)), dtype=kind)
        if not masked:
            return data.astype(np.float32)
        result: NDArray[np.float32] = np.where(picked, inside, outside).astype(np.float32)
        result[active] = data
        return result

    def block(self, n: int, given: bytes | None = None) -> bytes:
        """n bytes, packed by zlib where that is shorter: after their number, which is negative where they are not."""
        if not self.flags & ZIP:
            return self.raw(n, given)
        packed = None if given is None else min(given, zlib.compress(given, 1), key=len)
        sizes = [] if packed is None else [-n if packed is given else len(packed)]
        (length,) = self.numbers("q", *sizes)
        data = self.raw(abs(length), packed)
        if given is None and length > 0:
            data = zlib.decompress(data)
        if given is None and len(data) != n:
            raise ValueError("a block of values has another size than it should")
        return data


def _by_parent(places: NDArray[np.int64], size: int) -> dict[tuple[int, ...], NDArray[np.int64]]:
    """Places of nodes, each once, by the place of the node of `size` voxels around them; both in order."""
    nodes = np.unique(places, axis=0)
    parents, rows = np.unique(nodes // size * size, axis=0, return_inverse=True)
    order = np.argsort(rows.ravel(), kind="stable")
    parts = np.split(nodes[order], np.cumsum(np.bincount(rows.ravel()))[:-1])
    return dict(zip(map(tuple, parents.tolist()), parts, strict=False))
