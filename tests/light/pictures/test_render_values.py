"""What is handed to renderers, what is refused, what restarts and stops them, and what is written."""

from contextlib import suppress
from dataclasses import fields, replace
from inspect import signature
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import atra
from atra import light
from atra.light import textures
from atra.light.lightmaps.paths import BakeOptions
from atra.light.pictures.files import srgb_of
from atra.light.pictures.hybrid import Hybrid
from atra.light.pictures.paths import Paths
from tests.meshes import quads
from tests.shown import down, floor, sphere

MESH = quads([floor(1.0)])
NAN, FLOOR = float("nan"), quads([floor()])

WRONG = [
    (lambda: light.Lambertian((0.5, 1.1, 0.5)), "colour of Lambertian is 1.1, expected .* at most 1"),
    (lambda: light.Lambertian("red"), "colour of Lambertian is 'red', expected three numbers"),
    (lambda: light.Metal(0.5, 1.5), "fuzz of Metal is 1.5"),
    (lambda: light.Dielectric(1.5, "none"), "fresnel of Dielectric is 'none'"),
    (lambda: light.Dielectric(0.0), "ior of Dielectric is 0.0, expected a finite number above 0"),
    (lambda: light.Emissive((1, -1, 0)), "colour of Emissive is -1"),
    (lambda: light.Checker((1, 1, 1), (0, 0, 0), 0.0), "scale of Checker is 0.0"),
    (lambda: light.Image(np.zeros((2, 2))), r"texels of an image has shape \(2, 2\)"),
    (lambda: light.Image(np.full((1, 2, 3), [[[0, 0, 0], [0, 2, 0]]])), "at column 1 of row 0"),
    (lambda: light.GradientSky((1, 1, 1), (NAN, 0, 0)), "above of GradientSky"),
    (lambda: light.GradientSky(power=-1), "power of GradientSky is -1"),
    (lambda: light.PanoramaSky(np.full((1, 1, 3), NAN)), "texels of a sky"),
    (lambda: light.Sun((0, 0, 0)), r"direction of Sun is \(0.0, 0.0, 0.0\), expected a direction of non-zero length"),
    (lambda: light.Sun((0, -1, 0), 50), "angle_degrees of Sun is 50"),
    (lambda: light.PointLight((0, NAN, 0)), "position of PointLight"),
    (lambda: light.SphereLight((0, 1, 0), 1.0, power=-2), "power of SphereLight is -2"),
    (lambda: light.SpotLight((0, 1, 0), (0, -1, 0), outer_degrees=100), "outer_degrees of SpotLight is 100"),
    (lambda: light.Scene(None), "mesh is None"),
    (lambda: light.Scene(MESH, []), "no materials"),
    (lambda: light.Scene(MESH, ["grey"]), "material 0 is 'grey'"),
    (lambda: light.Scene(MESH, face_materials=[0]), r"face_materials is int64 of \(1,\), expected .* \(2,\)"),
    (lambda: light.Scene(MESH, face_materials=[0, 1]), "face 1 is made of material 1, but there are 1"),
    (lambda: light.Scene(MESH, face_materials=[0.0, 0.0]), "face_materials is float64"),
    (lambda: light.Scene(MESH, lights=[MESH]), "a light is Mesh"),
    (lambda: light.Scene(MESH, sky="blue"), "sky is 'blue'"),
    (lambda: light.Scene(MESH, normals=np.zeros((8, 3))), "normal has shape"),
    (lambda: light.Scene(MESH, normals=[(0, 1, 0)] * 3 + [(0, 0, 0)]), "normal of vertex 3 is zero"),
    (lambda: light.Scene(MESH, normals=[(0, 1, 0)] * 3 + [(0, NAN, 0)]), "normal of vertex 3"),
    (lambda: light.Scene(MESH, [light.Lambertian(light.Checker(1, 0))]), "material 0 has a texture, exp"),
    (lambda: Paths(bounces=-1), "bounces is -1"),
    (lambda: Paths(jitter="none"), "jitter is 'none', expected one of shared, off, pixel"),
    (lambda: Paths(clamp=0.0), "clamp is 0.0"),
    (lambda: Hybrid(jitter="pixel"), "jitter is 'pixel', expected one of shared, off"),
    (lambda: Hybrid(occlusion_rays=65), "occlusion_rays is 65"),
    (lambda: Hybrid(shadow_length=-1.0), "shadow_length is -1.0"),
    (lambda: Hybrid(occlusion="none"), "occlusion is 'none'"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "message"), WRONG)
def test_what_cannot_be_shown_is_refused_by_name(make, message):
    with pytest.raises(atra.InputError, match=message):
        make()


NEVER = [NAN, -np.inf, object(), 1j, (1j, 0, 0), (NAN, 0, 0), b"", np.full(3, NAN)]
"""Values of which no argument is."""

