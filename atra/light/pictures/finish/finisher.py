"""What all renderers do with their samples: states, layers, denoised images, files."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.geometry.view import View
from atra.hits import Hits
from atra.light.oidn import Denoiser
from atra.light.pictures.files import check_picture_path, exr_of, png_of
from atra.light.pictures.film import Film
from atra.light.pictures.finish.fingerprint import fingerprint
from atra.light.pictures.finish.layers_kernels import LAYER_PLANES, layers_kernel
from atra.light.pictures.finish.tone import stops_of, toned
from atra.light.pictures.gbuffer_kernels import new_chunk
from atra.light.pictures.options import RenderOptions
from atra.light.pictures.path_kernels import Pixels
from atra.light.scattering.diffuse import plain_of
from atra.light.scene import Scene
from atra.light.sky import constant_sky
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import KernelScene, Query
from atra.tracing.lifetime import Lifetime
from atra.tracing.tracer import Tracer
from atra.views.sampling import sub_pixel_offsets

Offset = tuple[float, float]

Wave = Callable[[int, int, Query], None]
"""Works on a number of pixels from a first one on, with what a thread asks a scene by."""

CENTRE = (0.5, 0.5)

_LEAST_ALPHA = np.float32(1e-3)
"""Pixels of less alpha keep their darkness in a PNG, whose colours are not multiplied by alpha."""

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


class Finisher(Lifetime):
    """The base of `Renderer`: what is done with the samples it has taken."""

    scene: Scene
    camera: View
    options: RenderOptions
    _film: Film
    rays: KernelScene
    _tracer: Tracer

    @abstractmethod
    def _start_film(self) -> None: ...

    @property
    @abstractmethod
    def image(self) -> NDArray[np.float32]: ...

    @property
    def alpha(self) -> NDArray[np.float32] | None:
        """(H, W), the share of each pixel that is not sky; None where the sky is drawn."""
        return None

    @abstractmethod
    def _pixels(self, offset: Offset, hits: Hits | None) -> Pixels: ...

    @abstractmethod
    def _in_waves(self, each: Wave) -> bool: ...

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        """Copies of the arrays that `restore` needs to go on with these samples, in this process or another."""
        with self._lock:
            return {"fingerprint": self._fingerprint(), **self._film.state}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from the `state` of a renderer of the same scene, camera and options; what follows is equal to the bit.

        Raises InputError for a state of another one, ClosedError after `close`.
        """
        with self._lock:
            self._check_open()
            if not np.array_equal(state["fingerprint"], self._fingerprint()):
                raise InputError("it is of another scene, camera, option or version of atra")
            self._start_film()
            self._film.restore(state)

    def _fingerprint(self) -> NDArray[np.uint8]:
        options = dict(vars(self.options))
        for name in ("threads", "most_samples"):  # which change no sample
            options.pop(name, None)
        version = import_module("atra").__version__
        return fingerprint(version, type(self).__name__, self.scene, self.camera, options)

    def layers(self) -> Layers:
        """What the pixels see first. Raises ClosedError after `close`."""
        with self._in_use():
            scene = self.scene
            plain = tuple(plain_of(material) for material in scene.materials)
            surfaces = surfaces_of(replace(scene, materials=plain, lights=(), sky=constant_sky(1.0)), 1.0)
            film = Film((LAYER_PLANES, self.camera.width, self.camera.height))
            kernel, chunks = layers_kernel(self.rays.packet_width), [new_chunk() for _ in range(self.rays.threads)]
            for number, offset in enumerate(sub_pixel_offsets(_POINTS).tolist()):
                pixels = self._pixels(tuple(offset), self._tracer.trace(tuple(offset)))._replace(sample=number)

                def add(first: int, count: int, query: Query, pixels: Pixels = pixels) -> None:
                    kernel(
                        first, count, pixels, surfaces, query.scene, query.packet, chunks[query.worker], film.sums
                    )  # fmt: skip

                self._in_waves(add)
                film.end_sample()
            return Layers(*(film.as_image(film.mean(slice(first, first + 3))) for first in (0, 3)))

    def denoised(self, layers: Layers | None = None) -> NDArray[np.float32]:
        """The image without its noise, by Open Image Denoise. layers: of this camera; None: they are made.

        Raises InputError without samples, and without the package pyoidn.
        """
        with self._lock, Denoiser(self.options.threads) as denoiser:
            image, seen = self.image, layers or self.layers()
            return denoiser.picture(image, seen.albedo, seen.normals)

    def save(
        self, path: Path | str, *, exposure: float | str = 0.0, tone: str = "none", denoise: bool = False
    ) -> float | None:
        """Write the picture: `.png` in 8-bit sRGB, or `.exr` in 32-bit linear RGB with layers (`files.exr_of`); returns
        the exposure of a PNG in stops.

        exposure: stops, or "auto". tone: see `tone.TONES`. An EXR has neither. denoise: see `denoised`. Raises
        InputError for another suffix or value, without samples, and without the packages it needs; StorageError.
        """
        path = Path(path)
        check_picture_path(path)
        with self._lock:
            image, stops = self.image, None
            alpha = self.alpha
            raw, is_exr = image, path.suffix.lower() == ".exr"
            layers = self.layers() if is_exr or denoise else None
            if denoise:
                image = self.denoised(layers)
            if layers is not None and is_exr:
                with self._in_use():
                    hits = self._tracer.trace(CENTRE)
                content = exr_of(image, hits, layers.albedo, self._film.samples, raw if denoise else None, alpha)
            else:
                if alpha is not None:
                    image = (image / np.maximum(alpha, _LEAST_ALPHA)[..., None]).astype(np.float32)
                stops = stops_of(image, exposure)
                content = png_of(toned(image, stops, tone), alpha)
            write_atomically(path, content)
        return stops
