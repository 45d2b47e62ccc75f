"""Scenes as a configuration names them: built in, in a folder, or a file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from scenes.built_in import BUILT_IN, make_scene, package_scene, package_scenes, stand_in_for
from scenes.scene import Scene


class SceneSource(Enum):
    """procedural = made by code; generated = one of a family, of any size; package = of an installed package; directory
    = the one named by ATRA_SCENES, or the cache of fetched scenes; file = the user's own."""

    procedural = "procedural"
    generated = "generated"
    package = "package"
    directory = "directory"
    file = "file"


class NamedScene(Protocol):
    """A scene as a configuration names it."""

    name: str | None
    source: SceneSource


MOST_TRIANGLES = 1 << 28
"""Limit of an enlarged scene, 5 GB of mesh; more is likely a mistake."""


def load_scene(
    source: SceneSource, name: str | None, path: str | None, subdivided: int = 0, copies: int = 1
) -> Scene:  # fmt: skip
    """The scene, `enlarged`. Raises InputError for an unknown name, a scene that is in no folder, a wrong ATRA_SCENES,
    a file that cannot be used, and as `enlarged`."""
    return enlarged(_load(source, name, path), subdivided, copies)


def _load(source: SceneSource, name: str | None, path: str | None) -> Scene:
    # Each way to a scene is imported when a scene needs it: workers start sooner.
    if source is SceneSource.file:
        from scenes.directory import load_scene_from_file

        if path is None:
            raise InputError("scene=file needs scene.path, for example scene.path=model.ply")
        return load_scene_from_file(path)
    if name is None:
        raise InputError(f"a {source.value} scene needs scene.name")
    if source is SceneSource.directory:
        from scenes.directory import load_scene_from_directory

        return load_scene_from_directory(name)
    if source is SceneSource.generated:
        from scenes.generated import named_scene

        return named_scene(name)
    return make_scene(name) if source is SceneSource.procedural else package_scene(name)


def enlarged(scene: Scene, subdivided: int, copies: int) -> Scene:
    """The scene with more triangles, its camera the same.

    subdivided: how often each triangle is cut into four at the middles of its edges; those of triangle i follow each
    other from 4 i on. copies: of all that, side by side over the box's two longest extents, the first where the scene
    is and the others around it; those of copy k have the `prim_id`s from k F on.
    Raises InputError where that makes more than `MOST_TRIANGLES`.
    """
    count = scene.mesh.triangle_count * 4 ** min(subdivided, 16) * copies
    if count > MOST_TRIANGLES:
        raise InputError(
            f"scene.subdivided={subdivided} and scene.copies={copies} make {count:,} triangles or more of "
            f"{scene.name}, expected at most {MOST_TRIANGLES:,}"
        )
    if subdivided == 0 and copies == 1:
        return scene
    mesh = scene.mesh
    vertices, faces = mesh.vertices, mesh.faces.astype(np.int64)
    for _ in range(subdivided):
        vertices, faces = _subdivided(vertices, faces)
    shifts = _places(copies) @ _steps(mesh.bounds)
    many = (vertices[None] + shifts[:, None].astype(np.float32)).reshape(-1, 3)
    own = faces[None] + (np.arange(copies) * len(vertices))[:, None, None]
    return replace(scene, mesh=Mesh(many, own.reshape(-1, 3).astype(np.uint32), mesh.name))


def _subdivided(
    vertices: NDArray[np.float32], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Each face as four; neighbours share the vertex in the middle of their edge, so no ray slips through."""
    a, b, c = faces.T
    ends = np.sort(np.stack([[a, b], [b, c], [c, a]]), axis=1)  # (edge, end, face)
    edges, middles = np.unique(ends[:, 0] * len(vertices) + ends[:, 1], return_inverse=True)
    low, high = np.divmod(edges, len(vertices))
    between = 0.5 * vertices[low] + 0.5 * vertices[high]
    ab, bc, ca = middles.reshape(3, -1) + len(vertices)
    four = np.stack([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]])  # (part, corner, face)
    return np.concatenate([vertices, between]), four.transpose(2, 0, 1).reshape(-1, 3)


def _places(copies: int) -> NDArray[np.int64]:
    """(copies, 2): columns and rows of a square as small as holds so many, the nearest to (0, 0) first."""
    side = int(np.ceil(np.sqrt(copies)))
    line = np.arange(side) - side // 2
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    return grid[np.argsort((grid**2).sum(axis=1), kind="stable")][:copies]


def _steps(bounds: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, 3): from one copy to the next, along the longest extent and the second longest, a little apart."""
    extents = np.ptp(bounds, axis=0)
    return np.diag(1.01 * extents)[np.argsort(-extents, kind="stable")[:2]]


def scene_is_available(source: SceneSource, name: str | None) -> bool:
    """Whether `load_scene` would find this scene; nothing is loaded, so its file may still prove unusable.

    True for every scene=file: its path is the user's word, and loading says what is wrong with it.
    Raises InputError when ATRA_SCENES names no folder: that is a mistake to mend, not a scene to do without.
    """
    if source is SceneSource.file:
        return True
    if name is None:
        return False
    if source is SceneSource.directory:
        from scenes.directory import find_scene_folder

        return find_scene_folder(name) is not None
    if source is SceneSource.generated:
        return True
    return name in (BUILT_IN if source is SceneSource.procedural else package_scenes())


def replace_missing_scenes(scenes: Iterable[NamedScene]) -> list[str]:
    """Put its stand-in in place of each of the paper's scenes that is not on this machine; other scenes stay.

    Changes the configurations given, where a scene may come many times. Returns one note for people per scene replaced.
    """
    notes: dict[str, str] = {}
    for scene in scenes:
        stand_in = stand_in_for(scene.name)
        if stand_in is not None and not scene_is_available(scene.source, scene.name):
            notes[str(scene.name)] = f"{scene.name} is not on this machine; {stand_in}, its stand-in, is not that scene"
            scene.name, scene.source = stand_in, SceneSource.procedural
    return list(notes.values())
