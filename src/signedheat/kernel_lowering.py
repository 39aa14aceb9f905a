"""From Numba's typed statements to LLVM's: short ways for what kernels are full of, with the same values.

Elements, parts and sizes of arrays, loops over ranges, sums and products of numbers, and variables (`kernel_values`).
Everything else is left to Numba. Importing this imports Numba.
"""

from __future__ import annotations

import operator
from importlib import import_module
from typing import Any

from . import kernel_calls as calls
from .kernel_arrays import Place, is_plain, sizes
from .kernel_entry import Entry, is_short
from .kernel_values import Builder, Variables, counting, drop_unused

arrays: Any = import_module("numba.np.arrayobj")
callwrapper: Any = import_module("numba.core.callwrapper")
cgutils: Any = import_module("numba.core.cgutils")
ir: Any = import_module("numba.core.ir")
llvm: Any = import_module("llvmlite.ir")
lowering: Any = import_module("numba.core.lowering")
types: Any = import_module("numba.core.types")

NAMES = "add", "sub", "mul", "pow", "floordiv", "mod", "xor"
NUMBERS = {
    types.float64: {operator.add: "fadd", operator.sub: "fsub", operator.mul: "fmul"},
    types.int64: {operator.add: "add", operator.sub: "sub", operator.mul: "mul", operator.xor: "xor"},
}
COMPARED = {
    operator.lt: "<",
    operator.le: "<=",
    operator.gt: ">",
    operator.ge: ">=",
    operator.eq: "==",
    operator.ne: "!=",
}
IN_PLACE = {getattr(operator, f"i{name}"): getattr(operator, name) for name in NAMES}


def _quotient(builder: Any, value: Any, divisor: Any) -> Any:
    """Rounded down, by a positive constant."""
    is_below = builder.icmp_signed("<", builder.srem(value, divisor), llvm.Constant(value.type, 0))
    return builder.add(builder.sdiv(value, divisor), builder.sext(is_below, value.type))


def _remainder(builder: Any, value: Any, divisor: Any) -> Any:
    """Not negative, by a positive constant."""
    rest = builder.srem(value, divisor)
    is_below = builder.icmp_signed("<", rest, llvm.Constant(value.type, 0))
    return builder.select(is_below, builder.add(rest, divisor), rest)


DIVIDED = {operator.floordiv: _quotient, operator.mod: _remainder}


