"""Kernels of texels: a conservative float64 rasteriser that assigns them to triangles, and a look-up by pixels."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import kernel, njit
from atra.embree.packets_kernels import MISS

INSIDE = -1.0
"""Distance of a texel whose centre lies strictly inside its triangle."""

STRICTLY = 1e-7
"""How deep, in texels, a centre must lie inside two triangles for them to overlap."""

_NO_AREA = 1e-14
"""Area in square texels below which a triangle is skipped."""


@njit
def _square_to_edge(x, y, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Squared distance from a point to a segment."""
    ex, ey = bx - ax, by - ay
    t = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)
    t = min(1.0, max(0.0, t))
    dx, dy = x - ax - t * ex, y - ay - t * ey
    return dx * dx + dy * dy


@kernel
def claim_texels(uv, prim_of, distance, overlap):  # type: ignore[no-untyped-def]
    """Assign each texel to the triangle nearest to its centre among those that touch it, the lowest on ties.

    uv: (F, 3, 2) float64, corners in texels; row 0 of the map is y from 0 to 1. prim_of: (H, W) int32, initially -1.
    distance: (H, W) float64, initially inf: squared, from the centre, or `INSIDE`. overlap: (3,) int64, initially 0:
    texels whose centre lies in two triangles, and the first two such triangles.
    """
    height, width = prim_of.shape
    for face in range(len(uv)):
        ax, ay = uv[face, 0, 0], uv[face, 0, 1]
        bx, by = uv[face, 1, 0], uv[face, 1, 1]
        cx, cy = uv[face, 2, 0], uv[face, 2, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if not abs(area) > _NO_AREA:
            continue
        side = 1.0 if area > 0.0 else -1.0
        left = max(0, int(np.floor(min(ax, bx, cx))))
        right = min(width, int(np.ceil(max(ax, bx, cx))))
        top = max(0, int(np.floor(min(ay, by, cy))))
        bottom = min(height, int(np.ceil(max(ay, by, cy))))
        for row in range(top, bottom):
            y = row + 0.5
            for column in range(left, right):
                x = column + 0.5
                least, touches = np.inf, True
                for edge in range(3):
                    px, py = uv[face, edge, 0], uv[face, edge, 1]
                    qx, qy = uv[face, (edge + 1) % 3, 0], uv[face, (edge + 1) % 3, 1]
                    ex, ey = qx - px, qy - py
                    length = np.sqrt(ex * ex + ey * ey)
                    inward = side * (ex * (y - py) - ey * (x - px)) / length
                    least = min(least, inward)
                    touches &= inward + 0.5 * (abs(ex) + abs(ey)) / length > STRICTLY
                if not touches:
                    continue
                if least > STRICTLY:
                    square = INSIDE
                    if distance[row, column] == INSIDE:
                        if overlap[0] == 0:
                            overlap[1], overlap[2] = prim_of[row, column], face
                        overlap[0] += 1
                elif least >= 0.0:
                    square = 0.0
                else:
                    square = min(
                        _square_to_edge(x, y, ax, ay, bx, by),
                        _square_to_edge(x, y, bx, by, cx, cy),
                        _square_to_edge(x, y, cx, cy, ax, ay),
                    )
                if square < distance[row, column]:
                    distance[row, column] = square
                    prim_of[row, column] = face


@kernel
def mark_shown(hits, eye, vertices, faces, uv, shown):  # type: ignore[no-untyped-def]
    """Mark the texels whose front pixels show.

    hits: prim_id, u and v, (H, W) uint32, float32, float32. eye: (4,) float64, its position and 1, or the direction to
    it and 0. vertices: (V, 3) float32. faces: (F, 3) uint32. uv: (F, 3, 2) float64, corners in texels, NaN without a
    place. shown: (h, w) bool, set where shown.
    """
    prim_id, u, v = hits
    height, width = shown.shape
    last, is_front = MISS, False
    for y in range(prim_id.shape[0]):
        for x in range(prim_id.shape[1]):
            face = prim_id[y, x]
            if face != last:
                last, is_front = face, face != MISS and _is_front(eye, corners_of(vertices, faces, face))
            if not is_front:
                continue
            ax, ay, bx, by, cx, cy = edges_of(uv, face)
            place_x = ax + u[y, x] * bx + v[y, x] * cx
            place_y = ay + u[y, x] * by + v[y, x] * cy
            if place_x > -1.0 and place_y > -1.0:  # false for NaN
                shown[min(max(np.int64(place_y), 0), height - 1), min(max(np.int64(place_x), 0), width - 1)] = True


@njit
def _is_front(eye, corners):  # type: ignore[no-untyped-def]
    """Whether the eye sees a triangle's front."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
    x, y, z = eye[0] - eye[3] * ax, eye[1] - eye[3] * ay, eye[2] - eye[3] * az
    bx, by, bz, cx, cy, cz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    return x * (by * cz - bz * cy) + y * (bz * cx - bx * cz) + z * (bx * cy - by * cx) > 0.0


@njit
def edges_of(uv, face):  # type: ignore[no-untyped-def]
    """A triangle's first corner, and its edges from there to the second and third, in texels."""
    ax, ay = uv[face, 0, 0], uv[face, 0, 1]
    return ax, ay, uv[face, 1, 0] - ax, uv[face, 1, 1] - ay, uv[face, 2, 0] - ax, uv[face, 2, 1] - ay


@njit(error_model="numpy")
def slopes_of(edges):  # type: ignore[no-untyped-def]
    """Reciprocals for `weights_at`: of twice the triangle's area, and of each side's squared length."""
    _, _, bx, by, cx, cy = edges
    dx, dy = cx - bx, cy - by
    return 1.0 / (bx * cy - by * cx), 1.0 / (bx * bx + by * by), 1.0 / (cx * cx + cy * cy), 1.0 / (dx * dx + dy * dy)


@njit(error_model="numpy")
def weights_at(edges, slopes, x, y):  # type: ignore[no-untyped-def]
    """Barycentric weights (v, w) of the point of the triangle nearest to (x, y).

    Without branches, which small triangles make unpredictable, and without divisions. Source: C. Ericson, "Real-Time
    Collision Detection", 2005, section 5.1.5, in two dimensions.
    """
    ax, ay, bx, by, cx, cy = edges
    per_area, per_b, per_c, per_d = slopes
    px, py = x - ax, y - ay
    v, w = (px * cy - py * cx) * per_area, (bx * py - by * px) * per_area
    along_b = min(1.0, max(0.0, (px * bx + py * by) * per_b))
    along_c = min(1.0, max(0.0, (px * cx + py * cy) * per_c))
    dx, dy = cx - bx, cy - by
    along_d = min(1.0, max(0.0, ((px - bx) * dx + (py - by) * dy) * per_d))
    to_b = (px - along_b * bx) ** 2 + (py - along_b * by) ** 2
    to_c = (px - along_c * cx) ** 2 + (py - along_c * cy) ** 2
    to_d = (px - bx - along_d * dx) ** 2 + (py - by - along_d * dy) ** 2
    is_inside = (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0)
    on_b, on_c = (to_b <= to_c) & (to_b <= to_d), to_c <= to_d
    nearest_v = along_b if on_b else (0.0 if on_c else 1.0 - along_d)
    nearest_w = 0.0 if on_b else (along_c if on_c else along_d)
    return v if is_inside else nearest_v, w if is_inside else nearest_w


@njit
def _corner(vertices, corner):  # type: ignore[no-untyped-def]
    return np.float64(vertices[corner, 0]), np.float64(vertices[corner, 1]), np.float64(vertices[corner, 2])


@njit
def corners_of(vertices, faces, face):  # type: ignore[no-untyped-def]
    """(x, y, z) float64 of each corner of a triangle."""
    return _corner(vertices, faces[face, 0]), _corner(vertices, faces[face, 1]), _corner(vertices, faces[face, 2])


@njit(error_model="numpy")
def point_at(corners, v, w, inset):  # type: ignore[no-untyped-def]
    """(x, y, z) float64 of barycentric weights, moved by the length `inset` towards the triangle's middle."""
    a, b, c = corners
    u = 1.0 - v - w
    x = u * a[0] + v * b[0] + w * c[0]
    y = u * a[1] + v * b[1] + w * c[1]
    z = u * a[2] + v * b[2] + w * c[2]
    dx = (a[0] + b[0] + c[0]) / 3.0 - x
    dy = (a[1] + b[1] + c[1]) / 3.0 - y
    dz = (a[2] + b[2] + c[2]) / 3.0 - z
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    share = min(0.5, inset / length) if length > 0.0 else 0.0
    return x + share * dx, y + share * dy, z + share * dz


@kernel
def place_texels(uv, vertices, faces, normals, texels, width, prim_of, positions, texel_normals):  # type: ignore[no-untyped-def]
    """The point of each texel's triangle nearest to the texel's centre, and the normal there.

    texels: (N,) int64, numbers on the map. prim_of: (N,) int32. positions, texel_normals: (N, 3) float32, written.
    """
    for n in range(len(texels)):
        face = prim_of[n]
        edges = edges_of(uv, face)
        v, w = weights_at(edges, slopes_of(edges), texels[n] % width + 0.5, texels[n] // width + 0.5)
        x, y, z = point_at(corners_of(vertices, faces, face), v, w, 0.0)
        positions[n, 0], positions[n, 1], positions[n, 2] = x, y, z
        for axis in range(3):
            texel_normals[n, axis] = normals[face, axis]
