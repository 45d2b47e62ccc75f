"""Panoramas: interpolated between texels, seen, mirrored and as light, and read from files of any kind."""

import importlib.util

import numpy as np
import pytest

import atra
from atra import light
from atra.errors import InputError
from atra.files.saving import encode_exr
from tests.baked import baked, sheet, standard_error
from tests.meshes import quads
from tests.shown import batches, down, floor, picture, sphere


def looked_up(texels, ways, degrees=0.0):
    """(N, 3): a panorama in the directions of (N, 3) unit vectors, by plain arithmetic."""
    rows, columns = texels.shape[:2]
    turn = np.arctan2(ways[:, 0], -ways[:, 2]) / (2 * np.pi) + 0.5 + degrees / 360
    y, x = np.arccos(ways[:, 1]) / np.pi * rows - 0.5, turn * columns - 0.5
    found = 0.0
    for row, column in np.ndindex(2, 2):
        at = np.clip(np.floor(y).astype(int) + row, 0, rows - 1), (np.floor(x).astype(int) + column) % columns
        weight = np.abs(1 - row - y % 1) * np.abs(1 - column - x % 1)
        found = found + weight[:, None] * texels[at]
    return found


@pytest.mark.parametrize("degrees", [0.0, 100.0, -37.0])
def test_a_wall_has_the_light_of_the_interpolated_panorama_before_it(degrees):
    texels = np.zeros((6, 12, 3), np.float32)
    texels[1, 8], texels[3, 9], texels[0, 0] = (1, 2, 3), (9, 4, 1), 5
    t, s = (np.mgrid[:300, :600] + 0.5).reshape(2, -1) / ((300,), (600,))
    around, down_ = 2 * np.pi * (s - 0.5), np.pi * t
    ways = np.stack([np.sin(down_) * np.sin(around), np.cos(down_), -np.sin(down_) * np.cos(around)], axis=1)
    weights = np.maximum(ways[:, 0], 0) * np.sin(down_) * 2 * np.pi / len(t)
    expected = weights @ looked_up(texels, ways, degrees)
    wall = quads([[(0, -1, 1), (0, -1, -1), (0, 1, -1), (0, 1, 1)]])
    scene = light.Scene.plain(wall, 1.0, sky=light.PanoramaSky(texels, 1.0, degrees))
    lightmap = baked(scene, sheet(scene.mesh, 8), 1024)
    error = 4 * standard_error(lightmap).mean() / 8
    np.testing.assert_allclose(lightmap.environment.mean(axis=0), expected, atol=error)
    assert error < 0.02 * expected.mean()


@pytest.mark.parametrize("shape", [(1, 1, 3), (3, 5, 3), (8, 16, 3)])
def test_in_a_sky_of_one_colour_a_ball_has_its_albedo_times_that(shape):
    ball = sphere(light.Lambertian((0.8, 0.5, 0.2)), light.PanoramaSky(np.full(shape, 2.0, np.float32)), segments=8)
    found = batches(ball, down(8, fov=16), 8, 64, bounces=1, jitter="pixel").mean(axis=(1, 2))
    np.testing.assert_allclose(found.mean(axis=0), (1.6, 1.0, 0.4), rtol=5e-3)


@pytest.mark.parametrize("kind", [light.PathRenderer, light.HybridRenderer])
@pytest.mark.parametrize("degrees", [0.0, 90.0, -37.0])
def test_a_panorama_is_seen_and_mirrored_where_its_texels_point_without_steps(kind, degrees):
    """Row 0 is above, the middle column along -z; a turn is counterclockwise seen from above."""
    texels = np.random.default_rng(2).random((8, 16, 3), np.float32)
    scene = light.Scene(quads([floor(50.0)]), [light.Metal((1, 1, 1))], sky=light.PanoramaSky(texels, 2.0, degrees))
    for target in ((0, 2.5, -1), (1, 1.5, 0.5)):
        camera = atra.Camera((0, 2, 0), target, fov_y_degrees=60, width=32, height=32)
        ways = camera.rays_world()[1].reshape(-1, 3)
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        if kind is light.PathRenderer:  # hybrid frames mirror no sky
            ways[:, 1] = np.abs(ways[:, 1])
        is_sky = ways[:, 1] > 0.05
        image = picture(kind, scene, camera, 1, jitter="off").reshape(-1, 3)
        expected = 2.0 * looked_up(texels, ways, degrees)
        assert is_sky.sum() > 60
        np.testing.assert_allclose(image[is_sky], expected[is_sky], rtol=1e-4, atol=2e-4)


openexr = pytest.mark.skipif(importlib.util.find_spec("OpenEXR") is None, reason="OpenEXR is not installed")

HEAD = b"#?RADIANCE\n# made by a test\nFORMAT=32-bit_rle_rgbe\n\n"


