"""The nearest hits of rays that start and head alike, or whether they hit anything, decided without rounding.

Such rays go through the tree together. All of them enter a node where the intervals that hold their numbers may; the
box of a leaf is tested with each ray, and so are its triangles, with all rays at once.
"""

from __future__ import annotations

import numpy as np

from atra.compiled import vectors
from atra.compiled.intrinsics import float_at, int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import doubles_at, fetch, load, store
from atra.compiled.store import float_part, njit
from atra.compiled.vectors import (
    bits_of,
    folded,
    fused,
    larger,
    mask_of,
    repeated,
    rounded,
    signed_like,
    size,
    smaller,
    where,
    widened,
)
from atra.exact.lines_kernels import UNIT, major_axis
from atra.rays.all_hits.boxes_kernels import BOX_MARGIN, FAR_MARGIN, PADDING, SMALLEST_COMPONENT
from atra.rays.all_hits.crossings_kernels import (
    PRECISE,
    ROUNDINGS,
    crossing,
    error_of,
    interval_of,
    prim_id_of,
    scale_of,
    vector_at,
)
from atra.rays.all_hits.finding_kernels import AHEAD_ROW, LANES, LEAF
from atra.rays.nearest.alone_kernels import NO_HIT, finished, is_nearer
from atra.trees.layout import BLOCK, BLOCK_BYTES
from atra.trees.wide import CHILDREN, COUNTS, FIRSTS, HIGH, WIDE_BYTES

ALIKE_DIRECTIONS = 0.125
"""How far apart the components of directions of 1 to 2 in size are at most for rays to head alike."""

_ZERO, _ZERO_64 = np.float32(0.0), np.float64(0.0)
_ROW = 4 * CHILDREN
_LINE = 4 * BLOCK
_WIDE = 8 * LANES
"""Bytes of a row of memory: a float64 of each ray; a row of float32 takes half of it."""

_ORIGIN, _DIRECTION, _NEAR, _FAR, _SCALE = 0, 3 * _WIDE, 6 * _WIDE, 7 * _WIDE, 8 * _WIDE
_AREAS, _HEIGHTS, _SLACK = 9 * _WIDE, 12 * _WIDE, 15 * _WIDE
_T, _ERROR, _START = 16 * _WIDE, 17 * _WIDE, 18 * _WIDE
_PLACE, _INVERSE, _AHEAD = 19 * _WIDE, 22 * _WIDE, AHEAD_ROW * _WIDE
"""Where rows lie: float64 up to `_START`, then float32."""


@njit(forceinline=True)
def _wide(x):  # type: ignore[no-untyped-def]
    return repeated(np.float64(x), LANES)


@njit(forceinline=True)
def _row(at):  # type: ignore[no-untyped-def]
    return load(at, _ZERO_64, LANES)


@njit(forceinline=True)
def _three(at):  # type: ignore[no-untyped-def]
    return _row(at), _row(at + _WIDE), _row(at + 2 * _WIDE)


@njit(forceinline=True)
def _three_narrow(at):  # type: ignore[no-untyped-def]
    return load(at, _ZERO, LANES), load(at + _WIDE, _ZERO, LANES), load(at + 2 * _WIDE, _ZERO, LANES)


@njit(forceinline=True)
def _larger_of(a, b, c):  # type: ignore[no-untyped-def]
    return larger(larger(size(a), size(b)), size(c))


@njit(forceinline=True)
def _lowest(row):  # type: ignore[no-untyped-def]
    """The least number of a row."""
    if LANES == 16:
        return vectors.lane(folded(folded(folded(folded(row)))), 0)
    return vectors.lane(folded(folded(folded(row))), 0)


@njit(forceinline=True)
def _highest(row, zero):  # type: ignore[no-untyped-def]
    """The largest number of a row; zero: of its type."""
    return -_lowest(repeated(zero, LANES) - row)


@njit(forceinline=True)
def _are_all(mask):  # type: ignore[no-untyped-def]
    return bits_of(mask) == (1 << LANES) - 1


