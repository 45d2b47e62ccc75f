"""What rays of one direction from a tile of texels may meet."""

from __future__ import annotations

import numpy as np

from atra.kernels.caching import kernel


@kernel
def carry_into_tile(vertices, faces, onto, origin, shift, half, moved, kept, used):  # type: ignore[no-untyped-def]
    """Carry vertices onto a tile's own axes, and say which triangles reach into its square, in front of it.

    vertices: (V, 3) float32, faces: (F, 3) uint32. onto: (3, 3) float64; a vertex becomes onto (vertex - origin) -
    shift. half: of the square's side, about (0, 0). moved: (V, 3) float64, written. kept: (F,) bool, written, and used:
    (V,) bool, False at first, of the corners of those triangles.
    """
    for vertex in range(len(vertices)):
        x, y, z = vertices[vertex, 0] - origin[0], vertices[vertex, 1] - origin[1], vertices[vertex, 2] - origin[2]
        for axis in range(3):
            moved[vertex, axis] = onto[axis, 0] * x + onto[axis, 1] * y + onto[axis, 2] * z - shift[axis]
    for face in range(len(faces)):
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        kept[face] = max(moved[a, 2], moved[b, 2], moved[c, 2]) > np.float64(0.0)
        for axis in range(2):
            low = min(moved[a, axis], moved[b, axis], moved[c, axis])
            high = max(moved[a, axis], moved[b, axis], moved[c, axis])
            kept[face] &= (high > -half) & (low < half)
        if kept[face]:
            used[a] = used[b] = used[c] = True
