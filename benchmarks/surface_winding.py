"""Winding numbers of curves on surfaces, a baseline: jump-harmonic functions and homology (Feng et al. 2023).

Written from the mathematics of Feng, Gillespie & Crane, *Winding Numbers on Discrete Surfaces*. u is harmonic away from
the curves and jumps by one across them; at free ends, where no function can jump, it is continuous. On surfaces with
handles the harmonic part γ of du belongs to curves that bound nothing: it is integrated to a function v that jumps
where that is cheap, on the curves themselves if possible, and w = u − v.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

import signedheat as sh
from shapes.jump_program import minimize_exactly
from signedheat.curves.jumps import JumpProblem
from signedheat.discretization import discretize
from signedheat.mesh.intrinsic_mesh import IntrinsicMesh
from signedheat.surfaces.cotan import cotan_matrix

ON_CURVE = 1e-2
"""Cost of a jump of v along the curves, relative to elsewhere."""


def winding_side(mesh: sh.TriangleMesh, curves: list[sh.Curve]) -> np.ndarray:
    """(n,) winding numbers minus one half at the vertices of a mesh: positive to the left of curves that bound."""
    domain = sh.intrinsic_delaunay(mesh, keep=curves)
    surface = discretize(domain)
    triangles = surface.triangles
    chain = edge_chain(triangles, [part for group in surface.segments(curves) for part in group])
    offsets = corner_offsets(triangles, chain)
    stiffness = cotan_matrix(triangles)
    stiffness = stiffness + sparse.triu(stiffness, 1).T
    u = harmonic(triangles, stiffness, offsets)
    if has_handles(triangles):
        u = u - unbounding(triangles, stiffness, u, chain)
    used = np.flatnonzero(chain)
    on_curve = np.isin(triangles.edges.face_edges, used)
    middle = 0.5 * (u + np.roll(u, -1, axis=1))[on_curve]
    u = u - np.average(middle, weights=triangles.edge_lengths[on_curve])
    count = np.bincount(triangles.corner_vertices.ravel(), minlength=triangles.n_vertices)
    return (np.bincount(triangles.corner_vertices.ravel(), u.ravel(), triangles.n_vertices) / count)[: mesh.n_vertices]


def edge_chain(triangles: IntrinsicMesh, parts: list) -> np.ndarray:
    """(e,) how often the curves run along each edge, from tail to head minus from head to tail."""
    chain = np.zeros(triangles.n_edges)
    for part in parts:
        start = part.nodes.elements[part.ends[:, 0]]
        np.add.at(chain, part.edges, np.where(triangles.edges.vertices[part.edges, 0] == start, 1.0, -1.0))
    return chain


def corner_offsets(triangles: IntrinsicMesh, chain: np.ndarray) -> np.ndarray:
    """(m, 3) numbers at corners that jump by the chain across each edge; 0 round vertices where they cannot."""
    faces_at = defaultdict(list)
    edges = triangles.edges
    near = np.zeros(triangles.n_vertices, dtype=bool)
    near[edges.vertices[chain != 0]] = True
    for face, corner in zip(*np.nonzero(near[triangles.corner_vertices]), strict=True):
        faces_at[int(triangles.corner_vertices[face, corner])].append((int(face), int(corner)))
    left = edges.forward  # a face lies to the left of the halfedges that it runs along
    offsets = np.zeros(triangles.corner_vertices.shape)
    for corners in faces_at.values():
        at_edge = defaultdict(list)
        for face, corner in corners:
            for side in (corner, (corner + 2) % 3):
                at_edge[int(edges.face_edges[face, side])].append((face, corner, bool(left[face, side])))
        links = defaultdict(list)
        for edge, pair in at_edge.items():
            if len(pair) == 2:
                (f, i, f_left), (g, j, _) = pair
                rise = chain[edge] if f_left else -chain[edge]  # value in f minus value in g
                links[f, i].append(((g, j), -rise))
                links[g, j].append(((f, i), rise))
        found: dict[tuple[int, int], float] = {}
        fits = True
        for start in corners:
            if start in found:
                continue
            found[start] = 0.0
            stack = [start]
            while stack:
                here = stack.pop()
                for there, rise in links[here]:
                    if there not in found:
                        found[there] = found[here] + rise
                        stack.append(there)
                    elif abs(found[there] - found[here] - rise) > 0.5:
                        fits = False
        if fits:
            for (face, corner), value in found.items():
                offsets[face, corner] = value
    return offsets


def gradients(triangles: IntrinsicMesh, at_corners: np.ndarray) -> np.ndarray:
    """(m,) gradients of functions that are linear in every face."""
    opposite = 1j * np.roll(triangles.edge_vectors, -1, axis=1)
    return (at_corners * opposite).sum(axis=1) / (2 * triangles.face_areas)


def harmonic(triangles: IntrinsicMesh, stiffness: sparse.csr_matrix, offsets: np.ndarray) -> np.ndarray:
    """(m, 3) corner values of the function of least energy with these jumps."""
    load = divergence(triangles, gradients(triangles, offsets))
    return offsets - solve(stiffness, load)[triangles.corner_vertices]


def divergence(triangles: IntrinsicMesh, fields: np.ndarray) -> np.ndarray:
    """(n,) ∫ ⟨∇λ_i, Y⟩."""
    opposite = 1j * np.roll(triangles.edge_vectors, -1, axis=1)
    shares = 0.5 * (np.conj(fields)[:, None] * opposite).real
    return np.bincount(triangles.corner_vertices.ravel(), shares.ravel(), triangles.n_vertices)


def solve(stiffness: sparse.csr_matrix, load: np.ndarray) -> np.ndarray:
    """Solution of the Laplace problem, with one vertex held."""
    held = sparse.csc_matrix(
        stiffness + sparse.diags(np.r_[1.0, np.zeros(len(load) - 1)] * stiffness.diagonal().mean())
    )
    return splu(held).solve(load - load.mean())


def has_handles(triangles: IntrinsicMesh) -> bool:
    """Whether the surface is neither a sphere nor a disk."""
    used = len(np.unique(triangles.corner_vertices))
    loops = triangles.edges.face_counts
    return used - triangles.n_edges + triangles.n_faces < (1 if (loops == 1).any() else 2)


def unbounding(triangles: IntrinsicMesh, stiffness: sparse.csr_matrix, u: np.ndarray, chain: np.ndarray) -> np.ndarray:
    """(m, 3) v: the function whose derivative is the harmonic part of du, with the cheapest jumps."""
    field = gradients(triangles, u)
    # du has no exact part, u being harmonic; its coexact part, the turned gradient of a function, is due to free ends
    turned = -1j * field
    stream = solve(stiffness, divergence(triangles, turned))
    remainder = field - 1j * gradients(triangles, stream[triangles.corner_vertices])
    remainder = remainder - gradients(
        triangles, solve(stiffness, divergence(triangles, remainder))[triangles.corner_vertices]
    )
    centers = triangles.corner_positions.mean(axis=1, keepdims=True)
    slopes = (np.conj(remainder)[:, None] * (triangles.corner_positions - centers)).real
    order = np.argsort(triangles.edges.face_edges.ravel(), kind="stable")
    sorted_edges = triangles.edges.face_edges.ravel()[order]
    first = np.flatnonzero(sorted_edges[1:] == sorted_edges[:-1])
    one, two, edge = order[first], order[first + 1], sorted_edges[first]
    middle = 0.5 * (slopes + np.roll(slopes, -1, axis=1)).ravel()
    differences = middle[two] - middle[one]
    weights = triangles.lengths_of_edges[edge] * np.where(chain[edge] != 0, ON_CURVE, 1.0)
    problem = JumpProblem(np.stack([one // 3, two // 3], axis=1), differences, differences, weights, triangles.n_faces)
    return slopes + minimize_exactly(problem).constants[:, None]
