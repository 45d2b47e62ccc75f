"""What there is to choose from: a method, its split, packets and form of geometry."""

from __future__ import annotations

from dataclasses import dataclass

from atra.alignment.cells import choose_packet_shape
from atra.errors import InputError
from atra.geometry.split import Split
from atra.tracing.rays import SQUAREST_SHAPE
from atra.whole_numbers import is_whole_number

METHODS = ("raster", "pixel", "bvh", "classified", "tiles", "visible_first", "aligned", "instanced")
"""Methods that the model knows; instanced is aligned, with an Embree instance a cell in place of copies."""

WITH_CELLS = ("tiles", "visible_first", "aligned", "instanced")


@dataclass(frozen=True)
class Choice:
    """A method and all that its cost depends on.

    method: one of `METHODS`. split: (nx, ny) cells, (1, 1) for methods without. packet_width: rays of a packet, 1 for
    methods without packets. culling: of aligned.
    Raises InputError for another method, cells where it has none, and counts below 1.
    """

    method: str
    split: tuple[int, int] = (1, 1)
    packet_width: int = 1
    culling: bool = True

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"method is {self.method!r}, expected one of {', '.join(METHODS)}")
        counts = {"split_x": self.split[0], "split_y": self.split[1], "packet_width": self.packet_width}
        for name, value in counts.items():
            if not is_whole_number(value) or value < 1:
                raise InputError(f"{name} is {value!r}, expected a whole number of at least 1")
        object.__setattr__(self, "split", (int(self.split[0]), int(self.split[1])))
        object.__setattr__(self, "packet_width", int(self.packet_width))
        if self.method not in WITH_CELLS and self.split != (1, 1):
            raise InputError(f"method is {self.method!r} with split {self.split}, but it has no cells; expected (1, 1)")

    @property
    def cells(self) -> int:
        return self.split[0] * self.split[1]

    def packet_shape(self, width: int, height: int) -> tuple[int, int]:
        """Columns and rows of a packet in an image of this size. Raises InputError for a split that does not divide
        it."""
        split = Split(*self.split, width, height)
        if self.method in ("aligned", "instanced", "visible_first"):
            return choose_packet_shape(self.packet_width, split)
        return SQUAREST_SHAPE[self.packet_width]

    def __str__(self) -> str:
        words = [self.method]
        if self.method in WITH_CELLS:
            words.append(f"{self.split[0]} x {self.split[1]}")
        if self.packet_width > 1:
            words.append(f"packets of {self.packet_width}")
        return ", ".join([*words, *([] if self.culling else ["culling off"])])
