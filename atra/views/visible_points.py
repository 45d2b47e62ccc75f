"""Which points cameras see: inside of their images, and with nothing of the mesh before them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.rays.all_hits.contains import FARTHEST_POINT, check_points
from atra.rays.rays import Rays
from atra.rays.scene import RayScene


def visible_points(
    mesh: Mesh,
    points: ArrayLike,
    cameras: Mapping[Any, View] | Iterable[View],
    *,
    tolerance: float = 1e-4,
    threads: int | None = None,
) -> NDArray[np.bool_]:
    """Whether cameras see points, by one exact ray per camera and point.

    Parameters
    ----------
    mesh : Mesh
    points : (P, 3) array_like of float
        Scene units; they may lie on the mesh.
    cameras : mapping or iterable of cameras
        Views of any kind, by name or in a list.
    tolerance : float
        Triangles nearer to the point than this share of its distance from the camera hide nothing, as points on the
        mesh are rounded.
    threads : int, optional
        None: every core.

    Returns
    -------
    (C, P) ndarray of bool

    Raises
    ------
    InputError
        For points that are not finite or beyond 1e19 in size, anything that is not a camera, and a tolerance outside
        [0, 1).

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera.framing(mesh, width=64, height=48)
    >>> atra.visible_points(mesh, [(0.2, 0.2, 0), (9, 9, 9)], [camera]).tolist()
    [[True, False]]
    """
    found, listed = check_points(points, FARTHEST_POINT), list_cameras(cameras)
    if not 0.0 <= tolerance < 1.0:
        raise InputError(f"tolerance is {tolerance!r}, expected a share in [0, 1)")
    visible = np.zeros((len(listed), len(found)), np.bool_)
    with RayScene(mesh, threads=threads) as scene:
        for row, camera in zip(visible, listed, strict=True):
            inside = np.flatnonzero(_is_in_image(camera, found))
            starts = np.broadcast_to(np.asarray(camera.eye), (len(inside), 3))
            ways = found[inside] - starts
            if camera.is_parallel:
                forward = camera.axes[2]
                along = (ways @ forward)[:, None] * forward
                starts, ways = found[inside] - along, along
            rays = Rays(starts, ways, tfar=1.0 - tolerance)  # type: ignore[arg-type]
            row[inside] = ~scene.occluded(rays)
    return visible


def list_cameras(cameras: Mapping[Any, View] | Iterable[View]) -> list[View]:
    """The cameras themselves. Raises InputError for anything else."""
    is_several = isinstance(cameras, Iterable) and not isinstance(cameras, View)
    listed: list[Any] = list(cameras.values() if isinstance(cameras, Mapping) else cameras) if is_several else []
    if not is_several or not all(isinstance(view, View) for view in listed):
        raise InputError(f"cameras is {cameras!r:.100}, expected several: by name, or a list of them")
    return listed


def _is_in_image(camera: View, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(P,) bool, whether points lie before the camera and are projected into its image; not at its eye."""
    x, y = camera.project(points).T
    is_before = (camera.to_camera_space(points)[:, 2] > 0.0) | camera.depth_is_along_ray
    return np.asarray(is_before & (x >= 0.0) & (x < camera.width) & (y >= 0.0) & (y < camera.height))
