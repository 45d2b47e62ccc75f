"""Loops over rays and hits that translate between trimesh's arrays and a scene's."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import kernel

_NEAR = 4.0
"""Rays that start farther from the middle than this many sizes of the mesh are moved up to it, in float64."""

_FARTHEST = 1e9
"""Sizes of the mesh from which on float64 cannot tell what a ray hits, as rays are float32 near the mesh: moving them
up to it is off by a share of 1e-16 of the way."""

_ROUNDINGS = 2.0**-50
"""Largest error of a moved ray's start, as a share of the way; there are 5 roundings."""

_EDGE_ON = 1e-6
"""Cosine below which a location is taken from the ray's parameter, not from the triangle's plane."""


@kernel
def scale_rays(origins, directions, low, scale, size, placed, units, tfar, moved):  # type: ignore[no-untyped-def]
    """Write rays as a scene takes them; returns the first that starts too far away to tell whether it hits, or N. A ray
    that cannot be traced, or surely passes, gets an empty interval.

    origins, directions: (N, 3) float64; directions become unit vectors. low: (3,) float64, scale, size: of the scene.
    placed, units: (N, 3) float32. tfar: (N,) float32. moved: (N,) float64, how far the ray was moved along itself.
    """
    middle = 0.5 * size
    for ray in range(len(origins)):
        x, y, z = directions[ray, 0], directions[ray, 1], directions[ray, 2]
        largest = max(abs(x), abs(y), abs(z))
        ox, oy, oz = origins[ray, 0] - low[0], origins[ray, 1] - low[1], origins[ray, 2] - low[2]
        ox, oy, oz = ox * scale, oy * scale, oz * scale
        moved[ray], tfar[ray] = 0.0, -1.0
        placed[ray, 0], placed[ray, 1], placed[ray, 2] = 0.0, 0.0, 0.0
        units[ray, 0], units[ray, 1], units[ray, 2] = 0.0, 0.0, 1.0
        if not (0.0 < largest < np.inf and abs(x) + abs(y) + abs(z) < np.inf and abs(ox) + abs(oy) + abs(oz) < np.inf):
            continue
        x, y, z = x / largest, y / largest, z / largest
        inverse = 1.0 / np.sqrt(x * x + y * y + z * z)
        x, y, z = x * inverse, y * inverse, z * inverse
        directions[ray, 0], directions[ray, 1], directions[ray, 2] = x, y, z
        if max(abs(ox - middle), abs(oy - middle), abs(oz - middle)) > _NEAR * size:
            way = max((middle - ox) * x + (middle - oy) * y + (middle - oz) * z - 2.0 * size, 0.0)
            ox, oy, oz = ox + way * x, oy + way * y, oz + way * z
            moved[ray] = way / scale
            away = max(abs(ox - middle), abs(oy - middle), abs(oz - middle))
            if away > _NEAR * size + _ROUNDINGS * way:
                continue
            if way > _FARTHEST * size:
                return ray
        tfar[ray] = np.inf
        placed[ray, 0], placed[ray, 1], placed[ray, 2] = ox, oy, oz
        units[ray, 0], units[ray, 1], units[ray, 2] = x, y, z
    return len(origins)


@kernel
def locate_hits(origins, directions, index_ray, index_tri, t, corners, faces, normals, locations):  # type: ignore[no-untyped-def]
    """Write where rays meet the planes of triangles, (M, 3) float64.

    origins, directions: (N, 3) float64. t: (M,) float64, the parameter found, for triangles seen edge-on. corners:
    (V, 3) float64 and faces: (F, 3) int64, of the mesh. normals: (F, 3) float64.
    """
    for hit in range(len(t)):
        ray, face = index_ray[hit], index_tri[hit]
        facing, ahead = 0.0, 0.0
        for axis in range(3):
            facing += normals[face, axis] * directions[ray, axis]
            ahead += normals[face, axis] * (corners[faces[face, 0], axis] - origins[ray, axis])
        way = ahead / facing if abs(facing) > _EDGE_ON else t[hit]
        for axis in range(3):
            locations[hit, axis] = origins[ray, axis] + way * directions[ray, axis]
