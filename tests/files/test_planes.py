"""Planes as files, read back by other programs' readers."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import atra
from atra.files.saving import encode_png, encode_tiff
from tests.images import draw
from tests.meshes import cornell_box, cornell_camera

cv2 = pytest.importorskip("cv2", reason="OpenCV, a test dependency, is the other reader of 16-bit files")


@pytest.fixture(scope="module")
def hits():
    return draw(cornell_box(), cornell_camera(48, 36))


def read(path):
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (1, 1)])
@pytest.mark.parametrize(("encode", "kind"), [(encode_png, "u1"), (encode_png, "u2"), (encode_tiff, "f4")])
def test_other_programs_read_the_same_numbers_from_a_png_and_a_tiff(encode, kind, shape, tmp_path):
    image = (np.random.default_rng(1).random(shape) * 256 ** int(kind[1])).astype(kind)
    (tmp_path / "a.png").write_bytes(encode(image))  # OpenCV looks at the bytes
    found = read(tmp_path / "a.png")
    assert found.dtype == kind
    np.testing.assert_array_equal(found[..., ::-1] if len(shape) == 3 else found, image)
    if len(shape) == 2:
        np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), image)


def test_a_depth_png_holds_millimetres_and_0_for_a_miss(hits, tmp_path):
    paths = hits.save_planes(tmp_path / "view", ["depth", "ids", "normal", "mask", "preview"], "png")
    names = ("depth", "prim_id", "normals", "mask", "preview")
    assert paths == [tmp_path / f"view.{name}.png" for name in names]
    depth, ids, normals, mask, preview = (read(path) for path in paths)
    np.testing.assert_array_equal(depth, np.where(hits.hit, np.rint(hits.depth.astype(float) * 1000), 0))
    np.testing.assert_array_equal(ids, np.where(hits.hit, hits.prim_id.astype(np.int64) + 1, 0))
    np.testing.assert_array_equal(mask == 255, hits.hit)
    np.testing.assert_allclose(normals[hits.hit][:, ::-1] / 65535 * 2 - 1, hits.normals[hits.hit], atol=2e-5)
    assert preview.dtype == np.uint8
    tenths = read(*hits.save_planes(tmp_path / "view", ["depth"], "png", depth_scale=10_000))
    np.testing.assert_allclose(tenths[hits.hit] / 1e4, hits.depth[hits.hit], atol=5.1e-5)


def test_instances_and_materials_are_numbers_of_the_file_from_1(hits, tmp_path):
    numbers = np.arange(hits.mesh.triangle_count, dtype=np.int32)
    sources = atra.FaceSources(numbers.astype(np.uint32), numbers % 3 - 1, numbers % 5 - 1)
    paths = hits.save_planes(tmp_path / "view", ["instance", "material"], "png", sources=sources)
    for path, modulus in zip(paths, (5, 3), strict=True):
        image = read(path)
        assert image.dtype == np.uint16
        np.testing.assert_array_equal(image, np.where(hits.hit, hits.prim_id % np.uint32(modulus), 0))
    with pytest.raises(atra.InputError, match=r"the plane material needs face sources of the mesh's .*, none were"):
        hits.save_planes(tmp_path / "view", ["material"], "png")
    fewer = atra.FaceSources(sources.face[:3], sources.material[:3], sources.node[:3])
    with pytest.raises(atra.InputError, match=r"those of 3 were given"):
        hits.save_planes(tmp_path / "view", ["instance"], "npz", sources=fewer)


def test_previews_have_a_colour_for_each_triangle_and_each_direction(hits, tmp_path):
    paths = hits.save_planes(tmp_path / "view", ["preview_ids", "preview_normals"], "png")
    ids, normals = (read(path)[..., ::-1] for path in paths)
    assert ids.dtype == normals.dtype == np.uint8
    colours = {tuple(ids[hits.prim_id == prim_id][0]) for prim_id in np.unique(hits.prim_id[hits.hit])}
    assert len(colours) == len(np.unique(hits.prim_id[hits.hit]))
    assert not ids[~hits.hit].any()
    np.testing.assert_allclose(normals[hits.hit] / 127.5 - 1.0, hits.normals[hits.hit], atol=0.005)


def test_values_that_do_not_fit_16_bits_are_counted_or_saturate(hits, tmp_path):
    far = int((hits.depth[hits.hit] * 30_000 > 65535).sum())
    with pytest.raises(atra.InputError, match=rf"^{far:,} of 1,728 depths do not fit 16 bits: they reach from "):
        hits.save_planes(tmp_path / "view", ["depth"], "png", depth_scale=30_000)
    assert not list(tmp_path.iterdir())
    saturated = read(*hits.save_planes(tmp_path / "view", ["depth"], "png", depth_scale=30_000, saturate=True))
    assert (saturated == 65535).sum() == far
    many = replace(hits, prim_id=np.where(hits.hit, np.uint32(70_000), atra.MISS))
    with pytest.raises(atra.InputError, match=r"ids do not fit 16 bits.* write them as npz"):
        many.save_planes(tmp_path / "view", ["prim_id"], "png")


@pytest.mark.parametrize("format", ["npz", "npy", "tiff", "exr"])
def test_floats_keep_every_bit(format, hits, tmp_path):
    planes = ["depth", "normals"]
    paths = hits.save_planes(tmp_path / "view", planes, format)
    if format == "npz":
        with np.load(*paths) as content:
            assert list(content) == planes
            found = [content[name] for name in planes]
    elif format == "npy":
        found = [np.load(path) for path in paths]
    elif format == "tiff":
        found = [read(paths[0]), read(paths[1])[..., ::-1]]
    else:
        channels = pytest.importorskip("OpenEXR").File(str(*paths), separate_channels=True).channels()
        found = [channels["Z"].pixels, np.stack([channels[f"N.{axis}"].pixels for axis in "XYZ"], axis=-1)]
    np.testing.assert_array_equal(found[0], hits.depth)
    np.testing.assert_array_equal(found[1], hits.normals)


def test_only_planes_that_are_asked_for_are_computed(hits, tmp_path):
    fresh = replace(hits)
    fresh.save_planes(tmp_path / "view", ["depth", "prim_id", "mask"], "npz")
    assert not {"points", "normals", "_barycentric"} & set(vars(fresh))


def test_depth_is_written_along_the_axis_or_the_ray_by_name(hits, tmp_path):
    along_ray = np.load(*hits.save_planes(tmp_path / "ray", ["depth"], "npy", depth_along="ray"))
    distance = np.linalg.norm(hits.points - np.array(hits.camera.eye), axis=-1)
    np.testing.assert_allclose(along_ray[hits.hit], distance[hits.hit], rtol=1e-6)
    along_axis = np.load(*hits.save_planes(tmp_path / "axis", ["depth"], "npy", depth_along="axis"))
    np.testing.assert_array_equal(along_axis, hits.depth)


@pytest.mark.parametrize(("planes", "format", "said"), [
    (["colour"], "npz", "planes are colour, expected some of depth, prim_id"),
    ([], "npz", "planes are none, expected some of"),
    (["depth"], "bmp", "format of planes is 'bmp', expected one of npz"),
    (["points"], "png", "points as PNG would lose digits"),
])  # fmt: skip
def test_unknown_planes_and_formats_are_refused(planes, format, said, hits, tmp_path):
    with pytest.raises(atra.InputError, match=said):
        hits.save_planes(tmp_path / "view", planes, format)
