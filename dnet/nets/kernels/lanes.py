"""Eight float32 numbers in one register of the processor, for kernels that numba compiles.

What a compiler makes of plain loops over small matrices runs at a fraction of the arithmetic that
a core can do; kernels written in these terms come near to it, on any processor that LLVM knows.
Numbers are read and written from a flat place of a contiguous array on, unchecked.
"""

from collections.abc import Callable
from typing import Any, no_type_check

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, models, register_model

from dnet.compiled import holds_parts

LANES = 8

_VECTOR = ir.VectorType(ir.FloatType(), LANES)
_NOTHING = ir.Constant(_VECTOR, ir.Undefined)
_POINTER = types.CPointer(types.float32)  # type: ignore[no-untyped-call]

holds_parts(__file__)


class Lanes(types.Type):
    """Numba's type of eight numbers."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Lanes) -> None:
        super().__init__(manager, kind, _VECTOR)  # type: ignore[no-untyped-call]


_LANES = Lanes()


def _address(context: Any, builder: Any, kind: types.Type, source: Any, place: Any) -> Any:
    """Return where `place` of an array or behind a pointer is."""
    data = source
    if isinstance(kind, types.Array):
        data = context.make_array(kind)(context, builder, source).data
    return builder.gep(data, [place])


def _read(builder: Any, address: Any) -> Any:
    return builder.load(builder.bitcast(address, _VECTOR.as_pointer()), align=4)


def _write(builder: Any, address: Any, value: Any) -> None:
    builder.store(value, builder.bitcast(address, _VECTOR.as_pointer()), align=4)


def _shuffle(builder: Any, first: Any, second: Any, order: list[int]) -> Any:
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), order)
    return builder.shuffle_vector(first, second, mask)


def _spread(builder: Any, number: Any) -> Any:
    one = builder.insert_element(_NOTHING, number, ir.Constant(ir.IntType(32), 0))
    return _shuffle(builder, one, _NOTHING, [0] * LANES)


@intrinsic
@no_type_check
def at(typing, source, place):
    """Return a pointer to flat `place` of an array, which must outlive it, or behind another."""

    def generate(context, builder, signature, args):
        return _address(context, builder, signature.args[0], *args)

    return _POINTER(source, types.intp), generate


@intrinsic
@no_type_check
def load(typing, source, place):
    """Return eight numbers of an array, or behind a pointer, from flat `place` on."""

    def generate(context, builder, signature, args):
        return _read(builder, _address(context, builder, signature.args[0], *args))

    return _LANES(source, types.intp), generate


@intrinsic
@no_type_check
def store(typing, target, place, value):
    """Write eight numbers into an array, or behind a pointer, from flat `place` on."""

    def generate(context, builder, signature, args):
        address = _address(context, builder, signature.args[0], *args[:2])
        _write(builder, address, args[2])
        return context.get_dummy_value()

    return types.void(target, types.intp, _LANES), generate


@intrinsic
@no_type_check
def spread_from(typing, source, place):
    """Return eight times the number at flat `place` of an array or behind a pointer."""

    def generate(context, builder, signature, args):
        address = _address(context, builder, signature.args[0], *args)
        return _spread(builder, builder.load(address))

    return _LANES(source, types.intp), generate


@intrinsic
@no_type_check
def spread(typing, number):
    """Return eight times the same number."""

    def generate(context, builder, signature, args):
        return _spread(builder, args[0])

    return _LANES(types.float32), generate


def _arithmetic(operation: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of two times eight numbers that applies one instruction."""

    @no_type_check
    def apply(typing, a, b):
        def generate(context, builder, signature, args):
            return operation(builder, *args)

        return _LANES(_LANES, _LANES), generate

    return intrinsic(apply)


add = _arithmetic(ir.IRBuilder.fadd)
"""Return a + b."""

subtract = _arithmetic(ir.IRBuilder.fsub)
"""Return a - b."""

multiply = _arithmetic(ir.IRBuilder.fmul)
"""Return a * b."""


@intrinsic
@no_type_check
def multiply_add(typing, a, b, c):
    """Return a * b + c, rounded once where the processor can."""

    def generate(context, builder, signature, args):
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        name = f"llvm.fmuladd.v{LANES}f32"
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), args)

    return _LANES(_LANES, _LANES, _LANES), generate


@intrinsic
@no_type_check
def where_positive(typing, decides, value):
    """Return `value` where `decides` is above zero or NaN, and zero elsewhere.

    That is ReLU's gradient; with twice the same argument, ReLU itself.
    """

    def generate(context, builder, signature, args):
        zero = ir.Constant(_VECTOR, [0.0] * LANES)
        return builder.select(builder.fcmp_ordered("<=", args[0], zero), zero, args[1])

    return _LANES(_LANES, _LANES), generate


@intrinsic
@no_type_check
def sum_of(typing, value):
    """Return the sum of eight numbers."""

    def generate(context, builder, signature, args):
        (total,) = args
        for distance in (4, 2, 1):
            order = [(lane + distance) % LANES for lane in range(LANES)]
            total = builder.fadd(total, _shuffle(builder, total, _NOTHING, order))
        return builder.extract_element(total, ir.Constant(ir.IntType(32), 0))

    return types.float32(_LANES), generate


@intrinsic
@no_type_check
def transpose(typing, target, step, source, stride):
    """Write 8 x 8 numbers turned over.

    Rows `stride` apart behind the pointer `source` become columns, rows `step` apart behind the
    pointer `target`.
    """

    def generate(context, builder, signature, args):
        target, step, source, stride = args

        def row_of(pointer, distance, row):
            return builder.gep(pointer, [builder.mul(distance, ir.Constant(distance.type, row))])

        rows = [_read(builder, row_of(source, stride, row)) for row in range(LANES)]
        # Blocks off the diagonal change places, at half the size each time.
        for half in (4, 2, 1):
            upper = [LANES + lane - half if lane & half else lane for lane in range(LANES)]
            lower = [LANES + lane if lane & half else lane + half for lane in range(LANES)]
            for row in range(LANES):
                if not row & half:
                    a, b = rows[row], rows[row + half]
                    rows[row] = _shuffle(builder, a, b, upper)
                    rows[row + half] = _shuffle(builder, a, b, lower)
        for row in range(LANES):
            _write(builder, row_of(target, step, row), rows[row])
        return context.get_dummy_value()

    return types.void(_POINTER, types.intp, _POINTER, types.intp), generate
