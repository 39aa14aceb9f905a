"""Make shapes, images, grids and fields from the arguments of a command, and write results to files."""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, overload

import numpy as np

import signedheat as sh

from ..arrays import Floats
from ..arrays import place as place
from ..constraints import Constraint
from ..diagnostics import Diagnostics, SampledSource
from ..distances import grid_around, measured_distance
from ..errors import FileFormatError, GeometryError, SignedHeatError, SourceError, counted, percent, printable
from ..grids.grid import RESOLUTION
from ..io.field_files import VALUE_FORMATS, save_with_values
from ..io.files import contents, distinct_names, extension
from ..io.image_files import CONFIDENCE, NIFTI
from ..io.key_figures import describe as describe
from ..io.numerals import parsed_numbers
from ..io.scenes import scale_to, unit_of
from ..io.solid_arrays import holds_solid
from ..jobs import reporting
from ..memory import refuse_beyond_memory
from ..solids.completion import Completing, Completion, completed
from ..solids.heat_surfaces import Heat
from ..tets.tet_discretization import memory_estimate
from .options import IMAGES, METHOD, REPAIR, is_given, is_planar, is_quiet
from .terminal import ProgressBar, say

CANCELLED_AREA = 0.9
"""Fraction of the area that may cancel. Above it, `hint_of_doubled_faces` says so."""
MOST_LABELS = 40
"""Images with at most this many different values, all whole numbers, are images of labels. Others are fields."""


@contextmanager
def prefix_errors(path: Any) -> Iterator[None]:
    """Within a ``with`` block, prefix the messages of errors that name no file with the name of the input."""
    try:
        yield
    except SignedHeatError as error:
        if error.path is not None:
            raise
        raise error.at(path) from error


def read_lines(arguments: Namespace) -> list[sh.Polyline]:
    """Read the polylines in the plane that a command measures distance to."""
    if arguments.transform is not None:
        raise SourceError("a matrix moves shapes in space, not drawings", element="--transform", path=arguments.shape)
    scale = 1.0 if arguments.units is None else unit_scale(arguments, arguments.shape)
    return [sh.Polyline(scale * line.points, line.closed) for line in sh.io.read_polylines(arguments.shape)]


def read_shape(arguments: Namespace, path: str) -> Any:
    """Read a shape in space, scaled and transformed as the options say. Voxels become their smooth surface."""
    shape = sh.read(path)
    if isinstance(shape, sh.Solid) and path == arguments.shape:
        refuse_completing(arguments)
    if isinstance(shape, sh.DigitalSurface):
        shape = shape.smooth_surface
    matrix = placement(arguments, path)
    with prefix_errors(path):
        return shape if matrix is None else sh.transform(shape, matrix)


def refuse_completing(arguments: Namespace) -> None:
    """Raise an error if options are given that have no effect on a solid, since it needs no completion."""
    for option in (*REPAIR.options, *(() if arguments.plain else METHOD.options)):
        if is_given(arguments, option.names[-1]):
            raise SourceError(
                f"{option.names[-1]} is for shapes that are completed, and a solid is complete",
                remedy="leave it out",
                element=option.names[-1],
                path=arguments.shape,
            )


def unit_in_use(arguments: Namespace, *paths: str) -> str | None:
    """Return the unit of printed and written lengths, from ``--units`` or the files; None if it is unknown.

    ``--units`` is a unit, such as mm, or two, inch:mm: that of files which state none, and that of the results.
    If only some files state a unit, or they state different ones, the first unit is stored as ``--units``, so that all
    files are scaled to it.
    """
    if arguments.units is None:
        stated = [unit_of(path) for path in paths]
        if len(set(stated)) == 1:
            return stated[0]
        arguments.units = next(filter(None, stated))
    return str(arguments.units.rpartition(":")[2])


def unit_suffix(unit: str | None, power: str = "") -> str:
    """Return the text after a length with a unit, such as ``" mm"``, or after a volume with the power ``"³"``.

    It is empty if the unit is unknown.
    """
    return "" if unit is None else f" {unit}{power}"


def solid_of(arguments: Namespace, path: str) -> Any:
    """Read a shape and complete it to a solid, as the options say, and print important notes on standard error."""
    with prefix_errors(path), ProgressBar(is_quiet(arguments)) as progress, reporting(progress):
        solid = completed(read_shape(arguments, path), *method_of(arguments))
    say_important(arguments, solid.diagnostics, path)
    return solid


