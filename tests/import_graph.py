"""The imports of a package, read from its source: which module names which, and what is wrong with that."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

Graph = Mapping[str, frozenset[str]]
"""Modules, and the modules of the same package that each imports."""


def import_graph(package: Path) -> Graph:
    """Every import counts: within functions, within ``if TYPE_CHECKING``, of names and of modules."""
    modules = {_module_name(package, path): path for path in sorted(package.rglob("*.py"))}
    return {name: frozenset(_imported(name, path, modules)) for name, path in modules.items()}


def circles(graph: Graph) -> list[list[str]]:
    """Modules that import one another, however indirectly: one list, in alphabetical order, for each such group."""
    found = []
    left = set(graph)
    while left:
        module = min(left)
        group = {other for other in _reached(graph, module) if module in _reached(graph, other)}
        if group:
            found.append(sorted(group))
        left -= group | {module}
    return found


def upward_imports(graph: Graph, floors: Sequence[Iterable[str]]) -> list[tuple[str, str]]:
    """Imports that point to a higher floor, as pairs (importer, imported).

    A floor is a set of modules and folders, named within the package; the package itself is ``""``. What no floor names
    is refused, so that a new folder has to be given its place.
    """
    height = {entry: number for number, floor in enumerate(floors) for entry in floor}

    def floor_of(module: str) -> int:
        inner = module.partition(".")[2]
        parts = inner.split(".")
        for length in range(len(parts), 0, -1):
            if ".".join(parts[:length]) in height:
                return height[".".join(parts[:length])]
        raise LookupError(f"{module} has no floor: give it one")

    return sorted((a, b) for a, imported in graph.items() for b in imported if floor_of(b) > floor_of(a))


def _module_name(package: Path, path: Path) -> str:
    parts = path.relative_to(package.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imported(name: str, path: Path, modules: Mapping[str, Path]) -> Iterator[str]:
    top = name.partition(".")[0]
    is_folder = path.name == "__init__.py"
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            named = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parents = name.split(".")
            base = parents[: len(parents) - node.level + is_folder] if node.level else []
            origin = ".".join([*base, *([node.module] if node.module else [])])
            named = [
                f"{origin}.{alias.name}" if f"{origin}.{alias.name}" in modules else origin for alias in node.names
            ]
        else:
            continue
        yield from (module for module in named if module.partition(".")[0] == top and module != name)


def _reached(graph: Graph, module: str) -> set[str]:
    """What a module imports, directly and indirectly; itself only if there is a way back to it."""
    reached: set[str] = set()
    waiting = [module]
    while waiting:
        for other in graph.get(waiting.pop(), ()):
            if other not in reached:
                reached.add(other)
                waiting.append(other)
    return reached
