"""The nearest hits of rays that start and head alike, or whether they hit anything, decided without rounding.

Such rays go through the tree together. All of them enter a node where the intervals that hold their numbers may; the
box of a leaf is tested with each ray, and so are its triangles, with all rays at once.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import float_at, int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import doubles_at, fetch, load, store
from atra.compiled.store import float_part, njit
from atra.compiled.vectors import (
    bits_of,
    fused,
    larger,
    repeated,
    size,
    smaller,
    widened,
)
from atra.exact.lines_kernels import UNIT, major_axis
from atra.rays.all_hits.boxes_kernels import BOX_MARGIN, FAR_MARGIN
from atra.rays.all_hits.crossings_kernels import (
    PRECISE,
    ROUNDINGS,
    crossing,
    error_of,
    prim_id_of,
)
from atra.rays.all_hits.memory import LANES, LEAF
from atra.rays.nearest.alone_kernels import NO_HIT, finished, is_nearer
from atra.rays.nearest.lanes_kernels import (
    AHEAD,
    AREAS,
    DIRECTION,
    HEIGHTS,
    LINE,
    ORIGIN,
    SLACK,
    WIDE,
    ZERO,
    ZERO_64,
    axis_of,
    begin_rays,
    entering,
    entry_of,
    exit_of,
    highest_of,
    largest_size,
    load_rays,
    lowest_of,
    range_of,
    row_at,
    spread,
    three_rows,
)
from atra.trees.layout import BLOCK, BLOCK_BYTES
from atra.trees.wide import CHILDREN, COUNTS, FIRSTS, WIDE_BYTES


@njit(forceinline=True)
def _corner(at, line):  # type: ignore[no-untyped-def]
    """A corner of a triangle, laid along each ray onto the plane across the major axis."""
    (ox, oy, oz), (sx, sy), (row_x, row_y, row_z), _, _ = line
    z = spread(float_at(at + row_z)) - oz
    return fused(sx, z, spread(float_at(at + row_x)) - ox), fused(sy, z, spread(float_at(at + row_y)) - oy), z


@njit(forceinline=True)
def _candidates(at, line, memory):  # type: ignore[no-untyped-def]
    """Bits of the rays that may cross a triangle, and that surely do; as `candidates`. at: of its first x."""
    px, py, pz = _corner(at, line)
    qx, qy, qz = _corner(at + 3 * LINE, line)
    rx, ry, rz = _corner(at + 6 * LINE, line)
    u, v, w = qx * ry - qy * rx, rx * py - ry * px, px * qy - py * qx
    error, square = line[3]
    sizes = (size(px) + size(py)) + (size(qx) + size(qy)) + (size(rx) + size(ry))
    slack = fused(sizes, error, square)
    none = slack - slack
    least, most = smaller(smaller(u, v), w), larger(larger(u, v), w)
    maybe = bits_of((least + slack >= none) | (most <= slack))
    if maybe == 0:
        return maybe, maybe
    store(u, memory + AREAS)
    store(v, memory + AREAS + WIDE)
    store(w, memory + AREAS + 2 * WIDE)
    store(pz, memory + HEIGHTS)
    store(qz, memory + HEIGHTS + WIDE)
    store(rz, memory + HEIGHTS + 2 * WIDE)
    store(slack, memory + SLACK)
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
    low_x, high_x, low_y, high_y = lowest_of(ox), highest_of(ox, ZERO_64), lowest_of(oy), highest_of(oy, ZERO_64)
    low_z, high_z = lowest_of(oz), highest_of(oz, ZERO_64)
    least_x, most_x, least_y, most_y = lowest_of(sx), highest_of(sx, ZERO_64), lowest_of(sy), highest_of(sy, ZERO_64)
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
    z = widened(load(place + row_z, ZERO, BLOCK)) - oz
    x = fused(sx, z, widened(load(place + row_x, ZERO, BLOCK)) - ox)
    return x, fused(sy, z, widened(load(place + row_y, ZERO, BLOCK)) - oy), z


@njit(forceinline=True)
def _met(block, tube, error):  # type: ignore[no-untyped-def]
    """Bits of the triangles of a block that any of the rays may cross: each is seen from a ray in the middle, and its
    corners lie elsewhere by as much as the rays are apart there. No bit for entries that hold no triangle."""
    px, py, pz = _middle_corner(block, tube)
    qx, qy, qz = _middle_corner(block + 3 * LINE, tube)
    rx, ry, rz = _middle_corner(block + 6 * LINE, tube)
    u, v, w = qx * ry - qy * rx, rx * py - ry * px, px * qy - py * qx
    sizes = (size(px) + size(py)) + (size(qx) + size(qy)) + (size(rx) + size(ry))
    off = fused(largest_size(pz, qz, rz), tube[4], tube[3] + repeated(error, BLOCK))
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
    is_alike, left, octant, major, scale = load_rays(rays, first, last, near_by, memory)
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
        (x, y, z), mx, my, mz = three_rows(memory + ORIGIN), spread(cx), spread(cy), spread(cz)
        farthest = highest_of(largest_size(x - mx, y - my, z - mz), ZERO_64)
    margin = (max(abs(cx), abs(cy), abs(cz)) + 16.0 * radius) * BOX_MARGIN + farthest * FAR_MARGIN
    left &= begin_rays(memory, tree.sphere, farthest, margin)
    if left == 0:
        return True
    margin_32 = np.float32(margin)
    x, y = axis_of(memory, 0, left, octant, margin_32), axis_of(memory, 1, left, octant, margin_32)
    z = axis_of(memory, 2, left, octant, margin_32)
    one, other = (major + 1) % 3, (major + 2) % 3
    way = row_at(memory + DIRECTION + major * WIDE)
    error = ROUNDINGS * UNIT * (farthest + radius)
    line = (
        (
            row_at(memory + ORIGIN + one * WIDE), row_at(memory + ORIGIN + other * WIDE),
            row_at(memory + ORIGIN + major * WIDE),
        ),
        (
            spread(0.0) - row_at(memory + DIRECTION + one * WIDE) / way,
            spread(0.0) - row_at(memory + DIRECTION + other * WIDE) / way,
        ),
        (one * LINE, other * LINE, major * LINE), (spread(error), spread(error * error)), 0,
    )  # fmt: skip
    tube = _tube_of(line, way, memory)
    _, ahead = range_of(memory + AHEAD, left)
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
            active = entering(child, memory, octant, margin_32) & left
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
                _, ahead = range_of(memory + AHEAD, left)
                end = repeated(ahead, CHILDREN)
            continue
        near = larger(start, larger(entry_of(node, y), larger(entry_of(node, z), entry_of(node, x))))
        far = smaller(end, smaller(exit_of(node, y), smaller(exit_of(node, z), exit_of(node, x))))
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
