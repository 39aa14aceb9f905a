"""Contents and defects of a file, and the memory that a grid around it takes, for `info`."""

from __future__ import annotations

import os
import shlex
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

import signedheat as sh

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
OUTPUTS = "filled", "whole", "wall"
"""Endings of the names that commands for repair write to: holes closed, made a solid, sheets thickened."""
SURFACE_FORMATS = {".stl", ".obj", ".ply", ".off", ".vtp"}
"""Formats that these commands write; other files are repaired into the first."""
WHOLE_AREA = 0.9999
"""A share of the area above this is all of it: the rest is rounding error."""


def report(file: str, arguments: Namespace) -> Summary:
    """Inspect a shape, a field or an image."""
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
    counts, found, measured = inspected(held)
    told = verdict_of_solid(held) if isinstance(held, sh.Solid) else verdict(counts, found)
    summary = {"verdict": told, "file": file, **shape_figures(held, counts, found, measured)}
    defects = list[Defect]()
    if isinstance(counts, SurfaceReport) and found is not None:
        defects = defects_of(counts, found, file)
    if (unit := unit_of(file)) is not None:
        summary["units"] = unit
    if extension(file) == ".obj":
        summary["line_elements"] = len(read_obj_elements(file)[1])
    rows = {name: value for name, value in summary.items() if name != "thickness"}
    if isinstance(counts, SurfaceReport) and counts.small_parts:
        summary["without_small_parts"] = advice = without_small_parts(counts, file)
        rows["small_parts"] = f"{counts.small_parts}, left out by {printable(advice)}"
    summary |= {"defects": [asdict(defect) for defect in defects], "remedy": remedy_of(defects)}
    if found is not None:
        rows["orientation"] = orientation_text(found)
    if measured is not None:
        rows |= _width_rows(measured)
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
    """Inspect polylines in the plane."""
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
    return summary, _table(summary)


def image_report(file: str, image: sh.io.LabelImage) -> dict[str, Any]:
    """Report the place of an image, and its labels or the range of its values."""
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
    """A kind of defect, how often there is one, what it is in words, and the command that mends it."""

    defect: str
    count: int
    text: str
    remedy: str


def defects_of(counts: SurfaceReport, found: Orientation, file: str) -> list[Defect]:
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
    borders = 0 if found.undecided_area > WHOLE_AREA else counts.borders  # the outlines of sheets are no holes
    kinds = (
        ("holes", borders, "hole", "to complete", f"signedheat fill {name} -o {filled}"),
        ("turned_faces", found.turned_faces, "face", "to flip", repair),
        ("duplicate_faces", found.merged_faces, "duplicate face", "to merge", repair),
        ("hidden_parts", found.nested_bodies, "part", "hidden in others, to leave out", repair),
        ("nonmanifold_edges", counts.nonmanifold_edges, "edge", "of three or more faces", repair),
    )
    defects = [
        Defect(kind, number, f"{_count(number, one)} {what}", remedy) for kind, number, one, what, remedy in kinds
    ]
    if found.undecided_area > 1 - WHOLE_AREA:
        text = f"{percent(found.undecided_area)} of the area bounds nothing"
        size = 0.01 * float(np.linalg.norm(np.subtract(counts.upper, counts.lower)))
        thicken = f"signedheat morph thicken {name} {size:.2g} -o {wall}"
        defects.append(Defect("sheets", found.undecided_parts, text, thicken))
    return [defect for defect in defects if defect.count]


def outputs_of(counts: SurfaceReport, file: str) -> list[str]:
    """Return a file and the files to which commands write it filled, watertight and thickened, quoted for a shell."""
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
    """Return one command that mends all defects: the only one, or that which mends all but sheets."""
    remedies = dict.fromkeys(defect.remedy for defect in defects)
    repairs = [remedy for remedy in remedies if remedy.startswith("signedheat watertight")]
    return next(iter([*repairs, *remedies]), None)


