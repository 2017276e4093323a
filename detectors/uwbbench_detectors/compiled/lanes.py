"""Operations on up to 64 taps at once, where a set of taps is the bits of one whole number: bit i stands for tap i.

What loops and branches decide of one tap after the other (what is the nearest tap that is higher?) is then a comparison
of all taps and a scan for a bit. numba has no such types, so that these few are written in the language of LLVM, which
makes of them whatever the processor has for it, from one instruction for eight taps down to one tap at a time.

Values are never negative here, nor NaN where it matters, and are compared as the whole numbers that their bits spell.
Arrays are float64, in one piece, with room for LANES values from the first one on; a set is an int64.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types as numba_types
from numba.extending import intrinsic

types: Any = numba_types

LANES = 64
BLOCK = 8
"""Values that are rooted or divided together; more would be wasted on short frames, as these take their time."""

_WORD, _REAL = ir.IntType(64), ir.DoubleType()
_WORDS = ir.VectorType(_WORD, LANES)
_SET = ir.VectorType(ir.IntType(1), LANES)
_LARGEST = (1 << 63) - 1


def operation(typed: Callable[..., Any]) -> Any:
    """Function that numba compiles by rules of its own: of its types, the signature and what builds the code."""
    return intrinsic(typed)


def _pointer(context: Any, builder: Any, kind: Any, array: Any, at: Any, pointed: Any) -> Any:
    """Pointer to element ``at`` of an array, as one to a larger type."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [at]), pointed.as_pointer())


def _words(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    pointer = _pointer(context, builder, kind, array, _WORD(0), _WORDS)
    return builder.load(pointer, align=8)


def _splat(builder: Any, value: Any, lanes: int) -> Any:
    """Vector of one value."""
    kind = ir.VectorType(value.type, lanes)
    single = builder.insert_element(ir.Constant(kind, ir.Undefined), value, ir.IntType(32)(0))
    return builder.shuffle_vector(single, ir.Constant(kind, ir.Undefined), _indices(range(lanes), fixed=0))


def _indices(lanes: range, fixed: int | None = None) -> Any:
    return ir.Constant(ir.VectorType(ir.IntType(32), len(lanes)), [lane if fixed is None else fixed for lane in lanes])


def _called(builder: Any, name: str, result: Any, arguments: list[Any]) -> Any:
    """Result of one of LLVM's own functions."""
    kind = ir.FunctionType(result, [argument.type for argument in arguments])
    function = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)
    return builder.call(function, arguments)


