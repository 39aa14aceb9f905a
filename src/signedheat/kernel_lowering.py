"""From Numba's typed statements to LLVM's: short ways for what kernels are full of, with the same values.

Elements and parts of arrays, loops over ranges, sums and products of numbers, and variables that need no references.
Everything else is left to Numba. Importing this imports Numba.
"""

from __future__ import annotations

import operator
from importlib import import_module
from typing import Any

from . import kernel_calls as calls
from .kernel_entry import Entry, is_short

arrays: Any = import_module("numba.np.arrayobj")
callwrapper: Any = import_module("numba.core.callwrapper")
cgutils: Any = import_module("numba.core.cgutils")
ir: Any = import_module("numba.core.ir")
llvm: Any = import_module("llvmlite.ir")
lowering: Any = import_module("numba.core.lowering")
types: Any = import_module("numba.core.types")

FLOATS = {operator.add: "fadd", operator.sub: "fsub", operator.mul: "fmul"}
INTEGERS = {operator.add: "add", operator.sub: "sub", operator.mul: "mul"}
COMPARED = {
    operator.lt: "<",
    operator.le: "<=",
    operator.gt: ">",
    operator.ge: ">=",
    operator.eq: "==",
    operator.ne: "!=",
}
IN_PLACE = {operator.iadd: operator.add, operator.isub: operator.sub, operator.imul: operator.mul}


