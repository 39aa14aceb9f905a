"""Which side of a broken surface is inside: the signs of φ where surface is missing, guarded by winding numbers.

φ < 0 alone carries on a shape that is half missing better than anything, and invents solids beside open sheets. Winding
numbers w do neither. Here both must agree that a node is inside, up to a level of w. Where little is missing the level
is `LEVEL`. A side that is missing altogether is filled by φ < 0 as far as can be had with no more area than there is of
faces: *no more is missing than is there*. And a region that faces enclose only in part, while other faces enclose
nothing, is no solid at all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from ..diagnostics import BoundsNothing, ReachesBox
from ..operators.grid.boundary_areas import boundary_areas, completion_areas
from ..operators.grid.face_values import values_at
from ..parallel import over_slabs
from .completed_area import completed_area
from .inside import Sides
from .rims import Rims

LEVEL = 0.4
"""Winding number that φ < 0 needs; from 1 less this on, nodes are inside whatever φ says."""
LEVELS = np.array([0.005, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1, 0.12, 0.15, 0.2, 0.25, 0.3, LEVEL])
"""Winding numbers down to which a missing side may be filled."""
CORES = (0.6, 0.75, 0.9)
"""Winding numbers of the parts of what is no solid that may be solids of their own."""
FAR = 1.5
"""Cells from any face beyond which the zero set is completed."""
REACH = 1.25
"""Cells before and behind a face at which its sides are looked up."""
MISSING_SIDE = 0.2
"""Completed area, over that of the faces, from which a whole side is missing."""
OPENING = 0.01
"""The same of the flattest way to close it, across the opening: a small hole, too, may be filled to no end."""
BOUNDING = 0.12
"""Mean winding number of both sides from which a face counts as bounding something: ½ on a solid, 0 on a sheet."""
FILM = 0.85
"""Area without faces, over that of the faces, from which a region is a mere film on one side of a sheet."""
OPEN = 0.72
"""Completed area, over that of the faces, up to which a region is a solid, if (nearly) all faces bound something."""
CLOSED = 0.02
"""The same if many faces bound nothing: then open regions are taken for open."""
ALL, MANY = 0.95, 0.92
"""Shares of the area of faces that bound something: nearly all, and less than which many do not."""
HALF, LESS = 0.52, 0.48
"""Mean of twice the winding number at the faces, 1 on whole shapes: on half a sphere, .61, on four sides of a box .55,
and on what encloses less, such as three sides of a box, .44."""
MIDDLE = 0.25
"""Distance of winding numbers from ½ up to which rims are asked."""
CURVED = 0.12
"""Sine of a quarter of the angle of a cap from which on φ tells the side between `LEVEL` and 1 less that."""
MOSTLY, PARTLY = 0.7, 0.4
"""How far faces around a missing side go on at least, and where φ < 0 beyond it has more area than all faces."""
BESIDE = 2.5
"""Cells from faces within which a hole is beside them."""
SLOPE = 4.0
"""Cells that a winding number of one is worth beside φ."""
ROOM = 6
"""Nodes around all that may be inside that what is computed there can depend on."""


@dataclass(frozen=True, eq=False)
class _Scene:
    """Everything on one grid of three axes, those in front of one node in the plane."""

    phi: NDArray[np.float64]
    winding: NDArray[np.float64]
    distance: NDArray[np.floating]
    steps: NDArray[np.float64]
    front: NDArray[np.int64]
    back: NDArray[np.int64]
    areas: NDArray[np.float64]
    bounding: NDArray[np.bool_]
    enclosure: float
    doubt: NDArray[np.float32]

    @property
    def cell(self) -> float:
        return float(self.steps.max())

    @cached_property
    def trust(self) -> float:
        """From 1, where all faces bound something, so that what is open is missing, to 0, where many do not."""
        total = float(self.areas.sum())
        share = float(self.areas[self.bounding].sum()) / total if total > 0 else 0.0
        ramps = (share - MANY) / (ALL - MANY), (self.enclosure - LESS) / (HALF - LESS)
        return float(np.clip(min(ramps), 0.0, 1.0))

    def guarded(self, level: float | None = None, box: tuple[slice, ...] = ()) -> NDArray[np.float64]:
        """Negative where φ < 0 and w > level, by default ½ less the doubt, or where w is above ½ by more than that."""
        phi, winding, doubt = self.phi[box], self.winding[box], self.doubt[box]
        result = np.empty(phi.shape)

        def planes(here: slice) -> None:
            result[here] = self._guarded(phi[here], winding[here], doubt[here], level)

        over_slabs(planes, phi.shape)
        return result

    def guarded_at(self, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
        """The same at some nodes."""
        return self._guarded(self.phi.ravel()[nodes], self.winding.ravel()[nodes], self.doubt.ravel()[nodes])

    def _guarded(
        self,
        phi: NDArray[np.float64],
        winding: NDArray[np.float64],
        doubt: NDArray[np.float32],
        level: float | None = None,
    ) -> NDArray[np.float64]:
        worth = SLOPE * self.cell
        result = np.maximum(phi, worth * ((0.5 - doubt if level is None else level) - winding))
        return np.minimum(result, worth * (0.5 + doubt - winding), out=result)


def choose_sides(
    phi: NDArray[np.float64],
    winding: NDArray[np.float64],
    distance: NDArray[np.floating],
    positions: NDArray[np.float64],
    vectors: NDArray[np.float64],
    spacing: NDArray[np.float64],
    origin: NDArray[np.float64],
    rims: Rims | None = None,
) -> Sides:
    """Decide which nodes of a grid are inside a broken shape. The memory of φ is used for the result.

    Parameters
    ----------
    phi : (*shape) float
        Generalized signed distance, in units of length.
    winding : (*shape) float
        Winding number of the shape, 1 inside, of which no body lies in another.
    distance : (*shape) float
        Distance to the faces, right where it is less than two cells.
    positions, vectors : (s, d) float
        Samples of the faces: places in cells from the first node, and area times normal in units of length.
    spacing : (d,) float
        Distance between nodes along each axis; two or three axes.
    origin : (d,) float
        Position of the first node, for reports.
    rims : Rims, optional
        Those of the shape, if it is a mesh: how its faces go on beyond them.

    Returns
    -------
    Sides

    Notes
    -----
    Regions where φ < 0 and w > .4, or w > .6 (both nearer ½ the flatter a hole's surroundings are: ½ is flat across)
    are solids if the completed part of their boundary is small beside the
    faces on it: at most .55 where nearly all faces of the shape bound something, so that what is open must be missing;
    next to nothing where many faces are open sheets. Other regions are looked at again above w = .6, .75, .9, so that
    closed legs stay solid below an open board.
    """
    box, first = _box_of_sides(phi, winding, positions)
    steps, part = np.ones(3), phi[box]
    steps[3 - phi.ndim :] = spacing
    shape = (1,) * (3 - phi.ndim) + part.shape
    if rims is not None:
        rims = replace(rims, places=rims.places - first * spacing)
    scene = _scene(part, winding[box], distance[box], positions - first, vectors, rims, shape, steps)
    function = scene.guarded()
    candidates = function < 0
    bodies, present = _bodies(scene, function)
    _fill_missing_sides(scene, rims, bodies, present, function)
    inside = function < 0
    sides = inside.ravel()
    bounding = sides[scene.back] != sides[scene.front]
    total = float(scene.areas.sum())
    loose = 1.0 - float(scene.areas[bounding].sum()) / total if total > 0 else 1.0
    np.copyto(bodies, inside)
    completed = completed_area(bodies, function, scene.distance, steps, FAR * scene.cell, origin + first * spacing)
    nowhere = np.zeros(phi.shape, dtype=bool)
    given = scene.phi.reshape(part.shape)
    if np.shares_memory(given, phi):
        given = given.copy()
    everywhere = nowhere.copy(), phi, nowhere
    everywhere[0][box] = inside.reshape(part.shape)
    everywhere[1][box] = function.reshape(part.shape)
    everywhere[2][box] = (candidates & ~inside).reshape(part.shape)
    on_walls = np.concatenate([side.ravel() for side in walls(everywhere[0])])
    return Sides(
        *everywhere,
        box,
        given,
        scene.trust == 0.0,
        completed,
        ReachesBox(float(on_walls.mean())) if on_walls.any() else None,
        BoundsNothing(loose) if loose > 0.5 else None,
    )


def _box_of_sides(
    phi: NDArray[np.float64], winding: NDArray[np.float64], positions: NDArray[np.float64]
) -> tuple[tuple[slice, ...], NDArray[np.int64]]:
    """The part of a grid that holds all faces and all that may be inside, with room around it; and its first node."""
    upper = np.array(phi.shape) - 1
    low, high = (np.clip(f(positions, axis=0), 0, upper) for f in (np.min, np.max))
    candidates = np.empty(phi.shape, dtype=bool)

    def planes(here: slice) -> None:
        candidates[here] = (phi[here] < 0) | (winding[here] > 0.5)

    over_slabs(planes, phi.shape)
    for axis, n in enumerate(phi.shape):
        layers = np.flatnonzero(candidates.reshape(int(np.prod(phi.shape[:axis])), n, -1).any(axis=(0, 2)))
        if len(layers):
            low[axis], high[axis] = min(low[axis], layers[0]), max(high[axis], layers[-1])
    first = np.maximum(np.floor(low).astype(np.int64) - ROOM, 0)
    last = np.minimum(np.ceil(high).astype(np.int64) + ROOM, upper)
    return tuple(slice(a, b + 1) for a, b in zip(first, last, strict=True)), first


def walls(values: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """The layers of nodes on the walls of a box."""
    return [np.moveaxis(values, axis, 0)[end] for axis in range(values.ndim) for end in (0, -1)]


def _scene(
    phi: NDArray[np.float64],
    winding: NDArray[np.float64],
    distance: NDArray[np.floating],
    positions: NDArray[np.float64],
    vectors: NDArray[np.float64],
    rims: Rims | None,
    shape: tuple[int, ...],
    steps: NDArray[np.float64],
) -> _Scene:
    """Nodes before and behind every sample, and everything with three axes."""
    dimension = positions.shape[1]
    areas = np.linalg.norm(vectors, axis=1)
    spacing = steps[3 - dimension :]
    away = vectors / np.where(areas > 0, areas, 1)[:, None] * (REACH * steps.max()) / spacing
    front, back = (
        np.ravel_multi_index(tuple(np.clip(np.rint(at).astype(np.int64), 0, np.array(phi.shape) - 1).T), phi.shape)
        for at in (positions + away, positions - away)
    )
    phi, winding = (np.ascontiguousarray(part).reshape(shape) for part in (phi, winding))
    distance = np.ascontiguousarray(distance).reshape(shape)
    places = np.zeros((len(positions), 3))
    places[:, 3 - dimension :] = positions
    at_faces = values_at(winding, places)
    enclosure = 2 * float(np.average(np.clip(at_faces, 0.0, 0.5), weights=areas)) if areas.any() else 0.0
    bounding = at_faces > BOUNDING
    doubt = _doubt(winding, distance, steps, rims)
    scene = _Scene(phi, winding, distance, steps, front, back, areas, bounding, enclosure, doubt)
    between = (scene.guarded_at(back) < 0) & ~(scene.guarded_at(front) < 0)
    return replace(scene, bounding=bounding | between)


def _doubt(
    winding: NDArray[np.float64], distance: NDArray[np.floating], steps: NDArray[np.float64], rims: Rims | None
) -> NDArray[np.float32]:
    """What a winding number must differ from ½ by to tell the side alone: less where a hole is in a flat face.

    In the middle of a missing spherical cap with half the angle θ it is ``½ (1 − sin ½θ)``.
    """
    doubt = np.full(winding.shape, 0.5 - LEVEL, dtype=np.float32)
    if rims is not None:
        chosen = np.empty(winding.shape, dtype=bool)

        def planes(here: slice) -> None:
            chosen[here] = (np.abs(winding[here] - 0.5) < MIDDLE) & (distance[here] > float(steps.max()))

        over_slabs(planes, winding.shape)
        nodes = np.argwhere(chosen)
        if len(nodes):
            doubt[tuple(nodes.T)] *= doubt_beside(rims, nodes * steps)
    return doubt


def doubt_beside(rims: Rims, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) from 0, where the nearest rim is that of a hole in a flat face, to 1: share of the doubt that remains."""
    bend = np.sin(0.5 * np.arcsin(rims.going_on_at(places)))
    share: NDArray[np.float64] = np.minimum((bend / CURVED) ** 2, 1.0)
    return share


def _bodies(scene: _Scene, function: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Labels of the solids, and the area of the faces on each; the function is made negative in them alone."""
    candidates = function
    bodies = np.zeros(function.shape, dtype=np.int32)
    present = np.zeros(1)
    trust = scene.trust
    for core in (*CORES, None):
        labels, n = scipy.ndimage.label(candidates < 0, output=np.int32)
        faces = _faces_on(scene, labels, n)
        total, completed = boundary_areas(labels, candidates, scene.distance, scene.steps, FAR * scene.cell)
        solid = (total - faces <= FILM * faces) & (completed <= (CLOSED + (OPEN - CLOSED) * trust) * faces)
        solid[0] = False
        bodies_of = np.where(solid, len(present) - 1 + np.cumsum(solid), 0).astype(np.int32)
        present = np.concatenate([present, faces[solid]])
        if solid[1:].all() and core == CORES[0]:
            return np.take(bodies_of, labels, out=labels, mode="clip"), present
        bodies += bodies_of[labels]
        doubtful = ~solid[labels] & (labels > 0)
        if core is None:
            np.abs(function, out=function, where=doubtful)
            break
        candidates = np.where(doubtful, SLOPE * scene.cell * (core - scene.winding), SLOPE * scene.cell)
        np.copyto(function, candidates, where=doubtful)
    return bodies, present


def _faces_on(scene: _Scene, labels: NDArray[np.int32], n: int) -> NDArray[np.float64]:
    """(n + 1,) area of the faces that have a region behind and not before them."""
    behind, before = labels.ravel()[scene.back], labels.ravel()[scene.front]
    result = np.bincount(behind, np.where(behind != before, scene.areas, 0.0), minlength=n + 1)
    result[0] = 0.0
    return result.astype(np.float64)


def _fill_missing_sides(
    scene: _Scene,
    rims: Rims | None,
    bodies: NDArray[np.int32],
    present: NDArray[np.float64],
    function: NDArray[np.float64],
) -> None:
    """Extend the function where a whole side of a solid is missing."""
    fillable = (scene.phi < 0) & (bodies == 0) & (scene.winding < LEVEL) & (scene.distance > scene.cell)
    holes, n = scipy.ndimage.label(fillable, output=np.int32)
    if n == 0 or len(present) == 1:
        return
    areas, owners, at_walls = completion_areas(
        holes, bodies, present, scene.phi, scene.winding, scene.distance, scene.steps, FAR * scene.cell, LEVELS
    )
    budget = present * scene.trust
    ends = np.minimum(at_walls, len(LEVELS) - 1)  # what fills the box has no end; leave room for offsets
    large = (owners > 0) & (areas[np.arange(len(ends)), ends] > MISSING_SIDE * present[owners])
    large &= areas.min(axis=1) > OPENING * present[owners]
    if rims is not None and large.any():
        endless = areas.max(axis=1) > present[owners]
        large &= _going_on(scene, rims, holes, n) > np.where(endless, PARTLY, MOSTLY)
    boxes = scipy.ndimage.find_objects(holes)
    for body in np.unique(owners[large]):
        own = np.flatnonzero(large & (owners == body))
        affordable = np.flatnonzero(areas[own].sum(axis=0) <= budget[body])
        if not len(affordable):
            continue
        level = LEVELS[max(int(affordable[0]), int(ends[own].max()))]
        for hole in own:
            box = tuple(slice(max(0, part.start - 2), part.stop + 2) for part in boxes[hole - 1])
            near = scipy.ndimage.binary_dilation(holes[box] == hole, np.ones((3, 3, 3)), iterations=2)
            refused = (scene.guarded(None, box) < 0) & (function[box] >= 0)
            np.copyto(function[box], scene.guarded(level, box), where=near & ~refused)


def _going_on(scene: _Scene, rims: Rims, holes: NDArray[np.int32], n: int) -> NDArray[np.float64]:
    """(n + 1,) how far the faces around each hole go on, at its nodes beside them."""
    beside = np.argwhere((holes > 0) & (scene.distance < BESIDE * scene.cell))
    of_hole = holes[tuple(beside.T)]
    going_on = rims.going_on_at(beside * scene.steps) if len(beside) else np.zeros(0)
    counts = np.bincount(of_hole, minlength=n + 1)
    result: NDArray[np.float64] = np.bincount(of_hole, going_on, minlength=n + 1) / np.maximum(counts, 1)
    return np.where(counts > 0, result, 1.0)
