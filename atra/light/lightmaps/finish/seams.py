"""Gutters filled from the nearest lit texels, and seams between charts matched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.charts.texels import Texels
from atra.light.tables import unit_normals

SMOOTH = np.cos(np.radians(10.0))
"""Cosine of the largest angle between triangles whose light is matched; across sharper edges light may differ."""

_FAITHFUL = 0.05
"""Cost of changing a texel, relative to the cost of a step at a seam."""

_PER_TEXEL = 2.0
"""Points compared per texel of a seam."""


def dilated(texels: Texels, values: NDArray[np.float32], valid: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(H, W, C) float32: (N, C) values of texels; gutters and texels that are not `valid`, (N,), take the nearest valid
    value of the same map, or 0 without any."""
    atlas, image = texels.atlas, np.zeros_like(texels.image(values))
    row, column = np.divmod(texels.number, atlas.width)
    on_map, row = np.divmod(row, atlas.map_height)
    for number, part in enumerate(np.split(image, atlas.maps)):
        known = np.flatnonzero(valid & (on_map == number))
        if len(known):
            part[:] = values[known][nearest_known((row[known], column[known]), part.shape[:2])]
    return image


def nearest_known(place: tuple[NDArray[np.int64], ...], shape: tuple[int, ...]) -> NDArray[np.int64]:
    """(H, W), for each place of an image the number of the nearest known one. place: rows and columns of the known, at
    least one."""
    from scipy.ndimage import distance_transform_edt

    number = np.full(shape, -1)
    number[place] = np.arange(len(place[0]))
    rows, columns = distance_transform_edt(number < 0, return_distances=False, return_indices=True)
    return np.asarray(number[rows, columns])


@dataclass(frozen=True, eq=False)
class Seams:
    """Points on edges where two charts meet, and the texels that interpolation reads on either side.

    texel: (2, P, 4) int64, numbers on the map. weight: (2, P, 4) float64, summing to 1.
    """

    texel: NDArray[np.int64]
    weight: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: Mesh, atlas: Atlas) -> Seams:
        """Find edges that two triangles share, whose UVs differ and whose normals differ by less than 10 degrees."""
        ends, face = _seam_edges(mesh, atlas)
        points, edge = _along(ends)
        texel, weight = [], []
        for side in (0, 1):
            rows, columns, fy, fx = atlas.texels_around(points[side], face[side][edge])
            texel.append(np.stack([row * atlas.width + column for row in rows for column in columns], axis=1))
            weight.append(np.stack([v * u for v in (1.0 - fy, fy) for u in (1.0 - fx, fx)], axis=1))
        return cls(np.array(texel), np.array(weight))

    def values(self, image: NDArray[np.floating]) -> NDArray[np.float64]:
        """(2, P, C): an (H, W, C) image interpolated on both sides."""
        flat = image.reshape(-1, image.shape[2]).astype(np.float64)
        return np.einsum("spk,spkc->spc", self.weight, flat[self.texel])

    def step(self, image: NDArray[np.floating]) -> float:
        """Root mean square difference of the two sides; 0 without seams."""
        sides = self.values(image)
        return float(np.sqrt(((sides[0] - sides[1]) ** 2).mean())) if sides.size else 0.0

    def stitched(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """The (H, W, C) image closest to this one, by least squares, whose seams match."""
        if not self.texel.size:
            return image
        from scipy.sparse import coo_matrix, identity
        from scipy.sparse.linalg import cg

        used, place = np.unique(self.texel, return_inverse=True)
        place = place.reshape(self.texel.shape)
        points = np.broadcast_to(np.arange(self.texel.shape[1])[:, None], self.texel.shape[1:])
        signed = np.concatenate([self.weight[0].ravel(), -self.weight[1].ravel()])
        where = np.concatenate([points.ravel()] * 2), np.concatenate([place[0].ravel(), place[1].ravel()])
        across = coo_matrix((signed, where), (self.texel.shape[1], len(used))).tocsr()
        matrix = (across.T @ across + _FAITHFUL * identity(len(used))).tocsr()
        flat = image.reshape(-1, image.shape[2]).copy()
        for channel in range(flat.shape[1]):
            start = flat[used, channel].astype(np.float64)
            solved, _ = cg(matrix, _FAITHFUL * start, x0=start, rtol=1e-6, maxiter=2000)
            flat[used, channel] = np.maximum(solved, 0.0) if (start >= 0.0).all() else solved
        return flat.reshape(image.shape)


def _seam_edges(mesh: Mesh, atlas: Atlas) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(2, E, 2, 2), the ends of every seam edge on the map in both triangles, in the same order; and (2, E), these
    triangles."""
    _, place = np.unique(mesh.local_vertices + np.float32(0.0), axis=0, return_inverse=True)  # -0.0 becomes 0.0
    corner = place.reshape(-1)[mesh.faces]
    face = np.tile(np.arange(mesh.triangle_count), 3)
    ends = np.stack([corner.T.reshape(-1), np.roll(corner, -1, axis=1).T.reshape(-1)])
    at = np.stack([uv.swapaxes(0, 1).reshape(-1, 2) for uv in (atlas.uv, np.roll(atlas.uv, -1, axis=1))])
    turned = ends[0] > ends[1]
    ends[:, turned], at[:, turned] = ends[::-1, turned], at[::-1, turned]
    keep = np.flatnonzero((ends[0] != ends[1]) & np.isfinite(at[0]).all(axis=1))
    order = keep[np.lexsort((ends[1, keep], ends[0, keep]))]
    starts = np.flatnonzero((np.diff(ends[:, order], prepend=-1) != 0).any(axis=0))
    pairs = starts[np.diff(starts, append=len(order)) == 2]
    sides = order[[pairs, pairs + 1]]
    normals = unit_normals(mesh)
    smooth = np.einsum("ni,ni->n", *normals[face[sides]]) > SMOOTH
    apart = np.abs(at[:, sides[0]] - at[:, sides[1]]).max(axis=(0, 2)) > 1e-6
    sides = sides[:, smooth & apart]
    return at[:, sides].transpose(1, 2, 0, 3), face[sides]


def _along(ends: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(2, P, 2), points on the edges, dense enough to reach every texel; and (P,), the edge of each."""
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=0)
    count = np.ceil(_PER_TEXEL * length).astype(int) + 1
    edge = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    share = ((step + 0.5) / count[edge])[:, None]
    return (1.0 - share) * ends[:, edge, 0] + share * ends[:, edge, 1], edge
