"""Contents -> one HTML page, in which nothing runs."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from atra.errors import printable
from atra.files import write_atomically
from experiments.drawing.figure import DrawnFigure
from experiments.report.facts import (
    Doubts,
    count_doubts,
    environment_lines,
    machine_in_short,
    measured_between,
    missing_points,
    scenes_in_short,
    software_in_short,
)
from experiments.report.tables import workload_tables
from experiments.results.claims import VERDICTS, JudgedClaim
from experiments.workloads.picture.pictures import ScenePictures
from scenes.manifest import picture_restriction

_TEMPLATES = Path(__file__).resolve().parents[2] / "reports"

# Words say the verdict; the mark and the colour repeat it.
_MARKS = dict(
    zip(
        VERDICTS, ("\N{HEAVY CHECK MARK}", "\N{HEAVY BALLOT X}", "\N{ALMOST EQUAL TO}", "\N{WHITE CIRCLE}"), strict=True
    )
)


@dataclass(frozen=True)
class ReportContents:
    """Everything the page shows.

    command: what was run, as typed. table: as `experiments.results.table.make_table` makes it.
    environment: `experiments.harness.environment.Environment` as a dictionary.
    """

    title: str
    command: str
    table: pd.DataFrame
    figures: Sequence[DrawnFigure]
    pictures: Sequence[ScenePictures]
    claims: Sequence[JudgedClaim]
    environment: dict[str, Any]


def write_report(folder: Path, contents: ReportContents) -> Path:
    """Write `report.html` into `folder`, beside the tables that it links to, and return its path."""
    path = folder / "report.html"
    write_atomically(path, render_report(contents).encode())
    return path


def render_report(contents: ReportContents) -> str:
    """The text of the page. It asks nothing of the network, and holds no picture that must not be passed on."""
    # Everything is escaped unless it is Markup, and only our own files are.
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_without_controls,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["thousands"] = lambda value: f"{value:,}"
    environment.filters["ratio"] = lambda value: f"{value:.2f}"
    environment.filters["svg"] = lambda content: _data_uri(content, "image/svg+xml")
    environment.filters["png"] = lambda content: _data_uri(content, "image/png")
    table = contents.table
    scenes = scenes_in_short(table)
    return environment.get_template("template.html").render(
        contents=contents,
        style=Markup((_TEMPLATES / "report.css").read_text(encoding="utf-8")),
        marks=_MARKS,
        scenes=scenes,
        stand_ins=[scene for scene in scenes if scene.stands_for is not None],
        statuses=table["status"].value_counts().to_dict(),
        doubts=count_doubts(table),
        verdicts={verdict: sum(claim.verdict == verdict for claim in contents.claims) for verdict in VERDICTS},
        figures=[(figure, _doubts_of(figure, table)) for figure in contents.figures],
        pictures=[(one, picture_restriction(one.scene)) for one in contents.pictures],
        missing=missing_points(table),
        machine=machine_in_short(contents.environment),
        software=software_in_short(contents.environment),
        environment_lines=environment_lines(contents.environment),
        measured_between=measured_between(table),
        tables=list(workload_tables(table)),
    )


def _without_controls(value: Any) -> Any:
    """Autoescaping leaves control characters and marks of direction as they are."""
    return printable(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _data_uri(content: bytes, media_type: str) -> str:
    return f"data:{media_type};base64,{base64.b64encode(content).decode('ascii')}"


def _doubts_of(figure: DrawnFigure, table: pd.DataFrame) -> Doubts:
    return count_doubts(table[table["point_id"].isin(figure.point_ids)])
