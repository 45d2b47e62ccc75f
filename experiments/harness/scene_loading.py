"""Scene by name or path -> triangles and the fields of its own camera."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.mesh_file import load_mesh
from experiments.harness.configuration import SceneConfiguration, SceneSource
from scenes.cornell_box import CORNELL_BOX_CAMERA, cornell_box
from scenes.directory import default_camera_fields, find_scene_folder, load_scene_from_directory
from scenes.needles import NEEDLES_CAMERA, needles
from scenes.stand_ins import STAND_INS, stand_in_for

PROCEDURAL_SCENES = {
    "cornell_box": (cornell_box, CORNELL_BOX_CAMERA),
    "needles": (needles, NEEDLES_CAMERA),
    **{name: (stand_in.make, stand_in.camera) for name, stand_in in STAND_INS.items()},
}
"""What makes each built-in scene, and the fields of its camera."""


def load_scene(source: SceneSource, name: str | None, path: str | None) -> tuple[Mesh, dict[str, Any]]:
    """Returns the mesh and its camera's eye, target, up and fov_y_degrees.

    Raises InputError for an unknown name, a scene that is in no folder, a wrong ATRA_SCENES, a file that cannot be
    used.
    """
    if source is SceneSource.file:
        if path is None:
            raise InputError("scene=file needs scene.path, for example scene.path=model.ply")
        mesh = load_mesh(path)
        return mesh, dict(default_camera_fields(mesh))
    if name is None:
        raise InputError(f"a {source.value} scene needs scene.name")
    if source is SceneSource.procedural:
        if name not in PROCEDURAL_SCENES:
            known = ", ".join(sorted(PROCEDURAL_SCENES))
            raise InputError(f"unknown procedural scene {name!r}, expected one of {known}")
        make_mesh, camera = PROCEDURAL_SCENES[name]
        return make_mesh(), dict(camera)
    mesh, fields = load_scene_from_directory(name)
    return mesh, {"up": Camera.up, "fov_y_degrees": Camera.fov_y_degrees, **fields}


def scene_is_available(source: SceneSource, name: str | None) -> bool:
    """Whether `load_scene` would find this scene; nothing is loaded, so its file may still prove unusable.

    True for every scene=file: its path is the user's word, and loading says what is wrong with it.
    Raises InputError when ATRA_SCENES names no folder: that is a mistake to mend, not a scene to do without.
    """
    if source is SceneSource.file:
        return True
    if name is None:
        return False
    return name in PROCEDURAL_SCENES if source is SceneSource.procedural else find_scene_folder(name) is not None


def replace_missing_scenes(scenes: Iterable[SceneConfiguration]) -> list[str]:
    """Put its stand-in in place of each of the paper's scenes that is not on this machine; other scenes stay.

    Changes the configurations given, where a scene may come many times. Returns one note for people per scene replaced.
    """
    notes: dict[str, str] = {}
    for scene in scenes:
        stand_in = stand_in_for(scene.name or "")
        if stand_in is not None and not scene_is_available(scene.source, scene.name):
            notes[str(scene.name)] = f"{scene.name} is not on this machine; {stand_in}, its stand-in, is not that scene"
            scene.name, scene.source = stand_in, SceneSource.procedural
    return list(notes.values())


def mesh_sha256(mesh: Mesh) -> str:
    """Hash of the triangles as loaded, so that a changed file never passes for the one measured before."""
    digest = hashlib.sha256()
    for array in (mesh.vertices, mesh.faces):
        contiguous = np.ascontiguousarray(array)
        digest.update(f"{contiguous.dtype.str} {contiguous.shape} ".encode())
        digest.update(contiguous.tobytes())
    return digest.hexdigest()
