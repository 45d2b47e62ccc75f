"""Judges the claims on ray classification that claims.toml states."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.classification.classified import CLASSIFIED, ClassifiedOptions
from experiments.classification.workload import KINDS
from experiments.drawing.values import numbers
from experiments.results.claims import UNDECIDED, Judge, Judgement
from experiments.results.queries import read_claims
from experiments.results.statistics import Estimate, NotMeasuredError, geometric_mean
from experiments.results.verdicts import (
    Bounds,
    Outcome,
    case_of,
    exact,
    known_values,
    measured_rows,
    on_cases,
    ratio_of,
    say,
)

_SPEED = "speedup_vs_bvh"
_FEWEST_SIZES = 4
_OTHER_SCENES = "The paper's average is over scenes that are not here."


def usual_value(name: str) -> object:
    """The default of an option of classified rays, as the table has it."""
    field = ClassifiedOptions.__dataclass_fields__[name]
    return field.metadata.get("null") if field.default is None else getattr(field.default, "value", field.default)


def usual(rows: pd.DataFrame, **changes: object) -> pd.DataFrame:
    """The rows of classified rays with all options as they are by default, but for these."""
    classified = rows[rows["method"].eq(CLASSIFIED.name) & rows["status"].eq("ok")]
    for name in ClassifiedOptions.__dataclass_fields__:
        if name in classified and classified[name].notna().any():  # else it is newer than the table
            wanted = changes.get(name, usual_value(name))
            if wanted is not any:
                classified = classified[classified[name].eq(wanted).fillna(False).astype(bool)]
    return classified


def _judge(check: Callable[[pd.DataFrame], Judgement | None], processes: pd.DataFrame | None) -> Judgement:
    outcome = None if processes is None or "steps_ratio" not in processes else check(measured_rows(processes))
    if outcome is None:
        raise NotMeasuredError("the sweep holds no such points")
    return outcome


def _of_points(rows: pd.DataFrame) -> pd.DataFrame:
    """A row of each point: all its processes count alike."""
    return rows.drop_duplicates("point_id")


def same_hits(rows: pd.DataFrame) -> Judgement | None:
    """No ray of any point is wrong, and at most one in a million differs from the plain traversal."""
    rows = _of_points(rows)
    counts = (int(np.nansum(numbers(rows, f"rays_{name}"))) for name in ("wrong", "different", "traced"))
    wrong, different, rays = counts
    value = f"{wrong} wrong, {different} different of {rays:,} rays"
    holds = wrong == 0 and different <= 1e-6 * rays
    return on_cases([("all points", Outcome(holds, value, None, None if holds else "hits differ"))])


def _mean_of_all(rows: pd.DataFrame, name: str, bounds: Bounds) -> Judgement | None:
    """The geometric mean of a column over all points; None unless all kinds of rays are there."""
    if rows["ray_kind"].nunique() < len(KINDS):
        return None
    known = known_values(rows, numbers(rows, name))
    if len(known) < rows["point_id"].nunique():
        return Judgement(UNDECIDED, "", None, "too few processes for an interval")
    counted = [exact(value) if isinstance(value, float) else value for value in known.values()]
    mean = geometric_mean([estimate for estimate in counted if isinstance(estimate, Estimate)])
    state = bounds.decide(mean)
    return on_cases([("mean", Outcome(state, f"{mean.value:.2f}", mean, None if state else _OTHER_SCENES))])


def _on_every(rows: pd.DataFrame, values: Any, holds: Any, why: str) -> Judgement | None:
    """Whether a condition holds at every point, by what is counted; None without points."""
    cases = [
        (f"{row['scene']} {row['ray_kind']}", Outcome(bool(is_so), say(float(value)), None, None if is_so else why))
        for (_, row), value, is_so in zip(
            rows.iterrows(), np.asarray(values), np.broadcast_to(holds, len(rows)), strict=True
        )
    ]
    return on_cases(cases) if cases else None


def _by_query(query: Mapping[str, Any], table: pd.DataFrame) -> Judgement | None:
    """Judges a column, or its ratio to another, of every point with default options, but for some.

    query: column, over, at_least, at_most, and why, if it fails; options: those that differ; secondary: no primary
    rays; mean: the geometric mean of all points is judged.
    """
    rows, bounds = usual(table, **query.get("options", {})), Bounds(*(query.get(end, other) for end, other in _ENDS))
    if query.get("mean"):
        return _mean_of_all(rows, query["column"], bounds)
    rows = _of_points(rows[rows["ray_kind"].ne(KINDS[0])] if query.get("secondary") else rows)
    values = numbers(rows, query["column"])
    if "over" in query:
        values = values / numbers(rows, query["over"])
    return _on_every(rows, values, (values >= bounds.low) & (values <= bounds.high), query["why"])


_ENDS = (("at_least", -np.inf), ("at_most", np.inf))


def dedup_saves(table: pd.DataFrame) -> Judgement | None:
    """Share of the bytes of lists that is saved by storing equal ones once, between 0.1 and 0.8."""
    rows = _of_points(usual(table))
    whole = 4 * numbers(rows, "shafts_built") * (1 + numbers(rows, "list_length_mean"))
    saved = 1 - numbers(rows, "list_bytes") / whole
    return _on_every(rows, saved, (saved >= 0.1) & (saved <= 0.8), "outside on some scene")


def half_is_best(table: pd.DataFrame) -> Judgement | None:
    """Fewest steps at a probability of 0.5, within 2 %."""
    rows = _of_points(usual(table, shaft_probability=any))
    cases = []
    for (scene, kind), same in rows.groupby(["scene", "ray_kind"], observed=True):
        at_half = same[same["shaft_probability"].eq(0.5)]
        if len(same) < 3 or not len(at_half):
            continue
        least = same.loc[same["steps_ratio"].astype(float).idxmin()]
        holds = float(at_half["steps_ratio"].iloc[0]) <= 1.02 * float(least["steps_ratio"])
        why = None if holds else "another probability takes fewer steps"
        cases.append((f"{scene} {kind}", Outcome(holds, f"{least['shaft_probability']:g}", None, why)))
    return on_cases(cases) if cases else None


def high_nears_root(table: pd.DataFrame) -> Judgement | None:
    """At the highest probability the ratio lies above that at 0.5, and nearer to 1."""
    rows = _of_points(usual(table, shaft_probability=any))
    if rows.empty or rows["shaft_probability"].nunique() < 3:
        return None
    most = rows[rows["shaft_probability"].eq(rows["shaft_probability"].max())]
    least = rows[rows["shaft_probability"].eq(rows["shaft_probability"].min())]
    low, high = (numbers(part, "steps_ratio") for part in (least, most))
    value = f"lowest: up to {low.max():.2f}; highest: {high.min():.2f} to {high.max():.2f}"
    holds = bool(low.max() > 1) and bool(high.max() > 0.9)
    return on_cases([("all points", Outcome(holds, value, None, None if holds else "not on these scenes"))])


def occlusion_helps(table: pd.DataFrame) -> Judgement | None:
    """Fewer entries and steps than with probabilities that no hit ends."""
    pairs = _pairs(usual(table), usual(table, shaft_occlusion=False))
    fewer = [pairs[name] <= pairs[f"{name}_other"] for name in ("list_length_mean", "steps_ratio")]
    gain = numbers(pairs, "steps_ratio_other") / numbers(pairs, "steps_ratio")
    return _on_every(pairs, gain, fewer[0] & fewer[1], "more entries or steps")


def subset_is_efficient(table: pd.DataFrame) -> Judgement | None:
    """Lists for the most used shafts: half the bytes, and at most 1.05 times the steps."""
    pairs = _pairs(usual(table, shaft_subset="sampled", shaft_cells=any), usual(table, shaft_cells=any))
    share = numbers(pairs, "list_bytes") / numbers(pairs, "list_bytes_other")
    steps = pairs["steps_ratio"] <= 1.05 * pairs["steps_ratio_other"]
    return _on_every(pairs, share, steps & (share <= 0.5), "more bytes or steps")


def _bytes_of_lists(rows: pd.DataFrame) -> NDArray[np.float64]:
    """Look-up and lists, equal ones counted each."""
    entries = numbers(rows, "shafts_built") * numbers(rows, "list_length_mean")
    return np.asarray(numbers(rows, "lookup_bytes") + 4 * entries)


def build_time_grows(table: pd.DataFrame) -> Judgement | None:
    """As the number of shafts."""
    return _grows(table, partial(numbers, name="shaft_build_time_s"))


def bytes_grow(table: pd.DataFrame) -> Judgement | None:
    """As the number of shafts."""
    return _grows(table, _bytes_of_lists)


def _grows(table: pd.DataFrame, size: Callable[[pd.DataFrame], NDArray[np.float64]]) -> Judgement | None:
    """Exponent of a size over shafts, between 0.9 and 1.1."""
    rows = _of_points(usual(table, shaft_cells=any, shaft_directions=any))
    rows = rows[rows["shaft_cells"].ne("by memory")]
    cases = []
    for (scene, kind), same in rows.groupby(["scene", "ray_kind"], observed=True):
        if len(same) >= _FEWEST_SIZES:
            exponent = float(np.polyfit(np.log(numbers(same, "shafts")), np.log(size(same)), 1)[0])
            holds = Bounds(0.9, 1.1).decide(exponent)
            cases.append((f"{scene} {kind}", Outcome(holds, f"{exponent:.2f}", None, None if holds else "another one")))
    return on_cases(cases) if cases else None


def occupied_as_fast(table: pd.DataFrame) -> Judgement | None:
    """Time with lists for occupied voxels alone, within 1.05 of all, secondary rays."""
    occupied, every = (
        rows[rows["ray_kind"].ne(KINDS[0])] for rows in (usual(table, shaft_subset="occupied"), usual(table))
    )
    known = known_values(occupied, numbers(occupied, _SPEED)) | known_values(every, numbers(every, _SPEED))
    cases = []
    for _, row in _pairs(occupied, every).iterrows():
        ratio = ratio_of(known.get(row["point_id_other"]), known.get(row["point_id"]))
        if ratio is not None:
            cases.append((f"{row['scene']} {row['ray_kind']}", case_of([ratio], Bounds(high=1.05))))
    return on_cases(cases) if cases else None


def _pairs(rows: pd.DataFrame, others: pd.DataFrame) -> pd.DataFrame:
    """Rows beside those of the same scene, kind of rays and voxels among others; values of these end in _other."""
    keys = ["scene", "ray_kind", "shaft_cells"]
    return rows.drop_duplicates(keys).merge(others.drop_duplicates(keys), on=keys, suffixes=("", "_other"))


_FUNCTIONS: Mapping[str, Callable[[pd.DataFrame], Judgement | None]] = {
    function.__name__: function
    for function in (
        same_hits, half_is_best, high_nears_root, dedup_saves, occlusion_helps, subset_is_efficient, bytes_grow,
        build_time_grows, occupied_as_fast,
    )
}  # fmt: skip


def _judges(query: Mapping[str, Any]) -> Mapping[str, Judge]:
    """What judges a claim: a function by its name, or `_by_query`."""
    check = _FUNCTIONS[query["function"]] if "function" in query else partial(_by_query, query)
    return {"": partial(_judge, check)}


CLAIMS = read_claims(Path(__file__).with_suffix(".toml"), {}, _judges)
