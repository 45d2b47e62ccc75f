"""Scene by name or path -> triangles and the fields of its own camera."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.mesh import Mesh, load_mesh
from experiments.configuration import SceneSource
from scenes.cornell_box import CORNELL_BOX_CAMERA, cornell_box
from scenes.directory import default_camera_fields, load_scene_from_directory
from scenes.stand_ins import STAND_INS

_PROCEDURAL = {
    "cornell_box": (cornell_box, CORNELL_BOX_CAMERA),
    **{name: (stand_in.make, stand_in.camera) for name, stand_in in STAND_INS.items()},
}


def load_scene(source: SceneSource, name: str | None, path: str | None) -> tuple[Mesh, dict[str, Any]]:
    """Returns the mesh and its camera's eye, target, up and fov_y_degrees.

    Raises InputError for an unknown name, an unset or wrong ATRA_SCENES, a file that cannot be used.
    """
    if source is SceneSource.file:
        if path is None:
            raise InputError("scene=file needs scene.path, for example scene.path=model.ply")
        mesh = load_mesh(path)
        return mesh, dict(default_camera_fields(mesh))
    if name is None:
        raise InputError(f"a {source.value} scene needs scene.name")
    if source is SceneSource.procedural:
        if name not in _PROCEDURAL:
            raise InputError(f"unknown procedural scene {name!r}, expected one of {', '.join(sorted(_PROCEDURAL))}")
        make_mesh, camera = _PROCEDURAL[name]
        return make_mesh(), dict(camera)
    mesh, fields = load_scene_from_directory(name)
    return mesh, dict(fields)


def mesh_sha256(mesh: Mesh) -> str:
    """Hash of the triangles as loaded, so that a changed file never passes for the one measured before."""
    digest = hashlib.sha256()
    for array in (mesh.vertices, mesh.faces):
        contiguous = np.ascontiguousarray(array)
        digest.update(f"{contiguous.dtype.str} {contiguous.shape} ".encode())
        digest.update(contiguous.tobytes())
    return digest.hexdigest()
