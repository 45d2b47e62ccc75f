"""Files of cameras with a lens, made here and read back; COLMAP's models as OpenCV and closed forms have them."""

import json

import numpy as np
import pytest

import atra
from tests.files.test_camera_files import WRITERS
from tests.images import assert_equal_images
from tests.judge.reference import brute_force
from tests.meshes import cornell_box

cv2 = pytest.importorskip("cv2", reason="OpenCV, a test dependency, projects as COLMAP's models do")

FOCALS, RAYS = (70.0, 65.0, 31.0, 25.5), np.array([(0.1, 0.2, 1.0), (-0.4, 0.3, 1.0), (0.5, -0.45, 1.0)])
X, Y = RAYS[:, 0], RAYS[:, 1]
RADIUS, ANGLE = np.hypot(X, Y), np.arctan(np.hypot(X, Y))


def by_opencv(*coefficients):
    return cv2.projectPoints(RAYS, np.zeros(3), np.zeros(3), np.eye(3), np.array(coefficients))[0][:, 0]


def scaled(factor):
    return np.stack([X, Y], axis=1) * factor[:, None]


def thin_prism(k1, k2, p1, p2, k3, k4, s1, s3):
    u, v = X * ANGLE / RADIUS, Y * ANGLE / RADIUS
    q = u * u + v * v
    radial = 1 + k1 * q + k2 * q**2 + k3 * q**3 + k4 * q**4
    return np.stack([
        u * radial + 2 * p1 * u * v + p2 * (q + 2 * u * u) + s1 * q,
        v * radial + 2 * p2 * u * v + p1 * (q + 2 * v * v) + s3 * q,
    ], axis=1)  # fmt: skip


KINDS = {
    "SIMPLE_RADIAL": ((70.0, 31.0, 25.5, -0.2), by_opencv(-0.2, 0, 0, 0)),
    "RADIAL": ((70.0, 31.0, 25.5, -0.2, 0.1), by_opencv(-0.2, 0.1, 0, 0)),
    "OPENCV": ((*FOCALS, -0.2, 0.1, 0.01, -0.02), by_opencv(-0.2, 0.1, 0.01, -0.02)),
    "FULL_OPENCV": (
        (*FOCALS, -0.2, 0.1, 0.01, -0.02, 0.02, 0.3, 0.1, 0.02),
        by_opencv(-0.2, 0.1, 0.01, -0.02, 0.02, 0.3, 0.1, 0.02),
    ),
    "FOV": ((*FOCALS, 0.9), scaled(np.arctan(2 * RADIUS * np.tan(0.45)) / 0.9 / RADIUS)),
    "SIMPLE_RADIAL_FISHEYE": ((70.0, 31.0, 25.5, 0.1), scaled(ANGLE * (1 + 0.1 * ANGLE**2) / RADIUS)),
    "RADIAL_FISHEYE": (
        (70.0, 31.0, 25.5, 0.1, -0.05),
        scaled(ANGLE * (1 + 0.1 * ANGLE**2 - 0.05 * ANGLE**4) / RADIUS),
    ),
    "OPENCV_FISHEYE": (
        (*FOCALS, 0.1, -0.05, 0.02, 0.01),
        scaled(ANGLE * (1 + 0.1 * ANGLE**2 - 0.05 * ANGLE**4 + 0.02 * ANGLE**6 + 0.01 * ANGLE**8) / RADIUS),
    ),
    "THIN_PRISM_FISHEYE": (
        (*FOCALS, 0.1, -0.05, 0.01, 0.02, 0.02, 0.01, 0.03, -0.02),
        thin_prism(0.1, -0.05, 0.01, 0.02, 0.02, 0.01, 0.03, -0.02),
    ),
}


