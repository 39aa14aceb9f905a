"""How kernels are compiled: Numba's steps, without what kernels do not need, in two thirds of the time.

* The type of ``a + b`` for types that another kernel has added is not searched for again.
* References are counted only in kernels that make arrays. Others borrow those of their caller.
* Kernels that are called by kernels alone are linked into these, and never become machine code of their own.

Importing this imports Numba.
"""

from __future__ import annotations

from importlib import import_module
from inspect import iscode
from types import BuiltinFunctionType
from typing import Any

codegen: Any = import_module("numba.core.codegen")  # as far as type checkers are concerned, all of it is untyped
compiler: Any = import_module("numba.core.compiler")
environments: Any = import_module("numba.core.environment")
ir: Any = import_module("numba.core.ir")
llvm: Any = import_module("llvmlite.binding")
machinery: Any = import_module("numba.core.compiler_machinery")
make_function: Any = import_module("numba._dynfunc").make_function
typed_passes: Any = import_module("numba.core.typed_passes")
untyped_passes: Any = import_module("numba.core.untyped_passes")
types: Any = import_module("numba.core.types")

VIEWS = {"getitem", "static_getitem", "getattr", "build_tuple", "cast", "phi", "getiter", "iternext", "exhaust_iter"}
VIEWS |= {"pair_first", "pair_second"}
"""Expressions whose value, if it is an array, is one that was there before, or a part of it."""

OF_THE_CALLER = {"no_cpython_wrapper", "no_cfunc_wrapper", "release_gil"}
UNNESTED = untyped_passes.InlineClosureLikes, untyped_passes.WithLifting
"""Steps that do nothing where no function is within another, nor objects of Python are used."""

_KNOWN: dict[Any, Any] = {}


class Flags(compiler.Flags):  # type: ignore[misc]
    """Numba's options, compared by what matters to the functions that are called, and fast: it is done very often."""

    __slots__ = ()

    def values(self) -> dict[str, Any]:
        """Those that were set."""
        return {name: value for name, value in self._values.items() if name not in OF_THE_CALLER}

    def __hash__(self) -> int:
        return hash(frozenset(self.values()))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Flags) and self.values() == other.values()


class Typing:
    """Numba's typing context, which remembers what operators and library functions return for which arguments."""

    def __init__(self, context: Any, flags: Any) -> None:
        self._context = context
        self._flags = repr(flags.fastmath)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, function: Any, arguments: Any, keywords: Any) -> Any:
        """The signature of a call."""
        if not isinstance(function, types.Function | BuiltinFunctionType | str):
            return self._context.resolve_function_type(function, arguments, keywords)
        key = function, arguments, tuple(keywords.items()), self._flags
        found = _KNOWN.get(key)
        if found is None:
            found = _KNOWN[key] = self._context.resolve_function_type(function, arguments, keywords)
        return found


class LinkedLibrary(codegen.JITCodeLibrary):  # type: ignore[misc]
    """Code that is only linked into other code, where it is optimised."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def serialize_using_object_code(self) -> Any:
        """For the cache on disk."""
        return self.serialize_using_bitcode()

    @classmethod
    def restored(cls, context: Any, name: str, bitcode: bytes) -> LinkedLibrary:
        """From the cache on disk."""
        library = cls(context.codegen(), name)
        library._final_module = llvm.parse_bitcode(bitcode)
        library._finalized = True
        return library


@machinery.register_pass(mutates_CFG=True, analysis_only=False)
class Lowering(typed_passes.NativeLowering):  # type: ignore[misc]
    """From typed to compiled code."""

    _name = "signedheat_lowering"

    def run_pass(self, state: Any) -> bool:
        """Replace the step of Numba."""
        if not makes_references(state):
            state.targetctx = state.targetctx.subtarget(enable_nrt=False)
        if state.flags.no_cpython_wrapper:
            return self._link_only(state)
        done = super().run_pass(state)
        for variable in state.library._final_module.global_variables:
            environment = variable.name.startswith("_ZN08NumbaEnv") and environments.lookup_environment(variable.name)
            if environment:  # those of linked kernels
                state.library.codegen.set_env(variable.name, environment)
        return bool(done)

    def _link_only(self, state: Any) -> bool:
        state.library = LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags = state.flags.copy()
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state.cr
        entry = handle(lowered.fndesc, lowered.env)
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        state.cr = compiler._LowerResult(lowered.fndesc, lowered.call_helper, cfunc=entry, env=lowered.env)
        return True


def handle(description: Any, environment: Any) -> Any:
    """What other kernels know a linked function by; it cannot be called."""
    return make_function(description.lookup_module(), description.qualname, "", 0, environment, ())


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


class Pipeline(compiler.CompilerBase):  # type: ignore[misc]
    """The steps."""

    def __init__(
        self, typing: Any, target: Any, library: Any, arguments: Any, returned: Any, flags: Any, variables: Any
    ):
        super().__init__(typing, target, library, arguments, returned, flags, variables)
        self.state.flags = Flags(flags)
        self.state.typingctx = Typing(typing, flags)

    def define_pipelines(self) -> list[Any]:
        """Numba's, with another last step, and without those for functions within functions where there are none."""
        steps = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state, "signedheat")
        left_out = () if any(map(iscode, self.state.func_id.code.co_consts)) else UNNESTED
        kept = [(step, about) for step, about in steps.passes if step not in left_out]
        steps.passes = [(Lowering if step is typed_passes.NativeLowering else step, about) for step, about in kept]
        steps._finalized = False
        steps.finalize()
        return [steps]


def restored(context: Any, kept: Any) -> Any:
    """A kernel that is only linked, from what the cache on disk holds of it."""
    (name, _, bitcode), description, environment, signature, objects, lifted, annotation, reload, referenced = kept
    library = LinkedLibrary.restored(context, name, bitcode)
    return compiler.CompileResult(
        target_context=context,
        typing_context=context.typing_context,
        library=library,
        environment=environment,
        entry_point=handle(description, environment),
        fndesc=description,
        type_annotation=annotation,
        signature=signature,
        objectmode=objects,
        lifted=lifted,
        typing_error=None,
        call_helper=None,
        metadata=None,
        reload_init=reload,
        referenced_envs=referenced,
    )
