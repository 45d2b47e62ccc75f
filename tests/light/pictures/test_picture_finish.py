"""From samples to a picture: exposure, tone, layers, denoising, stopping, and going on after an interruption."""

import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import atra
from atra import light
from atra.light.pictures.files import srgb_of
from scenes.lit.rooms import lit_cornell_box
from tests.folders import ROOT
from tests.shown import down, floor, rectangles

SCENE = lit_cornell_box()
CAMERA = atra.Camera((0, 1, 3.4), (0, 1, 0), fov_y_degrees=40, width=64, height=48)


def made(**options):
    return light.PathRenderer(SCENE, CAMERA, threads=1, **options)


@pytest.mark.parametrize(("tone", "linear", "shown"), [
    ("none", (4.0, 1.0, 0.25), (4.0, 1.0, 0.25)),
    ("neutral", (0.18, 0.18, 0.18), (0.14, 0.14, 0.14)),
    ("neutral", (0.02, 0.5, 0.1), (0.0025, 0.4825, 0.0825)),
    ("neutral", (4.0, 1.0, 0.25), (0.9833, 0.4683, 0.3396)),
    ("agx", (0.18, 0.18, 0.18), (0.2145, 0.2145, 0.2145)),
    ("agx", (4.0, 1.0, 0.25), (0.9365, 0.6236, 0.4374)),
])  # fmt: skip
def test_tone_maps_have_the_values_of_their_specifications(tone, linear, shown):
    np.testing.assert_allclose(light.toned(np.array([[linear]]), 0.0, tone)[0, 0], shown, atol=2e-4)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_light_is_shown_by_the_nearest_level_of_srgb(kind):
    dark, bright = np.arange(1 << 14) / 2.0**20, np.arange(1 << 16) / 2.0**16
    linear = np.concatenate([dark, bright]).astype(kind)[:, None]
    exact = linear.astype(np.float64)
    encoded = np.where(exact <= 0.0031308, 12.92 * exact, 1.055 * exact ** (1 / 2.4) - 0.055)
    np.testing.assert_array_equal(srgb_of(linear), np.rint(255 * encoded))
    beyond = np.array([[1.0, 1.5, np.inf], [-0.0, -1.0, -np.inf], [np.nan, 0.0, 1e-30]], kind)
    assert srgb_of(beyond).tolist() == [[255] * 3, [0] * 3, [0] * 3]


@pytest.mark.parametrize("tone", ["neutral", "agx"])
def test_tone_maps_keep_the_order_of_greys_and_end_below_white(tone):
    greys = np.repeat(np.geomspace(1e-3, 1e3, 200), 3).reshape(1, -1, 3)
    shown = light.toned(greys, 0.0, tone)[0]
    assert (np.diff(shown[:, 1]) > -1e-4).all()
    assert shown.max() <= 1.0
    assert shown[-1].min() > 0.9
    assert np.ptp(shown, axis=1).max() < 2e-3, "greys have a colour"


def test_automatic_exposure_undoes_any_power_of_the_light_and_is_a_number_of_stops():
    image = np.random.default_rng(1).gamma(1.0, 1.0, (16, 16, 3)).astype(np.float32)
    first = light.stops_of(image, "auto")
    assert light.stops_of(image / 8, "auto") == pytest.approx(first + 3.0, abs=1e-5)
    assert np.median(light.toned(image, first)) > 0.1
    assert light.stops_of(np.zeros((2, 2, 3)), "auto") == 0.0
    assert light.stops_of(image, "-1.5") == light.stops_of(image, -1.5) == -1.5
    for wrong in ("bright", 65, float("nan"), None):
        with pytest.raises(atra.InputError, match="exposure is"):
            light.stops_of(image, wrong)
    with pytest.raises(atra.InputError, match="tone is 'filmic', expected one of none, neutral, agx"):
        light.toned(image, 0.0, "filmic")


def test_denoising_comes_nearer_to_many_samples(tmp_path):
    pytest.importorskip("pyoidn", reason="pyoidn is not installed: pip install -e '.[denoise]'")
    with made() as renderer:
        renderer.add(8)
        raw, clean = renderer.image, renderer.denoised()
        renderer.add(504)
        truth = renderer.image
    assert np.abs(clean - truth).mean() < 0.7 * np.abs(raw - truth).mean()


