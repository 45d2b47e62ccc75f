"""Path tracing: paths followed from the eye, scattered by materials, to the sky and to emitters."""

from __future__ import annotations

from dataclasses import replace
from itertools import count as count_from
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.light.emitters.emitters_kernels import has_emitters
from atra.light.emitters.tables import emitters_of, no_emitters
from atra.light.laps import Laps
from atra.light.pictures.hybrid import albedo_of
from atra.light.pictures.options import PathOptions
from atra.light.pictures.path_kernels import BLOCK, FREE_ROWS, ROW_PADDING, Pixels
from atra.light.pictures.paths.depth_first_kernels import ALPHA, follow_depth_first
from atra.light.pictures.paths.following_kernels import Limits
from atra.light.pictures.paths.tracing import Batches, MakeScene, Packets
from atra.light.pictures.paths.waves_kernels import (
    PATH_ROWS,
    Paths,
    compact,
    generate,
    shade,
)
from atra.light.pictures.renderer import Primary, Renderer
from atra.light.scene import Scene
from atra.light.surface_kernels import HOLES, Surfaces
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import Query


class PathRenderer(Renderer):
    """Pictures by path tracing.

        with atra.light.PathRenderer(scene, camera, max_depth=8) as renderer:
            renderer.add(64)
            renderer.save("picture.png")

    Each sample traces one path per pixel. It ends at the sky, at an `Emissive` surface, dark after `max_depth` rays, or
    by chance where little of its light is left (option `roulette`). From every surface but mirrors another ray is aimed
    at an emitter (option `lights`): a triangle that shines, a panorama, or one of the scene's lights. Random numbers
    are Sobol' points, scrambled for each pixel and bounce. Stages: primary and depth_first; for waves primary,
    generate, trace, compact (which also sums up light), connect and shade.

    Parameters
    ----------
    scene, camera, primary :
        As for `Renderer`.
    rays : optional
        Function from the mesh to a `BatchScene`, which takes a wave of `order="waves"` as one batch. Scenes with holes
        are refused, and clear glass stops its rays to lamps.
    threads, packet_width, build_quality, robust :
        Of the scene for all rays but the primary ones, as for `atra.PixelTracer`.
    jitter : {"shared", "off", "pixel"}
        Sub-pixel offset of rays: one for all pixels, new for each sample; the centre; or one per pixel, whose rays the
        renderer traces itself.
    wave_rays : int
        Pixels (rays in waves) that a thread takes at a time, a multiple of 2,048.
    start_off : float, optional
        Offset of rays from the triangle they leave, scene units (default: as far as float32 needs).
    most_samples : int, optional
        Most samples of a picture (default: any number).
    max_depth : int
        Most rays of a path, the primary ray included.
    lights : {"aimed", "found"}
        How emitters are found: a ray from every surface but mirrors is aimed at one, and both ways share its light; or
        by scattered rays alone, which never meet lamps without extent.
    roulette : int
        Rays after which a path may end by chance, the likelier the less light it carries.
    order : {"depth_first", "waves"}
        One path after the other, or many paths stage by stage, with times of stages.
    transparent : bool
        The eye does not see the sky; what is saved has an alpha channel, also through holes and panes.

    Raises
    ------
    InputError
        For an option's value.
    """

    options: PathOptions

    def __init__(
        self,
        scene: Scene,
        camera: View,
        primary: Primary | None = None,
        rays: MakeScene | None = None,
        *,
        threads: int | None = None,
        packet_width: int | None = None,
        build_quality: str = "medium",
        robust: bool = True,
        jitter: str = "shared",
        wave_rays: int = 8 * BLOCK,
        start_off: float | None = None,
        most_samples: int | None = None,
        max_depth: int = 5,
        lights: str = "aimed",
        roulette: int = 4,
        order: str = "depth_first",
        transparent: bool = False,
    ) -> None:
        options = PathOptions(
            threads, packet_width, build_quality, robust, jitter, wave_rays, start_off, most_samples,
            max_depth, lights, roulette, order, transparent,
        )  # fmt: skip
        self._make_scene = rays
        super().__init__(scene, camera, primary, options)

    @property
    def _planes(self) -> int:
        return ALPHA + 1 if self.options.transparent else ALPHA

    def _new_rays(self, mesh: Mesh) -> Any:
        if self._make_scene is None:
            return super()._new_rays(mesh)
        if self.options.order != "waves":
            raise InputError(f"order is {self.options.order!r} with rays given, expected 'waves'")
        return Batches(self._make_scene(mesh))

    def _ray_options(self) -> PathOptions:
        return self.options if self.options.order == "waves" else replace(self.options, packet_width=1)

    def _tables(self) -> Surfaces:
        self._emitters = emitters_of(self.scene) if self.options.lights == "aimed" else no_emitters()
        surfaces = surfaces_of(self.scene, self.scene.sky.power, self.options.start_off)
        if isinstance(self.rays, Batches) and (surfaces.flags & HOLES).any():
            name = type(self.rays.scene).__name__
            raise InputError(f"{name} traces no scene with holes, expected none; leave out rays=")
        return surfaces

    def _same_sums(self, scene: Scene) -> bool:
        return scene is self.scene

    def _start_film(self) -> None:
        super()._start_film()
        self._waves: list[Paths | None] = [None] * self.rays.threads

    def _mean(self) -> NDArray[np.float64]:
        return self._film.mean(slice(3))

    @property
    def alpha(self) -> NDArray[np.float32] | None:
        """(H, W), the share of each pixel that is not sky; None without `transparent`. Raises InputError without
        samples."""
        if not self.options.transparent:
            return None
        with self._lock:
            return self._film.as_image(self._film.mean(slice(ALPHA, ALPHA + 1)))[..., 0]

    def _albedo(self, samples: int) -> NDArray[np.float32]:
        return albedo_of(self, samples)

    def _add_wave(self, first: int, count: int, pixels: Pixels, query: Query, stages: dict[str, float]) -> int | None:
        surfaces, emitters, options = self._surfaces, self._emitters, self.options
        lap = Laps(stages)
        if options.order == "depth_first":
            free = np.empty((FREE_ROWS, 1), np.float32)
            arguments = pixels, query.scene, query.packet, surfaces, emitters, self._film.sums, free
            rays = follow_depth_first(first, count, *arguments, Limits(options.max_depth, options.roulette))
            lap("depth_first")
            return None if rays < 0 else rays
        paths = self._waves[query.worker]
        if paths is None:
            paths = self._waves[query.worker] = _new_paths(options.wave_rays // BLOCK)
        assert surfaces is not None
        tracing = self.rays if isinstance(self.rays, Batches) else Packets(query, self.rays.packet_width)
        is_aimed, sample = has_emitters(emitters), pixels.sample
        generate(paths, first, count, pixels)
        lap("generate")
        is_finite, rays = True, 0
        for step in count_from(0):
            if step > 0 or len(pixels.prim_id) == 0:
                rays += tracing.trace(paths)
                lap("trace")
            is_finite &= compact(paths, surfaces, emitters, self._film.sums, sample, step, options.max_depth)
            lap("compact")
            if not paths.counts.any():
                break
            if is_aimed:
                aimed = tracing.connect(paths, surfaces, emitters, sample, self._film.sums)
                rays, is_finite = rays + max(aimed, 0), is_finite and aimed >= 0
                lap("connect")
            shade(paths, surfaces, sample, options.roulette)
            lap("shade")
        return rays if is_finite else None


def _new_paths(blocks: int) -> Paths:
    rays = blocks * BLOCK
    return Paths(
        np.empty((PATH_ROWS, rays + ROW_PADDING), np.float32),
        np.empty(rays, np.uint32),
        np.empty(rays, np.int32),
        np.empty(rays, np.int32),
        np.empty(rays, np.bool_),
        np.zeros(blocks, np.int64),
    )
