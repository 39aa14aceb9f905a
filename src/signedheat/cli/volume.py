"""``signedheat volume``: signed distance to a broken shape on a grid."""

from __future__ import annotations

from argparse import Namespace

from ..io import ensure_field_writable, save_field
from ..visualization import ensure_picture_writable, save_slices
from . import tets
from .computing import Summary, compute, describe, grid_for, hint, prefix_errors, read_source


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, write."""
    if arguments.tets is not None:
        return tets.run(arguments)
    ensure_field_writable(arguments.output)
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    shape = read_source(arguments.shape)
    with prefix_errors(arguments.shape):
        field = compute(shape, grid_for(shape, arguments), arguments)
    save_field(field, arguments.output)
    if arguments.preview:
        save_slices(field, arguments.preview, shape)
    summary = {"input": arguments.shape, "output": arguments.output, **describe(field)}
    nodes = " × ".join(map(str, field.grid.shape))
    text = f"{arguments.output}: {nodes} nodes, φ from {summary['minimum']:.4g} to {summary['maximum']:.4g}"
    text += hint(field)
    return summary, text
