"""The colours of images at eight points at once, bit for bit as `surface_kernels.colour_at` finds them one by one."""

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
from atra.light.surface_kernels import (
    CLAMP,
    CURVE,
    FACTOR,
    FIRST_TEXEL,
    HAS_COLOURS,
    IMAGE,
    IMAGES,
    MIRROR,
    NEAREST,
    OF_COLOUR,
    PLACEMENT,
    REPEAT,
    TEXELS_X,
    TEXELS_Y,
    TEXTURE,
    UV,
    WRAP_X,
    WRAP_Y,
)

_LANES = 8
_I32, _I64 = ir.IntType(32), ir.IntType(64)


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
def packed_image(surfaces, material):  # type: ignore[no-untyped-def]
    """The row of `textures` of a material whose colours `colours_at` finds: bytes, blended, by the vertices' first uv,
    and vertices without colours; -1 = one by one."""
    row = surfaces.materials[material]
    if row[TEXTURE] == IMAGE and row[HAS_COLOURS] == 0.0:
        number = np.int64(row[IMAGES + OF_COLOUR])
        image = surfaces.textures[number]
        if image[CURVE] >= 0.0 and image[NEAREST] == 0.0 and image[UV] == 0.0:
            return number
    return np.int64(-1)


@njit(forceinline=True)
def places_in(surfaces, image, s, t):  # type: ignore[no-untyped-def]
    """(x, y), two vectors of float64: places in an image, 0 ... 1 and y down, of eight uv. NaN stays NaN."""
    s, t, row = widened(s), widened(t), surfaces.textures[image]
    x = _scaled(row[PLACEMENT], s) + _scaled(row[PLACEMENT + 1], t) + splat(row[PLACEMENT + 2], _LANES)
    y = _scaled(row[PLACEMENT + 3], s) + _scaled(row[PLACEMENT + 4], t) + splat(row[PLACEMENT + 5], _LANES)
    return _wrapped(x, row[WRAP_X]), _wrapped(splat(1.0, _LANES) - y, row[WRAP_Y])


@njit(forceinline=True)
def colours_at(surfaces, image, x, y):  # type: ignore[no-untyped-def]
    """Three vectors of float32: red, green and blue, in linear light, of an image at eight of `places_in`, none NaN."""
    row = surfaces.textures[image]
    (x0, x1), (y0, y1), (fx, fy) = _around(row, x, y)
    base, curves = np.int64(surfaces.coded.ctypes.data), np.int64(surfaces.curves.ctypes.data)
    curves += 4 * 256 * np.int64(row[CURVE])
    a, b = _linear(base, curves, y0 + x0), _linear(base, curves, y0 + x1)
    c, d = _linear(base, curves, y1 + x0), _linear(base, curves, y1 + x1)
    one = splat(ONE, _LANES)
    weights = (one - fx) * (one - fy), fx * (one - fy), (one - fx) * fy, fx * fy
    return (
        _blended(row[FACTOR], weights, a[0], b[0], c[0], d[0]),
        _blended(row[FACTOR + 1], weights, a[1], b[1], c[1], d[1]),
        _blended(row[FACTOR + 2], weights, a[2], b[2], c[2], d[2]),
    )


@njit(forceinline=True)
def _around(row, x, y):  # type: ignore[no-untyped-def]
    """The columns of the texels left and right, the numbers of the first texels of the rows above and below, and how
    far right and down between them (float32)."""
    columns, half, whole = row[TEXELS_X], splat(0.5, _LANES), splat(1.0, _LANES)
    x, y = _scaled(columns, x) - half, _scaled(row[TEXELS_Y], y) - half
    left, above = floor(x), floor(y)
    between = rounded(x - left), rounded(y - above)
    x0, x1 = _inside(left, columns, row[WRAP_X]), _inside(left + whole, columns, row[WRAP_X])
    y0, y1 = _inside(above, row[TEXELS_Y], row[WRAP_Y]), _inside(above + whole, row[TEXELS_Y], row[WRAP_Y])
    first = splat(row[FIRST_TEXEL], _LANES)
    return (x0, x1), (first + _scaled(columns, y0), first + _scaled(columns, y1)), between


@njit(forceinline=True)
def _scaled(factor, vector):  # type: ignore[no-untyped-def]
    return splat(factor, _LANES) * vector


@njit(forceinline=True)
def _blended(factor, weights, a, b, c, d):  # type: ignore[no-untyped-def]
    wa, wb, wc, wd = weights
    return splat(np.float32(factor), _LANES) * (wa * a + wb * b + wc * c + wd * d)


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