def sky(height=8, width=16):
    """Dark, with runs of equal texels and a bright place."""
    texels = np.random.default_rng(2).random((height, width, 3)).astype(np.float32)
    texels[height // 2 :] = 0.25
    texels[1, 3] = 1000.0
    return texels


def exr_of(texels, **others):
    return encode_exr({channel: texels[..., k] for k, channel in enumerate("RGB")} | others)


def hdr_of(texels):
    cv2 = pytest.importorskip("cv2")
    return bytes(cv2.imencode(".hdr", np.ascontiguousarray(texels[..., ::-1]))[1])


def written(folder, name, content):
    path = folder / name
    path.write_bytes(content)
    return path


@openexr
def test_an_exr_is_read_to_the_bit_and_an_hdr_as_another_reader_does(tmp_path):
    texels = sky()
    path = written(tmp_path, "sky.exr", exr_of(texels, A=texels[..., 0]))
    np.testing.assert_array_equal(light.PanoramaSky.load(path).texels, texels)
    half = texels.astype(np.float16)
    path = written(tmp_path, "half.exr", exr_of(half))
    np.testing.assert_array_equal(light.PanoramaSky.load(path).texels, half.astype(np.float32))
    cv2 = pytest.importorskip("cv2")
    for shape in ((8, 16), (5, 300), (3, 4)):  # rows of 4 texels are stored as they are
        content = hdr_of(sky(*shape))
        theirs = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)[..., ::-1]
        ours = light.PanoramaSky.load(written(tmp_path, "sky.HDR", content), 2.0)
        np.testing.assert_array_equal(ours.texels, theirs)
        assert ours.power == 2.0
        np.testing.assert_allclose(ours.texels, sky(*shape), atol=0.01, rtol=0.01)


def test_an_hdr_without_runs_is_read(tmp_path):
    rows = bytes([128, 64, 0, 129, 0, 255, 255, 121]) * 3
    path = written(tmp_path, "sky.hdr", HEAD + b"-Y 3 +X 2\n" + rows)
    expected = np.float32([[(1.0, 0.5, 0.0), (0.0, 255 / 2**15, 255 / 2**15)]] * 3)
    np.testing.assert_array_equal(light.PanoramaSky.load(path).texels, expected)


ROW = bytes([2, 2, 0, 8]) + bytes([136, 128] * 4)


@pytest.mark.parametrize(("name", "content", "told"), [
    ("sky.jpg", b"", r"has the suffix '\.jpg', expected \.exr or \.hdr"),
    ("sky.hdr", b"", "expected #.RADIANCE"),
    ("sky.hdr", HEAD.replace(b"rgbe", b"xyze") + b"-Y 1 +X 8\n" + ROW, "expected #.RADIANCE"),
    ("sky.hdr", HEAD + b"+X 8 -Y 1\n" + ROW, "a size as -Y 512"),
    ("sky.hdr", HEAD + b"-Y 99999999 +X 999999\n" + ROW, r"claims 999,999 x 99,999,999 pixels, .* allowed 128 MiB"),
    ("sky.hdr", HEAD + b"-Y 2 +X 8\n" + ROW, "promise 8 x 2"),
    ("sky.hdr", HEAD + b"-Y 2 +X 8\n" + ROW + ROW[:3] + b"\t" + ROW[4:], "row 1 does not begin"),
    ("sky.hdr", HEAD + b"-Y 1 +X 8\n" + ROW.replace(b"\x88", b"\x89"), "row 0 is damaged"),
    ("sky.hdr", HEAD + b"-Y 1 +X 8\n" + ROW.replace(b"\x88", b"\x00"), "row 0 is damaged"),
    ("sky.hdr", HEAD + b"-Y 1 +X 8\n" + ROW[:-1] + b"", "promise 8 x 1"),
    ("sky.hdr", HEAD + b"-Y 0 +X 0\n", "its radiance has shape"),
])  # fmt: skip
def test_a_broken_file_is_refused_by_its_name(tmp_path, name, content, told):
    with pytest.raises(InputError, match=rf"the sky '.*{name}'.*{told}"):
        light.PanoramaSky.load(written(tmp_path, name, content))


def test_a_file_that_is_not_there_is_refused(tmp_path):
    for path in (tmp_path / "none.exr", tmp_path):
        with pytest.raises(InputError, match="the sky"):
            light.PanoramaSky.load(path)


@openexr
def test_an_exr_that_holds_no_sky_is_refused(tmp_path):
    texels = sky()
    whole = exr_of(texels)
    dark = texels.copy()
    dark[2, 5, 1] = -1.0
    window = whole.index(b"dataWindow")
    huge = whole[:window] + whole[window:].replace(np.array([15, 7], np.int32).tobytes(), b"\xff\x1f\x00\x00" * 2, 1)
    for content, told in (
        (whole[:100], "cannot be used"), (whole[: len(whole) // 2], "cannot be used"),
        (huge, r"cannot be used: it claims 201,326,592 numbers, .* allowed 128 MiB"),
        (encode_exr({"Y": texels[..., 0]}), "its channels are Y, expected R, G and B"),
        (exr_of(dark), "at column 5 of row 2, expected numbers >= 0"),
        (exr_of(np.where(texels > 100, np.inf, texels)), "at column 3 of row 1"),
    ):  # fmt: skip
        path = written(tmp_path, "sky.exr", content)
        with pytest.raises(InputError, match=rf"the sky '.*sky.exr'.*{told}"):
            light.PanoramaSky.load(path)


@openexr
def test_texels_below_0_by_rounding_become_0_with_one_warning_and_all_others_stay(tmp_path):
    texels = sky()
    texels[5, 2, 1], texels[6, 3] = -4.5e-6, -1e-6
    path = written(tmp_path, "sky.exr", exr_of(texels))
    with pytest.warns(UserWarning, match="below 0") as told:
        loaded = light.PanoramaSky.load(path)
    assert [str(one.message) for one in told] == ["sky.exr: 2 texels below 0, the lowest -4.5e-06, are taken as 0"]
    np.testing.assert_array_equal(loaded.texels, np.maximum(texels, 0.0))
    texels[0, 0, 0] = np.nan
    path.write_bytes(exr_of(texels))
    with pytest.raises(InputError, match=r"nan, .* at column 0 of row 0"):
        light.PanoramaSky.load(path)
