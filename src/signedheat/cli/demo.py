"""``signedheat demo``: distance and offset of a bundled broken duck."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from ..domains.grid import Grid
from ..domains.inspection import inspect
from ..errors import FileFormatError
from ..io import ensure_writable, save
from ..io.files import PathLike, replacing
from ..samples import broken_duck
from ..visualization import draw_shape, draw_slices, ensure_picture_writable, new_figure
from .computing import Summary, compute, describe

DISTANCE = 0.15

DEFAULTS = {
    "as_oriented": False,
    "keep_overlaps": False,
    "plain": False,
    "constraint": "zero-set",
    "band": None,
    "diffusion": 1.0,
}
"""What `compute` reads, where the demo has no options."""


def run(arguments: Namespace) -> Summary:
    """Write everything to one folder."""
    folder = Path(arguments.output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileFormatError(
            f"cannot be made a folder ({error.strerror})",
            remedy="name another",
            path=folder,
        ) from error
    files = {name: folder / name for name in ("duck.stl", "distance.vti", "offset.stl", "picture.png")}
    for path in files.values():
        ensure_writable(path, {path.suffix}, "a file")
    ensure_picture_writable(files["picture.png"])
    shape = broken_duck()
    save(shape, files["duck.stl"])
    grid = Grid.around(shape.bounds, arguments.resolution, padding=3 * DISTANCE)
    options = Namespace(**vars(arguments), **DEFAULTS)
    field = compute(shape, grid, options)
    surface = field.offset(DISTANCE)
    field.save(files["distance.vti"])
    save(surface, files["offset.stl"])
    draw_story(shape, field, surface, files["picture.png"])
    broken, whole = inspect(shape), inspect(surface)
    text = "\n".join(
        [
            f"{files['duck.stl']}: the input: {broken.open_edges} open edges, {broken.nonmanifold_edges} nonmanifold, "
            f"{broken.inconsistent_edges} inconsistent",
            f"{files['distance.vti']}: its signed distance at {' × '.join(map(str, grid.shape))} nodes",
            f"{files['offset.stl']}: the surface {DISTANCE:g} outside: {whole.open_edges} open edges, "
            f"{whole.nonmanifold_edges} nonmanifold, {whole.inconsistent_edges} inconsistent",
            f"{files['picture.png']}: a picture of them",
        ]
    )
    summary = {"files": [str(path) for path in files.values()], "distance": DISTANCE, "field": describe(field)}
    return summary, text


def draw_story(shape: Any, field: Any, surface: Any, path: PathLike) -> None:
    """Draw the broken shape, a slice of its distance, and the closed offset surface."""
    figure = new_figure(13.5, 4.6)
    before = figure.add_subplot(1, 3, 1)
    draw_shape(shape, before)
    before.set_title("in: holes, noise, flipped and\nduplicate faces", fontsize=11)
    middle = figure.add_subplot(1, 3, 2)
    draw_slices(field, [middle], shape, [DISTANCE], across=(1,))
    middle.set_title("its signed distance", fontsize=11)
    after = figure.add_subplot(1, 3, 3)
    draw_shape(surface, after)
    after.set_title(f"out: the closed surface at +{DISTANCE:g}", fontsize=11)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=110)
