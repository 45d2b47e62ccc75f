"""The camera models of COLMAP and of programs that follow it: their parameters, and the lenses they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from atra.errors import InputError
from atra.files.cameras.entries import number, pixels
from atra.geometry.calibration import image_plane_of_focals
from atra.geometry.image_plane import ImagePlane
from atra.geometry.lenses.models import EquirectangularLens, FisheyeLens, FovLens, Lens, OpenCVLens


class CameraModel(NamedTuple):
    """A camera model. lens: makes its lens, None for a model that is not known here. parameters: their names in order,
    of which f, fx, fy, cx, cy, w and h are the sensor's."""

    lens: Callable[..., Lens] | None
    parameters: str

    @property
    def coefficients(self) -> list[str]:
        """Names of the lens's parameters."""
        return [name for name in self.parameters.split() if name not in ("f", "fx", "fy", "cx", "cy", "w", "h")]


PANORAMA = "EQUIRECTANGULAR"
"""Camera model of a panorama."""

CAMERA_MODELS: Mapping[str, CameraModel] = {
    "SIMPLE_PINHOLE": CameraModel(OpenCVLens, "f cx cy"),
    "PINHOLE": CameraModel(OpenCVLens, "fx fy cx cy"),
    "SIMPLE_RADIAL": CameraModel(OpenCVLens, "f cx cy k1"),
    "RADIAL": CameraModel(OpenCVLens, "f cx cy k1 k2"),
    "OPENCV": CameraModel(OpenCVLens, "fx fy cx cy k1 k2 p1 p2"),
    "OPENCV_FISHEYE": CameraModel(FisheyeLens, "fx fy cx cy k1 k2 k3 k4"),
    "FULL_OPENCV": CameraModel(OpenCVLens, "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"),
    "FOV": CameraModel(FovLens, "fx fy cx cy omega"),
    "SIMPLE_RADIAL_FISHEYE": CameraModel(FisheyeLens, "f cx cy k1"),
    "RADIAL_FISHEYE": CameraModel(FisheyeLens, "f cx cy k1 k2"),
    "THIN_PRISM_FISHEYE": CameraModel(FisheyeLens, "fx fy cx cy k1 k2 p1 p2 k3 k4 s1 s3"),
    "RAD_TAN_THIN_PRISM_FISHEYE": CameraModel(None, "fx fy cx cy k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3"),
    "SIMPLE_DIVISION": CameraModel(None, "f cx cy k"),
    "DIVISION": CameraModel(None, "fx fy cx cy k"),
    "SIMPLE_FISHEYE": CameraModel(FisheyeLens, "f cx cy"),
    "FISHEYE": CameraModel(FisheyeLens, "fx fy cx cy"),
    "EUCM": CameraModel(None, "fx fy cx cy alpha beta"),
    PANORAMA: CameraModel(EquirectangularLens, "w h"),
}
"""Camera models by COLMAP's names; binary files give the place in this list. Source: COLMAP's `models.h`."""


def model_of(name: Any) -> CameraModel:
    """Raises InputError for a name that is unknown here, with those that are known."""
    if not isinstance(name, str) or name not in CAMERA_MODELS or CAMERA_MODELS[name].lens is None:
        known = ", ".join(name for name, model in CAMERA_MODELS.items() if model.lens is not None)
        raise InputError(f"its model is {name!s:.100}, expected one of {known}")
    return CAMERA_MODELS[name]


def sensor_of(name: Any, parameters: Sequence[Any]) -> tuple[Lens, ImagePlane]:
    """Lens and sensor of a model's parameters. Raises InputError, naming it, for whatever is wrong with them."""
    model = model_of(name)
    names = model.parameters.split()
    if len(parameters) != len(names):
        raise InputError(f"it has {len(parameters)} parameters, expected {len(names)}: {', '.join(names)}")
    check = pixels if name == PANORAMA else number
    given = {name: check(name, value) for name, value in zip(names, parameters, strict=True)}
    assert model.lens is not None
    lens = model.lens(**{name: given[name] for name in model.coefficients})
    if name == PANORAMA:
        return lens, ImagePlane.panoramic(given["w"], given["h"])
    f = given.get("f", 0.0)
    return lens, image_plane_of_focals(given.get("fx", f), given.get("fy", f), given["cx"], given["cy"])
