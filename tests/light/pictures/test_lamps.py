"""Lamps, shining triangles and panoramas: closed forms, holes before them, and the same mean whether rays are aimed at
light or find it by scattering, on leaning normals, too."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import atra
from atra import light
from scenes.lit.rooms import lit_cornell_box
from scenes.scene import upright_camera
from tests.baked import baked, sheet
from tests.meshes import cornell_camera
from tests.shown import BLACK, batches, down, floor, floor_points, picture, rectangles, room, sphere, traced

KINDS = {light.PathRenderer: {"bounces": 1}, light.HybridRenderer: {"occlusion_rays": 0}}
ABOVE = down(4, eye=(0.3, 1.0, 0), fov=2)
GREY, WHITE_SKY = light.Lambertian(0.5), light.constant_sky(1.0)
UV = [(0, 0), (1, 0), (1, 1), (0, 1)]
LAMPS = {
    "sun": light.Sun((0.0, -1.0, 0.0), 0.0, power=2.0), "point": light.PointLight((0, 2, 0), power=3.0),
    "spot": light.SpotLight((0, 2, 0), (0, -1, 0), 30.0, 35.0, power=3.0),
    "ball": light.SphereLight((0, 2, 0), 0.01, power=3.0),
    "large ball": light.SphereLight((0.4, 2.0, -0.3), 0.8, power=5.0),  # wholly above the horizon: as much as a point
}  # fmt: skip


def received(lamp, points):
    """What a white floor shows of a lamp above it; left out is where a spot's cone ends."""
    if isinstance(lamp, light.Sun):
        return np.full(points.shape[:-1], lamp.power)
    way = np.array(lamp.position) - points
    angle = np.degrees(np.arccos(way[..., 1] / np.linalg.norm(way, axis=-1)))
    shown = lamp.power * way[..., 1] / (way**2).sum(-1) ** 1.5
    if isinstance(lamp, light.SpotLight):
        return np.select([angle < lamp.inner_degrees - 2, angle > lamp.outer_degrees + 2], [shown, 0.0], np.nan)
    return shown


@pytest.mark.parametrize("lamp", LAMPS)
@pytest.mark.parametrize("kind", [*KINDS, light.Baker])
def test_a_floor_shows_a_lamp_as_the_inverse_square_and_the_cosine_say(kind, lamp):
    scene = rectangles((floor(1.5), GREY), lights=[LAMPS[lamp]])
    samples, error = (1024, 0.01) if lamp == "large ball" else (8, 2e-3)
    if kind is light.Baker:
        lightmap = baked(scene, sheet(scene.mesh, 32), 1024, bounces=0)
        points, found = lightmap.texels.positions, 0.5 * lightmap.direct[:, 0]
        error = 0.01  # a texel has the mean of its square
    else:
        camera = down(16, fov=45)
        image = picture(kind, scene, camera, samples, most_samples=None, jitter="off", **KINDS[kind])
        points = floor_points(camera)
        is_floor = np.abs(points).max(axis=-1) < 1.49
        points, found = points[is_floor], image[is_floor, 0]
    expected = 0.5 * received(LAMPS[lamp], points)
    known = np.isfinite(expected)
    assert known.mean() > 0.5
    np.testing.assert_allclose(found[known], expected[known], rtol=error, atol=1e-3 * (kind is light.Baker))


def test_of_many_lamps_each_is_counted_once():
    lamps = [light.PointLight((x, 1.5, z), power=1.0 + x * x) for x in range(-3, 4) for z in range(-3, 4)]
    image = traced(rectangles((floor(), GREY), lights=lamps), ABOVE, 512, bounces=1)
    expected = 0.5 * sum(received(lamp, floor_points(ABOVE)) for lamp in lamps)
    np.testing.assert_allclose(image[..., 0].mean(), expected.mean(), rtol=0.01)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("alpha", "share"), [("opaque", 0.0), ("mask", 1.0), ("blend", 0.6)])
