"""Reading and writing of curves on surfaces.

The text format of the published demo, a similar one with oriented segments, OBJ line elements, and JSON, in which
points are vertex ids with weights. Edges are numbered by first appearance in the faces (corners 0–1, 1–2, 2–0, face
after face) and have the direction in which their first face runs along them; a fraction s is from tail to head.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..domains.curves import Curve, CurveOrPoints, SurfacePoints
from ..domains.digital_surface import DigitalSurface
from ..domains.foreign import ForeignShape, converted
from ..domains.kinds import EmbeddedSurface
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError, SourceError, UnsupportedTypeError
from ..geometry.geodesics.paths import gaps
from ..geometry.intrinsic_mesh import IntrinsicMesh
from ..geometry.surface_points import locate_points
from .curve_readers import (
    POINTS,
    SIGNED,
    UNSIGNED,
    Group,
    Node,
    edge_vertices,
    nodes_of,
    read_csv,
    read_json,
    read_obj,
    read_text,
)
from .files import PathLike, format_for, reading, replacing
from .globe import write_geojson


def read_curves(path: PathLike, domain: EmbeddedSurface | ForeignShape, strict: bool = False) -> list[CurveOrPoints]:
    """Read curves and points on a surface.

    Parameters
    ----------
    path : str or path
        A ``.txt`` file of the published demo: ``signed_curve`` (a following ``1`` reverses it), ``unsigned_curve`` or
        ``unsigned_point``, then nodes ``v vertex``, ``e edge fraction``, ``f face a b [c]`` (ids from 0) or ``l`` and
        vertex ids from 1; or nodes and oriented segments ``l i j`` between them, with ``#offset 0`` where ids start at
        0. A ``.obj`` file with line elements: on the vertices of the mesh if its vertices are those, projected onto it
        if not. A ``.json`` file with vertex ids and weights, or with ``{"polylines": [{"points": [[x, y, z], …],
        "closed": false}, …]}``, and a ``.csv`` file with x, y and z on each line and an empty line between polylines,
        both projected onto the surface.
    domain : TriangleMesh, PolygonMesh, PointCloud or DigitalSurface
        The surface that the ids refer to.
    strict : bool
        Refuse curves with consecutive points that share no face, which are otherwise joined by geodesic paths.

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

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_curves(f"{folder}/curves.txt", [mesh.path([0, 1, 2])], mesh)
    ...     read_curves(f"{folder}/curves.txt", mesh)
    [Curve(3 points, open, oriented)]
    """
    read_groups = format_for(path, READERS, "curves")
    domain = surface_in_space(domain)
    with reading(path):
        found = read_groups(path, domain)
        sources = [source if isinstance(source, Curve) else placed(source, domain) for source in found]
        if strict:
            refuse_gaps(sources, domain.triangulation)
    if not sources:
        raise FileFormatError("there is no curve and no point", remedy="check that it is a file of curves", path=path)
    return sources


def refuse_gaps(sources: Sequence[CurveOrPoints], mesh: TriangleMesh) -> None:
    """Raise a `SourceError` if consecutive points of a curve share no face."""
    lengths = mesh.edge_lengths[mesh.edges.face_edges]
    triangles = IntrinsicMesh.from_lengths(mesh.faces, lengths, mesh.n_vertices, mesh.edges)
    for number, source in enumerate(sources):
        if isinstance(source, Curve):
            places = locate_points(triangles, source.faces, source.barycentric, f"curve {number}: point")
            apart = gaps(triangles, places, source.closed)
            if len(apart):
                raise SourceError(
                    f"curve {number}: points {apart[0]} and {(apart[0] + 1) % source.n_points} share no face, "
                    f"nor do the ends of {len(apart) - 1} more segments",
                    remedy="add points, or read without strict to join them",
                    element=f"curve {number}",
                )


def write_curves(
    path: PathLike, curves: CurveOrPoints | Sequence[CurveOrPoints], domain: EmbeddedSurface | ForeignShape
) -> None:
    """Write curves and points on a surface, in the format given by the extension.

    ``.txt`` (the published demo's format) and ``.json`` keep everything except given normals, exactly; ``.obj`` has
    polylines in space.

    Parameters
    ----------
    path : str or path
        The file. It is written under a temporary name and renamed, so that an existing file survives a failure.
    curves : Curve, SurfacePoints or a sequence of them
        The curves and points.
    domain : TriangleMesh, PolygonMesh, PointCloud or DigitalSurface
        The surface they lie on.

    Raises
    ------
    FileFormatError
        If the format is unknown or the file cannot be written.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_curves(f"{folder}/side.txt", mesh.path([0, 1]), mesh)
    ...     read_curves(f"{folder}/side.txt", mesh)
    [Curve(2 points, open, oriented)]
    """
    content_of = format_for(path, WRITERS, "curves")
    listed = [curves] if isinstance(curves, (Curve, SurfacePoints)) else list(curves)
    content = content_of(listed, surface_in_space(domain))
    with replacing(path) as temporary:
        temporary.write_text(content, encoding="utf-8")


def surface_in_space(domain: EmbeddedSurface | ForeignShape) -> EmbeddedSurface:
    """The surface that an object of another package describes; a surface as it is."""
    shape = converted(domain)
    if not isinstance(shape, TriangleMesh | PolygonMesh | PointCloud | DigitalSurface):
        raise UnsupportedTypeError(f"curves lie on surfaces, not on a {type(shape).__name__}", element="domain")
    return shape


def placed(group: Group, domain: EmbeddedSurface) -> CurveOrPoints:
    """The curve or the points of a group."""
    faces, weights = on_faces(group.nodes, domain)
    if group.kind == POINTS:
        return SurfacePoints(faces, weights)
    closed = len(group.nodes) > 2 and group.nodes[0] == group.nodes[-1]
    end = -1 if closed else None
    return Curve(faces[:end], weights[:end], closed=closed, oriented=group.kind == SIGNED)


def on_faces(nodes: Sequence[Node], domain: EmbeddedSurface) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Face and barycentric coordinates of nodes."""
    mesh = domain.triangulation
    count = np.array([len(node.vertices) for node in nodes])
    faces, weights = np.zeros(len(nodes), dtype=np.int64), np.zeros((len(nodes), 3))
    alone = np.flatnonzero(count == 1).tolist()
    points = domain.points_at([nodes[k].vertices[0] for k in alone]) if alone else None
    if points is not None:
        faces[alone], weights[alone] = points.faces, points.barycentric
    several = np.flatnonzero(count > 1).tolist()
    wanted = np.zeros(mesh.n_vertices + 1, dtype=bool)
    named = np.array([v for k in several for v in nodes[k].vertices], dtype=np.int64)
    wanted[named[(named >= 0) & (named < mesh.n_vertices)]] = True
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


def groups_of(curves: Sequence[CurveOrPoints], domain: EmbeddedSurface) -> list[Group]:
    """Curves and points as groups of a file; closed curves end with their first point."""
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


def write_text(curves: Sequence[CurveOrPoints], domain: EmbeddedSurface) -> str:
    """The format of the published demo."""
    table = edge_vertices(domain)
    number = {tuple(sorted(e)): (k, e[0]) for k, e in enumerate(table.tolist())}
    lines = []
    for curve, group in zip(curves, groups_of(curves, domain), strict=True):
        lines.append(group.kind)
        faces = [*curve.faces.tolist(), int(curve.faces[0])]
        weights = [*curve.barycentric.tolist(), curve.barycentric[0].tolist()]
        for node, face, inside in zip(group.nodes, faces, weights, strict=False):
            if len(node.vertices) == 1:
                lines.append(f"v {node.vertices[0]}")
            elif len(node.vertices) == 2 and tuple(sorted(node.vertices)) in number:
                edge, tail = number[tuple(sorted(node.vertices))]
                lines.append(f"e {edge} {node.weights[0 if node.vertices[0] != tail else 1]!r}")
            else:
                lines.append(f"f {face} {' '.join(repr(w) for w in inside)}")
    return "\n".join(lines) + "\n"


def write_json(curves: Sequence[CurveOrPoints], domain: EmbeddedSurface) -> str:
    """JSON with vertex ids and weights."""
    groups = []
    for group in groups_of(curves, domain):
        nodes = [{"v": list(node.vertices), "w": list(node.weights)} for node in group.nodes]
        steps = [] if group.kind == POINTS else [[k, k + 1] for k in range(len(nodes) - 1)]
        groups.append({"kind": group.kind, "nodes": nodes, "segments": steps})
    return json.dumps({"index_base": 0, "groups": groups}) + "\n"


def write_obj(curves: Sequence[CurveOrPoints], domain: EmbeddedSurface) -> str:
    """Polylines in space."""
    mesh = domain.triangulation
    vertices: list[str] = []
    elements: list[str] = []
    for curve in curves:
        points = np.einsum("ik,ikj->ij", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]])
        ids = [len(vertices) + k + 1 for k in range(len(points))]
        vertices += [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
        if isinstance(curve, Curve):
            ids += ids[:1] * curve.closed
        elements.append(("l " if isinstance(curve, Curve) else "p ") + " ".join(map(str, ids)))
    return "\n".join([*vertices, *elements]) + "\n"


READERS: dict[str, Callable[..., Iterable[Group | Curve]]] = {
    ".csv": read_csv,
    ".json": read_json,
    ".obj": read_obj,
    ".txt": read_text,
}
WRITERS: dict[str, Callable[..., str]] = {
    ".geojson": write_geojson,
    ".json": write_json,
    ".obj": write_obj,
    ".txt": write_text,
}
CURVE_FORMATS = frozenset(WRITERS)
