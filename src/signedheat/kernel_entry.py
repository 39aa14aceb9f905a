"""The entry by which Python calls a kernel: Numba's in a third of the instructions, for arrays and numbers.

Numba's frees each argument in two places, and unpickles types and errors in every kernel. Here what goes wrong is told
by `raise_error`, in Python. Importing this imports Numba.
"""

from __future__ import annotations

import ctypes
from importlib import import_module
from typing import Any

import numpy as np

cgutils: Any = import_module("numba.core.cgutils")
llvm: Any = import_module("llvmlite.ir")
serialize: Any = import_module("numba.core.serialize")
supported: Any = import_module("numba.np.numpy_support")
types: Any = import_module("numba.core.types")

FORMATS = {types.int64: "L", types.float64: "d", types.boolean: "p"}
"""How Python reads the numbers that kernels take."""


class Raised(ctypes.Structure):
    """An error of compiled code."""

    _fields_ = (
        ("data", ctypes.c_void_p),
        ("size", ctypes.c_int32),
        ("arguments", ctypes.c_void_p),
        ("unpack", ctypes.c_void_p),
        ("is_dynamic", ctypes.c_int32),
    )


def raise_error(address: int) -> None:
    """Raise what compiled code has left at an address."""
    raised = Raised.from_address(address)
    data = ctypes.string_at(raised.data, raised.size)
    if raised.is_dynamic > 0:
        unpack = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)(raised.unpack)
        kind, arguments, _ = serialize.runtime_build_excinfo_struct(data, unpack(raised.arguments))
    else:
        kind, arguments, _ = serialize.loads(data)
    raise kind(*arguments) if isinstance(kind, type) and arguments is not None else kind


def is_short(description: Any) -> bool:
    """Whether all that a kernel takes and returns is arrays and numbers."""
    returned = description.restype
    parts = tuple(returned) if isinstance(returned, types.Tuple | types.UniTuple) else (returned,)
    return all(type(one) is types.Array or one in FORMATS for one in description.argtypes) and (
        returned == types.none or all(type(one) is types.Array or one in FORMATS for one in parts)
    )


