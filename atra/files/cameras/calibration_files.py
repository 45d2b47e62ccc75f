"""The camera of a calibration file: OpenCV's YAML, XML or JSON, ROS's camera_info, Kalibr's and Open3D's."""

from __future__ import annotations

import re
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from numpy.typing import ArrayLike

from atra.errors import InputError
from atra.files.cameras.entries import Cameras, entry, numbers, pixels, read_file
from atra.files.reading import parse_json
from atra.geometry.camera import Camera

_NAMES = {
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
    "K": ("camera_matrix", "cameraMatrix", "K", "k"),
    "D": ("distortion_coefficients", "distCoeffs", "dist_coeffs", "D", "d"),
    "model": ("distortion_model",),
}
"""Names of a value in files of OpenCV, of ROS's camera_calibration, and in ROS's messages."""

_MODELS = {
    "plumb_bob": "pinhole", "rational_polynomial": "pinhole", "radtan": "pinhole", "none": "pinhole",
    "equidistant": "fisheye", "fisheye": "fisheye",
}  # fmt: skip
"""Distortion models of ROS and Kalibr, as `Camera.from_opencv` calls them."""

_MOST_BYTES = 1 << 20
"""Upper limit of a calibration file, which has a few hundred bytes."""


def read_calibration(
    path: str | PathLike[str],
    size: tuple[int, int] | None = None,
    *,
    R: ArrayLike = ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    t: ArrayLike = (0, 0, 0),
    model: str | None = None,
) -> Cameras:
    """Read the camera of a calibration file, by the file's name without suffix.

    The file is OpenCV's (YAML, XML or JSON), ROS's `camera_info`, Kalibr's `camchain` of one camera, or Open3D's
    intrinsics. YAML needs the package PyYAML. Such files have no pose.

    Parameters
    ----------
    path : path
    size : (int, int), optional
        Width and height of the image, pixels, where the file has none.
    R, t : (3, 3) and (3,) array_like of float, optional
        World to camera, as for `Camera.from_opencv`; by default at the origin along +Z.
    model : {"pinhole", "fisheye"}, optional
        None: what the file's distortion_model says, else pinhole.

    Returns
    -------
    dict of one CalibratedCamera or LensCamera

    Raises
    ------
    InputError
        Naming file and value, for missing or broken values, unknown distortion models, and a YAML file where the
        package PyYAML is missing.

    Examples
    --------
    >>> import atra
    >>> camera, = atra.read_calibration("camera.yaml").values()  # doctest: +SKIP
    """
    path = Path(path)
    content = read_file(path)
    with entry(str(path)):
        if len(content) > _MOST_BYTES:
            raise InputError(f"it has {len(content):,} bytes, expected a calibration of at most {_MOST_BYTES:,}")
        found = _as_opencv(_parsed(path, content))
        told = {**dict(zip(("width", "height"), size or (), strict=False)), "D": [], "model": "none"}
        given: dict[str, Any] = {
            name: next((found[one] for one in names if found.get(one) is not None), told.get(name))
            for name, names in _NAMES.items()
        }
        if given["K"] is None:
            raise InputError(f"it has no camera_matrix, expected one of {', '.join(_NAMES['K'])}")
        if given["width"] is None or given["height"] is None:
            raise InputError("the size of the image is missing, expected image_width and image_height; or give a size")
        if model is None:
            name = given["model"]
            if not (isinstance(name, str) and name in _MODELS):
                raise InputError(f"its distortion_model is {name!r:.100}, expected one of {', '.join(_MODELS)}")
            model = _MODELS[name]
        K, D = numbers("camera_matrix", given["K"], 9), numbers("distortion_coefficients", given["D"])
        size = pixels("width", given["width"]), pixels("height", given["height"])
        # ROS writes no coefficients for a camera without distortion.
        return {path.stem: Camera.from_opencv(K.reshape(3, 3), R, t, *size, D if D.size else None, model)}


def _as_opencv(found: Any) -> dict[str, Any]:
    """What Kalibr or Open3D wrote, by OpenCV's names; another object is returned as it is."""
    if not isinstance(found, dict):
        raise InputError(f"it holds a {type(found).__name__}, expected a calibration with camera_matrix")
    kind = found.get("class_name")
    if isinstance(kind, str) and kind.startswith("PinholeCamera") and kind != "PinholeCameraIntrinsic":
        raise InputError(f"it is Open3D's {kind}, which has poses; a trajectory is read by read_transforms")
    if "intrinsic_matrix" in found:  # Open3D's numbers stand column by column
        matrix = numbers("intrinsic_matrix", found["intrinsic_matrix"], 9)
        return {**found, "camera_matrix": matrix.reshape(3, 3).T.tolist()}
    cameras = [name for name, one in found.items() if isinstance(one, dict) and "intrinsics" in one]
    if not cameras:
        return found
    if len(cameras) > 1:
        raise InputError(f"it is Kalibr's calibration of {', '.join(map(str, cameras)):.100}; keep one in a file")
    given = found[cameras[0]]
    if given.get("camera_model") != "pinhole":
        raise InputError(f"its camera_model is {given.get('camera_model')!r:.100}, expected pinhole")
    fx, fy, cx, cy = numbers("intrinsics", given["intrinsics"], 4).tolist()
    width, height = numbers("resolution", given.get("resolution"), 2).tolist()
    return {
        "width": width, "height": height, "K": [fx, 0, cx, 0, fy, cy, 0, 0, 1], "D": given.get("distortion_coeffs"),
        "distortion_model": given.get("distortion_model"),
    }  # fmt: skip


def _parsed(path: Path, content: bytes) -> Any:
    if path.suffix.lower() == ".json":
        return parse_json(content)
    if path.suffix.lower() == ".xml" or content.lstrip()[:5] == b"<?xml":
        return _parsed_xml(content)
    try:
        yaml = import_module("yaml")
    except ImportError:
        raise InputError("YAML files need the package PyYAML, which is not installed: pip install pyyaml") from None
    try:
        text = content.decode("utf-8").replace("!!opencv-matrix", "")
        first, _, rest = text.partition("\n")  # OpenCV writes "%YAML:1.0", which is no YAML
        return yaml.safe_load(rest if first.startswith("%YAML") else text)
    except (ValueError, RecursionError, yaml.YAMLError) as error:  # ValueError: a number of thousands of digits, too
        raise InputError(f"it is no YAML: {' '.join(str(error).split())}") from None


def _parsed_xml(content: bytes) -> dict[str, Any]:
    """The values of OpenCV's XML, by name; numbers where all words are."""
    if b"<!" in re.sub(rb"<!--.*?-->", b"", content, flags=re.DOTALL):
        raise InputError("its XML declares entities, which are not read")
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise InputError(f"it is no XML: {error}") from None
    found: dict[str, Any] = {}
    for one in root:
        data = one.find("data")
        text = ((one if data is None else data).text or "").strip()
        try:
            values = [float(word) for word in text.split()]
            found[one.tag] = values[0] if data is None and len(values) == 1 else values
        except ValueError:
            found[one.tag] = text
    return found
