"""What hits say of the place of a hit, held against Möller–Trumbore in NumPy, and against fractions where float64 has
no digit to spare."""

import sys
from fractions import Fraction

import numpy as np
import pytest
import trimesh
from PIL import Image

import atra
from atra.errors import InputError
from atra.exact.intersection import Pairs, intersect_pixels
from tests.images import make_tracer, trace
from tests.machine import WIDEST
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, random_triangles

PINHOLE = atra.Camera((0.3, 0.1, 4.0), (0.0, 0.2, 0.0), (0.2, 1.0, 0.1), 70.0, 67, 45)
PARALLEL = atra.OrthographicCamera((0.3, 0.1, 4.0), (0.0, 0.2, 0.0), (0.2, 1.0, 0.1), 6.0, 67, 45)
HALF_A_UNIT = 2.0**-24


def hits_of(mesh, camera, prim_id, offset=(0.5, 0.5), **more):
    prim_id = np.broadcast_to(np.asarray(prim_id, np.uint32), (camera.height, camera.width))
    return atra.Hits(np.ones(prim_id.shape, np.float32), prim_id, offset, mesh, camera, **more)


def old_way(hits):
    y, x = np.nonzero(hits.hit)
    return y, x, intersect_pixels(hits.mesh, hits.camera, x, y, hits.prim_id[y, x], hits.offset)


