"""Signed distance to broken curves on surfaces: exact to the curves, with gaps completed by the signed heat method.

It is measured on a repaired mesh, without copies of faces and with faces flipped to agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, Literal, TypeVar

import numpy as np

from ..arrays import Bools, Ints
from ..constraints import Constraint, EachComponent, Free, LevelValues, Soft, ZeroSet
from ..diagnostics import Note
from ..errors import ConstraintError, InexactWarning, counted, percent, warn_user
from ..fields.field import Field
from ..fields.sharpening import sharpen
from ..jobs import bound_progress, part_of_work
from ..mesh.components import connected_components, grouped
from ..mesh.welding import GAP_UNITS, SEAM_UNITS, joined_rims
from ..methods import SOURCE_TOLERANCE
from ..shapes.foreign import as_list
from ..shapes.kinds import AnySurface, SurfaceDomain
from ..solver import SignedHeatSolver, distance_unwarned, field_without_heat
from ..surfaces.intrinsic_triangulation import IntrinsicTriangulation
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.repaired_mesh import RepairedMesh
from ..surfaces.source_segments import as_curves, given_curves, numbers_given, segments_of
from ..surfaces.surface_curves import Curve, CurveOrPoints, CurvesAndPoints, ElementList, SurfacePoints
from ..surfaces.surface_discretization import SurfaceDiscretization
from ..surfaces.surface_sharpening import distance_without_heat
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import flag
from .gaps import Gaps
from .resolution import flattened, on_resolving_triangles, surface_of, triangulated_once
from .stroke_directions import CurvePieces, Decision, bound_as_given, decide, pieces_for_all, with_turned
from .surroundings import Surroundings


def warn_of_gaps(mesh: object) -> None:
    """Warn if boundary vertices of a mesh are so near others that a seam may be meant, but too far apart to be welded.

    Nothing happens for other domains.
    """
    if not isinstance(mesh, TriangleMesh | PolygonMesh):
        return
    joined, nearly = (joined_rims(mesh.vertices, *_halfedges(mesh), units) for units in (SEAM_UNITS, GAP_UNITS))
    gaps = np.flatnonzero((nearly != joined) & (joined == np.arange(len(joined))))
    if len(gaps):
        warn_user(
            "boundary edges of the surface run along each other, less than "
            f"{GAP_UNITS * 2.0**-24:.0e} of its size apart, at {counted(len(gaps), 'vertex')}, the first of them "
            f"number {gaps[0]}: distance goes round the gap. Merge these vertices with those beside them if they are "
            "one",
            InexactWarning,
        )


def _halfedges(mesh: TriangleMesh | PolygonMesh) -> tuple[Ints, Ints]:
    """Return the (h,) first and (h,) second vertices of the halfedges of a mesh, one for each corner of its faces."""
    if isinstance(mesh, PolygonMesh):
        return mesh.corners, mesh.next_corners
    return mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()


UNTRUSTWORTHY = 0.1
"""Share of the area above which there is a warning if the shortest completion and that by heat differ on it. With half
of it there are no more warnings on 259 drawings. Two of 30 curves in twelve pieces, half of them gone, get a warning
for this reason alone, and both are wrong."""

MOST_LEFT_OUT = 0.25
"""Share of the length of the curves above which there is a warning if it is left out."""

GAP_EDGES = 2.0
"""Width of a gap, in mean edge lengths, above which a shortest path may close it. Heat closes narrower gaps."""

Surface = TypeVar("Surface", bound=SurfaceDomain)


@dataclass(frozen=True, eq=False, repr=False)
class CurvesTaken(Note):
    """Note on the given curves that were flipped, and on those that were left out.

    Attributes
    ----------
    turned : list of int
        Numbers of the curves that were flipped.
    left_out : list of int
        Numbers of the curves that were left out, since they bound nothing together with the others.
    share_left_out : float
        Length of the curves left out, as a fraction of the length of all curves.
    """

    turned: list[int]
    left_out: list[int]
    share_left_out: float

    @property
    def important(self) -> bool:
        return True

    def __str__(self) -> str:
        texts = [
            f"{name}: {len(numbers)}, the first of them number {numbers[0]}"
            for name, numbers in (("curves flipped", self.turned), ("curves left out", self.left_out))
            if len(numbers)
        ]
        share = [f"{self.share_left_out:.2g} of the length left out"] if len(self.left_out) else []
        return "; ".join(texts + share) or "curves are used as given"


def distance_to_pieces(
    solver: SignedHeatSolver[Surface],
    curves: CurvesAndPoints,
    constraint: Constraint | None,
    every_piece: bool,
    numbers: Ints | None = None,
    pieces: CurvePieces | None = None,
) -> tuple[Field[Surface], list[CurveOrPoints], str]:
    """Return the signed distance, by heat, to curves that may be pieces of broken ones, and the oriented curves.

    Third, the warning that the caller is to give if the answer is a guess, else "".

    Pieces are flipped so that they bound something together (`curve_orientation`). Pieces that bound nothing are left
    out, unless most bound nothing. Where faces cannot be oriented consistently around the curves, these are used as
    given.

    Warnings and notes name curves by `numbers`, (n,), by default their indices in the list. `pieces` are the curves as
    strokes, by default on the triangles of the solver. The curves returned are those that distance was measured to.
    """
    listed = flattened(curves)
    numbers = np.arange(len(listed)) if numbers is None else numbers
    once = triangulated_once(solver, listed)
    pieces = pieces or CurvePieces.of(surface_of(once), listed)
    if pieces is None:
        return distance_unwarned(once, listed, constraint), listed, ""
    if isinstance(solver.domain, TriangleMesh) and not has_sides(solver.domain, listed):
        doubt = (
            "curves run where faces cannot agree which side of them is left, on a surface with one side or across "
            "edges of more than two faces: curves were used as they are, and which side is which away from them "
            "is a guess. Leave out faces, or close the curves"
        )
        return distance_unwarned(once, listed, constraint), listed, doubt if pieces.is_piece.any() else ""
    decision = decide(pieces, every_piece)
    turn = decision.turned(len(listed))
    left_out = pieces.curves(decision.loose)
    used = [curve for k, curve in enumerate(with_turned(listed, turn)) if k not in set(left_out.tolist())]
    field = distance_unwarned(once, used, constraint)
    closing = closing_curves(field, used, GAP_EDGES * float(pieces.strokes.surface.triangles.lengths_of_edges.mean()))
    if closing:
        field = distance_unwarned(once, [*used, *closing], constraint)
    turn[left_out] = False
    share = float(pieces.strokes.lengths[decision.loose].sum() / pieces.strokes.lengths.sum())
    if turn.any() or len(left_out):
        note = CurvesTaken(numbers[turn].tolist(), numbers[left_out].tolist(), share)
        field = replace(field, diagnostics=field.diagnostics.noting(note))
    reason = reason_for_doubt(decision, field, listed, numbers)
    loops = numbers[decision.loops_left_out()] if len(left_out) else left_out
    if share > MOST_LEFT_OUT and not reason:
        reason = (
            f"{share:.0%} of the length of the curves was left out, as it bounds nothing with the others: "
            f"{named(numbers[left_out])}. Draw what is missing; every_piece=True takes all curves, and "
            'completion="none" measures unsigned distance, as to roads with junctions'
        )
    if len(loops) and not reason:
        reason = (
            f"what goes round, but bounds nothing with the others, was left out: {named(loops)}. every_piece=True "
            "takes all curves"
        )
    return field, used, reason


def closing_curves(field: Field[Surface], curves: Sequence[CurveOrPoints], least: float) -> list[Curve]:
    """Return shortest paths along the surface across gaps at which the zero set of the field bulges.

    Only gaps of curves that nearly close count (`Gaps`), and only those longer than `least`, in the units of the
    surface.
    """
    surface = field.domain.mesh if isinstance(field.domain, IntrinsicTriangulation) else field.domain
    lines = [curve for curve in curves if isinstance(curve, Curve) and curve.oriented]
    strokes = [curve for curve in lines if not curve.closed]
    points, closed = [surface.positions(c) for c in strokes], [surface.positions(c) for c in lines if c.closed]
    gaps = Gaps.of(points) if points else None
    zero_set = [surface.positions(c) for c in field.contour(0.0)] if gaps and len(gaps.strokes) else []
    if not gaps or not zero_set:
        return []
    paths = []
    for tail, head in gaps.bulging(points, closed, np.concatenate(zero_set), least).tolist():
        ends = ((strokes[tail], [-1]), (strokes[head], [0]))
        path = surface.shortest_path(*(SurfacePoints(curve.faces[k], curve.barycentric[k]) for curve, k in ends))
        paths.append(Curve(path.faces, path.barycentric))
    return paths


def has_sides(mesh: TriangleMesh, curves: Sequence[CurveOrPoints]) -> bool:
    """Whether every curve has a left and a right side: the faces it runs on are connected and can be oriented alike."""
    mesh = mesh.joined
    if (mesh.edges.face_counts == 2 - (mesh.edges.balance != 0)).all():
        return True
    crossed = [segments_of(curve, mesh.intrinsic, mesh.vertices).faces for curve in curves]
    sheet = sheet_faces(mesh, np.concatenate(crossed))
    edges = TriangleMesh(mesh.vertices, mesh.faces[sheet]).edges
    label = np.full(mesh.n_faces, -1)
    label[sheet] = connected_components(int(sheet.sum()), *(edges.pairs // 3).T)
    disagrees = ((edges.face_counts == 2) & (edges.balance != 0))[edges.face_edges].any(axis=1)
    bad = np.isin(label, [-1, *label[sheet][disagrees]])
    return not any(bool(bad[faces].any() or np.ptp(label[faces]) > 0) for faces in crossed if len(faces))


def sheet_faces(mesh: TriangleMesh, crossed: Ints) -> Bools:
    """Return (m,) bool, true for the faces of a sheet in a mesh with edges of three or more faces.

    `crossed` are the ids of faces that curves cross. Connected parts are added one by one, first those that curves
    cross, then the largest. A part that would put a third face on an edge of the sheet is left out.
    """
    edges = mesh.edges
    part = connected_components(mesh.n_faces, *(edges.pairs // 3).T)
    areas = np.bincount(part, mesh.face_areas)
    is_crossed = np.bincount(part[crossed], minlength=len(areas)) > 0
    count, kept = np.zeros(len(edges.vertices), dtype=np.int64), np.zeros(len(areas), dtype=bool)
    crowded = edges.face_counts[edges.face_edges] > 2
    starts, members = grouped(part, len(areas))
    for label in np.lexsort([-areas, ~is_crossed]):
        faces = members[starts[label] : starts[label + 1]]
        edge_ids, number = np.unique(edges.face_edges[faces][crowded[faces]], return_counts=True)
        kept[label] = ((count[edge_ids] == 0) | (count[edge_ids] + number <= 2)).all()
        count[edge_ids] += kept[label] * number
    return np.asarray(kept[part])


def reason_for_doubt(decision: Decision, field: Field[Surface], curves: Sequence[CurveOrPoints], numbers: Ints) -> str:
    """Return the text of a warning that says why the region that the curves bound is a guess, and what to do.

    The text is empty if the region is no guess. `field` is the distance, completed by heat, to the curves that were not
    left out. `curves` are all n given curves, which the text names by their `numbers`, (n,).
    """
    as_given = (
        'as_oriented=True takes curves as they are, and completion="none" measures unsigned distance, as to roads with '
        "junctions"
    )
    if decision.bounds_nothing:
        return (
            "most of the curves bound nothing together: which side is which away from them is a guess. Draw what is "
            f"missing, or flip curves that run the wrong way; {as_given}"
        )
    against = numbers[decision.turned_loops()]
    if len(against):
        return (
            f"{named(against)} ran against about as much of the others, and {'were' if len(against) > 1 else 'was'} "
            f"flipped: which of them are right is a guess. {as_given}"
        )
    if decision.tied:
        return (
            "the curves bound something else as well: which of the two is meant is a guess. Draw what is missing, or "
            f"flip curves that run the wrong way; {as_given}"
        )
    doubtful = numbers[decision.worth_little()]
    if len(doubtful):
        return (
            f"the region depends on {named(doubtful)}, and closing the gaps takes lines more than half as long: that "
            "is a guess. Remove what belongs to no curve, flip what runs the wrong way, or draw what is missing; "
            f"{as_given}"
        )
    strokes = decision.pieces.strokes
    if not decision.all_bound or not all(isinstance(curve, Curve) and curve.oriented for curve in curves):
        return ""  # what does not bound the region changes the sign of the field, too
    # compare the sides of the shortest completion with those of the completion by heat
    vertices = strokes.surface.restriction
    areas, sides = strokes.areas[vertices], decision.best.sides[vertices]
    near = np.abs(field.values) <= strokes.surface.triangles.lengths_of_edges.mean()
    apart = areas[(np.sign(field.values) != sides) & ~near & ~np.isnan(field.values)].sum() / areas.sum()
    if apart > UNTRUSTWORTHY:
        return (
            f"the gaps of the curves are so wide that completing them in two ways differs on {percent(apart)} of the "
            "surface. Draw more of them"
        )
    return ""


def named(numbers: Ints) -> str:
    """Return a text such as "curves number 3, 5" that names curves by up to eight of their numbers."""
    listed = ", ".join(map(str, numbers[:8].tolist())) + (", …" if len(numbers) > 8 else "")
    return f"curves number {listed}" if len(numbers) > 1 else f"curve number {listed}"


def distance_to_curves(
    curves: CurvesAndPoints | ElementList | Sequence[ElementList],
    domain: AnySurface,
    *,
    constraint: Free | ZeroSet | Soft | None = None,
    diffusion: float = 1.0,
    intrinsic: bool | Literal["auto"] = "auto",
    as_oriented: bool = False,
    every_piece: bool = False,
) -> Field[AnySurface]:
    """Compute the signed distance to curves and points on a surface, with the options of `signed_distance`.

    The signed heat method decides which side is positive and closes the gaps of the curves. Then exact distance along
    the surface is measured to the curves and to what closes their gaps (`sharpen`).
    """
    if isinstance(constraint, EachComponent | LevelValues):
        raise ConstraintError(
            f"distance to curves is zero on all of them, which {constraint!r} denies",
            remedy="use SignedHeatSolver.distance",
        )
    as_oriented, every_piece = flag(as_oriented, "as_oriented"), flag(every_piece, "every_piece")
    solver = SignedHeatSolver(domain, diffusion, intrinsic=intrinsic)
    given = as_curves(solver.domain, as_list(curves))
    warn_of_gaps(solver.domain)
    repaired = RepairedMesh.of(solver.domain)
    if repaired is not None:
        solver, given = SignedHeatSolver(repaired.mesh, diffusion, intrinsic=intrinsic), repaired.on_it(given)
    listed, left_out = given_curves(solver.domain, given)

    is_default = intrinsic == "auto"
    numbers = numbers_given(listed, left_out)

    def completed(
        by: SignedHeatSolver[Any], curves: CurvesAndPoints, pieces: CurvePieces | None
    ) -> tuple[Field[AnySurface], CurvesAndPoints, str]:
        """Return the field by heat, the curves to sharpen it to, and why it is a guess, "" if it is none."""
        if as_oriented:
            return distance_unwarned(by, curves, constraint), curves, ""
        return distance_to_pieces(by, curves, constraint, every_piece, numbers, pieces)

    def measured(by: SignedHeatSolver[Any]) -> tuple[Field[AnySurface], CurvesAndPoints | None, str]:
        """Return the field by a solver, and the curves to sharpen it to; None for these if it is exact already."""
        flat = flattened(listed)
        by = triangulated_once(by, flat)
        segments = surface_of(by).segments(flat)  # refuses curves that do not fit
        pieces = None
        if not as_oriented:  # directions do not depend on the options
            pieces = CurvePieces.of(surface_of(by), flat) if is_default else pieces_for_all(solver.domain, flat)
        # without heat, where the curves as given decide the sides of all vertices
        if pieces is None or bound_as_given(pieces):
            exact = distance_by_sides(by, given)
            if exact is not None:
                return exact, None, ""
        if as_oriented and left_out is not None:  # warnings call curves by their numbers among those given
            return completed(by, given, pieces)
        # by heat on the part of the mesh around the curves, if it decides the sides of the rest
        near = Surroundings.of(by.domain, list(chain(*segments))) if is_default and on_its_triangles(by) else None
        if near is not None:
            field, curves, doubt = completed(replace(by, domain=near.part), near.on_part(listed), None)
            extended = near.extended(field)
            if extended is not None:
                return extended, near.on_whole(curves), doubt
        # by heat on the whole surface
        return completed(by, listed, pieces)

    with part_of_work(0.0, 0.7):
        field, used, doubt = on_resolving_triangles(measured, solver, listed) if is_default else measured(solver)
    if doubt:
        warn_user(doubt, InexactWarning)
    with part_of_work(0.7, 1.0):
        sharpened = field if used is None else sharpen(field, used, progress=bound_progress())
    if repaired is not None:
        sharpened = repaired.on_given(sharpened)
    return sharpened if left_out is None else replace(sharpened, diagnostics=sharpened.diagnostics.noting(left_out))


def on_its_triangles(solver: SignedHeatSolver[Any]) -> bool:
    """Whether the solver takes the triangles of a mesh as they are, for all curves."""
    made = solver.discretization
    return isinstance(solver.domain, TriangleMesh) and isinstance(made, SurfaceDiscretization) and not made.transfer


def distance_by_sides(solver: SignedHeatSolver[Any], curves: CurvesAndPoints) -> Field[Any] | None:
    """Return the exact distance to curves that decide the side of every vertex without heat, or None if some do not."""
    if not isinstance(solver.domain, TriangleMesh):
        return None
    return field_without_heat(solver, curves, lambda source: distance_without_heat(source, SOURCE_TOLERANCE))