@float_part
def _load_rays(rays, first, last, near_by, memory):  # type: ignore[no-untyped-def]
    """(whether rays start and head alike, bits of those that are open, octant, major axis, scale) of rays from `first`
    up to `last`. Writes their numbers to memory; lanes beyond the last ray get its numbers.

    Directions are multiplied by one `scale`, a power of two, which makes the largest component 0.75 to 2.25 in size.
    """
    at = doubles_at(memory)
    u, v, w = vector_at(rays.directions + rays.vector_bytes * first, rays.is_double)
    scale, length = scale_of(u, v, w)
    for lane in range(LANES):
        ray = min(first + lane, last - 1)
        x, y, z = vector_at(rays.origins + rays.vector_bytes * ray, rays.is_double)
        at[lane], at[LANES + lane], at[2 * LANES + lane] = x, y, z
        x, y, z = vector_at(rays.directions + rays.vector_bytes * ray, rays.is_double)
        at[3 * LANES + lane] = x * scale + 0.0  # -0.0 counts as 0.0
        at[4 * LANES + lane] = y * scale + 0.0
        at[5 * LANES + lane] = z * scale + 0.0
        near, far = interval_of(rays, ray)
        at[6 * LANES + lane], at[7 * LANES + lane] = near * length, far * length
    (ox, oy, oz), (dx, dy, dz) = _three(memory + _ORIGIN), _three(memory + _DIRECTION)
    u, v, w = at[3 * LANES], at[4 * LANES], at[5 * LANES]
    major = major_axis(u, v, w)
    way = size(_row(memory + _DIRECTION + major * _WIDE))
    moved = _larger_of(ox - _wide(at[0]), oy - _wide(at[LANES]), oz - _wide(at[2 * LANES]))
    turned = _larger_of(dx - _wide(u), dy - _wide(v), dz - _wide(w))
    is_alike = (moved <= _wide(near_by)) & (turned <= _wide(ALIKE_DIRECTIONS)) & (_larger_of(dx, dy, dz) <= way)
    zero, every = _wide(0.0), (1 << LANES) - 1
    x, y, z = bits_of(zero > dx), bits_of(zero > dy), bits_of(zero > dz)
    octant = (x & 1) | (y & 1) << 1 | (z & 1) << 2
    is_one = (x == 0 or x == every) and (y == 0 or y == every) and (z == 0 or z == every)
    bits = bits_of(_row(memory + _FAR) > _row(memory + _NEAR)) & ((1 << (last - first)) - 1)
    return is_one and _are_all(is_alike), bits, octant, major, scale


@float_part
def _start(memory, sphere, farthest, margin):  # type: ignore[no-untyped-def]
    """Bits of the rays that come near the mesh. Writes what box tests need of each, as `start_of` and `box_ray` do of
    one; rays start anew a little earlier than there, as lengths of directions count as their least."""
    cx, cy, cz, radius = sphere
    (ox, oy, oz), (dx, dy, dz) = _three(memory + _ORIGIN), _three(memory + _DIRECTION)
    tnear, tfar = _row(memory + _NEAR), _row(memory + _FAR)
    x, y, z = _wide(cx) - ox, _wide(cy) - oy, _wide(cz) - oz
    middle = fused(x, dx, fused(y, dy, z * dz)) / fused(dx, dx, fused(dy, dy, dz * dz))
    padded = 1.4 * (PADDING * radius + 192.0 * UNIT * farthest)
    s = larger(tnear, middle - _wide(padded))
    px, py, pz = fused(s, dx, ox), fused(s, dy, oy), fused(s, dz, oz)
    way = _larger_of(_wide(cx) - px, _wide(cy) - py, _wide(cz) - pz)
    is_near = (s <= middle + _wide(padded)) & (way <= _wide(6.0 * padded)) & (s <= tfar)
    store(rounded(px), memory + _PLACE)
    store(rounded(py), memory + _PLACE + _WIDE)
    store(rounded(pz), memory + _PLACE + 2 * _WIDE)
    one, small = _wide(1.0), _wide(SMALLEST_COMPONENT)
    store(rounded(signed_like(one / larger(size(dx), small), dx)), memory + _INVERSE)
    store(rounded(signed_like(one / larger(size(dy), small), dy)), memory + _INVERSE + _WIDE)
    store(rounded(signed_like(one / larger(size(dz), small), dz)), memory + _INVERSE + 2 * _WIDE)
    store(rounded(fused(tfar - s, _wide(1.0 + BOX_MARGIN), _wide(margin))), memory + _AHEAD)
    store(s, memory + _START)
    store(tfar, memory + _T)
    store(_wide(0.0), memory + _ERROR)
    return bits_of(is_near)


