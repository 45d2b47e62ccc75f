"""One instance of the mesh per cell gives the image that a sheared copy per cell gives."""

import numpy as np
import pytest

import atra
from atra.alignment.alignment import Alignment
from atra.alignment.instancing import instance_transforms
from atra.embree.library import load_library
from atra.embree.scene import EmbreeScene
from atra.judge.reference import brute_force
from atra.kernels.callbacks import memory_monitor
from tests.images import assert_equal_images, trace_pixels
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads, random_triangles

pytestmark = pytest.mark.core

WIDTHS = load_library().native_packet_widths
SLANTED = {"eye": (0.3, 0.2, -0.4), "target": (1.0, 2.0, 3.0), "up": (0.2, 1.0, 0.1)}
"""A camera with no axis along one of the world's."""


def trace_instanced(mesh, camera, split, offset=(0.5, 0.5), **options):
    options = {"threads": 1, "culling": False, "geometry": "instanced", **options}
    with atra.AlignedTracer(mesh, camera, split, **options) as tracer:
        return tracer.trace(offset)


def trace_copied(mesh, camera, split, offset=(0.5, 0.5), **options):
    return trace_instanced(mesh, camera, split, offset, **options, geometry="copied")


def instanced_tracer(**options):
    options = {"split": (4, 2), "culling": False, "geometry": "instanced", "threads": 1, **options}
    return atra.AlignedTracer(cornell_box(), cornell_camera(32, 16), **options)


def test_the_transform_of_an_instance_is_the_shear_of_its_cell():
    camera = atra.Camera(**SLANTED, width=24, height=12)
    split = atra.Split(4, 3, 24, 12)
    alignment = Alignment.of_cells(camera, split)
    points = np.random.default_rng(0).normal(size=(5, 3))
    transforms = instance_transforms(alignment)
    assert np.all(transforms[:, :, 3] == 0.0)
    for j in range(3):
        for i in range(4):
            sheared = (points @ camera.axes) @ transforms[4 * j + i, :, :3].T
            np.testing.assert_allclose(sheared @ camera.axes.T, alignment.shear_points(points, i, j), atol=1e-5)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("offset", [(0.5, 0.5), (0.0, 0.0), (0.999999, 0.999999), (0.0, 0.7)])
def test_a_tilted_plane_has_the_depth_of_its_equation(width, offset):
    xy = [(-50, -50), (50, -50), (50, 50), (-50, 50)]
    plane = quads([[(x, y, 4 + 0.5 * x - 0.25 * y) for x, y in xy]])
    camera = atra.Camera(**EYE_AT_ORIGIN, width=48, height=30, fov_y_degrees=50)
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    direction = camera.directions(x, y, offset)  # camera X and Y are the world's -x and -y
    expected = 4 / (1 + 0.5 * direction[..., 0] - 0.25 * direction[..., 1])
    for split in ((1, 1), (6, 1), (1, 10), (3, 5)):
        hits = trace_instanced(plane, camera, split, offset, packet_width=width)
        np.testing.assert_allclose(hits.depth, expected, rtol=2e-6)


def test_every_cell_shows_its_own_part_of_the_scene():
    camera = atra.Camera(**EYE_AT_ORIGIN, width=12, height=6, fov_y_degrees=40)
    # Quadrilateral 4 j + i covers cell (i, j) of a 4 x 3 split alone, at its own depth.
    corners, depths = [], np.arange(2.0, 14.0)
    for cell, z in enumerate(depths):
        i, j = cell % 4, cell // 4
        left, right = (((3 * c) - 6) * camera.pixel_pitch * -z for c in (i, i + 1))
        top, bottom = (((2 * c) - 3) * camera.pixel_pitch * -z for c in (j, j + 1))
        corners.append([(left, top, z), (right, top, z), (right, bottom, z), (left, bottom, z)])
    hits = trace_instanced(quads(corners), camera, (4, 3))
    cells = np.repeat(np.repeat(np.arange(12).reshape(3, 4), 2, axis=0), 3, axis=1)
    np.testing.assert_array_equal(hits.prim_id // 2, cells)
    np.testing.assert_allclose(hits.depth, depths[cells], rtol=1e-6)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(("size", "split"), [
    ((96, 60), (1, 1)), ((96, 60), (12, 1)), ((96, 60), (1, 12)), ((96, 60), (3, 5)), ((35, 21), (5, 7)),
    ((35, 21), (7, 1)), ((33, 7), (1, 7)), ((13, 11), (13, 11)), ((1, 1), (1, 1)), ((7, 1), (7, 1)),
])  # fmt: skip
def test_instanced_copied_and_per_pixel_images_are_equal(size, split, width):
    camera = cornell_camera(*size)
    mesh = cornell_box()
    hits = trace_instanced(mesh, camera, split, packet_width=width)
    assert_equal_images(mesh, camera, hits, trace_copied(mesh, camera, split, packet_width=width))
    assert_equal_images(mesh, camera, hits, trace_pixels(mesh, camera))


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.999999, 0.999999), (0.0, 0.7)])
def test_any_offset_gives_the_per_pixel_image(offset):
    camera = cornell_camera(48, 36)
    mesh = cornell_box()
    hits = trace_instanced(mesh, camera, (12, 3), offset)
    assert_equal_images(mesh, camera, hits, trace_pixels(mesh, camera, offset))


