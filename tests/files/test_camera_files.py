"""COLMAP models made here and read back, and cameras of trimesh; what is missing or broken in them is named."""

import re
from struct import pack

import numpy as np
import pytest
import trimesh

import atra
from tests.files.camera_samples import (
    FOCALS,
    NOWHERE,
    RAYS,
    SENSORS,
    UNTURNED,
    WRITERS,
    assert_same_view,
    poses,
    read_one,
    rotation_of,
    write_binary,
    write_text,
)
from tests.images import assert_equal_images
from tests.judge.reference import brute_force
from tests.meshes import cornell_box

both_forms = pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
UNKNOWN = {"EUCM": 6, "DIVISION": 5, "SIMPLE_DIVISION": 4, "RAD_TAN_THIN_PRISM_FISHEYE": 16}
"""COLMAP's models without a lens here, and how many parameters they have."""


@both_forms
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


@both_forms
@pytest.mark.parametrize(("sensor", "images", "message"), [
    (("EUCM", 64, 48, (70.0,) * 6), None, "cameras, camera 1: its model is EUCM, expected one of SIMPLE_PINHOLE, PIN"),
    (("OPENCV", 64, 48, (70.0, 70.0, 32.0, 24.0, 0.1, np.inf, 0.0, 0.0)), None, "cameras, camera 1: k2 is inf, expect"),
    (("FOV", 64, 48, (70.0, 70.0, 32.0, 24.0, 4.0)), None, "cameras, camera 1: omega of the lens is 4, expected rad"),
    (("PINHOLE", 64, 48, (0.0, 65.0, 31.0, 25.0)), None, r"cameras, camera 1: the focal length fx is 0\.0"),
    (("PINHOLE", 0, 48, SENSORS[1][3]), None, "cameras, camera 1: its width is 0, expected a whole number"),
    (None, [(5, UNTURNED, NOWHERE, 2, "a")], r"images, image 5 \('a'\): its camera is 2, which is not in cameras"),
    (None, [(5, (2.0, 0.0, 0.0, 0.0), NOWHERE, 1, "a")], r"image 5 \('a'\): its rotation .* has length 2, expected"),
    (None, [(5, (1.0, 0.0, 0.0, np.inf), NOWHERE, 1, "a")], r"image 5 \('a'\): a part of its rotation is inf"),
    (None, [(5, UNTURNED, (0.0, np.nan, 0.0), 1, "a")], r"images, image 5 \('a'\): a translation is nan"),
    (None, [(i, UNTURNED, NOWHERE, 1, "a") for i in (5, 6)], r"images, image 6 \('a'\): the name 'a' is there twice"),
    (None, [], "images has no image, expected at least one"),
])  # fmt: skip
def test_a_broken_camera_or_image_of_a_colmap_model_is_named(write, sensor, images, message, tmp_path):
    write(tmp_path, SENSORS if sensor is None else SENSORS | {1: sensor}, images)
    with pytest.raises(atra.InputError) as refused:
        atra.read_colmap(tmp_path)
    assert re.search(message, re.sub(r"\.(txt|bin)", "", str(refused.value)))


@pytest.mark.parametrize(("name", "text", "message"), [
    ("cameras.txt", "1 PINHOLE 64\n", r"cameras\.txt, line 1 has 3 words, expected CAMERA_ID MODEL"),
    ("cameras.txt", "7 PINHOLE 64 48 70 70 x 24\n", r"cameras\.txt, camera 7: cx is 'x', expected a finite number"),
    ("cameras.txt", "7 PINHOLE 6x 48 70 70 3 24\n", r"cameras\.txt, camera 7: its width is '6x', expected a finite"),
    ("cameras.txt", "1.5 PINHOLE 64 48 70 70 3 24\n", r"line 1 starts with '1\.5', expected a whole number"),
    ("cameras.txt", "7 PINHOLE 64 48 70 70 3\n", "camera 7: it has 3 parameters, expected 4: fx, fy, cx, cy"),
    ("cameras.txt", "7 PINHOLE 64 48 1 1 3 4\n" * 2, "camera 7 is there twice"),
    ("images.txt", "5 1 0 0 0 0 0 0 1\n", r"images\.txt, line 1 has 9 words, .* two lines"),
    ("images.txt", "5 1 0 0 0 0 0 0 1 a.png\n6 1 0 0 0 0 0 0 1 b.png\n",
     r"images\.txt, line 2 has 10 words, expected X Y POINT3D_ID .* two lines"),
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
    ("cameras.bin", 50, "ends in camera 1"), ("cameras.bin", 70, "ends in camera entry 1"),
    ("images.bin", 30, "ends in image entry 0"), ("images.bin", 75, "ends in image 5"),
    ("images.bin", -3, "ends in image 7"),
])  # fmt: skip
def test_a_cut_binary_model_is_refused_saying_where_it_ends(name, kept, message, tmp_path):
    write_binary(tmp_path)
    path = tmp_path / name
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(atra.InputError, match=message):
        atra.read_colmap(tmp_path)


