"""Who answers: `RayScene` with each precision, Open3D, and trimesh with embreex.

Each is a function of a mesh that gives one of origins and directions, to (prim_ids, int64, -1 for a miss; t, in lengths
of the directions; whether the ray is occluded).
"""

from __future__ import annotations

from functools import partial
from importlib.util import find_spec

import numpy as np

import atra


def _ours(precision, mesh, vertices):
    scene = atra.RayScene(mesh, precision=precision, threads=1)

    def answer(origins, directions):
        found = scene.intersect(origins, directions)
        prim_ids = np.where(found.hit, found.prim_id.astype(np.int64), -1)
        return prim_ids, found.t, scene.occluded(origins, directions)

    return answer


def _open3d(mesh, vertices):
    import open3d

    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(vertices.astype(np.float32), mesh.faces.astype(np.uint32))

    def answer(origins, directions):
        rays = open3d.core.Tensor(np.concatenate([origins, directions], axis=1).astype(np.float32))
        found = scene.cast_rays(rays)
        named = found["primitive_ids"].numpy()
        prim_ids = np.where(named == scene.INVALID_ID, -1, named.astype(np.int64))
        return prim_ids, found["t_hit"].numpy(), scene.test_occlusions(rays).numpy()

    return answer


def _trimesh(mesh, vertices):
    import trimesh

    other = trimesh.Trimesh(vertices, mesh.faces.astype(np.int64), process=False, validate=False)

    def answer(origins, directions):
        o, d = origins.astype(np.float64), directions.astype(np.float64)
        places, of_ray, named = other.ray.intersects_location(o, d, multiple_hits=False)
        prim_ids, t = np.full(len(o), -1), np.full(len(o), np.inf)
        prim_ids[of_ray] = named
        t[of_ray] = ((places - o[of_ray]) * d[of_ray]).sum(axis=1) / (d[of_ray] ** 2).sum(axis=1)
        return prim_ids, t, other.ray.intersects_any(o, d)

    return answer


LIBRARIES = {precision: partial(_ours, precision) for precision in ("exact", "watertight", "fast")}
LIBRARIES |= {name: make for name, make in (("open3d", _open3d), ("trimesh", _trimesh)) if find_spec(name)}
