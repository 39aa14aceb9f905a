"""``signedheat sample``: points with distances and gradients, to learn from."""

from __future__ import annotations

from argparse import Namespace

from ..extensions.sampling import sample
from ..io import ensure_writable
from ..io.samples import SAMPLE_FORMATS
from .computing import Summary, compute, describe, grid_for, prefix_errors
from .placing import read_source


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, sample, write."""
    ensure_writable(arguments.output, SAMPLE_FORMATS, "samples")
    shape = read_source(arguments)
    with prefix_errors(arguments.shape):
        field = compute(shape, grid_for(shape, arguments), arguments)
        taken = sample(field, arguments.samples, near=arguments.near, widths=arguments.widths, seed=arguments.seed)
    (taken.normalized() if arguments.normalize else taken).save(arguments.output, arguments.layout)
    figures = taken.figures
    summary = {"input": arguments.shape, "output": arguments.output, **figures, "field": describe(field)}
    inside = figures["inside_share"]
    text = f"{arguments.output}: {len(taken.points)} points, {figures['near']} near the surface, {inside:.1%} inside"
    return summary, text
