"""``signedheat morph``: morphological operations on a broken shape."""

from __future__ import annotations

from argparse import Namespace

from ..extensions.morphology import closing, dilate, erode, opening, shell, thicken
from ..io import SHAPE_FORMATS, ensure_writable, read, save
from .computing import Summary, prefix_errors

OPERATIONS = {
    "dilate": dilate,
    "erode": erode,
    "opening": opening,
    "closing": closing,
    "shell": shell,
    "thicken": thicken,
}


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, write."""
    operation = OPERATIONS[arguments.operation]
    ensure_writable(arguments.output, SHAPE_FORMATS - {".xyz", ".pc"}, "a surface")
    shape = read(arguments.shape)
    with prefix_errors(arguments.shape):
        surface = operation(shape, *arguments.distances, resolution=arguments.resolution)
    save(surface, arguments.output)
    summary = {
        "input": arguments.shape,
        "operation": arguments.operation,
        "distances": arguments.distances,
        "output": arguments.output,
        "vertices": surface.n_vertices,
        "faces": surface.n_faces,
    }
    return summary, f"{arguments.output}: {arguments.operation}, closed surface of {surface.n_faces} faces"
