"""Declarations of commands: options as data next to the function that runs them, and the parser built from them.

This module does not import NumPy, so that help and errors of usage appear at once.
"""

from __future__ import annotations

import argparse
import math
import os
import re
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from .. import __version__
from ..errors import LONGEST_QUOTE, FileFormatError, refuse_deleted_folder, shortened
from ..jobs import MOST_THREADS
from .terminal import say, write_out

Summary: TypeAlias = tuple[dict[str, Any], str]
"""The result of a command: a dictionary for ``--json``, and text."""
Run: TypeAlias = Callable[[Namespace], Summary]
"""Function that runs a command."""
Check: TypeAlias = Callable[[Namespace], None]
"""Function that exits with an error if arguments of a command contradict each other, and may complete them."""

PLANAR = (".csv", ".dxf", ".geojson", ".svg")
"""Extensions of files with polylines in the plane."""
IMAGES = (".npy", ".nrrd", ".vti", ".nii", ".nii.gz")
"""Extensions of files that may hold images of labels."""
SURFACES = "surface: .stl .obj .ply .off .vtp"
"""Help for an output that is a surface."""
LENGTH_UNITS = ("micron", "mm", "millimeter", "cm", "centimeter", "inch", "foot", "m", "meter")
"""Names of units of length."""
CONSTRAINTS = ("free", "zero-set", "hard", "each-component", "soft", "soft:WEIGHT")
"""Names of the constraints except ``levels:V,V,…``, as errors list them."""


COMMANDS_OF_OTHERS = {
    "cap": "cut or fill",
    "boolean": "union, intersect or subtract",
    "check": "info",
    "clean": "watertight",
    "compare": "deviation",
    "difference": "subtract",
    "dilate": "morph",
    "distance": "volume",
    "erode": "morph",
    "fill-holes": "fill",
    "fill_holes": "fill",
    "fix": "watertight",
    "heal": "watertight",
    "hollow": "morph",
    "intersection": "intersect",
    "make-solid": "watertight",
    "wrap": "watertight",
    "isosurface": "contour",
    "manifold": "watertight",
    "plot": "view",
    "repair": "watertight",
    "sdf": "volume",
    "shell": "morph",
    "slice": "section",
    "split": "cut",
    "trim": "cut",
    "show": "view",
    "thicken": "morph",
    "voxelize": "volume",
}
"""Commands to suggest, by names that other programs have for them."""


class Parser(argparse.ArgumentParser):
    """An argument parser with one-line errors."""

    def error(self, message: str) -> NoReturn:
        """Print an error in one line, with a suggestion for commands of other programs, and exit with status 2."""
        unknown = re.search(r"COMMAND: invalid choice: '([^']*)'", message)
        if unknown and unknown[1] in COMMANDS_OF_OTHERS:
            message = f"there is no command '{unknown[1]}': use {COMMANDS_OF_OTHERS[unknown[1]]}"
        words = (word if len(word) <= LONGEST_QUOTE else f"{word[: LONGEST_QUOTE - 1]}…" for word in message.split(" "))
        say(f"{self.prog}: {shortened(' '.join(words))} (see {self.prog} --help)")
        raise SystemExit(2)

    def parse_known_args(self, *args: Any, **kwargs: Any) -> Any:
        """Parse arguments; what a command does not know is an error of this command, whose help lists what it knows."""
        known, others = super().parse_known_args(*args, **kwargs)
        if others:
            self.error(f"unrecognized arguments: {' '.join(others)}")
        return known, others

    def _print_message(self, message: str, file: object = None) -> None:
        """Print help by `write_out`, whatever the file."""
        write_out(message.rstrip("\n"))  # only help and version; errors go through `error`


@dataclass(frozen=True)
class Option:
    """An argument of a command: its names and its settings for argparse."""

    names: tuple[str, ...]
    settings: Mapping[str, Any]

    @property
    def attribute(self) -> str:
        """The name of the attribute that has the value of the option in the parsed arguments."""
        return str(self.settings.get("dest", self.names[-1].lstrip("-").replace("-", "_")))

    @property
    def default(self) -> Any:
        """The value of the option where it is not given."""
        return self.settings.get("default", False if self.settings.get("action") == "store_true" else None)


@dataclass(frozen=True)
class Group:
    """Options under a common title."""

    title: str
    options: tuple[Option, ...]


