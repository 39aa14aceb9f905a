"""Values of kernels on their way to LLVM: fewer instructions, with the same meaning.

What was put into an array's description or a tuple is taken out again without an instruction, variables that are
assigned once have no place in memory, and what nobody uses is not written. Importing this imports Numba.
"""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Callable
from importlib import import_module
from typing import Any

analysis: Any = import_module("numba.core.analysis")
instructions: Any = import_module("llvmlite.ir.instructions")
ir: Any = import_module("numba.core.ir")
llvm: Any = import_module("llvmlite.ir")
types: Any = import_module("numba.core.types")

INSERTION = instructions.InsertValue
NEEDLESS = INSERTION, instructions.ExtractValue, instructions.GEPInstr, instructions.CastInstr
"""Instructions that do nothing but make a value; loads as well, unless they are volatile."""
KEPT = {getattr(operator, name) for name in ("add", "iadd", "mul", "imul", "floordiv", "mod", "lshift", "and_")}
"""Operators whose value is not negative where both sides are not."""


class Builder(llvm.IRBuilder):  # type: ignore[misc]
    """A builder that looks up what was put into an aggregate."""

    def __init__(self, block: Any) -> None:
        super().__init__(block)
        self._taken: dict[Any, Any] = {}

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        """A part of an aggregate."""
        path = tuple(idx) if isinstance(idx, tuple | list) else (idx,)
        whole = agg
        while type(whole) is INSERTION:
            inner = tuple(whole.indices)
            if path[: len(inner)] == inner:
                whole, path = whole.value, path[len(inner) :]
                if not path:
                    return whole
            elif inner[: len(path)] == path:  # only some of what is asked for
                break
            else:
                whole = whole.aggregate
        key = whole, path, self.block
        found = self._taken.get(key)
        if found is None:
            found = self._taken[key] = super().extract_value(whole, path, name)
        return found


class Variables:
    """Which variables of a function need no place in memory.

    Attributes
    ----------
    once : set of str
        Assigned once, before every use on every path.
    owned : set of str
        Those of them that are given up once on every path from there, so that their references can be counted without
        asking whether they hold anything.
    """

    def __init__(self, blocks: Any, is_counted: Callable[[str], bool]) -> None:
        graph = analysis.compute_cfg_from_blocks(blocks)
        self._after = {label: [one for one, _ in graph.successors(label)] for label in blocks}
        places, ends = _assigned_once(blocks, graph.dominators())
        self.once = set(places)
        self.owned = {
            name
            for name, (label, _) in places.items()
            if is_counted(name) and self._is_given_up_once(label, ends.get(name, []))
        }

    def _is_given_up_once(self, label: int, ends: list[int]) -> bool:
        if len(set(ends)) < len(ends):
            return False
        if label not in ends and self._reaches(label, set(ends), {label}):
            return False
        return not any(self._reaches(end, {label}, set(ends)) for end in ends)

    def _reaches(self, label: int, avoided: set[int], goals: set[int]) -> bool:
        """Whether a path leads from the end of a block to one of the goals, not through those to be avoided."""
        waiting, seen = list(self._after[label]), set()
        while waiting:
            one = waiting.pop()
            if one in goals - avoided:
                return True
            if one not in seen and one not in avoided:
                seen.add(one)
                waiting += self._after[one]
        return False


def _assigned_once(blocks: Any, before: Any) -> tuple[dict[str, tuple[int, int]], dict[str, list[int]]]:
    """Where variables are assigned that are so once, before every use; and in which blocks each variable ends.

    Blocks are lowered in the order of their labels: what is assigned in one with a greater label does not count.
    """
    places: dict[str, Any] = {}
    ends: dict[str, list[int]] = {}
    for label, block in blocks.items():
        for position, statement in enumerate(block.body):
            if isinstance(statement, ir.Assign):
                name = statement.target.name
                places[name] = None if name in places else (label, position)
            elif isinstance(statement, ir.Del):
                ends.setdefault(statement.value, []).append(label)
    for label, block in blocks.items():
        for position, statement in enumerate(block.body):
            for name in _used(statement):
                place = places.get(name)
                if place is None:
                    continue
                is_before = place[1] < position if place[0] == label else place[0] < label and place[0] in before[label]
                if not is_before:
                    places[name] = None
    return {name: place for name, place in places.items() if place is not None}, ends


def _used(statement: Any) -> list[str]:
    if isinstance(statement, ir.Del):
        return [statement.value]
    if isinstance(statement, ir.Assign):
        value = statement.value
        if isinstance(value, ir.Var):
            return [value.name]
        return [one.name for one in value.list_vars()] if isinstance(value, ir.Inst) else []
    return [one.name for one in statement.list_vars()]


