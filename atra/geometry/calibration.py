"""Calibration: image planes and poses from the matrices of other programs."""

from __future__ import annotations

from math import frexp

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.image_plane import ImagePlane
from atra.geometry.numbers import Vector, as_vector, checked_array, cross

AXES = ("opengl", "opencv")
"""Axes of camera space: X right, Y up, Z backward (OpenGL, Blender, NeRF); X right, Y down, Z forward (OpenCV)."""

PIXEL_CENTRE = 0.5
"""Pixel position of a pixel's centre, which is (0, 0) in OpenCV."""

FARTHEST_EYE = 1e300
"""Largest coordinate of an eye from a matrix."""

ROTATION_TOLERANCE = 1e-4
"""Largest error of R R^T that a rotation matrix R may have, since files keep few digits."""

_ROUNDING = 2.0**-51
"""Error of R R^T up to which R is the nearest rotation already, but for rounding."""


def image_plane_of(K: ArrayLike) -> ImagePlane:
    """The image plane of an intrinsic matrix ((fx, 0, cx), (0, fy, cy), (0, 0, 1)) in OpenCV's pixels.

    Raises InputError for another shape or last row, numbers not finite, a singular matrix, skew, and bad focal lengths.
    """
    matrix = checked_array("K", K, "(3, 3)", (3, 3))
    with np.errstate(over="ignore"):
        is_singular = np.linalg.det(matrix) == 0.0
    if is_singular:
        raise InputError(f"K is singular, expected focal lengths above 0 and the last row [0, 0, 1]: {matrix.tolist()}")
    (fx, skew, cx), (below, fy, cy), last = matrix.tolist()
    if skew != 0.0 or below != 0.0:
        raise InputError(f"K has the skew {skew if skew else below:g}, expected 0: pixels must have right angles")
    if last != [0.0, 0.0, 1.0]:
        raise InputError(f"the last row of K is {last}, expected [0, 0, 1]; divide K by its last number")
    return image_plane_of_focals(fx, fy, cx + PIXEL_CENTRE, cy + PIXEL_CENTRE)


def image_plane_of_focals(fx: float, fy: float, axis_x: float, axis_y: float) -> ImagePlane:
    """The image plane of two focal lengths and a principal point, in pixels from the image's corner.

    Raises InputError for focal lengths that are not above 0, and numbers that are not finite.
    """
    for name, focal in (("fx", fx), ("fy", fy)):
        if not 0.0 < focal < np.inf or 1.0 / focal in (0.0, np.inf):
            raise InputError(f"the focal length {name} is {focal}, expected a finite number of pixels above 0")
    return ImagePlane(1.0 / fx, 1.0 / fy, axis_x, axis_y)


def pose_of(R: ArrayLike, t: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Eye (3,), and rows right, down, forward (3, 3), float64, of x_camera = R x_world + t in OpenCV's axes.

    Raises InputError for an R that is no rotation and a t that is not three finite numbers.
    """
    rotation = rotation_of("R", R, " (cv2.Rodrigues makes one of a rotation vector)")
    translation = checked_array("t", t, "three numbers", (3,), (3, 1), (1, 3)).reshape(3)
    with np.errstate(over="ignore", invalid="ignore"):  # such an eye is refused where it is used
        return -rotation.T @ translation, rotation


def pose_of_matrix(camera_to_world: ArrayLike, axes: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same as `pose_of`, from a matrix (4, 4) or (3, 4) from camera space, with one of `AXES`, to world space.

    Raises InputError for other axes, another shape or last row, numbers not finite, and a left part not a rotation.
    """
    if axes not in AXES:
        raise InputError(f"axes is {axes!r}, expected one of {', '.join(AXES)}")
    matrix = checked_array("camera_to_world", camera_to_world, "(4, 4) or (3, 4)", (4, 4), (3, 4))
    if matrix.shape == (4, 4) and matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise InputError(f"the last row of camera_to_world is {matrix[3].tolist()}, expected [0, 0, 0, 1]")
    columns = rotation_of("the left part of camera_to_world", matrix[:3, :3], "; remove a scale first")
    signs = np.array([1.0, -1.0, -1.0] if axes == "opengl" else [1.0, 1.0, 1.0])
    return matrix[:3, 3].copy(), columns.T * signs[:, None]


def rotation_of(name: str, given: ArrayLike, hint: str = "") -> NDArray[np.float64]:
    """(3, 3) float64, the rotation nearest to a matrix that is one to ROTATION_TOLERANCE.

    Raises InputError, stating the error of R R^T, for any other matrix.
    """
    matrix = checked_array(name, given, f"(3, 3){hint}", (3, 3))
    with np.errstate(over="ignore"):
        off = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if not off <= ROTATION_TOLERANCE:
        raise InputError(
            f"{name} is no rotation: R R^T is up to {off:.3g} from the unit matrix, expected at most "
            f"{ROTATION_TOLERANCE:g}{hint}"
        )
    if cross(matrix[0], matrix[1]) @ matrix[2] < 0.0:
        raise InputError(f"{name} is a reflection (determinant -1), expected a rotation; is an axis inverted?")
    if off <= _ROUNDING:  # it is the nearest already
        return matrix
    left, _, right = np.linalg.svd(matrix)
    return np.asarray(left @ right)


def rotation_of_quaternion(w: float, x: float, y: float, z: float) -> NDArray[np.float64]:
    """The rotation (3, 3) float64 of a quaternion of length 1."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def look_at(eye: NDArray[np.float64], axes: NDArray[np.float64]) -> tuple[Vector, Vector, Vector]:
    """eye, target and up of a camera whose axes right, down, forward are the rows of `axes`.

    The target is so far away that its difference from the eye keeps the digits of forward. Raises InputError for an eye
    beyond FARTHEST_EYE.
    """
    if not np.abs(eye).max() <= FARTHEST_EYE:
        raise InputError(
            f"the eye lies at {tuple(eye.tolist())}, expected at most {FARTHEST_EYE:g} from the origin: beyond, "
            "coordinates would leave float64"
        )
    distance = 2.0 ** max(frexp(float(np.abs(eye).max()))[1], 0)
    return as_vector(eye), as_vector(eye + distance * axes[2]), as_vector(-axes[1])
