"""What a report is made of; plain values, handed in by whoever ran the sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from experiments.results.claims import JudgedClaim


@dataclass(frozen=True)
class ReportFigure:
    """A drawn figure.

    name: of its files, without the suffix ("figure5").
    image: the content of an SVG or PNG file.
    point_ids: of the points it shows, whose doubts are listed under it. None = every row of the table.
    """

    name: str
    caption: str
    image: bytes
    point_ids: frozenset[str] | None = None


@dataclass(frozen=True)
class ScenePictures:
    """The shaded pictures of a scene from aligned and from per-pixel hits, and their difference.

    aligned, pixel, difference: content of PNG files of one size, or None where there is none.
    pixels_*: how the two images agree, or None where they were not compared.
    withheld: why no picture of this scene may be passed on (a licence); its pictures are then left out of the page.
    stands_for: the paper's scene that this procedural stand-in replaces without being it.
    """

    scene: str
    title: str
    aligned: bytes | None
    pixel: bytes | None
    difference: bytes | None
    pixels_equal: int | None
    pixels_tied: int | None
    pixels_edge: int | None
    pixels_wrong: int | None
    withheld: str | None = None
    stands_for: str | None = None


@dataclass(frozen=True)
class ReportContents:
    """Everything the page shows.

    command: what was run, as typed.
    table: as `experiments.results.table.make_table` makes it.
    environment: `experiments.harness.environment.Environment` as a dictionary.
    """

    title: str
    command: str
    table: pd.DataFrame
    figures: tuple[ReportFigure, ...]
    pictures: tuple[ScenePictures, ...]
    claims: Sequence[JudgedClaim]
    environment: dict[str, Any]
