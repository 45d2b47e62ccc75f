"""A scene: triangles, the view they are shown from, and what is known of where they came from."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh

CAMERA_FIELDS = ("eye", "target", "up", "fov_y_degrees")


Place = tuple[float, float, float]


def upright_camera(eye: Place, target: Place, fov_y_degrees: float) -> dict[str, Any]:
    """Camera fields of a view with y up, in scene units."""
    return {"eye": eye, "target": target, "up": (0.0, 1.0, 0.0), "fov_y_degrees": fov_y_degrees}


@dataclass(frozen=True, eq=False)
class Scene:
    """What loading a scene returns.

    camera: eye, target, up and fov_y_degrees of the scene's own view, fields of `atra.geometry.camera.Camera`.
    stands_for: the scene of the paper that this one replaces without being it.
    picture_restriction: why no picture of it may be published, as one sentence; None = nothing known against it.
    """

    name: str
    mesh: Mesh
    camera: dict[str, Any]
    stands_for: str | None = None
    picture_restriction: str | None = None

    @cached_property
    def mesh_sha256(self) -> str:
        """Hash of the triangles as loaded, so that a changed file never passes for the one measured before."""
        digest = hashlib.sha256()
        for array in (self.mesh.vertices, self.mesh.faces):
            contiguous = np.ascontiguousarray(array)
            digest.update(f"{contiguous.dtype.str} {contiguous.shape} ".encode())
            digest.update(contiguous.tobytes())
        return digest.hexdigest()


def camera_fields(whose: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """All of `CAMERA_FIELDS` from those written down in cameras.json or the manifest, where up and fov_y_degrees may be
    left out.

    Raises InputError, saying whose camera it is, for missing or unknown fields and what `Camera` refuses.
    """
    if not {"eye", "target"} <= set(given) <= set(CAMERA_FIELDS):
        raise InputError(
            f"{whose} has the fields {', '.join(sorted(given)) or 'none'}; "
            "expected eye and target, and optionally up and fov_y_degrees"
        )
    try:
        camera = Camera(**given)
    except InputError as error:
        raise InputError(f"{whose} cannot be used: {error}") from None
    return {name: getattr(camera, name) for name in CAMERA_FIELDS}
