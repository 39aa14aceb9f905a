"""Read and write curves on surfaces: JSON with vertex ids and weights, OBJ line elements, tables of points."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Floats, Ints, mask_of
from ..errors import FileFormatError, SignedHeatError, SourceError, UnsupportedTypeError
from ..geodesics.shortest_paths import gaps
from ..mesh.polylines import assemble_polylines
from ..mesh.surface_points import locate_points, refuse_missing
from ..shapes.foreign import ForeignShape, converted
from ..shapes.kinds import EmbeddedSurface
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.surface import closest_points
from ..surfaces.surface_curves import Curve, CurveOrPoints, SurfacePoints
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import flag, json_numbers
from .files import PathLike, damaged, format_for, reading, replacing, text
from .mesh_files import read_obj_elements
from .numerals import integer, integers, json_of, vector
from .point_files import read_point_lists

GROUP_KINDS = SIGNED, UNSIGNED, POINTS = "signed_curve", "unsigned_curve", "unsigned_point"
"""Kinds of groups in a file: curves with an inside (`oriented`), curves without, and points."""


class Node(NamedTuple):
    """A point in a file: the weighted mean of one vertex, two of an edge, or three of a face."""

    vertices: tuple[int, ...]
    weights: tuple[float, ...]


class Group(NamedTuple):
    """A curve in a file, or several points."""

    kind: str  # one of `GROUP_KINDS`
    nodes: list[Node]


def read_curves(path: PathLike, domain: EmbeddedSurface | ForeignShape, strict: bool = False) -> list[CurveOrPoints]:
    """Read curves and points on a surface.

    Parameters
    ----------
    path : str or path
        A ``.json`` file with vertex ids and weights, or with ``{"polylines": [{"points": [[x, y, z], …], "closed":
        false}, …]}``, a ``.obj`` file with line elements, or a ``.csv`` file with x, y and z on each line and an empty
        line between polylines. Points in space are projected onto the surface, unless the vertices of an ``.obj``
        file are those of the mesh.
    domain : TriangleMesh, PolygonMesh, PointCloud or DigitalSurface
        The surface that the ids refer to.
    strict : bool
        Whether to refuse curves with consecutive points that share no face. By default these are joined by geodesic
        paths.

    Returns
    -------
    list of Curve and SurfacePoints
        In the order of the file; curves that end where they begin are closed.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, or damaged.
    SourceError
        If the curves do not fit the surface, or have gaps that `strict` forbids.

    See Also
    --------
    io.write_curves : Write curves on a surface.
    Curve : A curve on a surface.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_curves([mesh.path([0, 1, 2])], f"{folder}/curves.json", mesh)
    ...     read_curves(f"{folder}/curves.json", mesh)
    [Curve(3 points, open, oriented)]
    """
    read_groups = format_for(path, CURVE_READERS, "curves")
    domain = surface_in_space(domain)
    with reading(path):
        groups = read_groups(path, domain)
        sources = [source if isinstance(source, Curve) else placed(source, domain) for source in groups]
        if strict:
            refuse_gaps(sources, domain.triangulation)
    if not sources:
        raise FileFormatError(
            "the file contains neither curves nor points", remedy="check that it is a file of curves", path=path
        )
    return sources


def refuse_gaps(sources: Sequence[CurveOrPoints], mesh: TriangleMesh) -> None:
    """Raise a `SourceError` if consecutive points of a curve share no face."""
    for number, source in enumerate(sources):
        if isinstance(source, Curve):
            located = locate_points(mesh.intrinsic, source.faces, source.barycentric, f"curve {number}: point")
            apart = gaps(mesh.intrinsic, located, source.closed)
            if len(apart):
                raise SourceError(
                    f"curve {number}: points {apart[0]} and {(apart[0] + 1) % source.n_points} share no face, "
                    f"nor do the ends of {len(apart) - 1} more segments",
                    remedy="add points, or read without strict to join them",
                    element=f"curve {number}",
                )


def write_curves(
    curves: CurveOrPoints | Sequence[CurveOrPoints], path: PathLike, domain: EmbeddedSurface | ForeignShape
) -> None:
    """Write curves and points on a surface, in the format given by the extension.

    ``.json`` keeps everything except given normals, exactly; ``.obj`` has polylines in space.

    Parameters
    ----------
    curves : Curve, SurfacePoints or a sequence of them
        The curves and points.
    path : str or path
        The file. It is written under a temporary name and renamed, so that an existing file survives a failure.
    domain : TriangleMesh, PolygonMesh, PointCloud or DigitalSurface
        The surface they lie on.

    Raises
    ------
    FileFormatError
        If the format is unknown or the file cannot be written.

    See Also
    --------
    io.read_curves : Read curves on a surface.
    close_curves : Close the gaps of curves on a surface.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_curves(mesh.path([0, 1]), f"{folder}/side.json", mesh)
    ...     read_curves(f"{folder}/side.json", mesh)
    [Curve(2 points, open, oriented)]
    """
    content_of = format_for(path, CURVE_WRITERS, "curves")
    listed = [curves] if isinstance(curves, (Curve, SurfacePoints)) else list(curves)
    if not listed:
        raise FileFormatError("there is no curve to write", remedy="pass at least one", path=path)
    content = content_of(listed, surface_in_space(domain))
    with replacing(path) as temporary:
        temporary.write_text(content, encoding="utf-8")


def surface_in_space(domain: EmbeddedSurface | ForeignShape) -> EmbeddedSurface:
    """Convert an object of another package to a surface; a surface is returned unchanged."""
    shape = converted(domain)
    if not isinstance(shape, TriangleMesh | PolygonMesh | PointCloud | DigitalSurface):
        raise UnsupportedTypeError(f"curves lie on surfaces, not on a {type(shape).__name__}", element="domain")
    return shape


def placed(group: Group, domain: EmbeddedSurface) -> CurveOrPoints:
    """Convert a group to a curve on the surface, which is closed if it ends where it begins, or to points."""
    faces, weights = on_faces(group.nodes, domain)
    if group.kind == POINTS:
        return SurfacePoints(faces, weights)
    closed = len(group.nodes) > 2 and group.nodes[0] == group.nodes[-1]
    end = -1 if closed else None
    return Curve(faces[:end], weights[:end], closed=closed, oriented=group.kind == SIGNED)


def on_faces(nodes: Sequence[Node], domain: EmbeddedSurface) -> tuple[Ints, Floats]:
    """Return (n,) faces on which n nodes lie, and (n, 3) barycentric coordinates of the nodes in these faces."""
    mesh = domain.triangulation
    count = np.array([len(node.vertices) for node in nodes])
    faces, weights = np.zeros(len(nodes), dtype=np.int64), np.zeros((len(nodes), 3))
    alone = np.flatnonzero(count == 1).tolist()
    points = domain.points_at([nodes[k].vertices[0] for k in alone]) if alone else None
    if points is not None:
        faces[alone], weights[alone] = points.faces, points.barycentric
    several = np.flatnonzero(count > 1).tolist()
    named = np.array([v for k in several for v in nodes[k].vertices], dtype=np.int64)
    wanted = mask_of(mesh.n_vertices, named[(named >= 0) & (named < mesh.n_vertices)])
    around: dict[int, list[int]] = {}
    for face in np.flatnonzero(wanted[mesh.faces].any(axis=1)).tolist() if several else []:
        for v in mesh.faces[face].tolist():
            around.setdefault(v, []).append(face)
    for k in several:
        ids = nodes[k].vertices
        shared = set.intersection(*(set(around.get(v, ())) for v in ids))
        if not shared:
            raise SourceError(
                f"point {k} lies between vertices {list(ids)}, which no face has in common", element=f"point {k}"
            )
        faces[k] = min(shared)
        corners = mesh.faces[faces[k]].tolist()
        for v, w in zip(ids, nodes[k].weights, strict=True):
            weights[k, corners.index(v)] = w
    return faces, weights


def polylines_of_segments(kind: str, nodes: list[Node], segments: Sequence[tuple[int, int]]) -> list[Group]:
    """Join segments, which are pairs of indices of nodes, to curves of a kind. Equal nodes count as the same point."""
    bad = [s for s in segments if not all(0 <= i < len(nodes) for i in s)]
    if bad:
        raise FileFormatError(
            f"segment {list(bad[0])} names a node that does not exist: there are {len(nodes)}",
            element=f"segment {list(bad[0])}",
        )
    if not len(segments):
        return []
    consecutive = [(k, k + 1) for k in range(len(nodes) - 1)]
    if list(segments) in (consecutive, [*consecutive, (len(nodes) - 1, 0)]):
        run = [*range(len(nodes))] + [0] * (len(segments) == len(nodes))
        return [Group(kind, [nodes[i] for i in run])]
    rank: dict[Node, int] = {}
    numbers = np.array([rank.setdefault(node, len(rank)) for node in nodes])
    ends = numbers[np.array([s for s in segments if numbers[s[0]] != numbers[s[1]]], dtype=np.int64).reshape(-1, 2)]
    distinct = list(rank)
    groups = []
    for order, backwards, _ in assemble_polylines(ends[:, 0], ends[:, 1], directed=kind == SIGNED):
        first = np.where(backwards, ends[order, 1], ends[order, 0])
        last = ends[order[-1], 0 if backwards[-1] else 1]
        groups.append(Group(kind, [distinct[i] for i in [*first.tolist(), int(last)]]))
    return groups


def read_json(path: PathLike, domain: EmbeddedSurface) -> list[Group] | list[Curve]:
    """Read vertex ids and weights, or polylines in space, from JSON."""
    try:
        content = json_of(text(path))
        if not isinstance(content, dict) or not {"polylines", "groups"} & set(content):
            raise FileFormatError(
                'the file has neither "polylines" nor "groups"',
                remedy='write curves by write_curves, or as {"polylines": [{"points": [[x, y, z], …]}, …]}',
            )
        if "polylines" not in content:
            return groups_of(content)
        lines = [
            (json_numbers(line["points"], "points", FileFormatError), flag(line.get("closed", False), "closed"))
            for line in content["polylines"]
        ]
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        if isinstance(error, SignedHeatError):
            raise
        raise damaged(f"these are not curves with vertex ids and weights ({error!r})") from error
    return [domain.polyline(points, closed=closed) for points, closed in lines]


def groups_of(content: dict[str, Any]) -> list[Group]:
    """Parse curves and points that are given by vertex ids and weights."""
    base, groups = integer(content.get("index_base", 0), "index_base"), []
    for group in content["groups"]:
        nodes = [
            Node(
                tuple((integers(node["v"], "vertex ids", 0) - base).tolist()),
                tuple(vector(node["w"], "weights", len(node["v"])).tolist()),
            )
            for node in group["nodes"]
        ]
        if not all(0 < len(node.vertices) <= 3 for node in nodes):
            raise ValueError("a node needs one to three vertices")
        if group["kind"] == POINTS:
            groups.append(Group(POINTS, nodes))
        elif group["kind"] in (SIGNED, UNSIGNED):
            segments = [(i, j) for i, j in (integers(pair, "segments", 0).tolist() for pair in group["segments"])]
            groups += polylines_of_segments(group["kind"], nodes, segments)
        else:
            raise ValueError(f"the kind '{group['kind']}' is none of {SIGNED}, {UNSIGNED}, {POINTS}")
    return groups


def read_csv(path: PathLike, domain: EmbeddedSurface) -> list[Curve]:
    """Read polylines in space from tables of points, and project them on the domain."""
    return [domain.polyline(points, closed=closed) for points, closed in read_point_lists(path, 3)]


def read_obj(path: PathLike, domain: EmbeddedSurface) -> Iterable[Group | Curve]:
    """Read line and point elements of an OBJ file; they are projected unless its vertices are those of the surface."""
    positions, lines, points = read_obj_elements(path)
    bad = [i for ids in lines + points for i in ids if not 0 <= i < len(positions)]
    if bad:
        raise FileFormatError(
            f"vertex {bad[0] + 1} of an element does not exist: there are {len(positions)}",
            element=f"vertex {bad[0] + 1}",
        )
    corners = domain.triangulation.vertices
    scale = 1e-6 * float(np.ptp(corners, axis=0).max())
    n = min(len(positions), len(corners))
    if len(positions) <= len(corners) and n and np.abs(positions - corners[:n]).max() <= scale:
        groups = [Group(SIGNED, [Node((i,), (1.0,)) for i in ids]) for ids in lines]
        return groups + [Group(POINTS, [Node((i,), (1.0,)) for i in ids]) for ids in points]
    curves: list[Group | Curve] = []
    for ids in lines:
        closed = len(ids) > 2 and ids[0] == ids[-1]
        curves.append(domain.polyline(positions[ids[:-1] if closed else ids], closed=closed))
    for ids in points:
        faces, weights, _ = closest_points(domain.triangulation, positions[ids])
        curves.append(Group(POINTS, nodes_of(faces, weights, domain)))
    return curves


def nodes_of(faces: Ints, weights: Floats, domain: EmbeddedSurface) -> list[Node]:
    """Return nodes for points with barycentric weights on faces; corners with weight 0 are left out."""
    refuse_missing("face", faces, domain.triangulation.n_faces)
    corners = domain.triangulation.faces[faces]
    return [
        Node(tuple(v for v, w in zip(c, b, strict=True) if w > 0), tuple(w for w in b if w > 0))
        for c, b in zip(corners.tolist(), weights.tolist(), strict=True)
    ]


def _groups_to_write(curves: Sequence[CurveOrPoints], domain: EmbeddedSurface) -> list[Group]:
    """Convert curves and points to the groups that a file holds. Closed curves end with their first point."""
    groups = []
    for number, curve in enumerate(curves):
        if not isinstance(curve, (Curve, SurfacePoints)):
            raise SourceError(
                f"item {number} is a {type(curve).__name__}: files of curves hold Curve and SurfacePoints",
                element=f"item {number}",
            )
        nodes = nodes_of(curve.faces, curve.barycentric, domain)
        if isinstance(curve, Curve):
            nodes += nodes[:1] * curve.closed
        groups.append(
            Group(POINTS if isinstance(curve, SurfacePoints) else SIGNED if curve.oriented else UNSIGNED, nodes)
        )
    return groups


def write_json(curves: Sequence[CurveOrPoints], domain: EmbeddedSurface) -> str:
    """Return JSON with the vertex ids and weights of curves and points."""
    groups = []
    for group in _groups_to_write(curves, domain):
        nodes = [{"v": list(node.vertices), "w": list(node.weights)} for node in group.nodes]
        steps = [] if group.kind == POINTS else [[k, k + 1] for k in range(len(nodes) - 1)]
        groups.append({"kind": group.kind, "nodes": nodes, "segments": steps})
    return json.dumps({"index_base": 0, "groups": groups}) + "\n"


def write_obj(curves: Sequence[CurveOrPoints], domain: EmbeddedSurface) -> str:
    """Return OBJ text with a line element for each curve, and a point element for each set of points."""
    vertices: list[str] = []
    elements: list[str] = []
    for curve in curves:
        points = domain.positions(curve)
        ids = [len(vertices) + k + 1 for k in range(len(points))]
        vertices += [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
        if isinstance(curve, Curve):
            ids += ids[:1] * curve.closed
        elements.append(("l " if isinstance(curve, Curve) else "p ") + " ".join(map(str, ids)))
    return "\n".join([*vertices, *elements]) + "\n"


CURVE_READERS: dict[str, Callable[..., Iterable[Group | Curve]]] = {
    ".csv": read_csv,
    ".json": read_json,
    ".obj": read_obj,
}
CURVE_WRITERS: dict[str, Callable[..., str]] = {".json": write_json, ".obj": write_obj}
CURVE_FORMATS = frozenset(CURVE_WRITERS)