@njit(forceinline=True)
def _range(at, bits):  # type: ignore[no-untyped-def]
    """The least and the largest float32 of a row, of some rays."""
    row = load(at, _ZERO, LANES)
    if bits != (1 << LANES) - 1:
        row = where(mask_of(bits, LANES), row, repeated(float_at(at + 4 * first_bit(bits)), LANES))
    return _lowest(row), _highest(row, _ZERO)


@njit(forceinline=True)
def _axis(memory, axis, bits, octant, margin):  # type: ignore[no-untyped-def]
    """What box tests of all rays need of an axis: where they start as seen from near and far sides of boxes, the
    reciprocals' range, and where the sides lie in a node."""
    low, high = _range(memory + _PLACE + axis * _WIDE, bits)
    one, other = _range(memory + _INVERSE + axis * _WIDE, bits)
    is_down = octant >> axis & 1
    near, far = (low - margin, high + margin) if is_down else (high + margin, low - margin)
    row = axis * _ROW
    return (
        repeated(np.float32(near), CHILDREN), repeated(np.float32(far), CHILDREN),
        repeated(one, CHILDREN), repeated(other, CHILDREN),
        HIGH + row if is_down else row, row if is_down else HIGH + row,
    )  # fmt: skip


@njit(forceinline=True)
def _near(node, axis):  # type: ignore[no-untyped-def]
    start, _, one, other, place, _ = axis
    way = load(node + place, _ZERO, CHILDREN) - start
    return smaller(way * one, way * other)


@njit(forceinline=True)
def _far(node, axis):  # type: ignore[no-untyped-def]
    _, start, one, other, _, place = axis
    way = load(node + place, _ZERO, CHILDREN) - start
    return larger(way * one, way * other)


@njit(forceinline=True)
def _side(at, margin):  # type: ignore[no-untyped-def]
    return repeated(np.float32(float_at(at) + margin), LANES)


@njit(forceinline=True)
def _entering(at, memory, octant, margin):  # type: ignore[no-untyped-def]
    """Bits of the rays that may meet the box of one child of a node; at: of its lowest x."""
    (px, py, pz), (ix, iy, iz) = _three_narrow(memory + _PLACE), _three_narrow(memory + _INVERSE)
    dx, dy, dz = octant & 1, octant >> 1 & 1, octant >> 2 & 1
    near, far = at, at + HIGH
    near_x, far_x = (_side(far, margin), _side(near, -margin)) if dx else (_side(near, -margin), _side(far, margin))
    near += _ROW
    far += _ROW
    near_y, far_y = (_side(far, margin), _side(near, -margin)) if dy else (_side(near, -margin), _side(far, margin))
    near += _ROW
    far += _ROW
    near_z, far_z = (_side(far, margin), _side(near, -margin)) if dz else (_side(near, -margin), _side(far, margin))
    start, end = repeated(np.float32(-margin), LANES), load(memory + _AHEAD, _ZERO, LANES)
    first = larger(start, larger((near_z - pz) * iz, larger((near_y - py) * iy, (near_x - px) * ix)))
    last = smaller(end, smaller((far_z - pz) * iz, smaller((far_y - py) * iy, (far_x - px) * ix)))
    return bits_of(first <= last)


@njit(forceinline=True)
def _corner(at, line):  # type: ignore[no-untyped-def]
    """A corner of a triangle, laid along each ray onto the plane across the major axis."""
    (ox, oy, oz), (sx, sy), (row_x, row_y, row_z), _, _ = line
    z = _wide(float_at(at + row_z)) - oz
    return fused(sx, z, _wide(float_at(at + row_x)) - ox), fused(sy, z, _wide(float_at(at + row_y)) - oy), z