@dataclass(frozen=True)
class Command:
    """A command, as the decorator `command` declares it."""

    name: str
    run: Run
    help: str  # one line in the list of commands
    description: str  # in the help of the command
    options: tuple[Option | Group, ...] = ()  # its own, in the order of the help
    check: Check | None = None
    usage: str | None = None  # what follows the name of the command in the first line of its help

    @property
    def declared(self) -> dict[str, Option]:
        """All options of the command, and those that all commands have, keyed by the last of their names."""
        groups = (entry.options if isinstance(entry, Group) else (entry,) for entry in (*COMMON, *self.options))
        return {option.names[-1]: option for options in groups for option in options}

    def add_to(self, commands: Any) -> None:
        """Add the command to the subparsers of an argparse parser."""
        parser = commands.add_parser(self.name, help=self.help, description=self.description)
        if self.usage is not None:
            parser.usage = f"%(prog)s {self.usage}"
        parser.set_defaults(**ABSENT, command=self, parser=parser)
        for entry in (*COMMON, *self.options):
            section = parser.add_argument_group(entry.title) if isinstance(entry, Group) else parser
            for argument in entry.options if isinstance(entry, Group) else (entry,):
                section.add_argument(*argument.names, **{"default": argument.default, **argument.settings})


def command(
    name: str,
    help: str,
    description: str,
    *options: Option | Group,
    check: Check | None = None,
    usage: str | None = None,
) -> Callable[[Run], Command]:
    """Return a decorator that makes a command of the function that runs it.

    Parameters
    ----------
    name : str
        The name of the command.
    help, description : str
        Its line in the list of commands, and the text in its own help.
    *options : Option or Group
        Its options in the order of the help, after those that all commands have.
    check : callable, optional
        A function that exits with status 2 if arguments contradict each other in ways that `refuse_contradictions`
        does not know.
    usage : str, optional
        What follows the name of the command in the first line of its help.
    """
    return lambda run: Command(name, run, help, description, options, check, usage)


def parser_of(commands: Iterable[Command]) -> Parser:
    """Return the parser of the whole command line."""
    parser = Parser(
        prog="signedheat",
        description="Generalized signed distance to broken geometry: negative inside, positive outside, "
        "in the units of the file.",
    )
    parser.add_argument("--version", action="version", version=f"signedheat {__version__}")
    subparsers = parser.add_subparsers(metavar="COMMAND", parser_class=Parser)
    for declared in commands:
        declared.add_to(subparsers)
    return parser


def without_exponents(words: Iterable[str]) -> list[str]:
    """Return words with negative numbers such as -1e-3 in plain digits, since argparse mistakes these for options.

    Examples
    --------
    >>> without_exponents(["offset", "-1e-3", "-2.5e1", "--quiet"])
    ['offset', '-0.001', '-25.0', '--quiet']
    """
    is_number = re.compile(r"-([0-9]+(\.[0-9]*)?|\.[0-9]+)(e[-+]?[0-9]+)?", re.IGNORECASE).fullmatch
    return [format(Decimal(repr(float(word))), "f") if is_number(word) else word for word in words]


def option(*names: str, **settings: Any) -> Option:
    """Declare an option or an argument, with its settings for argparse."""
    return Option(names, settings)


def group(title: str, *options: Option) -> Group:
    """Declare options under a common title."""
    return Group(title, options)


INPUT_ARGUMENTS = ("shape", "mesh", "field", "file", "files", "inputs", "curves", "scan", "nominal", "tets")
"""Arguments that may name an input file."""


def refuse_output_over_input(arguments: Namespace) -> None:
    """Raise `FileFormatError` if an output file is also an input."""
    inputs, outputs = (
        [name for argument in listed for name in _names(getattr(arguments, argument, None)) if name != "-"]
        for listed in (INPUT_ARGUMENTS, ("output",))
    )
    for name in inputs + outputs:
        refuse_deleted_folder(name)
    for written in outputs:
        for read in inputs:
            if os.path.realpath(written) == os.path.realpath(read) and not os.path.isdir(read):
                raise FileFormatError("the output would replace the input", remedy="name another file", path=written)


def refuse_unused_formats(arguments: Namespace) -> None:
    """Exit with an error if the format of standard input or output is given, and that stream is not used."""
    streams = (("--from", ("shape", "mesh", "field", "file", "files"), "input"), ("--format", ("output",), "output"))
    for option, names, stream in streams:
        named = [path for name in names for path in _names(getattr(arguments, name, None))]
        if is_given(arguments, option) and "-" not in named:
            arguments.parser.error(f"{option} is the format of standard {stream}: name it -")


def _names(value: Any) -> list[str]:
    """Return those strings in the value of an argument, a string or a list, that can be names of files."""
    values = value if isinstance(value, list) else [value]
    return [name for name in values if isinstance(name, str) and name and "\0" not in name]


