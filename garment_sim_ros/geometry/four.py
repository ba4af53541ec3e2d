"""Four numbers at once in kernels: a type that is one of the processor's vectors.

The compiler makes vectors of loops over consecutive numbers, but not of gathers: points of an
array, three or four numbers each, of which a loop takes some here and some there. With this type a
kernel says itself what goes together. Sums, differences, products and quotients are number by
number. In kernels that run as plain Python fours are arrays.
"""

import operator
from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.cgutils import get_or_insert_function
from numba.core.datamodel import models, register_default
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import make_array

from garment_sim_ros.arrays import SingleArray

_NUMBER = ir.FloatType()
_FOUR = ir.VectorType(_NUMBER, 4)
_ALIGNED = 4
"""Bytes that a number in memory is aligned to."""


class _FourType(types.Type):
    def __init__(self) -> None:
        super().__init__(name="Four")


_four = _FourType()


@register_default(_FourType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _FOUR)


def four_at(x: SingleArray, i: np.uint64) -> SingleArray:
    """The four numbers from number i of a flat array on."""
    return x[int(i) : int(i) + 4].copy()


def three_at(x: SingleArray, i: np.uint64) -> SingleArray:
    """The three numbers from number i on, and 0."""
    return np.append(x[int(i) : int(i) + 3], np.float32(0.0))


def put_four(x: SingleArray, i: np.uint64, four: SingleArray) -> None:
    """Writes four numbers to a flat array, from number i on."""
    x[int(i) : int(i) + 4] = four


def put_three(x: SingleArray, i: np.uint64, four: SingleArray) -> None:
    """The same with the first three."""
    x[int(i) : int(i) + 3] = four[:3]


def same_four(a: np.float32) -> SingleArray:
    """One number four times."""
    return np.full(4, a, np.float32)


def squares(a: SingleArray, b: SingleArray, c: SingleArray, d: SingleArray) -> SingleArray:
    """Squared lengths of four vectors; the last number of each does not count."""
    return np.array([np.dot(v[:3], v[:3]) for v in (a, b, c, d)], np.float32)


def products(a: tuple[SingleArray, ...], b: tuple[SingleArray, ...]) -> SingleArray:
    """Scalar products of four vectors with four others; the last number of each does not count."""
    return np.array([np.dot(v[:3], w[:3]) for v, w in zip(a, b)], np.float32)


def each_four_times(a: SingleArray) -> tuple[SingleArray, ...]:
    """Four fours, each with one of the numbers four times."""
    return tuple(same_four(number) for number in a)


def lower_four(a: SingleArray, b: SingleArray) -> SingleArray:
    """The lesser of each two numbers; that of b where one of them is not a number."""
    return np.where(a < b, a, b)


def higher_four(a: SingleArray, b: SingleArray) -> SingleArray:
    """The greater; see `lower_four`."""
    return np.where(a > b, a, b)


def where_above(
    a: SingleArray, b: SingleArray, this: SingleArray, other: SingleArray
) -> SingleArray:
    """Of two fours, numbers of the one where a is above b, else those of the other."""
    return np.where(a > b, this, other)


def counted() -> SingleArray:
    """0, 1, 2 and 3."""
    return np.arange(4, dtype=np.float32)


def turned_by_one(a: SingleArray) -> SingleArray:
    """The numbers one place on: the second one first, the first one last."""
    return np.roll(a, -1)


def turned_by_two(a: SingleArray) -> SingleArray:
    """The numbers two places on."""
    return np.roll(a, -2)


def roots(a: SingleArray) -> SingleArray:
    """Square roots."""
    return np.sqrt(a)


def any_above(a: SingleArray, b: SingleArray) -> bool:
    """Whether any number of a is above that of b."""
    return bool((a > b).any())


def each_number(a: SingleArray) -> tuple[np.float32, ...]:
    """The four numbers."""
    return tuple(a)


def _typed(function: Callable[..., Any], result: Any) -> None:
    """What a function of this file gives, in kernels, whatever it is given."""

    @wraps(function)  # The compiler looks at what it is given by name.
    def kind(*given: Any) -> Any:
        return result

    type_callable(function)(lambda context: kind)


