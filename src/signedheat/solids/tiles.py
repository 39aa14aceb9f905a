"""Distance to solids at the nodes of grids, in independent tiles; and bands on disk, which can be resumed.

A folder holds the input of the tiles, values and confidence of all blocks in memory-mapped files, and a mark for each
finished tile. Tiles are computed by threads, processes or a Dask cluster, which write to different rows.
"""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias, cast

import numpy as np
import scipy
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints, fingerprint
from ..diagnostics import Diagnostics, Note
from ..errors import (
    FileFormatError,
    MemoryLimitError,
    OutsideError,
    SignedHeatError,
    UnsupportedTypeError,
    refuse_deleted_folder,
)
from ..fields.field import Field
from ..fields.solid_queries import SolidQueries
from ..grids.band import Band
from ..grids.blocks import BLOCK, BLOCK_NODES, Blocks
from ..grids.grid import Grid
from ..grids.grid_discretization import refuse_large_grid
from ..grids.nearest_nodes import SQUARE_ROUNDING, Lattice, nearest_at_nodes
from ..jobs import report, reporting
from ..memory import available_memory, libraries
from ..packages import lazy_module
from ..parallel import connected, in_threads, n_threads
from ..search.face_tree import FaceTree, feet_on
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import positive_number
from .winding import Windings

TILE = 8
"""Number of blocks along each edge of a tile; small, so that threads finish together."""
BYTES_PER_DENSE_NODE = 12.0
"""Memory per node for a value and a confidence."""
BYTES_AT_WORK = 40e6
"""Measured memory of the tiles that are computed at the same time, and of compiled kernels."""
BYTES_IN_BAND = 6.5
"""Memory per node of a band, including its share of the tables of blocks."""
COARSE_NODES = 65
"""Approximate maximum of nodes along an axis of the coarse grid of a band, whose cells are 2, 4, 8, … times as long."""
FOLLOWED_CUBES, COUNT_FACTOR = 1024, 1.5
"""Number of cubes of each size that are divided to estimate the number of blocks, and factor by which the estimate may
be wrong."""


class Evaluated(SolidQueries, Protocol):
    """The part of `Solid` that is used in this module; importing the class would be circular."""

    @property
    def origins(self) -> Ints: ...  # (m,) face of the source of each triangle; −1 in the completion
    @property
    def bounds(self) -> Floats: ...  # (2, 3) corners of the box around the triangles
    @property
    def bounding(self) -> Bools: ...  # (m,) whether a triangle has the inside behind it only
    @property
    def source(self) -> TriangleMesh | None: ...  # triangles of the input, if they are known
    @property
    def tree(self) -> FaceTree: ...  # search tree over the triangles
    @property
    def windings(self) -> Windings: ...  # winding numbers, which decide what is inside
    @property
    def diagnostics(self) -> Diagnostics: ...  # notes on faces that were flipped, left out and added
    @property
    def uncrossed(self) -> bool: ...  # whether the triangles are known not to cross


