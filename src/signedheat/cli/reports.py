"""Reports of the command `info`: contents and defects of a file, and the memory of grids around it."""

from __future__ import annotations

import os
import shlex
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

import signedheat as sh

from ..arrays import Floats, place
from ..errors import SourceError, counted, percent, printable
from ..geodesics.shortest_paths import gaps
from ..grids.grid_discretization import fitting_spacing, memory_estimate
from ..io import read
from ..io.files import extension
from ..io.key_figures import inspected, shape_figures
from ..io.mesh_files import read_obj_elements
from ..io.scenes import unit_of
from ..memory import available_memory
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import EDGE, FACE, VERTEX, locate_points
from ..mesh.triangles import face_areas
from ..shapes.area_elements import bounds_around
from ..shapes.inspection import SMALL_PART, CloudReport, SurfaceReport, TetReport
from ..solids.mesh_orientation import Orientation
from ..solids.thickness import Widths
from ..solids.tiles import BYTES_AT_WORK, BYTES_PER_DENSE_NODE
from ..surfaces.source_segments import segments_of
from .operands import describe, field_or_image, labels_of
from .options import Summary, is_planar

POINT_KINDS = {VERTEX: "vertex", EDGE: "edge", FACE: "face"}
"""Words for what a point of a curve lies on."""
OUTPUTS = "filled", "whole", "wall"
"""Endings of the names of repaired files: with closed holes, made a solid, sheets thickened."""
SURFACE_FORMATS = {".stl", ".obj", ".ply", ".off", ".vtp"}
"""Formats of repaired files. For files in other formats, the suggested output is ``.stl``."""
WHOLE_AREA = 0.9999
"""Fraction of the area above which it counts as all of it, since the rest may be rounding error."""


def report(file: str, arguments: Namespace) -> Summary:
    """Return what `info` reports about a file with a shape, a field or an image: figures for JSON, and text."""
    field = field_or_image(file)
    if arguments.curves and (field is not None or is_planar(file)):
        raise SourceError("curves lie on surfaces, and this file holds none", element="--curves", path=file)
    if isinstance(field, sh.io.LabelImage):
        summary = image_report(file, field)
        return summary, _table(summary)
    if field is not None:
        summary = {"file": file, "kind": "Field", "domain": type(field.domain).__name__, **describe(field)}
        del summary["seconds"]
        return summary, _table(summary)
    if is_planar(file):
        return lines_report(file)
    held = read(file)
    shape = sh.as_shape(held)
    counts, oriented, measured = inspected(held)
    words = verdict_of_solid(held) if isinstance(held, sh.Solid) else verdict(counts, oriented)
    summary = {"verdict": words, "file": file, **shape_figures(held, counts, oriented, measured)}
    defects = list[Defect]()
    if isinstance(counts, SurfaceReport) and oriented is not None:
        defects = defects_of(counts, oriented, file)
    if (unit := unit_of(file)) is not None:
        summary["units"] = unit
    if extension(file) == ".obj":
        summary["line_elements"] = len(read_obj_elements(file)[1])
    rows = {name: value for name, value in summary.items() if name != "thickness"} | _box_rows(summary)
    if isinstance(counts, SurfaceReport) and counts.small_parts:
        summary["without_small_parts"] = advice = without_small_parts(counts, file)
        rows["small_parts"] = f"{counts.small_parts}, left out by {printable(advice)}"
    summary |= {"defects": [asdict(defect) for defect in defects], "remedy": remedy_of(defects)}
    if oriented is not None:
        rows["orientation"] = orientation_text(oriented)
    if measured is not None:
        rows |= _width_rows(measured, shape.bounds)
    summary["memory_bytes"] = sizes = {str(n): _memory(shape, n) for n in arguments.resolution}
    summary["least_spacing"] = least = _least_spacing(shape)
    rows |= {f"memory at {n}": "–" if size is None else f"{size / 1e9:.2f} GB" for n, size in sizes.items()}
    rows["spacing that fits"] = "–" if least is None else f"{least:.3g}"
    text = _table(rows)
    if defects:
        width = max(len(defect.text) for defect in defects)
        lines = [f"{defect.text:<{width}}  {printable(defect.remedy)}" for defect in defects]
        text += "\n\n" + "\n".join(lines)
    if arguments.curves:
        if isinstance(shape, sh.TetMesh):
            raise SourceError(
                f"curves lie on meshes and point clouds, not a {type(shape).__name__}",
                element="shape",
                path=arguments.curves,
            )
        triangles = shape.triangulation.intrinsic
        sources = sh.io.read_curves(arguments.curves, shape)
        summary["curves"] = [curve_report(triangles, source, number) for number, source in enumerate(sources)]
        text += f"\n\n{printable(arguments.curves)}\n{curves_text(summary['curves'])}"
    return summary, text


