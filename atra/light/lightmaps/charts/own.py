"""The charts of a scene: those that its file brings, or new ones."""

from __future__ import annotations

import warnings

import numpy as np

from atra.choices import check_choice
from atra.errors import InputError
from atra.light.checks import checked_number
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.charts.texels import Texels
from atra.light.scene import Scene

CHARTS = ("auto", "file", "xatlas")


def atlas_of(scene: Scene, size: int = 512, charts: str = "auto", texels_per_unit: float = 0.0) -> Atlas:
    """Where the triangles of a scene lie on a lightmap.

    charts: "file", by its second texture coordinates, on one map of `size` texels; "xatlas", as `Atlas.unwrap`; "auto",
    by those of the file if each part has them and none overlap, and otherwise by xatlas, with a warning that says why
    if there are any. texels_per_unit: as for `Atlas.unwrap`, which it implies. Raises InputError for coordinates of the
    file that cannot be used, with the reason, and as `Atlas.unwrap` does.
    """
    check_choice("charts", charts, CHARTS)
    texels_per_unit = checked_number("texels_per_unit", texels_per_unit, 0.0, 1e9)
    if charts == "xatlas" or (charts == "auto" and (texels_per_unit or scene.second_uv is None)):
        return Atlas.unwrap(scene.mesh, size, texels_per_unit=texels_per_unit)
    if texels_per_unit:
        raise InputError(f"charts of the file have a size of their own, but texels_per_unit is {texels_per_unit:g}")
    try:
        return _of_file(scene, size)
    except InputError as error:
        if charts == "file":
            raise
        warnings.warn(f"charts by xatlas, as the file's second uv do not do for a map: {error}", stacklevel=2)
        return Atlas.unwrap(scene.mesh, size)


def _of_file(scene: Scene, size: int) -> Atlas:
    if scene.second_uv is None:
        raise InputError("the file has no second uv (TEXCOORD_1), expected them for charts of the file")
    for part in scene.parts:
        own = scene.second_uv[part.first_vertex : part.first_vertex + part.vertices]
        if not np.ptp(own, axis=0).all():
            raise InputError(f"second uv of {part.name!r} are missing or span no area; expected an area on the map")
    atlas = Atlas.of_uv(scene.second_uv[scene.mesh.faces], size, size)
    with warnings.catch_warnings(action="ignore"):  # given again where they are used
        Texels.of(scene.mesh, atlas)
    return atlas
