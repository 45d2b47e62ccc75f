"""Options of a bake, as a value that is checked; `Baker` says what each is for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from atra.choices import check_choice
from atra.light.checks import check_clamp, check_rays, check_whole, checked_number


@dataclass(frozen=True)
class BakeOptions:
    """Options of `Baker`. Raises InputError, with the value. Source: the values of Unity's lightmapper, where it has
    any."""

    packet_width: ClassVar[int] = 1  # rays are incoherent

    threads: int | None = None
    build_quality: str = "medium"
    robust: bool = True
    bounces: int = 4
    roulette_from: int | None = 2
    open_length: float = 1.0
    lights: str = "aimed"
    seed: int = 0
    clamp: float | None = None

    def __post_init__(self) -> None:
        check_rays(self)
        check_choice("lights", self.lights, ("aimed", "grid"))
        check_whole("bounces", self.bounces, 0, 1 << 10)
        if self.roulette_from is not None:
            check_whole("roulette_from", self.roulette_from, 0, 1 << 20)
        object.__setattr__(self, "open_length", checked_number("open_length", self.open_length, 0.0, 1e30, above=True))
        check_whole("seed", self.seed, 0, (1 << 32) - 1)
        check_clamp(self)
