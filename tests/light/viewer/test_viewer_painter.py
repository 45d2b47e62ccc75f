"""The viewer's painter: what it shows is what renderers, tracers and the judge say, for the request and no other."""

import contextlib
import random
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from atra import MISS, InputError, PixelTracer, light
from atra.command.viewing import light_settings
from atra.judge.marks import COLOURS
from atra.light.pictures.files import srgb_of
from atra.light.pictures.finish.tone import toned
from atra.light.viewer.painter import BACKGROUND, Painter
from atra.light.viewer.request import Pose, Request, Settings
from atra.light.viewer.session import Session
from atra.raster.tracer import PreparedRaster
from scenes.built_in import make_scene
from tests.light.viewer.test_viewer_session import Screen
from tests.shown import picture

BOX = make_scene("cornell_box")
SCENE = light.Scene(BOX.mesh, [light.Lambertian((0.7, 0.5, 0.3))])
POSE = Pose((0.0, 0.8, 3.4), (0.0, 0.8, 0.0), (0.0, 1.0, 0.0), 50.0)
SETTINGS = Settings(side=64, samples=2, occlusion_length=0.5)
FIRST = Request(POSE, SETTINGS)


def made(**changes):
    return Painter(replace(SCENE, **changes), threads=1)


@pytest.fixture
def painter():
    with contextlib.closing(made()) as one:
        yield one


def with_settings(**settings):
    return Request(POSE, replace(SETTINGS, **settings))


def shown(painter, request, samples=1):
    for _ in range(samples):
        assert painter.add(request, lambda: False)
    return painter.show(request).image


def test_samples_under_a_panorama_accumulate_and_its_power_costs_none():
    texels = np.random.default_rng(1).random((4, 8, 3)).astype(np.float32)
    brighter = with_settings(sky_power=2.0)
    with contextlib.closing(made(sky=light.PanoramaSky(texels))) as one:
        first = shown(one, FIRST, 2)
        assert one.show(brighter).image.mean() > first.mean() + 10
        assert np.array_equal(one.show(FIRST).image, first)
        other = replace(SCENE, sky=light.PanoramaSky(texels[::-1], 0.5), lights=one._scene_of(SETTINGS).lights)
        renderer = one._renderer(FIRST)
        assert renderer.samples == 2
        renderer.update(scene=other)
        assert renderer.samples == 0


def test_a_request_changes_the_scene_s_first_sun_and_leaves_its_other_lights():
    lights = [light.PointLight((0.0, 1.0, 0.0)), light.Sun((0.0, -1.0, 0.0)), light.Sun((1.0, -1.0, 0.0), power=0.5)]
    one = made(lights=lights)
    chosen = one._scene_of(replace(SETTINGS, sun_power=3.0))
    assert (chosen.lights[0].power, *chosen.lights[1:]) == (3.0, lights[0], lights[2])
    assert one._scene_of(replace(SETTINGS, sun_power=0.0)).lights == (lights[0], lights[2])
    dark = with_settings(sun_power=0.0)
    assert not dark.keeps_samples_of(FIRST)
    assert not FIRST.keeps_samples_of(dark)


def test_a_picture_is_denoised_once_with_its_last_sample_or_keeps_its_noise_and_says_why(painter, monkeypatch):
    given = []

    def halved(renderer):
        given.append(renderer.image)
        return renderer.image / 2

    monkeypatch.setattr(light.Renderer, "denoised", halved)
    plain, denoised = FIRST, with_settings(denoise=True)
    assert denoised.keeps_samples_of(plain)
    assert np.array_equal(shown(painter, denoised), painter.show(plain).image)  # one of two samples
    quiet = shown(painter, denoised)
    (image,) = given
    assert np.array_equal(quiet, srgb_of(toned(image / 2, tone=plain.settings.tone)))
    brighter = painter.show(with_settings(denoise=True, exposure=1.0)).image
    assert np.array_equal(brighter, srgb_of(toned(image, tone=plain.settings.tone)))
    assert len(given) == 1
    painter.show(with_settings(denoise=True, sky_power=2.0))
    assert len(given) == 2
    assert "denoise" in painter.show(denoised).stage_s
    assert "denoise" not in painter.show(plain).stage_s

    def missing(_):
        raise InputError("denoising needs the package pyoidn")

    monkeypatch.setattr(light.Renderer, "denoised", missing)
    noisy = painter.show(with_settings(denoise=True, sky_power=3.0))
    assert np.array_equal(noisy.image, painter.show(with_settings(sky_power=3.0)).image)
    assert noisy.note == "denoising needs the package pyoidn"


def single_rays(camera):
    with PixelTracer(BOX.mesh, camera, packet_width=1, threads=1) as tracer:
        return tracer.trace()


def test_a_picture_is_the_renderer_s_own_and_exposure_and_tone_cost_no_sample(painter):
    scene = painter._scene_of(SETTINGS)
    kinds = {"hybrid": (light.HybridRenderer, {"occlusion_length": 0.5}), "path": (light.PathRenderer, {})}
    for frame, (kind, options) in kinds.items():
        request = with_settings(frame=frame)
        other = with_settings(frame=frame, exposure=-1.5, tone="agx")
        image = picture(kind, scene, request.camera, 2, **options)
        assert np.array_equal(shown(painter, request, 2), srgb_of(toned(image, tone=request.settings.tone)))
        assert other.keeps_samples_of(request)
        assert np.array_equal(painter.show(other).image, srgb_of(toned(image, -1.5, "agx")))


