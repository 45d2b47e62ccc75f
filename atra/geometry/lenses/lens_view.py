"""Views through a lens: pixels, rays, and where points are seen."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.image_plane import ImagePlane
from atra.geometry.lenses.models import EquirectangularLens, Lens, bends_rays
from atra.geometry.numbers import Vector, checked_pixels
from atra.geometry.view import View, check_offset


@dataclass(frozen=True)
class LensView(View):
    """The base of `LensCamera`, which documents it: all but what makes cameras without a lens."""

    eye: Vector
    target: Vector
    up: Vector
    width: int
    height: int
    lens: Lens = field(kw_only=True)
    sensor: ImagePlane = field(kw_only=True)

    is_parallel: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, kind in (("lens", Lens), ("sensor", ImagePlane)):
            if not isinstance(getattr(self, name), kind):
                raise InputError(f"{name} is {getattr(self, name)!r:.100}, expected atra.{kind.__name__}")

    @classmethod
    def panorama(cls, eye: Vector, target: Vector, up: Vector = (0.0, 1.0, 0.0), width: int = 2048) -> Self:
        """The equirectangular picture of all directions, twice as wide as high; the target is in its middle.

        Parameters
        ----------
        eye, target, up : tuple of three floats
            As for `Camera`.
        width : int
            Columns of the image, pixels; half as many rows.

        Returns
        -------
        LensCamera
            With an `EquirectangularLens`; depth is distance from the eye.

        Raises
        ------
        InputError
            As `Camera`, and for a width that is no whole number of at least 1.
        """
        height = max(checked_pixels("width", width) // 2, 1)
        sensor = ImagePlane.panoramic(width, height)
        return cls(eye, target, up, width, height, lens=EquirectangularLens(), sensor=sensor)

    def crop(self, left: int, top: int, width: int, height: int) -> Self:
        """As `Camera.crop`."""
        sensor = self.sensor.cropped((self.width, self.height), (left, top), (width, height))
        return replace(self, width=width, height=height, sensor=sensor)

    @property
    def plane(self) -> ImagePlane:
        raise InputError(f"a plane with a regular grid of pixels is needed, but {bends_rays(self.lens)}")

    @property
    def pixel_pitch(self) -> float:
        """Distance between neighbouring pixels in the middle of the lens, at distance 1."""
        return min(self.sensor.pitch_x, self.sensor.pitch_y)

    def rays(
        self, x: NDArray[np.integer], y: NDArray[np.integer], offset: tuple[float, float] = (0.5, 0.5)
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        from atra.geometry.lenses.lens_kernels import see  # Numba is slow to import

        check_offset(offset)
        a, b = (part.ravel() for part in np.broadcast_arrays(*self.sensor_coordinates(x, y, offset)))
        directions = np.empty((len(a), 3))
        see(self.lens.numbers, a, b, directions)
        directions = directions.reshape(*np.broadcast_shapes(np.shape(x), np.shape(y)), 3)
        return np.zeros_like(directions), directions

    def sensor_coordinates(
        self, x: ArrayLike, y: ArrayLike, offset: tuple[float, float]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Columns `x` and rows `y` at sub-pixel `offset`, over the focal lengths, from the principal point, float64."""
        sensor = self.sensor
        return sensor.columns(x, offset[0]) * sensor.pitch_x, sensor.rows(y, offset[1]) * sensor.pitch_y

    def has_ray(self, offset: tuple[float, float] = (0.5, 0.5)) -> NDArray[np.bool_]:
        y, x = np.mgrid[0 : self.height, 0 : self.width]
        return np.asarray(np.isfinite(self.rays(x, y, offset)[1]).all(axis=-1))

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        from atra.geometry.lenses.lens_kernels import place

        given = np.asarray(points, np.float64)
        places = np.empty((given.size // 3, 2))
        place(self.lens.numbers, self.to_camera_space(given.reshape(-1, 3)), places)
        places /= self.sensor.pitch_x, self.sensor.pitch_y
        return (places + self.sensor.axis_in_image).reshape(*given.shape[:-1], 2)
