"""Orthographic views whose image plane passes through the mesh: no method shows a wrong depth near the plane.

Float32 is finest at the eye. A copy is translated away from there, as far as the image is large, and what that does to
a corner is much of a depth of almost 0.
"""

import numpy as np
import pytest

import atra
from atra.alignment import rounding
from tests.images import make_tracer
from tests.meshes import quads, random_triangles

SIZE = {"width": 64, "height": 48}
SPLITS = ((1, 1), (16, 1), (64, 1), (8, 6), (1, 16))
COPIES = ("aligned", "unculled", "instanced", "frames")


def view(seed):
    """A view from within the triangles of `mesh`, covering from half as much as they do to 50 times that."""
    random = np.random.default_rng([32, seed])
    eye, forward = random.normal(size=3) * 0.3, random.normal(size=3)
    if seed % 3 == 0:
        forward = np.eye(3)[random.integers(3)] * random.choice([-1, 1])
    up, height = tuple(random.normal(size=3)), float(random.choice([1.0, 5.0, 20.0, 100.0]))
    return atra.OrthographicCamera(tuple(eye), tuple(eye + forward), up, height, **SIZE)


def mesh(seed):
    return random_triangles(3000, seed, size=0.1, spread=1.0)


def tracer(method, of, camera, seed):
    split = SPLITS[seed % len(SPLITS)]
    if method == "frames":
        other = atra.OrthographicCamera(camera.target, camera.eye, camera.up, 1.3 * camera.view_height, **SIZE)
        alignment = atra.Alignment.of_frames([camera, other], atra.Split.of_image(split, camera))
        return atra.FramesTracer(of, alignment, threads=1)
    if method == "raster":
        return atra.RasterTracer(of, camera, threads=1)
    return make_tracer(method, of, camera, split)


def pixels_wrong(method, seed):
    of, camera = mesh(seed), view(seed)
    offset = tuple(np.random.default_rng([seed, 1]).random(2).tolist())
    with tracer(method, of, camera, seed) as one:
        images = one.trace(offset).images
    wrong = 0
    for hits in images:
        with atra.PixelTracer(of, hits.camera, packet_width=1, threads=1) as single:
            wrong += atra.compare(hits, single.trace(offset)).pixels_wrong
    return wrong


@pytest.mark.parametrize("method", COPIES)
def test_what_a_translation_would_make_inexact_is_traced_where_it_is(method, monkeypatch):
    seeds = (17, 43)
    assert [pixels_wrong(method, seed) for seed in seeds] == [0, 0]
    for multiple in ("COPY_MULTIPLE", "INSTANCE_MULTIPLE"):
        monkeypatch.setattr(rounding, multiple, np.inf)
    assert sum(pixels_wrong(method, seed) for seed in seeds) > 0  # the views are such that it matters


@pytest.mark.parametrize("method", ["aligned", "instanced"])
def test_all_hits_are_gathered_once_where_some_triangles_have_no_copies(method):
    of, camera = mesh(43), view(43)
    with tracer(method, of, camera, 1) as one, atra.RasterTracer(of, camera, threads=1) as drawn:
        assert one.counters["triangles_left_out"] > 0
        np.testing.assert_array_equal(one.gather(atra.Count()).count, drawn.gather(atra.Count()).count)


def test_nothing_is_left_out_where_the_image_plane_lies_before_the_mesh():
    of = mesh(0)
    sun = atra.OrthographicCamera.of_light((0.5, -1, -0.35), of.bounds, **SIZE)
    with tracer("aligned", of, sun, 1) as one:
        assert one.counters["triangles_left_out"] == 0


def test_walls_along_the_rays_keep_their_copies():
    walls = quads([[(x, 0, 0), (x, 2, 0), (x, 2, 2), (x, 0, 2)] for x in (-0.3, 0.0, 0.4)])
    above = atra.OrthographicCamera((0, 1, 1), (0, 0, 1), (0, 0, 1), 4.0, **SIZE)
    with tracer("aligned", walls, above, 1) as one:
        assert not one.trace().hit.any()
        assert one.counters["triangles_left_out"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("method", ["pixels", *COPIES, "raster"])
def test_no_pixel_of_300_views_is_wrong(method):
    wrong = {seed: pixels_wrong(method, seed) for seed in range(300)}
    assert {seed: pixels for seed, pixels in wrong.items() if pixels} == {}
