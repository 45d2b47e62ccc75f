"""Path tracing: paths followed from the eye, scattered by materials, to the sky and to emitters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.view import View
from atra.light.emitters.tables import emitters_of, no_emitters
from atra.light.laps import Laps
from atra.light.pictures.options import PathOptions
from atra.light.pictures.path_kernels import FREE_ROWS, Pixels
from atra.light.pictures.paths.depth_first_kernels import ALPHA, follow_depth_first
from atra.light.pictures.paths.following_kernels import limits_of
from atra.light.pictures.renderer import Primary, Renderer
from atra.light.scene import Scene
from atra.light.surface_kernels import Surfaces
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import Query


class PathRenderer(Renderer):
    """Pictures by path tracing.

        with atra.light.PathRenderer(scene, camera, bounces=8) as renderer:
            renderer.add(64)
            renderer.save("picture.png")

    Each sample traces one path per pixel. It ends at the sky, at an `Emissive` surface, dark after `bounces`
    reflections, or by chance where little of its light is left (option `roulette_from`). From every surface but mirrors
    another ray is aimed at an emitter (option `lights`): a triangle that shines, a panorama, or one of the scene's
    lights. Random numbers are Sobol' points, scrambled for each pixel and bounce. Stages: primary and depth_first, the
    paths.

    Parameters
    ----------
    scene, camera, primary :
        As for `Renderer`.
    threads, build_quality, robust :
        Of the scene for all rays but the primary ones, as for `atra.PixelTracer`.
    jitter : {"shared", "off", "pixel"}
        Sub-pixel offset of rays: one for all pixels, new for each sample; the centre; or one per pixel, whose rays the
        renderer traces itself.
    most_samples : int, optional
        Most samples of a picture (default: any number).
    bounces : int
        Most reflections of light before it reaches the eye, 0 = what shines alone.
    lights : {"aimed", "grid", "found"}
        How emitters are found: a ray from every surface but mirrors is aimed at one, lamps by their power or by what
        each gives near the surface, and both ways share its light; or by scattered rays alone, which never meet lamps
        without extent.
    roulette_from : int, optional
        Reflections after which a path may end by chance, the likelier the less light it carries; None: never.
    transparent : bool
        The eye does not see the sky; what is saved has an alpha channel, also through holes and panes.

    Raises
    ------
    InputError
        For an option's value.

    Examples
    --------
    >>> import atra
    >>> from atra import light
    >>> mesh = atra.Mesh([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera(eye=(0, 0, 2), target=(0, 0, 0), width=3, height=3)
    >>> scene = light.Scene.plain(mesh, 0.7, sky=light.constant_sky(1.0))
    >>> with light.PathRenderer(scene, camera, threads=1) as renderer:
    ...     done = renderer.add(64)
    ...     image = renderer.image
    >>> round(float(image[1, 1, 0]), 2)  # its albedo, under a white sky
    0.7
    """

    options: PathOptions

    def __init__(
        self,
        scene: Scene,
        camera: View,
        primary: Primary | None = None,
        *,
        threads: int | None = None,
        build_quality: str = "medium",
        robust: bool = True,
        jitter: str = "shared",
        most_samples: int | None = None,
        bounces: int = 4,
        lights: str = "aimed",
        roulette_from: int | None = 4,
        transparent: bool = False,
    ) -> None:
        options = PathOptions(
            threads, build_quality, robust, jitter, most_samples, bounces, lights, roulette_from,
            transparent,
        )  # fmt: skip
        super().__init__(scene, camera, primary, options)

    @property
    def _planes(self) -> int:
        return ALPHA + 1 if self.options.transparent else ALPHA

    def _tables(self) -> Surfaces:
        lights = self.options.lights
        self._emitters = no_emitters() if lights == "found" else emitters_of(self.scene, in_grid=lights == "grid")
        return surfaces_of(self.scene, self.scene.sky.power)

    def _same_sums(self, scene: Scene) -> bool:
        return scene is self.scene

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

    def _add_wave(self, first: int, count: int, pixels: Pixels, query: Query, stages: dict[str, float]) -> int | None:
        lap, free = Laps(stages), np.empty((FREE_ROWS, 1), np.float32)
        arguments = pixels, query.scene, query.packet, self._surfaces, self._emitters, self._film.sums, free
        limits = limits_of(self.options.bounces, self.options.roulette_from)
        rays = follow_depth_first(first, count, *arguments, limits)
        lap("depth_first")
        return None if rays < 0 else rays
