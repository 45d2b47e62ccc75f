"""Camera files made here and read back; what is missing or broken in them is named."""

import json
import re
from struct import pack

import numpy as np
import pytest
import trimesh

import atra
from atra.files.cameras.lens_models import CAMERA_MODELS

SENSORS = {1: ("PINHOLE", 64, 48, (70.5, 65.25, 31.0, 25.5)), 7: ("SIMPLE_PINHOLE", 32, 24, (40.0, 15.5, 12.25))}


def rotation_of(quaternion):
    """By two products of quaternions for each axis, another way than the reader's."""
    w, x, y, z = quaternion
    vector = np.array([x, y, z])
    return np.stack([v + 2 * w * np.cross(vector, v) + 2 * np.cross(vector, np.cross(vector, v)) for v in np.eye(3)]).T


def poses():
    random = np.random.default_rng(8)
    turns = random.normal(size=(3, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    places = random.normal(size=(3, 3)) * 4
    names = ("rooms/a b.jpg", "0002.png", "ünder.png")
    return [
        (i + 5, turn, place, sensor, name)
        for i, (turn, place, sensor, name) in enumerate(zip(turns, places, (7, 1, 7), names, strict=True))
    ]


def write_text(folder, sensors=SENSORS, images=None):
    lines = ["# Camera list", "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    for sensor, (model, width, height, parameters) in sensors.items():
        lines.append(f"{sensor} {model} {width} {height} " + " ".join(map(repr, parameters)))
    (folder / "cameras.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    lines = ["# Image list with two lines of data per image:", ""]
    for index, (number, turn, place, sensor, name) in enumerate(poses() if images is None else images):
        numbers = " ".join(repr(float(value)) for value in (*turn, *place))
        lines += [f"{number} {numbers} {sensor} {name}", "" if index % 2 else "1.5 2.5 -1 3.5 4.5 12"]
    (folder / "images.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_binary(folder, sensors=SENSORS, images=None):
    numbers = {name: number for number, name in enumerate(CAMERA_MODELS)}
    cameras = pack("<Q", len(sensors))
    for sensor, (model, width, height, parameters) in sensors.items():
        cameras += pack("<IiQQ", sensor, numbers[model], width, height) + pack(f"<{len(parameters)}d", *parameters)
    (folder / "cameras.bin").write_bytes(cameras)
    given = poses() if images is None else images
    data = pack("<Q", len(given))
    for index, (number, turn, place, sensor, name) in enumerate(given):
        data += pack("<I7dI", number, *turn, *place, sensor) + name.encode() + b"\0"
        data += pack("<Q", index) + index * pack("<ddQ", 1.5, 2.5, 2**64 - 1)
    (folder / "images.bin").write_bytes(data)


WRITERS = {"text": write_text, "binary": write_binary}


def assert_same_view(camera, intrinsic, rotation, translation, size):
    """camera sees what K, R and t say; the principal point in `intrinsic` counts from the image's corner."""
    fx, fy, cx, cy = intrinsic
    assert (camera.width, camera.height) == size
    assert camera.plane == atra.ImagePlane(1 / fx, 1 / fy, cx, cy)
    np.testing.assert_allclose(camera.axes, rotation, atol=1e-12)
    np.testing.assert_allclose(camera.axes @ camera.eye, -np.asarray(translation), atol=1e-12)


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
def test_a_colmap_model_is_read_back_in_its_order(write, tmp_path):
    write(tmp_path)
    cameras = atra.read_colmap(tmp_path)
    assert list(cameras) == [name for *_, name in poses()]
    for (_, turn, place, sensor, _), camera in zip(poses(), cameras.values(), strict=True):
        _, width, height, parameters = SENSORS[sensor]
        intrinsic = parameters if len(parameters) == 4 else parameters[:1] + parameters
        assert_same_view(camera, intrinsic, rotation_of(turn), place, (width, height))


def test_of_a_model_in_both_forms_the_binary_one_is_read(tmp_path):
    write_text(tmp_path, images=poses()[:1])
    write_binary(tmp_path)
    assert len(atra.read_colmap(tmp_path)) == 3


UNTURNED = (1.0, 0.0, 0.0, 0.0)
NOWHERE = (0.0, 0.0, 0.0)


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
@pytest.mark.parametrize(("sensor", "message"), [
    (
        ("RAD_TAN_THIN_PRISM_FISHEYE", 64, 48, (70.0,) * 16),
        "its model is RAD_TAN_THIN_PRISM_FISHEYE, expected one of SIMPLE_PINHOLE, PINHOLE, ",
    ),
    (("OPENCV", 64, 48, (70.0, 70.0, 32.0, 24.0, 0.1, np.inf, 0.0, 0.0)), "k2 is inf, expected a finite number"),
    (("FOV", 64, 48, (70.0, 70.0, 32.0, 24.0, 4.0)), "omega of the lens is 4, expected radians"),
    (("PINHOLE", 64, 48, (0.0, 65.0, 31.0, 25.0)), r"the focal length fx is 0\.0"),
    (("PINHOLE", 64, 48, (60.0, 65.0, np.nan, 25.0)), "cx is nan, expected a finite number"),
    (("PINHOLE", 0, 48, SENSORS[1][3]), "its width is 0, expected a whole number"),
])  # fmt: skip
def test_a_broken_or_unknown_camera_of_a_colmap_model_is_named(write, sensor, message, tmp_path):
    write(tmp_path, SENSORS | {1: sensor})
    with pytest.raises(atra.InputError, match=rf"cameras\.\w+, camera 1: {message}"):
        atra.read_colmap(tmp_path)


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
@pytest.mark.parametrize(("images", "message"), [
    ([(5, UNTURNED, NOWHERE, 2, "a")], r", image 5 \('a'\): its camera is 2, which is not in cameras"),
    ([(5, (2.0, 0.0, 0.0, 0.0), NOWHERE, 1, "a")], r", image 5 \('a'\): its rotation .* has length 2, expected"),
    ([(5, (1.0, 0.0, 0.0, np.inf), NOWHERE, 1, "a")], r", image 5 \('a'\): a part of its rotation is inf"),
    ([(5, UNTURNED, (0.0, np.nan, 0.0), 1, "a")], r", image 5 \('a'\): a translation is nan"),
    ([(i, UNTURNED, NOWHERE, 1, "a") for i in (5, 6)], r", image 6 \('a'\): the name 'a' is there twice"),
    ([], " has no image, expected at least one"),
])  # fmt: skip
def test_a_broken_image_of_a_colmap_model_is_named(write, images, message, tmp_path):
    write(tmp_path, images=images)
    with pytest.raises(atra.InputError, match=rf"images\.\w+{message}"):
        atra.read_colmap(tmp_path)


def test_an_unknown_camera_that_no_image_uses_does_no_harm(tmp_path):
    write_text(tmp_path, SENSORS | {9: ("RAD_TAN_THIN_PRISM_FISHEYE", 64, 48, (1.0,) * 16)})
    assert len(atra.read_colmap(tmp_path)) == 3


@pytest.mark.parametrize(("name", "text", "message"), [
    ("cameras.txt", "1 PINHOLE 64\n", r"cameras\.txt, line 1 has 3 words, expected CAMERA_ID MODEL"),
    ("cameras.txt", "7 PINHOLE 64 48 70 70 x 24\n", r"cameras\.txt, camera 7: cx is 'x', expected a finite number"),
    ("cameras.txt", "7 PINHOLE 6x 48 70 70 3 24\n", r"cameras\.txt, camera 7: its width is '6x', expected a finite"),
    ("cameras.txt", "1.5 PINHOLE 64 48 70 70 3 24\n", r"line 1 starts with '1\.5', expected a whole number"),
    ("cameras.txt", "7 PINHOLE 64 48 70 70 3\n", "camera 7: it has 3 parameters, expected 4: fx, fy, cx, cy"),
    ("cameras.txt", "7 PINHOLE 64 48 1 1 3 4\n" * 2, "camera 7 is there twice"),
    ("images.txt", "5 1 0 0 0 0 0 0 1\n", r"images\.txt, line 1 has 9 words, .* two lines"),
    (
        "images.txt",
        "5 1 0 0 0 0 0 0 1 a.png\n6 1 0 0 0 0 0 0 1 b.png\n",
        r"images\.txt, line 2 has 10 words, expected X Y POINT3D_ID .* two lines",
    ),
    ("images.txt", "5 1 0 0 0 0 zero 0 7 a.png\n", r"image 5 \('a\.png'\): a translation is 'zero', expected"),
    ("images.txt", "5 1 0 0 0 0 0 0 I a.png\n", r"image 5 \('a\.png'\): its camera is 'I', which is not in"),
])  # fmt: skip
def test_a_broken_line_of_a_colmap_model_is_named(name, text, message, tmp_path):
    write_text(tmp_path)
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(atra.InputError, match=message):
        atra.read_colmap(tmp_path)


@pytest.mark.parametrize(("name", "kept", "message"), [
    ("cameras.bin", 4, r"cameras\.bin ends in the number of cameras, after 4 bytes; is it cut off\?"),
    ("cameras.bin", 50, "ends in camera 1"),
    ("cameras.bin", 70, "ends in camera entry 1"),
    ("images.bin", 30, "ends in image entry 0"),
    ("images.bin", 75, "ends in image 5"),
    ("images.bin", -3, "ends in image 7"),
])  # fmt: skip
def test_a_cut_binary_model_is_refused_saying_where_it_ends(name, kept, message, tmp_path):
    write_binary(tmp_path)
    path = tmp_path / name
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(atra.InputError, match=message):
        atra.read_colmap(tmp_path)


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
def test_broken_images_of_a_colmap_model_are_left_out_by_name_if_asked(write, tmp_path):
    fisheye = ("RAD_TAN_THIN_PRISM_FISHEYE", 64, 48, (1.0,) * 16)
    good = [(i, UNTURNED, NOWHERE, 1, f"{i}.png") for i in range(18)]
    turned = (20, (1.0, 1.0, 0.0, 0.0), NOWHERE, 1, "turned.png")
    images = [*good[:3], turned, *good[3:], (21, UNTURNED, NOWHERE, 9, "bent.png"), good[0]]
    write(tmp_path, SENSORS | {9: fisheye}, images)
    broken = {}
    assert list(atra.read_colmap(tmp_path, broken=broken)) == [name for *_, name in good]
    assert list(broken) == ["turned.png", "bent.png", "image 0 ('0.png')"]
    for error, message in zip(broken.values(), ("unit quaternion", "camera 9: its model is", "twice"), strict=True):
        assert isinstance(error, atra.InputError)
        assert re.search(rf"images\.\w+, image \d+ .*{message}", str(error))
    write(tmp_path, SENSORS | {9: fisheye}, images[-2:-1])
    with pytest.raises(atra.InputError, match=r"has no image that can be used, expected .*'bent\.png'.*PRISM_FISHEYE"):
        atra.read_colmap(tmp_path, broken={})


def test_an_unknown_model_number_and_a_folder_without_a_model_are_refused(tmp_path):
    with pytest.raises(atra.InputError, match=r"is no COLMAP model, expected cameras\.bin and images\.bin"):
        atra.read_colmap(tmp_path)
    write_binary(tmp_path)
    (tmp_path / "cameras.bin").write_bytes(pack("<QIiQQ", 1, 4, 99, 64, 48))
    with pytest.raises(atra.InputError, match=r"camera 4: its model is number 99, expected 0 to 17"):
        atra.read_colmap(tmp_path)


def matrix_of(index):
    """Camera to world, OpenGL's axes."""
    _, turn, place, _, _ = poses()[index]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation_of(turn), place
    return matrix


def transforms(*changes, **shared):
    """A `transforms.json` of three frames; each of `changes` goes into a frame, None takes a key out."""
    frames = [{"file_path": f"images/{i}.png", "transform_matrix": matrix_of(i).tolist()} for i in range(3)]
    for frame, change in zip(frames, changes, strict=False):
        frame.update(change)
    return {"w": 64, "h": 48, "fl_x": 70.5, "fl_y": 65.25, "cx": 31.0, "cy": 25.5, **shared, "frames": frames}


def written(folder, contents):
    contents["frames"] = [
        {key: value for key, value in frame.items() if value is not None} if isinstance(frame, dict) else frame
        for frame in contents["frames"]
    ]
    path = folder / "transforms.json"
    path.write_text(json.dumps({key: value for key, value in contents.items() if value is not None}), encoding="utf-8")
    return path


def placed(index):
    """R and t, OpenCV's axes."""
    matrix = matrix_of(index)
    rotation = (matrix[:3, :3] @ np.diag([1, -1, -1])).T
    return rotation, -rotation @ matrix[:3, 3]


def test_a_transforms_json_is_read_back_in_its_order_and_a_frame_may_have_numbers_of_its_own(tmp_path):
    own = {"fl_x": 33.0, "fl_y": 34.0, "cx": -5.0, "cy": 60.0, "w": 32, "h": 24}
    path = written(tmp_path, transforms({}, own, k1=0.0, p2=0, camera_model="OPENCV"))
    cameras = atra.read_transforms(path)
    assert list(cameras) == ["images/0.png", "images/1.png", "images/2.png"]
    for index, camera in enumerate(cameras.values()):
        intrinsic, size = ((70.5, 65.25, 31.0, 25.5), (64, 48)) if index != 1 else ((33.0, 34.0, -5.0, 60.0), (32, 24))
        assert_same_view(camera, intrinsic, *placed(index), size)


def test_a_field_of_view_alone_means_square_pixels_about_the_middle_and_the_size_may_be_given(tmp_path):
    angle = 0.9
    alone = dict.fromkeys(("w", "h", "fl_x", "fl_y", "cx", "cy"))
    camera, *_ = atra.read_transforms(written(tmp_path, transforms(**alone, camera_angle_x=angle)), (64, 48)).values()
    focal = 32 / np.tan(angle / 2)
    np.testing.assert_allclose(camera.axes, placed(0)[0], atol=1e-12)
    assert camera.plane == atra.ImagePlane(1 / focal, 1 / focal, 32.0, 24.0)
    assert camera.fov_y_degrees == pytest.approx(np.degrees(2 * np.arctan(24 / focal)))
    both = transforms(**alone | {"w": 64, "h": 48}, camera_angle_x=angle, camera_angle_y=0.5)
    camera, *_ = atra.read_transforms(written(tmp_path, both)).values()
    assert camera.fov_y_degrees == pytest.approx(np.degrees(0.5))


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
    (transforms({"file_path": None}), r"frame 0: it has no file_path"),
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
    reasons = {
        "images/0.png": "k1 is 'x'",
        "frame 2": "it has no file_path",
        "frame 3 ('images/1.png')": "it has no transform_matrix",
        "frame 4": "it has no file_path",
        "cut.png": "it has no transform_matrix",
        "frame 6 ('cut.png')": "it has no transform_matrix",
        "huge.png": "fl_x is 1000",
    }
    assert list(broken) == list(reasons)
    assert all(reason in str(broken[name]) for name, reason in reasons.items())
    with pytest.raises(
        atra.InputError, match=r"has no frame that can be used, expected at least one; .*frame 0.*k1 is"
    ):
        atra.read_transforms(written(tmp_path, transforms(k1="x")), broken={})


def test_a_file_that_is_not_there_or_no_transforms_json_is_refused(tmp_path):
    path = tmp_path / "transforms.json"
    with pytest.raises(atra.InputError, match=r"transforms\.json cannot be read: No such file"):
        atra.read_transforms(path)
    for text, message in (
        ("{", "is no JSON"),
        ("[]", "holds a list, expected an object with frames"),
        ("{}", "has no list of frames"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(atra.InputError, match=message):
            atra.read_transforms(path)


def test_the_camera_of_a_trimesh_scene_sees_along_trimesh_s_own_rays():
    scene = trimesh.Scene(trimesh.creation.box())
    scene.camera = trimesh.scene.Camera("above", resolution=(64, 48), fov=(50, 40))
    scene.camera_transform = matrix_of(1)
    ((name, camera),) = atra.cameras_from_trimesh(scene).items()
    assert name == "above"
    origins, directions, pixels = scene.camera_rays()
    np.testing.assert_allclose(origins, np.broadcast_to(camera.eye, origins.shape), atol=1e-12)
    ours = camera.directions(pixels[:, 0], camera.height - 1 - pixels[:, 1]) @ camera.axes
    ours /= np.linalg.norm(ours, axis=1, keepdims=True)
    np.testing.assert_allclose(ours, directions, atol=1e-12)


def test_a_scene_without_a_camera_and_what_is_no_scene_are_refused():
    with pytest.raises(atra.InputError, match="the scene has no camera"):
        atra.cameras_from_trimesh(trimesh.Scene(trimesh.creation.box()))
    with pytest.raises(atra.InputError, match=r"expected a trimesh\.Scene"):
        atra.cameras_from_trimesh("scene.glb")
