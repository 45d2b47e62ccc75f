"""Files of frames (NeRF programs, Nerfstudio, Open3D) made here and read back; what is broken in them is named."""

import json

import numpy as np
import pytest

import atra
from tests.files.camera_samples import FOCALS, RAYS, assert_same_view, poses, rotation_of
from tests.files.test_camera_files import LENSES


def matrix_of(index):
    """Camera to world, OpenGL's axes."""
    _, turn, place, *_ = poses()[index]
    return np.block([[rotation_of(turn), place[:, None]], [np.eye(4)[3:]]])


def transforms(*changes, **shared):
    """A `transforms.json` of three frames; each of `changes` goes into a frame, None takes a key out."""
    frames = [{"file_path": f"images/{i}.png", "transform_matrix": matrix_of(i).tolist()} for i in range(3)]
    for frame, change in zip(frames, changes, strict=False):
        frame.update(change)
    return {"w": 64, "h": 48, "fl_x": 70.5, "fl_y": 65.25, "cx": 31.0, "cy": 25.5, **shared, "frames": frames}


def written(folder, contents):
    def without_none(given):
        return {key: value for key, value in given.items() if value is not None} if isinstance(given, dict) else given

    contents = without_none(contents)
    contents["frames"] = [without_none(frame) for frame in contents["frames"]]
    path = folder / "transforms.json"
    path.write_text(json.dumps(contents), encoding="utf-8")
    return path


def placed(index):
    """R and t, OpenCV's axes."""
    matrix = matrix_of(index)
    rotation = (matrix[:3, :3] @ np.diag([1, -1, -1])).T
    return rotation, -rotation @ matrix[:3, 3]


def test_a_transforms_json_is_read_back_in_its_order_and_a_frame_may_have_numbers_of_its_own(tmp_path):
    own = {"fl_x": 33.0, "fl_y": 34.0, "cx": -5.0, "cy": 60.0, "w": 32, "h": 24}
    cameras = atra.read_transforms(written(tmp_path, transforms({}, own, k1=0.0, p2=0, camera_model="OPENCV")))
    assert list(cameras) == ["images/0.png", "images/1.png", "images/2.png"]
    for index, camera in enumerate(cameras.values()):
        intrinsic, size = ((70.5, 65.25, 31.0, 25.5), (64, 48)) if index != 1 else ((33.0, 34.0, -5.0, 60.0), (32, 24))
        assert_same_view(camera, intrinsic, *placed(index), size)


def test_a_field_of_view_alone_means_square_pixels_about_the_middle_and_the_size_may_be_given(tmp_path):
    alone, focal = dict.fromkeys(("w", "h", "fl_x", "fl_y", "cx", "cy")), 32 / np.tan(0.45)
    camera, *_ = atra.read_transforms(written(tmp_path, transforms(**alone, camera_angle_x=0.9)), (64, 48)).values()
    assert_same_view(camera, (focal, focal, 32.0, 24.0), *placed(0), (64, 48))
    both = transforms(**alone | {"w": 64, "h": 48}, camera_angle_x=0.9, camera_angle_y=0.5)
    camera, *_ = atra.read_transforms(written(tmp_path, both)).values()
    assert camera.fov_y_degrees == pytest.approx(np.degrees(0.5))


@pytest.mark.parametrize(("fields", "model"), [
    ({"k1": -0.2, "k2": 0.1, "p1": 0.01, "p2": -0.02}, "OPENCV"),
    ({"camera_model": "OPENCV", "k1": -0.2, "k2": 0.1, "p1": 0.01, "p2": -0.02}, "OPENCV"),
    ({"is_fisheye": True, "k1": 0.1, "k2": -0.05, "k3": 0.02, "k4": 0.01}, "OPENCV_FISHEYE"),
    ({"camera_model": "OPENCV_FISHEYE", "k1": 0.1, "k2": -0.05, "k3": 0.02, "k4": 0.01}, "OPENCV_FISHEYE"),
    ({"camera_model": "EQUIRECTANGULAR"}, None),
])  # fmt: skip
def test_a_transforms_json_with_a_lens_is_read(fields, model, tmp_path):
    sensor = dict(zip(("fl_x", "fl_y", "cx", "cy"), FOCALS, strict=True))
    frame = {"transform_matrix": np.diag([1, -1, -1, 1]).tolist()}
    camera, *_ = atra.read_transforms(written(tmp_path, transforms(frame, **sensor, **fields))).values()
    if model is None:
        assert camera.lens == atra.EquirectangularLens()
        np.testing.assert_allclose(camera.project([(0, 0, 1)]), [(32, 24)])
    else:
        coefficients, expected = LENSES[model]
        seen = expected(*coefficients) * FOCALS[:2] + FOCALS[2:]
        np.testing.assert_allclose(camera.project(RAYS), seen, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("contents", "message"), [
    (transforms(k1=0.1, camera_model="PINHOLE"), r"frame 0 .*: k1 is 0\.1, but the camera model PINHOLE has only \[\]"),
    (transforms({}, {"p1": "x"}), r"frame 1 \('images/1\.png'\): p1 is 'x', expected a finite number"),
    (transforms(camera_model="FISHEYE624"), "camera_model: its model is FISHEYE624, expected one of SIMPLE_PINHOLE"),
    (transforms(camera_model="FOV"), "the camera model is FOV, whose parameters have no names"),
    (transforms(is_fisheye=True, p1=0.1), r"p1 is 0\.1, but the camera model OPENCV_FISHEYE has only"),
    (transforms(camera_model="OPENCV", k4=0.1), r"k4 is 0\.1, but the camera model OPENCV has only"),
    (transforms(w=None), r"the size of the image is missing, expected w and h; or give size="),
    (transforms(h=0), "h is 0, expected a whole number of pixels"),
    (transforms(w="64"), "w is '64', expected a finite number"),
    (transforms(fl_x=None, fl_y=None), "the focal length is missing, expected fl_x or camera_angle_x"),
    (transforms(fl_x=0), r"the focal length fx is 0\.0, expected a finite number of pixels above 0"),
    (transforms(fl_x=None, camera_angle_x=4), "camera_angle_x is 4, expected radians between 0 and pi"),
    (transforms({"cy": float("nan")}), r"frame 0 .*: cy is nan, expected a finite number"),
    (transforms({}, {}, {"transform_matrix": None}), r"frame 2 .*: it has no transform_matrix"),
    (transforms({"transform_matrix": [[1, 2], [3, 4]]}), r"frame 0 .*: camera_to_world has shape \(2, 2\)"),
    (transforms({"transform_matrix": (2 * np.eye(4)).tolist()}), r"frame 0 .*: the last row of camera_to_world"),
    (transforms({}, {"transform_matrix": np.diag([3, 3, 3, 1]).tolist()}), "frame 1 .* is no rotation.*a scale"),
    (transforms({}, {"file_path": "images/0.png"}), r"frame 1 .*: the name 'images/0\.png' is there twice"),
    ({"frames": ["x"]}, "frame 0: it has no file_path"),
    ({"frames": []}, r"transforms\.json has no frame, expected at least one"),
])  # fmt: skip
def test_what_is_broken_in_a_transforms_json_is_named(contents, message, tmp_path):
    with pytest.raises(atra.InputError, match=message):
        atra.read_transforms(written(tmp_path, contents))


