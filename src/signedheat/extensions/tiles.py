"""Bands tile by tile: on threads, on a pool of processes, or on a Dask cluster; on disk, so that runs can go on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import ArrayLike, NDArray

from ..cache import fingerprint
from ..constraints import Constraint
from ..diagnostics import Diagnostics
from ..domains.grid import Grid
from ..domains.kinds import ShapeLike
from ..domains.point_cloud import PointCloud
from ..errors import FileFormatError, SignedHeatError
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..lowering.area_elements import area_elements, bounds_around
from ..operators.grid.blocks import SIDE, Blocks
from ..packages import lazy_module, require
from ..parallel import connected, n_threads
from ..progress import Progress, within
from ..solver import checked
from .band_grids import coarse_grid, grid_between, width_between
from .band_memory import refuse_tiles_beyond_disk, refuse_work_beyond_memory
from .band_plan import BandPlan, plan_band
from .band_stores import TilesComputed, load_plan, read_tile, save_plan, saved_fingerprint, solve_into, tile_blocks
from .joining import joined_shape
from .solid_distance import coarse_distance
from .steps import Steps

distributed = lazy_module("distributed", "Dask clusters")

RETRIES = 3
"""How often a tile is given to another worker of a cluster after one has died."""
PLANNED = 0.3
"""Share of the progress that the plan is."""

Place = tuple[int, int, int]


class ClusterClient(Protocol):
    """What is used of a `distributed.Client`."""

    def submit(
        self, function: Callable[..., object], /, *args: object, **options: object
    ) -> Future[tuple[int, int]]: ...


def tiled_distance(
    shape: ShapeLike | Sequence[ShapeLike],
    store: str | PathLike[str],
    domain: Grid | None = None,
    *,
    band: float,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    scheduler: Executor | ClusterClient | str | None = None,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    progress: Progress | None = None,
) -> BandField:
    """`solid_distance` in a band, computed in tiles of 128³ nodes that are written to a folder as they are done.

    The result is that of ``solid_distance(…, band=band)``, to the last bit, whoever computes it. A run that was stopped
    goes on where it was when it is called again with the same arguments. Values stay on disk and are mapped into memory
    as they are used, so that bands may be larger than it.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud or TetMesh; or several meshes
        See `solid_distance`, for all other parameters too.
    store : str or path
        Folder for the plan, the tiles (a zarr group each), and the band; workers must be able to read and write it.
    scheduler : concurrent.futures.Executor, distributed.Client or str, optional
        Who computes tiles: by default threads of this process; a pool, such as a `ProcessPoolExecutor`; or a Dask
        cluster, by its client or its address, such as ``"tcp://127.0.0.1:8786"``.
    progress : callable, optional
        Called as ``progress(fraction, step)``; what it raises cancels.

    Returns
    -------
    BandField
        Its notes tell how many tiles there were, and the most memory that a process needed: `TilesComputed`.

    Raises
    ------
    FileFormatError
        If the folder holds tiles of something else.
    MemoryLimitError
        If the tiles will surely not fit on the disk of the folder, or those at work at a time in memory.
    MissingPackageError
        If zarr is not installed, or for a cluster distributed.
    SourceError, GeometryError
        As `solid_distance`.

    Examples
    --------
    >>> import tempfile
    >>> from signedheat import samples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     ball = tiled_distance(samples.sphere(3), folder, resolution=160, band=0.1)
    ...     bool(abs(ball([[1.05, 0, 0]])[0] - 0.05) < 0.01)
    True
    """
    require("zarr", "tiles on disk")
    solid = joined_shape(shape)
    folder = Path(store).absolute()
    grid = Grid.around(bounds_around([solid]), resolution, padding, spacing) if domain is None else domain
    key = _key(solid, grid, (band, constraint, diffusion, as_oriented, keep_overlaps))
    steps = Steps(not as_oriented, not keep_overlaps, True, checked(constraint), diffusion)

    def coarsest(told: Progress | None) -> GridField:
        coarse = coarse_distance(solid, grid, steps, told)
        refuse_tiles_beyond_disk(coarse, grid, band, folder)
        return coarse

    run = _Run(key, scheduler, coarsest)
    field, note = _in_tiles(run, folder, grid, band, progress)
    return replace(field, diagnostics=field.diagnostics.noting(note))


@dataclass(frozen=True)
class _Run:
    """What bands in tiles that follow each other share: their fingerprint, who computes, and the coarsest field."""

    key: str
    scheduler: Executor | ClusterClient | str | None
    coarsest: Callable[[Progress | None], GridField]


def _in_tiles(
    run: _Run, folder: Path, grid: Grid, band: float, progress: Progress | None
) -> tuple[BandField, TilesComputed]:
    """A band in tiles; before it the one between it and the coarsest grid, where it is far finer, likewise."""
    diagnostics, saved = Diagnostics(), saved_fingerprint(folder)
    if saved not in (None, run.key):
        raise FileFormatError(
            "the folder holds tiles of another shape, grid or band",
            remedy="name another folder, or remove it",
            path=folder,
        )
    if saved is None:
        coarse: GridField | BandField
        between = grid_between(coarse_grid(grid), grid)
        planned = within(progress, 0.0, PLANNED)
        if between is None:
            coarse = run.coarsest(planned)
        else:
            coarse, _ = _in_tiles(run, folder / "between", between, width_between(grid, band), planned)
        diagnostics = coarse.diagnostics
        save_plan(plan_band(coarse, grid, band), folder, run.key)
        del coarse
    plan = load_plan(folder, run.key)
    places = [(int(a), int(b), int(c)) for a, b, c in plan.tiles]
    missing = [place for place in places if tile_blocks(folder, place) is None]
    if missing and run.scheduler is None:
        refuse_work_beyond_memory(plan)
    peak = 0
    for done, (_, memory) in enumerate(_computed(str(folder), run, missing)):
        peak = max(peak, memory)
        if progress is not None:
            progress(PLANNED + (1 - PLANNED) * (done + 1) / len(missing), "tiles")
    note = TilesComputed(len(places), len(places) - len(missing), peak)
    return _gathered(plan, folder, places, diagnostics), note


def _key(shape: object, grid: Grid, options: tuple[object, ...]) -> str:
    """Tells runs with different arguments apart."""
    if isinstance(shape, PointCloud):
        arrays = [part for part in (shape.points, shape.normals, shape.areas) if part is not None]
    else:
        elements = area_elements(shape)
        arrays = [elements.corners, elements.vectors]
    numbers = np.concatenate([grid.origin, grid.spacing, np.array(grid.shape, dtype=np.float64)])
    words = np.frombuffer(repr(options).encode(), dtype=np.uint8)
    return fingerprint(*arrays, numbers, words).hex()


def _computed(folder: str, run: _Run, places: list[Place]) -> Iterator[tuple[int, int]]:
    """What `solve_into` returns for each tile, as they are done."""
    scheduler = run.scheduler
    if not places:
        return
    if scheduler is None:
        with ThreadPoolExecutor(n_threads()) as pool:
            yield from _on_pool(folder, run.key, places, pool)
    elif isinstance(scheduler, Executor):
        yield from _on_pool(folder, run.key, places, scheduler)
    elif isinstance(scheduler, str):
        with connected(scheduler) as client:
            yield from _on_cluster(folder, run.key, places, client)
    else:
        yield from _on_cluster(folder, run.key, places, scheduler)


def _on_pool(folder: str, key: str, places: list[Place], pool: Executor) -> Iterator[tuple[int, int]]:
    jobs = [pool.submit(solve_into, folder, key, place) for place in places]
    try:
        for job in as_completed(jobs):
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


def _on_cluster(folder: str, key: str, places: list[Place], client: ClusterClient) -> Iterator[tuple[int, int]]:
    """Tiles that have the same input are different work: `pure` would let the cluster think that they are done."""
    jobs = [client.submit(solve_into, folder, key, place, pure=False, retries=RETRIES) for place in places]
    try:
        for job in distributed.as_completed(jobs):
            yield job.result()
    finally:
        for job in jobs:
            job.cancel()


def _gathered(plan: BandPlan, folder: Path, places: list[Place], diagnostics: Diagnostics) -> BandField:
    """The field of all tiles, its values in files that are mapped; written anew if they are not whole."""
    held = [place for place in places if tile_blocks(folder, place)]
    target = folder / "band"
    target.mkdir(exist_ok=True)
    counts = [tile_blocks(folder, place) or 0 for place in held]
    shape = (sum(counts), SIDE, SIDE, SIDE)
    values = open_memmap(target / "values.npy", mode="w+", dtype=np.float32, shape=shape)
    confidence = open_memmap(target / "confidence.npy", mode="w+", dtype=np.float16, shape=shape)
    where, crossings, begin = [np.zeros((0, 3), dtype=np.int32)], [np.zeros((0, 18))], 0
    for place, count in sorted(zip(held, counts, strict=True)):  # in the order of blocks
        arrays = read_tile(folder, place)
        here = slice(begin, begin + count)
        values[here], confidence[here] = arrays["values"], arrays["confidence"]
        where.append(np.asarray(arrays["places"], dtype=np.int32))
        crossings.append(np.asarray(arrays["crossings"], dtype=np.float64))
        begin += count
    values.flush()
    confidence.flush()
    del values, confidence
    mapped: list[NDArray[np.generic]] = [
        np.asarray(np.load(target / f"{name}.npy", mmap_mode="c")) for name in ("values", "confidence")
    ]
    blocks = Blocks(np.concatenate(where), (plan.grid.shape[0], plan.grid.shape[1], plan.grid.shape[2]))
    return BandField(
        plan.grid,
        blocks,
        mapped[0].astype(np.float32, copy=False),
        plan.far,
        plan.width,
        diagnostics,
        mapped[1].astype(np.float16, copy=False),
        plan.surface(np.concatenate(crossings)),
    )