NASTY = [np.inf, -1.0, -1e-300, 1e300, 1e400, "x", "", None, (), (1, 2), (1, 2, 3, 4), [[1]], np.zeros((0, 3)), {},
         True, ("a",) * 3, 2**70]  # fmt: skip
USUAL = {
    light.Lambertian: {}, light.Metal: {}, light.Dielectric: {}, light.Emissive: {}, light.GradientSky: {},
    light.Checker: {"first": 0.1, "second": 0.2}, light.Image: {"texels": np.zeros((1, 1, 3))},
    light.PanoramaSky: {"texels": np.zeros((1, 1, 3))}, light.Sun: {"direction": (0, -1, 0)},
    light.PointLight: {"position": (0, 1, 0)}, light.SphereLight: {"position": (0, 1, 0), "radius": 1.0},
    light.Scene: {"mesh": FLOOR}, Hybrid: {}, Paths: {}, BakeOptions: {},
}  # fmt: skip
"""Arguments without which a kind cannot be made."""

READ = {"cameras", "parts", "left_out", "is_coded", "is_nearest", "second_uv", "placement", "wrap", "factor"}
"""What readers of files set."""


@pytest.mark.parametrize("kind", USUAL, ids=lambda kind: kind.__name__)
def test_whatever_is_handed_in_is_taken_or_refused_by_name(kind):
    for name in signature(kind).parameters.keys() - READ:
        for value in NEVER:
            with pytest.raises(atra.InputError):
                kind(**(USUAL[kind] | {name: value}))
        for value in NASTY:
            with suppress(atra.InputError):
                kind(**(USUAL[kind] | {name: value}))


def test_a_texture_that_is_too_large_is_refused(monkeypatch):
    monkeypatch.setattr(textures, "MOST_TEXELS", 5)
    light.Image(np.zeros((1, 5, 3)))
    with pytest.raises(atra.InputError, match="make it smaller"):
        light.Image(np.zeros((2, 3, 3)))


@pytest.mark.parametrize(("given", "kept"), [(None, 40), (33, 33), (1, 1)])
def test_no_more_samples_are_added_than_a_picture_is_to_have(given, kept):
    scene = light.Scene(FLOOR, [light.Lambertian((0.5, 0.25, 1.0))])
    with light.HybridRenderer(scene, down(4), threads=1, most_samples=given) as renderer:
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
    scene = sphere(light.Lambertian((0.5, 0.25, 1.0)), light.GradientSky())
    camera = atra.Camera((0, 1, 3), (0, 0, 0), fov_y_degrees=45, width=21, height=14)
    part = camera.crop(left=3, top=2, width=13, height=7)
    of_kinds = {light.HybridRenderer: {"occlusion_rays": 0}, light.PathRenderer: {"bounces": 0}}
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
KINDS = [(light.HybridRenderer, Hybrid), (light.PathRenderer, Paths)]


@pytest.mark.parametrize(("kind", "options"), [*KINDS, (light.Baker, BakeOptions)])
def test_a_keyword_has_the_default_that_its_options_value_has(kind, options):
    shown = {one.name: one.default for one in signature(kind).parameters.values() if one.kind is one.KEYWORD_ONLY}
    assert shown == vars(options())


@pytest.mark.parametrize(("kind", "options"), KINDS)
def test_every_option_restarts_or_stays_or_is_refused_as_the_table_says(kind, options):
    names = {field.name for field in fields(options)}
    assert names <= RESTARTS.keys() | STAYS.keys() | set(options.built_with)
    scene = light.Scene(FLOOR, [light.Lambertian((0.5, 0.25, 1.0))], lights=[light.Sun((0, -1, 0))])
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


def test_a_picture_needs_a_sample_and_a_number_of_them():
    scene = light.Scene(MESH, lights=[light.Sun((0, -1, 0))])
    with light.HybridRenderer(scene, down(4), threads=1) as renderer:
        for look in (lambda: renderer.image, lambda: renderer.openness, renderer.lit, lambda: renderer.save("a.png")):
            with pytest.raises(atra.InputError, match="no sample yet"):
                look()
        for wrong in (0, -1, 1.5):
            with pytest.raises(atra.InputError, match="samples is"):
                renderer.add(wrong)
        with pytest.raises(atra.InputError, match="light is 1, but the scene has 1"):
            renderer.lit(1)
        with pytest.raises(TypeError, match="unexpected keyword argument 'depth'"):
            renderer.update(depth=3)
    with pytest.raises(atra.ClosedError, match="closed"):
        renderer.add(1)


def test_shares_that_paths_do_not_count_are_refused_by_name():
    with light.PathRenderer(light.Scene(MESH, lights=[light.Sun((0, -1, 0))]), down(4), threads=1) as renderer:
        renderer.add(1)
        for look, name in ((lambda: renderer.openness, "openness"), (renderer.lit, "light 0")):
            with pytest.raises(atra.InputError, match=f"a PathRenderer counts no {name}"):
                look()