def verdict(counts: SurfaceReport | CloudReport | TetReport, found: Orientation | None) -> str:
    """Say in one line whether a shape is whole, and if not, what completion will mend.

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
        turned = counts.inside_out_tets + counts.flat_tets
        return f"tets, {turned} of them inside out or flat" if turned else "tets, all of them sound"
    if found is None:
        return "voxels: closed and oriented"
    if found.undecided_area > WHOLE_AREA:
        return "open sheets that bound nothing: `signedheat morph thicken` makes walls of them"
    said = [defect.text for defect in defects_of(counts, found, "")]
    if not said:
        return "whole: closed and oriented; distance to it is exact"
    return f"broken: {', '.join(said)}; every command takes it as it is"


def verdict_of_solid(solid: sh.Solid) -> str:
    """Say in one line that a solid is complete, and how much of it is completion or sheets.

    Examples
    --------
    >>> from signedheat import complete, samples
    >>> verdict_of_solid(complete(samples.without_faces(samples.sphere(2), 0.1)))
    'a solid: closed, 10.2 % of its area completed; distance to it is exact'
    """
    areas = face_areas(solid.triangles)
    made, sheets = (areas[chosen].sum() / areas.sum() for chosen in (solid.origins < 0, ~solid.bounding))
    said = ["closed" if solid.bounding.any() else "sheets that bound nothing"]
    said += [f"{percent(made)} of its area completed"] if made else []
    said += [f"{percent(sheets)} of it sheets"] if sheets and solid.bounding.any() else []
    return f"a solid: {', '.join(said)}; distance to it is exact"


def orientation_text(found: Orientation) -> str:
    """Say in one line which way a mesh faces.

    Examples
    --------
    >>> from signedheat import samples
    >>> orientation_text(inspected(samples.with_flipped_faces(samples.sphere(2), 0.1))[1])
    '1 part, closed; faces disagree at 89 edges: 33 faces to flip (10.2 % of the area)'
    """
    closed = "closed" if found.closed_parts == found.n_parts else f"{found.closed_parts} closed"
    said = [f"{_count(found.n_parts, 'part')}, {closed}"]
    if found.inconsistent_edges:
        edges, faces = _count(found.inconsistent_edges, "edge"), _count(found.turned_faces, "face")
        said.append(f"faces disagree at {edges}: {faces} to flip ({percent(found.turned_area)} of the area)")
    elif found.turned_parts:
        which = "all" if found.turned_area > WHOLE_AREA else f"{_count(found.turned_parts, 'part')}"
        said.append(f"{which} facing inwards ({percent(found.turned_area)} of the area to flip)")
    elif found.undecided_area < WHOLE_AREA:
        said.append("facing outwards")
    kinds = (
        (found.nonorientable_parts, "nonorientable part", "nonorientable parts"),
        (found.nested_bodies, "body hidden in another", "bodies hidden in others"),
        (found.cavities, "cavity", "cavities"),
    )
    said += [f"{number} {one if number == 1 else many}" for number, one, many in kinds if number]
    if found.merged_faces:
        said.append(f"{_count(found.merged_faces, 'duplicate face')} to merge")
    if found.undecided_parts:
        sheets = _count(found.undecided_parts, "sheet")
        said.append(f"{percent(found.undecided_area)} of the area in {sheets} without an inside")
    return "; ".join(said)


def curve_report(triangles: IntrinsicMesh, source: Any, number: int) -> dict[str, Any]:
    """Return figures of a curve or points: where the points lie, and of a curve its segments, length and open ends."""
    places = locate_points(triangles, source.faces, source.barycentric, f"source {number}: point")
    kinds = np.bincount(places.kinds, minlength=3)
    row: dict[str, Any] = {
        "kind": "points",
        "n_points": len(places),
        "at_vertices": int(kinds[VERTEX]),
        "on_edges": int(kinds[EDGE]),
        "in_faces": int(kinds[FACE]),
    }
    if not isinstance(source, sh.Curve):
        return row
    apart = gaps(triangles, places, source.closed)
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
    """Write the rows as text, one line each."""
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
    """Write the first few items of a list."""
    return ", ".join(map(str, items[:6])) + (", …" if len(items) > 6 else "")


def _count(number: int, name: str) -> str:
    return f"{number} {name}" if number == 1 else f"{number} {name}s"


def _width_rows(widths: Widths) -> dict[str, str]:
    """Return rows of the table by name; walls and gaps are percentiles, the thinnest place is the minimum."""
    rows = {}
    for name, low, typical in (
        ("thin walls (1 %)", widths.wall, widths.typical_wall),
        ("narrow gaps (1 %)", widths.gap, widths.typical_gap),
    ):
        if low is not None:
            rows[name] = f"{low:.4g}" + (f" (typical {typical:.4g})" if typical is not None else "")
    if widths.thinnest is not None and widths.thinnest_place is not None:
        place = ", ".join(f"{x:.4g}" for x in widths.thinnest_place)
        rows["thinnest place"] = f"{widths.thinnest:.4g} at ({place})"
    if widths.spacing is not None:
        rows["spacing they need"] = f"{widths.spacing:.4g}"
    return rows


def _least_spacing(shape: Any) -> float | None:
    """Return the spacing of the finest grid around the shape that fits into free memory; None if there is none."""
    available = available_memory()
    if available is None or not (shape.bounds[1] > shape.bounds[0]).any():
        return None
    grid = sh.Grid.around(shape.bounds, 128)
    spacing = fitting_spacing(grid, available, BYTES_PER_DENSE_NODE, BYTES_AT_WORK, 0.0)
    return float(spacing.max()) if (spacing < grid.upper - grid.origin).all() else None


def _memory(shape: Any, resolution: int) -> int | None:
    """Estimate memory for a grid around the shape; None if the shape is a single place."""
    if not (shape.bounds[1] > shape.bounds[0]).any():
        return None
    return memory_estimate(sh.Grid.around(shape.bounds, resolution), BYTES_PER_DENSE_NODE, BYTES_AT_WORK)


def _table(summary: dict[str, Any]) -> str:
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
