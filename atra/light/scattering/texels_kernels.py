"""The colours of images at one place, and at eight places at once, equal to the bit."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from atra.compiled.memory import load_aligned
from atra.compiled.store import njit
from atra.compiled.vectors import VectorType, floor, larger, rounded, smaller, splat, where, widened
from atra.light.numbers_kernels import ONE

IMAGE_ROW = np.dtype(
    [
        ("first", "i8"), ("columns", "i8"), ("rows", "i8"), ("wrap_x", "i8"), ("wrap_y", "i8"), ("curve", "i8"),
        ("is_nearest", "?"), ("second_uv", "?"), ("factor", "f4", 4), ("placement", "f8", 6),
    ],
    align=True,
)  # fmt: skip
"""An image for kernels. first: of its texels. curve: -1 for texels of float32; otherwise the row of `curves` for bytes.
second_uv: whether by the vertices' second uv. factor: of four channels. placement: of the image's s and t by those of
the vertices."""

REPEAT, MIRROR, CLAMP = 0, 1, 2
"""Values of wrap_x and wrap_y."""

_LANES = 8
_I32, _I64 = ir.IntType(32), ir.IntType(64)


@njit(forceinline=True)
def image_at(surfaces, number, s, t):  # type: ignore[no-untyped-def]
    """Four channels, float32, of an image where uv is (s, t)."""
    row = surfaces.textures[number]
    place = row.placement
    x = place[0] * s + place[1] * t + place[2]
    y = place[3] * s + place[4] * t + place[5]
    columns, rows = row.columns, row.rows
    x, y = _wrapped_one(x, row.wrap_x) * columns - 0.5, _wrapped_one(1.0 - y, row.wrap_y) * rows - 0.5
    if row.is_nearest:
        x, y = np.floor(x + 0.5), np.floor(y + 0.5)
    left, above = np.floor(x), np.floor(y)
    fx, fy = np.float32(x - left), np.float32(y - above)
    x0, x1 = _inside_one(np.int64(left), columns, row.wrap_x), _inside_one(np.int64(left) + 1, columns, row.wrap_x)
    y0, y1 = _inside_one(np.int64(above), rows, row.wrap_y), _inside_one(np.int64(above) + 1, rows, row.wrap_y)
    first, curve, factor = row.first, row.curve, row.factor
    a, b = _texel(surfaces, curve, first + y0 * columns + x0), _texel(surfaces, curve, first + y0 * columns + x1)
    c, d = _texel(surfaces, curve, first + y1 * columns + x0), _texel(surfaces, curve, first + y1 * columns + x1)
    wa, wb, wc, wd = (ONE - fx) * (ONE - fy), fx * (ONE - fy), (ONE - fx) * fy, fx * fy
    return (
        factor[0] * (wa * a[0] + wb * b[0] + wc * c[0] + wd * d[0]),
        factor[1] * (wa * a[1] + wb * b[1] + wc * c[1] + wd * d[1]),
        factor[2] * (wa * a[2] + wb * b[2] + wc * c[2] + wd * d[2]),
        factor[3] * (wa * a[3] + wb * b[3] + wc * c[3] + wd * d[3]),
    )


@njit(forceinline=True)
def _texel(surfaces, curve, place):  # type: ignore[no-untyped-def]
    """(r, g, b, opacity) float32 of a texel, in linear light."""
    if curve < 0:
        texels = surfaces.texels
        return texels[place, 0], texels[place, 1], texels[place, 2], texels[place, 3]
    coded, curves = surfaces.coded, surfaces.curves
    return (
        curves[curve, coded[place, 0]],
        curves[curve, coded[place, 1]],
        curves[curve, coded[place, 2]],
        curves[0, coded[place, 3]],
    )


@njit(forceinline=True)
def _wrapped_one(place, wrap):  # type: ignore[no-untyped-def]
    """A place along an axis of an image -> one in [0, 1]."""
    if wrap == CLAMP:
        return min(1.0, max(0.0, place))
    if wrap == MIRROR:
        place = place - 2.0 * np.floor(0.5 * place)
        return place if place <= 1.0 else 2.0 - place
    return place - np.floor(place)


@njit(forceinline=True)
def _inside_one(place, count, wrap):  # type: ignore[no-untyped-def]
    """The number of a texel that is at most one beyond an end."""
    if wrap == REPEAT:
        return place + count if place < 0 else place - count if place >= count else place
    return min(count - 1, max(0, place))


@intrinsic
def _linear(typingctx: Any, base: Any, curves: Any, places: Any) -> Any:
    """Red, green and blue, three vectors of float32, of eight texels of 4 bytes each; places: 8 float64, whole numbers.

    base: address of the texels. curves: address of what a byte stands for, 256 float32. Numbers are read one by one:
    processors whose gathers are guarded against leaks take several times as long for them.
    """
    vector = VectorType(types.float32, _LANES)
    three = types.UniTuple(vector, 3)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        base, curves, places = values
        numbers = builder.fptosi(places, ir.VectorType(_I64, _LANES))
        found = [ir.Constant(context.get_value_type(vector), ir.Undefined)] * 3
        for k in range(_LANES):
            distance = builder.shl(builder.extract_element(numbers, _I32(k)), _I64(2))
            texel = load_aligned(builder, builder.add(base, distance), _I32, 4)
            for channel in range(3):
                byte = builder.and_(builder.lshr(texel, _I32(8 * channel)), _I32(255))
                place = builder.add(curves, builder.shl(builder.zext(byte, _I64), _I64(2)))
                value = load_aligned(builder, place, ir.FloatType(), 4)
                found[channel] = builder.insert_element(found[channel], value, _I32(k))
        return context.make_tuple(builder, three, found)

    return three(types.int64, types.int64, places), codegen


@njit(forceinline=True)
def places_in(surfaces, image, s, t):  # type: ignore[no-untyped-def]
    """(x, y), two vectors of float64: places in an image, 0 ... 1 and y down, of eight uv. NaN stays NaN."""
    s, t, row = widened(s), widened(t), surfaces.textures[image]
    x = _scaled(row.placement[0], s) + _scaled(row.placement[1], t) + splat(row.placement[2], _LANES)
    y = _scaled(row.placement[3], s) + _scaled(row.placement[4], t) + splat(row.placement[5], _LANES)
    return _wrapped(x, row.wrap_x), _wrapped(splat(1.0, _LANES) - y, row.wrap_y)


@njit(forceinline=True)
def colours_at(surfaces, image, x, y):  # type: ignore[no-untyped-def]
    """Three vectors of float32: red, green and blue, in linear light, of an image at eight of `places_in`, none NaN."""
    row = surfaces.textures[image]
    (x0, x1), (y0, y1), (fx, fy) = _around(row, x, y)
    base, curves = np.int64(surfaces.coded.ctypes.data), np.int64(surfaces.curves.ctypes.data)
    curves += 4 * 256 * row.curve
    a, b = _linear(base, curves, y0 + x0), _linear(base, curves, y0 + x1)
    c, d = _linear(base, curves, y1 + x0), _linear(base, curves, y1 + x1)
    one = splat(ONE, _LANES)
    weights = (one - fx) * (one - fy), fx * (one - fy), (one - fx) * fy, fx * fy
    return (
        _blended(row.factor[0], weights, a[0], b[0], c[0], d[0]),
        _blended(row.factor[1], weights, a[1], b[1], c[1], d[1]),
        _blended(row.factor[2], weights, a[2], b[2], c[2], d[2]),
    )


@njit(forceinline=True)
def _around(row, x, y):  # type: ignore[no-untyped-def]
    """The columns of the texels left and right, the numbers of the first texels of the rows above and below, and how
    far right and down between them (float32)."""
    columns, rows, half, whole = np.float64(row.columns), np.float64(row.rows), splat(0.5, _LANES), splat(1.0, _LANES)
    x, y = _scaled(columns, x) - half, _scaled(rows, y) - half
    left, above = floor(x), floor(y)
    between = rounded(x - left), rounded(y - above)
    x0, x1 = _inside(left, columns, row.wrap_x), _inside(left + whole, columns, row.wrap_x)
    y0, y1 = _inside(above, rows, row.wrap_y), _inside(above + whole, rows, row.wrap_y)
    first = splat(np.float64(row.first), _LANES)
    return (x0, x1), (first + _scaled(columns, y0), first + _scaled(columns, y1)), between


@njit(forceinline=True)
def _scaled(factor, vector):  # type: ignore[no-untyped-def]
    return splat(factor, _LANES) * vector


@njit(forceinline=True)
def _blended(factor, weights, a, b, c, d):  # type: ignore[no-untyped-def]
    wa, wb, wc, wd = weights
    return splat(factor, _LANES) * (wa * a + wb * b + wc * c + wd * d)


@njit(forceinline=True)
def _wrapped(place, wrap):  # type: ignore[no-untyped-def]
    """Places along an axis of an image -> ones in [0, 1]."""
    one = splat(1.0, _LANES)
    if wrap == CLAMP:
        return smaller(one, larger(splat(0.0, _LANES), place))
    if wrap == MIRROR:
        two = splat(2.0, _LANES)
        place = place - two * floor(splat(0.5, _LANES) * place)
        return where(one >= place, place, two - place)
    return place - floor(place)


@njit(forceinline=True)
def _inside(place, count, wrap):  # type: ignore[no-untyped-def]
    """The numbers of texels that are at most one beyond an end."""
    zero, most = splat(0.0, _LANES), splat(count - 1.0, _LANES)
    if wrap == REPEAT:
        all_ = splat(count, _LANES)
        return where(zero > place, place + all_, where(place > most, place - all_, place))
    return smaller(most, larger(zero, place))
