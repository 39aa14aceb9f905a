"""Reading of OpenVDB float grids: those that `write_vdb` writes, and those of other programs that use zlib or nothing.

See `signedheat.io.vdb` for the format. Where inactive values are left out, a byte before the values says what they are.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError, MemoryLimitError
from ..memory import available_memory
from .files import PathLike, contents
from .vdb import MAGIC, TOP

ZIP, ACTIVE_MASK, BLOSC = 1, 2, 4
"""Compression flags."""
SIZES = (TOP**3, 16**3, 8**3)
"""Places in the nodes of a tree, from the top."""


@dataclass
class VdbGrid:
    """What a file holds of a float grid.

    Attributes
    ----------
    metadata : dict of str
        Its strings.
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

    metadata: dict[str, str] = field(default_factory=dict)
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    spacing: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))
    background: float = 0.0
    places: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    values: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 8, 8, 8), dtype=np.float32))
    active: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 8, 8, 8), dtype=bool))
    tiles: list[tuple[NDArray[np.int64], int, float]] = field(default_factory=list)


def read_vdb(path: PathLike) -> VdbGrid:
    """The first float grid of a file.

    Raises
    ------
    FileFormatError
        If the file is no OpenVDB file with a float grid, is truncated, or is compressed in a way that is not known.
    """
    data = contents(path)
    try:
        return _Reader(data).grid()
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
    counts = np.array(grid.metadata.get("shape", "").split(), dtype=np.int64)
    first = np.zeros(3, dtype=np.int64)
    if counts.shape != (3,):
        rows, *inner = np.nonzero(grid.active)
        voxels = grid.places[rows] + np.stack(inner, axis=1)
        first = voxels.min(axis=0)
        counts = voxels.max(axis=0) + 1 - first
    room, needed = available_memory(), 12 * int(np.prod(counts))
    if room is not None and needed > room:
        raise MemoryLimitError(
            f"its {' × '.join(map(str, counts))} voxels need {needed / 1e9:.1f} GB, and {room / 1e9:.1f} are free",
            remedy="save bands as .npz, which stay bands",
            path=path,
        )
    values = np.full(counts, grid.background, dtype=np.float32)
    for place, size, value in grid.tiles:
        _fill(values, place - first, size, np.float32(value))
    for place, block in zip(grid.places, grid.values, strict=True):
        _fill(values, place - first, 8, block)
    written = np.array(grid.metadata.get("spacing", "").split(), dtype=np.float64)
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