@njit(forceinline=True)
def _candidates(at, line, memory):  # type: ignore[no-untyped-def]
    """Bits of the rays that may cross a triangle, and that surely do; as `candidates`. at: of its first x."""
    px, py, pz = _corner(at, line)
    qx, qy, qz = _corner(at + 3 * _LINE, line)
    rx, ry, rz = _corner(at + 6 * _LINE, line)
    u, v, w = qx * ry - qy * rx, rx * py - ry * px, px * qy - py * qx
    error, square = line[3]
    sizes = (size(px) + size(py)) + (size(qx) + size(qy)) + (size(rx) + size(ry))
    slack = fused(sizes, error, square)
    none = slack - slack
    least, most = smaller(smaller(u, v), w), larger(larger(u, v), w)
    maybe = bits_of((least + slack >= none) | (most <= slack))
    if maybe == 0:
        return maybe, maybe
    store(u, memory + _AREAS)
    store(v, memory + _AREAS + _WIDE)
    store(w, memory + _AREAS + 2 * _WIDE)
    store(pz, memory + _HEIGHTS)
    store(qz, memory + _HEIGHTS + _WIDE)
    store(rz, memory + _HEIGHTS + 2 * _WIDE)
    store(slack, memory + _SLACK)
    return maybe, bits_of((least > slack) | (none > most + slack))


@njit(forceinline=True)
def _sure_crossing(memory, lane, inverse_z):  # type: ignore[no-untyped-def]
    """(sign, t, error) of a ray that surely crosses the triangle's line, as `sure_crossing`."""
    at = doubles_at(memory + 8 * lane)
    u, v, w, slack = at[9 * LANES], at[10 * LANES], at[11 * LANES], at[15 * LANES]
    a, b, c = at[12 * LANES], at[13 * LANES], at[14 * LANES]
    tnear, tfar = at[6 * LANES], at[7 * LANES]
    whole = u + v + w
    if not slack < PRECISE * abs(whole):
        return 2, 0.0, 0.0
    inverse = 1.0 / whole
    t = (u * a + v * b + w * c) * inverse * inverse_z
    error = error_of(slack * abs(inverse), a, b, c)
    if not (abs(t - tnear) > error and abs(t - tfar) > error):
        return 2, 0.0, 0.0
    return (1 if tnear <= t < tfar else 0), t, error


@njit(forceinline=True)
def _tube_of(line, way_row, memory):  # type: ignore[no-untyped-def]
    """What `_met` needs: a ray in the middle of all, as `line_of` has it, and how far others lie from it, and how much
    more with each step along the major axis."""
    (ox, oy, oz), (sx, sy), rows, _, _ = line
    low_x, high_x, low_y, high_y = _lowest(ox), _highest(ox, _ZERO_64), _lowest(oy), _highest(oy, _ZERO_64)
    low_z, high_z = _lowest(oz), _highest(oz, _ZERO_64)
    least_x, most_x, least_y, most_y = _lowest(sx), _highest(sx, _ZERO_64), _lowest(sy), _highest(sy, _ZERO_64)
    apart = 0.5 * (max(high_x - low_x, high_y - low_y) + 1.125 * 2.0 * (high_z - low_z))
    turned = 0.5 * max(most_x - least_x, most_y - least_y)
    return (
        (
            repeated(0.5 * (low_x + high_x), BLOCK), repeated(0.5 * (low_y + high_y), BLOCK),
            repeated(0.5 * (low_z + high_z), BLOCK),
        ),
        (repeated(0.5 * (least_x + most_x), BLOCK), repeated(0.5 * (least_y + most_y), BLOCK)),
        rows, repeated(apart, BLOCK), repeated(turned, BLOCK),
    )  # fmt: skip


