"""Which texels come first: those that a camera sees, on the map that has the fewest samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View
from atra.hits import Hits
from atra.light.lightmaps.charts.texels import Texels
from atra.light.lightmaps.charts.texels_kernels import mark_shown
from atra.rays.kernel_scene import KernelScene

_START_OFF = 1e-5
_START_OFF_SPACINGS = 2.0


def start_off(mesh: Mesh) -> float:
    """How far rays between a texel and the eye stay off both, scene units: 1e-5 of the mesh's size, or 2 float32
    spacings at its largest coordinate if that is more.

    Float32 rounds origins by up to half a spacing along each axis, 0.87 along a normal. With a smaller offset a ray
    could start on or behind its surface and hit it.
    """
    mesh = mesh.local
    spacing = float(np.spacing(np.abs(mesh.bounds).max().astype(np.float32)))
    return max(_START_OFF * float((mesh.bounds[1] - mesh.bounds[0]).max()), _START_OFF_SPACINGS * spacing)


def visible_texels(texels: Texels, hits: Hits, scene: KernelScene) -> NDArray[np.bool_]:
    """(N,) bool: texels in the image and not hidden. Pixels decide for those they show, a ray to the eye for all
    others.

    A texel shared by several triangles is seen where the triangle it belongs to is.
    """
    seen = _shown(texels, hits)
    rest = np.flatnonzero(~seen & _in_image(texels, hits.camera))
    seen[rest[_reach_the_eye(texels, rest, hits.camera, scene)]] = True
    return seen


def _shown(texels: Texels, hits: Hits) -> NDArray[np.bool_]:
    """(N,) bool: the texels that pixels show."""
    atlas, (mesh, camera) = texels.atlas, own_space(texels.mesh, hits.camera)
    eye = np.append(-camera.axes[2], 0.0) if camera.is_parallel else np.append(camera.eye, 1.0)
    shown = np.zeros((atlas.height, atlas.width), np.bool_)
    mark_shown((hits.prim_id, hits.u, hits.v), eye, mesh.vertices, mesh.faces, atlas.uv, shown)
    return shown.ravel()[texels.number]


def _in_image(texels: Texels, camera: View) -> NDArray[np.bool_]:
    points = camera.to_eye_space(texels.positions)
    a, b, c = (points @ camera.to_pixels[:, :3].T + camera.to_pixels[:, 3]).T
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = (a >= 0.0) & (a <= camera.width * c) & (b >= 0.0) & (b <= camera.height * c) & (c > 0.0)
    facing = -camera.axes[2] if camera.is_parallel else -points
    return np.asarray(inside & (points @ camera.axes[2] > 0.0) & ((texels.normals * facing).sum(axis=1) > 0.0))


def _reach_the_eye(texels: Texels, numbers: NDArray[np.int64], camera: View, scene: KernelScene) -> NDArray[np.bool_]:
    if not len(numbers):
        return np.zeros(0, np.bool_)
    points = camera.to_eye_space(texels.positions[numbers])
    if camera.is_parallel:
        depth = points @ camera.axes[2]
        ways = -depth[:, None] * camera.axes[2]
    else:
        ways = -points
    # Rays start and end `start_off` from the texel's plane, and from the eye.
    off = start_off(texels.mesh)
    end = np.maximum(1.0 - off / np.linalg.norm(ways, axis=1), 0.0)
    start = off / (texels.normals[numbers] * ways).sum(axis=1)  # positive, as these texels face the eye
    return ~scene.occluded(points + camera.eye, ways, tnear=np.minimum(start, end), tfar=end)


def on_least_converged_map(texels: Texels, samples: NDArray[np.int32], wanted: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N,) bool: texels of the first map whose wanted texels have the fewest samples on average."""
    if texels.atlas.maps == 1:
        return wanted
    on_map = texels.map_of
    count, total = (np.bincount(on_map[wanted], of_each) for of_each in (None, samples[wanted]))
    means = np.divide(total, count, out=np.full(len(count), np.inf), where=count > 0)
    return np.asarray(on_map == np.argmin(means))