def output(help: str, metavar: str = "OUT") -> Option:
    """Return the option ``-o`` that names the output, with its help."""
    return option("-o", "--output", required=True, metavar=metavar, help=help)


def format_option(standard: str) -> Option:
    """Return the option ``--format`` of standard output; `standard` is its default."""
    return option(
        "--format", default=standard, metavar="EXT", help=f"format of standard output (-o -), {standard} by default"
    )


def is_quiet(arguments: Namespace) -> bool:
    """Whether to print nothing but the result."""
    return bool(arguments.quiet or arguments.json)


def finite(word: str) -> float:
    """Parse a finite number, for argparse."""
    try:
        value = float(word) if word.isascii() and "_" not in word else math.nan  # Python reads 1_0, and other scripts
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{word}' is not a finite number")
    return value


def ending(word: str) -> str:
    """Check that a word is an extension of files, and return it without its first dot."""
    if not re.fullmatch(r"\.?\w{1,20}(\.gz)?", word):
        raise argparse.ArgumentTypeError(f"{word!r} is not an extension of a file")
    return word.removeprefix(".")


def bounded(fault: str, is_within: Callable[[float], bool]) -> Callable[[str], float]:
    """Return a function that parses finite numbers for which `is_within` holds. Errors for others name the fault."""

    def parse(word: str) -> float:
        value = finite(word)
        if not is_within(value):
            raise argparse.ArgumentTypeError(f"{word} is {fault}")
        return value

    return parse


positive = bounded("not positive", lambda value: value > 0)
not_negative = bounded("negative", lambda value: value >= 0)
fraction = bounded("less than 0 or more than 1", lambda value: 0 <= value <= 1)


def whole_number(least: int, most: int | None = None) -> Callable[[str], int]:
    """Return a function that parses whole numbers from `least` to `most`."""
    upper = "on" if most is None else f"to {most}"

    def parse(word: str) -> int:
        is_number = re.fullmatch("[-+]?[0-9]{1,4000}", word)
        if not is_number or int(word) < least or (most is not None and int(word) > most):
            raise argparse.ArgumentTypeError(f"'{word}' is not a whole number from {least} {upper}")
        return int(word)

    return parse


def units(word: str) -> str:
    """Return a word if it is a unit, or two units separated by a colon; otherwise raise an error for argparse."""
    for unit in word.split(":", 1):
        if unit not in LENGTH_UNITS:
            raise argparse.ArgumentTypeError(f"'{unit}' is not one of {', '.join(LENGTH_UNITS)}")
    return word


def constraint(word: str, known: tuple[str, ...] = CONSTRAINTS) -> str:
    """Return a word if it names one of the known constraints, or a soft one with a positive weight; else raise."""
    name, _, weight = word.partition(":")
    if name == "soft":
        if weight:
            positive(weight)
    elif word not in known:
        raise argparse.ArgumentTypeError(f"'{word}' is not one of {', '.join(known)}")
    return word


def surface_constraint(word: str) -> str:
    """Return a word if it names a constraint on curves, which may also be ``levels:V,V,…``; else raise an error."""
    name, _, values = word.partition(":")
    if name == "levels":
        for value in values.split(","):
            finite(value)
        return word
    return constraint(word, (*CONSTRAINTS, "levels:V,V,…"))


def shape_option(planar: str = "") -> Option:
    """Return the argument for the shape of a command; `planar` is more help about drawings in the plane."""
    return option(
        "shape", metavar="SHAPE", help=f"surface or oriented points: .stl .obj .ply .off .vtp .glb .xyz .pc{planar}"
    )


