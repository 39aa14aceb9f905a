"""Options that several commands share, and the forms that their values must have."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from .streams import say, tell

Summary: TypeAlias = tuple[dict[str, Any], str]
"""The result of a command: a dictionary for ``--json``, and text."""
MOST_WORKERS = 1024
PLANAR = (".csv", ".svg")
"""Extensions of files with polylines in the plane."""
IMAGES = (".npy", ".nrrd", ".vti", ".nii", ".nii.gz")
"""Extensions of files that may have images of labels."""
UNITS = ("micron", "mm", "millimeter", "cm", "centimeter", "inch", "foot", "m", "meter")
"""Units of length."""
LINES = "; in the plane, polylines: .svg .csv"
"""What else is a shape, for commands that take lines."""
CONSTRAINTS = ("free", "zero-set", "hard", "each-component")
"""Names of the constraints that have no number."""


class Parser(argparse.ArgumentParser):
    """An argument parser with one-line errors that accepts negative numbers, 1e-3 included, as arguments."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._negative_number_matcher = re.compile(r"^-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$", re.IGNORECASE)

    def error(self, message: str) -> NoReturn:
        """Exit with status 2."""
        say(f"{self.prog}: {message} (see {self.prog} --help)")
        raise SystemExit(2)

    def _print_message(self, message: str, file: object = None) -> None:
        tell(message.rstrip("\n"))  # help and version, the only messages that are no errors


def add_command(
    commands: Any,
    name: str,
    run: Callable[[argparse.Namespace], Summary],
    check: Callable[[argparse.Namespace], None] | None = None,
    **texts: str,
) -> Parser:
    """Add a command with the options that all commands have.

    Parameters
    ----------
    commands : argparse subparsers
    name : str
    run : callable
        What does it, from the arguments; it returns a summary.
    check : callable, optional
        What exits with status 2 where arguments contradict each other.
    **texts
        ``help`` and ``description``.
    """
    parser: Parser = commands.add_parser(name, **texts)
    parser.set_defaults(run=run, parser=parser, check=check)
    parser.add_argument("--json", action="store_true", help="print a summary as JSON")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    return parser


def add_shape(parser: Parser, planar: str = "") -> None:
    """Add the shape that a command is about, with what it may be `planar`."""
    parser.add_argument(
        "shape", metavar="SHAPE", help=f"surface or oriented points: .stl .obj .ply .off .vtp .glb .xyz .pc{planar}"
    )


def add_format_option(parser: Parser, standard: str) -> None:
    """Add the option for what is written to standard output, last, with the format if nothing is said."""
    parser.add_argument("--format", default=standard, metavar="EXT", help=f"of standard output, with -o - ({standard})")


def add_grid_options(parser: Parser) -> None:
    """Add the options of the grid and of the computation."""
    grid = add_room_options(parser)
    grid.add_argument(
        "--origin", type=finite, nargs="+", metavar="X", help="first node of a grid of your own: X Y Z, or X Y"
    )
    grid.add_argument(
        "--shape",
        type=whole_number(2),
        nargs="+",
        metavar="NX",
        dest="grid_shape",
        help="its nodes: NX NY NZ, or NX NY",
    )
    grid.add_argument(
        "--mask",
        metavar="FILE",
        help="a grid with walls, which distance goes around (it is not sharpened then): .npy .nrrd .vti, solid where "
        "not 0; in the plane also .png .bmp .tif, solid where dark",
    )
    add_step_options(parser)
    add_method_options(parser)
    parser.add_argument("--preview", metavar="PNG", help="draw the result: in space, three slices")


def add_placing_options(parser: Parser) -> None:
    """Add the options that change the units and the place of a shape."""
    place = parser.add_argument_group("place of the shape (by default that of the file, in its units)")
    place.add_argument(
        "--units",
        type=units,
        metavar="[FROM:]TO",
        help="units of all numbers: mm, cm, m, inch, foot, micron; FROM where the file does not say its own, as .3mf "
        "and .glb do",
    )
    place.add_argument(
        "--transform", nargs="+", metavar="M", help="16 numbers of a matrix by rows, or 12, or a file of them"
    )


def units(word: str) -> str:
    """One unit, or two with a colon between."""
    for unit in word.split(":", 1):
        if unit not in UNITS:
            raise argparse.ArgumentTypeError(f"'{unit}' is none of {', '.join(UNITS)}")
    return word


def add_up_option(parser: Parser) -> None:
    """Add the option for pictures in space."""
    parser.add_argument(
        "--up", choices=["x", "y", "z"], default="z", help="axis that points upwards in the picture (z)"
    )


def add_label_option(parser: Parser) -> None:
    """Add the option for images of labels."""
    parser.add_argument(
        "--label",
        type=finite,
        metavar="N",
        help="of an image of labels (.nrrd .nii .nii.gz .vti .npy) the voxels with this one; the result lies where "
        "the image does",
    )


