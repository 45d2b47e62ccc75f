"""Scenes from files, which need not be trusted."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from atra.errors import InputError
from atra.files.meshes.loading import load_mesh
from atra.light.materials import Lambertian
from atra.light.reading.gltf import read_gltf
from atra.light.reading.obj import read_obj
from atra.light.scene import Scene
from atra.light.sky import NEUTRAL, constant_sky

_READERS = {".gltf": read_gltf, ".glb": read_gltf, ".obj": read_obj}


def load_scene(path: str | Path, *, memory_per_byte: float | None = None, **others: Any) -> Scene:
    """Read a file with its materials, textures, lights and cameras.

    path: glTF, GLB, or OBJ with its MTL; of other formats that `atra.load_mesh` reads, the triangles in grey. Materials
    become `MetallicRoughness`; an MTL's colours are taken as linear, as by Cycles. Triangles of all nodes of a glTF's
    default scene are joined; `parts` tells where each came from. Light intensities in candela and lux become powers
    (divided by pi). memory_per_byte: as for `atra.load_mesh`.
    others: further fields of the scene, such as `sky`, which no file has; without one, a file with lights stands in the
    dark, and others under a neutral sky.

    What is not read is named once, in a warning and in `left_out`; images larger than 4,096 a side are made smaller.
    Raises InputError naming the file: for damage, required extensions that are not read, files of a glTF named
    outside its folder (of an OBJ, those of the same name beside it are read), nodes in a cycle, and more memory than
    allowed.

    Examples
    --------
    >>> from atra import light
    >>> scene = light.load_scene("room.glb")  # doctest: +SKIP
    >>> list(scene.cameras), scene.left_out  # doctest: +SKIP
    (['front'], ())
    """
    path = Path(path).expanduser()
    if not path.is_file():
        raise InputError(f"{path} is no file, expected a scene")
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        grey = [Lambertian((0.7, 0.7, 0.7))]
        return Scene(load_mesh(path, memory_per_byte=memory_per_byte), grey, **({"sky": NEUTRAL} | others))
    try:
        fields = reader(path, memory_per_byte)
        sky = constant_sky(0.0) if (fields | others).get("lights") else NEUTRAL
        scene = Scene(**({"sky": sky} | fields | others))
    except Exception as error:  # a reader of damaged bytes may raise anything
        reason = str(error).strip() or type(error).__name__
        raise InputError(f"{path} cannot be read as {path.suffix.lower()[1:]}: {reason}") from None
    told = ["; ".join(scene.mesh.notes), f"not used: {'; '.join(scene.left_out)}" * bool(scene.left_out)]
    if any(told):
        warnings.warn(f"{path.name}: {'; '.join(filter(None, told))}", stacklevel=2)
    return scene
