"""Distance to curves on surfaces in one call: exact where they are there, completed by heat where they are missing.

It is measured on a repaired mesh: copies of faces left out, faces flipped to agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np

from ..arrays import Bools, Ints
from ..constraints import Constraint, EachComponent, Free, LevelValues, Soft, ZeroSet
from ..diagnostics import Note
from ..errors import ConstraintError, InexactWarning, counted, percent, warn_user
from ..fields.field import Field
from ..fields.sharpening import sharpen
from ..jobs import Progress, growing, within
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
from ..surfaces.surface_sharpening import distance_without_heat
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import flag
from .gaps import Gaps
from .resolution import flattened, on_resolving_triangles, surface_of, triangulated_once
from .stroke_directions import CurvePieces, Decision, bound_as_given, decide, pieces_for_all, with_turned


def warn_of_gaps(mesh: object) -> None:
    """Warn if vertices of rims are so near others that they may be meant to be one, but too far to be joined."""
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
    if isinstance(mesh, PolygonMesh):
        return mesh.corners, mesh.next_corners
    return mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()


UNTRUSTWORTHY = 0.1
"""The shortest completion and that by heat are announced as untrustworthy if they differ on this share of the area.
Half as much announces no more of 259 drawings; two of 30 curves in twelve pieces, half gone, are announced for this
reason alone, and both are wrong."""

MOST_LEFT_OUT = 0.25
"""There is a warning if more than this share of the length of the curves is left out."""

GAP_EDGES = 2.0
"""Gaps narrower than so many edges are left to heat."""

Surface = TypeVar("Surface", bound=SurfaceDomain)


@dataclass(frozen=True, eq=False, repr=False)
class CurvesTaken(Note):
    """Which of the curves given were flipped, and which were left out.

    Attributes
    ----------
    turned : (j,) int
        Curves whose positive side was made negative.
    left_out : (k,) int
        Curves that bound nothing together with the others.
    share_left_out : float
        Their share of the length of all curves.
    """

    turned: list[int]
    left_out: list[int]
    share_left_out: float

    @property
    def important(self) -> bool:
        return True

    def __str__(self) -> str:
        taken = [
            f"{name}: {len(which)}, the first of them number {which[0]}"
            for name, which in (("curves flipped", self.turned), ("curves left out", self.left_out))
            if len(which)
        ]
        share = [f"{self.share_left_out:.2g} of the length left out"] if len(self.left_out) else []
        return "; ".join(taken + share) or "curves are used as given"


def distance_to_pieces(
    solver: SignedHeatSolver[Surface],
    curves: CurvesAndPoints,
    constraint: Constraint | None,
    every_piece: bool,
    numbers: Ints | None = None,
    pieces: CurvePieces | None = None,
) -> tuple[Field[Surface], list[CurveOrPoints]]:
    """Return the distance to curves that may be pieces of broken ones, and the curves that it was measured to.

    Pieces are turned until they bound something together (`curve_orientation`), and those that do not are left out,
    unless most do not. Where faces cannot agree which side is left, pieces are taken as they are. There is an
    `InexactWarning` where the answer is a guess. Warnings and notes name curves by `numbers`, (n,), by default their
    places in the list. `pieces` may have triangles of their own; by default they are found on those of the solver.
    """
    listed = flattened(curves)
    numbers = np.arange(len(listed)) if numbers is None else numbers
    once = triangulated_once(solver, listed)
    pieces = pieces or CurvePieces.of(surface_of(once), listed)
    if pieces is None:
        return distance_unwarned(once, listed, constraint), listed
    if isinstance(solver.domain, TriangleMesh) and not has_sides(solver.domain, listed):
        if pieces.is_piece.any():
            warn_user(
                "curves run where faces cannot agree which side of them is left, on a surface with one side or across "
                "edges of more than two faces: curves were used as they are, and which side is which away from them "
                "is a guess. Leave out faces, or close the curves",
                InexactWarning,
            )
        return distance_unwarned(once, listed, constraint), listed
    decision = decide(pieces, every_piece)
    turn = decision.turned(len(listed))
    left_out = pieces.curves(decision.loose)
    taken = [curve for k, curve in enumerate(with_turned(listed, turn)) if k not in set(left_out.tolist())]
    field = distance_unwarned(once, taken, constraint)
    closing = closing_curves(field, taken, GAP_EDGES * float(pieces.strokes.surface.triangles.lengths_of_edges.mean()))
    if closing:
        field = distance_unwarned(once, [*taken, *closing], constraint)
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
    if reason:
        warn_user(reason, InexactWarning)
    return field, taken


def closing_curves(field: Field[Surface], curves: Sequence[CurveOrPoints], least: float) -> list[Curve]:
    """Return shortest paths across gaps longer than `least` of curves that nearly close, where heat bulges."""
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
        path = surface.shortest_path(*(SurfacePoints(curve.faces[at], curve.barycentric[at]) for curve, at in ends))
        paths.append(Curve(path.faces, path.barycentric))
    return paths


def has_sides(mesh: TriangleMesh, curves: Sequence[CurveOrPoints]) -> bool:
    """Whether the faces that each curve runs on are connected, and can agree which side of the curve is left."""
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
    """(m,) faces of a sheet in a mesh some of whose edges have three faces or more.

    Parts are added one by one, those that curves cross first, then the largest, unless they would put a third face on
    an edge that others use, as fins and tents do.
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
    """Return, as a warning, why the region that the curves bound is a guess, and what to do; "" if it is no guess.

    `field` is the distance, completed by heat, to the curves that were not left out. `curves` are all curves given,
    which the warning calls by their `numbers`, (n,).
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
    """Return the numbers of some curves in words."""
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
    progress: Progress | None = None,
) -> Field[AnySurface]:
    """Signed distance to curves and points on a surface: see `signed_distance`, which calls this.

    The signed heat method decides the sides and completes what is missing; then distance is measured along the surface,
    exactly, to the curves themselves and to what completes them (`sharpen`).
    """
    if isinstance(constraint, EachComponent | LevelValues):
        raise ConstraintError(
            f"distance to curves is zero on all of them, which {constraint!r} denies",
            remedy="use SignedHeatSolver.distance",
        )
    as_oriented, every_piece = flag(as_oriented, "as_oriented"), flag(every_piece, "every_piece")
    progress = growing(progress)  # triangles may be made twice, and sides decided before distance is measured
    share = within(progress, 0.0, 0.7)
    solver = SignedHeatSolver(domain, diffusion, share, intrinsic)
    given = as_curves(solver.domain, as_list(curves))
    warn_of_gaps(solver.domain)
    repaired = RepairedMesh.of(solver.domain)
    if repaired is not None:
        solver, given = SignedHeatSolver(repaired.mesh, diffusion, share, intrinsic), repaired.on_it(given)
    listed, left_out = given_curves(solver.domain, given)

    is_default = intrinsic == "auto"
    numbers = numbers_given(listed, left_out)

    def measured(by: SignedHeatSolver[Any]) -> tuple[Field[AnySurface], CurvesAndPoints | None]:
        flat = flattened(listed)
        by = triangulated_once(by, flat)
        surface_of(by).segments(flat)  # refuses curves that do not fit
        pieces = None
        if not as_oriented:
            pieces = CurvePieces.of(surface_of(by), flat) if is_default else pieces_for_all(solver.domain, flat)
        if pieces is None or bound_as_given(pieces):
            exact = distance_by_sides(by, given, progress)
            if exact is not None:
                return exact, None
        if as_oriented:
            return distance_unwarned(by, given, constraint), listed
        return distance_to_pieces(by, listed, constraint, every_piece, numbers, pieces)

    field, taken = on_resolving_triangles(measured, solver, listed) if is_default else measured(solver)
    sharpened = field if taken is None else sharpen(field, taken, progress=within(progress, 0.7, 1.0))
    if taken is None and progress is not None:
        progress(1.0, "done")
    if repaired is not None:
        sharpened = repaired.on_given(sharpened)
    return sharpened if left_out is None else replace(sharpened, diagnostics=sharpened.diagnostics.noting(left_out))


def distance_by_sides(
    solver: SignedHeatSolver[Any], curves: CurvesAndPoints, progress: Progress | None
) -> Field[Any] | None:
    """Return the distance to curves that decide by themselves which side every vertex is on; None if heat must."""
    if not isinstance(solver.domain, TriangleMesh):
        return None
    report = None if progress is None else (lambda: progress(0.7, "distance"))
    return field_without_heat(solver, curves, lambda source: distance_without_heat(source, SOURCE_TOLERANCE, report))
