"""A plan: the choice for a view, what it and others took when they were tried, kept as JSON."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.geometry.mesh import Mesh
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.planner.choice import Choice
from atra.tracing.options import check_ties, native_packet_widths
from atra.tracing.tracer import Tracer
from atra.whole_numbers import is_whole_number

FORMAT = 2
"""Version of the file's layout."""

MOST = 1 << 53
"""Of frames and the like: up to there floats count without gaps."""


@dataclass(frozen=True)
class Forecast:
    """What a choice took, and so is expected to take.

    first_s: from nothing to the first frame: plan, build and that frame. frame_time_s: every further frame.
    Raises InputError for times that are negative or not finite.
    """

    choice: Choice
    first_s: float
    frame_time_s: float

    def __post_init__(self) -> None:
        for name in ("first_s", "frame_time_s"):
            value = getattr(self, name)
            # Not math.isfinite: a whole number beyond all floats is an OverflowError there.
            if not (isinstance(value, (int, float)) and 0 <= value <= sys.float_info.max):
                raise InputError(f"{name} of {self.choice} is {value!r}, expected a finite number of at least 0")

    def total_s(self, frames: int) -> float:
        """Seconds from nothing to the last of so many frames."""
        return self.first_s + (frames - 1) * self.frame_time_s


@dataclass(frozen=True, repr=False)
class Plan:
    """The best choice found for a view.

    frames: how many the view was planned for. threads: of planning, building, tracing. width, height: of the image, in
    pixels. considered: all that were tried, the chosen one first; empty where frames were too few for that. ties: what
    is stored where triangles tie, as for the tracers.
    Raises InputError for counts below 1 or above `MOST`, a split that does not divide the image, and unknown ties.
    """

    frames: int
    threads: int
    width: int
    height: int
    choice: Choice
    considered: tuple[Forecast, ...] = ()
    ties: str = "lowest"

    def __post_init__(self) -> None:
        for name in ("frames", "threads", "width", "height"):
            value = getattr(self, name)
            if not is_whole_number(value) or not 1 <= value <= MOST:
                raise InputError(f"{name} is {value!r}, expected a whole number of at least 1 and at most 2^53")
            object.__setattr__(self, name, int(value))
        for choice in (self.choice, *(one.choice for one in self.considered)):
            Split(*choice.split, width=self.width, height=self.height)
        if self.considered and self.considered[0].choice != self.choice:
            raise InputError(f"choice is {self.choice}, expected the first considered, {self.considered[0].choice}")
        check_ties(self.ties)

    def __repr__(self) -> str:
        time_s = self.predicted_time_s
        predicted = "nothing tried" if time_s is None else f"{time_s:.3g} s predicted, {len(self.considered)} tried"
        view = f"{self.frames} frames of {self.width} x {self.height} pixels, {self.threads} threads"
        cells = "" if self.split == (1, 1) else f" {self.split[0]} x {self.split[1]}"
        return f"Plan({self.method}{cells}, packets of {self.packet_width}; {view}; {predicted})"

    @property
    def method(self) -> str:
        return self.choice.method

    @property
    def split(self) -> tuple[int, int]:
        return self.choice.split

    @property
    def packet_width(self) -> int:
        return self.choice.packet_width

    @property
    def packet_rows(self) -> int:
        return self.choice.packet_rows

    @property
    def build_quality(self) -> str:
        return self.choice.build_quality

    @property
    def predicted_time_s(self) -> float | None:
        """Plan, build and all frames; None where nothing was tried."""
        return self.considered[0].total_s(self.frames) if self.considered else None

    def tracer(
        self, mesh: Mesh, camera: View, ties: str | None = None, memory_budget_bytes: int | None = None
    ) -> Tracer:
        """The tracer, neither planned nor built.

        ties: None takes those planned for. memory_budget_bytes: as for the tracers.
        Raises InputError for an image of another size than planned for, and as the tracer's constructor does.
        """
        if (camera.width, camera.height) != (self.width, self.height):
            raise InputError(
                f"the plan is for {self.width} x {self.height} pixels, the camera has {camera.width} x "
                f"{camera.height}; plan again for this camera"
            )
        ties = self.ties if ties is None else ties
        return self.choice.tracer(mesh, camera, self.threads, ties, memory_budget_bytes)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the plan as JSON, so that a reader sees all of it or none."""
        fields = {"format": FORMAT, "native_packet_widths": list(native_packet_widths()), **asdict(self)}
        write_atomically(Path(path), (json.dumps(fields, indent=1) + "\n").encode())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote.

        Raises InputError, naming the path, for a file that is missing, not a plan of this version, or was made on a
        machine with packets of other widths.
        """
        try:
            fields = json.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{path} cannot be read as a plan: {error.strerror}") from None
        except (ValueError, RecursionError) as error:  # the latter where it is nested too deep
            raise InputError(f"{path} is not a plan: {error}; plan again and save that") from None
        found = fields.pop("format", None) if isinstance(fields, dict) else None
        if found != FORMAT:
            raise InputError(f"{path} is not a plan of format {FORMAT} (format is {found!r}); plan again and save that")
        native = list(native_packet_widths())
        widths = fields.pop("native_packet_widths", None)
        if widths != native:
            raise InputError(
                f"{path} was planned on a machine with packets of {widths}, this one has {native}; plan again here"
            )
        try:
            choice = _choice(fields.pop("choice"))
            considered = tuple(Forecast(_choice(one.pop("choice")), **one) for one in fields.pop("considered"))
            return cls(**fields, choice=choice, considered=considered)
        except (TypeError, KeyError, AttributeError, ValueError) as error:
            raise InputError(f"{path} is not a plan of format {FORMAT}: {error}; plan again and save that") from None


def _choice(fields: dict[str, Any]) -> Choice:
    nx, ny = fields.pop("split")
    return Choice(split=(nx, ny), **fields)
