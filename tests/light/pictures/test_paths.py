"""Path tracing against closed forms: furnaces, mirrors, glass, lamps; the same bits however the work is shared out."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import atra
from atra import light
from tests.meshes import random_triangles
from tests.shown import batches, down, floor, rectangles, sphere, traced

WHITE_SKY = light.constant_sky(1.0)
WALL = [(0, 0, 50), (0, 50, 50), (0, 50, -50), (0, 0, -50)]
AT_BALL = atra.Camera((0, 0, 4), (0, 0, 0), fov_y_degrees=40, width=16, height=16)


CLEAR = [
    light.Lambertian(1.0), light.Metal(1.0), light.Dielectric(1.5), light.Dielectric(1.5, "schlick"),
    light.Dielectric(0.7), light.MetallicRoughness(roughness=0.0, transmission=1.0),
]  # fmt: skip


@pytest.mark.parametrize("material", CLEAR)
def test_in_a_furnace_a_ball_that_absorbs_nothing_cannot_be_seen(material):
    shapes = [(True, 24, 999), (False, 24, 999)]
    if material in CLEAR[:2]:
        shapes.append((True, 8, 1))  # one bounce, and out: no shading normal sends light into the ball
    for smooth, segments, bounces in shapes:
        image = traced(sphere(material, WHITE_SKY, smooth, segments), AT_BALL, 8, bounces=bounces)
        np.testing.assert_allclose(image, 1.0, atol=1e-4)


def test_a_white_floor_sees_the_sky_by_the_cosine():
    sky = light.GradientSky((0, 0, 0), (1, 1, 1))  # (1 + y) / 2, where the mean of y, by the cosine, is 2 / 3
    scene = rectangles((floor(), light.Lambertian(1.0)), sky=sky)
    assert abs(traced(scene, down(8), 256, bounces=1).mean() - 5 / 6) < 0.01


def test_the_depth_counts_rays():
    scene = rectangles((floor(), light.Lambertian(0.5)), sky=WHITE_SKY)
    assert (traced(scene, down(4), 2, bounces=0) == 0).all()
    np.testing.assert_allclose(traced(scene, down(4), 2, bounces=1), 0.5)


def test_a_mirror_shows_the_sky_where_the_mirrored_ray_points():
    sky = light.GradientSky((0.0, 0.25, 1.0), (1.0, 0.5, 0.0))
    scene = rectangles((floor(), light.Metal((0.5, 1.0, 0.25))), sky=sky)
    camera = down(16, fov=90)
    image = traced(scene, camera, 1, bounces=1)
    y, x = np.mgrid[:16, :16]
    directions = camera.rays(x, y)[1] @ camera.axes
    up = 0.5 - 0.5 * directions[..., 1] / np.linalg.norm(directions, axis=-1)
    expected = (1 - up[..., None]) * np.array(sky.below) + up[..., None] * np.array(sky.above)
    np.testing.assert_allclose(image, expected * [0.5, 1.0, 0.25], rtol=1e-5)


def test_two_mirrors_in_a_row_multiply():
    mirrors = (floor(), light.Metal((0.5, 1.0, 0.75))), (WALL, light.Metal((0.25, 0.5, 1.0)))
    scene = rectangles(*mirrors, sky=WHITE_SKY)
    camera = atra.OrthographicCamera((3, 2, 0), (1, 0, 0), (0, 0, 1), 0.5, 4, 4)
    image = traced(scene, camera, 1)  # to the floor, the wall and the sky
    np.testing.assert_allclose(image, np.broadcast_to([0.125, 0.5, 0.75], (4, 4, 3)))


def reflectance(cosine, ior, fresnel="exact"):
    if fresnel == "schlick":
        least = ((1 - ior) / (1 + ior)) ** 2
        return least + (1 - least) * (1 - cosine) ** 5
    inner = np.sqrt(1 - (1 - cosine**2) / ior**2)
    across, within = (cosine - ior * inner) / (cosine + ior * inner), (ior * cosine - inner) / (ior * cosine + inner)
    return (across**2 + within**2) / 2


@pytest.mark.parametrize("degrees", [0.0, 60.0])
def test_a_slab_of_glass_passes_what_fresnel_s_equations_leave(degrees):
    glass = light.Dielectric(1.5)
    scene = rectangles((floor(30), glass), (floor(30, -0.5)[::-1], glass), (floor(200, -2.0), light.Emissive()))
    tilt = np.radians(degrees)
    camera = atra.OrthographicCamera((0, 4, 0), (4 * np.tan(tilt), 0, 0), (0, 0, -1), 0.5, 8, 8)
    r = reflectance(np.cos(tilt), 1.5)
    image = batches(scene, camera, 16, 32, bounces=63)[..., 0]
    mean, error = image.mean(), image.mean((1, 2)).std(ddof=1) / 4
    assert abs(mean - (1 - r) / (1 + r)) < 4 * error  # 1 - 2 r / (1 + r): all orders of inner mirroring
    assert error < 0.01


@pytest.mark.parametrize("fresnel", ["exact", "schlick"])
def test_one_surface_of_glass_mirrors_what_fresnel_or_schlick_says(fresnel):
    # From above, what is mirrored sees the lamp, and what passes falls into the dark.
    scene = rectangles((floor(), light.Dielectric(1.5, fresnel)), (floor(200, 30.0)[::-1], light.Emissive()))
    for degrees in (0.0, 70.0):
        tilt = np.radians(degrees)
        camera = atra.OrthographicCamera((0, 1, 0), (np.tan(tilt), 0, 0), (0, 0, -1), 0.2, 8, 8)
        image = traced(scene, camera, 400, bounces=1)[..., 0]
        expected = reflectance(np.cos(tilt), 1.5, fresnel)
        assert abs(image.mean() - expected) < 4 * np.sqrt(expected / image.size / 400)


def test_fuzz_absorbs_what_falls_below_the_surface_and_blurs_the_rest():
    scene = rectangles((floor(), light.Metal(1.0, 0.9)), sky=WHITE_SKY)
    straight = traced(scene, down(8, fov=5), 64)
    np.testing.assert_allclose(straight, 1.0)  # a sphere of 0.9 around the tip of the normal lies above the surface
    grazing = atra.OrthographicCamera((0, 1, 0), (40, 0, 0), (0, 0, -1), 0.001, 8, 8)
    above = 0.5 + 0.5 / 0.9 / np.sqrt(1 + 40**2)  # of the sphere: a height is as likely as any other
    assert abs(traced(scene, grazing, 64).mean() - above) < 0.03


def busy(count=300):
    """Triangles of all materials about the origin."""
    mesh = random_triangles(count, 5, size=0.8)
    materials = [
        light.Lambertian((0.8, 0.6, 0.4)), light.Metal((0.9, 0.8, 0.7), 0.2), light.Dielectric(1.5),
        light.Emissive((3.0, 2.0, 1.0)), light.Lambertian((0.2, 0.4, 0.9)),
    ]  # fmt: skip
    return light.Scene(mesh, materials, np.arange(count) % 5, lights=[light.Sun((0.3, -1, 0.2), 2.0)])


BUSY_CAMERA = atra.Camera((0.1, 0.2, -7), (0, 0, 0), fov_y_degrees=50, width=96, height=64)


@pytest.mark.parametrize("kind", [light.PathRenderer, light.HybridRenderer])
def test_threads_and_waves_change_no_bit(kind, monkeypatch):
    scene, pictures = busy(), set()
    for threads, wave_rays in ((1, 2048), (1, 4096), (1, 1 << 20), (2, 2048), (3, 4096)):
        with kind(scene, BUSY_CAMERA, threads=threads) as renderer:
            monkeypatch.setattr(type(renderer.integrator), "wave_pixels", wave_rays)
            renderer.add(3)
            pictures.add(renderer.image.tobytes())
            assert renderer.image.std() > 0.1
    assert len(pictures) == 1


@pytest.mark.parametrize("kind", [light.PathRenderer, light.HybridRenderer])
def test_methods_that_see_the_same_make_the_same_bits(kind):
    scene = busy()
    methods = {
        "raster": None,
        "single rays": partial(atra.PixelTracer, packet_width=1, threads=1),
        "packets": partial(atra.PixelTracer, threads=1),
        "aligned": partial(atra.AlignedTracer, split=(8, 1), threads=1),
        "visible-first": partial(atra.VisibleFirstTracer, split=(8, 1), threads=1),
    }
    pictures = {}
    for name, primary in methods.items():
        with kind(scene, BUSY_CAMERA, primary, threads=1) as renderer:
            renderer.add(1)
            pictures[name] = renderer.tracer.trace((0.5, 0.5)).prim_id, renderer.image
    seen, reference = pictures["single rays"]
    for prim_id, image in pictures.values():
        same = prim_id == seen
        assert same.mean() > 0.999
        np.testing.assert_array_equal(image[same], reference[same])


def test_jitter_of_each_pixel_s_own_converges_to_the_shared_one_s_picture():
    shared = batches(busy(), BUSY_CAMERA, 8, 16).mean((1, 2))
    own = batches(busy(), BUSY_CAMERA, 8, 16, jitter="pixel").mean((1, 2))
    error = np.sqrt((shared.var(axis=0, ddof=1) + own.var(axis=0, ddof=1)) / 8)
    assert (np.abs(shared.mean(axis=0) - own.mean(axis=0)) < 5 * error).all()


@pytest.mark.parametrize("kind", [light.PathRenderer, light.HybridRenderer])
def test_samples_added_in_parts_are_those_added_at_once(kind):
    with kind(busy(), BUSY_CAMERA, threads=1) as parts, kind(busy(), BUSY_CAMERA, threads=1) as whole:
        for _ in range(4):
            parts.add(4)
        whole.add(16)
        assert parts.samples == whole.samples == 16
        assert (parts.image == whole.image).all()


def beside_a_wall():
    material, sun = light.Lambertian((0.5, 0.25, 1.0)), light.Sun((1.0, -1.0, 0.0), 10.0)
    return rectangles((floor(), material), (WALL, material), lights=[sun], sky=WHITE_SKY)


@pytest.mark.parametrize(("kind", "make", "camera", "options"), [
    (light.PathRenderer, busy, replace(BUSY_CAMERA, width=32, height=32), {}),
    (light.HybridRenderer, beside_a_wall, down(24, eye=(1.3, 3, 0)), {"occlusion_length": 2.0, "most_samples": None}),
], ids=["paths", "hybrid"])  # fmt: skip
def test_the_error_falls_at_least_with_the_square_root_of_the_samples(kind, make, camera, options):
    numbers, pictures = [4, 16, 64], {}
    with kind(make(), camera, threads=1, jitter="off", **options) as renderer:
        for samples in (*numbers, 1024):
            renderer.add(samples - renderer.samples)
            pictures[samples] = renderer.image.astype(float)
    errors = [np.sqrt(((pictures[samples] - pictures[1024]) ** 2).mean()) for samples in numbers]
    assert -0.9 < np.polyfit(np.log(numbers), np.log(errors), 1)[0] <= -0.45


def test_a_clamp_limits_what_comes_by_more_than_one_reflection_alone():
    white = light.Lambertian(1.0)
    between = rectangles((floor(1.0), white), (floor(1.0, 1.0)[::-1], white), sky=WHITE_SKY)
    camera = down(4, eye=(0.3, 0.5, 0))
    options = {"bounces": 999, "roulette_from": None}
    once, whole = traced(between, camera, 16, bounces=1), traced(between, camera, 16, **options)
    np.testing.assert_allclose(whole, 1.0, atol=1e-5)
    assert 0.0 < once.mean() < 0.9
    np.testing.assert_allclose(traced(between, camera, 16, clamp=0.25, **options), once + 0.25 * (1 - once), atol=1e-5)
