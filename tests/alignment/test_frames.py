"""Several images from one set of rays: each is the image that tracing its own camera and mesh gives (paper §6)."""

import numpy as np
import pytest

import atra
from tests.images import assert_equal_images, trace_pixels
from tests.judge.reference import brute_force
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, random_triangles

SIZE = {"width": 48, "height": 36}


def moving_cameras(count, **size):
    """The Cornell box, walked into: every frame moves, turns and zooms."""
    start = cornell_camera(**size)
    eyes = np.array(start.eye) + np.linspace(0, 1, count)[:, None] * (0.25, 0.1, -0.6)
    targets = np.array(start.target) + np.linspace(0, 1, count)[:, None] * (-0.2, 0.05, 0.0)
    zooms = np.linspace(start.fov_y_degrees, start.fov_y_degrees * 1.5, count)
    return [
        atra.Camera(tuple(eye), tuple(target), start.up, zoom, **size)
        for eye, target, zoom in zip(eyes, targets, zooms, strict=True)
    ]


def eyes(distance, **size):
    left = cornell_camera(**size)
    step = distance * left.axes[0]
    return left, atra.Camera(tuple(left.eye + step), tuple(left.target + step), left.up, left.fov_y_degrees, **size)


def alignment_of(cameras, split):
    return atra.Alignment.of_frames(cameras, atra.Split(*split, cameras[0].width, cameras[0].height))


def trace_frames(meshes, alignment, offset=(0.5, 0.5), **options):
    with atra.FramesTracer(meshes, alignment, **{"threads": 1, **options}) as tracer:
        return tracer.trace(offset)


GEOMETRIES = [{}, {"culling": False}, {"culling": False, "geometry": "instanced"}]


@pytest.mark.parametrize("options", GEOMETRIES)
@pytest.mark.parametrize("split", [(12, 1), (1, 9)])
def test_both_eyes_see_what_each_alone_sees(split, options):
    left, right = eyes(0.065, **SIZE)
    alignment = atra.Alignment.of_eyes(left, right, atra.Split(*split, **SIZE))
    frames = trace_frames(cornell_box(), alignment, **options)
    assert [hits.camera for hits in frames] == [left, right]
    for hits in frames:
        assert_equal_images(hits.mesh, hits.camera, hits, trace_pixels(cornell_box(), hits.camera))
    assert (frames.prim_id[0] != frames.prim_id[1]).any()


@pytest.mark.core
@pytest.mark.parametrize("options", GEOMETRIES)
@pytest.mark.parametrize(("count", "split"), [(2, (12, 1)), (4, (4, 3))])
def test_frames_of_a_camera_that_moves_turns_and_zooms_are_those_traced_alone(count, split, options):
    cameras = moving_cameras(count, **SIZE)
    frames = trace_frames(cornell_box(), alignment_of(cameras, split), (0.25, 0.75), **options)
    assert len(frames) == count
    for hits in frames:
        assert_equal_images(hits.mesh, hits.camera, hits, trace_pixels(cornell_box(), hits.camera, (0.25, 0.75)))


def test_each_frame_may_bring_vertices_and_triangles_of_its_own():
    meshes = [random_triangles(30 + 10 * seed, seed) for seed in range(3)]
    cameras = [atra.Camera(**EYE_AT_ORIGIN, **SIZE, fov_y_degrees=fov) for fov in (60, 90, 120)]
    for options in GEOMETRIES[:2]:
        frames = trace_frames(meshes, alignment_of(cameras, (8, 1)), **options)
        for hits, mesh in zip(frames, meshes, strict=True):
            assert hits.mesh is mesh
            assert_equal_images(hits.mesh, hits.camera, hits, brute_force(mesh, hits.camera))


