"""The camera of a calibration file: OpenCV's YAML or JSON, and ROS's camera_info."""

from __future__ import annotations

from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from atra.errors import InputError
from atra.files.cameras.entries import entry, number, pixels, read_file
from atra.files.reading import parse_json
from atra.geometry.camera import CalibratedCamera, Camera, LensCamera

_NAMES = {
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
    "K": ("camera_matrix", "cameraMatrix", "K", "k"),
    "D": ("distortion_coefficients", "distCoeffs", "dist_coeffs", "D", "d"),
    "model": ("distortion_model",),
}
"""Names of a value in files of OpenCV, of ROS's camera_calibration, and in ROS's messages."""

_MODELS = {"plumb_bob": "pinhole", "rational_polynomial": "pinhole", "equidistant": "fisheye", "fisheye": "fisheye"}
"""Distortion models of ROS, as `Camera.from_opencv` calls them."""

_MOST_BYTES = 1 << 20
"""Upper limit of a calibration file, which has a few hundred bytes."""


def read_calibration(
    path: str | PathLike[str],
    size: tuple[int, int] | None = None,
    *,
    R: ArrayLike = ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    t: ArrayLike = (0, 0, 0),
    model: str | None = None,
) -> CalibratedCamera | LensCamera:
    """Read the camera of a calibration file: OpenCV's (YAML or JSON) or ROS's `camera_info`.

    Such files have no pose. R, t: world to camera, as for `Camera.from_opencv`; by default at the origin along +Z.
    size: width and height of the image where the file has none. model: "pinhole" or "fisheye"; None: what the file's
    distortion_model says, else pinhole.
    Raises InputError, naming file and value, for missing or broken values, unknown distortion models, and a YAML file
    where the package PyYAML is missing.
    """
    path = Path(path)
    content = read_file(path)
    with entry(str(path)):
        if len(content) > _MOST_BYTES:
            raise InputError(f"it has {len(content):,} bytes, expected a calibration of at most {_MOST_BYTES:,}")
        return camera_of_calibration(_parsed(path, content), size, R, t, model)


def camera_of_calibration(
    found: Any, size: tuple[int, int] | None, R: ArrayLike, t: ArrayLike, model: str | None = None
) -> CalibratedCamera | LensCamera:
    """As `read_calibration`, from what is parsed."""
    if not isinstance(found, dict):
        raise InputError(f"it holds a {type(found).__name__}, expected a calibration with camera_matrix")
    given = {name: next((found[one] for one in names if one in found), None) for name, names in _NAMES.items()}
    if given["K"] is None:
        raise InputError(f"it has no camera_matrix, expected one of {', '.join(_NAMES['K'])}")
    if size is None and (given["width"] is None or given["height"] is None):
        raise InputError("the size of the image is missing, expected image_width and image_height; or give a size")
    width, height = (
        pixels(name, given[name] if given[name] is not None else default)
        for name, default in zip(("width", "height"), size or (None, None), strict=True)
    )
    if model is None:
        told = given["model"]
        if told is not None and not (isinstance(told, str) and told in _MODELS):
            raise InputError(f"its distortion_model is {told!r:.100}, expected one of {', '.join(_MODELS)}")
        model = "pinhole" if told is None else _MODELS[told]
    K = _values("camera_matrix", given["K"])
    if K.size != 9:
        raise InputError(f"camera_matrix has {K.size} numbers, expected 9")
    distortion = None if given["D"] is None else _values("distortion_coefficients", given["D"])
    return Camera.from_opencv(K.reshape(3, 3), R, t, width, height, _without_end(distortion), model)


def _values(name: str, given: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The numbers of a list, of rows, or of a matrix with its data."""
    data = given.get("data") if isinstance(given, dict) else given
    rows = data if isinstance(data, list) else [data]
    flat = [value for row in rows for value in (row if isinstance(row, list) else [row])]
    return np.array([number(f"a number of {name}", value) for value in flat], np.float64)


def _without_end(distortion: np.ndarray[Any, np.dtype[np.float64]] | None) -> Any:
    """No coefficients where there is none, which is how ROS writes a camera without distortion."""
    return None if distortion is None or distortion.size == 0 else distortion


def _parsed(path: Path, content: bytes) -> Any:
    if path.suffix.lower() == ".json":
        return parse_json(content)
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
