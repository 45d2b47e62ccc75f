"""`python -m tests.raster.random_views SCENE FIRST COUNT`: the rasteriser in random views against the oracle.

Prints the views with wrong pixels, and how many views and wrong pixels there were. ATRA_SCENES: the scenes' folder. The
oracle examines every pixel in which the rasteriser and packets of rays disagree.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

import atra
from atra.judge.oracle import examine


def random_view(mesh, seed, parallel=None):
    """A view of 256 x 256 pixels; half of them from a surface, and half with parallel rays unless `parallel` says."""
    random = np.random.default_rng(seed)
    low, high = mesh.bounds
    size = high - low
    if random.random() < 0.5:
        corners = mesh.triangles(np.array([random.integers(mesh.triangle_count)]))[0].astype(float)
        eye = random.dirichlet(np.ones(3)) @ corners
    else:
        eye = low + random.random(3) * size
        if random.random() < 0.3:
            eye = low + (random.random(3) * 3 - 1) * size
    target = eye + random.normal(size=3) if random.random() < 0.5 else low + random.random(3) * size
    up = random.normal(size=3)
    is_parallel = random.random() < 0.5 if parallel is None else parallel
    pose = tuple(eye), tuple(target), tuple(up)
    if is_parallel:
        view_height = float(size.max() * np.exp(random.uniform(-4, 0.3)))
        return atra.OrthographicCamera(*pose, view_height=view_height, width=256, height=256)
    return atra.Camera(*pose, random.uniform(20, 120), 256, 256)


def main(scene, first, count):
    mesh, tracers, wrong, views = atra.load_mesh(Path(os.environ["ATRA_SCENES"]) / f"{scene}.ply"), {}, 0, 0
    for seed in range(first, first + count):
        camera, images = random_view(mesh, seed), []
        for make in (atra.RasterTracer, atra.PixelTracer):
            key = make, camera.is_parallel
            if key in tracers:
                tracers[key].look(camera)
            else:
                tracers[key] = make(mesh, camera, threads=1)
            images.append(tracers[key].trace())
        found = examine(mesh, camera, *images, atra.compare(mesh, camera, *images))
        pixels = int(found.hits.wrong.sum())
        wrong, views = wrong + pixels, views + 1
        if pixels:
            print(f"{scene}, seed {seed}: {pixels} wrong", flush=True)
    print(f"{scene}: {views} views, {wrong} wrong pixels")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