def test_the_estimated_error_is_that_against_many_samples_within_half_of_it():
    small = replace(CAMERA, width=32, height=24)
    with light.PathRenderer(SCENE, small, threads=1, jitter="pixel") as renderer:
        steps, images = [], {}
        for step in light.accumulate(renderer, 96):
            steps.append(step)
            images[step.samples] = renderer.image @ np.array((0.2126, 0.7152, 0.0722))
        renderer.add(928)
        truth = renderer.image @ np.array((0.2126, 0.7152, 0.0722))
    for samples in (16, 32, 64, 96):
        true = np.sqrt(((images[samples] - truth) ** 2).mean()) / truth.mean()
        assert true / 1.5 < steps[samples - 1].error < 1.5 * true
    assert [one.samples for one in steps] == list(range(1, 97))
    assert steps[0].error is None
    assert steps[-1].is_done
    assert not steps[-2].is_done


def test_a_picture_ends_at_the_first_of_its_limits():
    with made() as renderer:
        *_, last = light.accumulate(renderer, 4096, error=0.5)
        assert last.is_done
        assert last.error <= 0.5
        assert 2 <= last.samples < 4096
        renderer.restart()
        *_, last = light.accumulate(renderer, 1 << 20, minutes=1e-3)
        assert last.is_done
        assert last.elapsed_s >= 0.06
        for limits in ({}, {"samples": 0}, {"error": 0.0}, {"minutes": -1}):
            with pytest.raises(atra.InputError, match=r"samples|error|minutes"):
                next(light.accumulate(renderer, **limits))


@pytest.mark.parametrize("samples", [3, 40])  # within the first float32 sums, and after them
def test_a_state_goes_on_to_the_same_bits_in_another_renderer(tmp_path, samples):
    with made() as renderer:
        list(light.accumulate(renderer, 48, error=1e-9))
        expected = renderer.image
    path = tmp_path / "state"
    with made() as renderer:
        for step in light.accumulate(renderer, 48, error=1e-9, state=path, save_every_s=0.0):
            if step.samples == samples:
                break
    with made() as other:
        steps = list(light.accumulate(other, 48, error=1e-9, state=path))
        assert steps[0].samples == samples + 1
        np.testing.assert_array_equal(other.image, expected)
    assert path.exists()  # the error was not reached


def test_a_state_of_another_picture_is_refused(tmp_path):
    path = tmp_path / "state"
    with made() as renderer:
        next(light.accumulate(renderer, 4, state=path, save_every_s=0.0))
    brighter = replace(SCENE, sky=light.constant_sky(0.1))
    others = (
        made(bounces=2),
        light.PathRenderer(brighter, CAMERA, threads=1),
        light.PathRenderer(SCENE, replace(CAMERA, fov_y_degrees=41), threads=1),
    )
    for other in others:
        with other, pytest.raises(atra.InputError, match="cannot be resumed: it is of another scene, camera, option"):
            next(light.accumulate(other, 4, state=path))
    path.write_bytes(path.read_bytes()[:-100])
    with made() as renderer, pytest.raises(atra.InputError, match="is no state of a picture"):
        next(light.accumulate(renderer, 4, state=path))


KILLED = """
import sys
from atra import light
from tests.light.pictures.test_picture_finish import made
with made() as renderer:
    for step in light.accumulate(renderer, 150, state=sys.argv[1], save_every_s=0.0):
        print(step.samples, flush=True)
    renderer.save(sys.argv[2])
"""


@pytest.mark.slow
def test_killed_while_it_renders_a_picture_goes_on_to_the_same_file(tmp_path):
    def start(state, picture):
        given = [sys.executable, "-c", KILLED, str(tmp_path / state), str(tmp_path / picture)]
        return subprocess.Popen(given, cwd=ROOT, stdout=subprocess.PIPE, text=True)

    start("a.state", "whole.exr").communicate()
    one = start("b.state", "resumed.exr")
    assert one.stdout.readline() == "1\n"
    time.sleep(0.05)
    one.send_signal(signal.SIGKILL)
    one.communicate()
    said, _ = start("b.state", "resumed.exr").communicate()
    assert 1 < int(said.split()[0]) < 150
    assert (tmp_path / "resumed.exr").read_bytes() == (tmp_path / "whole.exr").read_bytes()


