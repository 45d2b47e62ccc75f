"""Pinhole cameras, and cameras with a lens."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from math import atan, degrees, radians, tan
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.choices import check_choice
from atra.errors import InputError
from atra.geometry.calibration import image_plane_of, look_at, pose_of, pose_of_matrix
from atra.geometry.image_plane import ImagePlane, check_axis
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.lenses.models import EquirectangularLens, FisheyeLens, Lens, OpenCVLens
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import Vector, as_number, as_vector, checked_angle, checked_vector, unit_vector
from atra.geometry.view import View

FOV_Y_DEGREES = 60.0
"""Default vertical field of view."""

MARGIN = 0.05
"""Share of the image that a framing camera leaves free on either side."""


@dataclass(frozen=True)
class Camera(View):
    """A pinhole camera and its pixel grid.

    Camera space has the eye at the origin, X to the right (forward x up), Y down (down = forward x right) and Z along
    the view axis; the image plane lies at Z = 1. The ray of pixel (x, y) at sub-pixel `offset` (ox, oy) has direction
    ((x + ox - W/2) p, (y + oy - H/2) p, 1) with pixel pitch p = 2 tan(fov_y / 2) / H, so a ray parameter *is* a depth.
    `from_opencv`, `from_matrix` and `crop` return cameras with other image planes. Source: paper §3.1; the axes are
    ours, as the paper leaves them open.

    Parameters
    ----------
    eye, target : tuple of three floats
        Where rays start, and a point on the view axis; scene units.
    up : tuple of three floats
        Direction that is up in the image.
    fov_y_degrees : float
        Full vertical field of view, between 0 and 180.
    width, height : int
        Columns and rows of the image, pixels.

    Raises
    ------
    InputError
        For a size below 1, a field of view outside (0, 180), eye = target, and up parallel to the view.

    Examples
    --------
    >>> import atra
    >>> camera = atra.Camera(eye=(0, 0, 3), target=(0, 0, 0), width=640, height=480)
    >>> camera.project([(0, 0, 0)]).tolist()  # pixels, from the upper left corner
    [[320.0, 240.0]]
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
        object.__setattr__(self, "fov_y_degrees", checked_angle("fov_y_degrees", self.fov_y_degrees))

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

        Parameters
        ----------
        K, R, t : (3, 3), (3, 3) and (3,) array
            Focal lengths and principal point in pixels, without skew; rotation and translation from world to camera.
        distortion : array, optional
            Coefficients in OpenCV's order, see `OpenCVLens.of` and `FisheyeLens.of`.
        model : {"pinhole", "fisheye"}
            A pinhole camera whose coefficients are all 0 has no lens.

        Returns
        -------
        CalibratedCamera or LensCamera
            The latter if there is a lens.

        Raises
        ------
        InputError
            For a K that is singular or has skew, an R that is no rotation, numbers not finite, another number of
            coefficients and another model.
        """
        pose, sensor = pose_of(R, t), image_plane_of(K)
        kinds: dict[str, type[OpenCVLens] | type[FisheyeLens]] = {"pinhole": OpenCVLens, "fisheye": FisheyeLens}
        check_choice("model", model, tuple(kinds))
        lens = kinds[model]() if distortion is None else kinds[model].of(distortion)
        return camera_of(lens, *pose, sensor, width, height)

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

        Parameters
        ----------
        camera_to_world : (4, 4) or (3, 4) array
            A rotation and the eye.
        width, height :
            As for `Camera`.
        axes : {"opengl", "opencv"}
            Of the camera's space: X right, Y up, Z backward (OpenGL, Blender, NeRF), or X right, Y down, Z forward.
        fov_y_degrees, K : optional
            One of both: full vertical field of view, or K as for `from_opencv`.

        Raises
        ------
        InputError
            For a matrix with scale, reflection or no rotation, other axes, and neither or both of those.
        """
        eye, rotation = pose_of_matrix(camera_to_world, axes)
        if (fov_y_degrees is None) == (K is None):
            raise InputError("expected either fov_y_degrees or K, neither or both were given")
        if K is not None:
            return CalibratedCamera.at(eye, rotation, image_plane_of(K), width, height)
        return Camera(*look_at(eye, rotation), as_number(fov_y_degrees), width, height)

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
        """The camera that sees the whole of a mesh, its box in the middle, 5 % of the image free on either side.

        Parameters
        ----------
        mesh : Mesh
            What is looked at.
        direction : tuple of three floats
            Direction of the view, world space, of any length but 0.
        up, fov_y_degrees, width, height :
            As for `Camera`.

        Raises
        ------
        InputError
            As `Camera`, and for a direction of length 0.
        """
        forward = unit_vector("direction", checked_vector("direction", direction))
        centre = np.asarray(mesh.bounds, np.float64).mean(axis=0)
        size = float(np.abs(mesh.bounds - centre).max()) or 1.0
        turned = Camera(as_vector(centre - size * forward), as_vector(centre), up, fov_y_degrees, width, height)
        away = _framing_distance(mesh.bounds, turned.axes, turned.fov_y_degrees, turned.width, turned.height)
        return Camera(as_vector(centre - away * forward), turned.target, up, fov_y_degrees, width, height)

    @cached_property
    def plane(self) -> ImagePlane:
        """The image plane at Z = 1."""
        pitch = 2.0 * tan(radians(self.fov_y_degrees) / 2.0) / self.height
        return ImagePlane.centred(pitch, self.width, self.height)

    def crop(self, left: int, top: int, width: int, height: int) -> CalibratedCamera:
        """The camera of a part of the image; its pixel (x, y) has the ray of pixel (left + x, top + y) to the bit.

        Raises InputError for a part that is not inside the image.
        """
        plane = self.plane.cropped((self.width, self.height), (left, top), (width, height))
        return CalibratedCamera(self.eye, self.target, self.up, width, height, plane=plane)


