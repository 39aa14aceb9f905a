"""Calls in kernels with short ways: ``np.empty``, ``np.zeros``, ``np.full``, ``np.ones``, ``min`` and ``max``.

Numba compiles a function of its own for each of them and for all types of their arguments. Importing this imports
Numba.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from .kernel_arrays import NO_END, is_plain, size

arrays: Any = import_module("numba.np.arrayobj")
cgutils: Any = import_module("numba.core.cgutils")
llvm: Any = import_module("llvmlite.ir")
types: Any = import_module("numba.core.types")
signature: Any = import_module("numba.core.typing").signature

SHAPED: dict[Any, tuple[str, ...]] = {
    **dict.fromkeys((np.empty, np.zeros, np.ones), ("shape", "dtype")),
    np.full: ("shape", "fill_value", "dtype"),
}
"""What makes arrays, and the names of its arguments."""
LEAST, GREATEST = {min: "<", max: ">"}, 3
"""How `min` and `max` compare, and of how many numbers at most."""
NUMBERS = types.int64, types.float64


def returned(function: Any, arguments: Any, keywords: Any) -> Any:
    """The signature of a call with a short way, or None."""
    key: Any = getattr(function, "typing_key", None)
    try:
        names = SHAPED.get(key)
    except TypeError:
        return None
    if names is not None:
        kind = _array(dict(zip(names, arguments, strict=False)) | keywords, key is np.full)
        return None if kind is None else signature(kind, *arguments, *keywords.values())
    if key in LEAST and not keywords and 1 < len(arguments) <= GREATEST:
        kinds = {types.unliteral(one) for one in arguments}
        if len(kinds) == 1 and kinds <= set(NUMBERS):
            return signature(*kinds, *arguments)
    return None


def _array(given: dict[str, Any], is_filled: bool) -> Any:
    shape, element = given.get("shape"), given.get("dtype")
    sizes = shape if isinstance(shape, types.BaseTuple) else (shape,)
    if not len(sizes) or not all(isinstance(one, types.Integer) and one.bitwidth <= 64 for one in sizes):
        return None
    if element is None:
        kind = types.unliteral(given["fill_value"]) if is_filled and "fill_value" in given else types.float64
    elif isinstance(element, types.DTypeSpec):
        kind = element.dtype
    else:
        key: Any = getattr(element, "typing_key", None)
        kind = {bool: types.boolean, int: types.int64, float: types.float64}.get(key)
    if not isinstance(kind, types.Integer | types.Float | types.Boolean):
        return None
    if is_filled and not isinstance(given.get("fill_value"), types.Integer | types.Float | types.Boolean):
        return None
    return types.Array(kind, len(sizes), "C")


def lowered(lower: Any, kind: Any, expression: Any) -> Any:
    """The value of such a call, or None."""
    function = lower.typeof(expression.func.name)
    key: Any = getattr(function, "typing_key", None)
    if key in MADE and expression.vararg is None and not expression.kws:
        return MADE[key](lower, kind, expression.args)
    if expression.vararg is not None or returned(function, *_given(lower, expression)) is None:
        return None
    made = lower.fndesc.calltypes[expression]
    if key in LEAST:
        values = [lower._cast_var(one, made.return_type) for one in expression.args]
        return lower.context.cast(lower.builder, _extreme(lower.builder, LEAST[key], values), made.return_type, kind)
    named = dict(zip(SHAPED[key], expression.args, strict=False)) | dict(expression.kws)
    array = _allocated(lower, made.return_type, _sizes(lower, named["shape"]))
    data, number, item = (lower.field(array, made.return_type, name) for name in ("data", "nitems", "itemsize"))
    if key is np.zeros:
        cgutils.memset(lower.builder, data, lower.builder.mul(item, number), 0)
    elif key is not np.empty:
        element = made.return_type.dtype
        if key is np.full:
            value = lower._cast_var(named["fill_value"], element)
        else:
            value = lower.context.get_constant_generic(lower.builder, element, 1)
        with cgutils.for_range(lower.builder, number) as loop:
            place = lower.builder.gep(data, [loop.index])
            arrays.store_item(lower.context, lower.builder, made.return_type, value, place)
    return array


def _range(lower: Any, kind: Any, given: list[Any]) -> Any:
    if not isinstance(kind, types.RangeType) or not kind.dtype.signed:
        return None
    bounds = [lower._cast_var(one, kind.dtype) for one in given]
    zero, one = (llvm.Constant(bounds[0].type, number) for number in (0, 1))
    start, stop, step = [[zero, *bounds, one], [*bounds, one], bounds][len(bounds) - 1]
    return lower.struct(kind, start=start, stop=stop, step=step)


def _slice(lower: Any, kind: Any, given: list[Any]) -> Any:
    kinds = [lower.typeof(one.name) for one in given]
    if not all(one == types.none or isinstance(one, types.Integer) for one in kinds) or kind.has_step:
        return None
    bounds = [
        None if one == types.none else lower._cast_var(var, types.intp) for one, var in zip(kinds, given, strict=True)
    ]
    start, stop = [None, *bounds] if len(bounds) == 1 else bounds[:2]
    first, last, one = (lower.context.get_constant(types.intp, number) for number in (0, NO_END, 1))
    return lower.struct(kind, start=start or first, stop=stop or last, step=one)


def _length(lower: Any, kind: Any, given: list[Any]) -> Any:
    array = lower.typeof(given[0].name)
    return size(lower, lower.loadvar(given[0].name), array, 0) if is_plain(array) and kind == types.intp else None


def _truth(lower: Any, kind: Any, given: list[Any]) -> Any:
    is_one = len(given) == 1 and lower.typeof(given[0].name) == kind == types.boolean
    return lower.loadvar(given[0].name) if is_one else None


MADE = {range: _range, slice: _slice, len: _length, bool: _truth}
"""What is made of arguments at once."""


def _given(lower: Any, expression: Any) -> tuple[Any, Any]:
    arguments = tuple(lower.typeof(one.name) for one in expression.args)
    return arguments, {name: lower.typeof(one.name) for name, one in expression.kws}


def _extreme(builder: Any, sign: str, values: list[Any]) -> Any:
    """As Python does, whose result depends on the order if one is NaN."""
    best = values[0]
    for value in values[1:]:
        is_int = isinstance(value.type, llvm.IntType)
        compare = builder.icmp_signed if is_int else builder.fcmp_ordered
        best = builder.select(compare(sign, value, best), value, best)
    return best


def _sizes(lower: Any, shape: Any) -> list[Any]:
    kind, value = lower.typeof(shape.name), lower.loadvar(shape.name)
    if not isinstance(kind, types.BaseTuple):
        return [lower.context.cast(lower.builder, value, kind, types.intp)]
    return [
        lower.context.cast(lower.builder, lower.builder.extract_value(value, axis), one, types.intp)
        for axis, one in enumerate(kind)
    ]


def _allocated(lower: Any, kind: Any, sizes: list[Any]) -> Any:
    """An array whose elements have no values yet."""
    context, builder = lower.context, lower.builder
    item = context.get_constant(types.intp, arrays.get_itemsize(context, kind))
    zero = llvm.Constant(item.type, 0)
    strides, number = [item], sizes[-1]
    is_wrong = builder.icmp_signed("<", sizes[-1], zero)
    for one in reversed(sizes[:-1]):
        strides.insert(0, builder.mul(item, number))
        product = builder.smul_with_overflow(number, one)
        number = builder.extract_value(product, 0)
        is_wrong = builder.or_(is_wrong, builder.icmp_signed("<", one, zero))
        is_wrong = builder.or_(is_wrong, builder.extract_value(product, 1))
    product = builder.smul_with_overflow(number, item)
    is_wrong = builder.or_(is_wrong, builder.extract_value(product, 1))
    with cgutils.if_unlikely(builder, is_wrong):
        context.call_conv.return_user_exc(builder, ValueError, ("the size of an array is negative or too large",))
    align = context.get_preferred_array_alignment(kind.dtype)
    held = context.nrt.meminfo_alloc_aligned(builder, builder.extract_value(product, 0), align)
    data = context.nrt.meminfo_data(builder, held)
    return lower.struct(
        kind,
        data=builder.bitcast(data, context.get_data_type(kind.dtype).as_pointer()),
        shape=cgutils.pack_array(builder, sizes, item.type),
        strides=cgutils.pack_array(builder, strides, item.type),
        itemsize=item,
        nitems=number,
        meminfo=held,
        parent=llvm.Constant(cgutils.voidptr_t, None),
    )
