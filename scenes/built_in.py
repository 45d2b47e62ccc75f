"""Scenes made by code: the Cornell box, needles, a closed solid, balls, and stand-ins for the paper's larger scenes.

Stand-ins have as many triangles, and let every figure be made offline. They are not the paper's scenes: what is
measured on them must say so and is never compared with the paper's numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from scenes.atrium import ATRIUM_CAMERA, atrium
from scenes.cornell_box import CORNELL_BOX_CAMERA, cornell_box, cornell_box_boxes, cornell_box_walls
from scenes.lit.weekend import WEEKEND_CAMERA, weekend
from scenes.living_room import LIVING_ROOM_CAMERA, living_room
from scenes.material_ball import MATERIAL_BALL_CAMERA, material_ball
from scenes.scene import Scene, camera_fields
from scenes.special import NEEDLES_CAMERA, THREE_HOLES_CAMERA, needles, three_holes


@dataclass(frozen=True)
class BuiltIn:
    """make: returns equal meshes at every call. camera, stands_for: as of `scenes.scene.Scene`."""

    make: Callable[[], Mesh]
    camera: dict[str, Any]
    stands_for: str | None = None


BUILT_IN = {
    "cornell_box": BuiltIn(cornell_box, CORNELL_BOX_CAMERA),
    "cornell_box_walls": BuiltIn(cornell_box_walls, CORNELL_BOX_CAMERA),
    "cornell_box_boxes": BuiltIn(cornell_box_boxes, CORNELL_BOX_CAMERA),
    "needles": BuiltIn(needles, NEEDLES_CAMERA),
    "three_holes": BuiltIn(three_holes, THREE_HOLES_CAMERA),
    "weekend": BuiltIn(lambda: weekend().mesh, WEEKEND_CAMERA),
    "material_ball": BuiltIn(material_ball, MATERIAL_BALL_CAMERA, "mitsuba"),
    "living_room": BuiltIn(living_room, LIVING_ROOM_CAMERA, "fireplace_room"),
    "atrium": BuiltIn(atrium, ATRIUM_CAMERA, "sponza"),
}
"""By the name of the scene."""


def make_scene(name: str) -> Scene:
    """The built-in scene of that name. Raises InputError with the known names if there is none."""
    if name not in BUILT_IN:
        raise InputError(f"unknown procedural scene {name!r}, expected one of {', '.join(sorted(BUILT_IN))}")
    made = BUILT_IN[name]
    return Scene(name, made.make(), dict(made.camera), made.stands_for)


def stand_in_for(name: str | None) -> str | None:
    """The name of the stand-in for the paper's scene `name`; None if it has none."""
    return next((own for own, made in BUILT_IN.items() if name is not None and made.stands_for == name), None)


GROUP = "atra.scenes"
"""Group of entry points: `mine = "my_package.scenes:mine"`, which returns a mesh and the fields of a camera."""

PACKAGE_SCENES: dict[str, EntryPoint] = {one.name: one for one in entry_points(group=GROUP)}
"""Scenes of installed packages, by name."""


def package_scene(name: str) -> Scene:
    """The scene of an installed package. Raises InputError for an unknown name, and for a function that fails or
    returns something else."""
    if name not in PACKAGE_SCENES:
        raise InputError(f"no installed package has a scene {name!r}, expected one of {', '.join(PACKAGE_SCENES)}")
    point = PACKAGE_SCENES[name]
    try:
        mesh, camera = point.load()()
    except Exception as error:  # a foreign package may raise anything
        told = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise InputError(f"scene {name} cannot be made by {point.value}, {told}") from error
    if not isinstance(mesh, Mesh):
        raise InputError(f"scene {name} is a {type(mesh).__name__}, expected an atra.Mesh and the fields of a camera")
    return Scene(name, mesh, camera_fields(f"the camera of scene {name!r}", camera))
