"""Camera files of further programs: read right, or named for what they are."""

import json
import sys

import numpy as np
import pytest

import atra
from atra.errors import InputError
from tests.files.test_camera_files import write_binary, write_text

POINTS = np.array([(0.3, -0.2, 1.0), (1.0, 0.5, 0.2)])
PROJECTED = {
    "FISHEYE": ((500, 450, 410, 190), [(553.96422535, 103.62146479), (1033.31878785, 470.49345453)]),
    "SIMPLE_FISHEYE": ((500, 410, 190), [(553.96422535, 94.02384977), (1033.31878785, 501.65939392)]),
    "EQUIRECTANGULAR": ((800, 400), [(437.10943163, 175.90111096), (574.86681672, 258.04059293)]),
}
"""Parameters of a model of 800 x 400 pixels, and where pycolmap 4.2.1 sees POINTS with it (`Camera.img_from_cam`)."""


@pytest.mark.parametrize("write", [write_text, write_binary])
@pytest.mark.parametrize("model", PROJECTED)
def test_a_recent_model_of_colmap_sees_points_where_pycolmap_does(model, write, tmp_path):
    parameters, expected = PROJECTED[model]
    write(tmp_path, {1: (model, 800, 400, parameters)}, [(1, np.array([1.0, 0, 0, 0]), np.zeros(3), 1, "a.jpg")])
    camera = atra.read_colmap(tmp_path)["a.jpg"]
    np.testing.assert_allclose(camera.project(POINTS), expected, atol=1e-5)


@pytest.mark.parametrize("write", [write_text, write_binary])
@pytest.mark.parametrize(("model", "count"), [("EUCM", 6), ("DIVISION", 5), ("SIMPLE_DIVISION", 4),
                                              ("RAD_TAN_THIN_PRISM_FISHEYE", 16)])  # fmt: skip
def test_a_model_without_lens_here_costs_its_own_images_alone(model, count, write, tmp_path):
    sensors = {1: (model, 800, 400, (1.0,) * count), 2: ("PINHOLE", 800, 400, (500.0, 500.0, 400.0, 200.0))}
    images = [(k, np.array([1.0, 0, 0, 0]), np.zeros(3), k, f"{k}.jpg") for k in (1, 2)]
    write(tmp_path, sensors, images)
    broken = {}
    assert list(atra.read_colmap(tmp_path, broken=broken)) == ["2.jpg"]
    assert f"its model is {model}, expected one of" in str(broken["1.jpg"])


KALIBR = """cam0:
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.05, 0.001, -0.001]
  distortion_model: {model}
  intrinsics: [500.0, 510.0, 320.0, 240.0]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
"""
XML = """<?xml version="1.0"?>
<opencv_storage>
<calibration_time>"Mon"</calibration_time>
<image_width>640</image_width>
<image_height>480</image_height>
<camera_matrix type_id="opencv-matrix">
  <rows>3</rows><cols>3</cols><dt>d</dt>
  <data>500. 0. 320. 0. 510. 240. 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix">
  <rows>1</rows><cols>5</cols><dt>d</dt>
  <data>-2e-1 5.0000000000000003e-02 1e-3 -1e-3 0.</data></distortion_coefficients>
</opencv_storage>
"""
SENSOR = {"width": 640, "height": 480, "intrinsic_matrix": [500, 0, 0, 0, 510, 0, 320, 240, 1]}
K = [[500, 0, 320], [0, 510, 240], [0, 0, 1]]
DISTORTION = [-0.2, 0.05, 0.001, -0.001]