class Lower(lowering.Lower):  # type: ignore[misc]
    """Numba's, with these short ways."""

    def init(self) -> None:
        """Begin a function."""
        super().init()
        self._counted: dict[Any, bool] = {}
        self._ranges: dict[int, tuple[Any, Any, Any]] = {}

    def is_counted(self, kind: Any) -> bool:
        """Whether values of this type are kept alive by references."""
        if not self.context.enable_nrt:
            return False
        found = self._counted.get(kind)
        if found is None:
            model = self.context.data_model_manager[kind]
            found = self._counted[kind] = bool(model.contains_nrt_meminfo())
        return found

    def create_cpython_wrapper(self, release_gil: bool = False) -> None:
        """The entry for Python, which is not worth optimising."""
        if self.genlower:
            super().create_cpython_wrapper(release_gil)
            return
        module = self.context.create_module("wrapper")
        kind = self.context.call_conv.get_function_type(self.fndesc.restype, self.fndesc.argtypes)
        called = llvm.Function(module, kind, self.fndesc.llvm_func_name)
        if is_short(self.fndesc):
            entry = Entry(self.context, module, called, self.fndesc, self.env).build(release_gil)
        else:
            parts = self.context, module, called, self.fndesc, self.env, self.call_helper, release_gil
            entry, _ = callwrapper.PyCallWrapper(*parts).build()
        for attribute in ("noinline", "optnone"):
            entry.attributes.add(attribute)
        self.library.add_ir_module(module)

    def delvar(self, name: str) -> None:
        """The end of a variable."""
        if self.is_counted(self.typeof(name)):
            super().delvar(name)

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Give a variable its value."""
        if argidx is None and self.is_counted(self.typeof(name)):
            super().storevar(value, name)
        elif name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self.builder.store(value, self.getvar(name))

    def alloca_lltype(self, name: str, kind: Any, datamodel: Any = None) -> Any:
        """Room for a variable."""
        return cgutils.alloca_once(self.builder, kind, name=name)

    def lower_block(self, block: Any) -> None:
        """The statements of a block."""
        self.pre_block(block)
        for statement in block.body:
            self.loc = statement.loc
            self.lower_inst(statement)
        self.post_block(block)

    def lower_expr(self, kind: Any, expression: Any) -> Any:
        """The value of an expression."""
        op = expression.op
        if op in ("getiter", "iternext", "pair_first", "pair_second"):
            found = self._of_range(op, expression)
        elif op == "static_getitem" and expression.index_var is not None and self._is_plain(expression.value):
            found = self.lower_getitem(
                kind, expression, expression.value, expression.index_var, self.fndesc.calltypes[expression]
            )
        else:
            found = None
        return super().lower_expr(kind, expression) if found is None else found

    def lower_inst(self, statement: Any) -> None:
        """A statement."""
        if isinstance(statement, ir.StaticSetItem) and self._is_plain(statement.target):
            signature = self.fndesc.calltypes[statement]
            self.lower_setitem(statement.target, statement.index_var, statement.value, signature)
        else:
            super().lower_inst(statement)

    def lower_call(self, kind: Any, expression: Any) -> Any:
        """The value of a call."""
        short = calls.lowered(self, kind, expression)
        if short is not None:
            return short
        value = super().lower_call(kind, expression)
        function = self.typeof(expression.func.name)
        is_range = isinstance(kind, types.RangeType) and getattr(function, "typing_key", None) is range
        if is_range and kind.dtype.signed and len(expression.args) < 3:
            given = [self._cast_var(argument, kind.dtype) for argument in expression.args]
            start, stop = given if len(given) == 2 else (llvm.Constant(given[0].type, 0), given[0])
            self._ranges[id(value)] = start, stop, value
        return value

    def _of_range(self, op: str, expression: Any) -> Any:
        kind = self.typeof(expression.value.name)
        value = self.loadvar(expression.value.name)
        if op == "getiter":
            known = self._ranges.get(id(value))
            return None if known is None else self._begin(known, self.fndesc.calltypes[expression].return_type)
        if op == "iternext":
            if not isinstance(kind, types.RangeIteratorType):
                return None
            return self._next(value, kind, self.fndesc.calltypes[expression].return_type)
        if isinstance(kind, types.Pair) and not self.is_counted(kind):
            return self.builder.extract_value(value, int(op == "pair_second"))
        return None

    def _begin(self, known: tuple[Any, Any, Any], kind: Any) -> Any:
        """The iterator of a range whose steps are 1."""
        start, stop, _ = known
        builder = self.builder
        is_any = builder.icmp_signed(">", stop, start)
        count = builder.select(is_any, builder.sub(stop, start), llvm.Constant(stop.type, 0))
        places = [cgutils.alloca_once(builder, count.type) for _ in range(2)]
        builder.store(start, places[0])
        builder.store(count, places[1])
        return self._struct(kind, iter=places[0], count=places[1], stop=stop, step=llvm.Constant(count.type, 1))

    def _next(self, iterator: Any, kind: Any, pair_kind: Any) -> Any:
        """The next number of a range, and whether there is one."""
        builder = self.builder
        place, step, left = (self._field(iterator, kind, name) for name in ("iter", "step", "count"))
        value, count = builder.load(place), builder.load(left)
        is_valid = builder.icmp_signed(">", count, llvm.Constant(count.type, 0))
        builder.store(builder.sub(count, llvm.Constant(count.type, 1), flags=["nsw"]), left)
        builder.store(builder.add(value, step), place)
        pair = self.context.get_constant_undef(pair_kind)
        return builder.insert_value(builder.insert_value(pair, value, 0), is_valid, 1)

    def _field(self, value: Any, kind: Any, name: str) -> Any:
        model = self.context.data_model_manager[kind]
        return self.builder.extract_value(value, model.get_field_position(name))

    def _struct(self, kind: Any, **fields: Any) -> Any:
        model = self.context.data_model_manager[kind]
        value = self.context.get_constant_undef(kind)
        for name, field in fields.items():
            value = self.builder.insert_value(value, field, model.get_field_position(name))
        return value

    def lower_binop(self, kind: Any, expression: Any, op: Any) -> Any:
        """The value of an operator."""
        signature = self.fndesc.calltypes[expression]
        left, right = (types.unliteral(one) for one in signature.args)
        name = IN_PLACE.get(op, op)
        returned = types.unliteral(signature.return_type)
        is_float = left == types.float64
        if left != right or not (is_float or left == types.int64):
            return super().lower_binop(kind, expression, op)
        make = (FLOATS if is_float else INTEGERS).get(name) if returned == left else None
        if make is None and not (name in COMPARED and returned == types.boolean):
            return super().lower_binop(kind, expression, op)
        values = [self._cast_var(one, left) for one in (expression.lhs, expression.rhs)]
        if make is not None:
            value = getattr(self.builder, make)(*values)
        elif not is_float:
            value = self.builder.icmp_signed(COMPARED[name], *values)
        else:
            compare = self.builder.fcmp_unordered if name is operator.ne else self.builder.fcmp_ordered
            value = compare(COMPARED[name], *values)
        return self.context.cast(self.builder, value, returned, kind)

    def _is_plain(self, variable: Any) -> bool:
        kind = self.typeof(variable.name)
        return type(kind) is types.Array and kind.ndim > 0

    def lower_getitem(self, kind: Any, expression: Any, value: Any, index: Any, signature: Any) -> Any:
        """An element or part of an array."""
        place = self._place(value, index, signature.args)
        if place is None:
            return super().lower_getitem(kind, expression, value, index, signature)
        whole, pointer, taken = place
        array = self.typeof(value.name)
        part = signature.return_type
        if taken == array.ndim:
            found = arrays.load_item(self.context, self.builder, array, pointer)
        else:
            found = self._part(whole, array, part, pointer, taken)
            self.incref(part, found)
        return self.context.cast(self.builder, found, part, kind)

    def lower_setitem(self, target: Any, index: Any, value: Any, signature: Any) -> Any:
        """Give an element of an array its value."""
        array = self.typeof(target.name)
        place = None
        if self._is_plain(target) and not isinstance(self.typeof(value.name), types.Buffer | types.Optional):
            place = self._place(target, index, signature.args, whole_only=True)
        if place is None:
            return super().lower_setitem(target, index, value, signature)
        given = self.context.cast(self.builder, self.loadvar(value.name), self.typeof(value.name), signature.args[2])
        given = self.context.cast(self.builder, given, signature.args[2], array.dtype)
        return arrays.store_item(self.context, self.builder, array, given, place[1])

    def _place(self, variable: Any, index: Any, asked: Any, whole_only: bool = False) -> Any:
        """An array, a pointer into it, and how many of its axes the index takes; None if it has other than integers."""
        array, given = self.typeof(variable.name), self.typeof(index.name)
        if not self._is_plain(variable) or self.context.enable_boundscheck:
            return None
        kinds = tuple(asked[1]) if isinstance(asked[1], types.BaseTuple) else (asked[1],)
        if not kinds or len(kinds) > array.ndim or not all(isinstance(one, types.Integer) for one in kinds):
            return None
        if whole_only and len(kinds) < array.ndim:
            return None
        value = self.context.cast(self.builder, self.loadvar(index.name), given, asked[1])
        several = isinstance(asked[1], types.BaseTuple)
        parts = [self.builder.extract_value(value, k) for k in range(len(kinds))] if several else [value]
        whole = self.loadvar(variable.name)
        steps = [
            self._wrapped(part, one, whole, array, axis)
            for axis, (part, one) in enumerate(zip(parts, kinds, strict=True))
        ]
        return whole, self._pointer(whole, array, steps), len(kinds)

    def _wrapped(self, index: Any, kind: Any, whole: Any, array: Any, axis: int) -> Any:
        """An index that is not negative."""
        if not kind.signed:
            return self.context.cast(self.builder, index, kind, types.uintp)
        index = self.context.cast(self.builder, index, kind, types.intp)
        known = kind.literal_value if isinstance(kind, types.IntegerLiteral) else getattr(index, "constant", None)
        if isinstance(known, int) and known >= 0:
            return llvm.Constant(index.type, known)
        from_end = self.builder.add(index, self._size(whole, array, "shape", axis))
        is_negative = self.builder.icmp_signed("<", index, llvm.Constant(index.type, 0))
        return self.builder.select(is_negative, from_end, index)

    def _size(self, whole: Any, array: Any, field: str, axis: int) -> Any:
        position = self.context.data_model_manager[array].get_field_position(field)
        return self.builder.extract_value(whole, [position, axis])

    def _pointer(self, whole: Any, array: Any, steps: list[Any]) -> Any:
        builder = self.builder
        data = self._field(whole, array, "data")
        if array.layout != "C":
            parts = [builder.mul(self._size(whole, array, "strides", axis), one) for axis, one in enumerate(steps)]
            offset = parts[0]
            for part in parts[1:]:
                offset = builder.add(offset, part)
            return cgutils.pointer_add(builder, data, offset)
        place = steps[0]
        for axis in range(1, array.ndim):
            place = builder.mul(place, self._size(whole, array, "shape", axis))
            if axis < len(steps):
                place = builder.add(place, steps[axis])
        return builder.gep(data, [place])

    def _part(self, whole: Any, array: Any, part: Any, pointer: Any, taken: int) -> Any:
        """An array of the further axes."""
        sizes = [self._size(whole, array, "shape", axis) for axis in range(taken, array.ndim)]
        strides = [self._size(whole, array, "strides", axis) for axis in range(taken, array.ndim)]
        number = sizes[0]
        for size in sizes[1:]:
            number = self.builder.mul(number, size, flags=["nsw"])
        kept = {name: self._field(whole, array, name) for name in ("meminfo", "parent", "itemsize")}
        whole_type = self.context.get_value_type(types.intp)
        return self._struct(
            part,
            nitems=number,
            data=pointer,
            shape=cgutils.pack_array(self.builder, sizes, whole_type),
            strides=cgutils.pack_array(self.builder, strides, whole_type),
            **kept,
        )