def test_the_time_left_knows_nothing_of_the_first_sample_which_compiles(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr("atra.light.pictures.finish.accumulate.monotonic", lambda: clock[0])

    class Slow:
        samples, image = 0, np.ones((2, 2, 3), np.float32)

        def add(self, count):
            clock[0] += 2.0 if self.samples else 60.0
            self.samples += count

    left = [step.left_s for step in light.accumulate(Slow(), 5)]
    assert left == [None, 6.0, 4.0, 2.0, 0.0]


def test_what_ends_before_the_asked_error_goes_on_where_it_was(tmp_path):
    path = tmp_path / "state"
    counts = []
    for limits in ({"samples": 3}, {"minutes": 1e-4}, {"samples": 12}):
        with made() as renderer:
            steps = list(light.accumulate(renderer, error=1e-9, state=path, **limits))
            counts.append((steps[0].samples, steps[-1].samples))
    assert path.exists()
    assert counts[0] == (1, 3)
    assert counts[1][0] == 4
    assert counts[2] == (counts[1][1] + 1, 12)
    with made(most_samples=14) as renderer:
        assert [step.samples for step in light.accumulate(renderer, 20, state=path)] == [13, 14]
    assert path.exists()
    with made() as renderer:
        assert [step.samples for step in light.accumulate(renderer, 15, error=0.9, state=path)] == []
    assert not path.exists()


@pytest.mark.parametrize("opacity", [1.0, 0.25])
def test_a_transparent_picture_has_the_share_of_each_pixel_that_is_hit_and_no_sky_in_its_colours(tmp_path, opacity):
    """The left half of a floor that reflects half of a white sky, seen from above by five columns."""
    half = [(-50, 0, 50), (0, 0, 50), (0, 0, -50), (-50, 0, -50)]
    material = light.MetallicRoughness((0.5, 0.5, 0.5), opacity, "blend", ior=1.0)
    scene = rectangles((half, material), sky=light.constant_sky(1.0))
    options = {"bounces": 1, "jitter": "pixel", "transparent": True, "lights": "found"}
    with light.PathRenderer(scene, down(5), threads=1, **options) as renderer:
        renderer.add(256)
        renderer.save(tmp_path / "half.png")
        alpha, image = renderer.alpha, renderer.image
        expected = np.broadcast_to(opacity * np.array([1, 1, 0.5, 0, 0]), (5, 5))
        np.testing.assert_allclose(alpha, expected, atol=0.05)
        assert (alpha[:, 3:] == 0.0).all()
        np.testing.assert_allclose(image, 0.5 * alpha[..., None] + np.zeros(3), atol=0.02)
        levels = np.asarray(Image.open(tmp_path / "half.png")).astype(int)
        np.testing.assert_allclose(levels[..., 3], 255 * alpha, atol=0.51)
        np.testing.assert_allclose(levels[:, :3, :3], 188, atol=8)  # half of white, coded
        openexr = pytest.importorskip("OpenEXR")
        renderer.save(tmp_path / "half.exr")
        with openexr.File(str(tmp_path / "half.exr"), separate_channels=True) as file:
            np.testing.assert_array_equal(file.channels()["A"].pixels, alpha)
            np.testing.assert_array_equal(file.channels()["R"].pixels, image[..., 0])


@pytest.mark.parametrize("kind", [light.PathRenderer, light.HybridRenderer])
def test_layers_hold_colours_and_shading_normals_of_the_one_surface_behind_what_the_eye_looks_through(
    kind, monkeypatch
):
    pane, ramp = floor(9.0, 1.0)[::-1], [(-9, -9, 9), (9, 9, 9), (9, 9, -9), (-9, -9, -9)]  # the eye sees a pane's back
    thin, dull = light.MetallicRoughness((0.1, 0.2, 0.9), is_double=False), light.Lambertian((0.8, 0.4, 0.2))
    tilted = np.array([(0.6, 0.8, 0.0)] * 8, np.float32)
    scene = rectangles((pane, thin), (ramp, dull), normals=tilted)
    with kind(scene, down(4, eye=(-2, 4, 0), fov=5), threads=1) as renderer:
        renderer.add(1)
        monkeypatch.setattr("atra.rays.kernel_scene.EmbreeScene", None)  # a second scene cannot be built
        layers = renderer.layers()
    np.testing.assert_allclose(layers.albedo, np.broadcast_to([0.8, 0.4, 0.2], (4, 4, 3)), rtol=1e-6)
    np.testing.assert_allclose(layers.normals, np.broadcast_to(tilted[0], (4, 4, 3)), atol=1e-6)


def test_the_colour_layer_shows_a_lamp_as_its_light_up_to_white():
    scene = rectangles((floor(), light.Emissive((4.0, 0.5, 0.0))))
    with light.PathRenderer(scene, down(2), threads=1) as renderer:
        np.testing.assert_allclose(renderer.layers().albedo, np.broadcast_to((1.0, 0.5, 0.0), (2, 2, 3)))
