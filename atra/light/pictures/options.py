"""Options of renderers."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import inf
from typing import ClassVar

from atra.errors import InputError
from atra.geometry.numbers import as_number
from atra.light.checks import check_whole, checked_number
from atra.light.pictures.path_kernels import BLOCK
from atra.tracing.options import PacketKeywords, PacketOptions, option, option_of

MOST_RAYS = 64
"""Most rays to a light, or into the sky, per pixel and sample."""

_DIRECTIONS = ("shared", "shifted")


class RenderKeywords(PacketKeywords, total=False):
    jitter: str
    wave_rays: int
    start_off: float | None
    most_samples: int | None


@dataclass(frozen=True)
class RenderOptions(PacketOptions):
    """Options of every renderer, beside those of the scene for its rays (`PacketOptions`).

    The picture depends on neither threads nor wave_rays. built_with: names of options that cannot change later. Raises
    InputError, with the value.
    """

    built_with: ClassVar[frozenset[str]] = frozenset(field.name for field in fields(PacketOptions)) | {"start_off"}

    jitter: str = option(
        "shared",
        "sub-pixel offset of rays: shared = one for all pixels, new for each sample, off = the centre",
        choices=("shared", "off"),
    )
    wave_rays: int = option(8 * BLOCK, "pixels (rays in waves) that a thread takes at a time, a multiple of 2,048")
    start_off: float | None = option(
        None, "offset of rays from the triangle they leave; null = as far as float32 needs", unit="scene units"
    )
    most_samples: int | None = option(None, "most samples of a picture; null = any number")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_whole("wave_rays", self.wave_rays, 1, 1 << 24)
        if self.wave_rays % BLOCK:
            raise InputError(f"wave_rays is {self.wave_rays}, expected a multiple of {BLOCK}")
        if self.most_samples is not None:
            check_whole("most_samples", self.most_samples, 1)
        if self.start_off is not None:
            object.__setattr__(self, "start_off", checked_number("start_off", self.start_off, 0.0))


class PathKeywords(RenderKeywords, total=False):
    max_depth: int
    lights: str
    roulette: int
    order: str


@dataclass(frozen=True)
class PathOptions(RenderOptions):
    """Options of `PathRenderer`."""

    built_with: ClassVar[frozenset[str]] = RenderOptions.built_with | {"lights", "order"}

    jitter: str = option_of(
        RenderOptions,
        "jitter",
        help="as for every renderer, or pixel = an offset per pixel, whose rays the renderer traces itself",
        choices=("shared", "off", "pixel"),
    )
    max_depth: int = option(5, "most rays of a path, the primary ray included")
    lights: str = option(
        "aimed",
        "how emitters are found: aimed = a ray from every surface but mirrors is aimed at one, and both ways share its "
        "light, found = by scattered rays alone, which never meet lamps without extent",
        choices=("aimed", "found"),
    )
    roulette: int = option(4, "rays after which a path may end by chance, the likelier the less light it carries")
    order: str = option(
        "depth_first",
        "depth_first = one path after the other, waves = many paths stage by stage, with times of stages",
        choices=("depth_first", "waves"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_whole("max_depth", self.max_depth, 1, 1 << 20)
        check_whole("roulette", self.roulette, 1, 1 << 20)


class HybridKeywords(RenderKeywords, total=False):
    shadow_rays: int
    shadow_length: float
    shadow_directions: str
    occlusion_rays: int
    occlusion_length: float
    occlusion: str
    occlusion_directions: str
    most_kept: int


@dataclass(frozen=True)
class HybridOptions(RenderOptions):
    """Options of `HybridRenderer`. With 0 rays of a kind there is no shadow, or no occlusion.

    Embree traces shared directions faster; shifted ones replace banding by noise.
    """

    shadow_rays: int = option(1, "rays to each light per sample, 0 to 64")
    shadow_length: float = option(inf, "largest distance at which a thing casts a shadow", unit="scene units")
    shadow_directions: str = option(
        "shared", "sample points on lights: shared by all pixels, or shifted per pixel", choices=_DIRECTIONS
    )
    occlusion_rays: int = option(1, "rays into the sky per sample, 0 to 64")
    occlusion_length: float = option(10.0, "largest distance at which a thing occludes", unit="scene units")
    occlusion: str = option(
        "uniform", "weight of directions in the hemisphere: uniform, or by their cosine", choices=("uniform", "cosine")
    )
    occlusion_directions: str = option(
        "shifted", "directions into the sky: shared by all pixels, or shifted per pixel", choices=_DIRECTIONS
    )
    wave_rays: int = option_of(RenderOptions, "wave_rays", default=512 * BLOCK)
    most_samples: int | None = option_of(RenderOptions, "most_samples", default=512)
    most_kept: int = option(
        0,
        "samples that reprojected pixels count as after a camera move, which softens edges and textures a little; "
        "0 = all start anew",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("shadow_rays", "occlusion_rays"):
            check_whole(name, getattr(self, name), 0, MOST_RAYS)
        check_whole("most_kept", self.most_kept, 0)
        for name in ("shadow_length", "occlusion_length"):
            length = as_number(getattr(self, name))
            if not 0.0 < length <= inf:
                raise InputError(f"{name} is {getattr(self, name)!r}, expected a length above 0, or inf")