def placement(arguments: Namespace, path: str) -> Floats | None:
    """Return the (4, 4) matrix that applies first ``--units``, then ``--transform``; None if neither is given."""
    if arguments.units is None and arguments.transform is None:
        return None
    matrix = np.eye(4)
    if arguments.units is not None:
        matrix[:3] *= unit_scale(arguments, path)
    if arguments.transform is not None:
        matrix = matrix_of(arguments.transform) @ matrix
    return matrix


def unit_scale(arguments: Namespace, path: str) -> float:
    """Return the factor from the unit of a file to that of ``--units``.

    It is 1 if neither the option nor the file names the unit of the file, with a message on standard error.
    """
    assumed, _, target = arguments.units.rpartition(":")
    if not assumed and unit_of(path) is None and not is_quiet(arguments):
        cause = f"{printable(path)} does not say its units"
        say(f"signedheat: {cause}: taken as {target} (else --units inch:{target})")
    return scale_to(path, arguments.units)


def matrix_of(words: list[str]) -> Floats:
    """Return the (4, 4) matrix of 16 or 12 numbers, row by row, given as words or in a text file named by one word."""
    path = words[0] if len(words) == 1 else None
    if path is not None:
        words = contents(path)[:10_000].decode("utf-8", "replace").replace(",", " ").split()
    try:
        numbers = parsed_numbers(words, "numbers")
    except FileFormatError:
        numbers = np.zeros(0)
    if len(numbers) not in (12, 16) or not np.isfinite(numbers).all():
        raise SourceError(
            "a transform has 16 numbers, or 12 without the last row",
            element="--transform",
            remedy="give them row by row",
            path=path,
        )
    matrix = np.eye(4)
    matrix[: len(numbers) // 4] = numbers.reshape(-1, 4)
    return matrix


def grid_for(
    shape: Any, arguments: Namespace, reach: float | None = None, image: sh.io.LabelImage | None = None
) -> sh.Grid:
    """Make the grid that the options describe, by default that of the image, or one around the shape.

    If the distance is needed up to `reach` from the shape, as for offsets, the default has room for that.
    """
    spacing = arguments.spacing
    if spacing is not None and len(spacing) == 1:
        spacing = spacing[0]
    if arguments.origin is not None:
        return sh.Grid(arguments.origin, spacing, arguments.grid_shape)
    if image is not None and (arguments.resolution, spacing, arguments.padding) == (None, None, None):
        if reach is None:
            return image.grid
        spacing = image.spacing
    return grid_around(shape, reach or 0.0, arguments.resolution or RESOLUTION, arguments.padding, spacing)


def constraint_of(word: str) -> Constraint:
    """Return the constraint with a name of the command line.

    Examples
    --------
    >>> constraint_of("soft:0.5")
    Soft(weight=0.5)
    """
    name, _, values = word.partition(":")
    if name == "levels":
        return sh.constraints.LevelValues([float(value) for value in values.split(",")])
    if name == "soft":
        return sh.constraints.Soft(float(values)) if values else sh.constraints.Soft()
    named: dict[str, Constraint] = {
        "free": sh.constraints.Free(),
        "zero-set": sh.constraints.ZeroSet(),
        "hard": sh.constraints.ZeroSet(hard=True),
        "each-component": sh.constraints.EachComponent(),
    }
    return named[word]


def shape_and_field(
    arguments: Namespace, image: sh.io.LabelImage | None = None, reach: float | None = None
) -> tuple[Any, sh.Field[sh.Grid]]:
    """Return the shape of a command, from a file or an image, and the distance to it on a grid.

    The grid has room for offsets up to `reach`.
    """
    with prefix_errors(arguments.shape):
        if image is not None:
            shape: Any = image.surface(arguments.label)
        else:
            shape = read_lines(arguments) if is_planar(arguments.shape) else read_shape(arguments, arguments.shape)
        return shape, compute(shape, grid_for(shape, arguments, reach, image), arguments)


def method_of(arguments: Namespace) -> tuple[Completion, Heat]:
    """Return the options of a command about completing shapes, and those about the method."""
    names = ("lids", "nested", "as_oriented", "keep_overlaps")
    completing: Completing = "none" if arguments.unsigned else "lids"
    completion = Completion(completing, **{name: getattr(arguments, name) for name in names})
    return completion, Heat(constraint_of(arguments.constraint), arguments.diffusion)


@overload
def compute(shape: Any, domain: sh.Grid, arguments: Namespace) -> sh.Field[sh.Grid]: ...
@overload
def compute(shape: Any, domain: sh.TetMesh, arguments: Namespace) -> sh.Field[sh.TetMesh]: ...
def compute(shape: Any, domain: sh.Grid | sh.TetMesh, arguments: Namespace) -> sh.Field[Any]:
    """Return the distance to a shape in space or to lines in the plane, and print important notes on standard error."""
    where: Any = (
        nullcontext(arguments.scheduler) if arguments.workers is None else ThreadPoolExecutor(arguments.workers)
    )
    with ProgressBar(is_quiet(arguments)) as progress, reporting(progress), where as scheduler:
        in_band = {"band": arguments.band, "store": arguments.tiles, "scheduler": scheduler}
        field = measured_distance(shape, domain, *method_of(arguments), arguments.plain, **in_band)
    say_important(arguments, field.diagnostics)
    return field


def say_important(arguments: Namespace, diagnostics: Diagnostics, path: str | None = None) -> None:
    """Print the important notes of a result on standard error, with the file's name if there are several files."""
    for note in () if arguments.quiet else diagnostics.important:
        say(printable(f"signedheat: {note}" if path is None else f"signedheat: {path}: {note}"))


def hint_of_doubled_faces(field: sh.Field[sh.Grid]) -> str:
    """Return a further line of output if most faces seem to be given twice, or else an empty text."""
    note = field.diagnostics.note(SampledSource)
    cancelled = note.area_cancelled if note else 0.0
    if cancelled < CANCELLED_AREA:
        return ""
    return (
        f"\n{percent(cancelled)} of the area lies within a cell of area that faces the other way, as on thin sheets: "
        "if faces are doubled, remove one copy"
    )


def range_in_words(summary: dict[str, Any], unit: str | None) -> str:
    """Return a text with the least and the greatest value of a field, which `describe` summarized."""
    return f"φ from {summary['minimum']:.4g} to {summary['maximum']:.4g}{unit_suffix(unit)}"


def shape_and_field_on_tets(arguments: Namespace) -> tuple[Any, sh.Field[sh.TetMesh]]:
    """Return the shape of a command, and the distance to it on tets from a file or around the shape."""
    shape, mesh = read_shape(arguments, arguments.shape), sh.read(arguments.tets) if arguments.tets else None
    if mesh is not None and not isinstance(mesh, sh.TetMesh):
        raise GeometryError(
            f"{arguments.tets} holds no tets, but a {type(mesh).__name__}",
            remedy="use a .mesh, .msh, .vtu or .ele file",
        )
    with prefix_errors(arguments.shape):
        if mesh is None:
            resolution = arguments.resolution or 32
            mesh = sh.tetrahedralize(shape, resolution=resolution, padding=arguments.padding)
            n = mesh.n_tets
            refuse_beyond_memory(  # the number of tets grows at least with the square of the resolution
                f"distance on {counted(n, 'tet')}",
                n,
                memory_estimate,
                lambda fits: f"lower the resolution from {resolution} to {int(resolution * math.sqrt(fits / n))}",
            )
        return shape, compute(shape, mesh, arguments)


def field_or_image(path: str) -> Any:
    """Read the field or the image in a file; return None if the file holds neither.

    Images are those of labels, and values along axes that are not x, y, z.
    """
    ending = extension(path)
    alone = ending == ".npy" and not Path(path).with_suffix(".json").is_file()
    if ending in NIFTI or alone:
        image = sh.io.read_labels(path)
        labels = labels_of(image) if alone else None
        return None if labels and set(labels) <= {0, 1} else image  # a set of voxels is a shape
    if ending not in sh.io.FIELD_FORMATS or (ending == ".npz" and holds_solid(path)):
        return None
    if ending not in IMAGES:
        return sh.read_field(path)
    try:
        image = sh.io.read_labels(path)
    except FileFormatError:  # it holds a field in the plane, or no field
        return sh.read_field(path)
    along = np.array_equal(image.axes, np.diag(image.spacing))
    return sh.read_field(path) if along and image.labels.dtype.kind == "f" else image


def image_of(arguments: Namespace) -> sh.io.LabelImage | None:
    """Read the image of labels of a command, scaled and transformed as the options say; None if it is no image."""
    if extension(arguments.shape) not in IMAGES:
        if arguments.label is not None:
            raise SourceError("only images have labels", element="--label", remedy="leave it out", path=arguments.shape)
        return None
    image, matrix = sh.io.read_labels(arguments.shape), placement(arguments, arguments.shape)
    if matrix is None:
        return image
    linear, shift = matrix[:3, :3], matrix[:3, 3]
    with prefix_errors(arguments.shape):
        return sh.io.LabelImage(image.labels, linear @ image.axes, linear @ image.origin + shift, image.space)


def labels_of(image: sh.io.LabelImage) -> list[int] | None:
    """Return the distinct labels of an image, or None if its values are not few whole numbers, as those of fields."""
    values = image.labels.astype(np.int8) if image.labels.dtype == bool else image.labels
    distinct = np.unique(values[np.isfinite(values)])
    if len(distinct) > MOST_LABELS or (distinct != np.round(distinct)).any():
        return None
    return [int(label) for label in distinct]


def field_of(image: sh.io.LabelImage) -> sh.Field[sh.Grid]:
    """Return the values of an image as a field on its own grid, along the axes of the image."""
    return sh.Field(image.grid, image.labels.astype(np.float64))


def field_or_boundary(image: sh.io.LabelImage) -> sh.Field[sh.Grid] | sh.PolygonMesh:
    """Return an image as a field or, if it has labels, the boundary of all voxels with labels other than 0.

    Both are in coordinates along the axes of the image.
    """
    if labels_of(image) is None:
        return field_of(image)
    return sh.DigitalSurface(image.labels != 0, image.spacing).squares


def position_figures(image: sh.io.LabelImage | None) -> dict[str, Any]:
    """Return the axes, origin and space of an image, for ``--json``; an empty dictionary without an image."""
    if image is None:
        return {}
    return {"image": {"axes": image.axes.tolist(), "origin": image.origin.tolist(), "space": image.space}}


def ensure_surface_writable(path: str, planar: bool = False) -> None:
    """Raise an error if a surface, or polylines in the plane, cannot be written, before a long computation."""
    if planar:
        sh.io.ensure_writable(path, sh.io.POLYLINE_FORMATS, "lines in the plane")
    else:
        sh.io.ensure_writable(path, sh.io.SHAPE_FORMATS - {".xyz", ".pc"}, "a surface")


def save_level(
    level_set: Any, path: str, image: sh.io.LabelImage | None = None, field: sh.Field[sh.Grid] | None = None
) -> None:
    """Write a level set, which is a surface in space or polylines in the plane.

    A surface from an image is mapped to the world. If its field has a confidence and the format supports it, the
    confidence at each vertex is written, too.
    """
    if isinstance(level_set, list):
        return sh.io.write_polylines(level_set, path)
    placed = level_set if image is None else image.to_world(level_set)
    if field is not None and field.confidence is not None and extension(path) in VALUE_FORMATS:
        save_with_values(placed, path, CONFIDENCE, field.confidence_at(level_set.vertices))
    else:
        sh.save(placed, path)


def sizes_of(level_set: Any) -> dict[str, Any]:
    """Return numbers of vertices and faces of a surface, or the number and length of polylines in the plane."""
    if isinstance(level_set, list):
        closed = sum(line.closed for line in level_set)
        return {"lines": len(level_set), "closed": closed, "length": float(sum(line.length for line in level_set))}
    return {"vertices": level_set.n_vertices, "faces": level_set.n_faces}


def output_names(output: str, distances: list[float]) -> list[str]:
    """Return a name of a file for each distance: the given one for a single distance, or with the distance in it."""
    return [output] if len(distances) == 1 else [named_after(output, number) for number in distinct_names(distances)]


def named_after(output: str, part: str) -> str:
    """Return the name of an output with an underscore and a further part before its extension."""
    path = Path(output)
    if not path.name:  # what does not name a file is refused later
        return output
    return str(path.with_name(f"{path.stem}_{part}{path.suffix}"))
