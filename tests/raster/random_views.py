"""`python -m tests.raster.random_views SCENE FIRST COUNT`: the rasteriser in random views against the oracle.

Prints the views with wrong pixels, and how many views and wrong pixels there were. ATRA_SCENES: the scenes' folder. The
oracle examines every pixel in which the rasteriser and packets of rays disagree, and a sample of all. Packets may see
the surface that the eye lies on in every pixel, which the oracle denies; in such a view all triangles are tested in a
sample of those pixels only, and in the others the triangles of both images.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

import atra
from experiments.workloads.agreement import oracle

SAMPLE = 200
"""Pixels of the sample of all."""

MOST_TESTS = 1e9
"""Rays times triangles that are tested in a view at most, the sample not counted."""


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


def wrong_pixels(mesh, camera, hits, reference, seed):
    """How many pixels of `hits` are wrong, and whether all triangles were tested in each of those in dispute."""
    agreement = atra.compare(hits, reference)
    disputed = np.flatnonzero(agreement.verdict.reshape(-1) != atra.Verdict.EQUAL)
    most = int(MOST_TESTS / mesh.triangle_count)
    tested = np.random.default_rng(seed).permutation(disputed)[:most]
    sample = np.concatenate([oracle.sample_pixels(camera, SAMPLE, [seed]), tested])
    found = oracle.examine(mesh, camera, hits, reference, agreement, sample)
    return int(found.hits.wrong.sum()), len(disputed) <= most


def main(scene, first, count):
    mesh, tracers, wrong, sampled = atra.load_mesh(Path(os.environ["ATRA_SCENES"]) / f"{scene}.ply"), {}, 0, 0
    oracle.EXHAUSTIVE_TESTS = 0  # all triangles are tested in the sample alone
    for seed in range(first, first + count):
        camera, images = random_view(mesh, seed), []
        for make in (atra.RasterTracer, atra.PixelTracer):
            key = make, camera.is_parallel
            if key in tracers:
                tracers[key].look(camera)
            else:
                tracers[key] = make(mesh, camera, threads=1)
            images.append(tracers[key].trace())
        pixels, is_whole = wrong_pixels(mesh, camera, *images, seed)
        wrong, sampled = wrong + pixels, sampled + (not is_whole)
        if pixels:
            print(f"{scene}, seed {seed}: {pixels} wrong", flush=True)
        if (seed - first + 1) % 20 == 0 or seed == first + count - 1:
            print(f"{scene}: {seed - first + 1} views, {wrong} wrong pixels, {sampled} views sampled", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
