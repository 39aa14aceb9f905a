"""Shapes from files, in the units and the place that are asked for."""

from __future__ import annotations

from argparse import Namespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..domains.digital_surface import DigitalSurface
from ..domains.grid import Grid, room_around
from ..domains.transforms import transform
from ..errors import FileFormatError, SourceError
from ..fields.grid_field import GridField
from ..io import read, read_polylines
from ..io.files import contents
from ..io.labels import LabelImage, format_of, read_labels
from ..io.three_mf import METRES, unit_of
from ..lowering.area_elements import bounds_around
from ..solver import as_list
from .computing import grid_for, prefix_errors
from .options import IMAGES, is_planar


def read_source(arguments: Namespace) -> Any:
    """The source: a shape in space, placed, or a list of polylines in the plane."""
    path = arguments.shape
    if is_planar(path):
        return read_polylines(path)
    shape = read(path)
    if isinstance(shape, DigitalSurface):
        shape = shape.squares
    matrix = placement(arguments)
    if matrix is None:
        return shape
    with prefix_errors(path):
        return transform(shape, matrix)


def placement(arguments: Namespace) -> NDArray[np.float64] | None:
    """The map that ``--units`` and ``--transform`` ask for, units first; None if neither is given."""
    if arguments.units is None and arguments.transform is None:
        return None
    matrix = np.eye(4)
    if arguments.units is not None:
        own, _, wanted = arguments.units.rpartition(":")
        own = own or unit_of(arguments.shape)
        if own is None:
            raise FileFormatError(
                "the file does not say its units", remedy=f"name both: --units mm:{wanted}", path=arguments.shape
            )
        matrix[:3] *= METRES[own] / METRES[wanted]
    if arguments.transform is not None:
        matrix = matrix_of(arguments.transform) @ matrix
    return matrix


def matrix_of(words: list[str]) -> NDArray[np.float64]:
    """(4, 4) from 16 or 12 numbers, row by row, or from a text file that has them."""
    if len(words) == 1:
        words = contents(words[0])[:10_000].decode("utf-8", "replace").replace(",", " ").split()
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) not in (12, 16) or not np.isfinite(numbers).all():
        raise SourceError(
            "a transform has 16 numbers, or 12 without the last row", element="--transform", remedy="give them by rows"
        )
    matrix = np.eye(4)
    matrix[: len(numbers) // 4] = numbers.reshape(-1, 4)
    return matrix


def image_of(arguments: Namespace) -> LabelImage | None:
    """The image of labels that the command is about, if it is about one."""
    if format_of(arguments.shape) not in IMAGES:
        return None
    image = read_labels(arguments.shape)
    if image.labels.size and arguments.label is None and image.labels.dtype == bool:
        return LabelImage(image.labels.astype(np.uint8), image.axes, image.origin, image.space)
    return image


def grid_of_image(image: LabelImage, shape: Any, arguments: Namespace, reach: float | None = None) -> Grid:
    """The grid of the options; by default that of the image, with room for offsets up to `reach` around the shape."""
    if any(given is not None for given in (arguments.resolution, arguments.spacing, arguments.padding)):
        return grid_for(shape, arguments, reach or 0.0)
    if reach is None:
        return image.grid
    bounds = bounds_around(as_list(shape))
    return Grid.around(bounds, padding=room_around(bounds, reach), spacing=image.spacing)


def place_of(image: LabelImage | None) -> dict[str, Any]:
    """Where an image is, for ``--json``."""
    if image is None:
        return {}
    return {"image": {"axes": image.axes.tolist(), "origin": image.origin.tolist(), "space": image.space}}


def save_placed(field: Any, image: LabelImage | None, output: str) -> None:
    """Write a field, into the place of an image if it comes from one."""
    if image is None:
        field.save(output)
    else:
        image.save(cast("GridField", field), output)
