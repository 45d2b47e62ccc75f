"""Pinhole cameras, and cameras with a lens."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import atan, degrees, pi, radians, tan
from typing import ClassVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.calibration import image_plane_of, pose_of, pose_of_matrix, target_of
from atra.geometry.framing import framing_distance
from atra.geometry.image_plane import ImagePlane
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.lenses.models import EquirectangularLens, FisheyeLens, Lens, OpenCVLens
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import Vector, as_number, as_vector, checked_vector, unit_vector
from atra.geometry.view import View, check_offset
from atra.whole_numbers import is_whole_number

__all__ = ["CalibratedCamera", "Camera", "Vector", "check_offset"]

FARTHEST_AXIS_PIXELS = 1e6
"""Largest distance of the principal point from the image, beyond which float32 cannot tell rays apart."""


FOV_Y_DEGREES = 60.0
"""Default vertical field of view."""


@dataclass(frozen=True)
class Camera(View):
    """A pinhole camera and its pixel grid.

    Camera space has the eye at the origin, X to the right (forward x up), Y down (down = forward x right) and Z along
    the view axis; the image plane lies at Z = 1. The ray of pixel (x, y) at sub-pixel `offset` (ox, oy) has direction
    ((x + ox - W/2) p, (y + oy - H/2) p, 1) with pixel pitch p = 2 tan(fov_y / 2) / H, so a ray parameter *is* a depth.
    `from_opencv`, `from_matrix` and `crop` return cameras with other image planes.

    eye: where rays start, three finite floats, scene units.
    target: a point on the view axis, three finite floats, scene units.
    up: direction that is up in the image, three finite floats.
    fov_y_degrees: full vertical field of view, between 0 and 180.
    width: columns of the image, pixels, at least 1.
    height: rows of the image, pixels, at least 1.

    Raises InputError for a size below 1, a field of view outside (0, 180), eye = target, or up parallel to the view.
    Source: paper §3.1; the axes are ours (the paper leaves them open).
    """

    eye: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    fov_y_degrees: float = FOV_Y_DEGREES
    width: int = 1024
    height: int = 1024

    is_parallel: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        fov = as_number(self.fov_y_degrees)
        if not 0.0 < fov < 180.0:
            raise InputError(f"fov_y_degrees is {self.fov_y_degrees!r}, expected an angle between 0 and 180 degrees")
        object.__setattr__(self, "fov_y_degrees", fov)

    @overload
    @staticmethod
    def from_opencv(K: ArrayLike, R: ArrayLike, t: ArrayLike, width: int, height: int) -> CalibratedCamera: ...

    @overload
    @staticmethod
    def from_opencv(
        K: ArrayLike,
        R: ArrayLike,
        t: ArrayLike,
        width: int,
        height: int,
        distortion: ArrayLike | None,
        model: str = "pinhole",
    ) -> CalibratedCamera | LensCamera: ...

    @staticmethod
    def from_opencv(
        K: ArrayLike,
        R: ArrayLike,
        t: ArrayLike,
        width: int,
        height: int,
        distortion: ArrayLike | None = None,
        model: str = "pinhole",
    ) -> CalibratedCamera | LensCamera:
        """The camera of an OpenCV calibration x = K (R X + t).

        OpenCV's camera looks along +Z with X right and Y down. Its (0, 0) is the *centre* of the first pixel, here it
        is the corner: a point that `cv2.projectPoints` puts at (u, v) has pixel position (u + 0.5, v + 0.5).

        K: (3, 3), focal lengths fx, fy and principal point cx, cy in pixels; no skew. R: (3, 3), t: three numbers,
        world to camera. width, height: of the image, pixels. distortion: coefficients in OpenCV's order, see
        `OpenCVLens.of` and `FisheyeLens.of`. model: "pinhole" or "fisheye". A pinhole camera whose coefficients are
        all 0 has no lens.
        Raises InputError for a K that is singular or has skew, an R that is no rotation, numbers not finite, another
        number of coefficients and another model.
        """
        placed, sensor = pose_of(R, t), image_plane_of(K)
        kinds: dict[str, type[OpenCVLens] | type[FisheyeLens]] = {"pinhole": OpenCVLens, "fisheye": FisheyeLens}
        if model not in kinds:
            raise InputError(f"model is {model!r}, expected one of {', '.join(kinds)}")
        lens = kinds[model]() if distortion is None else kinds[model].of(distortion)
        return camera_of(lens, *placed, sensor, width, height)

    @staticmethod
    def from_matrix(
        camera_to_world: ArrayLike,
        width: int,
        height: int,
        *,
        axes: str,
        fov_y_degrees: float | None = None,
        K: ArrayLike | None = None,
    ) -> Camera:
        """The camera with a matrix from its space to world space.

        camera_to_world: (4, 4) or (3, 4), a rotation and the eye. axes: of the camera's space, "opengl" for X right, Y
        up, Z backward (OpenGL, Blender, NeRF), "opencv" for X right, Y down, Z forward. Give either fov_y_degrees, or K
        as for `from_opencv`.
        Raises InputError for a matrix with scale, reflection or no rotation, other axes, and neither or both of those.
        """
        eye, rotation = pose_of_matrix(camera_to_world, axes)
        if (fov_y_degrees is None) == (K is None):
            raise InputError("expected either fov_y_degrees or K, neither or both were given")
        if K is not None:
            return CalibratedCamera.at(eye, rotation, image_plane_of(K), width, height)
        return Camera(*_placed(eye, rotation), as_number(fov_y_degrees), width, height)

    @staticmethod
    def framing(
        mesh: Mesh,
        direction: Vector = (-0.5, -0.4, -1.0),
        *,
        up: Vector = (0.0, 1.0, 0.0),
        fov_y_degrees: float = FOV_Y_DEGREES,
        width: int = 1024,
        height: int = 1024,
    ) -> Camera:
        """The camera that looks along `direction` at the whole of a mesh, its box in the middle of the image.

        direction: three finite floats of any length but 0. up, fov_y_degrees, width, height: as for `Camera`.
        Raises InputError as `Camera`, and for a direction of length 0.
        """
        forward = unit_vector("direction", checked_vector("direction", direction))
        centre = np.asarray(mesh.bounds, np.float64).mean(axis=0)
        size = float(np.abs(mesh.bounds - centre).max()) or 1.0
        turned = Camera(as_vector(centre - size * forward), as_vector(centre), up, fov_y_degrees, width, height)
        away = framing_distance(mesh.bounds, turned.axes, fov_y_degrees, width, height)
        return Camera(as_vector(centre - away * forward), turned.target, up, fov_y_degrees, width, height)

    @cached_property
    def plane(self) -> ImagePlane:
        """The image plane at Z = 1."""
        pitch = 2.0 * tan(radians(self.fov_y_degrees) / 2.0) / self.height
        return ImagePlane.centred(pitch, self.width, self.height)

    @cached_property
    def to_pixels(self) -> NDArray[np.float64]:
        """(3, 4) float64: eye-space point (X, Y, Z, 1) -> (a, b, c), pixel position (a / c, b / c) and depth c."""
        right, down, forward = self.axes
        axis_x, axis_y = self.plane.axis_in_image
        rows = np.stack(
            [right / self.plane.pitch_x + axis_x * forward, down / self.plane.pitch_y + axis_y * forward, forward]
        )
        return np.column_stack([rows, np.zeros(3)])

    def crop(self, left: int, top: int, width: int, height: int) -> CalibratedCamera:
        """The camera of a part of the image; its pixel (x, y) has the ray of pixel (left + x, top + y) to the bit.

        Raises InputError for a part that is not inside the image.
        """
        plane = self.plane.cropped((self.width, self.height), (left, top), (width, height))
        return CalibratedCamera(self.eye, self.target, self.up, width, height, plane=plane)

    def rays(
        self, x: NDArray[np.integer], y: NDArray[np.integer], offset: tuple[float, float] = (0.5, 0.5)
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        directions = self.directions(x, y, offset)
        return np.zeros_like(directions), directions

    def directions(
        self, x: NDArray[np.integer], y: NDArray[np.integer], offset: tuple[float, float] = (0.5, 0.5)
    ) -> NDArray[np.float64]:
        """Directions (..., 3) float64, camera space, Z = 1, of pixels (x, y) at sub-pixel `offset`."""
        return self._on_image_plane(x, y, offset, 1.0)


@dataclass(frozen=True)
class LensCamera(LensView):
    """A camera with a lens: its rays pass through no regular grid on a plane.

    `RasterTracer`, `PixelTracer`, and `RayScene` by `rays_world` take it; methods that need a plane refuse
    it. Where the lens model folds over, pixels see nothing: their rays are NaN and they are misses in every image.
    `Camera.from_opencv`, `LensCamera.panorama` and the readers of camera files return it.

    eye, target, up, width, height: as for `Camera`.
    lens: such as `OpenCVLens`. sensor: its grid of pixels; a pitch is 1 / focal length in pixels, or for a panorama
    the angle of a pixel in radians.

    Raises InputError as `Camera`, and for a lens or sensor of another type.
    """

    @classmethod
    def panorama(cls, eye: Vector, target: Vector, up: Vector = (0.0, 1.0, 0.0), width: int = 2048) -> LensCamera:
        """The equirectangular picture of all directions, twice as wide as high; the target is in its middle.

        Raises InputError for a width that is no whole number of at least 1.
        """
        if not is_whole_number(width) or width < 1:
            raise InputError(f"width is {width!r}, expected a whole number of pixels of at least 1")
        height = max(int(width) // 2, 1)
        sensor = ImagePlane(2.0 * pi / width, pi / height, width / 2, height / 2)
        return cls(eye, target, up, width, height, lens=EquirectangularLens(), sensor=sensor)

    def undistorted(self) -> CalibratedCamera:
        """The pinhole camera with this sensor and no lens, as `cv2.undistort` makes images for.

        Raises InputError for a panorama, which has no focal length.
        """
        if isinstance(self.lens, EquirectangularLens):
            raise InputError("a panorama sees all around, and no pinhole camera does; make cameras of parts of it")
        return CalibratedCamera(self.eye, self.target, self.up, self.width, self.height, plane=self.sensor)

    def crop(self, left: int, top: int, width: int, height: int) -> LensCamera:
        """As `Camera.crop`."""
        sensor = self.sensor.cropped((self.width, self.height), (left, top), (width, height))
        return LensCamera(self.eye, self.target, self.up, width, height, lens=self.lens, sensor=sensor)


@dataclass(frozen=True)
class CalibratedCamera(Camera):
    """A pinhole camera whose pixels need not be square and whose principal point need not be in the middle.

    `Camera.from_opencv`, `Camera.from_matrix`, `Camera.crop` and the readers of camera files return it.

    eye, target, up, width, height: as for `Camera`.
    plane: grid of pixels on the image plane.
    fov_y_degrees: angle between the upper and the lower border of the image, computed.

    Raises InputError as `Camera`, and for a principal point more than 1e6 pixels outside the image.
    """

    fov_y_degrees: float = field(init=False)
    plane: ImagePlane = field(kw_only=True)  # type: ignore[misc]  # given here, computed by `Camera`

    def __post_init__(self) -> None:
        View.__post_init__(self)
        if not isinstance(self.plane, ImagePlane):
            raise InputError(f"plane is {self.plane!r}, expected atra.ImagePlane")
        for name, axis, pixels in zip("xy", self.plane.axis_in_image, (self.width, self.height), strict=True):
            if max(-axis, axis - pixels) > FARTHEST_AXIS_PIXELS:
                raise InputError(
                    f"the view axis meets the image plane at {name} = {axis:g} pixels, expected at most "
                    f"{FARTHEST_AXIS_PIXELS:g} outside of the image: beyond, float32 cannot tell rays apart"
                )
        upper, lower = (float(self.plane.rows(y)) * self.plane.pitch_y for y in (0, self.height))
        object.__setattr__(self, "fov_y_degrees", degrees(atan(lower) - atan(upper)))

    @classmethod
    def at(
        cls, eye: NDArray[np.float64], axes: NDArray[np.float64], plane: ImagePlane, width: int, height: int
    ) -> CalibratedCamera:
        """The camera at `eye` (3,) whose axes right, down, forward are the rows of `axes` (3, 3), a rotation."""
        return cls(*_placed(eye, axes), width, height, plane=plane)


def camera_of(
    lens: Lens, eye: NDArray[np.float64], axes: NDArray[np.float64], sensor: ImagePlane, width: int, height: int
) -> CalibratedCamera | LensCamera:
    """The camera with a lens, placed as `CalibratedCamera.at`; one without where the lens bends nothing."""
    if lens == OpenCVLens():
        return CalibratedCamera.at(eye, axes, sensor, width, height)
    return LensCamera(*_placed(eye, axes), width, height, lens=lens, sensor=sensor)


def _placed(eye: NDArray[np.float64], axes: NDArray[np.float64]) -> tuple[Vector, Vector, Vector]:
    """eye, target and up of a camera whose axes right, down, forward are the rows of `axes`."""
    return as_vector(eye), target_of(eye, axes[2]), as_vector(-axes[1])
