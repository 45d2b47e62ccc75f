"""Stand-ins anyone can have: procedural scenes with the triangle counts of the paper's three larger ones.

They let every figure be made offline. They are not the paper's scenes: what is measured on them must say so and is
never compared with the paper's numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from atra.geometry.mesh import Mesh
from scenes.atrium import ATRIUM_CAMERA, atrium
from scenes.living_room import LIVING_ROOM_CAMERA, living_room
from scenes.material_ball import MATERIAL_BALL_CAMERA, material_ball

__all__ = [
    "ATRIUM_CAMERA",
    "LIVING_ROOM_CAMERA",
    "MATERIAL_BALL_CAMERA",
    "STAND_INS",
    "StandIn",
    "atrium",
    "living_room",
    "material_ball",
    "stand_in_for",
]


@dataclass(frozen=True)
class StandIn:
    """make: returns the mesh, the same one at every call. camera: fields of `atra.geometry.camera.Camera`.

    stands_for: name of the scene of the paper, as in the manifest.
    """

    make: Callable[[], Mesh]
    camera: dict[str, Any]
    stands_for: str


STAND_INS = {
    "material_ball": StandIn(material_ball, MATERIAL_BALL_CAMERA, "mitsuba"),
    "living_room": StandIn(living_room, LIVING_ROOM_CAMERA, "fireplace_room"),
    "atrium": StandIn(atrium, ATRIUM_CAMERA, "sponza"),
}
"""By the name of the scene."""


def stand_in_for(name: str) -> str | None:
    """The name of the stand-in for the paper's scene `name`; None if it has none."""
    return next((stand_in for stand_in, made in STAND_INS.items() if made.stands_for == name), None)