def lines_report(file: str) -> Summary:
    """Return what `info` reports about a file with polylines in the plane."""
    lines = sh.io.read_polylines(file)
    bounds = bounds_around(lines)
    summary = {
        "file": file,
        "kind": "Polyline",
        "n_polylines": len(lines),
        "n_closed": sum(line.closed for line in lines),
        "n_points": sum(line.n_points for line in lines),
        "length": float(sum(line.length for line in lines)),
        "lower": bounds[0].tolist(),
        "upper": bounds[1].tolist(),
    }
    return summary, _table(summary | _box_rows(summary))


def image_report(file: str, image: sh.io.LabelImage) -> dict[str, Any]:
    """Return figures of an image: its position in the world, and its labels or the range of its values."""
    values, labels = image.labels, labels_of(image)
    figures: dict[str, Any] = {
        "file": file,
        "kind": "image of labels" if labels is not None else "image of a field",
        "shape": [int(n) for n in values.shape],
        "spacing": image.spacing.tolist(),
        "origin": image.origin.tolist(),
        "axes": image.axes.T.ravel().tolist(),
    }
    if image.space is not None:
        figures["space"] = image.space
    if labels is None:
        return figures | {"lowest": float(np.nanmin(values)), "highest": float(np.nanmax(values))}
    return figures | {"labels": labels, "voxels": [int((values == label).sum()) for label in labels]}


@dataclass(frozen=True)
class Defect:
    """Defects of one kind in a surface."""

    defect: str  # the kind, such as "holes"
    count: int
    text: str  # number and kind in words
    remedy: str  # the command that mends them


def defects_of(counts: SurfaceReport, oriented: Orientation, file: str) -> list[Defect]:
    """List the defects of a surface with the command for each.

    Examples
    --------
    >>> from signedheat import samples
    >>> broken = samples.without_faces(samples.sphere(2), 0.1)
    >>> [(defect.count, defect.remedy) for defect in defects_of(*inspected(broken)[:2], "ball.stl")]
    [(24, 'signedheat fill ball.stl -o ball_filled.stl')]
    """
    name, filled, whole, wall = outputs_of(counts, file)
    repair = f"signedheat watertight {name} -o {whole}"
    borders = 0 if oriented.undecided_area > WHOLE_AREA else counts.borders  # the outlines of sheets are no holes
    kinds = (
        ("holes", borders, "hole", "to complete", f"signedheat fill {name} -o {filled}"),
        ("turned_faces", oriented.turned_faces, "face", "to flip", repair),
        ("duplicate_faces", oriented.merged_faces, "duplicate face", "to merge", repair),
        ("hidden_parts", oriented.nested_bodies, "part", "hidden in others, to leave out", repair),
        ("nonmanifold_edges", counts.nonmanifold_edges, "edge", "of three or more faces", repair),
    )
    defects = [
        Defect(kind, number, f"{_count(number, noun)} {rest}", remedy) for kind, number, noun, rest, remedy in kinds
    ]
    if oriented.undecided_area > 1 - WHOLE_AREA:
        text = f"{percent(oriented.undecided_area)} of the area bounds nothing"
        size = 0.01 * float(np.linalg.norm(np.subtract(counts.upper, counts.lower)))
        thicken = f"signedheat morph thicken {name} {size:.2g} -o {wall}"
        defects.append(Defect("sheets", oriented.undecided_parts, text, thicken))
    return [defect for defect in defects if defect.count]


