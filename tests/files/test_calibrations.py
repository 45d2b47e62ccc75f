"""Calibrations of OpenCV, ROS, Kalibr and Open3D, and cameras of BOP scenes, made here and read back."""

import json
import sys

import numpy as np
import pytest

import atra
from tests.files.camera_samples import RAYS, K

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
distortion_model: {}
distortion_coefficients: {{rows: 1, cols: 4, data: [-0.2, 0.1, 0.01, -0.02]}}
"""
KALIBR = """{}:
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.1, 0.01, -0.02]
  distortion_model: {}
  intrinsics: [70.0, 65.0, 30.5, 25.0]
  resolution: [64, 48]
  rostopic: /cam0/image_raw
"""
XML = """<?xml version="1.0"?>
<opencv_storage>
<calibration_time>"Mon"</calibration_time>
<image_width>64</image_width>
<image_height>48</image_height>
<camera_matrix type_id="opencv-matrix">
  <rows>3</rows><cols>3</cols><dt>d</dt>
  <data>70. 0. 30.5 0. 65. 25. 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix">
  <rows>1</rows><cols>5</cols><dt>d</dt>
  <data>-2e-1 1.0000000000000001e-01 1e-2 -2e-2 0.</data></distortion_coefficients>
</opencv_storage>
"""
DISTORTION = [-0.2, 0.1, 0.01, -0.02]
MESSAGE = {"width": 64, "height": 48, "k": K, "d": DISTORTION}
OPEN3D = {"class_name": "PinholeCameraIntrinsic", "width": 64, "height": 48,
          "intrinsic_matrix": [70, 0, 0, 0, 65, 0, 30.5, 25, 1]}  # fmt: skip


@pytest.mark.parametrize(("name", "text", "distortion", "model"), [
    ("opencv.yml", OPENCV, DISTORTION, "pinhole"), ("ros.yaml", ROS.format("plumb_bob"), DISTORTION, "pinhole"),
    ("ros.yaml", ROS.format("equidistant"), DISTORTION, "fisheye"),
    ("message.json", json.dumps(MESSAGE | {"distortion_model": "plumb_bob"}), DISTORTION, "pinhole"),
    ("rows.json", json.dumps({"image_width": 64, "image_height": 48, "D": DISTORTION, "K": [K[:3], K[3:6], K[6:]]}),
     DISTORTION, "pinhole"),
    ("camchain.yaml", KALIBR.format("cam0", "radtan"), DISTORTION, "pinhole"),
    ("camchain.yaml", KALIBR.format("cam0", "equidistant"), DISTORTION, "fisheye"),
    ("calibration.xml", XML, [*DISTORTION, 0], "pinhole"), ("calibration", XML, [*DISTORTION, 0], "pinhole"),
    ("intrinsic.json", json.dumps(OPEN3D), None, "pinhole"),
], ids=["OpenCV", "ROS", "ROS's fisheye", "message", "rows", "Kalibr", "Kalibr's fisheye", "XML", "by its beginning",
        "Open3D"])  # fmt: skip
def test_a_calibration_is_that_of_its_numbers(name, text, distortion, model, tmp_path):
    (tmp_path / name).write_text(text, encoding="utf-8")
    ((called, camera),) = atra.read_calibration(tmp_path / name).items()
    assert called == (tmp_path / name).stem
    expected = atra.Camera.from_opencv(np.reshape(K, (3, 3)), np.eye(3), (0, 0, 0), 64, 48, distortion, model)
    assert (camera.width, camera.height) == (64, 48)
    np.testing.assert_allclose(camera.project(RAYS), expected.project(RAYS), rtol=0, atol=1e-9)
    (moved,) = atra.read_calibration(tmp_path / name, R=np.diag([1, -1, -1]), t=(0, 0, 2)).values()
    assert moved.eye == (0.0, 0.0, 2.0)


@pytest.mark.parametrize(("name", "text", "said"), [
    ("a.json", "[]", r"a\.json: it holds a list, expected a calibration"),
    ("a.json", "{}", r"a\.json: it has no camera_matrix"),
    ("a.yaml", "a: [", r"a\.yaml: it is no YAML"),
    ("a.json", json.dumps(MESSAGE | {"width": None}), "the size of the image is missing"),
    ("a.json", json.dumps(MESSAGE | {"k": [1, 2]}), r"camera_matrix is \[1, 2\], expected 9 numbers"),
    ("a.json", json.dumps(MESSAGE | {"k": [70, 1, 3, 0, 65, 2, 0, 0, 1]}), "K has the skew 1, expected 0"),
    ("a.json", json.dumps(MESSAGE | {"k": [-70, 0, 3, 0, 65, 2, 0, 0, 1]}), "focal length fx is -70"),
    ("a.json", json.dumps(MESSAGE | {"d": [1, 2, 3]}), "expected 4, 5, 8, 12 or 14 coefficients"),
    ("a.json", json.dumps(MESSAGE | {"d": [1, 2, 3, "x"]}), "a number of distortion_coefficients is 'x'"),
    ("a.json", json.dumps(MESSAGE | {"distortion_model": "omni"}), "distortion_model is 'omni', expected one of plumb"),
    ("c.yaml", KALIBR.format("cam0", "radtan") + KALIBR.format("cam1", "radtan"),
     "Kalibr's calibration of cam0, cam1; keep one in a file"),
    ("c.yaml", KALIBR.format("cam0", "fov"), "its distortion_model is 'fov', expected one of plumb_bob, .*, radtan"),
    ("c.yaml", KALIBR.format("cam0", "none").replace("pinhole", "omni"), "camera_model is 'omni', expected pinhole"),
    ("c.json", '{"class_name": "PinholeCameraTrajectory", "parameters": []}', "trajectory is read by read_transforms"),
    ("c.xml", "<a", "it is no XML"), ("c.xml", '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "declares entities"),
])  # fmt: skip
def test_a_calibration_that_is_not_read_says_what_it_is_or_lacks(name, text, said, tmp_path):
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(atra.InputError, match=said):
        atra.read_calibration(tmp_path / name)


def test_yaml_without_its_package_says_so(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "yaml", None)
    (tmp_path / "c.yaml").write_text(KALIBR, encoding="utf-8")
    with pytest.raises(atra.InputError, match="pip install pyyaml"):
        atra.read_calibration(tmp_path / "c.yaml")


def test_the_cameras_of_a_bop_scene_are_read_with_the_dataset_s_image_size(tmp_path):
    scene = tmp_path / "test" / "000001"
    scene.mkdir(parents=True)
    (tmp_path / "camera.json").write_text(json.dumps({"width": 64, "height": 48}))
    turn = np.diag([1, -1, -1]).ravel().tolist()
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