def test_the_eye_and_light_pass_holes_and_in_part_what_is_blended(kind, alpha, share):
    pane = light.MetallicRoughness((0.0, 0.0, 0.0), 0.4, alpha, roughness=1.0)
    scene = rectangles((floor(), GREY), (floor(1.0, 1.5), pane), lights=[light.Sun((0, -1, 0), 0.0)])
    np.testing.assert_allclose(picture(kind, scene, ABOVE, 64, **KINDS[kind]), 0.5 * share, rtol=1e-4)
    above = picture(kind, scene, replace(ABOVE, eye=(0.3, 3.0, 0)), 256, **KINDS[kind])
    dark = 0.04 * 0.25  # what the black pane mirrors at most of the sun, rough as it is
    np.testing.assert_allclose(above.mean(), 0.5 * share * share, atol=dark + 0.02)


def test_a_floor_is_lit_as_much_as_a_square_lamp_fills_of_its_view():
    half, height = 0.25, 2.0
    scene = rectangles((floor(), GREY), (floor(half, height)[::-1], light.Emissive((3.0, 2.0, 1.0))))
    camera = down(4, eye=(0.5, 1.0, 0), fov=2)
    grid = (np.arange(64) + 0.5) / 64 * 2 * half - half
    way = np.stack(np.meshgrid(grid, grid), -1)[None, None] - floor_points(camera)[..., None, None, ::2]
    form = (
        (height**2 / ((way**2).sum(-1) + height**2) ** 2).mean((2, 3)) * (2 * half) ** 2 / np.pi
    )  # cos cos / (pi r^2)
    expected = 0.5 * form[..., None] * np.array([3.0, 2.0, 1.0])
    np.testing.assert_allclose(traced(scene, camera, 256, bounces=1), expected, rtol=0.01)


def test_a_lamp_shines_to_its_front_alone_is_shadowed_and_what_it_does_not_reach_is_dark():
    shining = room(light.Emissive((2.0, 1.0, 0.5)))
    inside = atra.Camera((0, 0, 0), (1, 0.2, 0.1), width=4, height=4)
    np.testing.assert_allclose(traced(shining, inside, 1), np.broadcast_to([2.0, 1.0, 0.5], (4, 4, 3)))
    behind = replace(shining, mesh=atra.Mesh(shining.mesh.vertices, shining.mesh.faces[:, ::-1]))
    assert (traced(behind, inside, 1) == 0).all()
    assert (traced(room(light.Lambertian(0.9), WHITE_SKY), inside, 4, bounces=49) == 0).all()
    lamp = light.Emissive()
    for parts in ([(floor(0.5, 2.0), lamp)], [(floor(0.5, 2.0)[::-1], lamp), (floor(1.0, 1.5), GREY)]):
        scene = rectangles((floor(), GREY), *parts)
        assert (traced(scene, down(4, eye=(0, 1, 0), fov=20), 16, bounces=1) == 0).all()


def panorama(degrees=0.0):
    """Dim, random, with one bright texel above the horizon."""
    texels = np.random.default_rng(0).random((8, 16, 3)).astype(np.float32)
    texels[2, 5] = 400.0
    return light.PanoramaSky(texels, rotation_degrees=degrees)


def beside_a_lamp():
    return lit_cornell_box(), cornell_camera(12, 12)


def smooth_under_a_panorama():
    ball = sphere(light.Lambertian((0.7, 0.5, 0.3)), panorama(100.0), segments=8)
    return ball, atra.Camera((0, 0.5, 4), (0, 0, 0), fov_y_degrees=40, width=12, height=12)


def lamp_and_panorama():
    wall = [(-2, 0, -1), (2, 0, -1), (2, 3, -1), (-2, 3, -1)], light.Metal(0.9, 0.2)
    lamp = floor(0.4, 1.5)[::-1], light.Emissive(8.0)
    scene = rectangles((floor(20.0), light.Lambertian(0.6)), lamp, wall, sky=panorama())
    return scene, atra.Camera(**upright_camera((1.0, 2.0, 5.0), (0.0, 0.7, 0.0), 40.0), width=12, height=12)


