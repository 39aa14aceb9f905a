"""Numba's steps before lowering, without the analyses that only generators and references need.

Importing this imports Numba.
"""

from __future__ import annotations

from importlib import import_module
from operator import is_
from typing import Any

import numpy as np

errors: Any = import_module("numba.core.errors")
ir: Any = import_module("numba.core.ir")
ir_utils: Any = import_module("numba.core.ir_utils")
machinery: Any = import_module("numba.core.compiler_machinery")
rewrites: Any = import_module("numba.core.rewrites")
ssa: Any = import_module("numba.core.ssa")
transforms: Any = import_module("numba.core.transforms")
typed_passes: Any = import_module("numba.core.typed_passes")
typeinfer: Any = import_module("numba.core.typeinfer")
types: Any = import_module("numba.core.types")
untyped_passes: Any = import_module("numba.core.untyped_passes")
utils: Any = import_module("numba.core.utils")

VIEWS = {"getitem", "static_getitem", "getattr", "build_tuple", "cast", "phi", "getiter", "iternext", "exhaust_iter"}
VIEWS |= {"pair_first", "pair_second"}
"""Expressions whose value, if it is an array, is one that was there before, or a part of it."""
PLAIN = {ir.Loc, str, int, float, bool, type(None)}
"""Parts of statements that hold no variables."""
UFUNCS = np.ufunc, import_module("numba.np.ufunc.dufunc").DUFunc
"""What calls of arrays become a loop."""


@machinery.register_pass(mutates_CFG=True, analysis_only=False)
class Processing(untyped_passes.IRProcessing):  # type: ignore[misc]
    """Blocks in order."""

    _name = "signedheat_processing"

    def run_pass(self, state: Any) -> bool:
        """Replace the step of Numba."""
        if state.func_ir.is_generator:
            return bool(super().run_pass(state))
        state.func_ir.blocks = transforms.canonicalize_cfg(state.func_ir.blocks)
        state.func_ir.generator_info = None
        return True


@machinery.register_pass(mutates_CFG=True, analysis_only=False)
class Rewriting(untyped_passes.GenericRewrites):  # type: ignore[misc]
    """Constant indices and the like."""

    _name = "signedheat_rewriting"

    def run_pass(self, state: Any) -> bool:
        """Replace the step of Numba."""
        if state.func_ir.is_generator:
            return bool(super().run_pass(state))
        blocks = state.func_ir.blocks
        for kind in rewrites.rewrite_registry.rewrites["before-inference"]:
            rewrite, waiting = kind(state), list(blocks.items())
            while waiting:
                key, block = waiting.pop()
                if rewrite.match(state.func_ir, block, state.typemap, state.calltypes):
                    blocks[key] = rewrite.apply()
                    waiting.append((key, blocks[key]))
        return True


@machinery.register_pass(mutates_CFG=False, analysis_only=False)
class Assignments(untyped_passes.ReconstructSSA):  # type: ignore[misc]
    """Variables that are assigned once."""

    _name = "signedheat_assignments"

    def run_pass(self, state: Any) -> bool:
        """Replace the step of Numba."""
        if state.func_ir.is_generator:
            return bool(super().run_pass(state))
        state.func_ir = ssa.reconstruct_ssa(state.func_ir)
        self._patch_locals(state)
        state.func_ir._definitions = ir_utils.build_definitions(state.func_ir.blocks)
        return True


@machinery.register_pass(mutates_CFG=True, analysis_only=False)
class ArrayExpressions(typed_passes.NopythonRewrites):  # type: ignore[misc]
    """Loops in the place of sums of arrays."""

    _name = "signedheat_array_expressions"

    def run_pass(self, state: Any) -> bool:
        """Replace the step of Numba."""
        return bool(super().run_pass(state)) if any(map(bool, _array_expressions(state))) else False


def _array_expressions(state: Any) -> Any:
    for block in state.func_ir.blocks.values():
        for assignment in block.find_insts(ir.Assign):
            value = assignment.value
            if not isinstance(value, ir.Expr):
                continue
            if value.op == "static_getitem" and isinstance(value.index, str):
                yield True
            if value.op in ("unary", "binop", "inplace_binop") or (value.op == "call" and _is_ufunc(state, value.func)):
                yield isinstance(state.typemap.get(assignment.target.name), types.Array)
        for item in block.find_insts(ir.StaticSetItem):
            yield isinstance(item.index, str)


def _is_ufunc(state: Any, function: Any) -> bool:
    kind = state.typemap[function.name]
    return not isinstance(kind, types.Dispatcher) and isinstance(getattr(kind, "typing_key", None), UFUNCS)


@machinery.register_pass(mutates_CFG=True, analysis_only=False)
class Merging(typed_passes.PreLowerStripPhis):  # type: ignore[misc]
    """Variables that are assigned in several places again."""

    _name = "signedheat_merging"

    def run_pass(self, state: Any) -> bool:
        """Replace the step of Numba."""
        if state.func_ir.is_generator:
            return bool(super().run_pass(state))
        state.func_ir = self._strip_phi_nodes(state.func_ir)
        state.func_ir._definitions = ir_utils.build_definitions(state.func_ir.blocks)
        return True