@njit(forceinline=True)
def _middle_corner(place, tube):  # type: ignore[no-untyped-def]
    (ox, oy, oz), (sx, sy), (row_x, row_y, row_z), _, _ = tube
    z = widened(load(place + row_z, _ZERO, BLOCK)) - oz
    x = fused(sx, z, widened(load(place + row_x, _ZERO, BLOCK)) - ox)
    return x, fused(sy, z, widened(load(place + row_y, _ZERO, BLOCK)) - oy), z


@njit(forceinline=True)
def _met(block, tube, error):  # type: ignore[no-untyped-def]
    """Bits of the triangles of a block that any of the rays may cross: each is seen from a ray in the middle, and its
    corners lie elsewhere by as much as the rays are apart there. No bit for entries that hold no triangle."""
    px, py, pz = _middle_corner(block, tube)
    qx, qy, qz = _middle_corner(block + 3 * _LINE, tube)
    rx, ry, rz = _middle_corner(block + 6 * _LINE, tube)
    u, v, w = qx * ry - qy * rx, rx * py - ry * px, px * qy - py * qx
    sizes = (size(px) + size(py)) + (size(qx) + size(qy)) + (size(rx) + size(ry))
    off = fused(_larger_of(pz, qz, rz), tube[4], tube[3] + repeated(error, BLOCK))
    slack = fused(sizes, off, (off + off) * off)
    none = slack - slack
    least, most = smaller(smaller(u, v), w), larger(larger(u, v), w)
    return bits_of((least + slack >= none) | (most <= slack))


