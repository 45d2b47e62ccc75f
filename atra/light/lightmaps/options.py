"""Options of a bake."""

from __future__ import annotations

from dataclasses import dataclass

from atra.light.checks import check_whole, checked_number
from atra.tracing.options import PacketKeywords, PacketOptions, option, option_of


class BakeKeywords(PacketKeywords, total=False):
    bounces: int
    roulette_from: int | None
    open_length: float
    environment: str
    lights: str
    adaptive: bool
    batch_rays: int
    expansion: int
    compaction: str
    seed: int


@dataclass(frozen=True)
class BakeOptions(PacketOptions):
    """Options of `Baker`, beside those of the scene for its rays (`PacketOptions`).

    The number of threads, batch_rays, expansion and compaction do not change a bit of the map with single rays; packets
    change bits where a ray meets an edge. `adaptive` checks texels after 64, 128, 256, ... samples; it stops where
    samples happen to agree, which biases means a little. Raises InputError, with the value. Source: the values of
    Unity's lightmapper, where it has any.
    """

    packet_width: int | None = option_of(PacketOptions, "packet_width", default=1)  # rays are incoherent
    bounces: int = option(4, "most reflections of light before it reaches a texel; 0 = direct light alone")
    roulette_from: int | None = option(
        2, "bounces after which Russian roulette by albedo ends paths; null = never", null="never"
    )
    open_length: float = option(1.0, "distance below which a thing counts as occluding", unit="scene units")
    environment: str = option(
        "mis",
        "what finds a panorama's light: light = rays aimed at bright parts, bsdf = scattered rays, mis = both, by the "
        "balance heuristic; for other skies always scattered rays",
        choices=("mis", "light", "bsdf"),
    )
    lights: str = option(
        "uniform",
        "which light a ray after a bounce is aimed at: uniform = all are as likely, grid = by what lights may give "
        "in a cell of a grid, with less noise for many lights",
        choices=("uniform", "grid"),
    )
    adaptive: bool = option(False, "skip texels whose mean is within 1 % with a confidence of 99 %")
    batch_rays: int = option(1 << 19, "rays in flight, of all threads together; determines the memory")
    expansion: int = option(16, "samples of a texel side by side in a batch")
    compaction: str = option(
        "bounces",
        "which lanes are packed together: none = all texels of the map, texels = lit texels, bounces = also the "
        "paths that continue after every bounce",
        choices=("none", "texels", "bounces"),
    )
    seed: int = option(0, "seed of random numbers")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_whole("bounces", self.bounces, 0, 1 << 10)
        if self.roulette_from is not None:
            check_whole("roulette_from", self.roulette_from, 0, 1 << 20)
        object.__setattr__(self, "open_length", checked_number("open_length", self.open_length, 0.0, 1e30, above=True))
        check_whole("batch_rays", self.batch_rays, 1 << 8, 1 << 26)
        check_whole("expansion", self.expansion, 1, 1 << 12)
        check_whole("seed", self.seed, 0, (1 << 32) - 1)