def outputs_of(counts: SurfaceReport, file: str) -> list[str]:
    """Return the names of a file and of its repaired versions with the endings `OUTPUTS`, quoted for a shell."""
    stem, ending = os.path.splitext(file)
    ending = ending.lower() if ending.lower() in SURFACE_FORMATS else ".stl"
    if ending == ".stl" and counts.nonmanifold_edges:
        ending = ".ply"  # STL would join again what touches along these edges
    return [shlex.quote(part) for part in (file, *(f"{stem}_{x}{ending}" for x in OUTPUTS))]


def without_small_parts(counts: SurfaceReport, file: str) -> str:
    """Return the command that leaves out the small parts of a surface.

    Examples
    --------
    >>> from signedheat import samples
    >>> mesh = samples.union(samples.sphere(2), samples.sphere(1, radius=0.002, center=(2, 0, 0)))
    >>> without_small_parts(inspected(mesh)[0], "scan.ply")
    'signedheat watertight scan.ply --smallest 0.0346 -o scan_whole.ply'
    """
    name, _, whole, _ = outputs_of(counts, file)
    return f"signedheat watertight {name} --smallest {SMALL_PART * counts.largest_part:.3g} -o {whole}"


def remedy_of(defects: Sequence[Defect]) -> str | None:
    """Return a command that mends all defects, except sheets if there are others; None if there are no defects."""
    remedies = dict.fromkeys(defect.remedy for defect in defects)
    repairs = [remedy for remedy in remedies if remedy.startswith("signedheat watertight")]
    return next(iter([*repairs, *remedies]), None)


def verdict(counts: SurfaceReport | CloudReport | TetReport, oriented: Orientation | None) -> str:
    """Return a line that says whether a shape is whole, and if not, what its defects are.

    Examples
    --------
    >>> from signedheat import samples
    >>> verdict(*inspected(samples.sphere(2))[:2])
    'whole: closed and oriented; distance to it is exact'
    >>> broken = samples.without_faces(samples.sphere(2), 0.1)
    >>> verdict(*inspected(broken)[:2])
    'broken: 24 holes to complete; every command takes it as it is'
    """
    if isinstance(counts, CloudReport):
        if counts.has_normals:
            return "points with normals: every command takes them for the solid that they bound"
        return "points without normals: these are found first; thin sheets of noisy points may lose their sides"
    if isinstance(counts, TetReport):
        n_bad = counts.inside_out_tets + counts.flat_tets
        return f"tets, {n_bad} of them inside out or flat" if n_bad else "tets, all of them sound"
    if oriented is None:
        return "voxels: closed and oriented"
    if oriented.undecided_area > WHOLE_AREA:
        return "open sheets that bound nothing: `signedheat morph thicken` makes walls of them"
    texts = [defect.text for defect in defects_of(counts, oriented, "")]
    if not texts:
        return "whole: closed and oriented; distance to it is exact"
    return f"broken: {', '.join(texts)}; every command takes it as it is"


def verdict_of_solid(solid: sh.Solid) -> str:
    """Return a line that says that a solid is complete, and how much of it is completion or sheets.

    Examples
    --------
    >>> from signedheat import complete, samples
    >>> verdict_of_solid(complete(samples.without_faces(samples.sphere(2), 0.1)))
    'a solid: closed, 10.2 % of its area completed; distance to it is exact'
    """
    areas = face_areas(solid.triangles)
    made, sheets = (areas[chosen].sum() / areas.sum() for chosen in (solid.origins < 0, ~solid.bounding))
    phrases = ["closed" if solid.bounding.any() else "sheets that bound nothing"]
    phrases += [f"{percent(made)} of its area completed"] if made else []
    phrases += [f"{percent(sheets)} of it sheets"] if sheets and solid.bounding.any() else []
    return f"a solid: {', '.join(phrases)}; distance to it is exact"