FLAT_SHAPE = shape_option("; in the plane, polylines: .svg .csv .dxf .geojson")
UP = option("--up", choices=["x", "y", "z"], default="z", help="axis that points up in the picture (z)")
LABEL = option(
    "--label",
    type=finite,
    metavar="N",
    help="in an image of labels (.nrrd .nii .nii.gz .vti .npy), take the voxels with this one; the result has the "
    "coordinates of the image",
)
UNITS_OPTION = option(
    "--units",
    type=units,
    metavar="[FROM:]TO",
    help="units of all numbers: mm, cm, m, inch, foot, micron; FROM: units of files that do not state theirs, as .3mf, "
    ".glb and .step do",
)
PLACE = group(
    "position of the shape (by default that of the file, in its units)",
    UNITS_OPTION,
    option("--transform", nargs="+", metavar="M", help="16 numbers of a matrix by rows, or 12, or a file of them"),
)
GRID_AROUND = group(
    "grid (by default around the shape)",
    option("--resolution", type=whole_number(2), metavar="N", help="nodes along the longest side (128)"),
    option(
        "--spacing", type=positive, nargs="+", metavar="H", help="distance between nodes: one, or one for each axis"
    ),
    option("--padding", type=not_negative, metavar="P", help="margin around the shape, in its units"),
    option(
        "--band",
        type=positive,
        metavar="B",
        help="fine nodes only within this distance of the surface, in the units of the shape, and coarse nodes beyond: "
        "for very fine grids",
    ),
)
GRID = group(
    GRID_AROUND.title,
    *GRID_AROUND.options,
    option("--origin", type=finite, nargs="+", metavar="X", help="first node of a custom grid: X Y Z, or X Y"),
    option(
        "--shape",
        type=whole_number(2),
        nargs="+",
        metavar="NX",
        dest="grid_shape",
        help="number of its nodes: NX NY NZ, or NX NY",
    ),
)
LIDS_OPTION = option(
    "--lids",
    choices=("bent", "flat"),
    default="bent",
    help="patches continue the curvature of the surface, or are flat, as for half models and hulls",
)
REPAIR = group(
    "steps (all done by default)",
    option("--as-oriented", action="store_true", help="flip no faces, normals or lines, and leave out no lines"),
    option("--keep-overlaps", action="store_true", help="keep surfaces that lie inside other bodies"),
    LIDS_OPTION,
    option(
        "--nested",
        choices=("given", "cavities", "bodies"),
        default="given",
        help="closed bodies inside others are oriented as given, cavities as in slicers, or bodies",
    ),
)
UNSIGNED_OPTION = option(
    "--unsigned",
    action="store_true",
    help="unsigned distance to what is there, with nothing completed: to clothes, other sheets, and lines",
)
COMPLETION_STEPS = group(
    REPAIR.title,
    *REPAIR.options,
    UNSIGNED_OPTION,
    option("--plain", action="store_true", help="the method's own field, not measured to the shape itself"),
)
METHOD = group(
    "method (completes points and triangles that scatter; patches complete other shapes, unless with --plain)",
    option(
        "--constraint",
        type=constraint,
        default="zero-set",
        metavar="C",
        help="free, zero-set (default), hard, each-component, soft, or soft:WEIGHT",
    ),
    option("--diffusion", type=positive, default=1.0, metavar="T", help="diffusion time in squared spacings (1)"),
)
SCHEDULER = option("--scheduler", metavar="ADDRESS", help="a running Dask cluster instead: tcp://host:port")


PLANE = group(
    "plane",
    option("--origin", type=finite, nargs=3, metavar=("X", "Y", "Z"), help="a point of it (the middle of the shape)"),
    option("--normal", type=finite, nargs=3, metavar=("X", "Y", "Z"), default=[0.0, 0.0, 1.0], help="its normal (z)"),
)


def workers(help: str) -> Option:
    """Return the option for the number of processes or threads."""
    return option("--workers", type=whole_number(1, MOST_THREADS), metavar="N", help=help)


TILES = group(
    "tiles of a band",
    option(
        "--tiles",
        metavar="FOLDER",
        help="compute the band in tiles and store them in this folder, for bands larger than memory; the same command "
        "resumes after a stop",
    ),
    workers("threads that compute them (one for each processor)"),
    SCHEDULER,
)
SLICES = option("--preview", metavar="PNG", help="draw the result: in space, three slices")
SAMPLING = group(
    "samples",
    option("--near", type=fraction, default=0.8, metavar="S", help="fraction near the surface, from 0 to 1 (0.8)"),
    option(
        "--widths",
        type=not_negative,
        nargs="+",
        default=[0.05, 0.0158],
        metavar="W",
        help="standard deviations of the noise, relative to the radius of the shape, used equally (0.05 0.0158)",
    ),
    option("--seed", type=whole_number(0), default=0, metavar="K", help="seed of the random numbers (0)"),
    option("--normalize", action="store_true", help="move and scale the shape into the unit sphere"),
    option(
        "--layout",
        choices=("arrays", "deepsdf"),
        default="arrays",
        help="arrays: points, distances, gradients, …; deepsdf: pos and neg, single precision (arrays)",
    ),
)


def is_planar(path: Any) -> bool:
    """Whether the extension of a file is one of polylines in the plane."""
    return Path(path).suffix.lower() in PLANAR


