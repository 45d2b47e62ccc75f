"""Path tracing: paths followed from the eye, scattered by materials, to the sky and to emitters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

import numpy as np

from atra.choices import check_choice, check_flags
from atra.errors import InputError
from atra.geometry.view import View
from atra.light.batches import Laps
from atra.light.checks import check_clamp, check_whole, checked_number
from atra.light.emitters.tables import emitters_of
from atra.light.pictures.film import Film
from atra.light.pictures.following_kernels import ALPHA, aperture_of, follow_depth_first, limits_of
from atra.light.pictures.integrator import Integrator, check_length
from atra.light.pictures.path_kernels import BLOCK, FREE_ROWS, Pixels
from atra.light.pictures.renderer import Primary, Renderer
from atra.light.scene import Scene
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import KernelScene, Query


@dataclass(frozen=True)
class Paths(Integrator):
    """How a `PathRenderer` gathers light."""

    renderer, sets_sums, wave_pixels = "PathRenderer", False, 8 * BLOCK
    built_with: ClassVar = Integrator.built_with | {"lights", "transparent"}
    jitters: ClassVar[tuple[str, ...]] = ("shared", "off", "pixel")
    packet_width: ClassVar = 1  # rays of paths are incoherent

    bounces: int = 4
    lights: str = "aimed"
    roulette_from: int | None = 4
    transparent: bool = False
    aperture_radius: float = 0.0
    focus_distance: float = inf
    clamp: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_number("aperture_radius", self.aperture_radius, 0.0, 1e12)
        check_length("focus_distance", self.focus_distance)
        check_choice("lights", self.lights, ("aimed", "grid", "found"))
        check_flags(transparent=self.transparent)
        check_clamp(self)
        check_whole("bounces", self.bounces, 0, 1 << 20)
        if self.roulette_from is not None:
            check_whole("roulette_from", self.roulette_from, 0, 1 << 20)

    @property
    def is_jittered(self) -> bool:
        """See `Integrator`; always with an aperture."""
        return self.jitter == "pixel" or self.aperture_radius > 0.0

    def check_camera(self, camera: View) -> None:
        """Raise InputError for a lens with an aperture."""
        if self.aperture_radius > 0.0 and camera.lens is not None:
            raise InputError(
                f"aperture_radius is {self.aperture_radius!r}, but the camera has the lens {camera.lens!r}; expected a "
                "pinhole or an orthographic camera, such as camera.undistorted()"
            )

    def planes(self, lamps: Sequence[Any]) -> int:
        """Sums per pixel."""
        return ALPHA + self.transparent

    def shares(self, scene: Scene) -> dict[str, int]:
        """The plane of alpha, if there is one."""
        return {"alpha": ALPHA} if self.transparent else {}

    def tables(self, scene: Scene, lamps: Sequence[Any], rays: KernelScene) -> tuple[Any, Any]:
        """See `Integrator.tables`."""
        return surfaces_of(scene, scene.sky.power), emitters_of(scene, self.lights)

    def add(
        self, tables: Any, camera: View, query: Query, first: int, count: int, pixels: Pixels, film: Film,
        stages: dict[str, float],
    ) -> int | None:  # fmt: skip
        """See `Integrator.add`."""
        lap, free = Laps(stages), np.empty((FREE_ROWS, 1), np.float32)
        aperture = aperture_of(camera, self.aperture_radius, self.focus_distance)
        limits = limits_of(self.bounces, self.roulette_from, self.clamp)
        arguments = pixels, query.scene, query.packet, *tables, film.sums, free, limits, aperture
        rays = follow_depth_first(first, count, *arguments)
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
    integrator = Paths(
        threads, build_quality, robust, jitter, most_samples, bounces, lights, roulette_from, transparent,
        aperture_radius, focus_distance, clamp,
    )  # fmt: skip
    return Renderer(scene, camera, primary, integrator)