def orientation_text(oriented: Orientation) -> str:
    """Return a line that says which way the faces of a mesh point, and what its parts are.

    Examples
    --------
    >>> from signedheat import samples
    >>> orientation_text(inspected(samples.with_flipped_faces(samples.sphere(2), 0.1))[1])
    '1 part, closed; faces disagree at 89 edges: 33 faces to flip (10.2 % of the area)'
    """
    closed = "closed" if oriented.closed_parts == oriented.n_parts else f"{oriented.closed_parts} closed"
    phrases = [f"{_count(oriented.n_parts, 'part')}, {closed}"]
    if oriented.inconsistent_edges:
        edges, faces = _count(oriented.inconsistent_edges, "edge"), _count(oriented.turned_faces, "face")
        phrases.append(f"faces disagree at {edges}: {faces} to flip ({percent(oriented.turned_area)} of the area)")
    elif oriented.turned_parts:
        which = "all" if oriented.turned_area > WHOLE_AREA else f"{_count(oriented.turned_parts, 'part')}"
        phrases.append(f"{which} facing inwards ({percent(oriented.turned_area)} of the area to flip)")
    elif oriented.undecided_area < WHOLE_AREA:
        phrases.append("facing outwards")
    kinds = (
        (oriented.nonorientable_parts, "nonorientable part", "nonorientable parts"),
        (oriented.nested_bodies, "body hidden in another", "bodies hidden in others"),
        (oriented.cavities, "cavity", "cavities"),
    )
    phrases += [f"{number} {one if number == 1 else many}" for number, one, many in kinds if number]
    if oriented.merged_faces:
        phrases.append(f"{_count(oriented.merged_faces, 'duplicate face')} to merge")
    if oriented.undecided_parts:
        sheets = _count(oriented.undecided_parts, "sheet")
        phrases.append(f"{percent(oriented.undecided_area)} of the area in {sheets} without an inside")
    return "; ".join(phrases)


def curve_report(triangles: IntrinsicMesh, source: Any, number: int) -> dict[str, Any]:
    """Return figures of a curve or points on triangles, by name; `number` is its position in the file.

    They say what the points lie on, and of a curve its segments, length and open ends.
    """
    points = locate_points(triangles, source.faces, source.barycentric, f"source {number}: point")
    kinds = np.bincount(points.kinds, minlength=3)
    row: dict[str, Any] = {
        "kind": "points",
        "n_points": len(points),
        "at_vertices": int(kinds[VERTEX]),
        "on_edges": int(kinds[EDGE]),
        "in_faces": int(kinds[FACE]),
    }
    if not isinstance(source, sh.Curve):
        return row
    apart = gaps(triangles, points, source.closed)
    parts = segments_of(source, triangles, number=number)
    degree = np.bincount(parts.ends.ravel(), minlength=len(parts.nodes))
    ends = [
        f"{POINT_KINDS[kind]} {element}"
        for kind, element in zip(
            parts.nodes.kinds[degree == 1].tolist(), parts.nodes.elements[degree == 1].tolist(), strict=True
        )
    ]
    row |= {
        "kind": "oriented curve" if source.oriented else "unoriented curve",
        "n_segments": source.n_segments,
        "length": float(parts.lengths.sum()),
        "along_edges": int((parts.edges >= 0).sum()),
        "inside_faces": int((parts.edges < 0).sum()),
        "share_no_face": apart.tolist(),
        "open_ends": ends,
        "junctions": int((degree > 2).sum()),
    }
    return row