def dense_field(solid: Evaluated, grid: Grid) -> Field[Grid[Literal[3]]]:
    """Compute the signed distance to a solid at all nodes of a grid."""
    refuse_plane_grid(grid)
    refuse_large_grid(grid, BYTES_PER_DENSE_NODE, BYTES_AT_WORK)
    values, confidence = np.empty(grid.shape), np.empty(grid.shape, dtype=np.float32)
    n_blocks = -(-np.array(grid.shape) // BLOCK)
    firsts = np.stack(np.meshgrid(*(np.arange(0, n, TILE) for n in n_blocks), indexing="ij"), axis=-1).reshape(-1, 3)
    tree, windings = prepared(solid)

    def tile(first: Ints) -> tuple[Floats, NDArray[np.float32]]:
        """Distances and confidence at the nodes of the tile of blocks that begins at block `first`."""
        stop = np.minimum(first + TILE, n_blocks)
        axes = (np.arange(*ends) for ends in zip(first, stop, strict=True))
        indices = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        return distances_in(tree, windings, grid, BLOCK * first, indices)

    for done, (first, (distances, trusted)) in enumerate(zip(firsts, in_threads(tile, firsts), strict=True)):
        window = tuple(slice(f, f + n) for f, n in zip(BLOCK * first, distances.shape, strict=True))
        values[window], confidence[window] = distances, trusted
        report((done + 1) / len(firsts), "distance")
    return cast("Field[Grid[Literal[3]]]", Field(grid, values, solid.diagnostics, confidence=confidence, solid=solid))


def band_field(
    solid: Evaluated,
    grid: Grid,
    width: float,
    store: str | PathLike[str] | None,
    scheduler: Scheduler,
) -> Field[Grid[Literal[3]]]:
    """Compute signed distance in the blocks of a grid within `width` of a solid, and on a coarse grid everywhere.

    The blocks are kept in memory, or in the folder `store`, whose tiles `scheduler` computes.
    """
    refuse_plane_grid(grid)
    width = positive_number(width, "band")
    tree, windings = prepared(solid)
    with reporting(None):
        coarse = dense_field(solid, coarser(grid, 1 << max(0, math.ceil(math.log2(max(grid.shape) / COARSE_NODES)))))
    reach = width + float(np.linalg.norm(grid.spacing))  # complete the cells at the ends of the band
    limit = blocks_that_fit(store)
    indices, factor = blocks_near(tree, grid, reach, limit)
    if factor > 1:
        raise MemoryLimitError(
            f"the band has more than {limit:,} blocks of {BLOCK_NODES} nodes, "
            f"{limit * BLOCK_NODES * BYTES_IN_BAND / 1e9:.2g} GB, for which there is room",
            remedy=f"use a spacing of {factor * float(grid.spacing.min()):.3g} or more, or a narrower band"
            + ("" if store is not None else ", or keep it on disk (store)"),
        )
    blocks = Blocks.of(indices, grid.shape)
    if not len(blocks):
        raise OutsideError("no node of the grid lies within the band", element="grid")
    tiles, diagnostics = tiles_of(blocks), solid.diagnostics
    if store is None:
        values: NDArray[Any] = np.empty((len(blocks), BLOCK, BLOCK, BLOCK), dtype=np.float32)
        confidence: NDArray[Any] = np.empty(values.shape, dtype=np.float16)

        def solve(rows: Ints) -> Ints:
            """Write the values at the nodes of the blocks with these row numbers; return them."""
            values[rows], confidence[rows] = solved(tree, windings, grid, blocks.places[rows].astype(np.int64))
            return rows

        for done, _ in enumerate(in_threads(solve, tiles)):
            report((done + 1) / len(tiles), "band")
    else:
        values, confidence, note = in_store(Path(store), tree, windings, grid, blocks, tiles, scheduler)
        diagnostics = diagnostics.noting(note)
    field = Field(Band(grid, blocks, width), values, diagnostics, confidence=confidence, solid=solid, coarse=coarse)
    return cast("Field[Grid[Literal[3]]]", field)


def distances_in(
    tree: FaceTree, windings: Windings, grid: Grid, first: Ints, indices: Ints
) -> tuple[Floats, NDArray[np.float32]]:
    """Compute signed distances at nodes of the blocks at (n, 3) places: (a, b, c) from node `first` on, else NaN.

    Also return the (a, b, c) confidence in the nearest faces.
    """
    lattice = Lattice(np.array(grid.origin), np.array(grid.spacing), np.array(grid.shape))
    squares, faces = nearest_at_nodes(tree, lattice, first, indices)
    values = np.sqrt(squares, out=squares)
    inside = _inside(tree, windings, grid, first, values, faces)
    return np.negative(values, out=values, where=inside), tree.features.trusted[faces]


def solved(
    tree: FaceTree, windings: Windings, grid: Grid, indices: Ints
) -> tuple[NDArray[np.float32], NDArray[np.float16]]:
    """(n, 8, 8, 8) signed distances at the nodes of blocks at (n, 3) places, NaN beyond the grid; and confidence.

    The places should be near each other, since memory grows with the box around them.
    """
    first = indices.min(axis=0)
    distances, trusted = distances_in(tree, windings, grid, BLOCK * first, indices)
    values = np.full((len(indices), BLOCK, BLOCK, BLOCK), np.nan, dtype=np.float32)
    confidence = np.ones(values.shape, dtype=np.float16)
    for row, place in enumerate(BLOCK * (indices - first)):
        a, b, c = (slice(p, p + BLOCK) for p in place)
        i, j, k = distances[a, b, c].shape
        values[row, :i, :j, :k], confidence[row, :i, :j, :k] = distances[a, b, c], trusted[a, b, c]
    return values, confidence


def _inside(
    tree: FaceTree, windings: Windings, grid: Grid, first: Ints, values: Floats, faces: NDArray[np.int32]
) -> Bools:
    """Find which nodes are inside, given their distances `values` and nearest faces; all arrays are (a, b, c).

    `first` is the first node. Connected nodes farther than half a step from any surface share one test.
    """
    origin, steps = grid.origin + first * grid.spacing, grid.spacing
    inside = np.zeros(values.shape, dtype=bool)
    far = values > 0.5 * (1.0 + SQUARE_ROUNDING) * float(steps.max())
    groups, count = scipy.ndimage.label(far)
    if count:
        most = np.zeros(count + 1)
        np.maximum.at(most, groups[far], values[far])
        farthest = far & (values == most[groups])
        where = np.argwhere(farthest)[np.unique(groups[farthest], return_index=True)[1]]
        group_is_inside = np.concatenate([[False], windings.inside(origin + where * steps)])
        inside = group_is_inside[groups]
    near = np.nonzero(~np.isnan(values) & ~far)
    if len(near[0]):
        points = origin + np.stack(near, axis=1) * steps
        inside[near] = windings.inside_near(points, feet_on(tree.features, faces[near], points))
    return inside


def tiles_of(blocks: Blocks) -> list[Ints]:
    """Group blocks into tiles of `TILE`³ blocks: return the row numbers of the blocks of each tile."""
    tiles = blocks.places.astype(np.int64) // TILE
    _, owners = np.unique(tiles, axis=0, return_inverse=True)
    order = np.argsort(owners.ravel(), kind="stable")
    return np.split(order, np.flatnonzero(np.diff(owners.ravel()[order])) + 1)


def coarser(grid: Grid, factor: int) -> Grid:
    """Return a grid that covers the same box, with nodes farther apart by a factor."""
    return Grid(grid.origin, factor * grid.spacing, [max(2, 1 - (-(n - 1) // factor)) for n in grid.shape])


def blocks_near(tree: FaceTree, grid: Grid, reach: float, limit: int) -> tuple[Ints, int]:
    """(n, 3) indices of the blocks that may have a node within reach of a face, and 1.

    If they are more than `limit`, none, and the factor by which cells must be larger.
    """
    diagonal = float(np.linalg.norm(grid.spacing))
    return blocks_where(grid, lambda centres, half: tree.distances(centres) <= reach + half * diagonal, limit)


def blocks_where(grid: Grid, near: Callable[[Floats, float], Bools], limit: float) -> tuple[Ints, int]:
    """(n, 3) indices of the blocks that `near` accepts, and 1; or none, and the factor by which cells must be larger.

    None are returned if there are more than `limit`. `near` takes the (k, 3) centres of cubes, and half of their edge
    in nodes, and returns (k,) whether the cubes are to be divided.
    """
    if math.prod(-(-n // BLOCK) for n in grid.shape) > limit:
        numbers = {side: number for side, _, number in _cubes(grid, near, FOLLOWED_CUBES)}
        if max(numbers.values()) > COUNT_FACTOR * limit:
            return np.zeros((0, 3), dtype=np.int64), 2 * max(s for s in numbers if numbers[s] * COUNT_FACTOR > limit)
    for side, indices, number in _cubes(grid, near, None):
        if number > limit:
            return indices[:0], 2 * side
    return indices, 1


def _cubes(grid: Grid, near: Callable[[Floats, float], Bools], few: int | None) -> Iterator[tuple[int, Ints, float]]:
    """Yield the cubes that `near` accepts, from coarse to fine: blocks per edge, (k, 3) indices, and their number.

    `near` takes (k, 3) centres in space and half the edge of a cube, in nodes, and returns (k,) bool. Indices count
    cubes of the same size. If there are more than `few`, only so many are divided, and the number is an estimate. None
    means no limit.
    """
    n_blocks = -(-np.array(grid.shape) // BLOCK)
    side, weight, random = 1 << max(0, int(np.ceil(np.log2(n_blocks.max())))), 1.0, np.random.default_rng(0)
    indices, halves = np.zeros((1, 3), dtype=np.int64), np.array(list(np.ndindex(2, 2, 2)))
    while side and len(indices):
        half = 0.5 * (side * BLOCK - 1)
        indices = indices[near(grid.origin + (indices * side * BLOCK + half) * grid.spacing, half)]
        yield side, indices, weight * len(indices)
        if few is not None and len(indices) > few:
            indices, weight = random.choice(indices, few, replace=False), weight * len(indices) / few
        side //= 2
        indices = (2 * indices[:, None] + halves).reshape(-1, 3)
        indices = indices[(indices * side < n_blocks).all(axis=1)]


def blocks_that_fit(store: str | PathLike[str] | None) -> int:
    """Return the number of blocks that fit in memory, or on the disk of a store."""
    if store is not None:
        refuse_deleted_folder(store)
        folder = Path(store).absolute()
        existing = next(place for place in (folder, *folder.parents) if place.exists())
        return max(blocks_held(folder), int(shutil.disk_usage(existing).free / (BLOCK_NODES * BYTES_IN_BAND)))
    available = available_memory()
    left = math.inf if available is None else available - libraries() - BYTES_AT_WORK
    return int(min(left / (BLOCK_NODES * BYTES_IN_BAND), 2**40))  # the coarse grid is allocated already


def refuse_plane_grid(grid: Grid) -> None:
    """Raise an error if a grid is not three-dimensional."""
    if grid.dimension != 3:
        raise UnsupportedTypeError(
            "distance to a solid is measured on grids in space", remedy="give it three axes", element="grid"
        )


def prepared(solid: Evaluated) -> tuple[FaceTree, Windings]:
    """Return the search tree and windings of a solid, with their caches filled, so that threads need not fill them."""
    tree, windings = solid.tree, solid.windings
    _ = tree.discs
    windings.inside(np.zeros((1, 3)))
    return tree, windings


distributed: Any = lazy_module("distributed", "Dask clusters")


class ClusterClient(Protocol):
    """The part of `distributed.Client` that is used."""

    def submit(self, function: Callable[..., object], /, *args: object, **options: object) -> Future[int]: ...


Scheduler: TypeAlias = Executor | ClusterClient | str | None
"""A pool, or the client or address of a cluster; None means threads of this process."""


@dataclass(frozen=True)
class TilesComputed(Note):
    """A band was computed in tiles on disk, some of which existed already."""

    tiles: int
    reused: int

    def __str__(self) -> str:
        return f"{self.tiles} tiles, of which {self.reused} were there already"


def in_store(
    folder: Path,
    tree: FaceTree,
    windings: Windings,
    grid: Grid,
    blocks: Blocks,
    tiles: list[Ints],
    scheduler: Scheduler,
) -> tuple[NDArray[np.float32], NDArray[np.float16], TilesComputed]:
    """Compute the unfinished tiles of a band in files of a folder.

    Return (n, 8, 8, 8) values and confidence of its blocks, memory-mapped, and a note.
    """
    folder = folder.absolute()
    plan: dict[str, NDArray[Any]] = {
        "corners": tree.features.vertices[tree.features.faces],
        "trusted": tree.features.trusted,
        "bounding": tree.features.face_regular,
        "origin": np.array(grid.origin),
        "spacing": np.array(grid.spacing),
        "shape": np.array(grid.shape),
        "places": blocks.places,
        "rows": np.concatenate(tiles),
        "starts": np.cumsum([0, *map(len, tiles)]),
        "closing": windings.triangles,
    }
    key = fingerprint(*plan.values()).hex()
    _begin(folder, key, plan, len(blocks), len(tiles))
    missing = np.flatnonzero(np.load(folder / "done.npy") == 0).tolist()
    for count, _ in enumerate(_computed(str(folder), key, missing, scheduler)):
        report((len(tiles) - len(missing) + count + 1) / len(tiles), "tiles")
    values, confidence = (np.load(folder / f"{name}.npy", mmap_mode="c") for name in ("values", "confidence"))
    return values, confidence, TilesComputed(len(tiles), len(tiles) - len(missing))


def _begin(folder: Path, key: str, plan: dict[str, NDArray[Any]], n_blocks: int, n_tiles: int) -> None:
    """Create the files of a band in a folder, unless it has them; raise an error if they are of another band.

    `key` identifies the band, and `plan` is the input of its tiles.
    """
    name = folder / "key.txt"
    if name.exists():
        if name.read_text() != key:
            raise FileFormatError(
                "the folder contains tiles of another solid, grid or band",
                remedy="name another folder, or remove it",
                path=folder,
            )
        return
    shape = (n_blocks, BLOCK, BLOCK, BLOCK)
    files = {"values": (np.float32, shape), "confidence": (np.float16, shape), "done": (np.uint8, (n_tiles,))}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(folder / "plan.npz", allow_pickle=False, **plan)
        for file, (dtype, size) in files.items():
            _reserve(folder / f"{file}.npy", dtype, size)
        name.write_text(key)  # written last; a folder without it is started again
    except OSError as error:
        for file in (*(f"{file}.npy" for file in files), "plan.npz", "key.txt"):
            with suppress(OSError):
                (folder / file).unlink()
        cause = f"the band cannot be kept there ({error.strerror or error})"
        raise FileFormatError(cause, remedy="choose a writable folder with enough space", path=folder) from error


def _reserve(path: Path, dtype: type, shape: tuple[int, ...]) -> None:
    """Make a ``.npy`` file of zeros whose space on disk is allocated, since a mapped page without space is fatal."""
    open_memmap(path, mode="w+", dtype=dtype, shape=shape).flush()
    size = path.stat().st_size
    with open(path, "r+b") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size)
            return
        file.seek(size - math.prod(shape) * np.dtype(dtype).itemsize)
        while file.tell() < size:
            file.write(bytes(min(1 << 24, size - file.tell())))


def blocks_held(folder: Path) -> int:
    """Count the blocks for which a folder has allocated space."""
    if not (folder / "key.txt").exists():
        return 0
    return int(np.load(folder / "values.npy", mmap_mode="r").shape[0])


@lru_cache(maxsize=1)
def _plan(folder: str, key: str) -> tuple[FaceTree, Windings, Grid, dict[str, Ints]]:
    """Return the search tree, winding numbers, grid and arrays from the plan of a folder, read once per process."""
    with np.load(Path(folder) / "plan.npz", allow_pickle=False) as file:
        plan = dict(file)
    tree = FaceTree.of_triangles(plan["corners"], plan["trusted"], plan["bounding"])
    return tree, Windings(plan["closing"]), Grid(plan["origin"], plan["spacing"], plan["shape"]), plan


def solve_into(folder: str, key: str, number: int) -> int:
    """Compute and write a tile of a folder, mark it as done, and return its number."""
    tree, windings, grid, plan = _plan(folder, key)
    rows = plan["rows"][plan["starts"][number] : plan["starts"][number + 1]]
    arrays = solved(tree, windings, grid, plan["places"][rows].astype(np.int64))
    for name, part in zip(("values", "confidence"), arrays, strict=True):
        file = open_memmap(Path(folder) / f"{name}.npy", mode="r+")
        file[rows] = part
        file.flush()
    done = open_memmap(Path(folder) / "done.npy", mode="r+")
    done[number] = 1
    done.flush()
    return number


def _computed(folder: str, key: str, missing: list[int], scheduler: Scheduler) -> Iterator[int]:
    """Compute the missing tiles, and yield their numbers as they are done."""
    if not missing:
        return
    if isinstance(scheduler, ThreadPoolExecutor):
        _plan(folder, key)  # read it once, before the threads need it
    if scheduler is None:
        with ThreadPoolExecutor(n_threads()) as pool:
            yield from _computed(folder, key, missing, pool)
    elif isinstance(scheduler, str):
        with connected(scheduler) as client:
            yield from _computed(folder, key, missing, client)
    elif isinstance(scheduler, Executor):
        jobs = [scheduler.submit(solve_into, folder, key, number) for number in missing]
        yield from _finished(jobs, as_completed(jobs), folder)
    else:  # not `pure`, because tasks have side effects
        options = {"pure": False, "retries": 3}
        jobs = [scheduler.submit(solve_into, folder, key, number, **options) for number in missing]
        yield from _finished(jobs, distributed.as_completed(jobs), folder)


def _finished(jobs: list[Future[int]], as_they_end: Iterable[Future[int]], folder: str) -> Iterator[int]:
    """Yield the results of jobs as they end; cancel the others if one fails or the caller stops."""
    try:
        for job in as_they_end:
            yield job.result()
    except BrokenProcessPool as error:
        raise SignedHeatError(
            "a process of the pool died",
            remedy="give it more memory, or start it under if __name__ == '__main__'; finished tiles are kept",
            path=folder,
        ) from error
    finally:
        for job in jobs:
            job.cancel()