def counting(blocks: Any, typeof: Callable[[str], Any]) -> set[str]:
    """Variables that are integers and never negative: numbers of loops, sizes, and sums and products of such."""
    given: dict[str, list[Any]] = {}
    for block in blocks.values():
        for statement in block.find_insts(ir.Assign):
            given.setdefault(statement.target.name, []).append(statement.value)
    needed: dict[str, list[str]] = {}
    for name, values in given.items():
        if isinstance(typeof(name), types.Integer):
            parts = [_as_far_as(value, given, typeof) for value in values]
            if None not in parts:
                needed[name] = [one for part in parts for one in part or ()]
    while True:
        wrong = [name for name, parts in needed.items() if not all(one in needed for one in parts)]
        if not wrong:
            return set(needed)
        for name in wrong:
            del needed[name]


def _as_far_as(value: Any, given: dict[str, list[Any]], typeof: Callable[[str], Any]) -> list[str] | None:
    """The variables that a value is as certain of not being negative as; None if that is not known."""
    if isinstance(value, ir.Var):
        return [value.name]
    if isinstance(value, ir.Const | ir.Global | ir.FreeVar):
        return [] if isinstance(value.value, int) and value.value >= 0 else None
    if not isinstance(value, ir.Expr):
        return None
    if value.op in ("binop", "inplace_binop"):
        return [value.lhs.name, value.rhs.name] if value.fn in KEPT else None
    if value.op == "cast":
        return [value.value.name]
    if value.op == "getattr":
        return [] if value.attr in ("size", "ndim") else None
    if value.op == "static_getitem":
        return [] if _is_shape(_origin(value.value, given)) else None
    if value.op == "call":
        return _of_call(value, typeof)
    if value.op != "pair_first":
        return None
    bounds = _range(value, given, typeof)
    if bounds is None or len(bounds) == 3:
        return None
    return [] if len(bounds) == 1 else [bounds[0].name]


def _of_call(call: Any, typeof: Callable[[str], Any]) -> list[str] | None:
    key = getattr(typeof(call.func.name), "typing_key", None)
    if key is len:
        return []
    if key is max:
        kinds = [typeof(one.name) for one in call.args]
        return [] if any(isinstance(k, types.IntegerLiteral) and k.literal_value >= 0 for k in kinds) else None
    is_number = key is int or isinstance(typeof(call.func.name), types.NumberClass)
    return [one.name for one in call.args] if key is min or (is_number and len(call.args) == 1) else None


def _range(pair: Any, given: dict[str, list[Any]], typeof: Callable[[str], Any]) -> Any:
    """The bounds of the range from which a number comes."""
    value = pair
    for op in ("iternext", "getiter", "call"):
        value = _origin(value.value, given)
        if not isinstance(value, ir.Expr) or value.op != op:
            return None
    return value.args if getattr(typeof(value.func.name), "typing_key", None) is range else None


def _origin(variable: Any, given: dict[str, list[Any]]) -> Any:
    """What a variable is given, if only once."""
    value = variable
    while isinstance(value, ir.Var):
        values = given.get(value.name, ())
        if len(values) != 1:
            return None
        value = values[0]
        if isinstance(value, ir.Expr) and value.op == "exhaust_iter":
            value = value.value
    return value


def _is_shape(value: Any) -> bool:
    return isinstance(value, ir.Expr) and value.op == "getattr" and value.attr == "shape"


def drop_unused(function: Any) -> None:
    """Leave out instructions of a function whose values nobody uses."""
    uses: Counter[int] = Counter()
    for block in function.blocks:
        for instruction in block.instructions:
            uses.update(map(id, _operands(instruction)))
    for block in reversed(function.blocks):
        kept = []
        for instruction in reversed(block.instructions):
            if not uses[id(instruction)] and _only_makes_a_value(instruction):
                uses.subtract(map(id, instruction.operands))
            else:
                kept.append(instruction)
        block.instructions[:] = reversed(kept)


def _operands(instruction: Any) -> list[Any]:
    if isinstance(instruction, instructions.PhiInstr):
        return [value for value, _ in instruction.incomings]
    operands: list[Any] = instruction.operands
    return operands


def _only_makes_a_value(instruction: Any) -> bool:
    return isinstance(instruction, NEEDLESS) or (
        isinstance(instruction, instructions.LoadInstr) and not getattr(instruction, "volatile", False)
    )
