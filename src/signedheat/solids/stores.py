"""Bands on disk: computed tile by tile by threads, processes or a Dask cluster, so that stopped runs can be resumed.

A folder holds the input of the tiles, values and confidence of all blocks in memory-mapped files, and a mark for each
finished tile. Tiles are independent, and workers write to different rows.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from ..arrays import Ints
from ..cache import fingerprint
from ..diagnostics import Note
from ..errors import FileFormatError, SignedHeatError
from ..grids.blocks import SIDE, Blocks
from ..grids.grid import Grid
from ..jobs import Progress
from ..packages import lazy_module
from ..parallel import connected, n_threads
from ..search.face_tree import FaceTree
from .node_distances import solved
from .winding import Windings

distributed: Any = lazy_module("distributed", "Dask clusters")

RETRIES = 3
"""Number of times a cluster retries a tile after its worker has died."""


class ClusterClient(Protocol):
    """The part of `distributed.Client` that is used."""

    def submit(self, function: Callable[..., object], /, *args: object, **options: object) -> Future[int]: ...


Scheduler: TypeAlias = Executor | ClusterClient | str | None
"""A pool, or the client or address of a cluster; None means threads of this process."""


@dataclass(frozen=True)
class TilesComputed(Note):
    """A band was computed in tiles on disk.

    Attributes
    ----------
    tiles, reused : int
        Number of all tiles, and of those that existed already.
    """

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
    progress: Progress | None,
) -> tuple[NDArray[np.float32], NDArray[np.float16], TilesComputed]:
    """Values and confidence of blocks, mapped from files of a folder; rows of `tiles` that are done stay.

    Raises
    ------
    FileFormatError
        If the folder holds tiles of something else.
    """
    folder = folder.absolute()
    plan: dict[str, NDArray[Any]] = {
        "corners": tree.features.vertices[tree.features.faces],
        "trusted": tree.features.trusted,
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
        if progress is not None:
            progress((len(tiles) - len(missing) + count + 1) / len(tiles), "tiles")
    values, confidence = (np.load(folder / f"{name}.npy", mmap_mode="c") for name in ("values", "confidence"))
    return values, confidence, TilesComputed(len(tiles), len(tiles) - len(missing))


def _begin(folder: Path, key: str, plan: dict[str, NDArray[Any]], n_blocks: int, n_tiles: int) -> None:
    """Make the files of a folder, unless they are there."""
    name = folder / "key.txt"
    if name.exists():
        if name.read_text() != key:
            raise FileFormatError(
                "the folder holds tiles of another solid, grid or band",
                remedy="name another folder, or remove it",
                path=folder,
            )
        return
    shape = (n_blocks, SIDE, SIDE, SIDE)
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
        raise FileFormatError(cause, remedy="choose a folder that is yours and has room", path=folder) from error


def _reserve(path: Path, dtype: type, shape: tuple[int, ...]) -> None:
    """Make a file of zeros with allocated space, since writing to a mapped page without space kills the process."""
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
    """Return the input of the tiles of a folder, read once per process."""
    with np.load(Path(folder) / "plan.npz", allow_pickle=False) as file:
        plan = dict(file)
    tree = FaceTree.of_triangles(plan["corners"], plan["trusted"])
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
    """Yield numbers of tiles as they are done."""
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
        options = {"pure": False, "retries": RETRIES}
        jobs = [scheduler.submit(solve_into, folder, key, number, **options) for number in missing]
        yield from _finished(jobs, distributed.as_completed(jobs), folder)


def _finished(jobs: list[Future[int]], in_order: Iterable[Future[int]], folder: str) -> Iterator[int]:
    """Yield results of jobs as they end; cancel the others if one fails or the caller stops."""
    try:
        for job in in_order:
            yield job.result()
    except BrokenProcessPool as error:
        raise SignedHeatError(
            "a process of the pool died",
            remedy="give it more memory, or start it under if __name__ == '__main__'; run again: what is done stays",
            path=folder,
        ) from error
    finally:
        for job in jobs:
            job.cancel()
