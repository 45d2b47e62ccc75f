"""Scenes made by code: the Cornell box, needles, a closed solid, balls, and stand-ins for the paper's larger scenes.

Stand-ins have as many triangles, and let every figure be made offline. They are not the paper's scenes: what is
measured on them must say so and is never compared with the paper's numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pkgutil import resolve_name
from typing import Any

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from scenes.scene import Scene, camera_fields


@dataclass(frozen=True)
class BuiltIn:
    """module: where it is defined, imported when it is needed. function, view: names there, of `make` and `camera`.
    stands_for: as of `scenes.scene.Scene`."""

    module: str
    function: str
    view: str
    stands_for: str | None = None

    @property
    def make(self) -> Callable[[], Mesh]:
        """A function that returns equal meshes at every call."""
        return resolve_name(f"{self.module}:{self.function}")  # type: ignore[no-any-return]

    @property
    def camera(self) -> dict[str, Any]:
        """As of `scenes.scene.Scene`."""
        return resolve_name(f"{self.module}:{self.view}")  # type: ignore[no-any-return]


BUILT_IN = {
    "cornell_box": BuiltIn("scenes.cornell_box", "cornell_box", "CORNELL_BOX_CAMERA"),
    "cornell_box_walls": BuiltIn("scenes.cornell_box", "cornell_box_walls", "CORNELL_BOX_CAMERA"),
    "cornell_box_boxes": BuiltIn("scenes.cornell_box", "cornell_box_boxes", "CORNELL_BOX_CAMERA"),
    "needles": BuiltIn("scenes.special", "needles", "NEEDLES_CAMERA"),
    "three_holes": BuiltIn("scenes.special", "three_holes", "THREE_HOLES_CAMERA"),
    "weekend": BuiltIn("scenes.lit.weekend", "weekend_mesh", "WEEKEND_CAMERA"),
    "material_ball": BuiltIn("scenes.material_ball", "material_ball", "MATERIAL_BALL_CAMERA", "mitsuba"),
    "living_room": BuiltIn("scenes.living_room", "living_room", "LIVING_ROOM_CAMERA", "fireplace_room"),
    "atrium": BuiltIn("scenes.atrium", "atrium", "ATRIUM_CAMERA", "sponza"),
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


@cache
def package_scenes() -> dict[str, EntryPoint]:
    """Scenes of installed packages, by name."""
    return {one.name: one for one in entry_points(group=GROUP)}


def package_scene(name: str) -> Scene:
    """The scene of an installed package. Raises InputError for an unknown name, and for a function that fails or
    returns something else."""
    known = package_scenes()
    if name not in known:
        raise InputError(f"no installed package has a scene {name!r}, expected one of {', '.join(known)}")
    point = known[name]
    try:
        mesh, camera = point.load()()
    except Exception as error:  # a foreign package may raise anything
        told = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise InputError(f"scene {name} cannot be made by {point.value}, {told}") from error
    if not isinstance(mesh, Mesh):
        raise InputError(f"scene {name} is a {type(mesh).__name__}, expected an atra.Mesh and the fields of a camera")
    return Scene(name, mesh, camera_fields(f"the camera of scene {name!r}", camera))
