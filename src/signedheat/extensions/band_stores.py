"""Bands on disk: the plan, which every worker maps into memory, and tiles, zarr groups that are written when done."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import Note
from ..domains.grid import Grid
from ..errors import FileFormatError
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..geometry.box_tree import BoxTree
from ..geometry.face_features import FaceFeatures
from ..operators.grid.blocks import Blocks
from ..operators.grid.exact_surface import ExactSurface
from ..packages import lazy_module
from .band_plan import BandPlan
from .band_tiles import Tile, solve_tile

zarr = lazy_module("zarr", "tiles on disk")

ARRAYS = ("places", "values", "confidence", "crossings")
"""What is stored of a tile."""


@dataclass(frozen=True, eq=False, repr=False)
class TilesComputed(Note):
    """Tiles of a band, those of them that were there before, and the most memory of a process that computed one."""

    tiles: int
    reused: int
    peak_memory: int

    def __str__(self) -> str:
        memory = f", at most {self.peak_memory / 1e9:.2f} GB for each process" if self.peak_memory else ""
        return f"{self.tiles} tiles, {self.reused} of them there before{memory}"


def save_plan(plan: BandPlan, folder: Path, fingerprint: str) -> None:
    """Write a plan to a folder, the file that makes it whole last.

    Parameters
    ----------
    plan : BandPlan
        What to write.
    folder : path
        Where to.
    fingerprint : str
        Tells whether a later run is the same one.
    """
    place = folder / "plan"
    place.mkdir(parents=True, exist_ok=True)
    surface = plan.coarse.surface
    arrays = {f"feature_{each.name}": getattr(plan.features, each.name) for each in fields(FaceFeatures)}
    arrays |= {"telling": plan.telling, "asked": plan.asked, "ends": plan.ends, "far_values": plan.far.values}
    arrays["crossings"] = np.zeros((0, 18)) if surface is None else surface.crossings
    if plan.far.confidence is not None:
        arrays["far_confidence"] = plan.far.confidence
    between = {}
    if isinstance(plan.coarse, BandField):
        arrays |= {"coarse_places": plan.coarse.blocks.places, "coarse_values": plan.coarse.values}
        if plan.coarse.confidence is not None:
            arrays["coarse_confidence"] = plan.coarse.confidence
        between = {"coarse_shape": list(plan.coarse.grid.shape), "coarse_width": plan.coarse.width}
    if plan.faces is not None:
        arrays |= {"bounds": plan.faces.tree.bounds, "items": plan.faces.tree.items}
    for name, array in arrays.items():
        np.save(place / f"{name}.npy", array)
    about = {
        "fingerprint": fingerprint,
        "origin": plan.grid.origin.tolist(),
        "spacing": plan.grid.spacing.tolist(),
        "shape": list(plan.grid.shape),
        "coarse_spacing": plan.coarse.grid.spacing.tolist(),
        "far_spacing": plan.far.grid.spacing.tolist(),
        "width": plan.width,
        "share": plan.share,
        "closed": plan.closed,
        **between,
    }
    temporary = place / "about.part"
    temporary.write_text(json.dumps(about))
    temporary.replace(place / "about.json")


def saved_fingerprint(folder: Path) -> str | None:
    """Of the plan in a folder; None if there is no whole one."""
    try:
        return str(json.loads((folder / "plan" / "about.json").read_text())["fingerprint"])
    except (OSError, ValueError, KeyError):
        return None


@lru_cache(maxsize=2)
def load_plan(folder: Path, fingerprint: str) -> BandPlan:
    """A plan whose arrays are mapped: what a tile does not need is not read, and processes share what they read.

    The fingerprint is the one it was saved with: a folder may be used for something else later.

    Raises
    ------
    FileFormatError
        If the folder has no whole plan.
    """
    place = folder / "plan"
    try:
        about = json.loads((place / "about.json").read_text())
        arrays = {path.stem: np.asarray(np.load(path, mmap_mode="c")) for path in place.glob("*.npy")}
        features = FaceFeatures(**{each.name: arrays[f"feature_{each.name}"] for each in fields(FaceFeatures)})
        origin = np.array(about["origin"])
        surface = ExactSurface(features, arrays["crossings"], origin, np.array(about["coarse_spacing"]))
        coarse = _coarse_field(about, arrays, surface)
        tree = BoxTree(arrays["bounds"], arrays["items"]) if "bounds" in arrays else None
        fine = Grid(origin, about["spacing"], about["shape"])
        faces = arrays["telling"], arrays["ends"], arrays["asked"]
        return BandPlan(fine, coarse, about["width"], features, *faces, about["share"], about["closed"], tree)
    except (OSError, ValueError, KeyError) as error:
        raise FileFormatError(
            f"the plan of its tiles cannot be read ({error})", remedy="remove the folder and start anew", path=folder
        ) from error


def _coarse_field(
    about: dict[str, Any], arrays: dict[str, NDArray[Any]], surface: ExactSurface
) -> GridField | BandField:
    """That of a plan, from what is written of it."""
    values = arrays["far_values"]
    box = Grid(about["origin"], about["far_spacing"], values.shape)
    far = GridField(box, values, confidence=arrays.get("far_confidence"), surface=surface)
    if "coarse_shape" not in about:
        return far
    grid = Grid(about["origin"], about["coarse_spacing"], about["coarse_shape"])
    blocks = Blocks(arrays["coarse_places"], (grid.shape[0], grid.shape[1], grid.shape[2]))
    confidence = arrays.get("coarse_confidence")
    width = float(about["coarse_width"])
    return BandField(grid, blocks, arrays["coarse_values"], far, width, confidence=confidence, surface=surface)


def solve_into(folder: str, fingerprint: str, tile: tuple[int, int, int]) -> tuple[int, int]:
    """Compute a tile and write it; returns its number of blocks, and the bytes that this process has had at most."""
    place = Path(folder)
    write_tile(place, tile, solve_tile(load_plan(place, fingerprint), np.array(tile)))
    return tile_blocks(place, tile) or 0, peak_memory()


def peak_memory() -> int:
    """The most memory that this process has had, in bytes; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:
        return 0
    return 1024 * int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)


def write_tile(folder: Path, tile: tuple[int, int, int], solved: Tile) -> None:
    """Write a tile to the zarr group of a folder; that it is whole, last."""
    group = zarr.open_group(str(folder / "tiles" / _name(tile)), mode="w")
    for name in ARRAYS if len(solved.places) else ():
        group.create_array(name, data=getattr(solved, name))
    group.attrs.update({"blocks": len(solved.places), "crossings": len(solved.crossings)})


def read_tile(folder: Path, tile: tuple[int, int, int]) -> dict[str, NDArray[np.generic]]:
    """The arrays of a tile that holds blocks."""
    group = zarr.open_group(str(folder / "tiles" / _name(tile)), mode="r")
    return {name: group[name][...] for name in ARRAYS}


def tile_blocks(folder: Path, tile: tuple[int, int, int]) -> int | None:
    """Number of blocks of a tile, or None if it is not whole."""
    try:
        about = json.loads((folder / "tiles" / _name(tile) / "zarr.json").read_text())
        return int(about["attributes"]["blocks"])
    except (OSError, ValueError, KeyError):
        return None


def _name(tile: tuple[int, int, int]) -> str:
    return ".".join(map(str, tile))