def read_colmap(folder, write, model, parameters, turn=(1.0, 0.0, 0.0, 0.0), place=(0.0, 0.0, 0.0)):
    write(folder, {1: (model, 64, 48, parameters)}, [(1, turn, place, 1, "a.png")])
    return atra.read_colmap(folder)["a.png"]


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
@pytest.mark.parametrize("model", KINDS)
def test_a_colmap_camera_sees_points_where_its_model_says(model, write, tmp_path):
    parameters, expected = KINDS[model]
    fx, fy, cx, cy = FOCALS if len(parameters) > 5 or model == "FOV" else (70.0, 70.0, 31.0, 25.5)
    seen = read_colmap(tmp_path, write, model, parameters).project(RAYS)
    np.testing.assert_allclose(seen, expected * [fx, fy] + [cx, cy], rtol=0, atol=1e-9)


@pytest.mark.parametrize("model", ["OPENCV", "OPENCV_FISHEYE"])
def test_a_colmap_model_with_distortion_is_rendered_with_the_labels_of_the_reference(model, tmp_path):
    turn = (np.cos(0.1), 0.0, np.sin(0.1), 0.0)
    parameters = (40.0, 42.0, 33.0, 23.0, -0.1, 0.05, 0.001, 0.002)
    camera = read_colmap(tmp_path, WRITERS["binary"], model, parameters, turn, (0.1, -0.7, 0.9))
    mesh = cornell_box()
    with atra.PixelTracer(mesh, camera, threads=1) as tracer:
        hits = tracer.trace()
    assert hits.hit.mean() > 0.3
    assert_equal_images(mesh, camera, hits, brute_force(mesh, camera))


POSE = np.diag([1.0, -1.0, -1.0, 1.0]).tolist()


def read_frame(tmp_path, **fields):
    shared = {"w": 64, "h": 48, "fl_x": 70, "fl_y": 65, "cx": 31, "cy": 25.5}
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps({**shared, **fields, "frames": [{"file_path": "a", "transform_matrix": POSE}]}))
    (camera,) = atra.read_transforms(path).values()
    return camera


@pytest.mark.parametrize(("fields", "expected"), [
    ({"k1": -0.2, "k2": 0.1, "p1": 0.01, "p2": -0.02}, KINDS["OPENCV"][1]),
    ({"camera_model": "OPENCV", "k1": -0.2, "k2": 0.1, "p1": 0.01, "p2": -0.02}, KINDS["OPENCV"][1]),
    ({"is_fisheye": True, "k1": 0.1, "k2": -0.05, "k3": 0.02, "k4": 0.01}, KINDS["OPENCV_FISHEYE"][1]),
    ({"camera_model": "OPENCV_FISHEYE", "k1": 0.1, "k2": -0.05, "k3": 0.02, "k4": 0.01}, KINDS["OPENCV_FISHEYE"][1]),
])  # fmt: skip
def test_a_transforms_json_with_a_lens_is_read(fields, expected, tmp_path):
    seen = read_frame(tmp_path, **fields).project(RAYS)
    np.testing.assert_allclose(seen, expected * [70, 65] + [31, 25.5], rtol=0, atol=1e-9)


def test_a_transforms_json_may_be_of_panoramas(tmp_path):
    camera = read_frame(tmp_path, camera_model="EQUIRECTANGULAR")
    assert camera.lens == atra.EquirectangularLens()
    np.testing.assert_allclose(camera.project([(0, 0, 1)]), [(32, 24)])


OPENCV = """%YAML:1.0
---
image_width: 64
image_height: 48
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 70., 0., 30.5, 0., 65., 25., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 4
   dt: d
   data: [ -0.2, 0.1, 0.01,
       -2.0e-02 ]
"""
ROS = """image_width: 64
image_height: 48
camera_name: narrow
camera_matrix:
  rows: 3
  cols: 3
  data: [70, 0, 30.5, 0, 65, 25, 0, 0, 1]
distortion_model: {model}
distortion_coefficients: {{rows: 1, cols: 4, data: {data}}}
"""
MESSAGE = {"width": 64, "height": 48, "k": [70, 0, 30.5, 0, 65, 25, 0, 0, 1], "d": [-0.2, 0.1, 0.01, -0.02]}


