"""Kernels of the tie rule: finding the triangles that can tie, and the tiles of an image that may show them."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import kernel, njit
from atra.geometry.projection_kernels import MARGIN_PIXELS

TILE = 16
"""Width and height of the image's tiles, pixels."""

PLANE_TOLERANCE = 1e-9
"""Distance, relative to their size, up to which two triangles lie in one plane."""

PLANE_NUMBER_ROUNDING = 1e-8
"""Largest difference of the numbers of one plane, reached by triangles that are almost needles."""

_NEEDLE = 1e-7
"""|e1 x e2| / (|e1| |e2|) up to which a triangle is a needle, too thin to cover a pixel or to have a known plane."""


@kernel
def number_planes(vertices, faces, centre, extent, numbers):  # type: ignore[no-untyped-def]
    """Set numbers[t] to a number of triangle t's plane, NaN for a needle; centre, extent: (3,) float64, the mesh's box.

    It is a continuous function of the plane without its orientation, so sorting puts triangles of one plane together.
    """
    scale = max(extent[0], extent[1], extent[2])
    for triangle in range(len(faces)):
        v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
        x, y, z = np.float64(vertices[v0, 0]), np.float64(vertices[v0, 1]), np.float64(vertices[v0, 2])
        ax, ay, az = vertices[v1, 0] - x, vertices[v1, 1] - y, vertices[v1, 2] - z
        bx, by, bz = vertices[v2, 0] - x, vertices[v2, 1] - y, vertices[v2, 2] - z
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if not length > _NEEDLE * np.sqrt((ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz)):
            numbers[triangle] = np.nan
            continue
        distance = nx * (x - centre[0]) + ny * (y - centre[1]) + nz * (z - centre[2])
        # Arbitrary weights: different planes with the same number only cost time.
        numbers[triangle] = abs(0.6137 * nx + 0.3511 * ny + 0.7071 * nz + 0.4243 * distance / scale) / length


@njit(forceinline=True)
def _boxes_meet(boxes, a, b):  # type: ignore[no-untyped-def]
    for axis in range(4):
        if boxes[a, 0, axis] > boxes[b, 1, axis] or boxes[b, 0, axis] > boxes[a, 1, axis]:
            return False
    return True


@kernel
def number_places(points, lowest, extent, numbers):  # type: ignore[no-untyped-def]
    """Set numbers[i] to the Morton code, 21 bits an axis, of point i of (N, 3) in the box with corner `lowest`."""
    if len(points) == 0:
        return  # the extent may be 0 then
    steps = 2097151.0 / max(extent[0], extent[1], extent[2])
    for i in range(len(points)):
        number = 0
        for axis in range(3):
            place = int((points[i, axis] - lowest[axis]) * steps)
            for bit in range(21):
                number |= ((place >> bit) & 1) << (3 * bit + axis)
        numbers[i] = number


@njit(forceinline=True)
def _same_corners(corners, a, b):  # type: ignore[no-untyped-def]
    """Whether two triangles with area have the same corners in any order."""
    for i in range(3):
        found = False
        for j in range(3):
            if (
                corners[a, i, 0] == corners[b, j, 0]
                and corners[a, i, 1] == corners[b, j, 1]
                and corners[a, i, 2] == corners[b, j, 2]
            ):
                found = True
        if not found:
            return False
    return True


@njit(forceinline=True)
def _in_plane(corners, normals, a, b, tolerance):  # type: ignore[no-untyped-def]
    """Whether all corners of b lie within `tolerance` of the plane of a."""
    for corner in range(3):
        distance = 0.0
        for axis in range(3):
            distance += normals[a, axis] * (corners[b, corner, axis] - corners[a, 0, axis])
        if abs(distance) > tolerance:
            return False
    return True


@njit(forceinline=True)
def _edge_separates(corners, a, b, first, second):  # type: ignore[no-untyped-def]
    """Whether the line along an edge of a separates a from b, or b only touches it.

    first, second: the two axes of the projection. Differences and products of float32 values are almost exact in
    float64, so triangles that share an edge or a corner give exactly zero there.
    """
    area = (corners[a, 1, first] - corners[a, 0, first]) * (corners[a, 2, second] - corners[a, 0, second]) - (
        corners[a, 1, second] - corners[a, 0, second]
    ) * (corners[a, 2, first] - corners[a, 0, first])
    for edge in range(3):
        following = (edge + 1) % 3
        along_first = corners[a, following, first] - corners[a, edge, first]
        along_second = corners[a, following, second] - corners[a, edge, second]
        beside = True
        for corner in range(3):
            side = along_first * (corners[b, corner, second] - corners[a, edge, second]) - along_second * (
                corners[b, corner, first] - corners[a, edge, first]
            )
            if side * area > 0.0:
                beside = False
        if beside:
            return True
    return False


@njit(forceinline=True)
def _overlap(corners, normals, sizes, a, b):  # type: ignore[no-untyped-def]
    """Whether two triangles lie in one plane and share an area there."""
    large, small = (a, b) if sizes[a] >= sizes[b] else (b, a)  # the larger one's plane is more accurate
    if not _in_plane(corners, normals, large, small, PLANE_TOLERANCE * (sizes[a] + sizes[b])):
        return False
    x, y, z = abs(normals[large, 0]), abs(normals[large, 1]), abs(normals[large, 2])
    first, second = 0, 1
    if x >= y and x >= z:
        first = 2
    elif y >= z:
        second = 2
    return not (_edge_separates(corners, a, b, first, second) or _edge_separates(corners, b, a, first, second))


