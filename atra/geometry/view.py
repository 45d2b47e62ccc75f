"""Views: what pinhole cameras, orthographic ones, and those with a lens have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.image_plane import ImagePlane
from atra.geometry.lenses.models import Lens
from atra.geometry.numbers import Vector, as_vector, checked_pixels, checked_vector, cross, unit_vector

_PARALLEL_SINE = 1e-6
"""Sine of the angle below which `up` counts as parallel to the view direction."""


class View(ABC):
    """The base of `Camera`, `OrthographicCamera` and `LensCamera`.

    Camera space is as for `Camera`. Ray directions have Z = 1 and rays start at Z = 0, so a ray parameter *is* a depth;
    for lenses that see sideways directions have length 1 instead, and depth is distance.

    Parameters
    ----------
    eye, target, up, width, height :
        As for `Camera`.

    Raises
    ------
    InputError
        As `Camera`.
    """

    eye: Vector
    target: Vector
    up: Vector
    width: int
    height: int

    is_parallel: ClassVar[bool]
    """Whether rays share their direction (True) or their origin (False)."""

    lens: Lens | None = None
    """The lens; None where rays pass through a regular grid on a plane."""

    def __post_init__(self) -> None:
        for name in ("eye", "target", "up"):
            object.__setattr__(self, name, checked_vector(name, getattr(self, name)))
        for name in ("width", "height"):
            object.__setattr__(self, name, checked_pixels(name, getattr(self, name)))
        _ = self.axes  # raises here, not at first use

    @cached_property
    def axes(self) -> NDArray[np.float64]:
        """(3, 3) float64, rows right, down, forward in world space; orthonormal."""
        if self.eye == self.target:
            raise InputError(f"eye and target are both {self.eye}, expected two different points")
        with np.errstate(over="ignore"):
            view = np.subtract(self.target, self.eye)
        if not np.isfinite(view).all():
            raise InputError(
                f"eye {self.eye} and target {self.target} are too far apart for float64; bring them closer"
            )
        forward = unit_vector("the view direction", view)
        right = cross(forward, unit_vector("up", self.up))
        sine = np.linalg.norm(right)
        if sine < _PARALLEL_SINE:
            raise InputError(f"up {self.up} is parallel to the view direction {tuple(forward.tolist())}; tilt it")
        right /= sine
        return np.stack([right, cross(forward, right), forward])

    @property
    @abstractmethod
    def plane(self) -> ImagePlane:
        """The grid of pixels on the image plane."""

    @property
    def pixel_pitch(self) -> float:
        """Distance between neighbouring pixels on the image plane, the smaller one of columns and rows."""
        return min(self.plane.pitch_x, self.plane.pitch_y)

    @cached_property
    def to_pixels(self) -> NDArray[np.float64]:
        """(3, 4) float64: transforms eye-space points (X, Y, Z, 1) to (a, b, c) with pixel position (a / c, b / c).

        c is the depth, or 1 for parallel rays. The ray of pixel (x, y) at offset (ox, oy) passes through the points
        with position (x + ox, y + oy).
        """
        right, down, forward = self.axes
        (axis_x, axis_y), x, y = self.plane.axis_in_image, right / self.plane.pitch_x, down / self.plane.pitch_y
        if self.is_parallel:
            return np.array([[*x, axis_x], [*y, axis_y], [0.0, 0.0, 0.0, 1.0]])
        return np.column_stack([np.stack([x + axis_x * forward, y + axis_y * forward, forward]), np.zeros(3)])

    def rays(
        self, x: NDArray[np.integer], y: NDArray[np.integer], offset: tuple[float, float] = (0.5, 0.5)
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The rays of pixels, in camera space.

        Parameters
        ----------
        x, y : arrays of whole numbers
            Columns and rows of the pixels; shapes that broadcast together.
        offset : (float, float)
            Sub-pixel position of the rays in [0, 1) x [0, 1).

        Returns
        -------
        origins, directions : (..., 3) float64
            Scene units; directions of length 1 or with Z = 1, NaN where a lens gives a pixel no ray.

        Raises
        ------
        InputError
            For another offset.
        """
        check_offset(offset)
        plane = self.plane
        across, down = plane.columns(x, offset[0]) * plane.pitch_x, plane.rows(y, offset[1]) * plane.pitch_y
        on_plane = np.stack(np.broadcast_arrays(across, down, 0.0 if self.is_parallel else 1.0), axis=-1)
        if self.is_parallel:
            return on_plane, np.broadcast_to([0.0, 0.0, 1.0], on_plane.shape)
        return np.zeros_like(on_plane), on_plane

    @property
    def depth_is_along_ray(self) -> bool:
        """Whether depth is measured along the ray, for lenses that see sideways; otherwise along the view axis."""
        return self.lens is not None and self.lens.sees_sideways

    def rays_world(self, offset: tuple[float, float] = (0.5, 0.5)) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The rays of all pixels in world space, as `RayScene` takes them: `scene.intersect(*camera.rays_world())`.

        Parameters
        ----------
        offset : (float, float)
            Sub-pixel position of the rays in [0, 1) x [0, 1).

        Returns
        -------
        origins, directions : (H, W, 3) float64
            Scene units; directions as of `rays`. Leave out pixels without a ray, whose direction is NaN.

        Raises
        ------
        InputError
            For another offset.
        """
        y, x = np.mgrid[0 : self.height, 0 : self.width]
        origins, directions = self.rays(x, y, offset)
        return origins @ self.axes + np.array(self.eye), directions @ self.axes

    def has_ray(self, offset: tuple[float, float] = (0.5, 0.5)) -> NDArray[np.bool_]:
        """(H, W) bool, whether each pixel has a ray at a sub-pixel `offset`: False where a lens model folds over."""
        check_offset(offset)
        return np.ones((self.height, self.width), np.bool_)

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Pixel positions at which points are seen.

        Parameters
        ----------
        points : (..., 3) array
            World space, scene units.

        Returns
        -------
        (..., 2) float64
            Column and row in pixels; (0, 0) is the image's upper left corner, (0.5, 0.5) the centre of its first pixel.
            Points outside the image have positions outside; those behind the eye, or beyond a lens's fold, NaN.
        """
        given = np.asarray(points, np.float64)
        eye_space = np.append(self.to_eye_space(given), np.ones((*given.shape[:-1], 1)), axis=-1)
        a, b, c = np.moveaxis(eye_space @ self.to_pixels.T, -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where((c > 0.0)[..., None], np.stack([a / c, b / c], axis=-1), np.nan)

    def to_eye_space(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Transform world points (N, 3) to eye space, (N, 3) float64: the world's axes, the eye at the origin."""
        return np.asarray(points, np.float64) - self.eye

    def to_camera_space(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Transform world points (N, 3) to camera space, (N, 3) float64; the eye is subtracted first to keep digits."""
        return self.to_eye_space(points) @ self.axes.T

    def counted_from(self, origin: NDArray[np.float64]) -> Self:
        """The same view, its axes to the bit, with positions that count from `origin`, (3,) float64."""
        moved = copy(self)
        moved.__dict__.update({name: as_vector(getattr(self, name) - origin) for name in ("eye", "target")})
        return moved


def check_view(camera: object) -> None:
    """Raise InputError unless this is a view."""
    if not isinstance(camera, View):
        raise InputError(f"camera is {camera!r:.100}, expected an atra.Camera or another view of atra")


def check_offset(offset: tuple[float, float], name: str = "offset") -> None:
    """Raise InputError unless `offset` is a sub-pixel position in [0, 1) x [0, 1)."""
    try:
        x, y = offset
        inside = bool(0.0 <= x < 1.0 and 0.0 <= y < 1.0)
    except (TypeError, ValueError):
        inside = False
    if not inside:
        raise InputError(f"{name} is {offset!r}, expected two numbers in [0, 1), such as (0.5, 0.5) for pixel centres")
