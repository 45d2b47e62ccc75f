"""An integrator: options of a renderer, and how it gathers light."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from math import inf
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.choices import check_choice
from atra.errors import InputError
from atra.geometry.numbers import as_number
from atra.geometry.view import View
from atra.light.batches import in_batches
from atra.light.checks import check_rays, check_whole
from atra.light.pictures.film import Film
from atra.light.pictures.path_kernels import BLOCK, Pixels
from atra.light.scene import Scene
from atra.rays.kernel_scene import KernelScene, Query

_WAVES_A_THREAD = 4
"""Least waves per thread; more balance the threads and ask `stop` more often."""


@dataclass(frozen=True)
class Integrator:
    """Options of every renderer, and the functions that a `Renderer` calls; several threads call `add` at once.

    renderer: what makes renderers with it. sets_sums: `is_set` of `Film`. wave_pixels: most pixels that a thread takes
    at a time. built_with: names of options that cannot change later. jitters: values of `jitter`. The picture does not
    depend on threads. Raises InputError, with the value.
    """

    renderer: ClassVar[str]
    sets_sums: ClassVar[bool]
    wave_pixels: ClassVar[int]
    built_with: ClassVar = frozenset(("threads", "build_quality", "robust"))
    jitters: ClassVar[tuple[str, ...]] = ("shared", "off")

    threads: int | None = None
    build_quality: str = "medium"
    robust: bool = True
    jitter: str = "shared"
    most_samples: int | None = None

    def __post_init__(self) -> None:
        check_rays(self)
        check_choice("jitter", self.jitter, self.jitters)
        if self.most_samples is not None:
            check_whole("most_samples", self.most_samples, 1)

    @property
    def is_jittered(self) -> bool:
        """Whether each pixel has an offset of its own; then the renderer traces primary rays itself."""
        return self.jitter == "pixel"

    def check_camera(self, camera: View) -> None:
        """Raise InputError for a camera that cannot have these options."""

    def lamps(self, scene: Scene) -> Sequence[Any]:
        """Lights that have sums of their own."""
        return ()

    def planes(self, lamps: Sequence[Any]) -> int:
        """Sums per pixel."""
        raise NotImplementedError

    def shares(self, scene: Scene) -> dict[str, int]:
        """Planes of the film that hold shares of a pixel, by name."""
        raise NotImplementedError

    def tables(self, scene: Scene, lamps: Sequence[Any], rays: KernelScene) -> Any:
        """The tables that kernels read. rays: the scene that is asked."""
        raise NotImplementedError

    def add(
        self, tables: Any, camera: View, query: Query, first: int, count: int, pixels: Pixels, film: Film,
        stages: dict[str, float],
    ) -> int | None:  # fmt: skip
        """Add the next sample of `count` pixels, and the seconds of stages. Returns the number of rays traced, None if
        light was not finite."""
        raise NotImplementedError

    def add_all(
        self, tables: Any, camera: View, rays: KernelScene, pixels: Pixels, film: Film, stages: dict[str, float],
        stop: Callable[[], bool] | None,
    ) -> tuple[bool, int]:  # fmt: skip
        """Add the next sample of all pixels, and the seconds of its stages; returns whether it finished, and the rays
        traced. Raises AtraError for light that is not finite."""
        every, threads = len(film.places), rays.threads
        times: list[dict[str, float]] = [{} for _ in range(threads)]

        def add(query: Query, first: int, count: int) -> int:
            traced = self.add(tables, camera, query, first, count, pixels, film, times[query.worker])
            if traced is None:
                raise film.not_finite(first, count)
            return traced

        waves = 1 if threads == 1 and stop is None else _WAVES_A_THREAD * threads
        share = -(-every // (waves * BLOCK)) * BLOCK
        done = in_batches(rays, every, min(self.wave_pixels, share), add, stop)
        for of_worker in times:
            for stage, seconds in of_worker.items():
                stages[stage] = stages.get(stage, 0.0) + seconds / threads
        return done

    def mean(self, scene: Scene, lamps: Sequence[Any], film: Film) -> NDArray[np.float64]:
        """The picture, (3, pixels), over all samples."""
        return film.mean(slice(3))

    def same_sums(self, scene: Scene, old: Scene) -> bool:
        """Whether samples of one scene have the sums of another's."""
        return scene is old


def check_length(name: str, value: object) -> None:
    """Raise InputError unless `value` is a length above 0, or infinite."""
    if not 0.0 < as_number(value) <= inf:
        raise InputError(f"{name} is {value!r}, expected a length above 0, or inf")


def unlike_but_for(one: object, other: object, *names: str) -> bool:
    """Whether two frozen values differ in fields other than `names`."""
    if type(one) is not type(other):
        return True
    kept = [field.name for field in fields(one) if field.name not in names]  # type: ignore[arg-type]
    return not all(_is_same(getattr(one, name), getattr(other, name)) for name in kept)


def _is_same(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray):  # texels, usually the same object
        return one is other or np.array_equal(one, other)  # type: ignore[arg-type]
    return bool(one == other)
