"""Hybrid pictures against closed forms: edges of shadows, penumbras, occlusion, the falling off of light."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import atra
from atra import light as render
from atra.light.emitters.panels import MOST_PANELS, panels_of
from atra.light.lights_kernels import KIND, PANEL, PLACE, SIZE, SPHERE
from tests.meshes import joined, quads
from tests.shown import BLACK, down, floor, floor_points, hybrid, rectangles, room, sphere, traced

GREY = render.Lambertian((0.5, 0.25, 1.0))


def with_screen(light, height=1.0):
    """A floor, and over the half x < 0 a screen that casts a straight edge along z; seen from between the two."""
    screen = [(-50, height, 50), (0, height, 50), (0, height, -50), (-50, height, -50)]
    return rectangles((floor(), GREY), (screen, GREY), lights=[light])


BELOW = down(48, eye=(-0.2, 0.9, 0), fov=70)


def test_a_point_light_s_shadow_ends_where_the_line_over_the_edge_meets_the_floor():
    scene = with_screen(render.PointLight((1.0, 3.0, 0.5)))
    lit = hybrid(scene, BELOW, 1).lit()
    x = floor_points(BELOW)[..., 0]
    edge = 0 - 1.0 * (1.0 - 0.0) / (3.0 - 1.0)  # the light 1 beside the edge and 2 above it, the floor 1 below
    clear = np.abs(x - edge) > 1e-3
    assert clear.mean() > 0.95
    assert ((lit == 1) == (x > edge))[clear].all()
    assert 0.1 < lit.mean() < 0.9


def test_shadows_reach_as_far_as_asked():
    scene = with_screen(render.Sun((0, -1, 0), 0.0))
    dark = floor_points(BELOW)[..., 0] < 0
    for options, has_shadow in (({}, True), ({"shadow_length": 1.01}, True), ({"shadow_length": 0.99}, False)):
        np.testing.assert_array_equal(hybrid(scene, BELOW, 1, **options).lit() == 0, dark & has_shadow)


def test_the_sun_s_penumbra_is_the_share_of_its_disc_beside_the_edge():
    angle = 8.0
    lit = hybrid(with_screen(render.Sun((0, -1, 0), angle)), BELOW, 256).lit()
    across = np.clip(floor_points(BELOW)[..., 0] / np.tan(np.radians(angle)), -1, 1)
    share = 0.5 + (across * np.sqrt(1 - across**2) + np.arcsin(across)) / np.pi
    assert ((share > 0) & (share < 1)).mean() > 0.2
    assert np.abs(lit - share).max() < 0.05
    assert np.abs(lit - share).mean() < 0.005
    assert (lit[share == 1] == 1).all()
    assert (lit[share == 0] == 0).all()


def test_each_sample_of_a_light_counts_by_its_own_cosine():
    angle = 40.0
    scene = rectangles((floor(), render.Lambertian(1.0)), lights=[render.Sun((0, -1, 0), angle)])
    image = hybrid(scene, down(4), 512).image
    radius = np.tan(np.radians(angle))  # points of a disc at distance 1: the mean of 1 / sqrt(1 + r^2)
    expected = 2.0 * (np.sqrt(1.0 + radius**2) - 1.0) / radius**2
    assert expected < 0.87
    np.testing.assert_allclose(image, expected, rtol=2e-3)


@pytest.mark.parametrize("samples", [3, 1000])
def test_a_pixel_is_colour_times_light_and_sky_as_by_hand(samples):
    sun = render.Sun((1.0, -2.0, 0.5), 0.0, colour=(1.0, 0.5, 0.25), power=3.0)
    sky = render.GradientSky((0.1, 0.2, 0.3), (0.5, 0.7, 1.0), power=2.0)
    scene = rectangles((floor(), GREY), lights=[sun], sky=sky)
    cosine = 2.0 / np.sqrt(1 + 4 + 0.25)
    expected = np.array(GREY.colour) * (cosine * 3.0 * np.array(sun.colour) + 2.0 * np.array(sky.above))
    renderer = hybrid(scene, down(4), samples, most_samples=None)
    np.testing.assert_allclose(renderer.image, np.broadcast_to(expected, (4, 4, 3)), rtol=2e-6)
    np.testing.assert_allclose(renderer.lit(), 1.0, rtol=1e-6)


@pytest.mark.parametrize(("occlusion", "free"), [
    ("uniform", lambda c: 1 - (1 - c) / 2),
    ("cosine", lambda c: 1 - (np.arccos(c) - c * np.sqrt(1 - c * c)) / np.pi),
])  # fmt: skip
def test_beside_a_wall_the_share_of_the_hemisphere_is_free_that_its_distance_says(occlusion, free):
    wall = [(0, 0, 50), (0, 50, 50), (0, 50, -50), (0, 0, -50)]
    scene = rectangles((floor(), GREY), (wall, GREY), sky=render.constant_sky(1.0))
    camera = down(16, eye=(1.3, 3, 0))
    options = {"occlusion_length": 2.0, "occlusion": occlusion}
    openness = hybrid(scene, camera, 512, **options).openness
    x = floor_points(camera)[..., 0]
    expected = free(np.clip(x / 2.0, 0, 1))
    assert np.ptp(expected[x > 0]) > 0.25
    assert np.abs(openness - expected)[x > 0].max() < 0.03


@pytest.mark.parametrize(("occlusion", "free"), [
    ("uniform", lambda angle: 1 - np.cos(angle)), ("cosine", lambda angle: np.sin(angle) ** 2),
])  # fmt: skip
def test_beneath_a_dome_the_share_of_its_opening_is_free(occlusion, free):
    angle = np.radians(50.0)
    steps = np.linspace(np.pi / 2, angle, 9)
    dome = trimesh.creation.revolve(2.0 * np.stack([np.sin(steps), np.cos(steps)], axis=1), sections=96)
    mesh = joined(quads([floor(2.0)]), atra.Mesh(dome.vertices[:, [0, 2, 1]], dome.faces))
    scene = render.Scene(mesh, [GREY], sky=render.constant_sky(1.0))
    middle = down(4, eye=(0, 0.5, 0), fov=1)
    openness = hybrid(scene, middle, 512, occlusion=occlusion, occlusion_length=np.inf).openness
    np.testing.assert_allclose(openness, free(angle), atol=0.015)
    near = hybrid(scene, middle, 64, occlusion=occlusion, occlusion_length=1.9).openness
    np.testing.assert_array_equal(near, 1.0)  # it begins farther away


def test_nothing_leaks_into_a_closed_room_and_nothing_shadows_itself_outside():
    scene = room(GREY, render.constant_sky(1.0))
    inside = atra.Camera((0.3, 0.2, 0.1), (1, 0.5, 0.7), fov_y_degrees=100, width=64, height=64)
    assert hybrid(scene, inside, 32, occlusion_length=np.inf).openness.max() == 0
    ball = sphere(GREY, render.constant_sky(1.0), smooth=False)
    outside = atra.Camera((0, 1, 3), (0, 0, 0), fov_y_degrees=45, width=64, height=64)
    assert hybrid(ball, outside, 32).openness.min() == 1


def test_a_triangulated_sphere_has_the_normals_of_a_sphere():
    sky = render.GradientSky((0, 0, 0), (1, 1, 1))
    camera = atra.OrthographicCamera((0, 0, 5), (0, 0, 0), (0, 1, 0), 2.0, 40, 40)
    image = hybrid(sphere(render.Lambertian(1.0), sky, segments=64), camera, 1, occlusion_rays=0).image
    y, x = 1 - (np.mgrid[:40, :40] + 0.5) / 20
    inner = x**2 + y**2 < 0.9
    np.testing.assert_allclose(image[inner, 0], (0.5 + 0.5 * y)[inner], atol=0.003)


def test_samples_stay_where_only_strengths_change_and_go_where_anything_else_does():
    sun, sky = render.Sun((0.3, -1, 0.2), 1.0), render.GradientSky()
    scene = render.Scene(quads([floor()]), [GREY, render.Metal()], lights=[sun], sky=sky)
    stay = [
        scene, replace(scene, sky=replace(sky, power=2.0)), replace(scene, lights=[replace(sun, power=0.5)]),
        replace(scene, lights=[replace(sun, colour=(1, 0, 0))]),
    ]  # fmt: skip
    go = [
        replace(scene, sky=replace(sky, above=(0, 0, 1))), replace(scene, lights=[sun, sun]),
        replace(scene, lights=[replace(sun, direction=(0, -1, 0))]),
        replace(scene, lights=[replace(sun, angle_degrees=2.0)]),
        replace(scene, materials=[render.Lambertian(), render.Metal()]),
    ]  # fmt: skip
    with render.HybridRenderer(scene, down(8), threads=1) as renderer:
        for other, samples in [*((one, 3) for one in stay), *((one, 0) for one in go)]:
            renderer.update(scene)
            renderer.restart()
            renderer.add(3)
            renderer.update(other)
            renderer.look(down(8))
            assert renderer.samples == samples
            if samples:
                expected = hybrid(other, down(8), 3, jitter="shared").image
                np.testing.assert_array_equal(renderer.image, expected)
        renderer.add(3)
        renderer.look(down(8, eye=(0, 3, 0)))
        assert renderer.samples == 0
        turned = atra.Mesh(scene.mesh.vertices, scene.mesh.faces[::-1])
        with pytest.raises(atra.InputError, match=r"expected .* as before: update takes other vertices"):
            renderer.update(replace(scene, mesh=turned))


def test_a_texture_lies_where_uv_says():
    mesh = quads([floor(1.0)])
    uv = (mesh.vertices[:, [0, 2]] * [0.5, -0.5] + 0.5).astype(np.float32)  # u to the right, v up in the picture
    camera = down(8, eye=(0, 1 / np.tan(np.radians(20)), 0))
    points = floor_points(camera)
    u, v = 0.5 + points[..., 0] / 2, 0.5 - points[..., 2] / 2
    plain = {"sky": render.constant_sky(1.0), "uv": uv}
    checker = render.Checker((1, 0, 0), (0, 0, 1), 4.0)
    image = hybrid(render.Scene(mesh, [render.Lambertian(checker)], **plain), camera, 1, occlusion_rays=0).image
    np.testing.assert_array_equal(image[..., 0] == 1, (np.floor(4 * u) + np.floor(4 * v)) % 2 == 0)
    texels = np.random.default_rng(1).random((8, 8, 3), np.float32)
    textured = render.Scene(mesh, [render.Lambertian(render.Image(texels))], **plain)
    np.testing.assert_allclose(hybrid(textured, camera, 1, occlusion_rays=0).image, texels, atol=1e-4)


@pytest.mark.parametrize("sky", ["gradient", "panorama"])
def test_images_looked_up_for_eight_pixels_at_once_have_the_colours_of_one_pixel_at_a_time(sky):
    draw = np.random.default_rng(5)
    ball = trimesh.creation.icosphere(2)
    uv = (2.3 * ball.vertices[:, :2] - 1.7 * ball.vertices[:, 2:]).astype(np.float32)
    wraps = [("repeat", "mirror"), ("mirror", "clamp"), ("clamp", "repeat"), ("repeat", "repeat")]
    images = [
        render.Image(
            draw.integers(0, 256, (rows, columns, 4), np.uint8), is_coded=columns != 5, wrap=wrap,
            factor=(0.9, 0.8, 0.7, 0.6), placement=((1.5, 0.1, 0.3), (-0.2, 0.8, 7.0)),
        )
        for wrap, rows, columns in zip(wraps, (7, 1, 16, 33), (5, 8, 16, 1), strict=True)
    ]  # fmt: skip
    numbers = draw.integers(0, len(images) + 1, len(ball.faces))
    skies = {"gradient": render.GradientSky(), "panorama": render.PanoramaSky(draw.random((8, 16, 3), np.float32))}
    camera = atra.Camera((0, 1, 2.5), (0, 0, 0), fov_y_degrees=50, width=67, height=53)
    pictures = []
    for second in (False, True):  # those of second uv are looked up one by one, at points rounded to float32
        kinds = [render.MetallicRoughness(replace(image, second_uv=second)) for image in images]
        kinds.append(render.MetallicRoughness((0.2, 0.4, 0.6)))
        scene = render.Scene(atra.Mesh(ball.vertices, ball.faces), kinds, numbers, uv=uv, second_uv=uv, sky=skies[sky])
        pictures.append(hybrid(scene, camera, 2).image)
    assert len(np.unique(pictures[0].reshape(-1, 3), axis=0)) > 1000
    np.testing.assert_allclose(pictures[0], pictures[1], atol=5e-5)


def test_a_shining_rectangle_is_seen_and_lights_the_floor_as_paths_find():
    lamp = [(0.3, 1.5, -0.7), (1.2, 1.5, -0.7), (1.2, 1.8, 0.9), (0.3, 1.8, 0.9)]
    scene = rectangles((floor(4.0), GREY), (lamp, render.Emissive((5.0, 3.0, 1.0))))
    below = down(16, eye=(0, 4, 0), fov=60)  # sees the lamp's back, which is black
    renderer, expected = hybrid(scene, below, 256), traced(scene, below, 256, bounces=1)
    np.testing.assert_allclose(renderer.image.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=0.02)
    up = atra.Camera((0.7, 0.2, 0.1), (0.75, 1.65, 0.1), (0, 0, 1), 10, 8, 8)
    np.testing.assert_allclose(hybrid(scene, up, 1).image, np.broadcast_to((5.0, 3.0, 1.0), (8, 8, 3)), rtol=1e-5)
    half = replace(scene, materials=[GREY, render.MetallicRoughness(0.0, emission=(2.5, 1.5, 0.5), is_double=True)])
    np.testing.assert_allclose(hybrid(half, up, 1).image, np.broadcast_to((2.5, 1.5, 0.5), (8, 8, 3)), rtol=1e-5)


def test_a_shining_ball_lights_as_a_sphere_and_connected_triangles_are_one_light():
    ball = sphere(render.Emissive((4.0, 4.0, 4.0)), BLACK, segments=8)
    (panel,) = panels_of(replace(ball, mesh=ball.mesh))
    assert panel.row[KIND] == SPHERE
    two = quads([floor(0.2, 2.0)[::-1], [(x + 3, y, z) for x, y, z in floor(0.1, 2.0)[::-1]]])
    lamps = panels_of(render.Scene(two, [render.Emissive((1.0, 1.0, 1.0))], sky=BLACK))
    assert [lamp.row[KIND] for lamp in lamps] == [PANEL, PANEL]
    np.testing.assert_allclose([lamp.row[PLACE:SIZE] for lamp in lamps], [(0, 2, 0), (3, 2, 0)], atol=1e-6)
    np.testing.assert_allclose([lamp.colour[0] for lamp in lamps], [0.16 / np.pi, 0.04 / np.pi], rtol=1e-6)
    many = quads([[(x + 3 * i, y, z) for x, y, z in floor(0.1, 2.0)] for i in range(MOST_PANELS + 3)])
    assert len(panels_of(render.Scene(many, [render.Emissive()], sky=BLACK))) == MOST_PANELS
