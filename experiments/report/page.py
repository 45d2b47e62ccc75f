"""Contents -> one HTML page, in which nothing runs."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from markupsafe import Markup

from atra.errors import printable
from atra.files.paths import write_atomically
from experiments.drawing.figure import NamedFigure
from experiments.drawing.render import render
from experiments.paper.conclusion import SceneGains, conclude, scene_gains
from experiments.paper.readings import readings_of
from experiments.report import facts
from experiments.report.load_figure import load_figure
from experiments.results.claims import (
    DOES_NOT_HOLD,
    HOLDS,
    NOT_MEASURED,
    ONE_READING,
    UNDECIDED,
    JudgedClaim,
    by_claim,
    verdict_on,
)
from experiments.results.processes import BAND
from experiments.results.statistics import NotMeasuredError
from experiments.workloads.picture.files import ScenePictures
from scenes.manifest import picture_restriction

_TEMPLATES = Path(__file__).resolve().parents[2] / "reports"

# Words say the verdict; the mark and the colour repeat it.
_MARKS = {
    HOLDS: "\N{HEAVY CHECK MARK}",
    ONE_READING: "\N{CIRCLE WITH LEFT HALF BLACK}",
    DOES_NOT_HOLD: "\N{HEAVY BALLOT X}",
    UNDECIDED: "\N{ALMOST EQUAL TO}",
    NOT_MEASURED: "\N{WHITE CIRCLE}",
}


@dataclass(frozen=True)
class ReportContents:
    """Everything the page shows.

    command: what was run, as typed. table, processes: as `experiments.results.table.make_tables` makes them.
    environment: `experiments.harness.environment.Environment` as a dictionary.
    """

    title: str
    command: str
    table: pd.DataFrame
    processes: pd.DataFrame
    figures: Sequence[NamedFigure]
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
    table = contents.table
    gains, no_gains = _gains(contents.processes)
    replaced = facts.stand_ins(table)
    # A sweep that measures nothing of what the paper claims has no verdict to show.
    judged = contents.claims if any(claim.verdict != NOT_MEASURED for claim in contents.claims) else ()
    claims = [(readings, verdict_on(readings)) for readings in by_claim(judged)]
    return _template().render(
        contents=contents,
        style=Markup((_TEMPLATES / "report.css").read_text(encoding="utf-8")),
        marks=_MARKS,
        conclusion=conclude(judged, gains, replaced.values()) if judged else None,
        gains=gains,
        no_gains=no_gains,
        readings=readings_of(contents.processes),
        one_reading=ONE_READING,
        packets_over=list(dict.fromkeys(words for of_scene in gains for words in of_scene.packets)),
        stand_ins=replaced,
        compared=facts.compared_images(table),
        processes=facts.count_processes(table),
        band=BAND,
        load=facts.load_in_short(contents.processes),
        load_figure=load_figure(contents.processes),
        statuses=table["status"].value_counts().to_dict(),
        warnings=facts.count_warnings(table),
        claims=claims,
        verdicts={name: sum(verdict == name for claim, verdict in claims if not claim[0].inferred) for name in _MARKS},
        figures=[(figure, _warnings_of(figure, table)) for figure in contents.figures],
        pictures=[(picture, picture_restriction(picture.scene)) for picture in contents.pictures],
        missing=facts.missing_points(table),
        machine=facts.machine_in_short(contents.environment),
        software=facts.software_in_short(contents.environment),
        environment=json.dumps(contents.environment, indent=1, default=str),
        measured_between=facts.measured_between(contents.processes),
        tables=list(facts.workload_tables(table)),
    )


@cache
def _template() -> Template:
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
    environment.filters["svg"] = lambda figure: _data_uri(render(figure, "svg"), "image/svg+xml")
    environment.filters["png"] = lambda content: _data_uri(content, "image/png")
    return environment.get_template("template.html")


def _gains(processes: pd.DataFrame) -> tuple[tuple[SceneGains, ...], str | None]:
    """And why there are none."""
    try:
        return scene_gains(processes), None
    except NotMeasuredError as error:
        return (), str(error)


def _without_controls(value: Any) -> Any:
    """Autoescaping leaves control characters and marks of direction as they are."""
    return printable(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _data_uri(content: bytes, media_type: str) -> str:
    return f"data:{media_type};base64,{base64.b64encode(content).decode('ascii')}"


def _warnings_of(figure: NamedFigure, table: pd.DataFrame) -> facts.Warnings:
    return facts.count_warnings(table[["status", "warnings"]][table["point_id"].isin(figure.point_ids)])
