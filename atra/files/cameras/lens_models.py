"""The camera models of COLMAP and of programs that follow it: their parameters, and the lenses they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import pi
from typing import Any, NamedTuple

from atra.errors import InputError
from atra.files.cameras.entries import number, pixels
from atra.geometry.calibration import image_plane_of_focals
from atra.geometry.image_plane import ImagePlane
from atra.geometry.lenses.models import EquirectangularLens, FisheyeLens, FovLens, Lens, OpenCVLens


class CameraModel(NamedTuple):
    """A camera model. lens: makes its lens. coefficients: their names, in the order of the model's parameters; focals:
    "f" or "fx fy"."""

    lens: Callable[..., Lens]
    focals: str
    coefficients: str

    @property
    def parameters(self) -> list[str]:
        """Names of all parameters, in order."""
        return [*self.focals.split(), "cx", "cy", *self.coefficients.split()]


PANORAMA = "EQUIRECTANGULAR"
"""Camera model of a panorama."""

CAMERA_MODELS: Mapping[str, CameraModel] = {
    "SIMPLE_PINHOLE": CameraModel(OpenCVLens, "f", ""),
    "PINHOLE": CameraModel(OpenCVLens, "fx fy", ""),
    "SIMPLE_RADIAL": CameraModel(OpenCVLens, "f", "k1"),
    "RADIAL": CameraModel(OpenCVLens, "f", "k1 k2"),
    "OPENCV": CameraModel(OpenCVLens, "fx fy", "k1 k2 p1 p2"),
    "FULL_OPENCV": CameraModel(OpenCVLens, "fx fy", "k1 k2 p1 p2 k3 k4 k5 k6"),
    "FOV": CameraModel(FovLens, "fx fy", "omega"),
    "SIMPLE_RADIAL_FISHEYE": CameraModel(FisheyeLens, "f", "k1"),
    "SIMPLE_FISHEYE": CameraModel(FisheyeLens, "f", ""),
    "FISHEYE": CameraModel(FisheyeLens, "fx fy", ""),
    "RADIAL_FISHEYE": CameraModel(FisheyeLens, "f", "k1 k2"),
    "OPENCV_FISHEYE": CameraModel(FisheyeLens, "fx fy", "k1 k2 k3 k4"),
    "THIN_PRISM_FISHEYE": CameraModel(FisheyeLens, "fx fy", "k1 k2 p1 p2 k3 k4 s1 s3"),
}
"""Camera models by COLMAP's names. Source: COLMAP's `models.h`."""


def model_of(name: Any) -> CameraModel:
    """Raises InputError for a name that is unknown here, with those that are known."""
    if not isinstance(name, str) or name not in CAMERA_MODELS:
        raise InputError(f"its model is {name!s:.100}, expected one of {', '.join(CAMERA_MODELS)}, {PANORAMA}")
    return CAMERA_MODELS[name]


def panorama_plane(width: float, height: float) -> ImagePlane:
    """The sensor of a panorama of so many pixels."""
    return ImagePlane(2 * pi / width, pi / height, width / 2, height / 2)


def sensor_of(name: Any, parameters: Sequence[Any]) -> tuple[ImagePlane, Lens]:
    """Sensor and lens of a model's parameters. Raises InputError, naming it, for whatever is wrong with them."""
    if name == PANORAMA:
        if len(parameters) != 2:
            raise InputError(f"it has {len(parameters)} parameters, expected 2: width, height")
        width, height = (pixels(f"its {what}", value) for what, value in zip(("w", "h"), parameters, strict=True))
        return panorama_plane(width, height), EquirectangularLens()
    model = model_of(name)
    names = model.parameters
    if len(parameters) != len(names):
        raise InputError(f"it has {len(parameters)} parameters, expected {len(names)}: {', '.join(names)}")
    given = {name: number(name, value) for name, value in zip(names, parameters, strict=True)}
    fx, fy = given.get("fx", given.get("f", 0.0)), given.get("fy", given.get("f", 0.0))
    plane = image_plane_of_focals(fx, fy, given["cx"], given["cy"])
    return plane, model.lens(**{name: given[name] for name in model.coefficients.split()})