def test_broken_frames_of_a_transforms_json_are_left_out_by_name_if_asked(tmp_path):
    contents = transforms({"k1": "x"}, {}, {"file_path": None})
    contents["frames"] += [{"file_path": "images/1.png"}, "x", {"file_path": "cut.png"}, {"file_path": "cut.png"}]
    contents["frames"].append({"file_path": "huge.png", "fl_x": 10**400})
    broken = {}
    assert list(atra.read_transforms(written(tmp_path, contents), broken=broken)) == ["images/1.png"]
    no_name, no_matrix = "it has no file_path", "it has no transform_matrix"
    reasons = {
        "images/0.png": "k1 is 'x'", "frame 2": no_name, "frame 3 ('images/1.png')": no_matrix, "frame 4": no_name,
        "cut.png": no_matrix, "frame 6 ('cut.png')": no_matrix, "huge.png": "fl_x is 1000",
    }  # fmt: skip
    assert list(broken) == list(reasons)
    assert all(reason in str(broken[name]) for name, reason in reasons.items())
    with pytest.raises(atra.InputError, match=r"no frame that can be used, expected at least one; .*frame 0.*k1 is"):
        atra.read_transforms(written(tmp_path, transforms(k1="x")), broken={})


def test_a_file_that_is_not_there_or_no_transforms_json_is_refused(tmp_path):
    path = tmp_path / "transforms.json"
    for text, message in (
        (None, r"transforms\.json cannot be read: No such file"), ("{", "is no JSON"),
        ("[]", "holds a list, expected an object with frames"), ("{}", "has no list of frames"),
    ):  # fmt: skip
        if text is not None:
            path.write_text(text, encoding="utf-8")
        with pytest.raises(atra.InputError, match=message):
            atra.read_transforms(path)


def test_a_camera_path_of_nerfstudio_is_read_by_number(tmp_path):
    """A camera at (1, 2, 3) that looks along +Y, with Z up and 90 degrees across its height."""
    frames = [{"camera_to_world": [1, 0, 0, 1, 0, 0, -1, 2, 0, 1, 0, 3, 0, 0, 0, 1], "fov": 90, "aspect": 2}]
    found = {"camera_type": "perspective", "render_height": 200, "render_width": 400, "camera_path": frames}
    path = tmp_path / "camera_path.json"
    path.write_text(json.dumps(found), encoding="utf-8")
    # OpenGL's camera looks along -Z of its own, which is +Y of the world here; up is Z.
    positions = atra.read_transforms(path)["0"].project([(1, 12, 3), (1, 12, 13), (11, 12, 3)])
    np.testing.assert_allclose(positions, [(200, 100), (200, 0), (300, 100)], atol=1e-9)
    path.write_text(json.dumps(found | {"camera_type": "fisheye"}), encoding="utf-8")
    with pytest.raises(atra.InputError, match="camera_type is 'fisheye', expected one of perspective"):
        atra.read_transforms(path)
    found["camera_path"] = [*frames, {"camera_to_world": [1], "fov": 90}]
    path.write_text(json.dumps(found), encoding="utf-8")
    broken = {}
    assert list(atra.read_transforms(path, broken=broken)) == ["0"]
    assert "frame 1" in str(broken["1"])


def test_a_trajectory_of_open3d_is_read_by_number(tmp_path):
    """World to camera is a shift by (1, 2, 3); numbers stand column by column."""
    sensor = {"width": 640, "height": 480, "intrinsic_matrix": [500, 0, 0, 0, 510, 0, 320, 240, 1]}
    one = {"class_name": "PinholeCameraParameters", "extrinsic": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1],
           "intrinsic": sensor}  # fmt: skip
    path = tmp_path / "trajectory.json"
    path.write_text(json.dumps({"class_name": "PinholeCameraTrajectory", "parameters": [one]}), encoding="utf-8")
    expected = atra.Camera.from_opencv([[500, 0, 320], [0, 510, 240], [0, 0, 1]], np.eye(3), (1, 2, 3), 640, 480)
    np.testing.assert_allclose(atra.read_transforms(path)["0"].project(RAYS), expected.project(RAYS), atol=1e-9)