def _compared(operator: str) -> Callable[[Any, Any, Any], Any]:
    """Set of taps whose value is ``operator`` a level."""

    def typed(_typing: Any, values: Any, _level: Any) -> Any:
        def lowered(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            words = _words(context, builder, signature.args[0], arguments[0])
            bits = _splat(builder, builder.bitcast(arguments[1], _WORD), LANES)
            return builder.bitcast(builder.icmp_signed(operator, words, bits), _WORD)

        return types.int64(values, types.float64), lowered

    return typed


def _reduced(operator: str, identity: int) -> Callable[[Any, Any, Any], Any]:
    """Extreme of the values in a set of taps."""

    def typed(_typing: Any, values: Any, _taps: Any) -> Any:
        def lowered(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            words = _words(context, builder, signature.args[0], arguments[0])
            others = _splat(builder, ir.Constant(_WORD, identity), LANES)
            chosen = builder.select(builder.bitcast(arguments[1], _SET), words, others)
            bits = _called(builder, f"llvm.vector.reduce.{operator}.v{LANES}i64", _WORD, [chosen])
            return builder.bitcast(bits, _REAL)

        return types.float64(values, types.int64), lowered

    return typed


taps_above = operation(_compared(">"))
"""``taps_above(values, level)``: the taps whose value is larger than a level."""

taps_at = operation(_compared("=="))
"""``taps_at(values, level)``: the taps whose value is a level."""

least_of = operation(_reduced("smin", _LARGEST))
"""``least_of(values, taps)``: the smallest value in a set of taps."""

largest_of = operation(_reduced("smax", 0))
"""``largest_of(values, taps)``: the largest value in a set of taps; 0 for none."""


@operation
def slopes(_typing: Any, values: Any) -> Any:
    """``slopes(values)``: taps that are lower, and taps that are higher, than the one behind them."""

    def lowered(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        words = _words(context, builder, signature.args[0], arguments[0])
        # Loaded once and moved, as what has just been stored cannot be loaded at an offset before it has settled.
        behind = builder.shuffle_vector(words, words, _indices(range(1, LANES + 1)))
        sets = [builder.bitcast(builder.icmp_signed(sign, words, behind), _WORD) for sign in "<>"]
        return context.make_tuple(builder, signature.return_type, sets)

    return types.UniTuple(types.int64, 2)(values), lowered


def _scan(name: str) -> Callable[[Any, Any], Any]:
    def typed(_typing: Any, _taps: Any) -> Any:
        def lowered(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return _called(builder, f"llvm.{name}.i64", _WORD, [arguments[0], ir.IntType(1)(0)])

        return types.int64(types.int64), lowered

    return typed


first_tap = operation(_scan("cttz"))
"""``first_tap(taps)``: the first tap of a set; LANES for none."""

taps_behind = operation(_scan("ctlz"))
"""``taps_behind(taps)``: how many of LANES taps lie behind the last one of a set; LANES for none."""


@operation
def measure_block(_typing: Any, samples: Any, _row: Any, _tap: Any, amplitude: Any) -> Any:
    """``measure_block(samples, row, tap, amplitude)``: magnitudes of BLOCK taps of a row of samples from a tap on.

    Parameters
    ----------
    _typing : Any
        numba's typing context.
    samples, amplitude : numba types
        Of a (frames, taps) complex64 or complex128 array, and of the (room,) float64 array that is written.
    _row, _tap : numba types
        Of the row, and of the first of the BLOCK taps.
    """
    part = ir.FloatType() if samples.dtype == types.complex64 else _REAL

    def lowered(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, row, tap, written = arguments
        kind = ir.VectorType(part, 2 * BLOCK)
        columns = builder.extract_value(context.make_array(signature.args[0])(context, builder, array).shape, 1)
        offset = builder.add(builder.mul(row, columns), tap)
        raw = builder.load(_pointer(context, builder, signature.args[0], array, offset, kind), align=4)
        parts = [builder.shuffle_vector(raw, raw, _indices(range(first, 2 * BLOCK, 2))) for first in (0, 1)]
        reals = ir.VectorType(_REAL, BLOCK)
        if part != _REAL:
            parts = [builder.fpext(one, reals) for one in parts]
        power = builder.fadd(*(builder.fmul(one, one) for one in parts))
        magnitude = _called(builder, f"llvm.sqrt.v{BLOCK}f64", reals, [power])
        builder.store(magnitude, _pointer(context, builder, signature.args[3], written, tap, reals), align=8)
        return context.get_dummy_value()

    return types.void(samples, types.int64, types.int64, amplitude), lowered


@operation
def scale_block(_typing: Any, amplitude: Any, _tap: Any, _low: Any, _span: Any, profile: Any) -> Any:
    """``scale_block(amplitude, tap, low, span, profile)``: ``(amplitude - low) / span`` of BLOCK taps from a tap on.

    Parameters
    ----------
    _typing : Any
        numba's typing context.
    amplitude, profile : numba types
        Of two (room,) float64 arrays: magnitudes, and the profile that is written.
    _tap : numba type
        Of the first of the BLOCK taps.
    _low, _span : numba types
        Of the least magnitude of the frame, and of its distance to the largest.
    """

    def lowered(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source, tap, low, span, written = arguments
        reals = ir.VectorType(_REAL, BLOCK)
        values = builder.load(_pointer(context, builder, signature.args[0], source, tap, reals), align=8)
        above = builder.fsub(values, _splat(builder, low, BLOCK))
        scaled = builder.fdiv(above, _splat(builder, span, BLOCK))
        builder.store(scaled, _pointer(context, builder, signature.args[4], written, tap, reals), align=8)
        return context.get_dummy_value()

    return types.void(amplitude, types.int64, types.float64, types.float64, profile), lowered