def textured_lamp():
    texels = np.zeros((4, 4, 3), np.uint8)
    texels[:2, :2] = 255
    glow = light.MetallicRoughness((0, 0, 0), emission=(4.0, 4.0, 4.0), emission_image=light.Image(texels))
    return rectangles((floor(), GREY), (floor(1.0, 1.5)[::-1], glow), uv=UV * 2), ABOVE


def lamp_behind_a_pane():
    pane = light.MetallicRoughness((0.9, 0.6, 0.3), roughness=0.0, transmission=1.0)
    lamp = floor(1.0, 3.0)[::-1], light.Emissive((3.0, 3.0, 3.0))
    return rectangles((floor(), GREY), (floor(4.0, 1.5), pane), lamp), ABOVE


def leaning(x, metallic, roughness=0.5, sky=BLACK):
    """A floor whose normals lean by 35 degrees towards +x, below a lamp that faces down, seen from x at 45 degrees."""
    angle = np.radians(35)
    normal = np.float32([[[np.sin(angle), 0.0, np.cos(angle)]]])
    bumped = light.MetallicRoughness(normals=light.Image(0.5 + 0.5 * normal), metallic=metallic, roughness=roughness)
    lamp = floor(20.0, 8.0)[::-1], light.Emissive((5.0, 5.0, 5.0))
    return rectangles((floor(), bumped), lamp, sky=sky, uv=UV * 2), atra.Camera(
        (x, 4, 0), (0, 0, 0), (0, 1, 0), 2, 8, 8
    )


@pytest.mark.parametrize(("make", "is_small"), [
    (beside_a_lamp, True), (smooth_under_a_panorama, True), (lamp_and_panorama, True), (textured_lamp, False),
    (lamp_behind_a_pane, False), *((partial(leaning, x, metallic), False) for x in (4, -4) for metallic in (0.0, 1.0)),
])  # fmt: skip
def test_both_ways_to_find_light_have_one_mean_and_aiming_at_what_is_small_has_less_noise(make, is_small):
    scene, camera = make()
    aimed = batches(scene, camera, 16, 16, bounces=3, jitter="pixel").mean(axis=(1, 2))
    found = batches(scene, camera, 16, 256, bounces=3, jitter="pixel", lights="found").mean(axis=(1, 2))
    error = np.sqrt((aimed.var(axis=0, ddof=1) + found.var(axis=0, ddof=1)) / 16)
    assert (np.abs(aimed.mean(axis=0) - found.mean(axis=0)) < 4 * error).all()
    assert (error < 0.05 * found.mean(axis=0)).all()
    if is_small:
        assert aimed.std() < 2 * found.std()  # with a sixteenth of the samples: half the noise at least


@pytest.mark.parametrize("x", [4, -4])
@pytest.mark.parametrize(("roughness", "lost"), [(0.0, 1e-5), (0.2, 0.04)])
def test_metal_whose_normals_lean_reflects_all_light_of_a_furnace_from_both_sides(x, roughness, lost):
    scene, camera = leaning(x, 1.0, roughness, WHITE_SKY)
    open_floor = rectangles((floor(), scene.materials[0]), sky=WHITE_SKY, uv=UV)
    np.testing.assert_allclose(traced(open_floor, camera, 64, bounces=1).mean(), 1.0, atol=lost)


def test_without_emitters_nothing_is_aimed_and_the_rays_are_the_same():
    scene, seen = rectangles((floor(), GREY), sky=WHITE_SKY), []
    for lights in ("aimed", "found"):
        with light.PathRenderer(scene, down(8), threads=1, lights=lights) as renderer:
            renderer.add(2)
            seen.append((renderer.ray_count, renderer.image.tobytes()))
    assert seen[0] == seen[1]


def test_roulette_changes_no_mean():
    short, long = (traced(*beside_a_lamp(), 256, bounces=11, roulette_from=rays).mean() for rays in (1, 100))
    assert short == pytest.approx(long, rel=0.02)
