"""Report on curves on a surface, for ``signedheat info MESH CURVES``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..domains.curves import Curve
from ..domains.segments import segments_of
from ..geometry.geodesics.paths import gaps
from ..geometry.intrinsic_mesh import IntrinsicMesh
from ..geometry.surface_points import EDGE, FACE, VERTEX, locate_points

NAMES = {VERTEX: "vertex", EDGE: "edge", FACE: "face"}


def curve_reports(surface: Any, sources: Sequence[Any]) -> list[dict[str, Any]]:
    """One row per source: elements that its points lie on, kinds of segments, length, open ends."""
    mesh = surface.triangulation
    lengths = mesh.edge_lengths[mesh.edges.face_edges]
    triangles = IntrinsicMesh.from_lengths(mesh.faces, lengths, mesh.n_vertices, mesh.edges)
    return [report(triangles, source, number) for number, source in enumerate(sources)]


def report(triangles: IntrinsicMesh, source: Any, number: int) -> dict[str, Any]:
    """The row of one source."""
    places = locate_points(triangles, source.faces, source.barycentric, f"source {number}: point")
    kinds = np.bincount(places.kinds, minlength=3)
    row: dict[str, Any] = {
        "kind": "points",
        "n_points": len(places),
        "at_vertices": int(kinds[VERTEX]),
        "on_edges": int(kinds[EDGE]),
        "in_faces": int(kinds[FACE]),
    }
    if not isinstance(source, Curve):
        return row
    apart = gaps(triangles, places, source.closed)
    parts = segments_of(source, triangles, number=number)
    degree = np.bincount(parts.ends.ravel(), minlength=len(parts.nodes))
    ends = [
        f"{NAMES[kind]} {element}"
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


def as_text(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as text, one line each."""
    lines = []
    for number, row in enumerate(rows):
        points = f"{row['at_vertices']} at vertices, {row['on_edges']} on edges, {row['in_faces']} in faces"
        line = f"{number:>4}  {row['kind']}, {row['n_points']} points ({points})"
        if "length" in row:
            line += f", length {row['length']:.6g}"
            line += f"; pieces: {row['along_edges']} along edges, {row['inside_faces']} in faces"
            apart, ends = row["share_no_face"], row["open_ends"]
            if apart:
                line += f"; {len(apart)} segments share no face: {shortened(apart)}"
            line += f"; open at {shortened(ends)}" if ends else "; closed"
            if row["junctions"]:
                line += f"; {row['junctions']} junctions"
        lines.append(line)
    return "\n".join(lines)


def shortened(items: Sequence[Any], most: int = 6) -> str:
    """The first few items of a list, as text."""
    return ", ".join(map(str, items[:most])) + (", …" if len(items) > most else "")
