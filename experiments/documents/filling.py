"""Tables and numbers of documents, made from stored tables as a description in TOML says.

A table has a cell for each of its rows and columns. What the table, the row and the column say is united, and describes
the cell:

    sweep   folder under reports/reference whose table.parquet and processes.parquet are read
    where   which points: column -> value, a list of them, or a test (`experiments.results.queries`)
    pick    which of several points: best = best split (`experiments.workloads.series.best_rows`), first, all, or
            lowest NAME; sum, max, min, median = that of every column. Without it there must be one point alone
    cell    text with fields {EXPRESSION:FORM}, of columns of the point
    over    for ratios, in which columns the other point differs
    empty   text of a cell that has no point or no value; without it that is an error

FORM is one of `_FORMS`, or a format of Python; without one a number has three digits.

    rows, columns   a list of {head = text, where = ..., cell = ...}; "scenes" stands for the paper's four
    each            columns whose values have a row each, in their order, beneath `label`, a text with fields
    corner          head of the first column
    align           a letter for each column, l or r
    function        instead: what `experiments.documents.writing` calls the function that makes the rows; head = heads
    kept            instead: the file in the sweep's folder, less its suffix .csv, that holds the rows; head = heads
    claims          instead: claims.json of the sweep, by ids or all; leave_out = those whose id begins so; tell = the
                    column between text and verdict
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from math import floor, log10
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.methods import find_method
from experiments.results.intervals import with_intervals
from experiments.results.queries import check_keys, chosen
from experiments.results.statistics import Estimate
from experiments.results.table import with_names_of_today
from experiments.workloads.series import best_rows
from scenes.directory import PAPER_SCENES as SCENES

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "reports" / "reference"
TIMES = "\N{MULTIPLICATION SIGN}"
_FIELD = re.compile(r"\{([^{}:]*)(?::([^{}]*))?\}")
_OF_CELLS = ("sweep", "where", "pick", "cell", "over", "empty")
_OF_TABLES = (
    "rows", "columns", "each", "label", "corner", "align", "function", "kept", "head", "claims", "tell",
    "leave_out",
)  # fmt: skip
_SUMMARIES = ("sum", "max", "min", "median")

Spec = Mapping[str, Any]


@dataclass(frozen=True)
class Kept:
    """What is kept of a sweep. points: a row a point. processes: a row a process of it. claims: those judged."""

    points: pd.DataFrame
    processes: pd.DataFrame = field(default_factory=pd.DataFrame)
    claims: list[dict[str, Any]] = field(default_factory=list)


@cache
def kept_of(sweep: str) -> Kept:
    """Read once, as a table of hundreds of columns takes a tenth of a second."""
    folder = REFERENCE / sweep
    points, processes = (
        with_names_of_today(pd.read_parquet(path)) if path.exists() else pd.DataFrame()
        for path in (folder / "table.parquet", folder / "processes.parquet")
    )
    if len(processes):
        points = with_intervals(points, processes)
    claims = folder / "claims.json"
    return Kept(points, processes, json.loads(claims.read_text(encoding="utf-8")) if claims.exists() else [])


def united(*specs: Spec) -> dict[str, Any]:
    """What several descriptions say together; of what two say the later holds, but conditions add up."""
    union: dict[str, Any] = {}
    for spec in specs:
        for name, value in spec.items():
            union[name] = {**union.get(name, {}), **value} if name in ("where", "over") else value
    return union


def table_lines(spec: Spec, functions: Mapping[str, Callable[..., Any]]) -> list[str]:
    """The lines of a table in Markdown. Raises ValueError naming what a cell lacks, or a key that nothing reads."""
    check_keys("a table", spec, {*_OF_CELLS, *_OF_TABLES})
    if "function" in spec:
        heads, rows = spec["head"], [list(row) for row in functions[spec["function"]](spec["sweep"])]
    elif "kept" in spec:
        text = (REFERENCE / spec["sweep"] / f"{spec['kept']}.csv").read_text(encoding="utf-8")
        heads, rows = spec["head"], list(csv.reader(text.splitlines()))
    elif "claims" in spec:
        heads, rows = spec["head"], list(_claims(spec))
    else:
        across = list(_entries(spec.get("columns", ["scenes"]), ""))
        heads = [spec.get("corner", ""), *(column["head"] for column in across)]
        down = list(_rows(spec))
        rows = [[row["head"], *(cell_text(united(spec, row, column)) for column in across)] for row in down]
    align = spec.get("align", "l" + "r" * (len(heads) - 1))
    rule = "|" + "|".join({"l": "---", "r": "---:"}[letter] for letter in align) + "|"
    lines = [table_row(*heads), rule, *(table_row(*row) for row in rows)]
    if any(line.count(" | ") != lines[0].count(" | ") for line in lines[2:]) or not rows:
        raise ValueError(f"a table of {spec['sweep']} has rows of another length than {heads}, or none")
    return lines


def cell_text(spec: Spec) -> str:
    points = _picked(spec)
    if not len(points):
        if "empty" not in spec:
            raise ValueError(f"{spec['sweep']} has no point with {spec.get('where')}")
        return str(spec["empty"])
    return _filled(spec["cell"], points, spec)


def _filled(text: str, points: pd.DataFrame, spec: Spec) -> str:
    return _FIELD.sub(lambda field: _field(field[1], field[2], points, spec), text)


def _entries(entries: list[Any], quote: str) -> Iterator[Spec]:
    for entry in entries:
        if entry == "scenes":
            yield from ({"head": f"{quote}{scene}{quote}", "where": {"scene": scene}} for scene in SCENES)
        else:
            check_keys("a row or column", entry, {*_OF_CELLS, "head"})
            yield entry


def _rows(spec: Spec) -> Iterator[Spec]:
    outer: list[Spec] = [{}]
    if "each" in spec:
        names, points = spec["each"], _measured(spec)
        outer = []
        for values, rows in points.groupby(names, sort=True):
            label = _filled(spec["label"], rows, spec)
            outer.append({"head": label, "where": dict(zip(names, values, strict=True))})
    inner = list(_entries(spec.get("rows", [{}]), "`"))
    for block, row_spec in product(outer, inner):
        yield united(block, row_spec, {"head": ", ".join(row["head"] for row in (block, row_spec) if "head" in row)})


def _measured(spec: Spec) -> pd.DataFrame:
    points = kept_of(spec["sweep"]).points
    return points[chosen(points, {**({"status": "ok"} if "status" in points else {}), **spec.get("where", {})})]


def _picked(spec: Spec) -> pd.DataFrame:
    points, pick = _measured(spec), spec.get("pick", "")
    if pick == "all" or not len(points):
        return points
    if pick in _SUMMARIES:
        return getattr(points, pick)(numeric_only=True).to_frame().T
    if pick.startswith("lowest "):
        known = points[points[_FIELD.findall(spec["cell"])[0][0]].notna()]
        return known.sort_values(pick.removeprefix("lowest "), kind="stable").head(1)
    rows_picked = {"best": best_rows, "first": lambda rows: rows.head(1), "": lambda rows: rows}[pick](points)
    if len(rows_picked) != 1:
        raise ValueError(f"{spec['sweep']} has {len(rows_picked)} points with {spec.get('where')}, expected one")
    return rows_picked


def _field(expression: str, form: str | None, points: pd.DataFrame, spec: Spec) -> str:
    row = points.iloc[0]
    if expression in ("split", "(split)"):
        if pd.isna(row.get("split_x")):
            return ""
        split = f"{int(row['split_x']):,} {TIMES} {int(row['split_y']):,}"
        return f" ({split})" if expression == "(split)" else split
    if form in _FORMS:
        return _FORMS[form](expression, points, spec)
    value = _value(expression, row)
    if "empty" in spec and pd.isna(value):
        return str(spec["empty"])
    if form:
        return format(value, form)
    return digits(value) if isinstance(value, float) else str(value)


def _value(expression: str, row: Any) -> Any:
    return row[expression] if expression in row else eval(expression, {"__builtins__": {}}, row)


def _interval(values: Sequence[float]) -> str:
    """ "2.40 [2.39, 2.46]", without an interval where there is none."""
    value, low, high = values
    return digits(value) if pd.isna(low) else f"{digits(value)} [{digits(low)}, {digits(high)}]"


def _estimate(name: str, points: pd.DataFrame, spec: Spec) -> Estimate:
    """The mean over a point's processes."""
    processes = kept_of(spec["sweep"]).processes
    mine = chosen(processes, {"status": "ok", "point_id": points.iloc[0]["point_id"]})
    return Estimate.of(processes[name][mine].astype(float).tolist())


