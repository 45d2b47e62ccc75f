"""Calibration: the matrices by which others describe a camera, checked and taken apart."""

from __future__ import annotations

from math import frexp

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.image_plane import ImagePlane
from atra.geometry.numbers import Vector

AXES = ("opengl", "opencv")
"""Of a camera's own space: X right, Y up, Z backward (OpenGL, Blender, NeRF); X right, Y down, Z forward (OpenCV)."""

PIXEL_CENTRE = 0.5
"""What OpenCV calls pixel (0, 0) is a pixel's centre; here pixel positions count from its corner."""

FARTHEST_EYE = 1e300
"""Largest coordinate of an eye that matrices place."""

ROTATION_TOLERANCE = 1e-4
"""How far the products of a rotation's rows may be from those of the unit matrix: files keep few digits."""


def image_plane_of(K: ArrayLike) -> ImagePlane:
    """The image plane of an intrinsic matrix ((fx, 0, cx), (0, fy, cy), (0, 0, 1)) in OpenCV's pixels.

    Raises InputError for another shape, for what is not finite, a singular matrix, skew, focal lengths that are not
    above 0, and another last row.
    """
    matrix = _matrix("K", K, (3, 3))
    with np.errstate(over="ignore"):
        is_singular = np.linalg.det(matrix) == 0.0
    if is_singular:
        raise InputError(f"K is singular, expected focal lengths above 0 and the last row [0, 0, 1]: {matrix.tolist()}")
    (fx, skew, cx), (below, fy, cy), last = matrix.tolist()
    if skew != 0.0 or below != 0.0:
        raise InputError(f"K has the skew {skew if skew else below:g}, expected none: images must have square corners")
    if last != [0.0, 0.0, 1.0]:
        raise InputError(f"the last row of K is {last}, expected [0, 0, 1]; divide K by its last number")
    return image_plane_of_focals(fx, fy, cx + PIXEL_CENTRE, cy + PIXEL_CENTRE)


def image_plane_of_focals(fx: float, fy: float, axis_x: float, axis_y: float) -> ImagePlane:
    """The image plane of two focal lengths and the principal point, all in pixels, (0, 0) being the image's corner.

    Raises InputError for focal lengths that are not above 0, and what is not finite.
    """
    for name, focal in (("fx", fx), ("fy", fy)):
        if not 0.0 < focal < np.inf or 1.0 / focal in (0.0, np.inf):
            raise InputError(f"the focal length {name} is {focal}, expected a finite number of pixels above 0")
    return ImagePlane(1.0 / fx, 1.0 / fy, axis_x, axis_y)


def pose_of(R: ArrayLike, t: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Eye (3,), and the axes right, down, forward as rows (3, 3), of x_camera = R x_world + t in OpenCV's axes.

    Raises InputError for an R that is no rotation and a t that is not three finite numbers.
    """
    rotation = rotation_of("R", R, " (cv2.Rodrigues makes one of a rotation vector)")
    translation = np.asarray(_real("t", t))
    if translation.shape not in ((3,), (3, 1), (1, 3)):
        raise InputError(f"t has shape {translation.shape}, expected three numbers")
    translation = _finite("t", translation.reshape(3))
    with np.errstate(over="ignore", invalid="ignore"):  # such an eye is refused where it is used
        return -rotation.T @ translation, rotation


def pose_of_matrix(camera_to_world: ArrayLike, axes: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same of a matrix (4, 4) or (3, 4) that carries a camera's own space, with one of `AXES`, into the world.

    Raises InputError for other axes, another shape or last row, what is not finite, and a rotation that is none.
    """
    if axes not in AXES:
        raise InputError(f"axes is {axes!r}, expected one of {', '.join(AXES)}")
    given = np.asarray(_real("camera_to_world", camera_to_world))
    if given.shape not in ((4, 4), (3, 4)):
        raise InputError(f"camera_to_world has shape {given.shape}, expected (4, 4) or (3, 4)")
    matrix = _finite("camera_to_world", given)
    if matrix.shape == (4, 4) and matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise InputError(f"the last row of camera_to_world is {matrix[3].tolist()}, expected [0, 0, 0, 1]")
    columns = rotation_of("the left part of camera_to_world", matrix[:3, :3], "; a scale must be taken out first")
    signs = np.array([1.0, -1.0, -1.0] if axes == "opengl" else [1.0, 1.0, 1.0])
    return matrix[:3, 3].copy(), columns.T * signs[:, None]


def rotation_of(name: str, given: ArrayLike, hint: str = "") -> NDArray[np.float64]:
    """(3, 3) float64, the rotation nearest to the one given, which rounding may have left ROTATION_TOLERANCE off one.

    Raises InputError, with how far off it is, for anything else.
    """
    matrix = np.asarray(_real(name, given))
    if matrix.shape != (3, 3):
        raise InputError(f"{name} has shape {matrix.shape}, expected (3, 3){hint}")
    matrix = _finite(name, matrix)
    with np.errstate(over="ignore"):
        off = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if not off <= ROTATION_TOLERANCE:
        raise InputError(
            f"{name} is no rotation: the products of its rows are up to {off:.3g} from those of one, expected at most "
            f"{ROTATION_TOLERANCE:g}{hint}"
        )
    if np.linalg.det(matrix) < 0.0:
        raise InputError(f"{name} is a reflection (determinant -1), expected a rotation; is an axis turned over?")
    left, _, right = np.linalg.svd(matrix)
    return np.asarray(left @ right)


def target_of(eye: NDArray[np.float64], forward: NDArray[np.float64]) -> Vector:
    """A point ahead of the eye, so far that their difference keeps the digits of `forward`. Raises InputError for an
    eye beyond FARTHEST_EYE."""
    if not np.abs(eye).max() <= FARTHEST_EYE:
        raise InputError(
            f"the eye lies at {tuple(eye.tolist())}, expected at most {FARTHEST_EYE:g} from the origin: "
            "float64 has no numbers for what lies beyond"
        )
    distance = 2.0 ** max(frexp(float(np.abs(eye).max()))[1], 0)
    x, y, z = (eye + distance * forward).tolist()
    return x, y, z


def _matrix(name: str, given: ArrayLike, shape: tuple[int, int]) -> NDArray[np.float64]:
    matrix = np.asarray(_real(name, given))
    if matrix.shape != shape:
        raise InputError(f"{name} has shape {matrix.shape}, expected {shape}")
    return _finite(name, matrix)


def _finite(name: str, array: NDArray[np.float64]) -> NDArray[np.float64]:
    if not np.isfinite(array).all():
        raise InputError(f"{name} is {array.tolist()}, expected finite numbers")
    return array


def _real(name: str, given: ArrayLike) -> NDArray[np.float64]:
    try:
        array = np.asarray(given)
        if array.dtype.kind not in "iuf":
            raise TypeError(f"it has dtype {array.dtype}")
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as an array of real numbers: {error}") from None
    return array.astype(np.float64)
