"""Generated scenes: families of any size from a thousand to a hundred million triangles, equal on every machine.

`scene=generated_terrain scene.triangles=1e5` on the command line; `generated_scene("terrain", 100_000)` in Python.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from scenes.generated import bodies, land
from scenes.scene import Scene, upright_camera

LEAST, MOST = 100, 10**8
"""Triangles that a generated scene may be asked for."""


@dataclass(frozen=True)
class Family:
    """make: how many triangles -> vertices and faces, at most so many but for the smallest scenes. camera: as of
    `scenes.scene.Scene`, good for all sizes."""

    make: Callable[[int], land.Triangles]
    camera: dict[str, Any]


FAMILIES = {
    "terrain": Family(land.terrain, upright_camera((-46.0, 20.0, 44.0), (0.0, 4.0, 0.0), 50.0)),
    "city": Family(land.city, upright_camera((-52.0, 22.0, -47.0), (0.0, 2.0, 0.0), 50.0)),
    "forest": Family(land.forest, upright_camera((0.0, 1.75, 0.0), (10.0, 2.5, 7.0), 60.0)),
    "needles": Family(bodies.needles, upright_camera((0.5, 0.75, 3.5), (0.0, 0.0, 0.0), 40.0)),
    "shells": Family(bodies.shells, upright_camera((1.0, 1.5, 2.75), (0.0, 0.0, 0.0), 35.0)),
    "soup": Family(bodies.soup, upright_camera((0.5, 0.75, 3.5), (0.0, 0.0, 0.0), 40.0)),
    "spheres": Family(bodies.spheres, upright_camera((0.5, 0.75, 3.5), (0.0, 0.0, 0.0), 40.0)),
}
"""By name, in the order of tables."""


def generated_scene(family: str, triangles: int) -> Scene:
    """A scene of this family with about so many triangles. Raises InputError for an unknown family, and for fewer than
    `LEAST` or more than `MOST`."""
    if family not in FAMILIES:
        raise InputError(f"unknown generated scene {family!r}, expected one of {', '.join(FAMILIES)}")
    if not LEAST <= triangles <= MOST:
        raise InputError(f"{triangles:,} triangles of {family} are asked for, expected {LEAST:,} to {MOST:,}")
    name = f"{family}_{triangles}"
    vertices, faces = FAMILIES[family].make(triangles)
    mesh = Mesh(vertices.astype(np.float32), faces.astype(np.uint32), name)
    return Scene(name, mesh, dict(FAMILIES[family].camera))


def named_scene(name: str) -> Scene:
    """The scene called as `generated_scene` names it, such as "terrain_100000". Raises InputError for another name."""
    family, _, triangles = name.rpartition("_")
    if not triangles.isdecimal():
        raise InputError(f"unknown generated scene {name!r}, expected a family and triangles such as terrain_100000")
    return generated_scene(family, int(triangles))
