"""Rows of the two articles' tables: what restarts, what stops, what is summed, and that nothing is ever torn."""

from dataclasses import fields
from inspect import signature
from math import inf, nan

import numpy as np
import pytest

import atra
from atra import light as render
from atra.light import textures
from atra.light.lightmaps.options import BakeOptions
from atra.light.pictures.files import srgb_of
from atra.light.pictures.hybrid import Hybrid
from atra.light.pictures.paths import Paths
from tests.meshes import quads
from tests.shown import BLACK, down, floor, hybrid, sphere

GREY = render.Lambertian((0.5, 0.25, 1.0))
FLOOR = quads([floor()])


def test_each_sample_of_a_light_counts_by_its_own_cosine():
    angle = 40.0
    sun = render.Sun((0, -1, 0), angle)
    scene = render.Scene(FLOOR, [render.Lambertian(1.0)], lights=[sun], sky=BLACK)
    image = hybrid(scene, down(4), 512).image
    radius = np.tan(np.radians(angle))  # points of a disc at distance 1: the mean of 1 / sqrt(1 + r^2)
    expected = 2.0 * (np.sqrt(1.0 + radius**2) - 1.0) / radius**2
    assert expected < 0.87
    np.testing.assert_allclose(image, expected, rtol=2e-3)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_light_is_shown_by_the_nearest_level_of_srgb(kind):
    dark, light = np.arange(1 << 14) / 2.0**20, np.arange(1 << 16) / 2.0**16
    linear = np.concatenate([dark, light]).astype(kind)[:, None]
    exact = linear.astype(np.float64)
    encoded = np.where(exact <= 0.0031308, 12.92 * exact, 1.055 * exact ** (1 / 2.4) - 0.055)
    np.testing.assert_array_equal(srgb_of(linear), np.rint(255 * encoded))
    beyond = np.array([[1.0, 1.5, inf], [-0.0, -1.0, -inf], [nan, 0.0, 1e-30]], kind)
    assert srgb_of(beyond).tolist() == [[255] * 3, [0] * 3, [0] * 3]


@pytest.mark.parametrize(("given", "kept"), [(None, 40), (33, 33), (1, 1)])
def test_no_more_samples_are_added_than_a_picture_is_to_have(given, kept):
    scene = render.Scene(FLOOR, [GREY])
    with render.HybridRenderer(scene, down(4), threads=1, most_samples=given) as renderer:
        for _ in range(4):
            renderer.add(10)
        assert renderer.samples == kept
        renderer.add(3)
        assert renderer.samples == (43 if given is None else kept)
        renderer.update(most_samples=50)
        renderer.add(99)
        assert renderer.samples == 50
    assert Hybrid().most_samples == 512
    assert Paths().most_samples is None


def test_an_image_of_any_size_is_the_part_of_a_larger_one():
    scene = sphere(GREY, render.GradientSky())
    camera = atra.Camera((0, 1, 3), (0, 0, 0), fov_y_degrees=45, width=21, height=14)
    part = camera.crop(left=3, top=2, width=13, height=7)
    of_kinds = {render.HybridRenderer: {"occlusion_rays": 0}, render.PathRenderer: {"bounces": 0}}
    for kind, options in of_kinds.items():
        pictures = []
        for one in (camera, part):
            with kind(scene, one, threads=1, **options) as renderer:
                renderer.add(4)
                pictures.append(renderer.image)
        np.testing.assert_allclose(pictures[0][2:9, 3:16], pictures[1], atol=2e-6)


RESTARTS = {
    "jitter": "off", "shadow_rays": 2, "shadow_length": 3.0,
    "occlusion_rays": 2, "occlusion_length": 3.0, "occlusion": "cosine",
    "bounces": 2, "roulette_from": 2, "aperture_radius": 0.1, "focus_distance": 2.0,
    "clamp": 4.0,
}  # fmt: skip
STAYS = {"most_samples": 100}
OF_PATHS = {"bounces", "roulette_from", "aperture_radius", "focus_distance", "clamp"}


