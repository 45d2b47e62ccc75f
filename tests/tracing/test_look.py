"""`look`: a tracer that takes another camera gives the image of a new tracer, to the bit."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from tests.images import assert_same_bits, make_tracer
from tests.meshes import cornell_box, cornell_camera, quads
from tests.tracing.test_lifetimes import devices

MESH, CAMERA = cornell_box(), cornell_camera(64, 48)
MOVED = replace(CAMERA, eye=tuple(np.add(CAMERA.eye, (0.11, -0.07, 0.05)).tolist()))
TURNED = replace(CAMERA, target=tuple(np.add(CAMERA.target, (0.3, 0.1, 0.0)).tolist()))
PATH = {
    "moved": MOVED,
    "turned": TURNED,
    "another size": replace(MOVED, width=32, height=80),
    "so narrow that ray space has the camera's axes": replace(CAMERA, fov_y_degrees=0.4),
    "back where it was": CAMERA,
}
FLAT = atra.OrthographicCamera(CAMERA.eye, CAMERA.target, view_height=2.0, width=64, height=32)
KINDS = ("pixels", "aligned", "instanced", "visible_first", "raster")
PARALLEL = ("pixels", "aligned", "instanced", "raster")
every_kind = pytest.mark.parametrize("kind", KINDS)


def tracer(kind, camera=CAMERA, mesh=MESH, **options):
    if kind == "raster":
        return atra.RasterTracer(mesh, camera, **{"threads": 1, **options})
    return make_tracer(kind, mesh, camera, (16, 1), **options)


def image(kind, camera, **options):
    with tracer(kind, camera, **options) as one:
        return one.trace()


@every_kind
def test_every_camera_of_a_path_is_seen_as_by_a_new_tracer(kind):
    cameras = [*PATH.values(), FLAT, CAMERA] if kind in PARALLEL else PATH.values()
    with tracer(kind) as one:
        one.trace()
        for camera in cameras:
            before = devices(one)
            one.look(camera)
            hits = one.trace()
            assert hits.camera is camera
            assert one.views == ((MESH, camera),)
            assert_same_bits(hits, image(kind, camera))
            assert all(device.closed or device in devices(one) for device in before)


@every_kind
def test_ties_are_settled_where_the_new_camera_sees_them(kind):
    corners = [(x, y, x / 2 - y / 4) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    twice = quads([corners, [(x / 2, y / 2, z / 2) for x, y, z in corners]])
    mesh = atra.Mesh(twice.vertices, twice.faces[::-1])
    away, before = (replace(CAMERA, eye=(0, 0, 3), target=(x, 0, 0)) for x in (9, 0.2))
    with tracer(kind, away, mesh) as one:
        assert not one.trace().hit.any()
        one.look(before)
        assert_same_bits(one.trace((0.3, 0.6)), _traced(kind, before, mesh, (0.3, 0.6)))


def _traced(kind, camera, mesh, offset):
    with tracer(kind, camera, mesh) as one:
        return one.trace(offset)


@every_kind
def test_a_camera_given_before_anything_is_built_is_the_one_that_is_built_for(kind):
    one = tracer(kind)
    one.look(MOVED)
    assert not any(devices(one))
    assert one.plan_time_s == one.build_time_s == 0.0
    with one:
        assert_same_bits(one.trace(), image(kind, MOVED))
    with pytest.raises(atra.ClosedError, match="closed"):
        one.look(CAMERA)


@pytest.mark.parametrize(("kind", "camera", "message"), [
    ("visible_first", FLAT, "VisibleFirstTracer needs rays through one point"),
    ("aligned", replace(CAMERA, width=65), r"split \(16, 1\) does not divide image 65 x 48"),
    ("visible_first", replace(CAMERA, width=65), "does not divide image 65 x 48"),
    ("pixels", replace(CAMERA, eye=(1e12, 0, 0)), "reaches 1e[+]12 from the eye"),
    ("raster", replace(CAMERA, eye=(1e12, 0, 0)), "reaches 1e[+]12 from the eye"),
    ("aligned", replace(CAMERA, eye=(1e12, 0, 0)), "reaches 1e[+]12 from the eye"),
])  # fmt: skip
def test_a_camera_that_is_refused_changes_nothing(kind, camera, message):
    with tracer(kind) as one:
        expected, held = one.trace(), devices(one)
        with pytest.raises(atra.InputError, match=message):
            one.look(camera)
        assert one.camera is CAMERA
        assert devices(one) == held
        assert_same_bits(one.trace(), expected)


def test_a_probe_that_is_an_image_goes_on_serving_where_the_size_stays():
    probe = image("pixels", CAMERA)
    with tracer("visible_first", probe=probe) as one:
        one.look(MOVED)
        assert_same_bits(one.trace(), image("visible_first", MOVED, probe=probe))
        with pytest.raises(atra.InputError, match=r"the probe is an image of \(48, 64\), expected \(24, 64\)"):
            one.look(replace(MOVED, height=24))


def test_rays_per_pixel_keep_their_bvh_while_the_eye_stays_and_build_another_where_it_moves():
    with tracer("pixels") as one:
        (scene,), built = devices(one), one.build_time_s
        for camera in (TURNED, replace(TURNED, fov_y_degrees=30, width=50), FLAT):
            one.look(camera)
            assert devices(one) == [scene]
            assert one.build_time_s == built
            assert_same_bits(one.trace(), image("pixels", camera))
        one.look(MOVED)
        assert scene.closed
        assert devices(one) != [scene]