def test_frames_of_another_tracer_are_refused_as_output():
    cameras = moving_cameras(3, **SIZE)
    with (
        atra.FramesTracer(cornell_box(), alignment_of(cameras[:2], (12, 1)), threads=1) as two,
        atra.FramesTracer(cornell_box(), alignment_of(cameras, (12, 1)), threads=1) as three,
    ):
        with pytest.raises(atra.InputError, match="pass a result of this tracer"):
            three.trace(out=two.trace())
        frames = three.trace()
        apart = atra.Frames(frames.depth[::2], frames.prim_id[::2], (0.5, 0.5), frames.meshes[::2], frames.cameras[::2])
        with pytest.raises(atra.InputError, match="pass a result of this tracer"):
            two.trace(out=apart)
        with pytest.raises(atra.InputError, match=r"float32 of \(36, 48\).*expected float32 of \(3, 36, 48\)"):
            three.trace(out=next(iter(frames)))


@pytest.mark.parametrize(("count", "meshes", "options", "error", "message"), [
    (3, [cornell_box()] * 2, {}, atra.InputError, "2 meshes for 3 frames"),
    (2, [cornell_box(), cornell_box()], GEOMETRIES[2], atra.InputError, "instances show one mesh"),
    (4, cornell_box(), {"culling": False, "memory_budget_bytes": 1 << 20}, atra.MemoryBudgetError,
     "53,376 triangle copies over 48 cells"),
])  # fmt: skip
def test_meshes_or_a_budget_that_do_not_fit_the_frames_are_refused(count, meshes, options, error, message):
    with pytest.raises(error, match=message):
        atra.FramesTracer(meshes, alignment_of(moving_cameras(count, **SIZE), (12, 1)), **options)


@pytest.mark.parametrize(("width", "height"), [(16, 8), (32, 8), (24, 4), (24, 16)])
def test_frames_or_a_split_of_another_size_or_kind_are_refused_whichever_is_larger(width, height):
    camera, other = (atra.Camera(**EYE_AT_ORIGIN, width=w, height=h) for w, h in ((24, 8), (width, height)))
    for cameras in ([camera, other], [camera, camera, other]):
        said = f"frame {len(cameras) - 1} has {width} x {height} pixels, the split is of an image of 24 x 8; no affine"
        with pytest.raises(atra.InputError, match=said):
            atra.Alignment.of_frames(cameras, atra.Split(4, 1, 24, 8))
    parallel = atra.OrthographicCamera(**EYE_AT_ORIGIN, view_height=2.0, width=24, height=8)
    for cameras, kinds in (
        ([camera, parallel], "frame 1 is a OrthographicCamera, frame 0 a Camera"),
        ([parallel, camera], "frame 1 is a Camera, frame 0 a OrthographicCamera"),
    ):
        with pytest.raises(atra.InputError, match=kinds):
            atra.Alignment.of_frames(cameras, atra.Split(4, 1, 24, 8))
    with pytest.raises(atra.InputError, match=f"frame 0 has 24 x 8 pixels, .* image of {width} x {height}"):
        atra.Alignment.of_cells(camera, atra.Split(1, 1, width, height))
    with pytest.raises(atra.InputError, match="no camera was given"):
        atra.Alignment.of_frames([], atra.Split(4, 1, 24, 8))


@pytest.mark.parametrize("fov_y_degrees", [40.0, 80.0])
def test_eyes_with_another_field_of_view_are_refused_and_frames_are_not(fov_y_degrees):
    left = atra.Camera(**EYE_AT_ORIGIN, width=24, height=8, fov_y_degrees=60.0)
    right = atra.Camera((0.1, 0, 0), (0.1, 0, 1), width=24, height=8, fov_y_degrees=fov_y_degrees)
    split = atra.Split(4, 1, 24, 8)
    with pytest.raises(atra.InputError, match="different fields of view"):
        atra.Alignment.of_eyes(left, right, split)
    turned = atra.Camera((0.1, 0, 0), (0.2, 0, 1), width=24, height=8, fov_y_degrees=60.0)
    with pytest.raises(atra.InputError, match=r"different directions.*use Alignment\.of_frames"):
        atra.Alignment.of_eyes(left, turned, split)
    for other in (right, turned):
        assert atra.Alignment.of_frames([left, other], split).cameras == (left, other)