def add_room_options(parser: Parser) -> argparse._ArgumentGroup:
    """Add the options of a grid around a shape."""
    grid = parser.add_argument_group("grid (by default around the shape)")
    grid.add_argument("--resolution", type=whole_number(2), metavar="N", help="nodes along the longest side (128)")
    grid.add_argument(
        "--spacing", type=positive, nargs="+", metavar="H", help="distance between nodes: one, or one for each axis"
    )
    grid.add_argument("--padding", type=not_negative, metavar="P", help="room around the shape, in its units")
    grid.add_argument(
        "--band",
        type=positive,
        metavar="B",
        help="fine nodes only up to this distance from the surface, in the units of the shape, and coarse ones beyond: "
        "for grids too fine to be computed whole",
    )
    return grid


def add_many_options(parser: Parser) -> None:
    """Add the arguments of commands that make something of many shapes."""
    parser.add_argument(
        "inputs",
        metavar="FILE",
        nargs="+",
        help="files, folders with all in them, patterns in quotes; - takes a list from standard input, a line for each",
    )
    parser.add_argument("-o", "--output", required=True, metavar="FOLDER", help="results, and manifest.jsonl")
    parser.add_argument(
        "--surface", choices=("stl", "obj", "ply", "off", "vtp"), default="stl", help="files of surfaces (stl)"
    )
    parser.add_argument(
        "--workers", type=whole_number(1, MOST_WORKERS), metavar="N", help="processes (one for each processor)"
    )
    parser.add_argument("--time-limit", type=positive, metavar="S", help="seconds after which a shape is given up")


def add_tile_options(parser: Parser) -> None:
    """Add the options of a band that is computed tile by tile."""
    tiles = parser.add_argument_group("tiles of a band")
    tiles.add_argument(
        "--tiles",
        metavar="FOLDER",
        help="compute the band in tiles, which are kept in this folder: for bands larger than memory; the same command "
        "goes on where it was stopped",
    )
    tiles.add_argument(
        "--workers", type=whole_number(1, MOST_WORKERS), metavar="N", help="processes for them (threads of this one)"
    )
    tiles.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask cluster instead: tcp://host:port")


def add_solid_options(parser: Parser) -> None:
    """Add the options of distance to a solid on a grid around it, of which nothing but the solid is wanted."""
    add_room_options(parser)
    add_repair_options(parser)
    add_method_options(parser)
    parser.set_defaults(origin=None, grid_shape=None, mask=None, preview=None, plain=False)


def add_method_options(parser: Parser) -> None:
    """Add the options of the method itself."""
    method = parser.add_argument_group("method")
    method.add_argument(
        "--constraint",
        type=constraint,
        default="zero-set",
        metavar="C",
        help="free, zero-set (default), hard, each-component, soft, or soft:WEIGHT",
    )
    method.add_argument(
        "--diffusion", type=positive, default=1.0, metavar="T", help="diffusion time in squared spacings (1)"
    )


def add_step_options(parser: Parser) -> None:
    """Add the options that leave out steps which are taken by default."""
    steps = add_repair_options(parser)
    steps.add_argument("--plain", action="store_true", help="the method's own field, not measured to the shape itself")


def add_repair_options(parser: Parser) -> argparse._ArgumentGroup:
    """Add the options that take a shape as it is."""
    steps = parser.add_argument_group("steps (all taken by default)")
    steps.add_argument("--as-oriented", action="store_true", help="turn no face or normal, put back no face")
    steps.add_argument("--keep-overlaps", action="store_true", help="count what lies inside other bodies as surface")
    return steps


def add_curves(parser: Parser, output: str) -> None:
    """Add the arguments of a distance to curves on a surface, and of its output."""
    parser.add_argument(
        "mesh", metavar="MESH", help="surface, points or voxels: .obj .ply .stl .off .vtp .glb .pc .xyz .npy .nrrd .vti"
    )
    parser.add_argument("curves", metavar="CURVES", help="curves and points on it: .txt .obj .json .csv")
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help=output)
    parser.add_argument(
        "--constraint",
        type=surface_constraint,
        default="zero-set",
        metavar="C",
        help="free, zero-set (default), hard, each-component, soft, soft:WEIGHT, or levels:V,V,…, one for each curve",
    )
    parser.add_argument(
        "--diffusion",
        type=positive,
        metavar="T",
        help="diffusion time in squared spacings (1; with --plain three, extrapolated, unless curves end); larger "
        "values close gaps more roundly",
    )
    parser.add_argument(
        "--globe",
        action="store_true",
        help="the mesh is a globe, and curves are longitudes and latitudes in degrees, joined along great circles: "
        ".csv .geojson",
    )
    parser.add_argument(
        "--intrinsic",
        action="store_true",
        help="run the method on better triangles of the same surface, along whose edges the curves run; by default on "
        "better triangles where the mesh has large angles",
    )
    parser.add_argument(
        "--plain",
        action="store_true",
        help="the method's own field, of the curves as they are given, not measured to the curves themselves",
    )
    parser.add_argument("--as-oriented", action="store_true", help="turn no curve, and leave none out")
    parser.add_argument(
        "--every-piece", action="store_true", help="leave out no piece, also if it belongs to none of the others"
    )


