"""Cameras on a circle around a mesh."""

from __future__ import annotations

import numpy as np

from atra.errors import InputError
from atra.geometry.camera import FOV_Y_DEGREES, Camera
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import Vector, as_number, as_vector, checked_vector, unit_vector
from atra.whole_numbers import is_whole_number


def orbit(
    mesh: Mesh,
    views: int = 36,
    *,
    elevation_degrees: float = 20.0,
    up: Vector = (0.0, 1.0, 0.0),
    fov_y_degrees: float = FOV_Y_DEGREES,
    width: int = 1024,
    height: int = 1024,
) -> tuple[Camera, ...]:
    """Cameras evenly around a mesh, all at the distance from which every one sees the whole of it.

        for number, hits in atra.render_views(mesh, atra.orbit(mesh, views=36)):
            ...

    Parameters
    ----------
    mesh : Mesh
    views : int
        Number of cameras.
    elevation_degrees : float
        How far above the mesh they are, between -90 and 90.
    up, fov_y_degrees, width, height :
        As for `Camera`.

    Returns
    -------
    tuple of Camera

    Raises
    ------
    InputError
        For a number of views below 1, an elevation outside (-90, 90), and as `Camera` does.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> [camera.eye[1] > 0 for camera in atra.orbit(mesh, views=3)]
    [True, True, True]
    """
    if not is_whole_number(views) or views < 1:
        raise InputError(f"views is {views!r}, expected a whole number of at least 1")
    elevation = np.radians(as_number(elevation_degrees))
    if not abs(elevation) < np.pi / 2:
        raise InputError(f"elevation_degrees is {elevation_degrees!r}, expected an angle between -90 and 90 degrees")
    upward = unit_vector("up", checked_vector("up", up))
    aside = np.cross(np.eye(3)[np.abs(upward).argmin()], upward)
    aside /= np.linalg.norm(aside)
    ahead = np.cross(upward, aside)
    framed = []
    for angle in np.arange(views) * (2.0 * np.pi / views):
        level = np.cos(angle) * ahead + np.sin(angle) * aside
        direction = as_vector(-np.cos(elevation) * level - np.sin(elevation) * upward)
        framed.append(Camera.framing(mesh, direction, up=up, fov_y_degrees=fov_y_degrees, width=width, height=height))
    centre = np.array(framed[0].target)
    distance = max(float(np.linalg.norm(camera.eye - centre)) for camera in framed)
    return tuple(
        Camera(as_vector(centre - distance * camera.axes[2]), camera.target, camera.up, fov_y_degrees, width, height)
        for camera in framed
    )
