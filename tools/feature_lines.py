"""How many lines of the package only one of its features needs: what could go with it.

A function or class (with its methods) is needed if a public name, a command, or something that is needed names it; one
that is registered for a type (`singledispatch`) if that type is needed. A feature is left out by its names, and the
lines are counted that nothing needs then. Run as ``python tools/feature_lines.py``.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent / "src"
FEATURES: dict[str, tuple[str, ...]] = {
    "batches": ("batches.*",),
    "pictures": ("view.*",),
    "objects of other packages": ("exchange.*", "foreign.from_*", "torch"),
    "files": ("io.*",),
    "command line": ("cli.*", "__main__"),
    "intrinsic triangulations": (
        "surfaces.intrinsic_triangulation",
        "surfaces.subdivision",
        "mesh.conforming_refinement",
        "mesh.gluing",
        "surfaces.intrinsic_history",
        "surfaces.intrinsic_refinement",
        "surfaces.intrinsic_transfer",
    ),
    "tets": (
        "tets.tet_mesh.TetMesh",
        "tets.tet_levels",
        "tets.tet_discretization",
        "tets.tet_source",
        "tets.lattice",
        "io.tet_files",
        "tets.tet_sharpening",
    ),
    "distance that jumps (piecewise)": ("curves.jumping_distance", "curves.jumps", "curves.cut_surface"),
    "point clouds": ("surfaces.point_cloud.PointCloud", "io.point_files", "solids.point_orientation"),
    "voxels and labels": ("surfaces.digital_surface.DigitalSurface", "io.voxel_files"),
    "drawings in the plane": ("grids.polyline.Polyline", "curves.drawings", "io.drawing_files"),
    "polygon meshes": ("surfaces.polygon_mesh",),
    "morphology": ("morphology",),
    "samples, deviation, thickness": ("solids.sampling", "solids.deviations", "solids.thickness"),
    "exact geodesic distance": (
        "geodesics.exact_distance",
        "geodesics.geodesic_sources",
        "geodesics.heap_kernels",
        "geodesics.shortest_paths",
    ),
    "curves that are completed": (
        "curves.curve_distance",
        "curves.curve_completion",
        "curves.strokes",
    ),
    "surfaces of solids": ("solids.contouring", "solids.offsets", "solids.kept_faces"),
    "completion of solids by lids": ("solids.completion", "solids.lids", "solids.closing", "solids.walls"),
    "orientation of faces and points": (
        "solids.mesh_orientation",
        "solids.point_orientation",
    ),
}
"""Names below the package that each feature begins with: modules, or functions and classes in them; ``.*`` for all."""
OPEN = ("cli", "samples", "morphology", "torch")
"""Modules all of whose functions are called from outside."""


@cache
def modules() -> dict[str, tuple[ast.Module, int]]:
    """The trees of all modules by name, and their numbers of lines."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        text = path.read_text()
        found[name] = ast.parse(text), text.count("\n")
    return found


