"""The orthographic camera: parallel rays, as for plans, elevations and shadow maps of directional lights."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from atra.errors import InputError
from atra.geometry.image_plane import ImagePlane
from atra.geometry.numbers import Vector, as_vector, checked_array, checked_positive, checked_vector, unit_vector
from atra.geometry.view import View

_WIDENING = 1e-9
"""Share by which `of_light` widens the view, so that rounding leaves no corner of the box outside."""


@dataclass(frozen=True)
class OrthographicCamera(View):
    """A camera whose rays are parallel, and its pixel grid.

    Camera space is as for `Camera`, but the image plane lies at Z = 0. The ray of pixel (x, y) at sub-pixel `offset`
    (ox, oy) starts at ((x + ox - W/2) p, (y + oy - H/2) p, 0) with pixel pitch p = view_height / H and has direction
    (0, 0, 1), so a ray parameter *is* a depth, and nothing behind the image plane is seen.

    Parameters
    ----------
    eye : tuple of three floats
        Centre of the image plane, scene units.
    target, up, width, height :
        As for `Camera`.
    view_height : float
        Height of the image, scene units; pixels are square.

    Raises
    ------
    InputError
        For a size below 1, a view_height that is not above 0, eye = target, and up parallel to the view.

    Examples
    --------
    >>> import atra
    >>> camera = atra.OrthographicCamera(eye=(0, 0, 3), target=(0, 0, 0), view_height=2, width=4, height=4)
    >>> camera.project([(0.5, 0, 0)]).tolist()
    [[3.0, 2.0]]
    """

    eye: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    view_height: float = 1.0
    width: int = 1024
    height: int = 1024

    is_parallel: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "view_height", checked_positive("view_height", self.view_height, "length"))

    @classmethod
    def of_light(cls, direction: Vector, bounds: ArrayLike, width: int, height: int, up: Vector | None = None) -> Self:
        """The view along a directional light that contains a box, as for a shadow map.

        The box is centred and fills the image along one axis or both. The image plane lies one diagonal of the box
        before its centre, so that the whole box lies in front of it.

        Parameters
        ----------
        direction : tuple of three floats
            The light's direction, of any length but 0.
        bounds : (2, 3) array
            Lowest and highest corner of the box, scene units, such as `Mesh.bounds`.
        width, height : int
            Of the image, pixels.
        up : tuple of three floats, optional
            None takes the world axis that is most across the light.

        Raises
        ------
        InputError
            For a direction of length 0, corners of no box, and a box without extent across the light.
        """
        forward = unit_vector("direction", checked_vector("direction", direction))
        low, high = box = checked_array("bounds", bounds, "(2, 3): lowest and highest corner", (2, 3))
        if not (low <= high).all():
            raise InputError(f"bounds is {box.tolist()}, expected the lowest corner first")
        if up is None:
            up = as_vector(np.eye(3)[np.abs(forward).argmin()])
        centre, diagonal = (low + high) / 2, high - low
        distance = hypot(*diagonal.tolist()) or 1.0
        unit = cls(as_vector(centre - distance * forward), as_vector(centre), up, 1.0, width, height)
        # The extent of a box along an axis is that of its diagonal if all components count positive.
        extent_right, extent_down = np.abs(unit.axes[:2]) @ diagonal
        view_height = max(extent_down, extent_right * unit.height / unit.width) * (1.0 + _WIDENING)
        if not view_height > 0.0:
            raise InputError(
                f"the box from {as_vector(low)} to {as_vector(high)} has no extent across the light "
                f"{as_vector(forward)}"
            )
        return cls(unit.eye, unit.target, unit.up, view_height, width, height)

    @property
    def plane(self) -> ImagePlane:
        """The image plane at Z = 0; distances in scene units."""
        return ImagePlane.centred(self.view_height / self.height, self.width, self.height)