@pytest.mark.parametrize("seed", range(6))
def test_triangles_behind_around_and_through_the_eye_give_the_float64_image(seed):
    mesh = random_triangles(60, seed)
    pose = SLANTED if seed % 2 else EYE_AT_ORIGIN
    camera = atra.Camera(**pose, width=40, height=24, fov_y_degrees=[20, 90, 150, 160, 60, 120][seed])
    reference = brute_force(mesh, camera)
    for split in ((1, 1), (8, 1), (40, 1), (1, 24), (5, 4), (40, 24)):
        assert_equal_images(mesh, camera, trace_instanced(mesh, camera, split), reference)


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("build_quality", ["low", "medium", "high"])
def test_neither_threads_nor_build_quality_change_the_image(threads, build_quality):
    camera = cornell_camera(64, 48)
    mesh = cornell_box()
    hits = trace_instanced(mesh, camera, (16, 2), threads=threads, build_quality=build_quality)
    assert_equal_images(mesh, camera, hits, trace_pixels(mesh, camera))


def test_a_second_frame_forgets_the_first():
    with instanced_tracer() as tracer:
        first = tracer.trace((0.5, 0.5)).prim_id
        tracer.trace((0.1, 0.9))
        np.testing.assert_array_equal(tracer.trace((0.5, 0.5)).prim_id, first)


def test_the_mesh_is_stored_once_whatever_the_number_of_cells():
    mesh = random_triangles(5_000, 0)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=64)
    bytes_of = {}
    for geometry in ("copied", "instanced"):
        for split in ((1, 1), (16, 4)):
            with atra.AlignedTracer(mesh, camera, split, culling=False, geometry=geometry, threads=1) as tracer:
                bytes_of[geometry, split] = tracer.embree_bytes
                copied = mesh.triangle_count - tracer.counters["triangles_left_out"]
                expected = mesh.triangle_count if geometry == "instanced" else split[0] * split[1] * copied
                assert tracer.triangle_count == expected
                assert tracer.counters["triangles_left_out"] < 0.05 * mesh.triangle_count
                assert tracer.plan_time_s > 0
                assert tracer.build_time_s > 0
    assert bytes_of["copied", (16, 4)] > 40 * bytes_of["copied", (1, 1)]
    # Both scenes count: the triangles of the inner one, and some hundred bytes an instance, in blocks of some kB.
    assert bytes_of["instanced", (1, 1)] > 0.9 * bytes_of["copied", (1, 1)]
    assert bytes_of["instanced", (1, 1)] < bytes_of["instanced", (16, 4)] < 1.3 * bytes_of["instanced", (1, 1)]


def test_culling_instances_is_refused_saying_what_to_set():
    with pytest.raises(atra.InputError, match="set culling=False"):
        instanced_tracer(culling=True)


def test_an_unknown_geometry_is_refused_with_its_value():
    with pytest.raises(atra.InputError, match="geometry is 'shared', expected one of copied, instanced"):
        instanced_tracer(geometry="shared")


def test_mesh_and_instances_both_count_towards_the_memory_budget():
    with instanced_tracer(memory_budget_bytes=1 << 18) as tracer:
        assert tracer.embree_bytes < 1 << 18
    with pytest.raises(atra.MemoryBudgetError, match="1,112 triangles and 8 instances of them need about"):
        instanced_tracer(memory_budget_bytes=1 << 16)
    with pytest.raises(atra.MemoryBudgetError, match="512 instances of them need about"):
        instanced_tracer(split=(32, 16), memory_budget_bytes=1 << 18)
    with pytest.raises(atra.MemoryBudgetError, match="triangle copies"):
        instanced_tracer(geometry="copied", memory_budget_bytes=1 << 18)


def test_closing_a_tracer_of_instances_twice_is_harmless():
    tracer = instanced_tracer()
    with tracer:
        tracer.build()  # a second build releases the first scenes
        assert tracer.trace().hit.any()
    tracer.close()
    with pytest.raises(atra.EmbreeError, match="closed"):
        tracer.trace()


def test_closing_a_scene_of_instances_gives_all_memory_back():
    mesh = cornell_box()
    transforms = np.tile(np.eye(3, 4, dtype=np.float32), (5, 1, 1))
    scene = EmbreeScene(mesh.vertices, mesh.faces, monitor_address=memory_monitor(), transforms=transforms)
    assert scene.embree_bytes > 1000
    scene.close()
    scene.close()
    assert scene.embree_bytes == 0
