"""``signedheat demo``: distance and offset of a bundled broken duck."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

import signedheat as sh

from ..errors import FileFormatError, MissingPackageError
from .options import Summary, add_command, whole_number
from .parts import computing, inspection, io, samples, view
from .streams import say

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


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "demo",
        run,
        help="try it on a broken duck that comes along",
        description="Make a broken shape, its distance field, an offset surface and a picture.",
    )
    parser.add_argument("-o", "--output", default="demo", metavar="FOLDER", help="where to (demo)")
    parser.add_argument(
        "--resolution", type=whole_number(8), default=128, metavar="N", help="nodes along the longest side"
    )


def run(arguments: Namespace) -> Summary:
    """Write everything to one folder."""
    folder = Path(arguments.output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileFormatError(
            f"cannot be made a folder ({error.strerror})", remedy="name another", path=folder
        ) from error
    files = {name: folder / name for name in ("duck.stl", "distance.vti", "offset.stl", "picture.png")}
    for path in files.values():
        io.ensure_writable(path, {path.suffix}, "a file")
    try:
        view.ensure_picture_writable(files["picture.png"])
    except MissingPackageError as error:  # the rest is worth having
        del files["picture.png"]
        if not arguments.quiet:
            say(f"signedheat: no picture is made: {error}")
    shape = samples.broken_duck()
    io.save(shape, files["duck.stl"])
    grid = sh.Grid.around(shape.bounds, arguments.resolution, padding=3 * DISTANCE)
    options = Namespace(**vars(arguments), **DEFAULTS)
    field = computing.compute(shape, grid, options)
    surface = field.offset(DISTANCE)
    field.save(files["distance.vti"])
    io.save(surface, files["offset.stl"])
    broken, whole = inspection.inspect(shape), inspection.inspect(surface)
    lines = [
        f"{files['duck.stl']}: the input: {broken.open_edges} open edges, {broken.nonmanifold_edges} nonmanifold, "
        f"{broken.inconsistent_edges} inconsistent",
        f"{files['distance.vti']}: its signed distance at {' × '.join(map(str, grid.shape))} nodes",
        f"{files['offset.stl']}: the surface {DISTANCE:g} outside: {whole.open_edges} open edges, "
        f"{whole.nonmanifold_edges} nonmanifold, {whole.inconsistent_edges} inconsistent",
    ]
    if "picture.png" in files:
        draw_story(shape, field, surface, files["picture.png"])
        lines.append(f"{files['picture.png']}: a picture of them")
    summary = {
        "files": [str(path) for path in files.values()],
        "distance": DISTANCE,
        "field": computing.describe(field),
    }
    return summary, "\n".join(lines)


def draw_story(shape: Any, field: Any, surface: Any, path: Path) -> None:
    """Draw the broken shape, a slice of its distance, and the closed offset surface."""
    figure = view.new_figure(13.5, 4.6)
    before = figure.add_subplot(1, 3, 1)
    view.draw_shape(shape, before)
    before.set_title("in: holes, noise, flipped and\nduplicate faces", fontsize=11)
    middle = figure.add_subplot(1, 3, 2)
    view.draw_slices(field, [middle], shape, [DISTANCE], across=(1,))
    middle.set_title("its signed distance", fontsize=11)
    after = figure.add_subplot(1, 3, 3)
    view.draw_shape(surface, after)
    after.set_title(f"out: the closed surface at +{DISTANCE:g}", fontsize=11)
    with io.files.replacing(path) as temporary:
        figure.savefig(temporary, dpi=110)
