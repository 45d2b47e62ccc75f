"""Claims of a TOML file: most say by a query what judges them, the others name a function.

    judge = {column = "speedup", where = {method = "aligned", positions = {at_least = 16}}, at_least = 1.0}

column, over: a column of the table of processes, or its ratio to another one. where: column -> its value, a list of
values, or {not = ...}, {at_least = ...}, {below = ...}, {at_most = ...}, {known = true}, or {has = [...]} for names
with commas, such as a point's grids. least: of these rows those alone with the least number of this column. at_least,
at_most: bounds. counted: it has no noise. some: one scene is enough. A claim that no table can judge has a text
instead, which says why.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.results.claims import Claim, Judge, Judgement
from experiments.results.statistics import NotMeasuredError
from experiments.results.table import columns
from experiments.results.verdicts import Bounds, value_judge

_KNOWN = {"column", "over", "where", "least", "at_least", "at_most", "counted", "some"}
_TESTS: dict[str, Callable[[pd.Series, Any], Any]] = {
    "not": lambda values, other: ~values.eq(other).fillna(False).astype(bool),
    "at_least": lambda values, least: values >= least,
    "at_most": lambda values, most: values <= most,
    "below": lambda values, most: values < most,
    "known": lambda values, _: values.notna(),
    "has": lambda values, names: values.fillna("").str.split(",").map(lambda parts: not set(names).isdisjoint(parts)),
}


def read_claims(
    path: Path,
    judges: Mapping[str, Mapping[str, Judge]],
    judges_of: Callable[[Any], Mapping[str, Judge]] | None = None,
    **numbers: Any,
) -> tuple[Claim, ...]:
    """The claims of a TOML file, in its order. judges: by id, of those that have no `judge` in the file, under each of
    their readings. judges_of: what a `judge` means, under each reading; without it `query_judge`, under one.

    In `paper` and `how` of a claim, {name} stands for the text of that name in [words], or for one of the numbers.
    Raises ValueError where a claim has no judge or two, and for a query that cannot be read.
    """
    judges_of = judges_of or (lambda query: {"": query_judge(query)})
    told = tomllib.loads(path.read_text(encoding="utf-8"))
    ids = [claim["id"] for claim in told["claims"] if "judge" not in claim]
    if set(ids) != judges.keys():
        raise ValueError(f"{path} leaves the claims {ids} to functions, expected {[*judges]}")
    words = dict(numbers)
    for name, text in told["words"].items():
        words[name] = text.format(**words)
    return tuple(
        Claim(
            claim["id"], claim["section"], claim["text"], claim["paper"].format(**words),
            claim.get("how", "").format(**words),
            judges_of(claim["judge"]) if "judge" in claim else judges[claim["id"]], claim.get("inferred", False),
        )
        for claim in told["claims"]
    )  # fmt: skip


def query_judge(query: Mapping[str, Any] | str) -> Judge:
    """What judges a claim by a query, or says why nothing does. Raises ValueError for a key that no query has."""
    if isinstance(query, str):
        return _unjudged(query)
    check_keys("a judge", query, _KNOWN)
    numerator, denominator = query["column"], query.get("over")

    def values(rows: pd.DataFrame) -> Any:
        numbers = _numbers(rows, numerator)
        return numbers if denominator is None else numbers / _numbers(rows, denominator)

    def which(rows: pd.DataFrame) -> pd.Series:
        asked = rows["scene"].notna() & chosen(rows, query.get("where", {}))
        if "least" in query:
            numbers = _numbers(rows, query["least"]).where(asked)
            asked &= numbers.eq(numbers.min())
        return asked

    return value_judge(values, which, bounds_of(query), query.get("counted", False), not query.get("some", False))


def bounds_of(query: Mapping[str, Any]) -> Bounds:
    """at_least, at_most, above and below; within: a factor of 1, up and down."""
    low, high = query.get("at_least", -math.inf), query.get("at_most", math.inf)
    if "within" in query:
        low, high = 1 / query["within"], query["within"]
    low = math.nextafter(query["above"], math.inf) if "above" in query else low
    high = math.nextafter(query["below"], -math.inf) if "below" in query else high
    return Bounds(low, high)


def check_keys(what: str, told: Mapping[str, Any], known: Collection[str]) -> None:
    """Raise ValueError for a key that nothing reads."""
    if unknown := told.keys() - set(known):
        raise ValueError(f"{what} has {sorted(unknown)}, expected some of {sorted(known)}")


def _unjudged(why: str) -> Judge:
    def judge(evidence: Any) -> Judgement:
        raise NotMeasuredError(why)

    return judge


def chosen(rows: pd.DataFrame, where: Mapping[str, Any]) -> pd.Series:
    """Which rows have these values; in a column that is newer than their table they have none. Raises ValueError for a
    column that no table has."""
    fits = pd.Series(True, index=rows.index)
    for name, wanted in where.items():
        values = _column(rows, name)
        if isinstance(wanted, dict):
            ((test, limit),) = wanted.items()
            kept = _TESTS[test](values, limit)
        else:
            kept = values.isin(wanted) if isinstance(wanted, list) else values.eq(wanted)
        fits &= kept.fillna(False).astype(bool)
    return fits


def _numbers(rows: pd.DataFrame, name: str) -> pd.Series:
    return pd.to_numeric(_column(rows, name), errors="coerce").astype(float)


def _column(rows: pd.DataFrame, name: str) -> pd.Series:
    if name in rows:
        return rows[name]
    if name not in columns():
        raise ValueError(f"{name} is a column of no table, expected one that a workload, a method or every point has")
    return pd.Series(pd.NA, index=rows.index, dtype="object")
