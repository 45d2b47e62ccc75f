"""A bake's tables for kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.hits import read_only
from atra.light.lightmaps.charts.texels import Texels
from atra.light.lightmaps.gather import tables_kernels as words
from atra.light.lightmaps.gather.grid import light_grid, uniform_grid
from atra.light.lightmaps.gather.lights import aims_at_emitters, aims_at_sky, light_rows
from atra.light.lightmaps.gather.tables_kernels import Tables
from atra.light.lightmaps.options import BakeOptions
from atra.light.lightmaps.surface import BakeScene
from atra.light.lights import light_from
from atra.light.tables import sky_tables, unit_normals

_START_OFF = 1e-5
_START_OFF_SPACINGS = 2.0

_WAYS = {"mis": words.GIVES_BOTH, "light": words.GIVES_LIGHT, "bsdf": words.GIVES_BSDF}


def start_off(mesh: Mesh) -> float:
    """How far rays start off the surfaces of a mesh, scene units: 1e-5 of the mesh's size, or 2 float32 spacings at its
    largest coordinate if that is more.

    Float32 rounds origins by up to half a spacing along each axis, 0.87 along a normal. With a smaller offset a ray
    could start on or behind its surface and hit it.
    """
    mesh = mesh.local
    spacing = float(np.spacing(np.abs(mesh.bounds).max().astype(np.float32)))
    return max(_START_OFF * float((mesh.bounds[1] - mesh.bounds[0]).max()), _START_OFF_SPACINGS * spacing)


def tables_of(scene: BakeScene, texels: Texels, options: BakeOptions) -> Tables:
    """The tables of a scene, around its mesh's origin. Raises InputError for light that float32 cannot hold."""
    mesh, surface = scene.mesh.local, scene.surface
    assert surface is not None
    normals = unit_normals(mesh)
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    emitters, of_emitters = aims_at_emitters(surface.emission, corners)
    of_sky = aims_at_sky(scene.sky) if options.environment != "bsdf" else None
    sky_by = words.GIVES_BSDF if of_sky is None else _WAYS[options.environment]
    others = [of_emitters.row] * (len(emitters) > 0) + ([of_sky.row] if of_sky is not None else [])
    lights = light_rows(tuple(light_from(light, scene.mesh.origin) for light in scene.lights), others)
    grid = light_grid(lights, mesh.bounds) if options.lights == "grid" and len(lights) else uniform_grid()
    sky, panorama = sky_tables(scene.sky, scene.sky.power)
    if not (np.isfinite(sky).all() and np.isfinite(panorama).all()):
        raise InputError("the sky times its power is beyond what float32 can hold; make it darker")
    offset = start_off(mesh)
    arrays: Any = (
        np.column_stack([normals, np.einsum("fi,fi->f", normals, corners[:, 0])]),
        mesh.vertices,
        mesh.faces,
        texels.atlas.uv,
        surface.albedo,
        surface.emission,
        surface.opacity,
        surface.tint,
        emitters,
        of_emitters.shares,
        of_emitters.density,
        lights,
        *grid,
        sky,
        panorama,
        np.zeros(0) if of_sky is None else of_sky.shares,
        np.zeros((1, 1), np.float32) if of_sky is None else of_sky.density,
        np.packbits(surface.panes, bitorder="little"),
        _box(corners[surface.panes], 0.1 * offset),  # rays that leave a pane start outside
    )
    numbers = (np.float64(offset), texels.atlas.width, np.float32(options.open_length), sky_by, np.uint32(options.seed))
    every: Any = (*(read_only(np.ascontiguousarray(array)) for array in arrays), *numbers)
    return Tables(*every)


def _box(corners: NDArray[np.float64], room: float) -> NDArray[np.float32]:
    """(2, 3), a box around corners (N, 3, 3) with margin `room`; zeros without corners."""
    if not len(corners):
        return np.zeros((2, 3), np.float32)
    return np.stack([corners.min(axis=(0, 1)) - room, corners.max(axis=(0, 1)) + room]).astype(np.float32)
