"""Contents -> one HTML page that needs nothing beside itself."""

from __future__ import annotations

import base64
import hashlib
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from atra.errors import printable
from atra.files import write_atomically
from experiments.report.columns import describe_columns, views_of
from experiments.report.contents import ReportContents, ReportFigure
from experiments.report.embedding import embed_figure, pack, parquet_bytes
from experiments.report.facts import (
    Doubts,
    count_doubts,
    count_verdicts,
    environment_lines,
    machine_in_short,
    measured_between,
    missing_points,
    scenes_in_short,
    software_in_short,
)
from experiments.report.pictures import embed_pictures
from experiments.results.claims import VERDICTS
from experiments.results.table import csv_bytes

_TEMPLATES = Path(__file__).resolve().parents[2] / "reports"

# Words say the verdict; the mark and the colour repeat it.
_MARKS = dict(
    zip(
        VERDICTS, ("\N{HEAVY CHECK MARK}", "\N{HEAVY BALLOT X}", "\N{ALMOST EQUAL TO}", "\N{WHITE CIRCLE}"), strict=True
    )
)


def write_report(folder: Path, contents: ReportContents) -> Path:
    """Write `report.html` into `folder` and return its path.

    The page asks nothing of the network or of files beside it. Raises InputError for a figure or picture that cannot
    be read, or a verdict that is none.
    """
    path = folder / "report.html"
    write_atomically(path, render_report(contents).encode())
    return path


def render_report(contents: ReportContents) -> str:
    """The text of the page; see `write_report`."""
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
    script = (_TEMPLATES / "report.js").read_text(encoding="utf-8")
    return environment.get_template("template.html").render(
        contents=contents,
        style=Markup((_TEMPLATES / "report.css").read_text(encoding="utf-8")),
        script=Markup(script),
        # The browser runs this script and no other, whatever the data hold.
        script_sha256=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        marks=_MARKS,
        **_facts(contents),
    )


def _without_controls(value: Any) -> Any:
    """Autoescaping leaves control characters and marks of direction as they are."""
    return printable(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _facts(contents: ReportContents) -> dict[str, Any]:
    table = contents.table
    scenes = scenes_in_short(table)
    return {
        "scenes": scenes,
        "stand_ins": [scene for scene in scenes if scene.stands_for is not None],
        "statuses": {str(status): int(count) for status, count in table["status"].value_counts().items()},
        "doubts": count_doubts(table),
        "verdicts": count_verdicts(contents.claims),
        "figures": [(figure, embed_figure(figure), _doubts_of(figure, table)) for figure in contents.figures],
        "pictures": [(pictures, embed_pictures(pictures)) for pictures in contents.pictures],
        "missing": missing_points(table),
        "machine": machine_in_short(contents.environment),
        "software": software_in_short(contents.environment),
        "environment_lines": environment_lines(contents.environment),
        "measured_between": measured_between(table),
        "columns": [vars(column) for column in describe_columns(table)],
        "views": [vars(view) for view in views_of(table)],
        "csv": pack(csv_bytes(table)),
        "parquet": pack(parquet_bytes(table)),
    }


def _doubts_of(figure: ReportFigure, table: pd.DataFrame) -> Doubts:
    return count_doubts(table if figure.point_ids is None else table[table["point_id"].isin(figure.point_ids)])
