"""Lens models of OpenCV, COLMAP and panoramas, as values."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cached_property
from math import cos, inf, pi, sin
from typing import Any, ClassVar, Self

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.lenses.lens_numbers import (
    EQUIDISTANT,
    EQUIRECTANGULAR,
    FIELD_OF_VIEW,
    PERSPECTIVE,
    LensNumbers,
)
from atra.geometry.numbers import as_number

LARGEST_TANGENT = 1e3
"""Largest tangent of the angle between a perspective lens's rays and its axis: 0.06 degrees short of 90."""

LARGEST_COEFFICIENT = 1e6
"""Largest size of a coefficient; products of larger ones could leave float64."""

_ANGLES, _SHARE = 256, 0.98
"""Number of radii whose fold is computed beforehand, and the share of the nearest fold up to which pixels need no
search of their own; folds change little from one radius to the next."""

_NO_SHIFTS = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

COEFFICIENT_COUNTS = (4, 5, 8, 12, 14)
"""Numbers of coefficients that OpenCV's pinhole model may have."""


@dataclass(frozen=True)
class Lens(ABC):
    """A lens model. Coefficients are floats; raises InputError for one that is not finite, or above 1e6 in size.

    sees_sideways: whether rays may leave at 90 degrees to the view axis and beyond. Depth is then measured along the
    ray, for other lenses along the axis.
    """

    sees_sideways: ClassVar[bool]

    def __post_init__(self) -> None:
        for field in fields(self):
            value = as_number(getattr(self, field.name))
            if not abs(value) <= LARGEST_COEFFICIENT:
                given = getattr(self, field.name)
                raise InputError(
                    f"{field.name} of the lens is {given!r}, expected a finite number up to {LARGEST_COEFFICIENT:g}"
                )
            object.__setattr__(self, field.name, value)

    @cached_property
    @abstractmethod
    def numbers(self) -> LensNumbers:
        """The lens as kernels take it."""

    def __str__(self) -> str:
        given = ", ".join(
            f"{field.name}={getattr(self, field.name):g}" for field in fields(self) if getattr(self, field.name)
        )
        return f"{type(self).__name__}({given})"


@dataclass(frozen=True)
class OpenCVLens(Lens):
    """OpenCV's pinhole model with distortion, also COLMAP's SIMPLE_RADIAL, RADIAL, OPENCV and FULL_OPENCV.

    Parameters
    ----------
    k1, k2, k3, k4, k5, k6 : float
        Radial: (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6).
    p1, p2 : float
        Tangential.
    s1, s2, s3, s4 : float
        Thin prism.
    tilt_x, tilt_y : float
        Tilt of the sensor, radians.

    Notes
    -----
    OpenCV's documentation, "Camera Calibration and 3D Reconstruction".

    Examples
    --------
    >>> import atra
    >>> import numpy as np
    >>> K = [[90, 0, 32], [0, 90, 24], [0, 0, 1]]
    >>> camera = atra.Camera.from_opencv(K, np.eye(3), (0, 0, 3), 64, 48, distortion=[-0.2, 0.05, 0, 0])
    >>> camera.lens == atra.OpenCVLens(k1=-0.2, k2=0.05)
    True
    """

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    s1: float = 0.0
    s2: float = 0.0
    s3: float = 0.0
    s4: float = 0.0
    tilt_x: float = 0.0
    tilt_y: float = 0.0

    sees_sideways = False

    @classmethod
    def of(cls, distortion: Any) -> Self:
        """The lens of OpenCV's coefficients.

        Parameters
        ----------
        distortion : array
            k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tilt_x, tilt_y, or the first 4, 5, 8 or 12 of these.

        Raises
        ------
        InputError
            For another number of coefficients, and one that is not finite.
        """
        names = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tilt_x", "tilt_y")
        given = coefficients_of(distortion, COEFFICIENT_COUNTS)
        return cls(**dict(zip(names, given, strict=False)))

    @cached_property
    def numbers(self) -> LensNumbers:
        over, under = (1.0, self.k1, self.k2, self.k3), (1.0, self.k4, self.k5, self.k6)
        shifts = (self.p1, self.p2, self.s1, self.s2, self.s3, self.s4)
        return _numbers(PERSPECTIVE, over, under, shifts, _tilt(self.tilt_x, self.tilt_y), LARGEST_TANGENT)


@dataclass(frozen=True)
class FisheyeLens(Lens):
    """OpenCV's fisheye model, also COLMAP's OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, THIN_PRISM_FISHEYE.

    The distance from the image's centre is a polynomial in the angle to the view axis.

    Parameters
    ----------
    k1, k2, k3, k4 : float
        Coefficients of the polynomial.
    p1, p2 : float
        Tangential.
    s1, s3 : float
        Thin prism along x and along y.

    Examples
    --------
    >>> import atra
    >>> atra.FisheyeLens.of([0.02, 0.003, 0.0, 0.0])
    FisheyeLens(k1=0.02, k2=0.003, k3=0.0, k4=0.0, p1=0.0, p2=0.0, s1=0.0, s3=0.0)
    """

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    s1: float = 0.0
    s3: float = 0.0

    sees_sideways = True

    @classmethod
    def of(cls, distortion: Any) -> Self:
        """The lens of OpenCV's coefficients k1, k2, k3, k4. Raises InputError unless there are 4 finite numbers."""
        return cls(*coefficients_of(distortion, (4,)))

    @cached_property
    def numbers(self) -> LensNumbers:
        over = (1.0, self.k1, self.k2, self.k3, self.k4)
        return _numbers(EQUIDISTANT, over, (1.0,), (self.p1, self.p2, self.s1, 0.0, self.s3, 0.0), np.eye(3), pi)