@dataclass(frozen=True)
class LensCamera(LensView):
    """A camera with a lens: its rays pass through no regular grid on a plane.

    `RasterTracer` and `PixelTracer` trace its images, and `RayScene` takes its `rays_world`; methods that need a plane
    refuse it. Where the lens model folds over, pixels see nothing: their rays are NaN, and they are misses.
    `Camera.from_opencv`, `LensCamera.panorama` and the readers of camera files return it.

    Parameters
    ----------
    eye, target, up, width, height :
        As for `Camera`.
    lens : Lens
        Such as `OpenCVLens`.
    sensor : ImagePlane
        Its grid of pixels; a pitch is 1 / focal length in pixels, or for a panorama the angle of a pixel in radians.

    Raises
    ------
    InputError
        As `Camera`, and for a lens or sensor of another type.

    Examples
    --------
    >>> import atra
    >>> camera = atra.LensCamera.panorama(eye=(0, 0, 0), target=(0, 0, -1), width=360)
    >>> camera.height, camera.depth_is_along_ray
    (180, True)
    """

    def undistorted(self) -> CalibratedCamera:
        """The pinhole camera with this sensor and no lens, as `cv2.undistort` makes images for.

        Raises InputError for a panorama, which has no focal length.
        """
        if isinstance(self.lens, EquirectangularLens):
            raise InputError("a panorama sees all around, and no pinhole camera does; make cameras of parts of it")
        return CalibratedCamera(self.eye, self.target, self.up, self.width, self.height, plane=self.sensor)


@dataclass(frozen=True)
class CalibratedCamera(Camera):
    """A pinhole camera whose pixels need not be square and whose principal point need not be in the middle.

    `Camera.from_opencv`, `Camera.from_matrix`, `Camera.crop` and the readers of camera files return it.

    Parameters
    ----------
    eye, target, up, width, height :
        As for `Camera`.
    plane : ImagePlane
        Grid of pixels on the image plane; `fov_y_degrees` is the angle between its upper and lower border.

    Raises
    ------
    InputError
        As `Camera`, and for a principal point more than 1e6 pixels outside the image.
    """

    fov_y_degrees: float = field(init=False)
    plane: ImagePlane = field(kw_only=True)  # type: ignore[misc]  # given here, computed by `Camera`

    def __post_init__(self) -> None:
        View.__post_init__(self)
        if not isinstance(self.plane, ImagePlane):
            raise InputError(f"plane is {self.plane!r}, expected atra.ImagePlane")
        check_axis(self.plane, self.width, self.height)
        upper, lower = (float(self.plane.rows(y)) * self.plane.pitch_y for y in (0, self.height))
        object.__setattr__(self, "fov_y_degrees", degrees(atan(lower) - atan(upper)))

    @classmethod
    def at(
        cls, eye: NDArray[np.float64], axes: NDArray[np.float64], plane: ImagePlane, width: int, height: int
    ) -> CalibratedCamera:
        """The camera at `eye` (3,) whose axes right, down, forward are the rows of `axes` (3, 3), a rotation."""
        return cls(*look_at(eye, axes), width, height, plane=plane)


def camera_of(
    lens: Lens, eye: NDArray[np.float64], axes: NDArray[np.float64], sensor: ImagePlane, width: int, height: int
) -> CalibratedCamera | LensCamera:
    """The camera with a lens, placed as `CalibratedCamera.at`; one without where the lens bends nothing."""
    if lens == OpenCVLens():
        return CalibratedCamera.at(eye, axes, sensor, width, height)
    return LensCamera(*look_at(eye, axes), width, height, lens=lens, sensor=sensor)


def _framing_distance(
    bounds: NDArray[np.floating], axes: NDArray[np.float64], fov_y_degrees: float, width: int, height: int
) -> float:
    """The least distance from the centre of a box, given by two corners, at which a pinhole camera sees all of it."""
    half = (np.asarray(bounds[1], np.float64) - bounds[0]) / 2.0
    x, y, z = (np.array(list(product((-1.0, 1.0), repeat=3))) * half @ axes.T).T
    reach_y = np.tan(np.radians(fov_y_degrees) / 2.0) * (1.0 - 2.0 * MARGIN)
    reach_x = reach_y * width / height
    distance = float((np.maximum(np.abs(x) / reach_x, np.abs(y) / reach_y) - z).max())
    return max(distance, float(np.linalg.norm(half)) * 1.001) or 1.0