@machinery.register_pass(mutates_CFG=False, analysis_only=True)
class Ends(typed_passes.IRLegalization):  # type: ignore[misc]
    """Where variables end, in kernels that count references."""

    _name = "signedheat_ends"

    def run_pass(self, state: Any) -> bool:
        """Replace the step of Numba."""
        if state.func_ir.is_generator or makes_references(state):
            return bool(super().run_pass(state))
        state.func_ir.blocks = transforms.canonicalize_cfg(state.func_ir.blocks)
        return True


def rewritten(blocks: Any, states: Any, handler: Any) -> Any:
    """Blocks in which one variable is given other names: Numba's, which rewrites those without the variable, too."""
    name, found = states["varname"], {}
    for label, block in blocks.items():
        if name not in _names(block):
            found[label] = block
            continue
        states["label"], states["block"] = label, block
        new = found[label] = ir.Block(scope=block.scope, loc=block.loc)
        for statement in block.body:
            is_assigned = isinstance(statement, ir.Assign)
            new.body.append((handler.on_assign if is_assigned else handler.on_other)(states, statement))
        new.names = block.names
    return found


def listed(_: Any, value: Any) -> list[Any]:
    """The variables in a statement or a part of one, in order: what Numba asks for most often."""
    found: list[Any] = []
    _list(value, found)
    return found


def _list(value: Any, found: list[Any]) -> None:
    kind = type(value)
    if kind is ir.Var:
        found.append(value)
    elif isinstance(value, dict | list | tuple):
        for part in value.values() if isinstance(value, dict) else value:
            if type(part) not in PLAIN:
                _list(part, found)
    elif isinstance(value, ir.Inst):
        found += value.list_vars()


def _names(block: Any) -> Any:
    """Of all variables in a block, as they were at first: later ones are never searched for."""
    names = getattr(block, "names", None)
    if names is None:
        names = block.names = {one.name for statement in block.body for one in statement.list_vars()}
    return names


class Sequence(machinery.PassManager):  # type: ignore[misc]
    """Steps one after another, without checks between them, nor analyses that only generators and lifted loops need."""

    def _runPass(self, index: int, step: Any, state: Any) -> None:
        if state.func_ir is not None and state.func_ir.is_generator:
            super()._runPass(index, step, state)
            return
        step.analysis = self._analysis
        with errors.new_error_context("Pass {name}", name=step.name()):
            has_changed = step.run_initialization(state)
            has_changed |= step.run_pass(state)
            has_changed |= step.run_finalizer(state)
        if has_changed and machinery._pass_registry.get(type(step)).mutates_CFG:
            state.func_ir.blocks = transforms.canonicalize_cfg(state.func_ir.blocks)


class Constraints(typeinfer.ConstraintNetwork):  # type: ignore[misc]
    """What types depend on: asked again only when a type has changed, and without a place for the warnings of each."""

    def __init__(self) -> None:
        super().__init__()
        self._names: list[list[str]] = []
        self._known: dict[int, list[Any]] = {}

    def propagate(self, inferer: Any) -> list[Any]:
        """Apply all; those that fail for now are told."""
        told = []
        for place, constraint in enumerate(self.constraints):
            if place in self._known and all(map(is_, self._known[place], self._types(place, inferer))):
                continue
            try:
                constraint(inferer)
            except errors.ForceLiteralArg as error:
                told.append(error)
            except errors.TypingError as error:
                told.append(utils.chain_exception(errors.TypingError(str(error), loc=constraint.loc), error))
            else:
                found = self._types(place, inferer)
                if not any(isinstance(kind, types.Dispatcher | types.RecursiveCall) for kind in found):
                    self._known[place] = found
        return told

    def _types(self, place: int, inferer: Any) -> list[Any]:
        """The types, as far as they are known, of all variables in a constraint."""
        while place >= len(self._names):
            parts = list(vars(self.constraints[len(self._names)]).values())
            texts = [part for part in parts if isinstance(part, str) and part in inferer.typevars]
            self._names.append(texts + [one.name for one in listed(None, parts)])
        return [getattr(inferer.typevars.get(name), "type", None) for name in self._names[place]]


REPLACED = {
    untyped_passes.IRProcessing: Processing,
    untyped_passes.GenericRewrites: Rewriting,
    untyped_passes.ReconstructSSA: Assignments,
    typed_passes.NopythonRewrites: ArrayExpressions,
    typed_passes.PreLowerStripPhis: Merging,
    typed_passes.IRLegalization: Ends,
}


def makes_references(state: Any) -> bool:
    """Whether a function makes or returns arrays, or uses lists and the like."""

    def counted(kind: Any) -> bool:
        return bool(state.targetctx.data_model_manager[kind].contains_nrt_meminfo())

    def borrowed(kind: Any) -> bool:
        return isinstance(kind, types.Array | types.ArrayIterator | types.Pair) or (
            isinstance(kind, types.BaseTuple) and all(borrowed(part) or not counted(part) for part in kind)
        )

    if counted(state.return_type) or any(counted(t) and not borrowed(t) for t in state.typemap.values()):
        return True
    for block in state.func_ir.blocks.values():
        for assignment in block.find_insts(ir.Assign):
            value = assignment.value
            if isinstance(value, ir.Expr) and counted(state.typemap[assignment.target.name]):
                index = value.op == "getitem" and state.typemap[value.index.name]
                if value.op not in VIEWS or (index and counted(index)):
                    return True
    return False
