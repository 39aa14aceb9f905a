"""How kernels are compiled: Numba's steps, without what kernels do not need, in half of the time.

* The type of ``a + b`` for types that another kernel has added is not searched for again.
* References are counted only in kernels that make arrays. Others borrow those of their caller.
* Elements of arrays, loops and sums have short ways to LLVM (`kernel_lowering`), and analyses that only generators
  and references need are left out (`kernel_steps`).
* Kernels that are called by kernels alone are linked into these, and never become machine code of their own.

Importing this imports Numba.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from inspect import iscode
from types import BuiltinFunctionType
from typing import Any

from . import kernel_calls as calls
from .kernel_lowering import Lower
from .kernel_steps import REPLACED, Constraints, Sequence, listed, makes_references, rewritten

codegen: Any = import_module("numba.core.codegen")  # as far as type checkers are concerned, all of it is untyped
compiler: Any = import_module("numba.core.compiler")
config: Any = import_module("numba.core.config")
environments: Any = import_module("numba.core.environment")
ir: Any = import_module("numba.core.ir")
llvm: Any = import_module("llvmlite.binding")
machinery: Any = import_module("numba.core.compiler_machinery")
make_function: Any = import_module("numba._dynfunc").make_function
ssa: Any = import_module("numba.core.ssa")
typeinfer: Any = import_module("numba.core.typeinfer")
typed_passes: Any = import_module("numba.core.typed_passes")
untyped_passes: Any = import_module("numba.core.untyped_passes")
types: Any = import_module("numba.core.types")
templates: Any = import_module("numba.core.typing.templates")
compiler_lock: Any = import_module("numba.core.compiler_lock").global_compiler_lock

LINKED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
OF_THE_CALLER = {"no_cpython_wrapper", "no_cfunc_wrapper", "release_gil"}
UNNESTED = untyped_passes.InlineClosureLikes, untyped_passes.WithLifting
"""Steps that do nothing where no function is within another, nor objects of Python are used."""
LEVEL = 2
"""Of LLVM's optimisation: at 3, Numba's, compiling takes a thirtieth more, and kernels run no faster. Nor do they where
loops are unrolled, which takes a fifth of LLVM's time."""
NEW_PASSES = hasattr(llvm, "create_new_function_pass_manager")

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
            found = calls.returned(function, arguments, keywords)
            found = found or self._context.resolve_function_type(function, arguments, keywords)
            _KNOWN[key] = found
        return found


class Library(codegen.JITCodeLibrary):  # type: ignore[misc]
    """Code of a kernel, optimised as a whole, once; older versions of LLVM do as Numba says."""

    has_references = True

    def _optimize_functions(self, module: Any) -> None:
        """Only make variables of what lies on the stack: the rest of the work is done again for the whole."""
        if not NEW_PASSES:
            super()._optimize_functions(module)
            return
        module.data_layout = self._codegen._data_layout
        builder = self._codegen._pass_builder()
        for function in module.functions:
            if not function.is_declaration:
                steps = llvm.create_new_function_pass_manager()
                steps.add_sroa_pass()
                steps.add_simplify_cfg_pass()
                steps.add_instruction_combine_pass()
                steps.run(function, builder)

    def _optimize_final_module(self) -> None:
        if not NEW_PASSES:
            super()._optimize_final_module()
            return
        if self.has_references:  # into one function, so that most of them are found to be needless
            steps, builder = self._codegen._module_pass_manager(opt=0, loop_vectorize=False, cost="cheap")
            steps.run(self._final_module, builder)
        options = llvm.create_pipeline_tuning_options(min(LEVEL, int(config.OPT)))
        options.loop_vectorization = bool(config.LOOP_VECTORIZE)
        options.slp_vectorization = options.loop_unrolling = options.loop_interleaving = False
        builder = llvm.create_pass_builder(self._codegen._tm, options)
        steps = builder.getModulePassManager()
        if self.has_references:
            steps.add_refprune_pass()
        steps.run(self._final_module, builder)


class LinkedLibrary(Library):
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

    @property
    def lowering_class(self) -> Any:
        """From statements to LLVM's."""
        return Lower

    def run_pass(self, state: Any) -> bool:
        """Replace the step of Numba."""
        has_references = makes_references(state)
        if not has_references:
            state.targetctx = state.targetctx.subtarget(enable_nrt=False)
        if state.flags.no_cpython_wrapper:
            return self._link_only(state)
        state.library = Library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.has_references = has_references
        state.library.enable_object_caching()
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


@contextmanager
def our_steps() -> Iterator[None]:
    """While one of our kernels is compiled: what it calls of Numba's own is only linked, and nobody times LLVM."""
    lock = getattr(getattr(llvm.ffi.lib, "_lock", None), "_cblist", [])
    decorator = templates._OverloadFunctionTemplate._get_jit_decorator

    def linked(self: Any) -> Any:
        jit = decorator(self)
        return lambda **options: jit(**{**options, **LINKED, "pipeline_class": Pipeline})

    ours: dict[tuple[Any, str], Any] = {
        (templates._OverloadFunctionTemplate, "_get_jit_decorator"): linked,
        (typeinfer, "ConstraintNetwork"): Constraints,
        (ssa, "_run_block_rewrite"): rewritten,
        (ir.Inst, "_rec_list_vars"): listed,
    }
    with compiler_lock:
        told, lock[:] = list(lock), []
        theirs = {(owner, name): getattr(owner, name) for owner, name in ours}
        for (owner, name), value in ours.items():
            setattr(owner, name, value)
        try:
            yield
        finally:
            for (owner, name), value in theirs.items():
                setattr(owner, name, value)
            lock[:] = told


def handle(description: Any, environment: Any) -> Any:
    """What other kernels know a linked function by; it cannot be called."""
    return make_function(description.lookup_module(), description.qualname, "", 0, environment, ())


class Pipeline(compiler.CompilerBase):  # type: ignore[misc]
    """The steps."""

    def __init__(
        self, typing: Any, target: Any, library: Any, arguments: Any, returned: Any, flags: Any, variables: Any
    ):
        super().__init__(typing, target, library, arguments, returned, flags, variables)
        self.state.flags = Flags(flags)
        self.state.typingctx = Typing(typing, flags)

    def define_pipelines(self) -> list[Any]:
        """Numba's, some replaced, and without those for functions within functions where there are none."""
        steps = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state, "signedheat")
        left_out = () if any(map(iscode, self.state.func_id.code.co_consts)) else UNNESTED
        kept = [(step, about) for step, about in steps.passes if step not in left_out]
        replaced = {**REPLACED, typed_passes.NativeLowering: Lowering}
        steps.passes = [(replaced.get(step, step), about) for step, about in kept]
        sequence = Sequence("signedheat")
        sequence.passes = steps.passes
        sequence.finalize()
        return [sequence]


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
