"""Draws `architecture.png`: the floors of the package, and the way of the data through them."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from textwrap import wrap

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from PIL import Image

FLOORS = [
    (
        "__main__   cli   view   samples   public   results   batches   io   torch",
        "commands, pictures, many shapes, files",
        "#f3d9c1",
    ),
    (
        "distances   morphology   solids",
        "what bounds a shape, which way it faces, what closes it; exact distance to it",
        "#f7e6d0",
    ),
    ("curves", "broken curves on surfaces: close them, measure to them, jumps", "#f7e6d0"),
    ("sharpening   tets", "distance to the zero set of φ; tets of a box", "#f7e6d0"),
    ("solver   fields", "SignedHeatSolver; values that know their domain", "#fbf1de"),
    ("method   extrapolation   constraints", "diffuse → normalize → integrate, once, on discretisations", "#fff6c9"),
    ("lowering", "every domain and every source to its discretisation: surface, grid, tets", "#e3efd3"),
    ("discretization", "the protocols: Discretization, SourceTerm, Integration", "#e3efd3"),
    ("domains", "frozen data: meshes, polygons, points, voxels, tets, grids, curves", "#d3e8ea"),
    ("operators   linear", "sparse matrices, matrix-free stencils, factorisations, Krylov", "#c9dcee"),
    ("geometry", "arrays in, arrays out: intrinsic meshes, geodesics, flips, clipping", "#bccfe8"),
    (
        "cache compiled diagnostics errors frozen memory packages jobs parallel processes progress reprs",
        "used by all",
        "#d9d9e3",
    ),
]
FLOW = [
    (9, "shapes, curves, grids"),
    (7, "X₀, t;  M + tL, C;  A"),
    (6, "X  →  Y  →  φ"),
    (5, "Field"),
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
