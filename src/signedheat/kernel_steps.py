"""Numba's steps before lowering, without the analyses that only generators and references need.

Importing this imports Numba.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

ir: Any = import_module("numba.core.ir")
ir_utils: Any = import_module("numba.core.ir_utils")
machinery: Any = import_module("numba.core.compiler_machinery")
rewrites: Any = import_module("numba.core.rewrites")
ssa: Any = import_module("numba.core.ssa")
transforms: Any = import_module("numba.core.transforms")
typed_passes: Any = import_module("numba.core.typed_passes")
types: Any = import_module("numba.core.types")
untyped_passes: Any = import_module("numba.core.untyped_passes")

VIEWS = {"getitem", "static_getitem", "getattr", "build_tuple", "cast", "phi", "getiter", "iternext", "exhaust_iter"}
VIEWS |= {"pair_first", "pair_second"}
"""Expressions whose value, if it is an array, is one that was there before, or a part of it."""


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
            if value.op in ("unary", "binop", "inplace_binop", "call"):
                yield isinstance(state.typemap.get(assignment.target.name), types.Array)
        for item in block.find_insts(ir.StaticSetItem):
            yield isinstance(item.index, str)


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


REPLACED = {
    untyped_passes.IRProcessing: Processing,
    untyped_passes.GenericRewrites: Rewriting,
    untyped_passes.ReconstructSSA: Assignments,
    typed_passes.NopythonRewrites: ArrayExpressions,
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