class Entry:
    """The entry of a kernel `function`, as it is written into a module."""

    def __init__(self, context: Any, module: Any, function: Any, description: Any, environment: Any) -> None:
        self.context, self.module, self.function = context, module, function
        self.description, self.environment = description, environment
        pointer = context.get_argument_type(types.pyobject)
        kind = llvm.FunctionType(pointer, [pointer] * 3)
        self.entry = llvm.Function(module, kind, name=description.llvm_cpython_wrapper_name)
        self.builder = llvm.IRBuilder(self.entry.append_basic_block("entry"))
        self.api = context.get_python_api(self.builder)

    def build(self, releases: bool) -> Any:
        """Write it; `releases` the lock of Python while the kernel runs."""
        builder, api = self.builder, self.api
        values = self._unpacked()
        state = api.save_thread() if releases else None
        status, value = self.context.call_conv.call_function(
            builder, self.function, self.description.restype, self.description.argtypes, values, attrs=("noinline",)
        )
        if releases:
            api.restore_thread(state)
        if self.context.enable_nrt:
            for one, kind in zip(values, self.description.argtypes, strict=True):
                if isinstance(kind, types.Array):
                    self._release(one)
        with builder.if_then(status.is_error, likely=False):
            with builder.if_then(status.is_user_exc):
                self._raise(status.excinfoptr)
            builder.ret(api.get_null_object())
        builder.ret(self._packed(self.description.restype, value))
        return self.entry

    def _raise(self, error: Any) -> None:
        """Call `raise_error`."""
        api, builder = self.api, self.builder
        name, method, wanted = (self._text(one) for one in (__name__, raise_error.__name__, "K"))
        load = llvm.FunctionType(api.pyobj, [api.cstring])
        module = builder.call(cgutils.get_or_insert_function(self.module, load, "PyImport_ImportModule"), [name])
        call = llvm.FunctionType(api.pyobj, [api.pyobj, api.cstring, api.cstring], var_arg=True)
        address = builder.ptrtoint(error, llvm.IntType(64))
        called = cgutils.get_or_insert_function(self.module, call, "PyObject_CallMethod")
        builder.call(called, [module, method, wanted, address])
        api.decref(module)

    def _text(self, text: str) -> Any:
        return self.context.insert_const_string(self.module, text)

    def _unpacked(self) -> list[Any]:
        """The arguments as compiled code takes them."""
        context, builder, api = self.context, self.builder, self.api
        kinds, places, wanted = self.description.argtypes, [], ""
        for kind in kinds:
            is_array = isinstance(kind, types.Array)
            wanted += "O" if is_array else FORMATS[kind]
            number = llvm.IntType(32) if kind == types.boolean else context.get_value_type(kind)
            held = api.pyobj if is_array else number
            places.append(builder.alloca(held))
        text = self._text(wanted)
        shape = llvm.FunctionType(llvm.IntType(32), [api.pyobj, api.cstring], var_arg=True)
        parse = cgutils.get_or_insert_function(self.module, shape, "PyArg_ParseTuple")
        is_parsed = builder.call(parse, [self.entry.args[1], text, *places])
        with cgutils.if_unlikely(builder, cgutils.is_null(builder, is_parsed)):
            builder.ret(api.get_null_object())
        values, failed = [], llvm.Constant(llvm.IntType(32), 0)
        adapt = api.nrt_adapt_ndarray_from_python if context.enable_nrt else api.numba_array_adaptor
        for kind, place in zip(kinds, places, strict=True):
            value = builder.load(place)
            if isinstance(kind, types.Array):
                array = builder.alloca(context.get_value_type(kind))
                failed = builder.or_(failed, adapt(value, builder.bitcast(array, api.voidptr)))
                values.append(array)
            elif kind == types.boolean:
                values.append(cgutils.is_not_null(builder, value))
            else:
                values.append(value)
        with cgutils.if_unlikely(builder, cgutils.is_not_null(builder, failed)):
            api.err_set_string("PyExc_TypeError", self._text("what this takes is of another type"))
            builder.ret(api.get_null_object())
        return [builder.load(v) if isinstance(k, types.Array) else v for k, v in zip(kinds, values, strict=True)]

    def _release(self, array: Any) -> None:
        pointer = cgutils.voidptr_t
        kind = llvm.FunctionType(llvm.VoidType(), [pointer])
        release = cgutils.get_or_insert_function(self.module, kind, "NRT_decref")
        self.builder.call(release, [self.builder.bitcast(self.builder.extract_value(array, 0), pointer)])

    def _packed(self, kind: Any, value: Any) -> Any:
        """A result as Python takes it."""
        if kind == types.none:
            return self.api.make_none()
        if isinstance(kind, types.BaseTuple):
            whole = self.api.tuple_new(len(kind))
            for place, one in enumerate(kind):
                self.api.tuple_setitem(whole, place, self._packed(one, self.builder.extract_value(value, place)))
            return whole
        if kind == types.int64:
            return self.api.long_from_longlong(value)
        if kind == types.float64:
            return self.api.float_from_double(value)
        if kind == types.boolean:
            return self.api.bool_from_bool(value)
        return self._packed_array(kind, value)

    def _packed_array(self, kind: Any, value: Any) -> Any:
        builder, api = self.builder, self.api
        small = llvm.IntType(32)
        place = builder.alloca(value.type)
        builder.store(value, place)
        shape = llvm.FunctionType(api.pyobj, [api.voidptr, api.pyobj, small, small, api.pyobj])
        adapt = cgutils.get_or_insert_function(self.module, shape, "NRT_adapt_ndarray_to_python_acqref")
        element = self._constant(supported.as_dtype(kind.dtype))
        sizes = llvm.Constant(small, kind.ndim), llvm.Constant(small, int(kind.mutable))
        made = builder.call(adapt, [builder.bitcast(place, api.voidptr), self._constant(np.ndarray), *sizes, element])
        self._release(value)
        return made

    def _constant(self, value: Any) -> Any:
        """An object that is kept with the kernel."""
        kept = self.environment.consts
        if not any(one is value for one in kept):
            kept.append(value)
        index = next(k for k, one in enumerate(kept) if one is value)
        name = self.context.get_env_name(self.description)
        pointer = self.builder.load(self.context.declare_env_global(self.module, name))
        return self.api.list_getitem(self.context.get_env_body(self.builder, pointer).consts, index)