@pytest.mark.parametrize(("name", "text", "expected"), [
    ("opencv.yml", OPENCV, "OPENCV"),
    ("ros.yaml", ROS.format(model="plumb_bob", data="[-0.2, 0.1, 0.01, -0.02]"), "OPENCV"),
    ("ros.yaml", ROS.format(model="equidistant", data="[0.1, -0.05, 0.02, 0.01]"), "OPENCV_FISHEYE"),
    ("message.json", json.dumps(MESSAGE | {"distortion_model": "plumb_bob"}), "OPENCV"),
    ("rows.json", json.dumps({"image_width": 64, "image_height": 48, "D": MESSAGE["d"],
                              "K": [[70, 0, 30.5], [0, 65, 25], [0, 0, 1]]}), "OPENCV"),
])  # fmt: skip
def test_a_calibration_of_opencv_or_ros_is_read(name, text, expected, tmp_path):
    (tmp_path / name).write_text(text)
    (camera,) = atra.read_calibration(tmp_path / name).values()
    assert (camera.width, camera.height) == (64, 48)
    np.testing.assert_allclose(camera.project(RAYS), KINDS[expected][1] * [70, 65] + [31, 25.5], rtol=0, atol=1e-9)
    (moved,) = atra.read_calibration(tmp_path / name, R=np.diag([1, -1, -1]), t=(0, 0, 2)).values()
    assert moved.eye == (0.0, 0.0, 2.0)


@pytest.mark.parametrize(("name", "text", "said"), [
    ("a.json", "[]", r"a\.json: it holds a list, expected a calibration"),
    ("a.json", "{}", r"a\.json: it has no camera_matrix"),
    ("a.yaml", "a: [", r"a\.yaml: it is no YAML"),
    ("a.json", json.dumps(MESSAGE | {"width": None}), "the size of the image is missing"),
    ("a.json", json.dumps(MESSAGE | {"k": [1, 2]}), "camera_matrix has 2 numbers, expected 9"),
    ("a.json", json.dumps(MESSAGE | {"k": [70, 1, 3, 0, 65, 2, 0, 0, 1]}), "K has the skew 1, expected 0"),
    ("a.json", json.dumps(MESSAGE | {"k": [-70, 0, 3, 0, 65, 2, 0, 0, 1]}), "focal length fx is -70"),
    ("a.json", json.dumps(MESSAGE | {"d": [1, 2, 3]}), "expected 4, 5, 8, 12 or 14 coefficients"),
    ("a.json", json.dumps(MESSAGE | {"d": [1, 2, 3, "x"]}), "a number of distortion_coefficients is 'x'"),
    ("a.json", json.dumps(MESSAGE | {"distortion_model": "omni"}), "distortion_model is 'omni', expected one of plumb"),
])  # fmt: skip
def test_what_is_broken_in_a_calibration_is_named(name, text, said, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(atra.InputError, match=said):
        atra.read_calibration(tmp_path / name)


def test_the_cameras_of_a_bop_scene_are_read_with_the_dataset_s_image_size(tmp_path):
    scene = tmp_path / "test" / "000001"
    scene.mkdir(parents=True)
    (tmp_path / "camera.json").write_text(json.dumps({"width": 64, "height": 48}))
    K, turn = [70, 0, 30.5, 0, 65, 25, 0, 0, 1], np.diag([1, -1, -1]).ravel().tolist()
    images = {"3": {"cam_K": K, "depth_scale": 1.0}, "5": {"cam_K": K, "cam_R_w2c": turn, "cam_t_w2c": [0, 0, 2]}}
    path = scene / "scene_camera.json"
    path.write_text(json.dumps(images | {"7": {"cam_K": K[:4]}, "8": {}}))
    broken = {}
    cameras = atra.read_bop(path, broken=broken)
    assert (list(cameras), list(broken)) == (["3", "5"], ["7", "8"])
    assert "cam_K is [70, 0, 30.5, 0], expected 9 numbers" in str(broken["7"])
    np.testing.assert_allclose(cameras["3"].project([(0.1, 0.2, 1)]), [(38.0, 38.5)])
    assert cameras["5"].eye == (0.0, 0.0, 2.0)
    (tmp_path / "camera.json").unlink()
    with pytest.raises(atra.InputError, match=r"expected a camera\.json above it; or give a size"):
        atra.read_bop(path)
    assert atra.read_bop(path, (32, 24), broken={})["3"].width == 32