COMMON = (
    option("--json", action="store_true", help="print a summary as JSON"),
    option("--quiet", action="store_true", help="print nothing but errors"),
    option(
        "--from",
        type=ending,
        dest="input_format",
        metavar="EXT",
        help="format of standard input, where - stands for a file",
    ),
)
"""Options of all commands."""
SHARED = (LABEL, SLICES, *(entry for part in (PLACE, GRID, COMPLETION_STEPS, METHOD, TILES) for entry in part.options))
"""Options that functions for several commands read."""
ABSENT: Mapping[str, Any] = {"operation": "", "shape": "", **{option.attribute: option.default for option in SHARED}}
"""Values of these options for commands that lack them, so that all commands can share these functions."""
DRAWING, THICKEN = "a drawing", "thicken"
"""Names, in the tables below, of an input that is a drawing in the plane and of the operation of `morph`."""
WITHOUT_COMPLETION = ("--plain", "--constraint each-component", "--constraint levels")
"""Options with which shapes or curves are not completed before the method runs."""
ONLY_WITH = {
    "--tiles": "--band",
    **dict.fromkeys(("--workers", "--scheduler"), "--tiles"),
    **dict.fromkeys(("--near", "--widths", "--seed", "--normalize", "--layout"), "--sample"),
    "--surface": "--offset",
    "--up": "--preview",
}
"""The option that another one needs to have an effect, in commands that have both."""
EXCLUDED = {
    "--spacing": ("--resolution",),
    "--origin": ("--resolution", "--padding"),
    "--scheduler": ("--workers",),
    "--tets": ("--spacing", "--origin", "--shape", "--band", "--label"),
    "--every-piece": WITHOUT_COMPLETION,
    "--unsigned": (
        "--plain",
        "--constraint",
        "--diffusion",
        "--as-oriented",
        "--every-piece",
        "--keep-overlaps",
        "--lids",
        "--nested",
        THICKEN,
    ),
}
"""Options that contradict each option, named as for `is_given`."""
WITHOUT_SOLIDS = {
    **dict.fromkeys(("--band", "--lids", "--nested", "--keep-overlaps"), (*WITHOUT_COMPLETION, DRAWING, THICKEN)),
    **dict.fromkeys(("--as-oriented", "--plain", "--constraint", "--diffusion"), (THICKEN,)),
}
"""Options and inputs, named as for `is_given`, with which no solid is made, for each option about solids."""


def is_given(arguments: Namespace, named: str) -> bool:
    """Whether an option, an operation or an input is among the arguments.

    It is named like ``--option``, like ``--option value`` with the beginning of its value, like an operation of
    `morph`, or `DRAWING` for an input that is a drawing.
    """
    if not named.startswith("-"):
        return named in (arguments.operation, DRAWING if is_planar(arguments.shape or "") else None)
    name, _, beginning = named.partition(" ")
    option = arguments.command.declared.get(name)
    value = None if option is None else getattr(arguments, option.attribute)
    return option is not None and (str(value).startswith(beginning) if beginning else value is not option.default)


def refuse_together(arguments: Namespace, name: str, others: Iterable[str]) -> None:
    """Exit with an error if an option is given together with one of others, named as for `is_given`."""
    for other in others:
        if is_given(arguments, name) and is_given(arguments, other):
            arguments.parser.error(f"{name} and {other} do not go together: give one of them")


def refuse_contradictions(arguments: Namespace) -> None:
    """Exit with an error if an option contradicts another one, needs another one, or has a wrong number of values."""
    error, declared = arguments.parser.error, arguments.command.declared
    for name in (name for name in declared if is_given(arguments, name)):
        refuse_together(arguments, name, EXCLUDED.get(name, ()))
        for other in WITHOUT_SOLIDS.get(name, ()):
            if is_given(arguments, other):
                error(f"{name} is for solids, and {other} uses none")
        needed = ONLY_WITH.get(name, name)
        if needed in declared and not is_given(arguments, needed):
            error(f"{name} goes with {needed}")
    dimension = 2 if is_given(arguments, DRAWING) else 3
    for name, counts in (("--spacing", (1, dimension)), ("--origin", (dimension,)), ("--shape", (dimension,))):
        numbers = getattr(arguments, declared[name].attribute) if name in declared else None
        if isinstance(numbers, list) and len(numbers) not in counts:
            error(f"argument {name}: {' or '.join(map(str, counts))} numbers, not {len(numbers)}")
    own_grid = (arguments.origin, arguments.spacing, arguments.grid_shape)
    if "--spacing" in declared and own_grid[::2] != (None, None) and None in own_grid:
        error("a custom grid needs all of --origin, --spacing and --shape")