class Lower(lowering.Lower):  # type: ignore[misc]
    """Numba's, with these short ways."""

    def init(self) -> None:
        """Begin a function."""
        self._counted: dict[Any, bool] = {}
        self._values: dict[str, Any] = {}
        self._held: set[str] = set()
        self._counting: set[str] = set()
        self._items: dict[str, list[str]] = {}
        self._singly_assigned_vars: set[str] = set()  # Numba's own, which are not used
        self._blk_local_varmap: dict[str, Any] = {}
        if not self.func_ir.func_id.is_generator:
            variables = Variables(self.blocks, lambda name: self.is_counted(self.typeof(name)))
            self._counting = counting(self.blocks, self.typeof)
            self._held = {name for name in variables.once if not self.is_counted(self.typeof(name))} | variables.owned

    def setup_function(self, fndesc: Any) -> None:
        """Begin to write."""
        super().setup_function(fndesc)
        self.builder = Builder(self.entry_block)
        self.call_helper = self.call_conv.init_call_helper(self.builder)

    def lower_normal_function(self, fndesc: Any) -> None:
        """A function that is no generator."""
        super().lower_normal_function(fndesc)
        drop_unused(self.function)

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
        kind = self.typeof(name)
        if not self.is_counted(kind):
            return
        if name in self._held:
            self.decref(kind, self._values[name])
        else:
            super().delvar(name)

    def loadvar(self, name: str) -> Any:
        """The value of a variable."""
        value = self._values.get(name)
        return super().loadvar(name) if value is None else value

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Give a variable its value."""
        if name in self._held:
            self._values[name] = value
            return
        place = self.getvar(name)
        if argidx is None and self.is_counted(self.typeof(name)):
            self.decref(self.typeof(name), self.builder.load(place))
        self.builder.store(value, place)

    def _alloca_var(self, name: str, kind: Any) -> None:
        """Make room for a variable that needs it."""
        if name not in self._held:
            super()._alloca_var(name, kind)

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
        elif op == "getattr" and expression.attr == "shape" and is_plain(self.typeof(expression.value.name)):
            found = sizes(self, self.loadvar(expression.value.name), self.typeof(expression.value.name))
        elif op == "static_getitem":
            found = self._static_getitem(kind, expression)
        else:
            found = None
        return super().lower_expr(kind, expression) if found is None else found

    def _static_getitem(self, kind: Any, expression: Any) -> Any:
        whole = self.typeof(expression.value.name)
        if is_plain(whole) and expression.index_var is not None:
            signature = self.fndesc.calltypes[expression]
            return self.lower_getitem(kind, expression, expression.value, expression.index_var, signature)
        if isinstance(whole, types.Tuple | types.UniTuple) and isinstance(expression.index, int):
            index = range(len(whole))[expression.index]
            found = self.builder.extract_value(self.loadvar(expression.value.name), index)
            self.incref(whole[index], found)
            return self.context.cast(self.builder, found, whole[index], kind)
        return None

    def lower_inst(self, statement: Any) -> None:
        """A statement."""
        if isinstance(statement, ir.Assign):
            name = statement.target.name
            is_argument = isinstance(statement.value, ir.Arg)
            if isinstance(statement.value, ir.Expr) and statement.value.op == "build_tuple":
                self._items[name] = [one.name for one in statement.value.items]
            self.storevar(self.lower_assign(self.typeof(name), statement), name, 0 if is_argument else None)
        elif isinstance(statement, ir.StaticSetItem) and is_plain(self.typeof(statement.target.name)):
            signature = self.fndesc.calltypes[statement]
            self.lower_setitem(statement.target, statement.index_var, statement.value, signature)
        elif isinstance(statement, ir.SetItem):
            self.lower_setitem(statement.target, statement.index, statement.value, self.fndesc.calltypes[statement])
        elif isinstance(statement, ir.Del):
            self.delvar(statement.value)
        else:
            super().lower_inst(statement)

    def lower_call(self, kind: Any, expression: Any) -> Any:
        """The value of a call."""
        short = calls.lowered(self, kind, expression)
        return super().lower_call(kind, expression) if short is None else short

    def _of_range(self, op: str, expression: Any) -> Any:
        kind = self.typeof(expression.value.name)
        value = self.loadvar(expression.value.name)
        if op == "getiter" and isinstance(kind, types.RangeType) and kind.dtype.signed:
            return self._begin(value, kind, self.fndesc.calltypes[expression].return_type)
        if op == "iternext" and isinstance(kind, types.RangeIteratorType) and kind.yield_type.signed:
            return self._next(value, kind, self.fndesc.calltypes[expression].return_type)
        if isinstance(kind, types.Pair) and not self.is_counted(kind):
            return self.builder.extract_value(value, int(op == "pair_second"))
        return None

    def _begin(self, value: Any, kind: Any, iterator: Any) -> Any:
        """The iterator of a range: where the next number is kept."""
        with self.builder.goto_entry_block():
            place = self.builder.alloca(self.context.get_value_type(kind.dtype))
        self.builder.store(self.field(value, kind, "start"), place)
        return self.struct(iterator, iter=place, **{name: self.field(value, kind, name) for name in ("stop", "step")})

    def _next(self, iterator: Any, kind: Any, pair_kind: Any) -> Any:
        """The next number of a range, and whether there is one."""
        builder = self.builder
        place, stop, step = (self.field(iterator, kind, name) for name in ("iter", "stop", "step"))
        value = builder.load(place)
        known = getattr(step, "constant", None)
        if isinstance(known, int):
            is_valid = builder.icmp_signed("<" if known > 0 else ">", value, stop)
        else:
            is_up = builder.icmp_signed(">", step, llvm.Constant(step.type, 0))
            signs = [builder.icmp_signed(sign, value, stop) for sign in "<>"]
            is_valid = builder.select(is_up, *signs)
        builder.store(builder.add(value, step, flags=["nsw"]), place)
        pair = self.context.get_constant_undef(pair_kind)
        return builder.insert_value(builder.insert_value(pair, value, 0), is_valid, 1)

    def field(self, value: Any, kind: Any, name: str) -> Any:
        """A part of a value by its name."""
        model = self.context.data_model_manager[kind]
        return self.builder.extract_value(value, model.get_field_position(name))

    def struct(self, kind: Any, **fields: Any) -> Any:
        """A value made of parts."""
        model = self.context.data_model_manager[kind]
        value = self.context.get_constant_undef(kind)
        for name, field in fields.items():
            value = self.builder.insert_value(value, field, model.get_field_position(name))
        return value

    def lower_binop(self, kind: Any, expression: Any, op: Any) -> Any:
        """The value of an operator."""
        signature = self.fndesc.calltypes[expression]
        left, right = (types.unliteral(one) for one in signature.args)
        name, returned = IN_PLACE.get(op, op), types.unliteral(signature.return_type)
        known = self.typeof(expression.rhs.name)
        number = known.literal_value if isinstance(known, types.IntegerLiteral) else 0
        if name is operator.pow and number == 2 and returned == left and isinstance(left, types.Float):
            value = self._cast_var(expression.lhs, left)
            return self.context.cast(self.builder, self.builder.fmul(value, value), returned, kind)
        if left != right or left not in NUMBERS:
            return super().lower_binop(kind, expression, op)
        values = [self._cast_var(one, left) for one in (expression.lhs, expression.rhs)]
        value = None
        if returned == left == types.int64 and number > 0 and name in DIVIDED:
            value = DIVIDED[name](self.builder, values[0], llvm.Constant(values[0].type, number))
        elif returned == left and name in NUMBERS[left]:
            value = getattr(self.builder, NUMBERS[left][name])(*values)
        elif returned == types.boolean and name in COMPARED:
            value = self._compared(COMPARED[name], left, values)
        if value is None:
            return super().lower_binop(kind, expression, op)
        return self.context.cast(self.builder, value, returned, kind)

    def _compared(self, sign: str, kind: Any, values: list[Any]) -> Any:
        if kind == types.int64:
            return self.builder.icmp_signed(sign, *values)
        return (self.builder.fcmp_unordered if sign == "!=" else self.builder.fcmp_ordered)(sign, *values)

    def lower_getitem(self, kind: Any, expression: Any, value: Any, index: Any, signature: Any) -> Any:
        """An element or part of an array."""
        place = self._place(value, index, signature.args)
        if place is None:
            return super().lower_getitem(kind, expression, value, index, signature)
        part = signature.return_type
        if place.left:
            found = place.part(part)
            self.incref(part, found)
        else:
            found = arrays.load_item(self.context, self.builder, self.typeof(value.name), place.pointer)
        return self.context.cast(self.builder, found, part, kind)

    def lower_setitem(self, target: Any, index: Any, value: Any, signature: Any) -> Any:
        """Give an element of an array its value."""
        array = self.typeof(target.name)
        place = None
        if is_plain(array) and not isinstance(self.typeof(value.name), types.Buffer | types.Optional):
            place = self._place(target, index, signature.args, whole_only=True)
        if place is None:
            return super().lower_setitem(target, index, value, signature)
        given = self.context.cast(self.builder, self.loadvar(value.name), self.typeof(value.name), signature.args[2])
        given = self.context.cast(self.builder, given, signature.args[2], array.dtype)
        return arrays.store_item(self.context, self.builder, array, given, place.pointer)

    def _place(self, variable: Any, index: Any, asked: Any, whole_only: bool = False) -> Any:
        """Where an index leads in an array; None if it has other than integers and slices without a step."""
        array, given = self.typeof(variable.name), self.typeof(index.name)
        if not is_plain(array) or self.context.enable_boundscheck:
            return None
        several = isinstance(asked[1], types.BaseTuple)
        kinds = tuple(asked[1]) if several else (asked[1],)
        if not kinds or len(kinds) > array.ndim or (whole_only and len(kinds) < array.ndim):
            return None
        for one in kinds:
            if not (isinstance(one, types.Integer) or (_is_simple(one) and not whole_only)):
                return None
        value = self.context.cast(self.builder, self.loadvar(index.name), given, asked[1])
        parts = [self.builder.extract_value(value, k) for k in range(len(kinds))] if several else [value]
        known = [name in self._counting for name in self._items.get(index.name, [index.name] * len(kinds))]
        return Place(self, self.loadvar(variable.name), array, list(zip(parts, kinds, known, strict=True)))


def _is_simple(kind: Any) -> bool:
    return isinstance(kind, types.SliceType) and not kind.has_step
