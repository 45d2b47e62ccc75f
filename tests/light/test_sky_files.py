"""Panoramas from files: what is read is what was written, it lights what it shall, and hostile files are refused."""

import importlib.util

import numpy as np
import pytest

from atra import light
from atra.errors import InputError
from atra.files.saving import encode_exr

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
