"""Layers of a picture: what its pixels see first, for denoisers and for further work."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from atra.light.batches import in_batches
from atra.light.materials import plain_of
from atra.light.pictures.film import Film
from atra.light.pictures.gbuffer_kernels import new_chunk
from atra.light.pictures.lighting_kernels import LAYER_PLANES, layers_kernel
from atra.light.pictures.path_kernels import BLOCK, Pixels
from atra.light.scene import Scene
from atra.light.sky import constant_sky
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import KernelScene, Query
from atra.views.sampling import sub_pixel_offsets

Offset = tuple[float, float]

_POINTS = 16
"""Points of a pixel that layers are averaged over."""


@dataclass(frozen=True, eq=False)
class Layers:
    """What pixels see first, averaged over their area; a denoiser keeps the edges in it.

    albedo: (H, W, 3) float32, linear RGB, the base colour; 1 for the sky. normals: (H, W, 3) float32, of the surface as
    it is shaded, in the world, facing the eye; shorter than 1 where a pixel sees several; 0 for the sky.
    """

    albedo: NDArray[np.float32]
    normals: NDArray[np.float32]


def layers_of(scene: Scene, size: tuple[int, int], rays: KernelScene, seen_at: Callable[[Offset], Pixels]) -> Layers:
    """Layers of an image. size: its width and height. rays: the scene's. seen_at: what all pixels see at a sub-pixel
    offset."""
    plain = tuple(plain_of(material) for material in scene.materials)
    surfaces = surfaces_of(replace(scene, materials=plain, lights=(), sky=constant_sky(1.0)), 1.0)
    film = Film((LAYER_PLANES, *size))
    kernel, chunks = layers_kernel(rays.packet_width), [new_chunk() for _ in range(rays.threads)]
    for number, offset in enumerate(sub_pixel_offsets(_POINTS).tolist()):
        pixels = seen_at(tuple(offset))._replace(sample=number)

        def add(query: Query, first: int, count: int, pixels: Pixels = pixels) -> int:
            kernel(first, count, pixels, surfaces, query.scene, query.packet, chunks[query.worker], film.sums)
            return 0

        in_batches(rays, size[0] * size[1], BLOCK, add)
        film.end_sample()
    return Layers(*(film.as_image(film.mean(slice(first, first + 3))) for first in (0, 3)))