def _ratio(name: str, numerator: pd.DataFrame, denominator: pd.DataFrame, spec: Spec) -> str:
    """The ratio of two points, with its interval; they share no process, so their errors are independent."""
    if numerator.iloc[0]["point_id"] == denominator.iloc[0]["point_id"]:
        return "1"
    return say(_estimate(name, numerator, spec).over(_estimate(name, denominator, spec)))


def _hours(spec: Spec, name: str) -> str:
    told = pd.to_datetime(kept_of(spec["sweep"]).processes[name].dropna())
    return f"{(told.max() - told.min()).total_seconds() / 3600:.1f}"


def _other(spec: Spec) -> pd.DataFrame:
    return _picked(united(spec, {"where": spec["over"]}))


_FORMS: dict[str | None, Callable[[str, pd.DataFrame, Spec], str]] = {
    "interval": lambda name, points, spec: _interval([points.iloc[0][f"{name}{end}"] for end in ("", "_low", "_high")]),
    "inverse": lambda name, points, spec: _interval(
        [1 / points.iloc[0][f"{name}{end}"] for end in ("", "_high", "_low")]
    ),
    "estimate": lambda name, points, spec: say(_estimate(name, points, spec)),
    "ratio": lambda name, points, spec: _ratio(name, points, _other(spec), spec),
    "under": lambda name, points, spec: _ratio(name, _other(spec), points, spec),
    "quotient": lambda name, points, spec: digits(points.iloc[0][name] / _other(spec).iloc[0][name]),
    "span": lambda name, points, spec: span(_value(name, row) for _, row in points.iterrows()),
    "list": lambda name, points, spec: ", ".join(digits(value) for value in points[name]),
    "hours": lambda name, points, spec: _hours(spec, name),
    "method": lambda name, points, spec: find_method(points.iloc[0][name]).label,
    "never": lambda name, points, spec: "never" if pd.isna(value := points.iloc[0][name]) else f"{value:,.0f}",
}
"""interval, inverse: with its interval, from the point. estimate, ratio, under (the ratio turned round): from
processes. quotient: of points. span, list: of several points. hours: from the first time of a process to the
last. method: its label."""