@dataclass(frozen=True)
class FovLens(Lens):
    """COLMAP's FOV: the distance from the image's centre is atan(2 r tan(omega / 2)) / omega.

    Parameters
    ----------
    omega : float
        Radians, above 0 and below pi.

    Notes
    -----
    F. Devernay, O. Faugeras, "Straight lines have to be straight", 2001.
    """

    omega: float

    sees_sideways = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.omega < pi:
            raise InputError(f"omega of the lens is {self.omega:g}, expected radians above 0 and below pi")

    @cached_property
    def numbers(self) -> LensNumbers:
        return _numbers(FIELD_OF_VIEW, (1.0,), (1.0,), _NO_SHIFTS, np.eye(3), LARGEST_TANGENT, self.omega)


@dataclass(frozen=True)
class EquirectangularLens(Lens):
    """A panorama: columns are longitudes, rows are latitudes; the view axis is in the middle."""

    sees_sideways = True

    @cached_property
    def numbers(self) -> LensNumbers:
        return _numbers(EQUIRECTANGULAR, (1.0,), (1.0,), _NO_SHIFTS, np.eye(3), pi)


def bends_rays(lens: Lens) -> str:
    """Error text for functions that take no lens: names the lens and what to use instead."""
    return (
        f"the camera has the lens {lens}; RasterTracer and PixelTracer take it, RayScene takes "
        "camera.rays_world(), and camera.undistorted() has no lens"
    )


def coefficients_of(distortion: Any, counts: tuple[int, ...]) -> list[float]:
    """`distortion` as floats. Raises InputError for no numbers, or another number of them than one of `counts`."""
    try:
        given = np.asarray(distortion, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"distortion cannot be read as numbers: {error}") from None
    if given.size not in counts or given.size != max(given.shape, default=0):
        expected = " or ".join((", ".join(map(str, counts[:-1])), str(counts[-1]))) if len(counts) > 1 else str(*counts)
        raise InputError(f"distortion has shape {given.shape}, expected {expected} coefficients")
    return [float(number) for number in given.ravel()]


def _numbers(
    kind: int,
    over: tuple[float, ...],
    under: tuple[float, ...],
    shifts: tuple[float, float, float, float, float, float],
    tilt: NDArray[np.float64],
    limit: float,
    omega: float = 1.0,
) -> LensNumbers:
    n, m, q = Polynomial(over), Polynomial(under), Polynomial([0.0, 1.0])
    rise = n * m + 2.0 * q * (n.deriv() * m - n * m.deriv())
    is_radial = not any(shifts)
    parts = np.stack([_padded(part.coef, 13) for part in (n * rise, n * m**2, rise * m, m**3)])
    given = kind, _padded(over, 5), _padded(under, 4), _padded(rise.coef, 9), parts, *shifts
    untilt = np.asarray(np.linalg.inv(tilt), np.float64)
    is_tilted = bool((tilt != np.eye(3)).any())

    def known(surely: float, farthest: float) -> LensNumbers:
        return LensNumbers(*given, tilt, untilt, is_radial, is_tilted, omega, limit, surely, farthest)

    if kind not in (PERSPECTIVE, EQUIDISTANT):
        return known(limit, inf)
    from atra.geometry.lenses.folds_kernels import find_folds  # Numba is slow to import, and cameras seldom need it
    from atra.geometry.lenses.lens_kernels import distort

    numbers = known(0.0, inf)
    angles = np.arange(1 if is_radial else _ANGLES) * (2.0 * pi / _ANGLES)
    radii = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    folds, border = np.empty(len(angles)), np.empty((len(angles), 2))
    find_folds(numbers, radii[:, 0].copy(), radii[:, 1].copy(), folds)
    if is_radial:
        return known(float(folds[0]), inf)
    distort(numbers, folds[:, None] * radii, border)
    farthest = float(np.hypot(*border.T).max()) / _SHARE
    return known(_SHARE * float(folds.min()), farthest)


def _padded(coefficients: Any, count: int) -> NDArray[np.float64]:
    return np.concatenate([coefficients, np.zeros(count - len(coefficients))])


def _tilt(x: float, y: float) -> NDArray[np.float64]:
    """(3, 3) float64, the homography of a sensor tilted about its axes by x and y radians."""
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cos(x), sin(x)], [0.0, -sin(x), cos(x)]])
    about_y = np.array([[cos(y), 0.0, -sin(y)], [0.0, 1.0, 0.0], [sin(y), 0.0, cos(y)]])
    turn = about_y @ about_x
    onto = np.array([[turn[2, 2], 0.0, -turn[0, 2]], [0.0, turn[2, 2], -turn[1, 2]], [0.0, 0.0, 1.0]])
    return np.asarray(onto @ turn)