def add_sampling_options(parser: Parser) -> None:
    """Add the options that say where samples are taken and how they are kept."""
    group = parser.add_argument_group("samples")
    group.add_argument(
        "--near", type=fraction, default=0.8, metavar="S", help="share near the surface, from 0 to 1 (.8)"
    )
    group.add_argument(
        "--widths",
        type=not_negative,
        nargs="+",
        default=[0.05, 0.0158],
        metavar="W",
        help="standard deviations of the noise, over the radius of the shape; each gets the same share (.05 .0158)",
    )
    group.add_argument("--seed", type=whole_number(0), default=0, metavar="K", help="of the random numbers (0)")
    group.add_argument("--normalize", action="store_true", help="move and scale the shape into the unit sphere")
    group.add_argument(
        "--layout",
        choices=("arrays", "deepsdf"),
        default="arrays",
        help="arrays: points, distances, gradients, …; deepsdf: pos and neg, single precision (arrays)",
    )


def constraint(word: str, with_numbers: str = "soft, soft:WEIGHT") -> str:
    """The name of a constraint, with its number if it has one; messages also name those `with_numbers`."""
    name, _, weight = word.partition(":")
    if name == "soft":
        if weight:
            positive(weight)
    elif word not in CONSTRAINTS:
        raise argparse.ArgumentTypeError(f"'{word}' is none of {', '.join(CONSTRAINTS)}, {with_numbers}")
    return word


def surface_constraint(word: str) -> str:
    """The name of a constraint, with its numbers; on surfaces also given levels."""
    name, _, values = word.partition(":")
    if name == "levels":
        for value in values.split(","):
            finite(value)
        return word
    return constraint(word, with_numbers="soft, soft:WEIGHT, levels:V,V,…")


def finite(word: str) -> float:
    """A finite number."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{word}' is no finite number")
    return value


def positive(word: str) -> float:
    """A positive number."""
    value = finite(word)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"{word} is not positive")
    return value


def not_negative(word: str) -> float:
    """A nonnegative number."""
    value = finite(word)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{word} is negative")
    return value


def fraction(word: str) -> float:
    """A number from 0 to 1."""
    value = not_negative(word)
    if value > 1:
        raise argparse.ArgumentTypeError(f"{word} is more than 1")
    return value


def whole_number(least: int, most: int | None = None) -> Callable[[str], int]:
    """A function that parses a whole number of at least `least`, and at most `most`."""
    upper = "on" if most is None else f"to {most}"

    def parse(word: str) -> int:
        is_number = re.fullmatch(r"[-+]?\d{1,4000}", word)
        if not is_number or int(word) < least or (most is not None and int(word) > most):
            raise argparse.ArgumentTypeError(f"'{word}' is no whole number from {least} {upper}")
        return int(word)

    return parse


def is_planar(path: Any) -> bool:
    """Whether a file holds polylines in the plane."""
    return Path(path).suffix.lower() in PLANAR


def refuse_together(arguments: argparse.Namespace, first: str, *others: str) -> None:
    """Exit if an option is given, and one of some others with it."""

    def is_given(option: str) -> bool:
        name = "grid_shape" if option == "--shape" else option.lstrip("-").replace("-", "_")
        return not any(getattr(arguments, name, None) is absent for absent in (None, False))

    for other in others:
        if is_given(first) and is_given(other):
            arguments.parser.error(f"{other} and {first} do not go together: give one of them")


def check_grid_options(arguments: argparse.Namespace) -> None:
    """Reject options that contradict each other, and numbers for another dimension."""
    error, own = arguments.parser.error, (arguments.origin, arguments.spacing, arguments.grid_shape)
    dimension = 2 if is_planar(getattr(arguments, "shape", "")) else 3
    for name, numbers, counts in (
        ("--spacing", arguments.spacing, (1, dimension)),
        ("--origin", arguments.origin, (dimension,)),
        ("--shape", arguments.grid_shape, (dimension,)),
    ):
        if numbers is not None and len(numbers) not in counts:
            error(f"argument {name}: {' or '.join(map(str, counts))} numbers, not {len(numbers)}")
    refuse_together(arguments, "--mask", "--resolution", "--padding", "--shape", "--band")
    refuse_together(arguments, "--origin", "--resolution", "--padding")
    refuse_together(arguments, "--spacing", "--resolution")
    refuse_together(arguments, "--band", "--plain")
    refuse_together(arguments, "--scheduler", "--workers")
    if arguments.band is not None and dimension == 2:
        error("--band is for shapes in space")
    if arguments.mask is None and (arguments.origin, arguments.grid_shape) != (None, None) and None in own:
        error("a grid of your own needs all of --origin, --spacing and --shape")


def check_tile_options(arguments: argparse.Namespace) -> None:
    """Reject tiles without a band, and workers without tiles."""
    if arguments.tiles is not None and arguments.band is None:
        arguments.parser.error("--tiles goes with --band")
    if arguments.tiles is None and (arguments.workers, arguments.scheduler) != (None, None):
        arguments.parser.error("--workers and --scheduler go with --tiles")