@pytest.mark.parametrize("direction", [(-0.4, -1.0, 0.3), (0.0, 0.0, 5.0), (1.0, 0.2, -1.0)])
def test_controls_of_the_sun_begin_with_the_scene_s_own(direction):
    own = light.Sun(direction, 2.0, (1.0, 0.4, 0.0), 3.0)
    settings = Settings(**light_settings(light.Scene(BOX.mesh, lights=[own], sky=light.GradientSky(power=0.3))))
    assert np.dot(settings.sun_direction, np.array(direction) / np.linalg.norm(direction)) > np.cos(np.radians(1.0))
    values = settings.sun_cone, settings.sun_power, settings.sun_colour, settings.sky_power
    assert values == (2.0, 3.0, (255, 102, 0), 0.3)
    assert light_settings(light.Scene(BOX.mesh)) == {"sky_power": 1.0, "sun_power": 0.0}


@pytest.mark.parametrize("method", ["raster", "visible_first"])
def test_shades_of_hits_are_those_of_single_rays(painter, method):
    request = with_settings(method=method, split_x=8)
    hits = single_rays(request.camera)
    ids = shown(painter, replace(request, settings=replace(request.settings, shade="prim_id")))
    expected, own = hits.prim_id.ravel(), ids.reshape(-1, 3)
    colours = {prim_id: own[expected == prim_id] for prim_id in np.unique(expected)}
    assert all((of_one == of_one[0]).all() for of_one in colours.values())
    assert len({tuple(of_one[0]) for of_one in colours.values()}) == len(colours) > 50
    assert tuple(colours[MISS][0]) == BACKGROUND

    depth = shown(painter, replace(request, settings=replace(request.settings, shade="depth")))
    order = np.argsort(hits.depth[hits.hit])
    assert (np.diff(depth[hits.hit][order, 0].astype(int)) <= 0).all(), "what is farther is lighter"
    normal = shown(painter, replace(request, settings=replace(request.settings, shade="normal")))
    back_wall = hits.hit & (hits.normals[..., 2] > 0.999)
    assert back_wall.sum() > 400
    assert (normal[back_wall] == (128, 128, 255)).all()


def test_occlusion_is_dark_in_corners_and_of_the_picture_s_frame_not_of_its_kind(painter):
    image = shown(painter, with_settings(shade="occlusion", frame="path"), 16)
    hits = single_rays(FIRST.camera)
    assert (image[~hits.hit] == 255).all()
    x, z = np.abs(hits.points[..., 0]), hits.points[..., 2]
    back_wall = hits.hit & (z < -0.999) & (hits.points[..., 1] > 1.0) & (hits.points[..., 1] < 1.3)
    assert image[back_wall & (x > 0.95)].mean() < image[back_wall & (x < 0.4)].mean() - 20


def test_right_pixels_are_white_and_a_wrong_one_is_marked_and_counted(painter, monkeypatch):
    request = with_settings(shade="wrong")
    shown(painter, request)
    assert "0 wrong" in painter.show(request).note

    draw = PreparedRaster.draw

    def tampered(self, offset, depth, prim_id):
        draw(self, offset, depth, prim_id)
        prim_id[10, 20] = 0 if prim_id[10, 20] != 0 else 1

    monkeypatch.setattr(PreparedRaster, "draw", tampered)
    picture = painter.show(request)
    assert "1 wrong" in picture.note
    (wrong,) = (colour for verdict, colour in COLOURS.items() if verdict.name == "WRONG")
    assert tuple(picture.image[10, 20]) == wrong


def test_a_sketch_has_the_pixels_of_the_picture_and_no_shadow(painter):
    sketch = painter.sketch(FIRST)
    unshadowed = with_settings(shadow_rays=0, occlusion_rays=0, jitter="off")
    assert np.array_equal(sketch.image, shown(painter, unshadowed))


def test_frames_of_a_real_session_are_those_of_their_request_alone(painter):
    chosen, screen = random.Random(2), Screen(time.monotonic)
    session = Session(painter, screen, FIRST)
    thread = threading.Thread(target=session.run)
    thread.start()
    for _ in range(60):
        eye = tuple(chosen.uniform(-0.5, 0.5) + place for place in POSE.eye)
        shade = chosen.choice(["material", "material", "material", "normal"])
        method, aspect = chosen.choice(["raster", "visible_first"]), chosen.choice([1.0, 2.0])
        other = {"shade": shade, "sun_power": chosen.choice([0.5, 1.0]), "method": method, "split_x": 8}
        session.want(replace(POSE, eye=eye, aspect=aspect), **other)
        time.sleep(chosen.choice([0.0, 0.005, 0.02]))
    end_s = time.monotonic() + 20.0
    while not (screen.frames and screen.frames[-1][1].samples == session.wanted.settings.enough):
        assert time.monotonic() < end_s, "the picture at rest never came"
        time.sleep(0.02)
    session.close()
    thread.join(20.0)
    assert not thread.is_alive()
    assert screen.told == []
    assert screen.frames[-1][1].request is session.wanted
    for _, frame in screen.frames:
        with contextlib.closing(made()) as new:
            request, samples = frame.request, frame.samples
            expected = shown(new, request, samples) if samples else new.sketch(request).image
        assert np.array_equal(frame.picture.image, expected)