@kernel
def find_overlaps(prim_ids, corners, normals, sizes, boxes, twins, most_pairs):  # type: ignore[no-untyped-def]
    """Find the pairs of triangles that overlap in one plane, with a binary tree of boxes.

    prim_ids: (N,) uint32, ordered so that neighbours are near each other, equal triangles by prim_id. corners:
    (N, 3, 3), normals: (N, 3) of length 1, sizes: (N,) longest side of the box, all float64.
    boxes: (2 L, 2, 4) float64, lowest and highest x, y, z and plane number; L is a power of two. Leaves start at L,
    empty boxes where there is no triangle; node i < L, filled here, contains nodes 2 i and 2 i + 1.
    twins: (F,) uint32, on entry each triangle itself, on return the lowest triangle with the same corners.

    Returns (P, 2) uint32, pairs of a triangle and a partner with a lower prim_id; P = most_pairs + 1 if there are more
    than most_pairs. A triangle is skipped once a lower twin is known, so a stack of equal ones does not give all pairs.
    """
    leaves = len(boxes) // 2
    for node in range(leaves - 1, 0, -1):
        for axis in range(4):
            boxes[node, 0, axis] = min(boxes[2 * node, 0, axis], boxes[2 * node + 1, 0, axis])
            boxes[node, 1, axis] = max(boxes[2 * node, 1, axis], boxes[2 * node + 1, 1, axis])
    pairs = np.empty((64, 2), np.uint32)
    count = 0
    for a in range(len(prim_ids)):
        if twins[prim_ids[a]] != prim_ids[a]:
            continue
        node = leaves + a
        while True:
            while node & 1:  # this subtree is done: go on with the next one on the right
                node >>= 1
            if node == 0:
                break
            node += 1
            while node < leaves and _boxes_meet(boxes, leaves + a, node):
                node *= 2
            b = node - leaves
            if b < 0 or not _boxes_meet(boxes, leaves + a, node):
                continue
            if twins[prim_ids[b]] != prim_ids[b] or not _overlap(corners, normals, sizes, a, b):
                continue
            if _same_corners(corners, a, b):
                twins[prim_ids[b]] = prim_ids[a]
                continue
            if count == len(pairs):
                longer = np.empty((2 * count, 2), np.uint32)
                for pair in range(count):  # a slice assignment takes seconds to compile
                    longer[pair, 0], longer[pair, 1] = pairs[pair, 0], pairs[pair, 1]
                pairs = longer
            pairs[count, 0], pairs[count, 1] = max(prim_ids[a], prim_ids[b]), min(prim_ids[a], prim_ids[b])
            count += 1
            if count > most_pairs:
                return pairs[:count]
    return pairs[:count]


@kernel
def mark_ties(vertices, faces, concerned, pairs, eye, to_pixels, size, boxes, marks):  # type: ignore[no-untyped-def]
    """Add 1 to every tile in which both triangles of a pair may be visible.

    marks: (tile rows + 1, tile columns + 1) int64, differences that the caller sums along both axes. concerned: (N,)
    uint32 prim_ids. pairs: (P, 2) uint32, indices into them. eye: (3,), to_pixels: (3, 4), size: (2,) float64, of the
    camera. boxes: (N, 4) int64, scratch: first and last column, first and last row of each triangle's tiles.
    """
    m = to_pixels
    for place in range(len(concerned)):
        low_x = low_y = nearest = np.inf
        high_x = high_y = farthest = -np.inf
        for corner in range(3):
            vertex = faces[concerned[place], corner]
            u, v, w = vertices[vertex, 0] - eye[0], vertices[vertex, 1] - eye[1], vertices[vertex, 2] - eye[2]
            depth = m[2, 0] * u + m[2, 1] * v + m[2, 2] * w + m[2, 3]  # 1 where rays are parallel
            nearest, farthest = min(nearest, depth), max(farthest, depth)
            nearness = 1.0 / depth if depth != 0.0 else np.inf
            x = (m[0, 0] * u + m[0, 1] * v + m[0, 2] * w + m[0, 3]) * nearness
            y = (m[1, 0] * u + m[1, 1] * v + m[1, 2] * w + m[1, 3]) * nearness
            low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
        for axis, low, high in ((0, low_x, high_x), (1, low_y, high_y)):
            first, last = low - MARGIN_PIXELS, high + MARGIN_PIXELS
            if not nearest > 0.0:  # it reaches behind the eye and may be anywhere
                first, last = 0.0, size[axis] if farthest >= 0.0 else -1.0
            boxes[place, 2 * axis] = int(min(max(first, 0.0), size[axis] + TILE)) // TILE
            boxes[place, 2 * axis + 1] = int(max(min(last, size[axis] - 1.0), -1.0)) // TILE
    for pair in range(len(pairs)):
        a, b = pairs[pair, 0], pairs[pair, 1]
        left, right = max(boxes[a, 0], boxes[b, 0]), min(boxes[a, 1], boxes[b, 1])
        top, bottom = max(boxes[a, 2], boxes[b, 2]), min(boxes[a, 3], boxes[b, 3])
        if left <= right and top <= bottom:
            marks[top, left] += 1
            marks[top, right + 1] -= 1
            marks[bottom + 1, left] -= 1
            marks[bottom + 1, right + 1] += 1