def imported(tree: ast.Module, name: str, is_package: bool, known: set[str]) -> dict[str, str]:
    """What names at the top of a module mean: other modules, or things in them."""
    names: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            parts = name.split(".")[: len(name.split(".")) - node.level + is_package] if node.level else []
            base = ".".join([*parts, *([node.module] if node.module else [])])
            names |= {alias.asname or alias.name: f"{base}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Call) and node.value.args:
            first = node.value.args[0]
            if getattr(node.value.func, "id", "") == "lazy_module" and getattr(first, "value", None) in known:
                names[node.targets[0].id] = first.value  # type: ignore[attr-defined]
    return names


def graph() -> tuple[dict[str, set[str]], dict[str, int]]:
    """Which things name which others, and their lines; what is left of a module is a thing of its own."""
    trees = modules()
    needs: dict[str, set[str]] = {}
    lines: dict[str, int] = {}
    for name, (tree, length) in trees.items():
        meaning = meanings(name)
        own = {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
        gives = any("__all__" in ast.unparse(node) for node in tree.body if isinstance(node, ast.Assign))
        needs[name], lines[name] = set(meaning.values()) if gives else set(), length
        for number, node in enumerate(tree.body):
            thing, registered, found = name, [], set()
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                thing = f"{name}.{node.name if node.name != '_' else number}"
                registered = [each for each in node.decorator_list if "register" in ast.unparse(each)]
                begin = min([node.lineno, *(each.lineno for each in node.decorator_list)])
                size = (node.end_lineno or begin) - begin + 3  # with the empty lines before it
                lines[thing] = lines.get(thing, 0) + size
                lines[name] -= size
            for inner in ast.walk(node):
                if isinstance(inner, ast.Attribute) and isinstance(inner.value, ast.Name) and inner.value.id in meaning:
                    found.add(f"{meaning[inner.value.id]}.{inner.attr}")
                elif isinstance(inner, ast.Name):
                    found.add(f"{name}.{inner.id}" if inner.id in own else meaning.get(inner.id, ""))
            needs.setdefault(thing, set()).update({name, *found} - {""})
            if registered and isinstance(node, ast.FunctionDef) and node.args.args:
                first = node.args.args[0].annotation
                kinds = " ".join(map(ast.unparse, [*registered, *([] if first is None else [first])]))
                for word in set(re.findall(r"\w+", kinds)):
                    kind = f"{name}.{word}" if word in own else meaning.get(word)
                    if kind:
                        needs.setdefault(kind, set()).add(thing)
    for thing, named in needs.items():  # re-exports of packages
        needs[thing] = {imported_from(each, trees, needs) for each in named}
    return needs, lines


@cache
def meanings(name: str) -> dict[str, str]:
    """What names at the top of a module mean."""
    return imported(modules()[name][0], name, (ROOT / name.replace(".", "/")).is_dir(), set(modules()))


def imported_from(thing: str, trees: dict[str, tuple[ast.Module, int]], needs: dict[str, set[str]]) -> str:
    """Where a thing is defined, that a package may give under its own name."""
    module, _, last = thing.rpartition(".")
    if thing in needs or module not in trees:
        return thing
    meaning = meanings(module)
    return imported_from(meaning[last], trees, needs) if last in meaning and meaning[last] != thing else module


def reached(needs: dict[str, set[str]], without: set[str]) -> set[str]:
    """What is needed of the public names, the commands and the samples, without some things."""
    roots = ["signedheat.public", "signedheat.cli", "signedheat.cli.shell", "signedheat.samples", "signedheat.__main__"]
    roots += [thing for thing in needs if thing.startswith(tuple(f"signedheat.{name}." for name in OPEN))]
    stack = [imported_from(each, modules(), needs) for each in meanings("signedheat.public").values()] + roots
    seen: set[str] = set()
    while stack:
        thing = stack.pop()
        if thing in seen or thing in without:
            continue
        seen.add(thing)
        stack += needs.get(thing, ())
    return seen


def left_out(feature: tuple[str, ...], things: set[str]) -> set[str]:
    """The things that a feature begins with."""
    starts = [f"signedheat.{name.removesuffix('.*')}" for name in feature]
    return {thing for thing in things if any(thing == start or thing.startswith(f"{start}.") for start in starts)}


def main() -> None:
    """Print the lines of each feature, and of all of it."""
    needs, lines = graph()
    everything = reached(needs, set())
    print(f"{sum(lines.values()):7,d} all\n{sum(lines[t] for t in lines if t not in everything):7,d} not reached")
    things, gone = set(needs) | set(lines), set()
    print("  alone    left without it and all above")
    for name, feature in FEATURES.items():
        kept = reached(needs, left_out(feature, things))
        count = sum(size for thing, size in lines.items() if thing in everything and thing not in kept)
        gone |= left_out(feature, things)
        kept = reached(needs, gone)
        print(f"{count:7,d} {sum(size for thing, size in lines.items() if thing in kept):7,d} {name}")


if __name__ == "__main__":
    main()