class _Reader:
    """Goes through the bytes of a file."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0
        self.flags, self.kind, self.background = 0, np.dtype("<f4"), np.float32(0)

    def take(self, form: str) -> tuple[int, ...]:
        """Numbers of the given form."""
        result = struct.unpack_from("<" + form, self.data, self.at)
        self.at += struct.calcsize("<" + form)
        return result

    def piece(self, n: int) -> bytes:
        """The next n bytes."""
        if n < 0 or self.at + n > len(self.data):
            raise ValueError("it ends too soon")
        self.at += n
        return self.data[self.at - n : self.at]

    def text(self) -> str:
        """A string after its length."""
        return self.piece(self.take("I")[0]).decode()

    def metadata(self) -> dict[str, str]:
        """Named values, of which strings are kept."""
        found = {}
        for _ in range(self.take("I")[0]):
            name, kind = self.text(), self.text()
            value = self.piece(self.take("I")[0])
            if kind == "string":
                found[name] = value.decode()
        return found

    def grid(self) -> VdbGrid:
        """Everything of the first float grid."""
        magic, version = self.take("qI")
        if magic != MAGIC or version < 222:
            raise ValueError(f"version {version}" if magic == MAGIC else "another format")
        _, _, offsets = self.take("IIB")
        self.piece(36)
        self.metadata()
        for _ in range(self.take("I")[0]):
            self.text()
            kind, parent = self.text(), self.text()
            begin, _, end = self.take("qqq")
            if kind.startswith("Tree_float_5_4_3") and not parent:
                self.kind = np.dtype("<f2" if kind.endswith("_HalfFloat") else "<f4")
                self.at = begin if offsets else self.at
                return self.volume()
            self.at = end
        raise ValueError("it has no float grid")

    def volume(self) -> VdbGrid:
        """Description, transform and tree."""
        self.flags = self.take("I")[0]
        if self.flags & BLOSC:
            raise ValueError("its values are compressed by Blosc; write it with zlib")
        result = VdbGrid(self.metadata())
        result.origin, result.spacing = self.transform()
        self.take("I")
        self.background = np.frombuffer(self.piece(4), dtype="<f4")[0]
        result.background = float(self.background)
        tiles, children = self.take("II")
        for _ in range(tiles):
            place, value = np.array(self.take("iii")), np.frombuffer(self.piece(4), dtype="<f4")[0]
            result.tiles.append((place, 4096, float(value)))
            self.piece(1)
        places: list[NDArray[np.int64]] = []
        for _ in range(children):
            self.node(np.array(self.take("iii"), dtype=np.int64), 0, places, result)
        result.places = np.array(places, dtype=np.int64).reshape(-1, 3)
        result.values = np.empty((len(places), 8, 8, 8), dtype=np.float32)
        result.active = np.empty((len(places), 8, 8, 8), dtype=bool)
        for row in range(len(places)):
            mask = self.mask(512)
            result.active[row] = mask.reshape(8, 8, 8)
            result.values[row] = self.values(mask, np.zeros(512, dtype=bool)).reshape(8, 8, 8)
        return result

    def transform(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position of the first voxel, and distance between voxels."""
        kind = self.text()
        rows = {"ScaleMap": 5, "UniformScaleMap": 5, "ScaleTranslateMap": 6, "UniformScaleTranslateMap": 6}.get(kind, 0)
        if not rows:
            raise ValueError(f"its axes are not x, y, z but a {kind}")
        numbers = np.frombuffer(self.piece(24 * rows), dtype="<f8").reshape(rows, 3)
        return (numbers[0], numbers[1]) if rows == 6 else (np.zeros(3), numbers[0])

    def node(self, place: NDArray[np.int64], level: int, places: list[NDArray[np.int64]], result: VdbGrid) -> None:
        """A node and what is below it; blocks come with their voxels later."""
        if level == 2:
            self.piece(64)
            places.append(place)
            return
        n, size = SIZES[level], 128 if level == 0 else 8
        children, active = self.mask(n), self.mask(n)
        values = self.values(active, children)
        side = round(n ** (1 / 3))
        inner = np.stack(np.unravel_index(np.arange(n), (side,) * 3), axis=1) * size
        for k in np.flatnonzero(~children & (values != self.background)):
            result.tiles.append((place + inner[k], size, float(values[k])))
        for k in np.flatnonzero(children):
            self.node(place + inner[k], level + 1, places, result)

    def mask(self, n: int) -> NDArray[np.bool_]:
        """n bits."""
        return np.unpackbits(np.frombuffer(self.piece(n // 8), dtype=np.uint8), bitorder="little").astype(bool)

    def values(self, active: NDArray[np.bool_], children: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Values of all places of a node."""
        code, n = self.take("B")[0], len(active)
        kind = self.kind
        outside = self.background
        inside = -outside
        if code in (2, 4, 5):
            outside = np.frombuffer(self.piece(kind.itemsize), dtype=kind)[0].astype(np.float32)
        if code == 5:
            inside = np.frombuffer(self.piece(kind.itemsize), dtype=kind)[0].astype(np.float32)
        elif code == 4:
            inside = self.background
        elif code == 1:
            outside, inside = inside, outside
        picked = self.mask(n) if code in (3, 4, 5) else np.zeros(n, dtype=bool)
        masked = bool(self.flags & ACTIVE_MASK) and code != 6
        data = np.frombuffer(self.block(kind.itemsize * (int(active.sum()) if masked else n)), dtype=kind)
        if not masked:
            return data.astype(np.float32)
        result: NDArray[np.float32] = np.where(picked, inside, outside).astype(np.float32)
        result[active] = data
        return result

    def block(self, n: int) -> bytes:
        """n bytes, compressed or not."""
        if not self.flags & ZIP:
            return self.piece(n)
        length = self.take("q")[0]
        data = self.piece(-length) if length <= 0 else zlib.decompress(self.piece(length))
        if len(data) != n:
            raise ValueError("a block of values has another size than it should")
        return data