@pytest.mark.parametrize(("name", "text", "distortion", "model"), [
    ("camchain.yaml", KALIBR.format(model="radtan"), DISTORTION, "pinhole"),
    ("camchain.yaml", KALIBR.format(model="equidistant"), DISTORTION, "fisheye"),
    ("calibration.xml", XML, [*DISTORTION, 0], "pinhole"), ("calibration", XML, [*DISTORTION, 0], "pinhole"),
    ("intrinsic.json", json.dumps({"class_name": "PinholeCameraIntrinsic", **SENSOR}), None, "pinhole"),
], ids=["Kalibr", "Kalibr's fisheye", "XML", "XML by its beginning", "Open3D"])  # fmt: skip
def test_a_calibration_of_a_further_program_is_that_of_its_numbers(name, text, distortion, model, tmp_path):
    (tmp_path / name).write_text(text, encoding="utf-8")
    ((called, camera),) = atra.read_calibration(tmp_path / name).items()
    assert called == (tmp_path / name).stem
    expected = atra.Camera.from_opencv(K, np.eye(3), (0, 0, 0), 640, 480, distortion, model)
    assert (camera.width, camera.height) == (640, 480)
    np.testing.assert_allclose(camera.project(POINTS), expected.project(POINTS), atol=1e-9)


@pytest.mark.parametrize(("name", "text", "told"), [
    ("c.yaml", KALIBR.format(model="radtan") + KALIBR.format(model="radtan").replace("cam0:", "cam1:"),
     "Kalibr's calibration of cam0, cam1; keep one in a file"),
    ("c.yaml", KALIBR.format(model="fov"), "its distortion_model is 'fov', expected one of plumb_bob, .*, radtan"),
    ("c.json", '{"class_name": "PinholeCameraTrajectory", "parameters": []}', "trajectory is read by read_transforms"),
    ("c.xml", "<a", "it is no XML"), ("c.xml", '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "declares entities"),
], ids=["two cameras", "model", "trajectory", "damaged", "entities"])  # fmt: skip
def test_a_calibration_that_is_not_read_says_what_it_is(name, text, told, tmp_path):
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=told):
        atra.read_calibration(tmp_path / name)


def test_yaml_without_its_package_says_so(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "yaml", None)
    (tmp_path / "c.yaml").write_text(KALIBR, encoding="utf-8")
    with pytest.raises(InputError, match="pip install pyyaml"):
        atra.read_calibration(tmp_path / "c.yaml")


def test_a_camera_path_of_nerfstudio_is_read_by_number(tmp_path):
    """A camera at (1, 2, 3) that looks along +Y, with Z up and 90 degrees across its height."""
    frames = [{"camera_to_world": [1, 0, 0, 1, 0, 0, -1, 2, 0, 1, 0, 3, 0, 0, 0, 1], "fov": 90, "aspect": 2}]
    found = {"camera_type": "perspective", "render_height": 200, "render_width": 400, "camera_path": frames}
    path = tmp_path / "camera_path.json"
    path.write_text(json.dumps(found), encoding="utf-8")
    camera = atra.read_transforms(path)["0"]
    # OpenGL's camera looks along -Z of its own, which is +Y of the world here; up is Z.
    positions = camera.project([(1, 12, 3), (1, 12, 13), (11, 12, 3)])
    np.testing.assert_allclose(positions, [(200, 100), (200, 0), (300, 100)], atol=1e-9)
    path.write_text(json.dumps(found | {"camera_type": "fisheye"}), encoding="utf-8")
    with pytest.raises(InputError, match="camera_type is 'fisheye', expected one of perspective"):
        atra.read_transforms(path)
    path.write_text(
        json.dumps(found | {"camera_path": [*frames, {"camera_to_world": [1], "fov": 90}]}), encoding="utf-8"
    )
    broken = {}
    assert list(atra.read_transforms(path, broken=broken)) == ["0"]
    assert "frame 1" in str(broken["1"])


def test_a_trajectory_of_open3d_is_read_by_number(tmp_path):
    """World to camera is a shift by (1, 2, 3); numbers stand column by column."""
    one = {"class_name": "PinholeCameraParameters", "extrinsic": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1],
           "intrinsic": SENSOR}  # fmt: skip
    path = tmp_path / "trajectory.json"
    path.write_text(json.dumps({"class_name": "PinholeCameraTrajectory", "parameters": [one]}), encoding="utf-8")
    expected = atra.Camera.from_opencv(K, np.eye(3), (1, 2, 3), 640, 480)
    found = atra.read_transforms(path)["0"]
    np.testing.assert_allclose(found.project(POINTS), expected.project(POINTS), atol=1e-9)