def curves_text(rows: Sequence[dict[str, Any]]) -> str:
    """Return the figures of curves, which `curve_report` returns, as text with a line for each."""
    lines = []
    for number, row in enumerate(rows):
        points = f"{row['at_vertices']} at vertices, {row['on_edges']} on edges, {row['in_faces']} in faces"
        line = f"{number:>4}  {row['kind']}, {row['n_points']} points ({points})"
        if "length" in row:
            line += f", length {row['length']:.6g}"
            line += f"; pieces: {row['along_edges']} along edges, {row['inside_faces']} in faces"
            apart, ends = row["share_no_face"], row["open_ends"]
            if apart:
                line += f"; {counted(len(apart), 'segment')} within no common face: {_shortened(apart)}"
            line += f"; open at {_shortened(ends)}" if ends else "; closed"
            if row["junctions"]:
                line += f"; {row['junctions']} junctions"
        lines.append(line)
    return "\n".join(lines)


def _shortened(items: Sequence[Any]) -> str:
    """Return the first six items of a list as text."""
    return ", ".join(map(str, items[:6])) + (", …" if len(items) > 6 else "")


def _count(number: int, name: str) -> str:
    """Return a number and a noun, such as ``"1 edge"`` or ``"2 edges"``."""
    return f"{number} {name}" if number == 1 else f"{number} {name}s"


def _box_rows(summary: dict[str, Any]) -> dict[str, str]:
    """Return the rows of the table with the two corners of the box around a shape."""
    bounds = {name: summary[name] for name in ("lower", "upper")}
    return {name: place(corner, [*bounds.values()])[1:-1].replace(",", "") for name, corner in bounds.items()}


def _width_rows(widths: Widths, bounds: Floats) -> dict[str, str]:
    """Return rows of the table by name: the widths of walls and gaps of a shape, and where its thinnest wall is."""
    rows = {}
    for name, low, typical in (
        ("thin walls (1 %)", widths.wall, widths.typical_wall),
        ("narrow gaps (1 %)", widths.gap, widths.typical_gap),
    ):
        if low is not None:
            rows[name] = f"{low:.4g}" + (f" (typical {typical:.4g})" if typical is not None else "")
    if widths.thinnest is not None and widths.thinnest_place is not None:
        rows["thinnest place"] = f"{widths.thinnest:.4g} at {place(widths.thinnest_place, bounds)}"
    if widths.spacing is not None:
        rows["spacing they need"] = f"{widths.spacing:.4g}"
    return rows


def _least_spacing(shape: Any) -> float | None:
    """Return the spacing of the finest grid around a shape that fits into free memory.

    It is None if the memory is unknown, the shape is a single point, or no grid fits.
    """
    available = available_memory()
    if available is None or not (shape.bounds[1] > shape.bounds[0]).any():
        return None
    grid = sh.Grid.around(shape.bounds, 128)
    spacing = fitting_spacing(grid, available, BYTES_PER_DENSE_NODE, BYTES_AT_WORK, 0.0)
    return float(spacing.max()) if (spacing < grid.upper - grid.origin).all() else None


def _memory(shape: Any, resolution: int) -> int | None:
    """Return the estimated memory in bytes for a grid around a shape; None if the shape is a single point."""
    if not (shape.bounds[1] > shape.bounds[0]).any():
        return None
    return memory_estimate(sh.Grid.around(shape.bounds, resolution), BYTES_PER_DENSE_NODE, BYTES_AT_WORK)


def _table(summary: dict[str, Any]) -> str:
    """Return figures as text, with a line for each name and its value."""
    rows = []
    for key, value in summary.items():
        if isinstance(value, (list, tuple)):
            value = " ".join(f"{entry:g}" for entry in value)
        elif isinstance(value, bool):
            value = "yes" if value else "no"
        elif isinstance(value, float):
            value = f"{value:g}"
        rows.append((key.removeprefix("n_").replace("_", " "), printable(str(value))))
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)
