"""``signedheat volume``: signed distance to a broken shape on a grid."""

from __future__ import annotations

from argparse import Namespace

from ..io import ensure_band_writable, ensure_field_writable
from ..visualization import ensure_picture_writable, save_slices
from . import tets
from .computing import Summary, compute, describe, drawable, grid_for, hint, prefix_errors
from .placing import grid_of_image, image_of, place_of, read_source, save_placed


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, write."""
    if arguments.tets is not None:
        return tets.run(arguments)
    image = image_of(arguments)
    if image is not None:
        image.ensure_writable(arguments.output)
    elif arguments.band is None:
        ensure_field_writable(arguments.output)
    else:
        ensure_band_writable(arguments.output)
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    with prefix_errors(arguments.shape):
        shape = read_source(arguments) if image is None else image.surface(arguments.label)
        grid = grid_for(shape, arguments) if image is None else grid_of_image(image, shape, arguments)
        field = compute(shape, grid, arguments)
    save_placed(field, image, arguments.output)
    if arguments.preview:
        save_slices(drawable(field), arguments.preview, shape)
    summary = {"input": arguments.shape, "output": arguments.output, **describe(field), **place_of(image)}
    nodes = " × ".join(map(str, field.grid.shape))
    there = "" if arguments.band is None else f" ({summary['nodes']:,} of them there)"
    text = f"{arguments.output}: {nodes} nodes{there}, φ from {summary['minimum']:.4g} to {summary['maximum']:.4g}"
    text += hint(field)
    return summary, text