@float_part
def hit_together(any_hit, tree, rays, first, last, near_by, found, touches, t_of, answers):  # type: ignore[no-untyped-def]
    """Write the hits of rays from `first` up to, not including, `last`, LANES at most; False: they are not alike, and
    nothing is written. near_by: how far apart alike rays start. t_of, answers: as for `nearest_kernel`. Other arguments
    as for `hit_alone`."""
    memory, exact = found.lanes.ctypes.data, found.exact.ctypes.data
    is_alike, left, octant, major, scale = _load_rays(rays, first, last, near_by, memory)
    if not is_alike:
        return False
    at, blocks, places = doubles_at(memory), found.hit_blocks, found.hit_places
    for lane in range(last - first):
        answers[first + lane] = np.uint32(0) if any_hit else NO_HIT
        blocks[lane] = 0
        if not any_hit:
            t_of[first + lane] = np.inf
    if left == 0:
        return True
    cx, cy, cz, radius = tree.sphere
    farthest = max(abs(at[0] - cx), abs(at[LANES] - cy), abs(at[2 * LANES] - cz)) + near_by
    if near_by == np.inf:
        (x, y, z), mx, my, mz = _three(memory + _ORIGIN), _wide(cx), _wide(cy), _wide(cz)
        farthest = _highest(_larger_of(x - mx, y - my, z - mz), _ZERO_64)
    margin = (max(abs(cx), abs(cy), abs(cz)) + 16.0 * radius) * BOX_MARGIN + farthest * FAR_MARGIN
    left &= _start(memory, tree.sphere, farthest, margin)
    if left == 0:
        return True
    margin_32 = np.float32(margin)
    x, y = _axis(memory, 0, left, octant, margin_32), _axis(memory, 1, left, octant, margin_32)
    z = _axis(memory, 2, left, octant, margin_32)
    one, other = (major + 1) % 3, (major + 2) % 3
    way = _row(memory + _DIRECTION + major * _WIDE)
    error = ROUNDINGS * UNIT * (farthest + radius)
    line = (
        (
            _row(memory + _ORIGIN + one * _WIDE), _row(memory + _ORIGIN + other * _WIDE),
            _row(memory + _ORIGIN + major * _WIDE),
        ),
        (
            _wide(0.0) - _row(memory + _DIRECTION + one * _WIDE) / way,
            _wide(0.0) - _row(memory + _DIRECTION + other * _WIDE) / way,
        ),
        (one * _LINE, other * _LINE, major * _LINE), (_wide(error), _wide(error * error)), 0,
    )  # fmt: skip
    tube = _tube_of(line, way, memory)
    _, ahead = _range(memory + _AHEAD, left)
    start, end = repeated(-margin_32, CHILDREN), repeated(ahead, CHILDREN)
    entries = found.entries.ctypes.data
    found.stack[0], found.reached[0] = tree.nodes, -np.inf
    top = 1
    while top > 0:
        top -= 1
        node = found.stack[top]
        if found.reached[top] > ahead:
            continue
        if node & LEAF:
            child = found.boxes[top]
            active = _entering(child, memory, octant, margin_32) & left
            if active == 0:
                continue
            changed = False
            block = tree.blocks + np.int64(int32_at(child + FIRSTS)) * BLOCK_BYTES
            for _ in range(int32_at(child + COUNTS)):
                met = _met(block, tube, error)
                while met:
                    k = first_bit(met)
                    met &= met - 1
                    maybe, sure = _candidates(block + 4 * k, line, memory)
                    maybe &= active
                    while maybe:
                        lane = first_bit(maybe)
                        maybe &= maybe - 1
                        sign, t, wrong = 2, 0.0, 0.0
                        if sure >> lane & 1:
                            sign, t, wrong = _sure_crossing(memory, lane, 1.0 / at[(3 + major) * LANES + lane])
                        o = at[lane], at[LANES + lane], at[2 * LANES + lane]
                        d = at[3 * LANES + lane], at[4 * LANES + lane], at[5 * LANES + lane]
                        if sign == 2:
                            tnear, tfar = at[6 * LANES + lane], at[7 * LANES + lane]
                            own = major_axis(d[0], d[1], d[2])
                            sign, t, wrong, _, _ = crossing(block, k, o, d, tnear, tfar, own, exact, touches)
                        if sign == 0:
                            continue
                        if any_hit:
                            answers[first + lane] = 1
                            left &= ~(1 << lane)
                            active &= left
                            changed = True
                            continue
                        nearest, doubt = at[16 * LANES + lane], at[17 * LANES + lane]
                        best, place = blocks[lane], places[lane]
                        if is_nearer(t, wrong, block, k, nearest, doubt, best, place, o, d, exact):
                            at[16 * LANES + lane], at[17 * LANES + lane] = t, wrong
                            blocks[lane], places[lane] = block, k
                            limit = (t + wrong - at[18 * LANES + lane]) * (1.0 + BOX_MARGIN) + margin
                            found.ahead[lane] = limit
                            changed = True
                    if active == 0:
                        break
                if active == 0:
                    break
                block += BLOCK_BYTES
            if changed:
                if left == 0:
                    break
                _, ahead = _range(memory + _AHEAD, left)
                end = repeated(ahead, CHILDREN)
            continue
        near = larger(start, larger(_near(node, y), larger(_near(node, z), _near(node, x))))
        far = smaller(end, smaller(_far(node, y), smaller(_far(node, z), _far(node, x))))
        store(near, entries)
        bits = bits_of(near <= far)
        lowest = top
        while bits:
            child = 4 * first_bit(bits)
            bits &= bits - 1
            entry = float_at(entries + child)
            to = np.int64(LEAF)
            if int32_at(node + COUNTS + child) == 0:
                to = tree.nodes + np.int64(int32_at(node + FIRSTS + child)) * WIDE_BYTES
                fetch(to)
                fetch(to + 64)
                fetch(to + 128)
                fetch(to + 192)
            into = top  # the farthest stands lowest
            while into > lowest and found.reached[into - 1] < entry:
                found.stack[into], found.reached[into] = found.stack[into - 1], found.reached[into - 1]
                found.boxes[into] = found.boxes[into - 1]
                into -= 1
            found.stack[into], found.reached[into], found.boxes[into] = to, entry, node + child
            top += 1
    if any_hit:
        return True
    for lane in range(last - first):
        if blocks[lane]:
            o = at[lane], at[LANES + lane], at[2 * LANES + lane]
            d = at[3 * LANES + lane], at[4 * LANES + lane], at[5 * LANES + lane]
            best, place = blocks[lane], places[lane]
            t = finished(at[16 * LANES + lane], at[17 * LANES + lane], best, place, o, d, exact)
            t_of[first + lane] = t * scale
            answers[first + lane] = prim_id_of(best, place)
    return True