def test_light_beyond_all_numbers_is_reported_with_its_pixel_and_leaves_nothing_behind():
    camera = atra.Camera((0, 0, 0), (0, 0, -1), fov_y_degrees=40, width=4, height=2)
    texels = np.full((1, 360, 3), 0.5)
    texels[0, 188:193] = 3e38  # what the pixels of the third column see
    scene = light.Scene(quads([floor(0.001, height=-50)]), sky=light.PanoramaSky(texels))
    brighter = replace(scene, sky=light.PanoramaSky(texels, power=2.0))
    with light.PathRenderer(brighter, camera, threads=1) as renderer:
        with pytest.raises(atra.AtraError, match=r"sample 0 of pixel \(2, 0\) is inf"):
            renderer.add(2)
        assert renderer.samples == 0
        renderer.update(scene=scene)
        renderer.add(1)
        assert np.isfinite(renderer.image).all()


def test_an_interrupted_sample_leaves_no_torn_picture(monkeypatch):
    scene = light.Scene(MESH)
    with light.PathRenderer(scene, down(4), threads=1) as renderer:
        renderer.add(2)
        expected = renderer.image

        def interrupt(*_):
            raise KeyboardInterrupt

        monkeypatch.setattr("atra.light.pictures.paths.follow_depth_first", interrupt)
        with pytest.raises(KeyboardInterrupt):
            renderer.add(1)
        monkeypatch.undo()
        assert renderer.samples == 0
        renderer.add(2)
        np.testing.assert_array_equal(renderer.image, expected)


@pytest.mark.parametrize("kind", [light.PathRenderer, light.HybridRenderer])
@pytest.mark.parametrize("first", [1, 32])  # also where float32 sums begin again
def test_a_picture_that_is_stopped_between_waves_keeps_its_samples_and_goes_on(kind, first):
    whole, renderer = (kind(light.Scene(MESH), down(64), threads=1) for _ in range(2))
    with whole, renderer:
        whole.add(first)
        expected = whole.image
        assert renderer.add(first - 1 or 1, stop=lambda: False)
        answers = iter([False] * (4 if first > 1 else 1) + [True])  # two waves a sample: stopped within one
        assert not renderer.add(9, stop=lambda: next(answers))
        assert renderer.samples == first
        np.testing.assert_array_equal(renderer.image, expected)
        whole.add(2)
        assert renderer.add(2)
        np.testing.assert_array_equal(renderer.image, whole.image)


def test_sums_that_would_not_fit_are_refused_before_they_are_made(monkeypatch):
    monkeypatch.setattr("psutil.virtual_memory", lambda: SimpleNamespace(available=20 << 20))
    with pytest.raises(atra.MemoryBudgetError, match="sums of 1,048,576 pixels"):
        light.PathRenderer(light.Scene(MESH), down(1024), threads=1)


def test_pictures_are_written_as_their_names_say(tmp_path):
    scene = light.Scene(quads([floor(0.5)]), [light.Lambertian((0.25, 0.5, 0.75))], sky=light.constant_sky(1.0))
    camera = down(16, height=12)
    with light.PathRenderer(scene, camera, threads=1) as renderer:
        renderer.add(2)
        renderer.save(tmp_path / "a.png", exposure=1.0, tone="agx")
        shown = np.asarray(Image.open(tmp_path / "a.png"))
        np.testing.assert_array_equal(shown, srgb_of(light.toned(renderer.image, 1.0, "agx")))
        with pytest.raises(atra.InputError, match=r"ends in \.png or \.exr"):
            renderer.save(tmp_path / "a.jpg")
        exr = pytest.importorskip("OpenEXR")
        renderer.save(tmp_path / "a.exr")
        hits = renderer.tracer.trace((0.5, 0.5))
        parts = exr.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
        np.testing.assert_array_equal(np.stack([parts[name].pixels for name in "RGB"], -1), renderer.image)
        np.testing.assert_array_equal(parts["Z"].pixels, hits.depth)
        np.testing.assert_array_equal(parts["prim_id"].pixels, hits.prim_id)
        normals = np.stack([parts[f"N.{name}"].pixels for name in "XYZ"], -1)
        np.testing.assert_array_equal(normals[hits.hit], np.broadcast_to([0, 1, 0], (hits.hit.sum(), 3)))
        albedo = np.stack([parts[f"albedo.{name}"].pixels for name in "RGB"], -1)
        np.testing.assert_allclose(albedo[6, 8], (0.25, 0.5, 0.75), rtol=1e-5)
        assert (parts["samples"].pixels == 2).all()
        assert (albedo[0, 0] == 1).all()
        assert 0 < hits.hit.mean() < 1
        assert (normals[~hits.hit] == 0).all()


def test_without_openexr_an_exr_is_refused_saying_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "OpenEXR", None)
    with light.PathRenderer(light.Scene(MESH), down(4), threads=1) as renderer:
        renderer.add(1)
        with pytest.raises(atra.InputError, match="pip install openexr"):
            renderer.save(tmp_path / "a.exr")
