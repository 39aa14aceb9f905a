"""Elements and parts of arrays in kernels, for indices that are integers and slices without a step.

Importing this imports Numba.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

arrays: Any = import_module("numba.np.arrayobj")
cgutils: Any = import_module("numba.core.cgutils")
llvm: Any = import_module("llvmlite.ir")
types: Any = import_module("numba.core.types")

NO_END = (1 << 63) - 1
"""Where a slice ends of which that is not said."""


def is_plain(kind: Any) -> bool:
    """Whether a type is an array of numbers with axes."""
    return type(kind) is types.Array and kind.ndim > 0


def size(lower: Any, whole: Any, array: Any, axis: int, field: str = "shape") -> Any:
    """The size of an array along an axis, or its stride."""
    position = lower.context.data_model_manager[array].get_field_position(field)
    return lower.builder.extract_value(whole, [position, axis])


def sizes(lower: Any, whole: Any, array: Any) -> Any:
    """The shape of an array."""
    parts = [size(lower, whole, array, axis) for axis in range(array.ndim)]
    return cgutils.pack_array(lower.builder, parts, parts[0].type)


class Place:
    """Where an index leads in an array.

    Attributes
    ----------
    pointer : value
        To the first element.
    left : list of (size, stride)
        Of the axes of the part; none for an element.
    """

    def __init__(self, lower: Any, whole: Any, array: Any, index: list[tuple[Any, Any, bool]]) -> None:
        """`index` has the value and type for each axis, and whether it is known not to be negative."""
        self._lower, self._whole, self._array = lower, whole, array
        starts, self.left = [], []
        for axis, (value, kind, is_counting) in enumerate(index):
            length = size(lower, whole, array, axis)
            if isinstance(kind, types.SliceType):
                start, stop = (self._bound(lower.field(value, kind, name), length) for name in ("start", "stop"))
                starts.append(start)
                self.left.append((self._length(start, stop), self._stride(axis)))
            else:
                starts.append(self._from_front(value, kind, is_counting, length))
        for axis in range(len(index), array.ndim):
            self.left.append((size(lower, whole, array, axis), self._stride(axis)))
        self.pointer = self._pointer(starts)

    def part(self, kind: Any) -> Any:
        """The part as an array of its own."""
        lower = self._lower
        number = self.left[0][0]
        for length, _ in self.left[1:]:
            number = lower.builder.mul(number, length, flags=["nsw"])
        kept = {name: lower.field(self._whole, self._array, name) for name in ("meminfo", "parent", "itemsize")}
        return lower.struct(
            kind,
            nitems=number,
            data=self.pointer,
            shape=cgutils.pack_array(lower.builder, [length for length, _ in self.left], number.type),
            strides=cgutils.pack_array(lower.builder, [stride for _, stride in self.left], number.type),
            **kept,
        )

    def _stride(self, axis: int) -> Any:
        return size(self._lower, self._whole, self._array, axis, "strides")

    def _from_front(self, index: Any, kind: Any, is_counting: bool, length: Any) -> Any:
        """An index that is not negative."""
        context, builder = self._lower.context, self._lower.builder
        if not kind.signed:
            return context.cast(builder, index, kind, types.uintp)
        index = context.cast(builder, index, kind, types.intp)
        known = kind.literal_value if isinstance(kind, types.IntegerLiteral) else getattr(index, "constant", None)
        if isinstance(known, int) and known >= 0:
            return llvm.Constant(index.type, known)
        return index if is_counting else self._wrapped(index, length)

    def _wrapped(self, index: Any, length: Any) -> Any:
        builder = self._lower.builder
        is_negative = builder.icmp_signed("<", index, llvm.Constant(index.type, 0))
        return builder.select(is_negative, builder.add(index, length), index)

    def _bound(self, bound: Any, length: Any) -> Any:
        """The bound of a slice, within the array."""
        builder, known = self._lower.builder, getattr(bound, "constant", None)
        if known == 0:
            return bound
        if known == NO_END:
            return length
        zero = llvm.Constant(bound.type, 0)
        bound = self._wrapped(bound, length)
        bound = builder.select(builder.icmp_signed("<", bound, zero), zero, bound)
        return builder.select(builder.icmp_signed(">", bound, length), length, bound)

    def _length(self, start: Any, stop: Any) -> Any:
        builder, zero = self._lower.builder, llvm.Constant(start.type, 0)
        if getattr(start, "constant", None) == 0:
            return stop
        return builder.select(builder.icmp_signed("<", start, stop), builder.sub(stop, start), zero)

    def _pointer(self, starts: list[Any]) -> Any:
        lower, whole, array = self._lower, self._whole, self._array
        builder, data = lower.builder, lower.field(whole, array, "data")
        if array.layout != "C":
            offset = builder.mul(self._stride(0), starts[0])
            for axis, start in enumerate(starts[1:], 1):
                offset = builder.add(offset, builder.mul(self._stride(axis), start))
            return cgutils.pointer_add(builder, data, offset)
        place = starts[0]
        for axis in range(1, array.ndim):
            place = builder.mul(place, size(lower, whole, array, axis))
            if axis < len(starts):
                place = builder.add(place, starts[axis])
        return builder.gep(data, [place])
