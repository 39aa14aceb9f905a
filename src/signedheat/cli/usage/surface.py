"""``signedheat surface``: signed distance to curves on a surface, at its vertices."""

from __future__ import annotations

from typing import Any

from .options import Parser, add_command, add_up_option, constraint, finite, positive, whole_number


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "surface",
        help="signed distance to curves on a surface",
        description="Signed distance on a mesh, a point cloud or the boundary of a set of voxels to curves, broken or "
        "not, and to points on it.",
    )
    add_curves_and_output(parser, "field: .ply .vtp .obj .npz")
    parser.add_argument(
        "--contours",
        type=whole_number(1, 1000),
        metavar="N",
        help="write N isolines beside the output, as OUT.contours.obj",
    )
    parser.add_argument(
        "--subdivide",
        action="store_true",
        help="write the flat pieces of the surface on which the field is linear, where it was computed on better "
        "triangles than those of the mesh, whose vertices come first",
    )
    parser.add_argument("--preview", metavar="PNG", help="draw the result")
    add_up_option(parser)


def add_curves_and_output(parser: Parser, output: str) -> None:
    """Add the arguments of a distance to curves on a surface, and of its output."""
    parser.add_argument(
        "mesh", metavar="MESH", help="surface, points or voxels: .obj .ply .stl .off .vtp .glb .pc .xyz .npy .nrrd .vti"
    )
    parser.add_argument("curves", metavar="CURVES", help="curves and points on it: .txt .obj .json .csv")
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help=output)
    parser.add_argument(
        "--constraint",
        type=surface_constraint,
        default="zero-set",
        metavar="C",
        help="free, zero-set (default), hard, each-component, soft, soft:WEIGHT, or levels:V,V,…, one for each curve",
    )
    parser.add_argument(
        "--diffusion",
        type=positive,
        metavar="T",
        help="diffusion time in squared spacings (1; with --plain three, extrapolated, unless curves end); larger "
        "values close gaps more roundly",
    )
    parser.add_argument(
        "--globe",
        action="store_true",
        help="the mesh is a globe, and curves are longitudes and latitudes in degrees, joined along great circles: "
        ".csv .geojson",
    )
    parser.add_argument(
        "--intrinsic",
        action="store_true",
        help="run the method on better triangles of the same surface, along whose edges the curves run; by default on "
        "better triangles where the mesh has large angles",
    )
    parser.add_argument(
        "--plain",
        action="store_true",
        help="the method's own field, of the curves as they are given, not measured to the curves themselves",
    )
    parser.add_argument("--as-oriented", action="store_true", help="turn no curve, and leave none out")
    parser.add_argument(
        "--every-piece", action="store_true", help="leave out no piece, also if it belongs to none of the others"
    )


def surface_constraint(word: str) -> str:
    """The name of a constraint, with its numbers; on surfaces also given levels."""
    name, _, values = word.partition(":")
    if name == "levels":
        for value in values.split(","):
            finite(value)
        return word
    return constraint(word, with_numbers="soft, soft:WEIGHT, levels:V,V,…")
