"""Options of renderers, as values that are checked; the renderers say what each is for."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import inf
from typing import ClassVar

import numpy as np

from atra.choices import check_choice, check_flags
from atra.errors import InputError
from atra.geometry.numbers import as_number
from atra.geometry.view import View
from atra.light.checks import check_clamp, check_rays, check_whole, checked_number

LARGEST = 1e12
"""Largest radius of an aperture."""

MOST_RAYS = 64
"""Most rays to a light, or into the sky, per pixel and sample."""


@dataclass(frozen=True)
class RenderOptions:
    """Options of every renderer.

    The picture does not depend on threads. built_with: names of options that cannot change later.
    jitters: values of `jitter`. Raises InputError, with the value.
    """

    built_with: ClassVar = frozenset(("threads", "build_quality", "robust"))
    jitters: ClassVar[tuple[str, ...]] = ("shared", "off")

    threads: int | None = None
    build_quality: str = "medium"
    robust: bool = True
    jitter: str = "shared"
    most_samples: int | None = None

    @property
    def is_jittered(self) -> bool:
        """Whether each pixel has an offset of its own; then the renderer traces primary rays itself."""
        return self.jitter == "pixel"

    def check_camera(self, camera: View) -> None:
        """Raise InputError for a camera that cannot have these options."""

    def __post_init__(self) -> None:
        check_rays(self)
        check_choice("jitter", self.jitter, self.jitters)
        if self.most_samples is not None:
            check_whole("most_samples", self.most_samples, 1)


@dataclass(frozen=True)
class PathOptions(RenderOptions):
    """Options of `PathRenderer`."""

    built_with: ClassVar = RenderOptions.built_with | {"lights", "transparent"}
    jitters: ClassVar[tuple[str, ...]] = ("shared", "off", "pixel")
    packet_width: ClassVar = 1  # rays of paths are incoherent

    bounces: int = 4
    lights: str = "aimed"
    roulette_from: int | None = 4
    transparent: bool = False
    aperture_radius: float = 0.0
    focus_distance: float = inf
    clamp: float | None = None

    @property
    def is_jittered(self) -> bool:
        """See `RenderOptions`; always with an aperture."""
        return self.jitter == "pixel" or self.aperture_radius > 0.0

    def check_camera(self, camera: View) -> None:
        """Raise InputError for a lens with an aperture."""
        if self.aperture_radius > 0.0 and camera.lens is not None:
            raise InputError(
                f"aperture_radius is {self.aperture_radius!r}, but the camera has the lens {camera.lens!r}; expected a "
                "pinhole or an orthographic camera, such as camera.undistorted()"
            )

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_number("aperture_radius", self.aperture_radius, 0.0, LARGEST)
        _check_length("focus_distance", self.focus_distance)
        check_choice("lights", self.lights, ("aimed", "grid", "found"))
        check_flags(transparent=self.transparent)
        check_clamp(self)
        check_whole("bounces", self.bounces, 0, 1 << 20)
        if self.roulette_from is not None:
            check_whole("roulette_from", self.roulette_from, 0, 1 << 20)


@dataclass(frozen=True)
class HybridOptions(RenderOptions):
    """Options of `HybridRenderer`. With 0 rays of a kind there is no shadow, or no occlusion."""

    built_with: ClassVar = RenderOptions.built_with | {"packet_width"}

    packet_width: int | None = None
    most_samples: int | None = 512
    shadow_rays: int = 1
    shadow_length: float = inf
    occlusion_rays: int = 1
    occlusion_length: float = 10.0
    occlusion: str = "uniform"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("occlusion", self.occlusion, ("uniform", "cosine"))
        for name in ("shadow_rays", "occlusion_rays"):
            check_whole(name, getattr(self, name), 0, MOST_RAYS)
        for name in ("shadow_length", "occlusion_length"):
            _check_length(name, getattr(self, name))


def _check_length(name: str, value: object) -> None:
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
