"""Files of cameras made here: COLMAP models in both forms, and the numbers that other programs give their cameras."""

from struct import pack

import numpy as np

import atra
from atra.files.cameras.lens_models import CAMERA_MODELS

SENSORS = {1: ("PINHOLE", 64, 48, (70.5, 65.25, 31.0, 25.5)), 7: ("SIMPLE_PINHOLE", 32, 24, (40.0, 15.5, 12.25))}
UNTURNED, NOWHERE = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


def rotation_of(quaternion):
    """By two products of quaternions for each axis, another way than the reader's."""
    w, x, y, z = quaternion
    vector = np.array([x, y, z])
    return np.stack([v + 2 * w * np.cross(vector, v) + 2 * np.cross(vector, np.cross(vector, v)) for v in np.eye(3)]).T


def poses():
    """Number, quaternion, translation, sensor and name of three images."""
    random = np.random.default_rng(8)
    turns = random.normal(size=(3, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    places = random.normal(size=(3, 3)) * 4
    names = ("rooms/a b.jpg", "0002.png", "ünder.png")
    return list(zip((5, 6, 7), turns, places, (7, 1, 7), names, strict=True))


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


def read_one(folder, write, model, parameters, width=64, height=48, turn=UNTURNED, place=NOWHERE):
    """The camera of a COLMAP model with one image."""
    write(folder, {1: (model, width, height, parameters)}, [(1, turn, place, 1, "a.png")])
    return atra.read_colmap(folder)["a.png"]


def assert_same_view(camera, intrinsic, rotation, translation, size):
    """camera sees what K, R and t say; the principal point in `intrinsic` counts from the image's corner."""
    fx, fy, cx, cy = intrinsic
    assert (camera.width, camera.height) == size
    assert camera.plane == atra.ImagePlane(1 / fx, 1 / fy, cx, cy)
    np.testing.assert_allclose(camera.axes, rotation, atol=1e-12)
    np.testing.assert_allclose(camera.axes @ camera.eye, -np.asarray(translation), atol=1e-12)


RAYS = np.array([(0.1, 0.2, 1.0), (-0.4, 0.3, 1.0), (0.5, -0.45, 1.0)])
K = [70, 0, 30.5, 0, 65, 25, 0, 0, 1]
FOCALS = (70.0, 65.0, 31.0, 25.5)
"""The same sensor of 64 x 48 pixels, in OpenCV's pixels and from the image's corner."""
