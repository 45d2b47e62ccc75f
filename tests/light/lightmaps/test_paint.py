"""What bakes and views see of materials: textures, colours of vertices, holes, panes, metal and smooth normals."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra import light
from atra.light import Baker, lit_view
from atra.light.lightmaps.finish.views import look_of
from tests.baked import baked, cube, painted, sheet, standard_error
from tests.images import draw
from tests.meshes import joined
from tests.shown import BLACK, floor, rectangles, sphere

RED, GREEN = (0.8, 0.1, 0.05), (0.05, 0.6, 0.1)
WALL = [(-1, 0, -1), (1, 0, -1), (1, 2, -1), (-1, 2, -1)]
UV = [(0, 0), (1, 0), (1, 1), (0, 1)]
SUN = light.Sun((0.2, -1.0, -0.3), 0.0)
WHITE, DIM = light.Lambertian((0.8, 0.8, 0.8)), light.constant_sky(0.2)


def halves(left, right):
    """An image, its left half of one colour, its right half of another."""
    return light.Image(np.float32([[left, right]]), is_nearest=True)


def on_a_floor(material, uv=UV):
    """A white wall, a chart of its own, behind a floor of a material with uv, which has none."""
    return rectangles((WALL, WHITE), (floor(1.0), material), lights=[SUN], sky=DIM, uv=[*UV, *uv])


def split_floor(left, right):
    """The wall behind a floor of two quadrilaterals."""
    parts = [[(x, 0, 1), (x + 1, 0, 1), (x + 1, 0, -1), (x, 0, -1)] for x in (-1, 0)]
    return rectangles((WALL, WHITE), (parts[0], left), (parts[1], right), lights=[SUN], sky=DIM)


def test_light_from_a_texture_has_the_colour_of_the_place_as_from_plain_faces_of_these_colours():
    painted = on_a_floor(light.Lambertian(halves(RED, GREEN)))
    plain = split_floor(light.Lambertian(RED), light.Lambertian(GREEN))
    by_place, expected = (baked(scene, sheet(scene.mesh, 6, charted=1), 256) for scene in (painted, plain))
    # Random numbers are the same, so paths are, too, but for hits at the rim between both colours.
    off = np.abs(by_place.indirect - expected.indirect).max(axis=1)
    assert (off < standard_error(expected)).all()
    np.testing.assert_allclose(by_place.indirect.mean(axis=0), expected.indirect.mean(axis=0), rtol=0.01)
    left = by_place.texels.positions[:, 0] < 0
    red = by_place.indirect[:, 0] / by_place.indirect[:, 1]
    assert red[left].mean() > 1.5 * red[~left].mean()
    np.testing.assert_array_equal(by_place.direct, expected.direct)


@pytest.mark.parametrize("alpha", ["mask", "blend"])
def test_light_passes_the_holes_of_a_texture_as_if_nothing_were_there(alpha):
    image = halves((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0))
    cover = [(-1, 0.5, 1), (1, 0.5, 1), (1, 0.5, -1), (-1, 0.5, -1)]
    ground, half = (floor(1.0), light.Lambertian(0.0)), [(min(x, 0), y, z) for x, y, z in cover]
    lit = {"lights": [SUN], "sky": light.constant_sky(0.5)}
    scene = rectangles(ground, (cover, light.MetallicRoughness(image, alpha=alpha)), uv=UV * 2, **lit)
    expected = rectangles(ground, (half, light.Lambertian(0.0)), **lit)
    got, known = (baked(one, sheet(one.mesh, 8, charted=1), 64, bounces=0) for one in (scene, expected))
    np.testing.assert_allclose(got.direct, known.direct, atol=0.05)
    np.testing.assert_allclose(got.environment, known.environment, atol=0.05)
    assert got.direct.min() == 0.0
    assert (got.direct > 0.9).mean() > 0.3


def seen(scene, camera, level):
    """The view of a scene whose map has this light everywhere, and its hits."""
    hits, atlas = draw(scene.mesh, camera), sheet(scene.mesh, 8)
    return lit_view(hits, scene, atlas, np.full((atlas.height, atlas.width, 3), level, np.float32)), hits


@pytest.mark.parametrize("sky", [
    light.GradientSky((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 2.0), light.PanoramaSky(np.float32([[[0.1, 0.2, 0.3]]]), 2.0),
], ids=["gradient", "panorama"])  # fmt: skip
def test_a_view_shows_what_is_behind_panes_and_the_sky_through_the_last(sky):
    """The camera looks down at two panes, one with a hole on the right, above half a floor."""
    half = [(x, y, min(z, 0)) for x, y, z in floor(1.0)], light.Lambertian(RED)
    tinted = floor(1.0, 0.5), light.MetallicRoughness((0.5, 0.5, 0.5), opacity=0.25, alpha="blend")
    image = halves((0.0, 0.0, 0.6, 1.0), (0.0, 0.0, 0.0, 0.0))
    holed = floor(1.0, 1.0), light.MetallicRoughness(image, alpha="mask")
    camera = atra.Camera((0.0, 1000.0, 0.0), (0, 0, 0), (0, 0, -1), 0.1, 32, 32)  # hardly any perspective
    shown, _ = seen(rectangles(half, tinted, holed, sky=sky, uv=UV * 3), camera, 1.0)
    far, near = slice(2, 14), slice(18, 30)  # rows above the floor, and of the sky below
    left, right = far, near
    below = 2 * np.float32(sky.below) if isinstance(sky, light.GradientSky) else 2 * sky.texels[0, 0]
    for rows, columns, expected in (
        (slice(2, 30), left, (0.0, 0.0, 0.6)), (far, right, 0.25 * 0.5 + 0.75 * np.float32(RED)),
        (near, right, 0.25 * 0.5 + 0.75 * below),
    ):  # fmt: skip
        got = shown[rows, columns]
        np.testing.assert_allclose(got, np.broadcast_to(np.float32(expected), got.shape), atol=1e-4)


def test_a_view_shows_the_sky_where_there_is_nothing_else():
    sky = light.GradientSky((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 2.0)
    camera = atra.Camera((0, 1, 3), (0, 1, 0), fov_y_degrees=60, width=32, height=24)
    shown, hits = seen(rectangles((floor(1.0), WHITE), sky=sky), camera, 0.0)
    ways = camera.rays_world()[1]
    part = (0.5 + 0.5 * ways[..., 1:2] / np.linalg.norm(ways, axis=2, keepdims=True))[~hits.hit]
    expected = 2.0 * ((1.0 - part) * sky.below + part * np.array(sky.above))
    np.testing.assert_allclose(shown[~hits.hit], expected, atol=1e-5)
    assert 0.05 < hits.hit.mean() < 0.9
    assert shown[hits.hit].max() == 0.0


def test_colours_of_vertices_multiply_a_texture_between_the_corners():
    scene = on_a_floor(light.MetallicRoughness(halves((1, 1, 1), (0.5, 0.5, 0.5))))
    colours = np.ones((8, 4))
    colours[4:, 0] = 0.0, 1.0, 1.0, 0.0  # red grows with x
    painted = look_of(replace(scene, colours=colours))
    x = np.array([-0.9, -0.2, 0.4, 0.8])
    faces = np.array([2, 3, 2, 3], np.uint32)
    points = np.stack([x, np.zeros(4), np.where(faces == 2, 1, -1) * 0.95 * np.abs(x)], axis=1)
    found = painted.at(faces, points).albedo
    part = np.where(x < 0, 1.0, 0.5)
    np.testing.assert_allclose(found[:, 0], (x + 1) / 2 * part, atol=1e-6)
    np.testing.assert_allclose(found[:, 1], part, atol=1e-6)


def test_a_mesh_that_moves_takes_its_textures_along():
    scene = on_a_floor(light.Lambertian(halves(RED, GREEN)))
    vertices = scene.mesh.vertices.copy()
    vertices[4:, 0] += 0.5
    moved = replace(scene, mesh=atra.Mesh(vertices, scene.mesh.faces))
    atlas = sheet(scene.mesh, 4, charted=1)
    with Baker(scene, atlas, threads=1) as baker:
        baker.add(4)
        baker.update(moved)
        baker.add(32)
        np.testing.assert_array_equal(baker.maps.combined, baked(moved, atlas, 32).combined)
    points = np.array([[0.4, 0, 0], [0.6, 0, 0]])
    np.testing.assert_allclose(look_of(moved).at(np.uint32([3, 2]), points).albedo, [RED, GREEN], atol=1e-6)


def test_what_blends_shows_its_opacity_and_clear_glass_its_tint():
    glass = light.MetallicRoughness((0.5, 1, 1), opacity=0.25, alpha="blend")
    scene = on_a_floor(glass)
    assert look_of(scene).at(np.uint32([2]), np.array([[0.5, 0, 0.7]])).opacity.tolist() == [0.25]
    for changes, opacity, tint in (
        ({"alpha": "opaque"}, 1.0, 1.0), ({"alpha": "mask"}, 0.0, 1.0), ({"alpha": "mask", "cutoff": 0.2}, 1.0, 1.0),
        ({"alpha": "opaque", "transmission": 1.0, "roughness": 0.0}, 0.04, 0.5),
    ):  # fmt: skip
        other = replace(scene, materials=[WHITE, replace(glass, **changes)])
        shown = look_of(other).at(np.uint32([2]), np.array([[0.5, 0, 0.7]]))
        np.testing.assert_allclose((shown.opacity[0], shown.tint[0, 0]), (opacity, tint), atol=1e-6)


ROOM = joined(cube(inwards=True), cube(0.3))
STEEP_SUN = light.Sun((0.3, -1.0, 0.2), 0.0)


def scene_of(mesh, opacity, albedo=0.6):
    lights = [STEEP_SUN, light.PointLight((0.6, 0.7, -0.6))]
    return painted(mesh, albedo, opacity=opacity, lights=lights, sky=light.constant_sky(0.5))


def test_a_room_of_nothing_but_panes_lets_the_sun_and_the_sky_in():
    mesh = cube(inwards=True)
    lightmap = baked(replace(scene_of(mesh, 0.25, albedo=0.0), lights=[STEEP_SUN]), sheet(mesh, 4), 1024, bounces=0)
    below = lightmap.texels.normals[:, 1] > 0.9
    cosine = 1.0 / np.linalg.norm(STEEP_SUN.direction)
    np.testing.assert_allclose(lightmap.direct[below], 0.75 * cosine, rtol=1e-5)
    count = 1024 * len(below)
    np.testing.assert_allclose(lightmap.environment.mean(), 0.5 * 0.75, rtol=5 * np.sqrt(1 / 3 / count))


def test_a_view_shows_the_same_texels_whether_or_not_faces_let_light_on():
    atlas, camera = sheet(ROOM, 8), atra.Camera((0.9, 0.8, 0.9), (0, -0.2, 0), width=48, height=32)
    seen = []
    for opacity in (1.0, 0.5):
        with Baker(scene_of(ROOM, np.full(24, opacity)), atlas, threads=1) as baker:
            baker.look(camera)
            seen.append(baker.visible)
    np.testing.assert_array_equal(*seen)
    assert 0.05 < seen[0].mean() < 0.9


def test_probes_see_through_panes():
    mesh = cube(inwards=True)
    found = []
    for opacity in (0.0, 1.0):
        scene = replace(scene_of(mesh, np.full(12, opacity)), lights=[])
        with Baker(scene, sheet(mesh, 4), threads=1) as baker:
            found.append(baker.probes([(0, 0, 0)], 256).environment[0, 0, 0])
    np.testing.assert_allclose(found, [0.5 * np.sqrt(4 * np.pi), 0.0], rtol=1e-5)


def test_smooth_normals_light_a_ball_as_a_ball():
    ball = replace(sphere(light.Lambertian(0.5), BLACK, segments=12), lights=[light.Sun((0, -1, 0), 0.0)])
    count = ball.mesh.triangle_count
    side = int(np.ceil(np.sqrt(count)))
    row, column = np.divmod(np.arange(count), side)
    corners = np.array([(0.1, 0.1), (0.8, 0.1), (0.1, 0.8)])
    uv = (np.stack([column, row], -1)[:, None] + corners) / side
    atlas = light.Atlas.of_uv(uv, 8 * side, 8 * side)
    lit = baked(ball, atlas, 64, bounces=0)
    height = lit.texels.positions[:, 1] / np.linalg.norm(lit.texels.positions, axis=1)
    top = lit.texels.normals[:, 1] > 0.3
    np.testing.assert_allclose(lit.direct[top, 0], height[top], atol=0.06)
    flat = baked(replace(ball, normals=None), atlas, 64, bounces=0)
    assert np.abs(flat.direct[top, 0] - height[top]).max() > 0.1


def test_a_clamp_limits_each_share_of_indirect_light_and_no_other():
    white = light.Lambertian(1.0)
    scene = rectangles((floor(1.0), white), (floor(1.0, 1.0)[::-1], white), sky=light.constant_sky(1.0))
    options = {"bounces": 64, "roulette_from": None}
    whole, less = (baked(scene, sheet(scene.mesh, 4), 16, clamp=most, **options) for most in (None, 0.25))
    np.testing.assert_array_equal(less.environment, whole.environment)
    np.testing.assert_allclose(less.indirect, 0.25 * whole.indirect, rtol=1e-5)
    assert whole.indirect.min() > 0.0
