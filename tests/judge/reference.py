"""The reference: the nearest hit of every pixel in float64, slow and simple, for comparison with all methods."""

from __future__ import annotations

import numpy as np

from atra.exact.intersection import FLOAT64_TOLERANCE, divided, triangles_in_camera_space, volumes_of
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View
from atra.hits import Hits
from atra.prim_ids import MISS


def brute_force(mesh: Mesh, camera: View, offset: tuple[float, float] = (0.5, 0.5)) -> Hits:
    """The nearest hit of every pixel, found by testing every triangle with every ray in float64.

    Edges belong to the triangle; of triangles at the same depth the lowest `prim_id` wins; a hit has depth > 0. Both
    rules have a tolerance of 1e-12, so that rounding opens no gap along a shared edge.
    """
    own_mesh, own_camera = own_space(mesh, camera)
    y, x = np.divmod(np.arange(camera.width * camera.height), camera.width)
    origins, directions = camera.rays(x, y, offset)
    # What all rays share is passed once.
    origins, directions = (origins, directions[0]) if camera.is_parallel else (origins[0], directions)
    corner, edge_1, edge_2 = triangles_in_camera_space(own_mesh, own_camera, np.arange(mesh.triangle_count))
    depth = np.full(len(x), np.inf)
    prim_id = np.full(len(x), MISS, np.uint32)
    for i in range(mesh.triangle_count):
        found = divided(volumes_of(origins, directions, corner[i], edge_1[i], edge_2[i], own_camera.eye))
        inside = (found.edge_distance >= -FLOAT64_TOLERANCE) & (found.depth > 0.0)
        nearer = inside & (found.depth < depth * (1.0 - FLOAT64_TOLERANCE))
        depth[nearer] = found.depth[nearer]
        prim_id[nearer] = i
    shape = (camera.height, camera.width)
    return Hits(depth.astype(np.float32).reshape(shape), prim_id.reshape(shape), offset, mesh, camera)