def test_an_unknown_model_number_and_a_folder_without_a_model_are_refused(tmp_path):
    with pytest.raises(atra.InputError, match=r"is no COLMAP model, expected cameras\.bin and images\.bin"):
        atra.read_colmap(tmp_path)
    write_binary(tmp_path)
    (tmp_path / "cameras.bin").write_bytes(pack("<QIiQQ", 1, 4, 99, 64, 48))
    with pytest.raises(atra.InputError, match=r"camera 4: its model is number 99, expected 0 to 17"):
        atra.read_colmap(tmp_path)


@both_forms
def test_broken_images_of_a_colmap_model_are_left_out_by_name_if_asked(write, tmp_path):
    good = [(i, UNTURNED, NOWHERE, 1, f"{i}.png") for i in range(18)]
    turned = (20, (1.0, 1.0, 0.0, 0.0), NOWHERE, 1, "turned.png")
    unknown = {30 + k: (model, 64, 48, (1.0,) * count) for k, (model, count) in enumerate(UNKNOWN.items())}
    bent = [(number, UNTURNED, NOWHERE, number, f"{sensor[0]}.png") for number, sensor in unknown.items()]
    write(tmp_path, SENSORS | unknown, [*good[:3], turned, *good[3:], *bent, good[0]])
    broken = {}
    assert list(atra.read_colmap(tmp_path, broken=broken)) == [name for *_, name in good]
    expected = {"turned.png": "unit quaternion", **{f"{model}.png": f"its model is {model}, ex" for model in UNKNOWN}}
    expected["image 0 ('0.png')"] = "twice"
    assert list(broken) == list(expected)
    for error, message in zip(broken.values(), expected.values(), strict=True):
        assert re.search(rf"images\.\w+, image \d+ .*{message}", str(error))
    write(tmp_path, SENSORS | unknown, bent[:1])
    with pytest.raises(atra.InputError, match=r"has no image that can be used, expected .*'EUCM\.png'.*model is EUCM"):
        atra.read_colmap(tmp_path, broken={})
    write(tmp_path, SENSORS | unknown, good[:1])  # sensors that no image uses do no harm
    assert list(atra.read_colmap(tmp_path)) == ["0.png"]


X, Y = RAYS[:, 0], RAYS[:, 1]
RADIUS, ANGLE = np.hypot(X, Y), np.arctan(np.hypot(X, Y))


def by_opencv(*coefficients):
    cv2 = pytest.importorskip("cv2", reason="OpenCV, a test dependency, projects as COLMAP's models do")
    return cv2.projectPoints(RAYS, np.zeros(3), np.zeros(3), np.eye(3), np.array(coefficients))[0][:, 0]


def fisheye(*coefficients):
    """The angle from the axis times a polynomial of its square."""
    factor = ANGLE * (1 + sum(k * ANGLE ** (2 * n) for n, k in enumerate(coefficients, 1))) / RADIUS
    return np.stack([X, Y], axis=1) * factor[:, None]


def thin_prism(k1, k2, p1, p2, k3, k4, s1, s3):
    u, v = X * ANGLE / RADIUS, Y * ANGLE / RADIUS
    q = u * u + v * v
    radial = 1 + k1 * q + k2 * q**2 + k3 * q**3 + k4 * q**4
    return np.stack([
        u * radial + 2 * p1 * u * v + p2 * (q + 2 * u * u) + s1 * q,
        v * radial + 2 * p2 * u * v + p1 * (q + 2 * v * v) + s3 * q,
    ], axis=1)  # fmt: skip