def _pointer(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    data = make_array(sig.args[0])(context, builder, args[0]).data
    return builder.gep(data, [args[1]])


def _index(k: int) -> Any:
    return ir.Constant(ir.IntType(32), k)


def _pick(builder: Any, a: Any, b: Any, *which: int) -> Any:
    """Numbers of a, from 0 on, and of b, from the size of both on."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), 4), list(which)))


def _repeated(builder: Any, number: Any) -> Any:
    one = builder.insert_element(ir.Constant(_FOUR, ir.Undefined), number, _index(0))
    return _pick(builder, one, one, 0, 0, 0, 0)


_typed(four_at, _four)
_typed(three_at, _four)
_typed(put_four, types.none)
_typed(put_three, types.none)
_typed(same_four, _four)
_typed(squares, _four)
_typed(products, _four)
_typed(each_four_times, types.UniTuple(_four, 4))
_typed(each_number, types.UniTuple(types.float32, 4))
_typed(lower_four, _four)
_typed(higher_four, _four)
_typed(where_above, _four)
_typed(counted, _four)
_typed(turned_by_one, _four)
_typed(turned_by_two, _four)
_typed(roots, _four)
_typed(any_above, types.boolean)


@lower_builtin(four_at, types.Array, types.Integer)
def _four_at(context, builder, sig, args):
    pointer = builder.bitcast(_pointer(context, builder, sig, args), _FOUR.as_pointer())
    return builder.load(pointer, align=_ALIGNED)


@lower_builtin(three_at, types.Array, types.Integer)
def _three_at(context, builder, sig, args):
    pointer = _pointer(context, builder, sig, args)
    two = ir.VectorType(_NUMBER, 2)
    first = builder.load(builder.bitcast(pointer, two.as_pointer()), align=_ALIGNED)
    first = _pick(builder, first, ir.Constant(two, [0.0, 0.0]), 0, 1, 2, 3)
    return builder.insert_element(
        first, builder.load(builder.gep(pointer, [_index(2)])), _index(2)
    )


@lower_builtin(put_four, types.Array, types.Integer, _FourType)
def _put_four(context, builder, sig, args):
    pointer = builder.bitcast(_pointer(context, builder, sig, args), _FOUR.as_pointer())
    builder.store(args[2], pointer, align=_ALIGNED)
    return context.get_dummy_value()


@lower_builtin(put_three, types.Array, types.Integer, _FourType)
def _put_three(context, builder, sig, args):
    pointer = _pointer(context, builder, sig, args)
    two = ir.VectorType(_NUMBER, 2)
    mask = ir.Constant(ir.VectorType(ir.IntType(32), 2), [0, 1])
    first = builder.shuffle_vector(args[2], args[2], mask)
    builder.store(first, builder.bitcast(pointer, two.as_pointer()), align=_ALIGNED)
    third = builder.extract_element(args[2], _index(2))
    builder.store(third, builder.gep(pointer, [_index(2)]))
    return context.get_dummy_value()


@lower_builtin(same_four, types.float32)
def _same_four(context, builder, sig, args):
    return _repeated(builder, args[0])


@lower_builtin(squares, _FourType, _FourType, _FourType, _FourType)
def _squares(context, builder, sig, args):
    x, y, z = _by_axis(builder, *args)
    total = builder.fadd(builder.fmul(x, x), builder.fmul(y, y))
    return builder.fadd(total, builder.fmul(z, z))


@lower_builtin(products, types.UniTuple, types.UniTuple)
def _products(context, builder, sig, args):
    a, b = ([builder.extract_value(vectors, k) for k in range(4)] for vectors in args)
    x, y, z = _by_axis(builder, *map(builder.fmul, a, b))
    return builder.fadd(builder.fadd(x, y), z)


def _by_axis(builder: Any, a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Any, Any]:
    """First numbers of four fours, second and third ones."""
    ab, cd = _pick(builder, a, b, 0, 4, 1, 5), _pick(builder, c, d, 0, 4, 1, 5)
    x, y = _pick(builder, ab, cd, 0, 1, 4, 5), _pick(builder, ab, cd, 2, 3, 6, 7)
    ab, cd = _pick(builder, a, b, 2, 6, 2, 6), _pick(builder, c, d, 2, 6, 2, 6)
    return x, y, _pick(builder, ab, cd, 0, 1, 4, 5)


@lower_builtin(each_four_times, _FourType)
def _each_four_times(context, builder, sig, args):
    fours = [_pick(builder, args[0], args[0], k, k, k, k) for k in range(4)]
    return context.make_tuple(builder, sig.return_type, fours)


@lower_builtin(each_number, _FourType)
def _each_number(context, builder, sig, args):
    numbers = [builder.extract_element(args[0], _index(k)) for k in range(4)]
    return context.make_tuple(builder, sig.return_type, numbers)


@lower_builtin(lower_four, _FourType, _FourType)
def _lower_four(context, builder, sig, args):
    return builder.select(builder.fcmp_ordered("<", *args), *args)


@lower_builtin(higher_four, _FourType, _FourType)
def _higher_four(context, builder, sig, args):
    return builder.select(builder.fcmp_ordered(">", *args), *args)


@lower_builtin(where_above, _FourType, _FourType, _FourType, _FourType)
def _where_above(context, builder, sig, args):
    return builder.select(builder.fcmp_ordered(">", *args[:2]), *args[2:])


@lower_builtin(counted)
def _counted(context, builder, sig, args):
    return ir.Constant(_FOUR, [0.0, 1.0, 2.0, 3.0])


@lower_builtin(turned_by_one, _FourType)
def _turned_by_one(context, builder, sig, args):
    return _pick(builder, args[0], args[0], 1, 2, 3, 0)


@lower_builtin(turned_by_two, _FourType)
def _turned_by_two(context, builder, sig, args):
    return _pick(builder, args[0], args[0], 2, 3, 0, 1)


@lower_builtin(roots, _FourType)
def _roots(context, builder, sig, args):
    kind = ir.FunctionType(_FOUR, [_FOUR])
    root = get_or_insert_function(builder.module, kind, "llvm.sqrt.v4f32")
    return builder.call(root, args)


@lower_builtin(any_above, _FourType, _FourType)
def _any_above(context, builder, sig, args):
    above = builder.bitcast(builder.fcmp_ordered(">", *args), ir.IntType(4))
    return builder.icmp_unsigned("!=", above, ir.Constant(ir.IntType(4), 0))


def _operator(function: Callable[..., Any], instruction: str) -> None:
    def typed(a: Any, b: Any) -> Any:
        return _four if a is _four and b is _four else None

    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return getattr(builder, instruction)(*args)

    type_callable(function)(lambda context: typed)
    lower_builtin(function, _FourType, _FourType)(lowered)


_operator(operator.add, "fadd")
_operator(operator.sub, "fsub")
_operator(operator.mul, "fmul")
_operator(operator.truediv, "fdiv")
