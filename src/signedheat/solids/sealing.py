"""Keep only the faces that can be reached from outside through wide openings.

A ball that rolls in from outside gets through openings wider than itself. Its centre stays where the distance to all
faces is more than its radius; this region is flooded from outside on a grid. A side of a face is outside if a ball
whose centre is flooded touches it, or if it continues such a side and lies no deeper than a corner that the ball does
not fill.
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
"""Number of grid cells across the narrowest opening that lets the ball through."""
BYTES_OF_FLOOD = 12.0
"""Peak memory of the flood per grid cell."""
TOUCHING = 0.9
"""A ball that is placed on a face touches it if all faces are at least this far from its centre, relative to its
radius. At 1, balls would not touch the facets of hollows."""
NEARER = 8.0
"""Factor by which the balls shrink that must all touch a face at the same point; small ones stay on one side of a thin
wall."""
SMALLEST_BALL = 1e-6
"""Radius of the smallest of these balls, relative to the largest. The sides of thinner walls are not told apart."""
CORNER_DEPTH = 2.0
"""Faces in corners are kept up to this distance from the centres of balls, in radii: in corners of 60° and more."""


@dataclass(frozen=True, eq=False)
class Flood:
    """Where the centre of a ball can be that comes from outside."""

    tree: FaceTree  # of the faces
    radius: float  # radius of the ball
    spacing: float  # spacing of the grid that is flooded
    border: PointTree  # centres of flooded cells next to others

    @classmethod
    def around(cls, triangles: Floats, length: float) -> Flood:
        """Flood the surroundings of (m, 3, 3) triangles by a ball with diameter `length`."""
        radius, spacing = 0.5 * length, length / CELLS_PER_OPENING
        lower = triangles.min(axis=(0, 1)) - radius - 3 * spacing
        counts = np.ceil((triangles.max(axis=(0, 1)) + radius + 3 * spacing - lower) / (BLOCK * spacing))
        refuse_beyond_memory(
            f"sealing openings of {length:.3g}",
            int(np.prod(counts * BLOCK)),
            lambda n: BYTES_OF_FLOOD * n,
            lambda _: "seal wider openings only",
        )
        # where a ball is free, by the distance of the middle of each block, or node by node where that is unclear
        blocks = counts.astype(int)
        tree = FaceTree.of_triangles(triangles)
        free = np.zeros((*blocks, BLOCK, BLOCK, BLOCK), dtype=bool)
        corners = np.stack(np.meshgrid(*map(np.arange, blocks), indexing="ij"), axis=-1).reshape(-1, 3) * BLOCK
        within = np.stack(np.meshgrid(*[np.arange(BLOCK)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        middle, reach = 0.5 * (BLOCK - 1), 0.5 * (BLOCK - 1) * np.sqrt(3.0) * spacing
        rough = tree.distances(lower + spacing * (corners + middle))
        free.reshape(len(corners), -1)[rough > radius + reach] = True
        for rows in np.array_split(near := np.flatnonzero(np.abs(rough - radius) <= reach), 1 + len(near) // 2048):
            points = lower + spacing * (corners[rows][:, None] + within).reshape(-1, 3)
            free.reshape(len(corners), -1)[rows] = (tree.distances(points) > radius).reshape(len(rows), -1)
        # the part of this that is connected with the corner of the grid
        nodes = free.transpose(0, 3, 1, 4, 2, 5).reshape(blocks * BLOCK)
        labels, _ = scipy.ndimage.label(nodes)
        outside = labels == labels[0, 0, 0]
        border = np.argwhere(outside & ~scipy.ndimage.binary_erosion(outside, border_value=1))
        return cls(tree, radius, spacing, PointTree(lower + spacing * border))

    def touches(self, points: Floats, normals: Floats) -> Bools:
        """(n,) whether a flooded ball touches the faces at (n, 3) points, on the side of the (n, 3) unit normals."""
        rows, radius = np.arange(len(points)), self.radius
        centres = points + radius * normals
        rows = rows[self.border.query(centres, distance_upper_bound=2 * self.spacing)[0] < 2 * self.spacing]
        while radius > SMALLEST_BALL * self.radius and len(rows):
            rows = rows[self.tree.distances(points[rows] + radius * normals[rows]) >= TOUCHING * radius]
            radius /= NEARER
        touched = np.zeros(len(points), dtype=bool)
        touched[rows] = True
        return touched

    def shallow(self, points: Floats) -> Bools:
        """(n,) whether (n, 3) points lie no deeper than `CORNER_DEPTH` from the centre of a flooded ball."""
        return np.asarray(self.border.query(points)[0] < CORNER_DEPTH * self.radius + self.spacing)


def sealed(mesh: TriangleMesh, length: float) -> tuple[TriangleMesh, Ints, LeftOut]:
    """Keep the faces that are reached from outside through openings wider than `length`, oriented outwards.

    Faces are cut where they cross. Also return the (k,) given faces that those of the result are parts of, and a note
    on how much was left out.
    """
    if not SMALLEST_EXTENT <= length <= LARGEST_COORDINATE:
        raise GeometryError(
            f"seal is {length:g}, and lengths from {SMALLEST_EXTENT:g} to {LARGEST_COORDINATE:g} can be computed with",
            remedy="seal openings of about the size of the shape or less",
            element="seal",
        )
    # which sides of the pieces a ball touches at the middle of a part, and which pieces are shallow all over
    pieces = arranged(mesh.vertices, mesh.faces)
    triangles = pieces.points[pieces.faces]
    flood = Flood.around(triangles, length)
    normals = unit(area_vectors(triangles))
    parts, owners = cut_small(triangles, lambda pieces: side_lengths(pieces).max(axis=1) <= flood.spacing)
    centres = parts.mean(axis=1)
    n = len(triangles)
    outside = np.zeros((n, 2), dtype=bool)  # in front of each piece, and behind it
    shallow = np.ones(n, dtype=bool)
    shallow[owners[~flood.shallow(centres)]] = False
    for side, way in enumerate((1.0, -1.0)):
        outside[owners[flood.touches(centres, way * normals[owners])], side] = True
    # side 2 f of piece f is in front of it, 2 f + 1 behind; across an edge of two faces, each side goes on
    table = edge_table(pieces.faces)
    pairs = table.pairs  # halfedges of edges with two faces
    disagree = table.forward.ravel()[pairs[:, 0]] == table.forward.ravel()[pairs[:, 1]]
    first, second = pairs.T // 3
    both_shallow = shallow[first] & shallow[second]
    sides = np.concatenate([2 * first, 2 * first + 1])
    next_sides = np.concatenate([2 * second + disagree, 2 * second + 1 - disagree])
    shallow_pairs = np.concatenate([both_shallow, both_shallow])
    # where one of the two is touched, the other one need only be shallow itself
    labels = connected_components(2 * n, sides[shallow_pairs], next_sides[shallow_pairs])
    seeds = outside.ravel().copy()
    for a, b in ((sides, next_sides), (next_sides, sides)):
        seeds[b[outside.ravel()[a] & shallow[b // 2]]] = True
    reached = np.isin(labels, labels[seeds & shallow.repeat(2)]) & shallow.repeat(2) | seeds
    front, back = reached.reshape(n, 2).T
    kept = front | back
    if not kept.any():
        raise SourceError(
            f"nothing of the shape is reached by a ball of diameter {length:.3g}", remedy="seal narrower openings only"
        )
    flipped = back & ~front
    faces = np.where(flipped[:, None], pieces.faces[:, ::-1], pieces.faces)[kept]
    areas, lost = face_areas(triangles), np.unique(pieces.origins[~kept])
    share = float(areas[~kept].sum() / max(float(areas.sum()), np.finfo(float).tiny))
    note = LeftOut(len(lost), share, int(np.isin(lost, pieces.origins[kept]).sum()))
    used, faces = np.unique(faces, return_inverse=True)
    return TriangleMesh(pieces.points[used], faces.reshape(-1, 3)), pieces.origins[kept], note
