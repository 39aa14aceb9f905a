"""What the fuzzer has found, again: a case or more of each kind of failure."""

from __future__ import annotations

import pytest

from fuzz.frame import families, run_case

FOUND = [
    # edges of huge shapes at faces without area
    ("space queries", 777, 153), ("space solid", 777, 223), ("space solid", 4242, 180), ("space solid", 4242, 702),
    ("space solid", 4242, 775),
    # points nearer to each other than rounding, along segments that have to become edges
    ("surface distance", 100, 175), ("surface use", 103, 132), ("surface use", 104, 93),
    ("surface triangulation", 102, 76), ("surface triangulation", 102, 158), ("surface triangulation", 105, 43),
    ("surface piecewise", 102, 158),
    # ends of segments beyond the face in which they lie
    ("surface distance", 100, 191), ("surface use", 102, 2), ("surface use", 105, 68), ("surface piecewise", 103, 156),
    ("surface piecewise", 104, 236),
    # faces without area
    ("surface use", 102, 212), ("surface piecewise", 102, 218), ("surface use", 100, 168),
    pytest.param("surface use", 101, 223, marks=pytest.mark.slow),
    # numbers whose squares or quotients leave the range
    ("surface use", 100, 21), ("surface piecewise", 106, 119), ("arguments", 109, 172),
    # weights of soft constraints
    ("space grid", 100, 113), ("space grid", 103, 188), ("space grid", 103, 246), ("space grid", 112, 86),
    ("space grid", 107, 217), ("space grid", 208, 161), ("space grid", 206, 449),
    ("space solid", 207, 161), ("space solid", 210, 435),
    # samples that nearly coincide
    ("space grid", 100, 175),
    # samples on solid nodes but for rounding
    ("space grid", 4501, 2867),
    # loops without area
    ("surface curves", 4502, 877), ("surface curves", 4502, 1223), ("surface curves", 4502, 2178),
    # holes without area
    ("space queries", 4502, 231), ("space queries", 4502, 5425), ("space queries", 4502, 7984),
    # normals along the rim of a hole
    ("space solid", 4501, 6149), ("space solid", 4501, 7419),
    # sources that hardly touch the tets
    ("space tets", 101, 49), ("space tets", 103, 81), ("space tets", 107, 207),
    # more samples in few tets than these can follow exactly
    ("space tets", 207, 222),
    # levels far from zero, interpolated
    ("surface use", 7007, 2403), ("surface use", 300, 927), ("surface use", 300, 1913),
    # thin faces that were refined for forty seconds
    ("surface use", 7001, 1022),
    # faces without area whose jumps nothing holds
    ("surface piecewise", 20261201, 4234),
    # triangulations that tell their area from lengths alone, at the start as at the end
    ("surface triangulation", 20261201, 4556), ("surface triangulation", 20261201, 5745),
    # windows of exact distance on a thousand sheets, which grew by copies
    pytest.param("surface use", 20261201, 1747, marks=pytest.mark.slow),
    # values near the largest number, on surfaces without orientation
    ("surface use", 20261201, 4888),
    # points among faces without area
    ("surface curves", 20261201, 5213),
    # points that nearly coincide, each at a level of its own
    ("surface use", 412, 1359),
    # paths through edges that are a rounding shorter than none
    ("surface use", 202, 43), ("surface curves", 300, 4876),
    # curves across triangles as thin as rounding, which turn them
    ("surface curves", 7003, 1478), ("surface triangulation", 7007, 684), ("surface curves", 1311, 2478),
    # geodesics past edges so short that windows on them are lost
    ("surface curves", 7009, 1312),
    # an image in space whose origin is one of the plane
    ("files labels", 7008, 2630),
    # parts of cut faces without area
    ("surface triangulation", 4503, 7974),
    # segments whose ends are one to rounding
    ("surface triangulation", 7007, 1631),
    # a part of the surface that no curve reaches, and whose sides touch one
    ("surface curves", 20261123, 3919),
    # bands around shapes all of whose faces lie in layers
    ("space queries", 400, 3031), ("space queries", 400, 5229),
    # polygons that overlap, and shapes without any face, in bands
    ("space queries", 1122, 41), ("space queries", 1122, 466),
    # five points whose solid leaves the box, far from any of them, in a band
    ("space queries", 1123, 2356),
    # a Delaunay triangulation with the point at infinity
    ("space queries", 1123, 7427),
    # areas that rounding makes negative, edges that it leaves no length
    ("surface curves", 1123, 2399), ("surface curves", 1124, 2141),
    # curves in faces that do not exist
    ("surface curves", 1124, 1932),
    # segments on the line of huge ones, to rounding
    ("surface curves", 20261124, 415),
    # tets of no corners beside others, in a VTK file
    ("files tet fields", 1123, 6794),
    # parts of a surface without curves, told by a command on standard output alone
    ("commands", 1123, 1948),
    # large faces behind rims of narrow openings, divided millions of times; none of whose pieces is near
    ("space solid", 991, 519), ("space solid", 991, 617),
    # a band around ten points with 10¹² nodes along each edge
    pytest.param("commands", 1126, 701, marks=pytest.mark.slow),
    # sheets thickened by many times their size
    ("commands", 1130, 4932), ("commands", 1130, 5694),
    # parts of a surface far smaller than the width over which jumps are smoothed
    ("surface piecewise", 1145, 3772),
    # arguments that are quoted, compared or counted
    ("arguments", 100, 6), ("arguments", 100, 88), ("arguments", 100, 152), ("arguments", 100, 211),
    ("arguments", 206, 22), ("arguments", 108, 89), ("arguments", 102, 126), ("arguments", 103, 15),
    # lids whose plates went to and fro
    ("same solid moved", 9952, 89),
    # samples of faces at places that depended on which corner came first
    ("same solid renumbered", 20261127, 2), ("same solid renumbered", 9601, 81),
    # boxes from one end of what can be written to the other
    ("arguments", 7004, 197), ("arguments", 7008, 1101),
    # shapes taken as they are oriented, none of whose faces has an area
    ("commands", 9112, 263),
]  # fmt: skip


@pytest.mark.parametrize(("name", "seed", "number"), FOUND)
def test_what_was_found_stays_mended(name, seed, number):
    outcome = run_case(families()[name], seed, number)
    assert not outcome.failed, str(outcome)
