"""The texels of a lightmap that get light, and the charts of a scene: those that its file brings, or new ones."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from atra.choices import check_choice
from atra.errors import InputError
from atra.exact.ties_kernels import number_places
from atra.geometry.mesh import Mesh
from atra.light.checks import checked_number
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.charts.texels_kernels import claim_texels, place_texels
from atra.light.lightmaps.charts.unwrap import UNMAPPED
from atra.light.scene import Scene
from atra.light.tables import unit_normals

_FOLDED = 1e-3
"""Share of the texels that may lie in two triangles, as where charts of xatlas fold over by rounding."""


@dataclass(frozen=True, eq=False)
class Texels:
    """The N texels that triangles touch, row by row.

    atlas: the charts. mesh: whose triangles they are. number: (N,) int64, row times width plus column; rows of several
    maps are counted through. prim_id: (N,) int32, the triangle each belongs to. local_positions: (N, 3) float32, the
    point of the triangle nearest to the texel's centre, around the mesh's origin. normals: (N, 3) float32, unit, there.
    faces_lost: triangles without area, in space or on the map, which get no texel. A texel belongs to the triangle that
    contains its centre, or else to the nearest that reaches into it, the lowest on ties.
    """

    atlas: Atlas
    mesh: Mesh
    number: NDArray[np.int64] = field(repr=False)
    prim_id: NDArray[np.int32] = field(repr=False)
    local_positions: NDArray[np.float32] = field(repr=False)
    normals: NDArray[np.float32] = field(repr=False)
    faces_lost: int

    def __len__(self) -> int:
        return len(self.number)

    @property
    def chart(self) -> NDArray[np.int32]:
        """(N,) int32, each texel's chart."""
        return self.atlas.chart[self.prim_id]

    @cached_property
    def positions(self) -> NDArray[np.floating]:
        """(N, 3) float32, `local_positions` in world space; float64 for a mesh with an origin."""
        return self.local_positions + self.mesh.origin if self.mesh.has_origin else self.local_positions

    @cached_property
    def along_curve(self) -> NDArray[np.int32]:
        """(N,) int32, the texels along a Morton curve through the scene; neighbours on it tend to see the same."""
        places, (lowest, highest) = np.empty(len(self), np.int64), self.mesh.local.bounds
        number_places(self.local_positions, lowest, highest - lowest, places)
        return np.argsort(places, kind="stable").astype(np.int32)

    @property
    def map_of(self) -> NDArray[np.int64]:
        """(N,), each texel's map."""
        return self.number // (self.atlas.width * self.atlas.map_height)

    @property
    def occupancy(self) -> float:
        """The fraction of the maps' texels that get light."""
        return len(self) / (self.atlas.width * self.atlas.height)

    def image(self, values: NDArray, empty: float = 0) -> NDArray:
        """(H, W, ...) image of (N, ...) values, several maps stacked vertically; `empty` elsewhere."""
        atlas = self.atlas
        image = np.full((atlas.height * atlas.width, *values.shape[1:]), empty, values.dtype)
        image[self.number] = values
        return image.reshape(atlas.height, atlas.width, *values.shape[1:])

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """(H, W) bool: texels that get light."""
        return self.image(np.ones(len(self), np.bool_))

    @classmethod
    def of(cls, mesh: Mesh, atlas: Atlas) -> Texels:
        """The texels of a mesh's charts.

        Warns of charts so close that interpolation between texels would mix them, and of overlapping triangles, naming
        the first two and the number of texels. Raises InputError where that is more than one of a thousand, for an
        atlas of another mesh, and if no triangle touches a texel.
        """
        if len(atlas.uv) != mesh.triangle_count:
            raise InputError(f"the atlas has {len(atlas.uv)} triangles, but {mesh!r} is to be lit; unwrap that mesh")
        uv = atlas.uv.copy()
        uv[mesh.without_area] = np.nan
        prim_of = np.full((atlas.height, atlas.width), -1, np.int32)
        distance = np.full(prim_of.shape, np.inf)
        overlap = np.zeros(3, np.int64)
        claim_texels(uv, prim_of, distance, overlap)
        number = np.flatnonzero(prim_of.ravel() >= 0)
        if overlap[0]:
            count, first, second = overlap.tolist()
            told = f"faces {first} and {second} overlap in the map, in {count} texels together with others"
            if count > _FOLDED * len(number):
                raise InputError(f"{told}; expected separate places; give other uv, or let Atlas.unwrap make charts")
            warnings.warn(f"{told}; each such texel has the light of one of them", stacklevel=2)
        if not len(number):
            raise InputError(f"no triangle of {mesh!r} touches a texel, expected at least one")
        _warn_of_neighbours(atlas, prim_of)
        prim_id = prim_of.ravel()[number]
        positions, normals = np.empty((2, len(number), 3), np.float32)
        place_texels(
            uv, mesh.local_vertices, mesh.faces, unit_normals(mesh), number, atlas.width, prim_id, positions, normals
        )
        lost = int((atlas.chart == UNMAPPED).sum() + len(mesh.without_area))
        edges = uv[:, 1:] - uv[:, :1]
        lost += int((edges[:, 0, 0] * edges[:, 1, 1] == edges[:, 0, 1] * edges[:, 1, 0]).sum())
        return cls(atlas, mesh, number, prim_id, positions, normals, lost)


def _warn_of_neighbours(atlas: Atlas, prim_of: NDArray[np.int32]) -> None:
    of_texel = np.where(prim_of >= 0, atlas.chart[prim_of], UNMAPPED).reshape(atlas.maps, -1, atlas.width)
    mixed = 0
    for there, here in (
        (np.s_[:, 1:], np.s_[:, :-1]), (np.s_[..., 1:], np.s_[..., :-1]),
        (np.s_[:, 1:, 1:], np.s_[:, :-1, :-1]), (np.s_[:, 1:, :-1], np.s_[:, :-1, 1:]),
    ):  # fmt: skip
        a, b = of_texel[there], of_texel[here]
        mixed += int(((a != b) & (a != UNMAPPED) & (b != UNMAPPED)).sum())
    if mixed:
        warnings.warn(
            f"{mixed} pairs of neighbouring texels belong to different charts: interpolation mixes their light; "
            "leave at least two texels between charts",
            stacklevel=3,
        )


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
