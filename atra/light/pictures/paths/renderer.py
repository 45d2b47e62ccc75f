"""Path tracing: paths followed from the eye, scattered by materials, to the sky and to emitters."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import numpy as np
from numpy.typing import NDArray

from atra.geometry.view import View
from atra.light.batches import Laps
from atra.light.emitters.tables import emitters_of
from atra.light.pictures.film import Film
from atra.light.pictures.options import PathOptions
from atra.light.pictures.path_kernels import BLOCK, FREE_ROWS, Pixels
from atra.light.pictures.paths.depth_first_kernels import ALPHA, aperture_of, follow_depth_first
from atra.light.pictures.paths.following_kernels import limits_of
from atra.light.pictures.renderer import Primary, Renderer
from atra.light.scene import Scene
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import KernelScene, Query


class Paths:
    """The integrator of `PathRenderer`."""

    name, sets_sums, wave_pixels = "PathRenderer", False, 8 * BLOCK

    def take(self, scene: Scene, options: PathOptions, camera: View) -> None:
        """See `Integrator.take`."""
        self._scene, self._options = scene, options
        self._aperture = aperture_of(camera, options.aperture_radius, options.focus_distance)

    @property
    def planes(self) -> int:
        """Sums per pixel."""
        return ALPHA + self._options.transparent

    @property
    def shares(self) -> dict[str, int]:
        """The plane of alpha, if there is one."""
        return {"alpha": ALPHA} if self._options.transparent else {}

    def build(self, rays: KernelScene) -> None:
        """See `Integrator.build`."""
        self._emitters = emitters_of(self._scene, self._options.lights)
        self._surfaces = surfaces_of(self._scene, self._scene.sky.power)

    def same_sums(self, scene: Scene) -> bool:
        """See `Integrator.same_sums`."""
        return scene is self._scene

    def parts(self, film: Film) -> Iterator[NDArray[np.float64]]:
        """The picture as a whole."""
        yield film.mean(slice(3))

    def add(
        self, query: Query, first: int, count: int, pixels: Pixels, film: Film, stages: dict[str, float]
    ) -> int | None:
        """See `Integrator.add`."""
        lap, free = Laps(stages), np.empty((FREE_ROWS, 1), np.float32)
        arguments = pixels, query.scene, query.packet, self._surfaces, self._emitters, film.sums, free
        limits = limits_of(self._options.bounces, self._options.roulette_from, self._options.clamp)
        rays = follow_depth_first(first, count, *arguments, limits, self._aperture)
        lap("depth_first")
        return None if rays < 0 else rays


def PathRenderer(
    scene: Scene, camera: View, primary: Primary | None = None, *,
    threads: int | None = None, build_quality: str = "medium", robust: bool = True, jitter: str = "shared",
    most_samples: int | None = None, bounces: int = 4, lights: str = "aimed", roulette_from: int | None = 4,
    transparent: bool = False, aperture_radius: float = 0.0, focus_distance: float = inf,
    clamp: float | None = None,
) -> Renderer:  # fmt: skip
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
    aperture_radius : float
        Radius of the disk that rays start from, scene units; 0 = a pinhole, everything is sharp. With a disk each pixel
        has an offset of its own, whatever `jitter` is. Not through a lens. Layers, and so `denoised`, see as a pinhole.
    focus_distance : float
        Distance along the view axis at which things are sharp, scene units.
    clamp : float, optional
        Most radiance that an emitter may add to a sample at once by more than one reflection. It takes away bright
        specks and, with them, light: the mean is biased. None: no limit, unbiased.

    Returns
    -------
    Renderer

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
    options = PathOptions(
        threads,
        build_quality,
        robust,
        jitter,
        most_samples,
        bounces,
        lights,
        roulette_from,
        transparent,
        aperture_radius,
        focus_distance,
        clamp,
    )
    return Renderer(scene, camera, primary, options, Paths())
