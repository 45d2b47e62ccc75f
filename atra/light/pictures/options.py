"""Options of renderers: what a person can choose about a picture and how it is made."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import inf
from typing import ClassVar

from atra.errors import InputError
from atra.geometry.numbers import as_number
from atra.light.checks import check_one_of, checked_number
from atra.light.pictures.path_kernels import BLOCK
from atra.tracing.options import RayOptions
from atra.whole_numbers import is_whole_number

MOST_RAYS = 64
"""To a light, or into the sky, from each pixel and for each sample."""


@dataclass(frozen=True)
class RenderOptions(RayOptions):
    """Options of every renderer, beside those of the scene that its rays meet (`RayOptions`).

    jitter: where in its pixels sample n's rays go, "shared": all through the same point, the n-th of
    `sub_pixel_offsets`, which any method of primary visibility can trace; "off": always through the centre.
    most_samples: of a picture; more are not added. None: as many as are asked for.
    wave_rays: pixels that each thread takes at a time, at most, and of waves rays that go through a stage together; a
    multiple of 2,048.
    start_off: how far rays start off the triangle they leave, in scene units; None: as far as float32 needs, triangle
    by triangle.
    built_with: names of the options that a renderer keeps for its life.
    The picture depends on neither threads nor wave_rays. Raises InputError, with the value.
    """

    jitters: ClassVar[tuple[str, ...]] = ("shared", "off")
    built_with: ClassVar[frozenset[str]] = frozenset(field.name for field in fields(RayOptions)) | {"start_off"}

    jitter: str = "shared"
    wave_rays: int = 8 * BLOCK
    start_off: float | None = None
    most_samples: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_one_of("jitter", self.jitter, self.jitters)
        if not is_whole_number(self.wave_rays) or not BLOCK <= self.wave_rays <= 1 << 24 or self.wave_rays % BLOCK:
            raise InputError(f"wave_rays is {self.wave_rays!r}, expected a multiple of {BLOCK} from {BLOCK} to 2^24")
        if self.most_samples is not None and (not is_whole_number(self.most_samples) or self.most_samples < 1):
            raise InputError(f"most_samples is {self.most_samples!r}, expected a whole number of at least 1, or None")
        if self.start_off is not None:
            object.__setattr__(self, "start_off", checked_number("start_off", self.start_off, 0.0))


@dataclass(frozen=True)
class PathOptions(RenderOptions):
    """Options of `PathRenderer`.

    max_depth: rays of a path at most, the one from the eye among them; a path that has found no light by then is dark.
    jitter: may also be "pixel": every pixel has an offset of its own, and the renderer traces these rays itself.
    order: "depth_first": one path after the other, ray by ray, which was as fast or a little faster on large scenes;
    "waves": all paths of a wave go from stage to stage, in packets, and each stage's time is known.
    """

    jitters: ClassVar[tuple[str, ...]] = ("shared", "off", "pixel")
    built_with: ClassVar[frozenset[str]] = RenderOptions.built_with | {"order"}

    max_depth: int = 5
    order: str = "depth_first"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_one_of("order", self.order, ("depth_first", "waves"))
        if not is_whole_number(self.max_depth) or not 1 <= self.max_depth <= 1 << 20:
            raise InputError(f"max_depth is {self.max_depth!r}, expected a whole number from 1 to 2^20")


@dataclass(frozen=True)
class HybridOptions(RenderOptions):
    """Options of `HybridRenderer`.

    shadow_rays, occlusion_rays: for each sample, to each light and into the sky, 0 to 64; without any there is no
    shadow, or no occlusion. shadow_length, occlusion_length: how far a thing may be and still cast a shadow, or
    occlude, in scene units; inf: any.
    occlusion: "uniform", the share of the hemisphere that is free, or "cosine", weighted by the cosine of its angle.
    shadow_directions, occlusion_directions: "shared": the same for all pixels (into the sky, turned to each surface's
    side), which Embree traces faster; "shifted": by a random amount of each pixel's own, which trades bands for noise.
    most_kept: when the camera moves and nothing else changes, pixels that see what one saw before go on with its mean,
    as of so many samples at most; 0: all start anew. Edges and textures are a little softer for it.
    """

    shadow_rays: int = 1
    shadow_length: float = inf
    shadow_directions: str = "shared"
    occlusion_rays: int = 1
    occlusion_length: float = 10.0
    occlusion: str = "uniform"
    occlusion_directions: str = "shifted"
    wave_rays: int = 512 * BLOCK
    most_samples: int | None = 512
    most_kept: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("shadow_rays", "occlusion_rays"):
            rays = getattr(self, name)
            if not is_whole_number(rays) or not 0 <= rays <= MOST_RAYS:
                raise InputError(f"{name} is {rays!r}, expected a whole number from 0 to {MOST_RAYS}")
        if not is_whole_number(self.most_kept) or self.most_kept < 0:
            raise InputError(f"most_kept is {self.most_kept!r}, expected a whole number of at least 0")
        for name in ("shadow_length", "occlusion_length"):
            length = as_number(getattr(self, name))
            if not 0.0 < length <= inf:
                raise InputError(f"{name} is {getattr(self, name)!r}, expected a length above 0, or inf")
        check_one_of("occlusion", self.occlusion, ("uniform", "cosine"))
        for name in ("shadow_directions", "occlusion_directions"):
            check_one_of(name, getattr(self, name), ("shared", "shifted"))