def _claims(spec: Spec) -> Iterator[list[str]]:
    """A row a claim: its text, another of its columns, and its verdict, under each reading where it has several."""
    rows: dict[tuple[str, str], list[str]] = {}
    for claim in kept_of(spec["sweep"]).claims:
        if claim["id"].startswith(tuple(spec.get("leave_out", ()))) or claim["id"] not in (
            spec["claims"] if isinstance(spec["claims"], list) else [claim["id"]]
        ):
            continue
        text = f"{claim['text']} (an inference of ours)" if claim["inferred"] else claim["text"]
        shown = f"{claim['reading']}: {claim['verdict']}" if claim["reading"] else claim["verdict"]
        rows.setdefault((text, claim[spec["tell"]] or "-"), []).append(shown)
    yield from ([*key, "; ".join(verdicts)] for key, verdicts in rows.items())


def digits(value: float, count: int = 3) -> str:
    """So many significant digits, but two decimals at most: 16.5, 9.25, 0.68."""
    decimals = count - 1 - floor(log10(value))
    return f"{value:.{min(max(decimals, 0), 2)}f}"


def say(estimate: Any) -> str:
    """An `Estimate` with its interval."""
    return _interval((estimate.value, estimate.low, estimate.high))


def span(values: Any) -> str:
    """ "1.22 to 1.98", or "0.98" where both ends are written alike."""
    known = [value for value in values if not pd.isna(value)]
    low, high = digits(min(known)), digits(max(known))
    return low if low == high else f"{low} to {high}"


def table_row(*cells: Any) -> str:
    return "| " + " | ".join(str(cell) for cell in cells) + " |"
