"""Where float32 cannot tell which of two triangles is nearer, the image is that of the oracle all the same."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

import atra
from experiments.workloads.agreement.oracle import examine
from tests.images import draw
from tests.judge.reference import brute_force
from tests.lenses import lens_camera
from tests.meshes import EYE_AT_ORIGIN, cornell_box, joined, quads

FOUND = {
    "cornell_box": (11, 66, 200, 207, 535, 555),
    "sponza": (183, 233, 280, 300, 330, 333, 348, 356, 526, 900),
}
"""Seeds of views, of sponza with parallel rays, in which pixels were wrong."""


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


def wrong_pixels(mesh, camera):
    hits, reference = draw(mesh, camera, ties="any"), brute_force(mesh, camera)
    return int(examine(hits, reference).hits_wrong.sum())


@pytest.mark.parametrize("size", [1.0, 0.03])
@pytest.mark.parametrize(
    "camera",
    [
        atra.Camera(**EYE_AT_ORIGIN, width=48, height=32, fov_y_degrees=60),
        atra.OrthographicCamera(**EYE_AT_ORIGIN, width=48, height=32, view_height=3.0),
        lens_camera(atra.OpenCVLens(k1=-0.3, k2=0.08), atra.Camera(**EYE_AT_ORIGIN), 48, 32),
        lens_camera(atra.EquirectangularLens(), atra.Camera(**EYE_AT_ORIGIN), 48, 32),
    ],
    ids=["pinhole", "parallel", "barrel", "panorama"],
)
def test_walls_that_cross_within_a_unit_of_float32_are_told_apart(camera, size):
    """Wide triangles and narrow ones, whichever is drawn first; corners differ in the last digit of float32."""
    steps = np.arange(-2.0, 2.0, 4.0 * size)
    one, unit = [], 2.0**-21
    for x in steps if size < 1.0 else (-2.0,):
        for y in steps[::8] if size < 1.0 else (-2.0,):
            w = 4.0 * size
            one.append([(x, y, 4), (x + w, y, 4), (x + w, y + w, 4), (x, y + w, 4)])
    other = [[(a, b, c + unit * (k % 2 * 2 - 1)) for k, (a, b, c) in enumerate(quad)] for quad in one]
    for walls in ((one, other), (other, one)):
        assert wrong_pixels(joined(*map(quads, walls)), camera) == 0


def test_an_eye_on_an_edge_or_a_corner_to_its_last_digit_sees_what_the_oracle_sees():
    """Triangles far smaller than the eye's coordinates: the eye is rounded by more than their own size says."""
    random = np.random.default_rng(5)
    for seed in range(40):
        fan = (np.array([1.0, 0.75, 0.44]) + random.normal(size=(3, 3)) * 1e-3).astype(np.float32).astype(float)
        weights = (random.random(), 0.0) if seed % 2 else (1.0, 0.0)
        eye = fan[0] + weights[0] * (fan[1] - fan[0]) + random.integers(-1, 2, 3) * (seed % 4 == 0) * 2.0**-52
        corners = np.roll(fan, seed, axis=0)
        mesh = joined(atra.Mesh(corners, [[0, 1, 2]]), cornell_box())
        camera = atra.Camera(tuple(eye), tuple(fan[2] + random.normal(size=3) * 2e-4), (0.1, 1, 0.2), 90, 24, 16)
        assert wrong_pixels(mesh, camera) == 0, seed


def test_parallel_rays_see_what_lies_before_the_eye_by_less_than_a_unit_of_its_farthest_corner():
    mesh = atra.Mesh([(-4, -4, -4), (4, -4, 4), (4, 4, 4), (-4, 4, -4)], [[0, 1, 2], [0, 2, 3]])
    for shift in (1e-6, -1e-6):
        eye = atra.OrthographicCamera((0, 0, -shift), (0, 0, 1), (0, 1, 0), view_height=8.0, width=33, height=32)
        assert wrong_pixels(mesh, eye) == 0
        assert draw(mesh, eye).hit[:, 16].all() == (shift > 0)


@pytest.mark.slow
@pytest.mark.skipif("ATRA_SCENES" not in os.environ, reason="needs the scenes")
@pytest.mark.parametrize("scene", FOUND)
def test_views_that_had_wrong_pixels_have_none(scene):
    folder = Path(os.environ["ATRA_SCENES"])
    assert scene in json.loads((folder / "cameras.json").read_text())
    mesh = atra.load_mesh(folder / f"{scene}.ply")
    for seed in FOUND[scene]:
        camera = random_view(mesh, seed, True if scene == "sponza" else None)
        hits = draw(mesh, camera)
        with atra.PixelTracer(mesh, camera, threads=1) as tracer:
            reference = tracer.trace()
        found = examine(hits, reference)
        assert not found.hits_wrong.any()