@pytest.mark.parametrize("camera", [PINHOLE, PARALLEL])
@pytest.mark.parametrize("offset", [(0.5, 0.5), (0.0, 0.9)])
@pytest.mark.parametrize("run", [1, 5, 200])
def test_weights_and_points_are_those_of_moeller_and_trumbore(camera, offset, run):
    mesh, random = random_triangles(50, seed=run), np.random.default_rng(run)
    # Any triangle at any pixel, in runs of any length, hit or not: the planes know no edges.
    prim_id = np.repeat(random.integers(0, 60, 67 * 45), run)[: 67 * 45].reshape(45, 67).astype(np.uint32)
    prim_id[prim_id >= 50] = atra.MISS
    hits = hits_of(mesh, camera, prim_id, offset, threads=2)
    y, x, found = old_way(hits)
    never = np.isnan(found.u)
    assert 0.1 < never.mean() < 0.9
    for own, reference in ((hits.u, found.u), (hits.v, found.v)):
        assert np.isnan(own[~hits.hit]).all()
        np.testing.assert_array_equal(np.isnan(own[y, x]), never)
        np.testing.assert_allclose(own[y, x], reference, rtol=1e-6, atol=1e-9)
    corner, b, c = np.moveaxis(mesh.triangles(prim_id[y, x]), 1, 0)
    places = corner + found.u[:, None] * (b - corner) + found.v[:, None] * (c - corner)
    assert np.isnan(hits.points[~hits.hit]).all()
    np.testing.assert_allclose(hits.points[y, x], places, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("parallel", [False, True])
def test_weights_of_needles_are_as_exact_as_float64_allows(parallel):
    """Long thin triangles all but edge-on, and far from the eye, against fractions: axes and eye are exact here."""
    view = {**EYE_AT_ORIGIN, "width": 24, "height": 16}
    camera = atra.OrthographicCamera(**view, view_height=2.0) if parallel else atra.Camera(**view, fov_y_degrees=60.0)
    random = np.random.default_rng(3)
    first = random.uniform(-1, 1, (40, 3)) + (0, 0, 1000)
    edges = random.uniform(-1, 1, (40, 2, 3)) * random.choice([1e-3, 1.0, 500.0], (40, 2, 1))
    edges[::2, 1] = edges[::2, 0] * 0.7 + random.normal(0, 1e-5, (20, 3))
    edges[1::4, :, :2] *= 1e-6
    mesh = atra.Mesh(
        np.stack([first, *(first + edges[:, i] for i in (0, 1))], 1).reshape(-1, 3), np.arange(120).reshape(-1, 3)
    )
    hits = hits_of(mesh, camera, random.integers(0, 40, (16, 24)), (0.25, 0.5))
    y, x, found = old_way(hits)
    origins, directions = camera.rays(x, y, hits.offset)
    compared = 0
    for i in np.flatnonzero(np.isfinite(found.u))[:150]:
        a, b, c = (
            camera.to_camera_space(corner[None])[0] for corner in mesh.triangles(hits.prim_id[y[i], x[i]][None])[0]
        )
        o, d, a, b, c = ([Fraction(float(part)) for part in vector] for vector in (origins[i], directions[i], a, b, c))
        e1, e2, to_origin = sub(b, a), sub(c, a), sub(o, a)
        facing = dot(cross(d, e2), e1)
        volumes = dot(cross(d, e2), to_origin), dot(d, cross(to_origin, e1))
        lengths = [float(np.linalg.norm([float(part) for part in vector])) for vector in (d, e1, e2, to_origin)]
        for own, volume, edge in zip((hits.u, hits.v), volumes, (lengths[2], lengths[1]), strict=True):
            exact = volume / facing
            size = lengths[0] * edge * lengths[3] + abs(float(exact)) * lengths[0] * lengths[1] * lengths[2]
            error = abs(Fraction(float(own[y[i], x[i]])) - exact)
            assert error <= 1.001 * HALF_A_UNIT * abs(float(exact)) + 8 * 2.0**-53 * size / abs(float(facing))
            compared += 1
    assert compared > 100


def sub(a, b):
    return [p - q for p, q in zip(a, b, strict=True)]


def dot(a, b):
    return sum(p * q for p, q in zip(a, b, strict=True))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def test_a_triangle_whose_plane_holds_the_eye_or_lies_behind_it_has_a_normal_and_no_weights():
    camera = atra.Camera(**EYE_AT_ORIGIN, width=20, height=10)
    edge_on = [(0, 0.1, 1), (0, -0.1, 1), (0, 0.1, 9)]  # its plane holds the eye, and every ray meets it there or never
    behind = [(-1, -1, -2), (1, -1, -2), (0, 1, -2)]
    flat = [(0, 0, 3), (0, 0, 3), (1, 1, 3)]
    mesh = atra.Mesh(np.array([*edge_on, *behind, *flat]), np.arange(9).reshape(3, 3))
    hits = hits_of(mesh, camera, np.arange(200).reshape(10, 20) % 3)
    y, x, found = old_way(hits)
    np.testing.assert_array_equal(np.isnan(hits.u[y, x]), np.isnan(found.u))
    assert np.isnan(hits.points[hits.prim_id > 0]).all()
    np.testing.assert_array_equal(np.abs(hits.normals[hits.prim_id == 0]), [(1, 0, 0)] * (hits.prim_id == 0).sum())
    np.testing.assert_array_equal(hits.normals[hits.prim_id == 1], [(0, 0, 1)] * (hits.prim_id == 1).sum())
    assert np.isnan(hits.normals[hits.prim_id == 2]).all()


def test_what_is_edge_on_but_for_rounding_has_no_weights():
    forward = np.array((54.0, 41.0, 33.0))
    camera = atra.OrthographicCamera((0, 0, 0), tuple(forward), view_height=4.0, width=21, height=9)
    corners = (0.125, 0.25, 0.5) + np.array([2 * forward, 7 * forward, 3 * forward - (5.75, 4.875, 11.375)])
    hits = hits_of(atra.Mesh(corners, [(0, 1, 2)]), camera, 0)
    y, x, found = old_way(hits)
    volumes = Pairs(hits.mesh, camera, x, y, hits.prim_id[y, x], hits.offset).volumes
    assert (volumes.facing * volumes.ahead > 0).any()  # neither zero nor behind the eye
    assert np.isnan(found.u).all()
    assert np.isnan(hits.u).all()
    assert np.isnan(hits.points).all()


LIGHT = atra.OrthographicCamera.of_light((0.1, -0.2, -1), cornell_box().bounds, 67, 45)


@pytest.mark.parametrize("camera", [cornell_camera(61, 40), LIGHT])
def test_points_lie_at_the_depth_and_in_the_pixel_that_were_traced(camera):
    offset = (0.125, 0.75)
    hits = trace("pixels", cornell_box(), camera, offset=offset)
    assert hits.hit.mean() > 0.2
    y, x = np.nonzero(hits.hit & ~np.isnan(hits.u))
    a, b, c = camera.to_pixels @ np.column_stack([camera.to_eye_space(hits.points[y, x]), np.ones(len(x))]).T
    np.testing.assert_allclose(camera.to_camera_space(hits.points[y, x])[:, 2], hits.depth[y, x], rtol=1e-5)
    np.testing.assert_allclose(np.stack([a, b]) / c, [x + offset[0], y + offset[1]], atol=1e-3)


def test_normals_are_of_length_1_and_follow_the_order_of_the_corners():
    mesh = cornell_box()
    hits = trace("aligned", mesh, cornell_camera(64, 64), (8, 1))
    corners = mesh.triangles(hits.prim_id[hits.hit])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(hits.normals[hits.hit], normals, atol=1e-7)
    assert np.isnan(hits.normals[~hits.hit]).all()
    turned = atra.Hits(
        hits.depth, hits.prim_id, hits.offset, atra.Mesh(mesh.vertices, mesh.faces[:, ::-1]), hits.camera
    )
    np.testing.assert_array_equal(turned.normals, -hits.normals)


def test_any_number_of_threads_and_any_layout_of_the_image_gives_the_same_bits():
    hits = trace("aligned", cornell_box(), cornell_camera(54, 70), (18, 1), packet_width=WIDEST)
    assert not hits.prim_id.flags.c_contiguous  # packets reach past the right border
    other = atra.Hits(hits.depth.copy(), hits.prim_id.astype(np.int64), hits.offset, hits.mesh, hits.camera, threads=3)
    for name in ("u", "v", "points", "normals"):
        own = getattr(hits, name)
        assert own.dtype == np.float32
        assert own.tobytes() == getattr(other, name).tobytes()


def test_frames_hand_their_threads_and_their_own_mesh_to_each_image():
    mesh, camera = cornell_box(), cornell_camera(32, 32)
    moved = atra.Mesh(mesh.vertices * 1.5, mesh.faces)
    alignment = atra.Alignment.of_frames([camera, camera], atra.Split.of_image((4, 1), camera))
    with atra.FramesTracer([mesh, moved], alignment, threads=1) as tracer:
        frames = tracer.trace()
    for image, of_frame in zip(frames, (mesh, moved), strict=True):
        assert image.threads == 1
        with make_tracer("pixels", of_frame, camera) as tracer:
            alone = tracer.trace()
        same = alone.hit & (alone.prim_id == image.prim_id)
        assert same.mean() > 0.5
        np.testing.assert_array_equal(image.points[same], alone.points[same])


@pytest.mark.parametrize("name", ["u", "v", "points", "normals"])
def test_a_triangle_that_the_mesh_does_not_have_is_named(name):
    mesh, camera = cornell_box(), cornell_camera(16, 16)
    with pytest.raises(InputError, match="prim_id 1112 is not in"):
        getattr(hits_of(mesh, camera, np.arange(256).reshape(16, 16) + 857), name)


@pytest.fixture(scope="module")
def seen():
    """With misses, and a part of the box seen from afar."""
    return trace("pixels", cornell_box(), atra.Camera((0, 1, 9), (0, 1, 0), width=40, height=30), threads=1)


def test_an_image_is_saved_as_arrays(seen, tmp_path):
    seen.save(tmp_path / "view.npz")
    with np.load(tmp_path / "view.npz") as stored:
        assert set(stored) == {"depth", "prim_id", "u", "v", "points", "normals"}
        for name, array in stored.items():
            np.testing.assert_array_equal(array, getattr(seen, name))


def test_an_image_is_saved_as_channels_of_an_exr(seen, tmp_path):
    OpenEXR = pytest.importorskip("OpenEXR")
    seen.save(tmp_path / "view.exr")
    with OpenEXR.File(str(tmp_path / "view.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    expected = {"Z": seen.depth, "prim_id": seen.prim_id}
    expected |= {f"N.{axis}": seen.normals[..., number] for number, axis in enumerate("XYZ")}
    assert channels.keys() == expected.keys()
    for name, array in expected.items():
        assert channels[name].dtype == array.dtype
        np.testing.assert_array_equal(channels[name], array)


def test_a_picture_is_white_where_it_is_nearest_and_black_where_nothing_is(seen, tmp_path):
    seen.save(tmp_path / "view.PNG")
    with Image.open(tmp_path / "view.PNG") as image:
        grey = np.asarray(image)
    assert grey.shape == seen.depth.shape
    assert (grey[~seen.hit] == 0).all()
    assert grey[seen.depth == seen.depth[seen.hit].min()].tolist() == [255] * (seen.depth == seen.depth.min()).sum()
    assert set(grey[seen.depth == seen.depth[seen.hit].max()]) == {40}


def test_a_point_cloud_has_the_hits_and_their_normals(seen, tmp_path):
    seen.save(tmp_path / "view.ply")
    cloud = trimesh.load(tmp_path / "view.ply")
    np.testing.assert_array_equal(cloud.vertices, seen.points[seen.hit])
    lines = (tmp_path / "view.ply").read_bytes().partition(b"end_header\n")
    assert b"property float nx" in lines[0]
    stored = np.frombuffer(lines[2], "<f4").reshape(-1, 6)
    np.testing.assert_array_equal(stored[:, 3:], seen.normals[seen.hit])


def test_an_image_without_a_hit_is_saved_too_but_not_as_points(tmp_path):
    nothing = hits_of(cornell_box(), cornell_camera(8, 8), atra.MISS)
    nothing.depth[:] = np.inf
    for suffix in ("npz", "exr", "png"):
        nothing.save(tmp_path / f"view.{suffix}")
    with pytest.raises(InputError, match="nothing is hit"):
        nothing.save(tmp_path / "view.ply")
    assert len(nothing.visible_triangles().prim_id) == 0


@pytest.mark.parametrize("name", ["view.tif", "view", "npz"])
def test_another_suffix_is_refused_by_its_name_and_nothing_is_written(seen, tmp_path, name):
    with pytest.raises(InputError, match=r"has the suffix '(\.tif)?', expected one of \.npz, \.exr, \.png, \.ply"):
        seen.save(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_missing_package_is_named_with_what_installs_it(seen, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(InputError, match="not installed: pip install openexr"):
        seen.save(tmp_path / "view.exr")


def test_what_was_there_before_stays_when_an_image_cannot_be_written(seen, tmp_path, monkeypatch):
    path = tmp_path / "view.npz"
    path.write_bytes(b"before")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(atra.AtraError, match="No space left"):
        seen.save(path)
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


def test_visible_triangles_are_those_that_pixels_show_and_how_many(seen):
    found = seen.visible_triangles()
    prim_id, pixels = np.unique(seen.prim_id[seen.hit], return_counts=True)
    assert len(prim_id) >= 10
    np.testing.assert_array_equal(found.prim_id, prim_id)
    np.testing.assert_array_equal(found.pixels, pixels)
    assert found.prim_id.dtype == np.uint32


def test_hits_and_meshes_print_one_line(seen):
    assert repr(seen).startswith("Hits(40 x 30 pixels of 'cornell_box', ")
    assert "% hit, depth " in repr(seen)
    assert repr(seen.mesh) == f"Mesh('cornell_box', 1,112 triangles, {len(seen.mesh.vertices)} vertices)"
    assert not any("\n" in text for text in (repr(seen), repr(seen.mesh)))
