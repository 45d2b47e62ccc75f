"""Options of a bake, as a value that is checked; `Baker` says what each is for."""

from __future__ import annotations

from dataclasses import dataclass, replace

from atra.choices import check_choice, check_flags
from atra.errors import InputError
from atra.light.checks import check_rays, check_whole, checked_number


@dataclass(frozen=True)
class BakeOptions:
    """Options of `Baker`. Raises InputError, with the value. Source: the values of Unity's lightmapper, where it has
    any."""

    threads: int | None = None
    packet_width: int | None = 1  # rays are incoherent
    build_quality: str = "medium"
    robust: bool = True
    bounces: int = 4
    roulette_from: int | None = 2
    open_length: float = 1.0
    environment: str = "mis"
    lights: str = "uniform"
    adaptive: bool = False
    batch_rays: int = 1 << 19
    expansion: int = 16
    compaction: str = "bounces"
    seed: int = 0

    def __post_init__(self) -> None:
        check_rays(self)
        check_choice("environment", self.environment, ("mis", "light", "bsdf"))
        check_choice("lights", self.lights, ("uniform", "grid"))
        check_choice("compaction", self.compaction, ("none", "texels", "bounces"))
        check_flags(adaptive=self.adaptive)
        check_whole("bounces", self.bounces, 0, 1 << 10)
        if self.roulette_from is not None:
            check_whole("roulette_from", self.roulette_from, 0, 1 << 20)
        object.__setattr__(self, "open_length", checked_number("open_length", self.open_length, 0.0, 1e30, above=True))
        check_whole("batch_rays", self.batch_rays, 1 << 8, 1 << 26)
        check_whole("expansion", self.expansion, 1, 1 << 12)
        check_whole("seed", self.seed, 0, (1 << 32) - 1)

    def for_paths(self) -> BakeOptions:
        """Those of a bake of a `Scene`, whose rays are traced one by one. Raises InputError for what it lacks."""
        for name, usual in (("environment", "mis"), ("lights", "uniform")):
            if getattr(self, name) != usual:
                raise InputError(f"{name} is {getattr(self, name)!r} for a Scene, expected {usual!r} or a BakeScene")
        return replace(self, packet_width=1)
