"""`python -m tests.alignment.many_views [VIEWS] [FOLDER]`: whole images of the paper's scenes against brute force.

Draws VIEWS views (10 by default) of a million pixels of each scene of ATRA_SCENES with every method, and judges the
pixels in which two methods name different triangles: each ray is tested with every triangle in float64, and what is
called farther is confirmed in fractions. Prints a row per scene and method. FOLDER: where the images are kept.

farther: pixels that name a triangle behind the nearest one by less than ROUNDING of the depth. beside: pixels that name
a triangle that the ray passes by. holes: a miss, or a triangle far behind, in front of which the ray hits another.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np

import atra
from atra.exact.intersection import Pairs
from atra.exact.ties import TIE_TOLERANCE
from atra.prim_ids import MISS
from experiments.workloads.agreement.brute_force_kernels import SLACK
from experiments.workloads.agreement.oracle import nearest_hits
from scenes.directory import load_scene_from_directory
from tests.rays.near_whole_numbers import hits_without_rounding

SCENES = ("cornell_box", "mitsuba", "fireplace_room", "sponza")

METHODS = {
    "raster": (atra.RasterTracer, {}),
    "packets": (atra.PixelTracer, {}),
    "aligned 16 x 16": (atra.AlignedTracer, {"split": (16, 16)}),
    "aligned 256 x 1": (atra.AlignedTracer, {"split": (256, 1)}),
    "instanced 16 x 16": (atra.AlignedTracer, {"split": (16, 16), "geometry": "instanced", "culling": False}),
    "visible-first 256 x 1": (atra.VisibleFirstTracer, {"split": (256, 1)}),
}

ROUNDING = 1e-3
"""Largest share of its depth by which float32 shows a triangle farther than it is; a farther one is in a hole."""

KINDS = ("right", "tied", "farther", "beside", "holes")


def views_of(scene, count):
    """The scene's own camera, then as many near it as anywhere in the scene's box."""
    random = np.random.default_rng(60)
    low, high = scene.mesh.bounds
    size, own = high - low, atra.Camera(**scene.camera, width=1024, height=1024)
    yield own
    for view in range(1, count):
        eye, target = np.array(own.eye), np.array(own.target)
        if view % 2:
            eye = eye + random.uniform(-0.1, 0.1, 3) * size
            target = target + random.uniform(-0.3, 0.3, 3) * np.linalg.norm(target - eye)
        else:
            eye, target = low + random.uniform(0.1, 0.9, 3) * size, low + random.uniform(0, 1, 3) * size
        fov_y_degrees = random.uniform(30, 80)
        yield atra.Camera(tuple(eye), tuple(target), (0, 1, 0), fov_y_degrees, width=1024, height=1024)


def kinds_of(mesh, camera, x, y, prim_id, truth):
    """What each pixel (x, y) that names `prim_id` is, of KINDS; (N,) indices."""
    named = prim_id != MISS
    depth, inside = np.full(len(x), np.inf), np.zeros(len(x), bool)
    met = Pairs(mesh, camera, x[named], y[named], prim_id[named], (0.5, 0.5)).intersections
    depth[named], inside[named] = met.depth, met.edge_distance >= -SLACK
    with np.errstate(invalid="ignore"):
        behind = depth / truth.depth - 1.0
    found = np.select(
        [prim_id == truth.prim_id, inside & (np.abs(behind) <= TIE_TOLERANCE), named & ~inside, behind <= ROUNDING],
        [0, 1, 3, 2],
        4,
    )
    origins, directions = (side @ camera.axes for side in camera.rays(x, y, (0.5, 0.5)))
    for pixel in np.flatnonzero(found == 2):
        pair = np.sort([truth.prim_id[pixel], prim_id[pixel]])
        two = atra.Mesh(mesh.vertices, mesh.faces[pair])
        nearest = hits_without_rounding(two, origins[pixel] + camera.eye, directions[pixel])
        found[pixel] = 2 if nearest and pair[nearest[0][1]] == truth.prim_id[pixel] else 1
    return found


def main(views=10, folder=None):
    print("scene,method,disputed," + ",".join(KINDS))
    for name in SCENES:
        scene = load_scene_from_directory(name)
        counts = {method: Counter() for method in METHODS}
        total = 0
        for number, camera in enumerate(views_of(scene, int(views))):
            images = {}
            for method, (kind, options) in METHODS.items():
                with kind(scene.mesh, camera, threads=1, **options) as tracer:
                    images[method] = tracer.trace()
                if folder is not None:
                    hits, place = images[method], Path(folder) / f"{name} {number} {method}.npz"
                    np.savez(place, depth=hits.depth, prim_id=hits.prim_id)
            prim_ids = np.stack([hits.prim_id for hits in images.values()])
            y, x = np.nonzero((prim_ids != prim_ids[0]).any(axis=0))
            truth = nearest_hits(scene.mesh, camera, x, y, threads=1)
            total += len(x)
            for method, hits in images.items():
                kinds = kinds_of(scene.mesh, camera, x, y, hits.prim_id[y, x], truth)
                counts[method].update(KINDS[kind] for kind in kinds)
        for method, counted in counts.items():
            print(name, method, total, *(counted[kind] for kind in KINDS), sep=",", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
