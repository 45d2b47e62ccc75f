"""What a ray starts on it does not hit: planes that hold the eye, exactly or to the last bit of its coordinates."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import trimesh

import atra
from atra.hits import Hits
from atra.judge.compare import Verdict
from experiments.workloads.agreement.oracle import examine
from tests.images import assert_no_pixel_wrong, draw, trace, trace_pixels
from tests.judge.reference import brute_force
from tests.meshes import EYE_AT_ORIGIN, joined, quads

WALL = quads([[(-9, -9, 5), (9, -9, 5), (9, 9, 5), (-9, 9, 5)]])
PANE = quads([[(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]])
CAMERA = atra.Camera(**EYE_AT_ORIGIN, width=16, height=12)


def image_of(prim_id, depth, mesh, camera):
    shape = camera.height, camera.width
    return Hits(np.full(shape, depth, np.float32), np.full(shape, prim_id, np.uint32), (0.5, 0.5), mesh, camera)


@pytest.mark.parametrize("before", [1e-17, 1e-19, 1e-30])
def test_a_pane_no_farther_from_the_eye_than_float64_can_tell_may_be_named_or_not(before):
    pane = atra.Mesh([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], [[0, 1, 2]])
    mesh, camera = joined(pane, WALL), replace(CAMERA, eye=(0, 0, -before))
    near, far = image_of(0, before, mesh, camera), brute_force(mesh, camera)
    assert (far.depth == 5.0).all()
    agreement = atra.compare(near, far)
    assert set(np.unique(agreement.verdict)) == {Verdict.EDGE}
    assert not examine(far, near).hits_wrong.any()


def test_a_pane_that_float64_tells_from_the_eye_must_be_named():
    pane = atra.Mesh([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], [[0, 1, 2]])
    mesh, camera = joined(pane, WALL), replace(CAMERA, eye=(0, 0, -1e-9))
    for hits in (draw(mesh, camera), trace_pixels(mesh, camera)):
        assert not hits.prim_id.any()
        assert_no_pixel_wrong(mesh, camera, hits, brute_force(mesh, camera))
    through = image_of(2, 5.0, mesh, camera)
    assert atra.compare(through, brute_force(mesh, camera)).pixels_wrong == through.depth.size


def panes(random):
    """Twelve triangles between points of a coarse grid, of which half lie along an axis."""
    points = (random.integers(-8, 9, (12, 3, 3)) / random.choice([4, 7, 10])).astype(np.float32)
    for triangle in range(0, 12, 2):
        axis = random.integers(3)
        points[triangle, :, axis] = points[triangle, 0, axis]
    return atra.Mesh(points.reshape(-1, 3), np.arange(36).reshape(-1, 3))


@pytest.mark.parametrize("seed", range(40))
def test_an_eye_a_bit_beside_a_plane_sees_the_float64_image(seed):
    random = np.random.default_rng(seed)
    mesh = panes(random)
    eye = mesh.triangles(np.array([2 * random.integers(6)]))[0].mean(axis=0)
    if seed % 2:
        eye = np.nextafter(eye, eye + random.normal(size=3))
    if seed % 5 == 0:
        eye += random.choice([1e-17, -1e-17, 1e-13], 3)
    forward = np.eye(3)[random.integers(3)] if seed % 3 else random.normal(size=3)
    camera = atra.Camera(tuple(eye), tuple(eye + forward), (0.1, 1, 0.2), 20 + 4 * seed % 130, 24, 16)
    reference = brute_force(mesh, camera)
    for hits in (draw(mesh, camera), trace_pixels(mesh, camera), trace("pixels", mesh, camera)):
        assert_no_pixel_wrong(mesh, camera, hits, reference)


TRACERS = {
    "raster": atra.RasterTracer, "pixel": atra.PixelTracer, "fast": partial(atra.PixelTracer, robust=False),
    "aligned": partial(atra.AlignedTracer, split=(4, 1)),
    "instanced": partial(atra.AlignedTracer, split=(4, 1), geometry="instanced", culling=False),
    "visible_first": partial(atra.VisibleFirstTracer, split=(4, 1)),
}  # fmt: skip


@pytest.mark.parametrize("kind", ["raster", "pixel", "aligned", "instanced", "visible_first"])
def test_an_eye_on_a_vertex_sees_what_lies_behind_the_triangles_there(kind):
    """A ball whose vertices need all digits of float32; the triangles at the eye came out at a depth of 1e-9 or 0."""
    ball = trimesh.creation.icosphere(subdivisions=1)
    mesh = atra.Mesh(ball.vertices, ball.faces)
    for vertex, target in ((5, (0, 0, 0)), (5, (0.3, 0.63, 1.05)), (0, (0, 0, 0))):
        eye = tuple(mesh.vertices[vertex].astype(float))
        camera = atra.Camera(eye, target, (0.1, 1, 0.2), 70, 32, 32)
        reference = brute_force(mesh, camera)
        with TRACERS[kind](mesh, camera, threads=1) as tracer:
            hits = tracer.trace()
        assert_no_pixel_wrong(mesh, camera, hits, reference)
        np.testing.assert_array_equal(hits.hit, reference.hit)
        np.testing.assert_allclose(hits.depth, reference.depth, rtol=1e-5)


PLAN = atra.OrthographicCamera(**EYE_AT_ORIGIN, width=16, height=12, view_height=3)


@pytest.mark.parametrize(
    ("kind", "camera"),
    [(kind, camera) for kind in TRACERS for camera in (CAMERA, PLAN) if (kind, camera) != ("visible_first", PLAN)],
)
def test_a_face_that_rays_start_on_is_no_hit_nor_is_one_of_all_hits(kind, camera):
    """The eye inside a face, on an edge and on a vertex of it; the image plane of parallel rays in the face."""
    for shift in ((0.3, 0.1, 0), (0, 0, 0), (1, 1, 0), (1, 0.5, 0)):
        pane = atra.Mesh(PANE.vertices + np.float32(shift), PANE.faces)
        mesh = joined(pane, WALL)
        reference = brute_force(mesh, camera)
        assert set(np.unique(reference.prim_id)) == {2, 3}
        with TRACERS[kind](mesh, camera, threads=1) as tracer:
            hits = tracer.trace()
            counts = tracer.gather(atra.Count()).count if kind in ("pixel", "fast", "aligned") else 1
        np.testing.assert_array_equal(hits.depth, reference.depth)
        assert_no_pixel_wrong(mesh, camera, hits, reference)
        assert np.all(counts == 1)