@pytest.mark.parametrize(
    ("kind", "options"),
    [(render.HybridRenderer, Hybrid), (render.PathRenderer, Paths), (render.Baker, BakeOptions)],
)
def test_a_keyword_has_the_default_that_its_options_value_has(kind, options):
    shown = {one.name: one.default for one in signature(kind).parameters.values() if one.kind is one.KEYWORD_ONLY}
    assert shown == vars(options())


REFUSED = {name for kind in (Hybrid, Paths) for name in kind.built_with}


@pytest.mark.parametrize(("kind", "options"), [(render.HybridRenderer, Hybrid), (render.PathRenderer, Paths)])
def test_every_option_restarts_or_stays_or_is_refused_as_the_table_says(kind, options):
    names = {field.name for field in fields(options)}
    assert names <= RESTARTS.keys() | STAYS.keys() | REFUSED
    scene = render.Scene(FLOOR, [GREY], lights=[render.Sun((0, -1, 0))])
    with kind(scene, down(4), threads=1) as renderer:
        for name, value in (RESTARTS | STAYS).items():
            if name in names:
                renderer.update(**{name: getattr(options(), name)})
                renderer.add(2)
                renderer.update(**{name: value})
                assert renderer.samples == (2 if name in STAYS else 0), name
        for name in options.built_with:
            with pytest.raises(atra.InputError, match="was built with"):
                renderer.update(**{name: getattr(renderer.integrator, name)})


NASTY = [nan, inf, -inf, -1.0, -1e-300, 1e300, 1e400, "x", "", None, (), (1, 2), (1, 2, 3, 4), (nan, 0, 0), [[1]],
         np.zeros((0, 3)), np.full(3, nan), object(), {}, b"", 1j, (1j, 0, 0), True, ("a",) * 3, 2**70]  # fmt: skip
MAKERS = {
    render.Lambertian: ("colour",), render.Metal: ("colour", "fuzz"),
    render.Dielectric: ("ior",), render.Emissive: ("colour",), render.Checker: ("first", "second", "scale"),
    render.Image: ("texels",), render.GradientSky: ("below", "above", "power"),
    render.PanoramaSky: ("texels", "power", "rotation_degrees"),
    render.Sun: ("direction", "angle_degrees", "colour", "power"),
    render.PointLight: ("position", "colour", "power"), render.SphereLight: ("position", "radius", "colour", "power"),
    render.Scene: ("mesh", "materials", "face_materials", "lights", "sky", "normals", "uv"),
    Hybrid: tuple(RESTARTS.keys() - OF_PATHS) + ("most_samples",),
    Paths: ("jitter", "most_samples", *OF_PATHS),
}  # fmt: skip
USUAL = {
    render.Checker: {"first": 0.1, "second": 0.2}, render.Image: {"texels": np.zeros((1, 1, 3))},
    render.PanoramaSky: {"texels": np.zeros((1, 1, 3))}, render.Sun: {"direction": (0, -1, 0)},
    render.PointLight: {"position": (0, 1, 0)}, render.SphereLight: {"position": (0, 1, 0), "radius": 1.0},
    render.Scene: {"mesh": FLOOR},
}  # fmt: skip


@pytest.mark.parametrize("kind", MAKERS, ids=lambda kind: kind.__name__)
def test_whatever_is_handed_in_is_taken_or_refused_by_name(kind):
    refused = 0
    for name in MAKERS[kind]:
        for value in NASTY:
            try:
                kind(**(USUAL.get(kind, {}) | {name: value}))
            except atra.InputError:
                refused += 1
    assert refused > len(MAKERS[kind]) * len(NASTY) / 2


def test_a_texture_that_is_too_large_is_refused(monkeypatch):
    monkeypatch.setattr(textures, "MOST_TEXELS", 5)
    render.Image(np.zeros((1, 5, 3)))
    with pytest.raises(atra.InputError, match="make it smaller"):
        render.Image(np.zeros((2, 3, 3)))
