"""Rays of a path-traced picture, as batches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.embree.packets_kernels import START
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.light.emitters.tables import emitters_of
from atra.light.pictures.film import Film, pixels_of
from atra.light.tables import surfaces_of
from atra.raster.tracer import RasterTracer
from atra.rays.rays import Rays
from atra.rays.scene import RayScene
from atra.views.sampling import sub_pixel_offsets
from experiments.classification.workload.path_rays_kernels import PATH_ROWS, bounce_paths, start_paths
from scenes.lit.lighting import lit

PATH_KINDS = ("bounce", "shadow")
"""Rays of paths after the first: those that surfaces scatter, and those aimed at lights."""

_MOST_BOUNCES = 4
"""Surfaces from which paths go on, as by default in `PathRenderer`."""


def path_rays(kind: str, name: str, mesh: Mesh, camera: Camera, threads: int | None) -> Rays:
    """All rays of one of `PATH_KINDS` in one sample of the scene called `name` in its light; the same for everyone.

    Those of the first bounce come first, in the order of pixels, then those of the second. Surfaces stop them, those of
    clear glass, too.
    """
    scene, (x, y) = lit(name, mesh, camera), sub_pixel_offsets(1)[0].tolist()
    with RasterTracer(mesh, camera, threads=threads) as tracer:
        hits = tracer.trace((x, y))
    _, own_camera = own_space(mesh, camera)
    film = Film((1, camera.width, camera.height))
    paths = np.empty((PATH_ROWS, len(film.places)), np.float32)
    prim_id, pixel = np.empty(paths.shape[1], np.uint32), np.arange(paths.shape[1], dtype=np.int32)
    start_paths(pixels_of(own_camera, film, (x, y), hits), paths, prim_id)
    tables = surfaces_of(scene, scene.sky.power), emitters_of(scene)
    batches: dict[str, list[Rays]] = {kind: [] for kind in PATH_KINDS}
    with RayScene(mesh, threads=threads) as rays_scene:
        for bounce in range(_MOST_BOUNCES):
            aimed, lengths, goes_on = np.empty_like(paths), np.empty(len(pixel), np.float32), np.empty(len(pixel), bool)
            bounce_paths(paths, prim_id, pixel, bounce, *tables, aimed, lengths, goes_on)
            chosen = lengths > 0.0
            batches["shadow"].append(_rays(aimed[:, chosen], lengths[chosen]))
            paths, pixel = paths[:, goes_on], pixel[goes_on]
            batches["bounce"].append(_rays(paths))
            prim_id = rays_scene.intersect(batches["bounce"][-1]).prim_id
    fields = ("origins", "directions", "tnear", "tfar")
    return Rays(*(np.concatenate([getattr(batch, field) for batch in batches[kind]]) for field in fields))


def _rays(rows: NDArray[np.float32], lengths: NDArray[np.float32] | None = None) -> Rays:
    near = np.full(rows.shape[1], START)
    return Rays(rows[:3].T, rows[3:].T, near, np.full_like(near, np.inf) if lengths is None else lengths)
