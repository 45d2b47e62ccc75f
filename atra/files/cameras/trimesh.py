"""The camera of a trimesh scene."""

from __future__ import annotations

from typing import Any

from atra.errors import InputError
from atra.files.cameras.entries import Cameras, entry
from atra.geometry.calibration import image_plane_of_focals, pose_of_matrix
from atra.geometry.camera import CalibratedCamera


def cameras_from_trimesh(scene: Any) -> Cameras:
    """The camera of a `trimesh.Scene`, by its name: `scene.camera` at `scene.camera_transform`.

    Parameters
    ----------
    scene : trimesh.Scene

    Returns
    -------
    dict of CalibratedCamera

    Raises
    ------
    InputError
        For anything but a scene with a camera (trimesh would invent one) whose transform is a rotation.

    Examples
    --------
    >>> import atra
    >>> import trimesh
    >>> scene = trimesh.creation.box().scene()
    >>> camera = scene.camera  # trimesh makes one on demand
    >>> len(atra.cameras_from_trimesh(scene))
    1
    """
    if not hasattr(scene, "has_camera"):
        raise InputError(f"scene is {scene!r:.100}, expected a trimesh.Scene")
    if not scene.has_camera:
        raise InputError("the scene has no camera; call scene.set_camera(), or make an atra.Camera")
    name, (width, height), (fx, fy) = scene.camera.name, scene.camera.resolution, scene.camera.focal
    with entry(f"the scene's camera {name!r}"):
        plane = image_plane_of_focals(float(fx), float(fy), int(width) / 2, int(height) / 2)
        placed = pose_of_matrix(scene.camera_transform, "opengl")
        return {str(name): CalibratedCamera.at(*placed, plane, int(width), int(height))}
