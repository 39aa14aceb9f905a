"""Keep only what can be reached from outside through wide openings: skins, leaks and rubbish within are left out.

A ball that rolls in from outside gets through openings wider than itself. Its centre stays where the distance to all
faces is more than its radius: that is flooded from outside on a grid. A side of a face is outside if a ball touches it
whose centre is flooded, or if it goes on from such a side and lies no deeper than a corner that the ball does not fill.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ..arrays import Bools, Floats, Ints
from ..diagnostics import LeftOut
from ..errors import GeometryError, SourceError
from ..grids.blocks import BLOCK
from ..memory import refuse_beyond_memory
from ..mesh.arrangement import arranged
from ..mesh.components import connected_components
from ..mesh.edges import edge_table
from ..mesh.triangles import area_vectors, cut_small, face_areas, side_lengths
from ..mesh.unit_vectors import unit
from ..parallel import PointTree
from ..search.face_tree import FaceTree
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import LARGEST_COORDINATE, SMALLEST_EXTENT

CELLS_PER_OPENING = 6.0
"""Cells of the grid across the narrowest opening that is passed."""
BYTES_OF_FLOOD = 12.0
"""Memory of the flood, for each cell."""
TOUCHING = 0.9
"""A ball touches a face if the distance of its centre to all faces is at least this share of its radius: also the
facets of hollows."""
NEARER = 8.0
"""Factor between the radii of the balls that must touch a face at one place, so that none reaches through a wall."""
SMALLEST_BALL = 1e-6
"""Radius of the smallest of these balls, relative to the largest: walls that are thinner count as one."""
CORNER_DEPTH = 2.0
"""Distance from the centres of balls, in radii, up to which faces in corners are kept: those of 60° and more are."""


@dataclass(frozen=True, eq=False)
class Flood:
    """Where the centre of a ball can be that comes from outside."""

    tree: FaceTree
    radius: float
    spacing: float
    border: PointTree  # centres of flooded cells next to others

    @classmethod
    def around(cls, triangles: Floats, length: float) -> Flood:
        """Flood the surroundings of (m, 3, 3) triangles by a ball with this diameter."""
        radius, spacing = 0.5 * length, length / CELLS_PER_OPENING
        lower = triangles.min(axis=(0, 1)) - radius - 3 * spacing
        counts = np.ceil((triangles.max(axis=(0, 1)) + radius + 3 * spacing - lower) / (BLOCK * spacing))
        refuse_beyond_memory(
            f"sealing openings of {length:.3g}",
            int(np.prod(counts * BLOCK)),
            lambda n: BYTES_OF_FLOOD * n,
            lambda _: "seal wider openings only",
        )
        blocks = counts.astype(int)
        tree = FaceTree.of_triangles(triangles)
        free = np.zeros((*blocks, BLOCK, BLOCK, BLOCK), dtype=bool)
        corners = np.stack(np.meshgrid(*map(np.arange, blocks), indexing="ij"), axis=-1).reshape(-1, 3) * BLOCK
        within = np.stack(np.meshgrid(*[np.arange(BLOCK)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        middle, reach = 0.5 * (BLOCK - 1), 0.5 * (BLOCK - 1) * np.sqrt(3.0) * spacing
        rough = tree.distances(lower + spacing * (corners + middle))
        free.reshape(len(corners), -1)[rough > radius + reach] = True
        for rows in np.array_split(near := np.flatnonzero(np.abs(rough - radius) <= reach), 1 + len(near) // 2048):
            places = lower + spacing * (corners[rows][:, None] + within).reshape(-1, 3)
            free.reshape(len(corners), -1)[rows] = (tree.distances(places) > radius).reshape(len(rows), -1)
        nodes = free.transpose(0, 3, 1, 4, 2, 5).reshape(blocks * BLOCK)
        labels, _ = scipy.ndimage.label(nodes)
        outside = labels == labels[0, 0, 0]
        border = np.argwhere(outside & ~scipy.ndimage.binary_erosion(outside, border_value=1))
        return cls(tree, radius, spacing, PointTree(lower + spacing * border))

    def touches(self, places: Floats, normals: Floats) -> Bools:
        """(n,) whether a flooded ball touches faces at (n, 3) places on the side of unit normals."""
        rows, size = np.arange(len(places)), self.radius
        centres = places + size * normals
        rows = rows[self.border.query(centres, distance_upper_bound=2 * self.spacing)[0] < 2 * self.spacing]
        while size > SMALLEST_BALL * self.radius and len(rows):
            rows = rows[self.tree.distances(places[rows] + size * normals[rows]) >= TOUCHING * size]
            size /= NEARER
        found = np.zeros(len(places), dtype=bool)
        found[rows] = True
        return found

    def shallow(self, places: Floats) -> Bools:
        """(n,) whether (n, 3) places lie no deeper than a corner that a flooded ball does not fill."""
        return np.asarray(self.border.query(places)[0] < CORNER_DEPTH * self.radius + self.spacing)


def sealed(mesh: TriangleMesh, length: float) -> tuple[TriangleMesh, Ints, LeftOut]:
    """Return the faces that are reached from outside through openings wider than a length, facing there.

    Faces are cut where they cross. Also returned are the (k,) faces that they are parts of, and what was left out.
    """
    if not SMALLEST_EXTENT <= length <= LARGEST_COORDINATE:
        raise GeometryError(
            f"seal is {length:g}, and lengths from {SMALLEST_EXTENT:g} to {LARGEST_COORDINATE:g} can be computed with",
            remedy="seal openings of about the size of the shape or less",
            element="seal",
        )
    pieces = arranged(mesh.vertices, mesh.faces)
    triangles = pieces.points[pieces.faces]
    flood = Flood.around(triangles, length)
    normals = unit(area_vectors(triangles))
    parts, owners = cut_small(triangles, lambda pieces: side_lengths(pieces).max(axis=1) <= flood.spacing)
    places = parts.mean(axis=1)
    n = len(triangles)
    outside = np.zeros((n, 2), dtype=bool)  # in front of each piece, and behind it
    shallow = np.ones(n, dtype=bool)
    shallow[owners[~flood.shallow(places)]] = False
    for side, way in enumerate((1.0, -1.0)):
        outside[owners[flood.touches(places, way * normals[owners])], side] = True
    table = edge_table(pieces.faces)
    pairs = table.pairs  # halfedges of edges with two faces
    same = table.forward.ravel()[pairs[:, 0]] == table.forward.ravel()[pairs[:, 1]]
    first, second = pairs.T // 3
    both = shallow[first] & shallow[second]
    ones = np.concatenate([2 * first, 2 * first + 1])
    others = np.concatenate([2 * second + same, 2 * second + 1 - same])
    near = np.concatenate([both, both])
    # where one of the two is touched, the other one need only be shallow itself
    labels = connected_components(2 * n, ones[near], others[near])
    seeds = outside.ravel().copy()
    for a, b in ((ones, others), (others, ones)):
        seeds[b[outside.ravel()[a] & shallow[b // 2]]] = True
    reached = np.isin(labels, labels[seeds & shallow.repeat(2)]) & shallow.repeat(2) | seeds
    front, back = reached.reshape(n, 2).T
    kept = front | back
    if not kept.any():
        raise SourceError(
            f"nothing of the shape is reached by a ball of diameter {length:.3g}", remedy="seal narrower openings only"
        )
    turned = back & ~front
    faces = np.where(turned[:, None], pieces.faces[:, ::-1], pieces.faces)[kept]
    areas, lost = face_areas(triangles), np.unique(pieces.origins[~kept])
    share = float(areas[~kept].sum() / max(float(areas.sum()), np.finfo(float).tiny))
    note = LeftOut(len(lost), share, int(np.isin(lost, pieces.origins[kept]).sum()))
    used, faces = np.unique(faces, return_inverse=True)
    return TriangleMesh(pieces.points[used], faces.reshape(-1, 3)), pieces.origins[kept], note
