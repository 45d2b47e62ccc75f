"""Textures, colours of vertices and holes in bakes, at the place where light meets a triangle."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra import light
from atra.errors import InputError
from atra.light import Atlas, Baker, lit_view
from atra.light.lightmaps.finish.views import look_of
from tests.baked import baked, sheet, standard_error
from tests.images import draw
from tests.light.lightmaps.test_light import corner_factor
from tests.meshes import quads
from tests.shown import floor

RED, GREEN = (0.8, 0.1, 0.05), (0.05, 0.6, 0.1)
WALL = [(-1, 0, -1), (1, 0, -1), (1, 2, -1), (-1, 2, -1)]
UV = [(0, 0), (1, 0), (1, 1), (0, 1)]
SUN = light.Sun((0.2, -1.0, -0.3), 0.0)
WHITE = light.Lambertian((0.8, 0.8, 0.8))


def halves(left, right):
    """An image, its left half of one colour, its right half of another."""
    return light.Image(np.float32([[left, right]]), is_nearest=True)


def on_a_floor(material, uv=UV):
    """A white wall, a chart of its own, behind a floor of a material with uv, which has none."""
    mesh = quads([WALL, floor(1.0)])
    return light.Scene(mesh, [WHITE, material], np.repeat([0, 1], 2), [SUN], light.constant_sky(0.2), uv=[*UV, *uv])


def of_the_first(mesh, texels):
    """An atlas of a mesh's first quadrilateral alone."""
    first = sheet(quads([WALL]), texels)
    uv = np.full((mesh.triangle_count, 3, 2), np.nan)
    uv[:2] = first.uv
    return Atlas(uv, np.where(np.arange(mesh.triangle_count) < 2, 0, -1), first.width, first.height)


def split_floor(left, right):
    """The wall behind a floor of two quadrilaterals."""
    parts = [[(x, 0, 1), (x + 1, 0, 1), (x + 1, 0, -1), (x, 0, -1)] for x in (-1, 0)]
    mesh = quads([WALL, *parts])
    return light.Scene(mesh, [WHITE, left, right], np.repeat([0, 1, 2], 2), [SUN], light.constant_sky(0.2))


def test_light_from_a_texture_has_the_colour_of_the_place_as_from_plain_faces_of_these_colours():
    painted = on_a_floor(light.Lambertian(halves(RED, GREEN)))
    plain = split_floor(light.Lambertian(RED), light.Lambertian(GREEN))
    by_place, expected = (baked(scene, of_the_first(scene.mesh, 6), 256) for scene in (painted, plain))
    # Random numbers are the same, so paths are, too, but for hits at the rim between both colours.
    off = np.abs(by_place.indirect - expected.indirect).max(axis=1)
    assert (off < standard_error(expected)).all()
    np.testing.assert_allclose(by_place.indirect.mean(axis=0), expected.indirect.mean(axis=0), rtol=0.01)
    left = by_place.texels.positions[:, 0] < 0
    red = by_place.indirect[:, 0] / by_place.indirect[:, 1]
    assert red[left].mean() > 1.5 * red[~left].mean()
    np.testing.assert_array_equal(by_place.direct, expected.direct)


def test_a_plate_half_red_lights_the_one_above_by_the_form_factor_of_that_half():
    """The sun is low: the upper plate's shadow falls beside the lower one."""
    up, down = floor(0.5), floor(0.5, 1.0)[::-1]
    mesh = quads([down, up])
    materials = light.Lambertian((0, 0, 0)), light.Lambertian(halves((0.9, 0, 0), (0, 0, 0)))
    sun = light.Sun((-2.0, -1.0, 0.0), 0.0)
    scene = light.Scene(mesh, materials, np.repeat([0, 1], 2), [sun], light.constant_sky(0.0), uv=[*UV, *UV])
    lightmap = baked(scene, of_the_first(mesh, 4), 1 << 14, bounces=1)
    x, _, z = lightmap.texels.positions.T.astype(float)
    steps = (np.arange(8) + 0.5) / 32 - 1 / 8  # within a texel
    x, z = (np.clip(v[:, None, None] + s, -0.5, 0.5) for v, s in ((x, steps[:, None]), (z, steps)))
    # The left half is the rectangle from x - 0.5 to x, less that beyond the middle where x is negative.
    seen = sum(corner_factor(0.5 + x, 0.5 + k * z) - corner_factor(x, 0.5 + k * z) for k in (-1, 1)).mean(axis=(1, 2))
    got, expected = lightmap.luminance, 0.2126 * 0.9 / np.sqrt(5) * seen
    error = standard_error(lightmap)
    assert (np.abs(got - expected) < 5 * error).all()
    assert abs(got.mean() - expected.mean()) < 4 * np.sqrt((error**2).sum()) / len(error)
    assert error.mean() < 0.04 * expected.mean()
    assert lightmap.indirect[:, 1:].max() == 0.0


