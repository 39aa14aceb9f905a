"""``signedheat volume``: signed distance to a broken shape on a grid."""

from __future__ import annotations

from argparse import Namespace

from ..io import ensure_band_writable, ensure_field_writable
from ..visualization import ensure_picture_writable, save_slices
from . import tets
from .computing import Summary, compute, describe, drawable, grid_for, hint, prefix_errors, read_source


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, write."""
    if arguments.tets is not None:
        return tets.run(arguments)
    if arguments.band is None:
        ensure_field_writable(arguments.output)
    else:
        ensure_band_writable(arguments.output)
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    shape = read_source(arguments.shape)
    with prefix_errors(arguments.shape):
        field = compute(shape, grid_for(shape, arguments), arguments)
    field.save(arguments.output)
    if arguments.preview:
        save_slices(drawable(field), arguments.preview, shape)
    summary = {"input": arguments.shape, "output": arguments.output, **describe(field)}
    nodes = " × ".join(map(str, field.grid.shape))
    there = "" if arguments.band is None else f" ({summary['nodes']:,} of them there)"
    text = f"{arguments.output}: {nodes} nodes{there}, φ from {summary['minimum']:.4g} to {summary['maximum']:.4g}"
    text += hint(field)
    return summary, text
