"""Readers of curves on surfaces, one for each format: groups of nodes, or curves."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..domains.curves import Curve
from ..domains.kinds import EmbeddedSurface
from ..domains.polygon_mesh import PolygonMesh
from ..domains.projection import closest_points
from ..errors import FileFormatError, SignedHeatError
from ..geometry.polylines import assemble_polylines
from .files import PathLike, text
from .meshes import read_obj_elements
from .points import read_point_lists

KINDS = SIGNED, UNSIGNED, POINTS = "signed_curve", "unsigned_curve", "unsigned_point"


class Node(NamedTuple):
    """A point in a file: up to three vertices and their weights."""

    vertices: tuple[int, ...]
    weights: tuple[float, ...]


class Group(NamedTuple):
    """A curve in a file, or several points."""

    kind: str
    nodes: list[Node]


def edge_vertices(domain: EmbeddedSurface) -> NDArray[np.int64]:
    """(e, 2) tails and heads of the edges of a domain, by first appearance in its faces."""
    if not isinstance(domain, PolygonMesh):
        return domain.triangulation.edges.vertices
    ends = np.stack([domain.corners, domain.next_corners], axis=1)
    first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)[1]
    return ends[np.sort(first)]


def read_text(path: PathLike, domain: EmbeddedSurface) -> list[Group]:
    """Curves in either of the two text formats.

    That of the published demo has lines that begin a curve, or points; in the other one, nodes are joined by segments
    ``l i j``, which count them from 1 unless ``#offset`` says otherwise.
    """
    lines = [line.split() for line in text(path).splitlines()]
    has_kinds = any(words and words[0] in KINDS for words in lines)
    groups: list[tuple[Group, bool]] = []
    nodes: list[Node] = []
    segments: list[tuple[int, int]] = []
    offset, edges = 1, None
    for number, words in enumerate(lines, start=1):
        try:
            if words[:1] == ["#offset"] and len(words) > 1 and not has_kinds:
                if not re.fullmatch(r"[-+]?\d{1,18}", words[1]):
                    raise ValueError("the offset is no whole number")
                offset = int(words[1])
            elif not words or words[0].startswith("#") or (words[0] == "n" and not has_kinds):
                continue
            elif words[0] in KINDS:
                nodes = []
                groups.append((Group(words[0], nodes), words[1:2] == ["1"]))
            elif has_kinds and not groups:
                raise ValueError(f"a node comes before any {', '.join(KINDS)}")
            elif words[0] == "l" and has_kinds:
                nodes += [Node((int(word) - 1,), (1.0,)) for word in words[1:]]
            elif words[0] == "l":
                segments += pairwise(int(word) - offset for word in words[1:])
            else:
                edges = edge_vertices(domain) if edges is None and words[0] == "e" else edges
                nodes.append(parsed(words, edges, domain))
        except (ValueError, IndexError) as error:
            cause = f"line {number}, '{' '.join(words)[:60]}', makes no sense ({error})"
            raise FileFormatError(cause, element=f"line {number}") from error
    if not has_kinds:
        return polylines_of_segments(SIGNED, nodes, segments)
    return [Group(group.kind, group.nodes[::-1] if reverse else group.nodes) for group, reverse in groups]


def parsed(words: list[str], edges: NDArray[np.int64] | None, domain: EmbeddedSurface) -> Node:
    """A node from ``v i``, ``e i s`` or ``f i a b [c]``."""
    kind, index, numbers = words[0], int(words[1]), [float(word) for word in words[2:]]
    if kind == "v":
        return Node((index,), (1.0,))
    table = edges if kind == "e" else domain.triangulation.faces if kind == "f" else None
    if table is None:
        raise ValueError(f"'{kind}' is none of v, e, f, l")
    if not 0 <= index < len(table):
        raise ValueError(f"there is no {'edge' if kind == 'e' else 'face'} {index}; ids go from 0 to {len(table) - 1}")
    if len(numbers) != (1 if kind == "e" else 2) and not (kind == "f" and len(numbers) == 3):
        raise ValueError("an edge needs one number after its id, a face two or three")
    weights = (1 - numbers[0], numbers[0]) if kind == "e" else (*numbers[:2], 1 - numbers[0] - numbers[1])
    if not all(np.isfinite(weights)) or min(weights) < -1e-6 or (len(numbers) == 3 and abs(sum(numbers) - 1) > 1e-6):
        raise ValueError("fractions must be between 0 and 1 and add up to no more than 1")
    pairs = [(int(v), max(w, 0.0)) for v, w in zip(table[index], weights, strict=True) if w > 0]
    return Node(tuple(v for v, _ in pairs), tuple(w for _, w in pairs))


def polylines_of_segments(kind: str, nodes: list[Node], segments: Sequence[tuple[int, int]]) -> list[Group]:
    """Segments between nodes, joined to curves; nodes at the same position count as one."""
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
    place = np.array([rank.setdefault(node, len(rank)) for node in nodes])
    ends = place[np.array([s for s in segments if place[s[0]] != place[s[1]]], dtype=np.int64).reshape(-1, 2)]
    distinct = list(rank)
    groups = []
    for order, backwards, _ in assemble_polylines(ends[:, 0], ends[:, 1], directed=kind == SIGNED):
        first = np.where(backwards, ends[order, 1], ends[order, 0])
        last = ends[order[-1], 0 if backwards[-1] else 1]
        groups.append(Group(kind, [distinct[i] for i in [*first.tolist(), int(last)]]))
    return groups


def read_json(path: PathLike, domain: EmbeddedSurface) -> list[Group] | list[Curve]:
    """Vertex ids and weights, independent of any order of edges; or polylines in space."""
    try:
        content = json.loads(text(path))
        if "polylines" not in content:
            return groups_of(content)
        lines = [
            (np.array(line["points"], dtype=np.float64), bool(line.get("closed", False)))
            for line in content["polylines"]
        ]
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        if isinstance(error, SignedHeatError):
            raise
        raise FileFormatError(f"these are no curves with vertex ids and weights ({error!r})") from error
    return [domain.polyline(points, closed=closed) for points, closed in lines]


def groups_of(content: dict[str, Any]) -> list[Group]:
    """Curves with vertex ids and weights."""
    base, groups = int(content.get("index_base", 0)), []
    for group in content["groups"]:
        nodes = [
            Node(tuple(int(v) - base for v in node["v"]), tuple(float(w) for w in node["w"])) for node in group["nodes"]
        ]
        if any(len(n.vertices) != len(n.weights) or not 0 < len(n.vertices) <= 3 for n in nodes):
            raise ValueError("a node needs one to three vertices and as many weights")
        if group["kind"] == POINTS:
            groups.append(Group(POINTS, nodes))
        elif group["kind"] in (SIGNED, UNSIGNED):
            segments = [(int(i), int(j)) for i, j in group["segments"]]
            groups += polylines_of_segments(group["kind"], nodes, segments)
        else:
            raise ValueError(f"the kind '{group['kind']}' is none of {SIGNED}, {UNSIGNED}, {POINTS}")
    return groups


def read_csv(path: PathLike, domain: EmbeddedSurface) -> list[Curve]:
    """Polylines in space from tables of points, projected on the domain."""
    return [domain.polyline(points, closed=closed) for points, closed in read_point_lists(path, 3)]


def read_obj(path: PathLike, domain: EmbeddedSurface) -> Iterable[Group | Curve]:
    """Line and point elements of an OBJ file."""
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
    found: list[Group | Curve] = []
    for ids in lines:
        closed = len(ids) > 2 and ids[0] == ids[-1]
        found.append(domain.polyline(positions[ids[:-1] if closed else ids], closed=closed))
    if points:
        found += [Group(POINTS, projected_nodes(domain, positions[ids])) for ids in points]
    return found


def projected_nodes(domain: EmbeddedSurface, points: NDArray[np.float64]) -> list[Node]:
    """Closest points on a surface, as nodes."""
    faces, weights, _ = closest_points(domain.triangulation, points)
    return nodes_of(faces, weights, domain)


def nodes_of(faces: NDArray[np.int64], weights: NDArray[np.float64], domain: EmbeddedSurface) -> list[Node]:
    """Points on faces, as nodes."""
    corners = domain.triangulation.faces[faces]
    return [
        Node(tuple(v for v, w in zip(c, b, strict=True) if w > 0), tuple(w for w in b if w > 0))
        for c, b in zip(corners.tolist(), weights.tolist(), strict=True)
    ]
