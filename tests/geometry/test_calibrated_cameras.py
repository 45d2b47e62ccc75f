"""Cameras with any image plane: as OpenCV sees through them, as matrices place them, and through every method."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import atra
from tests.images import METHODS, assert_no_pixel_wrong, assert_same_bits, trace, trace_pixels
from tests.judge.reference import brute_force
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads, random_triangles

cv2 = pytest.importorskip("cv2", reason="OpenCV, a test dependency, is what calibrated cameras are held against")

K = np.array([[800.0, 0.0, 312.5], [0.0, 640.0, 201.25], [0.0, 0.0, 1.0]])
AXES = np.eye(3)
UNTURNED = {"K": K, "R": AXES, "t": np.zeros(3), "width": 640, "height": 480}


def random_calibration(seed):
    random = np.random.default_rng(seed)
    rotation, _ = cv2.Rodrigues(random.normal(size=3) * 2)
    eye = random.normal(size=3) * 10.0 ** random.integers(-2, 4)
    intrinsic = np.diag([*random.uniform(100, 5000, 2), 1.0])
    intrinsic[:2, 2] = random.uniform(-3000, 5000, 2)
    points = eye + (random.normal(size=(20, 3)) * [1, 1, 0.2] + [0, 0, 3]) @ rotation
    return intrinsic, rotation, -rotation @ eye, points


@pytest.mark.parametrize("seed", range(6))
def test_points_are_seen_where_opencv_projects_them_its_pixels_being_counted_from_their_centres(seed):
    intrinsic, rotation, translation, points = random_calibration(seed)
    projected, _ = cv2.projectPoints(points, rotation, translation, intrinsic, None)
    camera = atra.Camera.from_opencv(intrinsic, rotation, translation, 640, 480)
    np.testing.assert_allclose(camera.project(points), projected[:, 0] + 0.5, rtol=0, atol=1e-6)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("axes", ["opengl", "opencv"])
def test_a_matrix_places_the_camera_that_r_and_t_place(seed, axes):
    intrinsic, rotation, translation, points = random_calibration(seed)
    to_world = np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = rotation.T, -rotation.T @ translation
    if axes == "opengl":
        to_world[:3, 1:3] *= -1
    expected = atra.Camera.from_opencv(intrinsic, rotation, translation, 64, 48)
    for matrix in (to_world, to_world[:3]):
        camera = atra.Camera.from_matrix(matrix, 64, 48, axes=axes, K=intrinsic)
        assert camera.plane == expected.plane
        np.testing.assert_allclose(camera.project(points), expected.project(points), atol=1e-6)
    plain = atra.Camera.from_matrix(to_world, 64, 48, axes=axes, fov_y_degrees=40)
    assert (type(plain), plain.fov_y_degrees) == (atra.Camera, 40.0)
    np.testing.assert_allclose(plain.axes, rotation, atol=1e-12)


def test_a_rotation_of_few_digits_becomes_the_nearest_one():
    _, rotation, translation, _ = random_calibration(3)
    camera = atra.Camera.from_opencv(K, np.round(rotation, 5), translation, 64, 48)
    np.testing.assert_allclose(camera.axes @ camera.axes.T, AXES, atol=1e-14)
    np.testing.assert_allclose(camera.axes, rotation, atol=1e-5)


def changed(matrix, **places):
    """The matrix with other numbers at places such as r0c2."""
    other = np.array(matrix, np.float64)
    for place, value in places.items():
        other[int(place[1]), int(place[3])] = value
    return other


MATRIX = {"camera_to_world": np.eye(4), "width": 8, "height": 8, "axes": "opengl", "fov_y_degrees": 60}
PART = {"left": 0, "top": 0, "width": 4, "height": 4}
PLANE = {"pitch_x": 1.0, "pitch_y": 1.0, "axis_x": 0.0, "axis_y": 0.0}
SMALL = atra.Camera(**EYE_AT_ORIGIN, width=48, height=32)


@pytest.mark.parametrize(("make", "given", "change", "message"), [
    *((atra.Camera.from_opencv, UNTURNED, change, message) for change, message in (
        ({"K": changed(K, r0c0=0)}, r"K is singular, expected focal lengths above 0 and the last row \[0, 0, 1\]: \["),
        ({"K": changed(K, r1c1=-640)}, "the focal length fy is -640"),
        ({"K": changed(K, r0c1=2.5)}, "K has the skew 2.5, expected 0"),
        ({"K": changed(K, r1c0=2.5)}, "K has the skew 2.5, expected 0"),
        ({"K": changed(K, r2c2=2)}, r"the last row of K is \[0.0, 0.0, 2.0\], expected \[0, 0, 1\]"),
        ({"K": changed(K, r0c2=np.nan)}, r"K is \[\[800.0, 0.0, nan\]"),
        ({"K": changed(K, r0c2=2e6)}, "meets the image plane at x = 2e\\+06 pixels, expected at most 1e\\+06 outside"),
        ({"K": np.eye(4)}, r"K has shape \(4, 4\), expected \(3, 3\)"),
        ({"K": "abc"}, "K cannot be read as an array of real numbers: it has dtype <U3"),
        ({"R": np.diag([1, 1, -1])}, "R is a reflection"),
        ({"R": 2 * AXES}, "R is no rotation: R R\\^T is up to 3 from the unit matrix"),
        ({"R": np.zeros(3)}, r"R has shape \(3,\), expected \(3, 3\) \(cv2.Rodrigues makes one"),
        ({"t": [0, 0]}, r"t has shape \(2,\), expected three numbers"),
        ({"t": [0, 0, np.nan]}, "t is .*nan.*, expected finite numbers"),
        ({"t": [[0, 0, 1], [2]]}, "t cannot be read as an array"),
        ({"width": 0}, "width is 0, expected a whole number of pixels"),
    )),
    *((atra.Camera.from_matrix, MATRIX, change, message) for change, message in (
        ({"axes": "blender"}, "axes is 'blender', expected one of opengl, opencv"),
        ({"camera_to_world": AXES}, r"camera_to_world has shape \(3, 3\), expected \(4, 4\) or \(3, 4\)"),
        ({"camera_to_world": np.diag([2, 2, 2, 1])}, "the left part of camera_to_world is no rotation.*remove a scale"),
        ({"camera_to_world": np.diag([1, 1, 1, 2])}, r"the last row of camera_to_world is \[0.0, 0.0, 0.0, 2.0\]"),
        ({"K": K}, "expected either fov_y_degrees or K, neither or both were given"),
        ({"fov_y_degrees": None}, "expected either fov_y_degrees or K"),
        ({"fov_y_degrees": 200}, "fov_y_degrees is 200.0"),
    )),
    *((SMALL.crop, PART, change, message) for change, message in (
        ({"height": 0, "width": 0}, "left is 0 and the size 0, expected whole numbers"),
        ({"left": -1}, "left is -1"),
        ({"top": 2.5}, "top is 2.5"),
        ({"left": 40, "width": 9}, "left 40 and 9 pixels reach beyond the 48 of the image"),
        ({"top": 30, "height": 3}, "top 30 and 3 pixels reach beyond the 32 of the image"),
    )),
    *((atra.ImagePlane, PLANE, change, message) for change, message in (
        ({"pitch_x": 0.0}, "pitch_x is 0.0"),
        ({"pitch_y": np.inf}, "pitch_y is inf"),
        ({"axis_x": np.nan}, "axis_x is nan"),
        ({"axis_y": "a"}, "axis_y is 'a'"),
        ({"left": 0.5}, "left is 0.5"),
    )),
    (atra.CalibratedCamera, EYE_AT_ORIGIN, {"plane": None}, r"plane is None, expected atra\.ImagePlane"),
])  # fmt: skip
def test_what_makes_no_camera_no_part_and_no_image_plane_is_refused_with_its_value(make, given, change, message):
    with pytest.raises(atra.InputError, match=message):
        make(**{**given, **change})


WHOLE = atra.Camera(**EYE_AT_ORIGIN, fov_y_degrees=70, width=48, height=32)
TURNED = {"eye": (0.2, -0.1, 0.3), "target": (1.0, 0.4, -2.0), "up": (0.3, 1.0, 0.1)}


def beside(stretched, axis_x, axis_y, **size):
    pitch = 0.02
    plane = atra.ImagePlane(pitch * stretched, pitch, axis_x, axis_y)
    return atra.CalibratedCamera(**TURNED, **{"width": 48, "height": 32, **size}, plane=plane)


VIEWS = {
    "off-centre": beside(1.0, 9.3, 27.8),
    "wide pixels": beside(2.5, 24.0, 16.0),
    "tall pixels off-centre": beside(0.4, 30.1, 2.6),
    "axis outside of the image": beside(1.5, -60.2, 90.7),
    "crop": atra.Camera(**TURNED, fov_y_degrees=80, width=200, height=160).crop(120, 11, 48, 32),
    "crop of a crop": beside(1.5, 80.0, -3.0, width=100, height=90).crop(20, 30, 70, 50).crop(10, 15, 48, 32),
    "from OpenCV": atra.Camera.from_opencv(changed(np.diag([40.0, 55.0, 1.0]), r0c2=33.3), AXES, [0.1, 0.2, 0], 48, 32),
}


@pytest.mark.parametrize("camera", VIEWS.values(), ids=VIEWS)
def test_every_method_takes_any_image_plane(camera):
    mesh = random_triangles(60, 5)
    reference = brute_force(mesh, camera, (0.3, 0.6))
    assert reference.hit.mean() > 0.1
    for method in METHODS:
        assert_no_pixel_wrong(mesh, camera, trace(method, mesh, camera, (6, 2), (0.3, 0.6)), reference)
    with atra.RasterTracer(mesh, camera, threads=1) as tracer:
        assert_no_pixel_wrong(mesh, camera, tracer.trace((0.3, 0.6)), reference)


@pytest.mark.parametrize("name", ["off-centre", "wide pixels", "crop of a crop"])
def test_ties_are_decided_where_the_image_plane_has_them(name):
    camera = VIEWS[name]
    corners = [(-90, -90, 90, 90), (-5, -1, 9, 7)]
    walls = quads([[(x0, y0, -4), (x1, y0, -4), (x1, y1, -4), (x0, y1, -4)] for x0, y0, x1, y1 in corners[::-1]])
    reference = brute_force(walls, camera)
    assert (reference.prim_id < 2).any()  # on the small wall, where both are as deep
    for method in METHODS:
        hits = trace(method, walls, camera, (6, 2))
        agreement = assert_no_pixel_wrong(walls, camera, hits, reference)
        assert agreement.pixels_tied == 0, method


def test_the_probe_looks_through_the_pixels_of_the_image_plane():
    mesh, whole = cornell_box(), cornell_camera(256, 256)
    verified = []
    for camera in (whole, whole.crop(10, 20, 128, 128)):
        with atra.VisibleFirstTracer(mesh, camera, (32, 1), threads=1) as tracer:
            tracer.trace()
            verified.append(tracer.counters["packets_verified"])
    assert verified[1] <= verified[0] > 0


def part_of(hits, left, top, camera):
    rows, columns = slice(top, top + camera.height), slice(left, left + camera.width)
    return replace(hits, depth=hits.depth[rows, columns], prim_id=hits.prim_id[rows, columns], camera=camera)


@pytest.mark.parametrize("whole", [WHOLE, beside(1.5, 3.7, 40.9)], ids=["plain", "calibrated"])
def test_the_image_of_a_crop_is_the_crop_of_the_image(whole):
    mesh, crop = random_triangles(60, 6), whole.crop(17, 5, 24, 16)
    assert_same_bits(trace_pixels(mesh, crop), part_of(trace_pixels(mesh, whole), 17, 5, crop))
    everything = whole.crop(0, 0, whole.width, whole.height)
    assert everything.plane == whole.plane
    assert everything.fov_y_degrees == pytest.approx(whole.fov_y_degrees)
    assert pickle.loads(pickle.dumps(everything)) == everything
    for method in METHODS:
        cut = part_of(trace(method, mesh, whole, (6, 2)), 17, 5, crop)
        assert_no_pixel_wrong(mesh, crop, trace(method, mesh, crop, (6, 2)), cut)


def test_frames_of_other_image_planes_are_aligned_and_eyes_of_others_refused():
    mesh, split = random_triangles(60, 7), atra.Split(6, 2, 48, 32)
    cameras = [VIEWS["off-centre"], VIEWS["axis outside of the image"], VIEWS["crop"], WHOLE]
    with atra.FramesTracer(mesh, atra.Alignment.of_frames(cameras, split), threads=1) as tracer:
        for camera, hits in zip(cameras, tracer.trace(), strict=True):
            assert_no_pixel_wrong(mesh, camera, hits, brute_force(mesh, camera))
    left, right = beside(1.0, 20.0, 16.0), beside(1.0, 21.0, 16.0)
    with pytest.raises(atra.InputError, match="or principal points, expected parallel views"):
        atra.Alignment.of_eyes(left, right, split)
