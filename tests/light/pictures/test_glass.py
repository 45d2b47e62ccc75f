"""What lets light on: panes that keep their share, clear glass before lamps, stacks of holes, one-sided surfaces."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra import light
from atra.light.tables import surfaces_of
from tests.meshes import quads
from tests.shown import down, floor, hybrid, picture, rectangles, sphere, traced

ABOVE = down(4, eye=(0.3, 1.0, 0), fov=2)
WHITE_SKY, GREY, SUN = light.constant_sky(1.0), light.Lambertian(0.5), light.Sun((0, -1, 0), 0.0)
TINT = (0.9, 0.6, 0.3)
BARE = 0.04  # what glass of 1.5 mirrors at a right angle
PANE = light.MetallicRoughness(TINT, roughness=0.0, transmission=1.0)


def beneath(glass, lamp, heights=(1.5,)):
    """A floor lit by a lamp straight above it, through panes."""
    panes = [(floor(4.0, height)[:: 1 - 2 * (k % 2)], glass) for k, height in enumerate(heights)]
    return rectangles((floor(1.0), GREY), *panes, lights=[lamp])


SOLID = light.MetallicRoughness(roughness=0.0, transmission=1.0, is_thin=False)
ONE, BOTH = (1.5,), (1.6, 1.5)


@pytest.mark.parametrize(
    "lamp",
    [
        SUN,
        light.Sun((0, -1, 0), 5.0),
        light.PointLight((0.3, 6, 0), power=36.0),
    ],
    ids=["sun", "wide sun", "point"],
)
@pytest.mark.parametrize(("kind", "glass", "sides", "share"), [
    (light.PathRenderer, PANE, ONE, (1 - BARE) * np.array(TINT)),
    (light.PathRenderer, PANE, BOTH, ((1 - BARE) * np.array(TINT)) ** 2),
    (light.PathRenderer, SOLID, BOTH, (1 - BARE) ** 2),
    (light.PathRenderer, light.Dielectric(1.5), BOTH, (1 - BARE) ** 2),
    (light.HybridRenderer, replace(PANE, colour=(1, 1, 1)), ONE, 1 - BARE),
    (light.HybridRenderer, light.Dielectric(1.5), ONE, 1 - BARE),
], ids=["pane", "two panes", "solid", "dielectric", "pane, hybrid", "dielectric, hybrid"])  # fmt: skip
def test_lamps_shine_straight_through_clear_glass_less_what_its_sides_mirror(kind, glass, sides, share, lamp):
    options = {"bounces": 1} if kind is light.PathRenderer else {"occlusion_rays": 0, "jitter": "off"}
    image = picture(kind, beneath(glass, lamp, sides), ABOVE, 16, **options)
    np.testing.assert_allclose(image, np.broadcast_to(0.5 * share, image.shape), rtol=0.01)


@pytest.mark.parametrize("lamp", [SUN, light.PointLight((0.3, 6, 0), power=36.0)], ids=str)
def test_light_that_passes_glass_straight_is_absorbed_on_its_way_within_by_beers_law(lamp):
    tint, density = np.array((0.9, 0.5, 1.0)), (0.0, 1.0, 5.0)
    glass = replace(SOLID, colour=tuple(tint), absorption=density)
    image = traced(beneath(glass, lamp, (1.6, 1.5)), ABOVE, 16, bounces=1)
    once = (tint * (1 - BARE)) ** 2
    np.testing.assert_allclose(
        image, np.broadcast_to(0.5 * once * np.exp(-0.1 * np.array(density)), image.shape), rtol=0.01
    )
    twice = traced(beneath(glass, lamp, (2.7, 2.5, 1.6, 1.5)), ABOVE, 16, bounces=1)  # 0.9 of air between them
    np.testing.assert_allclose(
        twice, np.broadcast_to(0.5 * once**2 * np.exp(-0.3 * np.array(density)), image.shape), rtol=0.01
    )


HOLE = light.MetallicRoughness((1, 1, 1), 0.0, "mask")


@pytest.mark.parametrize("gap", [1e-6, 1e-4])
@pytest.mark.parametrize(("pane", "mirrored"), [(HOLE, 0.0), (PANE, 0.2)], ids=["hole", "glass"])
def test_what_stands_a_millionth_behind_a_pane_is_seen_and_shades(pane, mirrored, gap):
    white, black = light.Lambertian(1.0), light.Lambertian(0.0)
    scene = rectangles((floor(1.0), white), (floor(4.0, 0.5 - gap), black), (floor(4.0, 0.5), pane), sky=WHITE_SKY)
    assert traced(scene, ABOVE, 64, bounces=1).max() <= mirrored
    lit = rectangles((floor(1.0), white), (floor(4.0, 0.5), black), (floor(4.0, 0.5 - gap), pane), lights=[SUN])
    assert traced(lit, replace(ABOVE, eye=(0.3, 0.4, 0)), 4, bounces=1).max() == 0.0


@pytest.mark.parametrize("height", [1.0, 9.0])
def test_a_ray_passes_any_number_of_holes(height):
    sheets = [(floor(4.0, 1.5 + 0.01 * k), HOLE) for k in range(130)]
    scene, camera = rectangles((floor(), GREY), *sheets, lights=[SUN]), replace(ABOVE, eye=(0.3, height, 0))
    np.testing.assert_allclose(traced(scene, camera, 2, bounces=1), 0.5, rtol=1e-5)
    np.testing.assert_allclose(hybrid(scene, camera, 2, occlusion_rays=0).image, 0.5, rtol=1e-5)


@pytest.mark.parametrize("samples", [1, 8, 64])
def test_a_pane_keeps_its_share_of_a_hybrid_frame_however_many_samples_it_has(samples):
    red = light.MetallicRoughness((1, 0, 0), 0.5, "blend")
    scene = rectangles((floor(), light.Lambertian(1.0)), (floor(4.0, 1.0), red), sky=WHITE_SKY)
    image = hybrid(scene, down(64), samples, occlusion_rays=0).image
    np.testing.assert_allclose(image[..., 1].mean(), 0.5, atol=5 * 0.5 / 64 / np.sqrt(samples))
    np.testing.assert_allclose(image[..., 0], 1.0, rtol=1e-5)


@pytest.mark.parametrize("options", [
    {"is_double": False}, {"alpha": "mask"}, {"alpha": "blend"}, {"roughness": 0.0, "transmission": 0.5},
], ids=str)  # fmt: skip
def test_beside_a_surface_that_lets_light_on_a_hybrid_frame_shows_the_sky(options):
    scene = light.Scene(quads([floor(0.6)]), [light.MetallicRoughness(**options)], sky=WHITE_SKY)
    renderer = hybrid(scene, down(64, eye=(0.07, 3, 0.05)), 2)
    np.testing.assert_allclose(renderer.image, 1.0, rtol=1e-5)
    assert renderer.openness.min() == pytest.approx(1.0)


def test_a_back_that_the_eye_looks_through_is_no_hole_for_light():
    lid = light.MetallicRoughness((0, 0, 0), is_double=False)
    scene = rectangles((floor(), GREY), (floor(1.0, 1.5)[::-1], lid), lights=[SUN])
    tables = surfaces_of(scene, 1.0)
    assert (tables.has_holes, tables.is_looked_through) == (False, True)
    above = replace(ABOVE, eye=(0.3, 3.0, 0))
    assert traced(scene, above, 4, bounces=1).max() == 0.0
    assert traced(replace(scene, sky=WHITE_SKY), above, 16, bounces=1).mean() > 0.05  # beside the lid
    holes = surfaces_of(replace(scene, materials=[scene.materials[0], replace(lid, alpha="mask")]), 1.0)
    assert (holes.has_holes, holes.is_looked_through) == (True, True)


def test_a_panorama_lights_hybrid_frames_by_all_of_its_light():
    rows, columns = np.mgrid[:64, :128]
    height, turn = np.cos(np.pi * (rows + 0.5) / 64), 2 * np.pi * ((columns + 0.5) / 128 - 0.5)
    along_x = np.sqrt(1 - height**2) * np.sin(turn)  # the middle column looks along -z, those right of it along +x
    radiance = 0.5 + 0.3 * along_x + 0.2 * height
    sky = light.PanoramaSky(np.repeat(radiance[..., None], 3, axis=2).astype(np.float32))
    normal = np.array((0.6, 0.8, 0.0))
    tilted = light.Scene(quads([floor()]), [light.Lambertian(1.0)], sky=sky, normals=np.tile(normal, (4, 1)))
    image = hybrid(tilted, down(4), 1, occlusion_rays=0).image
    np.testing.assert_allclose(image, 0.5 + (0.3 * 0.6 + 0.2 * 0.8) * 2 / 3, rtol=2e-3)
    window = np.zeros((32, 64, 3), np.float32)
    window[3:7, 20:24] = 40.0
    ball = sphere(light.Lambertian(1.0), light.PanoramaSky(window))
    camera = atra.Camera((0, 5, 0), (0, 0, 0), (0, 0, -1), fov_y_degrees=20, width=24, height=24)
    seen, paths = (one.mean() for one in (hybrid(ball, camera, 4).image, traced(ball, camera, 256, bounces=1)))
    assert seen == pytest.approx(paths, rel=0.06)


def test_what_a_solid_absorbs_is_told_by_the_way_within_it():
    absorption = np.array([0.1, 0.4, 2.0])
    blue = light.MetallicRoughness(
        roughness=0.0, transmission=1.0, ior=1.0, is_thin=False, absorption=tuple(absorption.tolist())
    )
    scene = rectangles((floor(4.0, 0.5), blue), (floor(4.0, -0.2)[::-1], blue), sky=WHITE_SKY)
    image = traced(scene, ABOVE, 4, bounces=7)
    np.testing.assert_allclose(image, np.broadcast_to(np.exp(-0.7 * absorption), image.shape), rtol=1e-3)
