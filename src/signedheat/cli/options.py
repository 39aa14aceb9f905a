"""Options that several commands share, and their conversion to numbers and constraints."""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Callable
from typing import Any, NoReturn

from ..constraints import Constraint, EachComponent, Free, Soft, ZeroSet

Summary = tuple[dict[str, Any], str]
"""The result of a command: a dictionary for ``--json``, and text."""


class Parser(argparse.ArgumentParser):
    """An argument parser with one-line errors that accepts negative numbers, 1e-3 included, as arguments."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._negative_number_matcher = re.compile(r"^-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$", re.IGNORECASE)

    def error(self, message: str) -> NoReturn:
        """Exit with status 2."""
        print(f"{self.prog}: {message} (see {self.prog} --help)", file=sys.stderr)
        raise SystemExit(2)


def add_command(commands: Any, name: str, run: Callable[..., Summary], help: str, description: str) -> Parser:
    """Add a command with the options that all commands have."""
    parser = commands.add_parser(name, help=help, description=description)
    parser.set_defaults(run=run)
    parser.add_argument("--json", action="store_true", help="print a summary as JSON")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    return parser


def add_grid_options(parser: Parser) -> None:
    """Add the options of the grid and of the computation."""
    grid = parser.add_argument_group("grid (by default around the shape)")
    grid.add_argument("--resolution", type=whole_number(2), metavar="N", help="nodes along the longest side (128)")
    grid.add_argument(
        "--spacing", type=positive, nargs="+", metavar="H", help="distance between nodes: one, or one for each axis"
    )
    grid.add_argument("--padding", type=not_negative, metavar="P", help="room around the shape, in its units")
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
    method = parser.add_argument_group("method")
    method.add_argument(
        "--constraint",
        type=constraint,
        default=ZeroSet(),
        metavar="C",
        help="free, zero-set (default), hard, each-component, or soft:WEIGHT",
    )
    method.add_argument(
        "--diffusion", type=positive, default=1.0, metavar="T", help="diffusion time in squared spacings (1)"
    )
    parser.add_argument("--preview", metavar="PNG", help="draw the result: in space, three slices")


def add_step_options(parser: Parser) -> None:
    """Which of the steps that are taken by default are left out."""
    steps = parser.add_argument_group("steps (all taken by default)")
    steps.add_argument("--as-oriented", action="store_true", help="turn no face and no normal: take them as given")
    steps.add_argument("--keep-overlaps", action="store_true", help="count what lies inside other bodies as surface")
    steps.add_argument(
        "--plain",
        action="store_true",
        help="the method's own field, not measured to the shape itself",
    )


def constraint(word: str, with_numbers: str = "soft:WEIGHT") -> Constraint:
    """A constraint from its name on the command line; messages also name those `with_numbers`."""
    name, _, weight = word.partition(":")
    known = {"free": Free(), "zero-set": ZeroSet(), "hard": ZeroSet(hard=True), "each-component": EachComponent()}
    if name == "soft":
        return Soft(positive(weight))
    if word not in known:
        raise argparse.ArgumentTypeError(f"'{word}' is none of {', '.join(known)}, {with_numbers}")
    return known[word]


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


def whole_number(least: int) -> Callable[[str], int]:
    """A function that parses a whole number of at least `least`."""

    def parse(word: str) -> int:
        if not re.fullmatch(r"[-+]?\d+", word) or int(word) < least:
            raise argparse.ArgumentTypeError(f"'{word}' is no whole number from {least} on")
        return int(word)

    return parse