@pytest.mark.parametrize("alpha", ["mask", "blend"])
def test_light_passes_the_holes_of_a_texture_as_if_nothing_were_there(alpha):
    image = halves((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0))
    cover = [(-1, 0.5, 1), (1, 0.5, 1), (1, 0.5, -1), (-1, 0.5, -1)]
    black = light.Lambertian((0, 0, 0))
    sky = light.constant_sky(0.5)
    materials = [black, light.MetallicRoughness(image, alpha=alpha)]
    scene = light.Scene(quads([floor(1.0), cover]), materials, np.repeat([0, 1], 2), [SUN], sky, uv=[*UV, *UV])
    half = [(min(x, 0), y, z) for x, y, z in cover]
    expected = light.Scene(quads([floor(1.0), half]), [black], lights=[SUN], sky=sky)
    got, known = (baked(one, of_the_first(one.mesh, 8), 64, bounces=0) for one in (scene, expected))
    np.testing.assert_allclose(got.direct, known.direct, atol=0.05)
    np.testing.assert_allclose(got.environment, known.environment, atol=0.05)
    assert got.direct.min() == 0.0
    assert (got.direct > 0.9).mean() > 0.3


def test_a_view_shows_the_texture_at_the_place_that_it_sees():
    scene = on_a_floor(light.Lambertian(halves(RED, GREEN)))
    camera = atra.Camera((0.3, 3.0, 0.2), (0, 0, 0), (0, 0, -1), 30.0, 32, 32)
    hits = draw(scene.mesh, camera)
    atlas = sheet(scene.mesh, 8)
    shown = lit_view(hits, scene, atlas, np.ones((atlas.height, atlas.width, 3), np.float32))
    x = hits.points[..., 0]
    for colour, there in ((RED, x < -0.01), (GREEN, x > 0.01)):
        assert there.sum() > 100
        np.testing.assert_allclose(shown[there], np.broadcast_to(colour, (there.sum(), 3)), atol=1e-6)


@pytest.mark.parametrize("sky", [
    light.GradientSky((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 2.0), light.PanoramaSky(np.float32([[[0.1, 0.2, 0.3]]]), 2.0),
], ids=["gradient", "panorama"])  # fmt: skip
def test_a_view_shows_what_is_behind_panes_and_the_sky_through_the_last(sky):
    """The camera looks down at two panes, one with a hole on the right, above half a floor."""
    half = [(x, y, min(z, 0)) for x, y, z in floor(1.0)]
    tinted = [(x, 0.5, z) for x, _, z in floor(1.0)]
    holed = [(x, 1.0, z) for x, _, z in floor(1.0)]
    mesh = quads([half, tinted, holed])
    materials = [
        light.Lambertian(RED), light.MetallicRoughness((0.5, 0.5, 0.5), opacity=0.25, alpha="blend"),
        light.MetallicRoughness(halves((0.0, 0.0, 0.6, 1.0), (0.0, 0.0, 0.0, 0.0)), alpha="mask"),
    ]  # fmt: skip
    scene = light.Scene(mesh, materials, np.repeat([0, 1, 2], 2), sky=sky, uv=[*UV, *UV, *UV])
    camera = atra.Camera((0.0, 1000.0, 0.0), (0, 0, 0), (0, 0, -1), 0.1, 32, 32)  # hardly any perspective
    atlas = sheet(mesh, 8)
    shown = lit_view(draw(mesh, camera), scene, atlas, np.ones((atlas.height, atlas.width, 3), np.float32))
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
    mesh = quads([floor(1.0)])
    atlas = sheet(mesh, 4)
    camera = atra.Camera((0, 1, 3), (0, 1, 0), fov_y_degrees=60, width=32, height=24)
    hits = draw(mesh, camera)
    shown = lit_view(hits, light.Scene(mesh, sky=sky), atlas, np.zeros((atlas.height, atlas.width, 3), np.float32))
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


def test_a_mesh_that_moves_takes_its_textures_along_and_another_is_refused():
    scene = on_a_floor(light.Lambertian(halves(RED, GREEN)))
    vertices = scene.mesh.vertices.copy()
    vertices[4:, 0] += 0.5
    moved = replace(scene, mesh=atra.Mesh(vertices, scene.mesh.faces))
    atlas = of_the_first(scene.mesh, 4)
    with Baker(scene, atlas, threads=1) as baker:
        baker.add(4)
        baker.update(moved)
        baker.add(32)
        np.testing.assert_array_equal(baker.maps.combined, baked(moved, atlas, 32).combined)
    points = np.array([[0.4, 0, 0], [0.6, 0, 0]])
    np.testing.assert_allclose(look_of(moved).at(np.uint32([3, 2]), points).albedo, [RED, GREEN], atol=1e-6)
    with (
        Baker(scene, atlas, threads=1) as baker,
        pytest.raises(InputError, match="other vertices of the same"),
    ):
        baker.update(light.Scene.plain(atra.Mesh(vertices, scene.mesh.faces[:2])))


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
