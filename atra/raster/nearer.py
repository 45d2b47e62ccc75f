"""Which of two triangles is nearer where float32 cannot tell: their depths in float64, from the corners themselves."""

from __future__ import annotations

from typing import NamedTuple

from atra.compiled.memory import doubles_at, floats_at, identities_at
from atra.compiled.store import njit
from atra.exact.intersection import FLOAT64_TOLERANCE
from atra.prim_ids import MISS
from atra.raster.image import eye_at

UNSURE = 2.0**-20
"""Difference of two stored values of nearness, as a share of them, up to which float64 decides. Each is off by at most
8 roundings of float32: a gentle slope adds at most 2 times the value along a row."""

UNSURE_OF_LENS = 2.0 * UNSURE
"""As UNSURE: samples beside whole numbers add as many roundings, those of what a row and a column add."""

FEW = 8
"""Lanes of vectors of samples that are decided: all drawing kernels share the code."""


class Corners(NamedTuple):
    """Addresses of a mesh's vertices and faces, all that `nearness_along` reads; named as in `ClusterAddresses`."""

    mesh_vertices: int
    mesh_faces: int


@njit
def nearness_along(parallel, eye, clusters, prim_id, row):  # type: ignore[no-untyped-def]
    """Nearness on the plane of a triangle in a row of samples: what each column adds, and that in column 0.

    p: a corner, homogeneous as its pixel position and depth; n: the normal there. Edges are subtracted before anything
    is rounded.
    """
    m, axis, position = doubles_at(eye.to_pixels), doubles_at(eye.depth_axis), doubles_at(eye.position)
    values, corners = floats_at(clusters.mesh_vertices), identities_at(clusters.mesh_faces + prim_id * 12)
    v0, v1, v2 = int(corners[0]) * 3, int(corners[1]) * 3, int(corners[2]) * 3
    x, y, z = float(values[v0]), float(values[v0 + 1]), float(values[v0 + 2])
    ax, ay, az = values[v1] - x, values[v1 + 1] - y, values[v1 + 2] - z
    bx, by, bz = values[v2] - x, values[v2 + 1] - y, values[v2 + 2] - z
    x, y, z = x - position[0], y - position[1], z - position[2]
    p0, p1 = m[0] * x + m[1] * y + m[2] * z, m[4] * x + m[5] * y + m[6] * z
    a0, a1 = m[0] * ax + m[1] * ay + m[2] * az, m[4] * ax + m[5] * ay + m[6] * az
    b0, b1 = m[0] * bx + m[1] * by + m[2] * bz, m[4] * bx + m[5] * by + m[6] * bz
    p2 = axis[0] * x + axis[1] * y + axis[2] * z
    a2, b2 = axis[0] * ax + axis[1] * ay + axis[2] * az, axis[0] * bx + axis[1] * by + axis[2] * bz
    n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    if parallel:
        p0, p1 = p0 + m[3], p1 + m[7]
        inverse = 1.0 / n2 if n2 != 0.0 else 0.0
        return n0 * inverse, (n1 * (row - p1) - n0 * p0) * inverse - (p2 if n2 != 0.0 else 0.0)
    ahead = n0 * p0 + n1 * p1 + n2 * p2
    inverse = 1.0 / ahead if ahead != 0.0 else 0.0
    return n0 * inverse, (n1 * row + n2) * inverse


@njit(forceinline=True)
def _is_behind(own, theirs, prim_id, other):  # type: ignore[no-untyped-def]
    """Whether of two nearnesses the other triangle's is the larger, or the same and its prim_id is the lower."""
    ahead = own - theirs
    return other < prim_id if abs(ahead) <= FLOAT64_TOLERANCE * abs(theirs) else ahead < 0.0


@njit(forceinline=True)
def without_farther(parallel, bits, close, prim_id, own, known, stored, address, eye, clusters, left, row):  # type: ignore[no-untyped-def]
    """`bits` of the lanes to be drawn without those of `close` where what is stored is nearer, or as near with a lower
    prim_id; and a prim_id with its `nearness_along` the row.

    own: `nearness_along` of the triangle that is drawn. known, stored: what was returned before for this row, at first
    prim_id and own. address: of the stored prim_ids, those of the samples (left, row), (left + 1, row) ...
    """
    lane = 0
    while close >> lane != 0:
        if (close >> lane) & 1:
            other = identities_at(address)[lane]
            if other != MISS:
                if other != known:
                    known, stored = other, nearness_along(parallel, eye, clusters, other, row)
                theirs = stored[0] * (left + lane) + stored[1]
                if _is_behind(own[0] * (left + lane) + own[1], theirs, prim_id, other):
                    bits &= ~(1 << lane)
        lane += 1
    return bits, known, stored


@njit
def without_farther_of_lens(bits, close, prim_id, address, numbers, mesh, left, row, places, down_places):  # type: ignore[no-untyped-def]
    """As `without_farther`, through a lens, with few arguments: every call of what calls it passes them on.

    numbers: address of those of an `Eye`. mesh: `Corners`. places, down_places: addresses of float32, by which samples
    lie beside whole numbers.
    """
    lane, eye = 0, eye_at(numbers, 0.0)
    while close >> lane != 0:
        other = identities_at(address)[lane]
        if (close >> lane) & 1 and other != MISS:
            i, j = left + lane + float(floats_at(places)[lane]), row + float(floats_at(down_places)[lane])
            own = nearness_along(False, eye, mesh, prim_id, j)
            theirs = nearness_along(False, eye, mesh, other, j)
            if _is_behind(own[0] * i + own[1], theirs[0] * i + theirs[1], prim_id, other):
                bits &= ~(1 << lane)
        lane += 1
    return bits