LENSES = {
    "SIMPLE_RADIAL": ((-0.2,), lambda k: by_opencv(k, 0, 0, 0)),
    "RADIAL": ((-0.2, 0.1), lambda *ks: by_opencv(*ks, 0, 0)),
    "OPENCV": ((-0.2, 0.1, 0.01, -0.02), by_opencv),
    "FULL_OPENCV": ((-0.2, 0.1, 0.01, -0.02, 0.02, 0.3, 0.1, 0.02), by_opencv),
    "FOV": ((0.9,), lambda w: RAYS[:, :2] * (np.arctan(2 * RADIUS * np.tan(w / 2)) / w / RADIUS)[:, None]),
    "SIMPLE_FISHEYE": ((), fisheye), "FISHEYE": ((), fisheye), "SIMPLE_RADIAL_FISHEYE": ((0.1,), fisheye),
    "RADIAL_FISHEYE": ((0.1, -0.05), fisheye), "OPENCV_FISHEYE": ((0.1, -0.05, 0.02, 0.01), fisheye),
    "THIN_PRISM_FISHEYE": ((0.1, -0.05, 0.01, 0.02, 0.02, 0.01, 0.03, -0.02), thin_prism),
}  # fmt: skip
"""Coefficients of COLMAP's models, and where they put points of the plane z = 1."""


@both_forms
@pytest.mark.parametrize("model", LENSES)
def test_a_colmap_camera_sees_points_where_its_model_says(model, write, tmp_path):
    coefficients, expected = LENSES[model]
    has_one_focal = model.startswith("SIMPLE") or model.startswith("RADIAL")
    fx, fy, cx, cy = FOCALS[:1] + FOCALS[:1] + FOCALS[2:] if has_one_focal else FOCALS
    sensor = (fx, cx, cy) if has_one_focal else FOCALS
    seen = read_one(tmp_path, write, model, (*sensor, *coefficients)).project(RAYS)
    np.testing.assert_allclose(seen, expected(*coefficients) * [fx, fy] + [cx, cy], rtol=0, atol=1e-9)


@both_forms
def test_a_panorama_of_colmap_sees_points_where_pycolmap_does(write, tmp_path):
    """By pycolmap 4.2.1, `Camera.img_from_cam`."""
    camera = read_one(tmp_path, write, "EQUIRECTANGULAR", (800, 400), 800, 400)
    expected = [(437.10943163, 175.90111096), (574.86681672, 258.04059293)]
    np.testing.assert_allclose(camera.project([(0.3, -0.2, 1.0), (1.0, 0.5, 0.2)]), expected, atol=1e-5)


@pytest.mark.parametrize("model", ["OPENCV", "OPENCV_FISHEYE"])
def test_a_colmap_model_with_distortion_is_rendered_with_the_labels_of_the_reference(model, tmp_path):
    turn, parameters = (np.cos(0.1), 0.0, np.sin(0.1), 0.0), (40.0, 42.0, 33.0, 23.0, -0.1, 0.05, 0.001, 0.002)
    camera = read_one(tmp_path, write_binary, model, parameters, turn=turn, place=(0.1, -0.7, 0.9))
    mesh = cornell_box()
    with atra.PixelTracer(mesh, camera, threads=1) as tracer:
        hits = tracer.trace()
    assert hits.hit.mean() > 0.3
    assert_equal_images(mesh, camera, hits, brute_force(mesh, camera))


def test_the_camera_of_a_trimesh_scene_sees_along_trimesh_s_own_rays():
    scene = trimesh.Scene(trimesh.creation.box())
    with pytest.raises(atra.InputError, match="the scene has no camera"):
        atra.cameras_from_trimesh(scene)
    with pytest.raises(atra.InputError, match=r"expected a trimesh\.Scene"):
        atra.cameras_from_trimesh("scene.glb")
    scene.camera = trimesh.scene.Camera("above", resolution=(64, 48), fov=(50, 40))
    _, turn, place, *_ = poses()[1]
    scene.camera_transform = np.block([[rotation_of(turn), place[:, None]], [np.eye(4)[3:]]])
    ((name, camera),) = atra.cameras_from_trimesh(scene).items()
    assert name == "above"
    origins, directions, pixels = scene.camera_rays()
    np.testing.assert_allclose(origins, np.broadcast_to(camera.eye, origins.shape), atol=1e-12)
    ours = camera.rays(pixels[:, 0], camera.height - 1 - pixels[:, 1])[1] @ camera.axes
    ours /= np.linalg.norm(ours, axis=1, keepdims=True)
    np.testing.assert_allclose(ours, directions, atol=1e-12)
