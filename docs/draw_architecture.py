"""Draws `architecture.png`: the floors of the package, and the way of the data through them."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from textwrap import wrap

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from PIL import Image

FLOORS = [
    ("cli   __main__", "commands", "#f3d9c1"),
    ("public   results   samples   batches", "public names, many shapes", "#f3d9c1"),
    ("io   view   torch", "files, pictures, tensors", "#f3d9c1"),
    ("distances   morphology", "signed_distance in one call; offsets, shells", "#f7e6d0"),
    ("curves   solids", "broken curves on surfaces, and broken shapes in space: completed, then exact", "#f7e6d0"),
    ("solver", "SignedHeatSolver: a domain and its factors", "#fbf1de"),
    ("surfaces   grids   tets", "slices: domain, operators, sources, discretisation, sharpening, field", "#d3e8ea"),
    (
        "fields   shapes   methods",
        "one function for all slices, by type: fields, what is taken for a shape, sharpening",
        "#d3e8ea",
    ),
    (
        "constraints   discretization   method",
        "the paper: diffuse → normalize → integrate, once, on discretisations",
        "#fff6c9",
    ),
    ("geodesics", "exact distance on polyhedral surfaces, shortest paths", "#e3efd3"),
    ("search   linear", "nearest faces, winding numbers; sparse solvers", "#c9dcee"),
    ("mesh", "arrays in, arrays out: edges, welding, components, cutting, intrinsic meshes", "#bccfe8"),
    (
        "arrays compiled diagnostics errors jobs memory packages parallel validation",
        "used by all",
        "#d9d9e3",
    ),
]
FLOW = [
    (10, "arrays, files of others"),
    (6, "domain;  X₀, t;  M + tL, C;  A"),
    (5, "X  →  Y  →  φ:  Field"),
    (4, "solids, completed curves"),
    (0, "files, pictures, numbers"),
]
"""Floor at which each thing is, from the top, in the order in which data pass through."""


def draw(path: Path) -> None:
    """Floors on the left, from the bottom up; data on the right."""
    figure = Figure(figsize=(11, 7.6), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, 11), ylim=(-0.55, len(FLOORS) + 0.55))
    axes.axis("off")
    level = [len(FLOORS) - 1 - k for k in range(len(FLOORS))]
    for (names, what, color), y in zip(FLOORS, level, strict=True):
        lines = wrap(names, 95, replace_whitespace=False) if len(names) > 95 else [names]
        deeper = 0.2 * max(len(lines) - 2, 0)
        axes.add_patch(_box(0.75, y + 0.06 - deeper, 7.1, 0.86 + deeper, color))
        size = min(11.5, 750 / max(len(line) for line in lines))  # that it fits into the box
        text = {"family": "monospace", "size": size, "weight": "bold", "va": "center"}
        axes.text(0.95, y + 0.62 - 0.7 * deeper, "\n".join(lines), linespacing=1.1, **text)
        axes.text(0.95, y + 0.28 - 0.09 * (len(lines) - 1) - 0.7 * deeper, what, size=9.5, va="center", color="#333333")
    axes.annotate("", (0.4, 0.1), (0.4, len(FLOORS) - 0.1), arrowprops={"arrowstyle": "-|>", "lw": 1.8})
    axes.text(0.16, len(FLOORS) / 2, "imports point down", rotation=90, va="center", ha="center", size=10)
    axes.text(9.4, len(FLOORS) + 0.2, "the way of the data", ha="center", size=10)
    axes.text(4.3, len(FLOORS) + 0.2, "the floors", ha="center", size=10)
    for k, (floor, what) in enumerate(FLOW):
        y = level[floor] + 0.5
        axes.text(9.4, y, what, ha="center", va="center", size=10.5, bbox={"fc": "white", "ec": "#555555", "pad": 5})
        axes.plot([7.9, 8.15], [y, y], color="#999999", lw=1)
        if k + 1 < len(FLOW):
            above = level[FLOW[k + 1][0]] + 0.5
            axes.annotate("", (9.4, above - 0.3), (9.4, y + 0.3), arrowprops={"arrowstyle": "-|>", "lw": 1.4})
    pixels = BytesIO()
    figure.savefig(pixels)
    Image.open(pixels).convert("RGB").quantize(48).save(path, optimize=True)  # a third of the size


def _box(x: float, y: float, width: float, height: float, color: str) -> FancyBboxPatch:
    style = "round,pad=0,rounding_size=0.08"
    return FancyBboxPatch((x, y), width, height, boxstyle=style, fc=color, ec="#777777", lw=0.8)


if __name__ == "__main__":
    draw(Path(__file__).with_name("architecture.png"))
