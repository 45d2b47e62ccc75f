"""Options of a bake: what a person can choose about the light that is gathered, and how it is gathered."""

from __future__ import annotations

from dataclasses import dataclass

from atra.errors import InputError
from atra.light.checks import check_one_of, checked_number
from atra.tracing.options import RayOptions
from atra.whole_numbers import is_whole_number

COMPACTIONS = ("none", "texels", "bounces")
ENVIRONMENTS = ("mis", "light", "bsdf")
LIGHTS = ("uniform", "grid")


@dataclass(frozen=True)
class BakeOptions(RayOptions):
    """Options of `Baker`, beside those of the scene that its rays meet (`RayOptions`).

    packet_width: 1, as almost no two rays head alike; others change bits where a ray meets an edge.
    bounces: how often light is reflected before it reaches a texel, at most; 0: direct light alone.
    roulette_from: bounces after which a path goes on only as often as its albedos say; None: always.
    open_length: how near a thing counts as occluding, in scene units.
    environment: what finds the light of a panorama; "light": rays aimed at where it is bright, "bsdf": those that leave
    by chance, "mis": both, by the balance heuristic. Other skies are found by chance.
    lights: which light a ray after a bounce is aimed at; "uniform": one of all; "grid": one that may give much in its
    cell of a grid, with the same mean and, of many lights, less noise.
    adaptive: `advance` leaves texels whose mean is within 1 % with a confidence of 99 %; asked after 64, 128, 256, …
    samples. It stops where samples happen to agree, so means are a little off.
    batch_rays: rays in flight, of all threads together; memory hangs on it and not on the map. expansion: samples of a
    texel side by side in a batch. compaction: "none": batches hold all texels of the map, with idle lanes; "texels":
    those that are lit; "bounces": what goes on moves up after every bounce, too.
    seed: of random numbers. Neither threads nor batch_rays, expansion and compaction change a bit of single rays' maps.
    Raises InputError, with the value. Source: the values of Unity's lightmapper where it names any.
    """

    packet_width: int | None = 1
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
        super().__post_init__()
        _check_whole("bounces", self.bounces, 0, 1 << 10)
        if self.roulette_from is not None:
            _check_whole("roulette_from", self.roulette_from, 0, 1 << 20)
        object.__setattr__(self, "open_length", checked_number("open_length", self.open_length, 0.0, 1e30, above=True))
        check_one_of("environment", self.environment, ENVIRONMENTS)
        check_one_of("lights", self.lights, LIGHTS)
        if not isinstance(self.adaptive, bool):
            raise InputError(f"adaptive is {self.adaptive!r}, expected True or False")
        _check_whole("batch_rays", self.batch_rays, 1 << 8, 1 << 26)
        _check_whole("expansion", self.expansion, 1, 1 << 12)
        check_one_of("compaction", self.compaction, COMPACTIONS)
        _check_whole("seed", self.seed, 0, (1 << 32) - 1)


def _check_whole(name: str, value: object, low: int, high: int) -> None:
    if not is_whole_number(value) or not low <= value <= high:  # type: ignore[operator]
        raise InputError(f"{name} is {value!r}, expected a whole number from {low} to {high}")
