"""What Hendrich et al. 2019 claim of ray classification, in our own words, and what a table says of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.values import numbers
from experiments.methods.classified import CLASSIFIED, ClassifiedOptions
from experiments.results.claims import DOES_NOT_HOLD, HOLDS, UNDECIDED, Claim, Judge, Judgement, NotMeasuredError

KINDS = ("primary", "occlusion", "diffuse")

_OTHER_SCENES = "The paper's average is over scenes that are not here."
_POP = "Nodes tested when popped, complete shafts within the memory of the BVH, single rays"
_SECTIONS = {"abstract": "abstract", "lists": "§3", "memory": "§4"}


def usual_value(name: str) -> object:
    """The default of an option of classified rays, as the table has it."""
    field = ClassifiedOptions.__dataclass_fields__[name]
    return field.metadata.get("null") if field.default is None else getattr(field.default, "value", field.default)


def usual(rows: pd.DataFrame, **changes: object) -> pd.DataFrame:
    """The rows of classified rays with all options as they are by default, but for these."""
    found = rows[rows["method"].eq(CLASSIFIED.name) & rows["status"].eq("ok")]
    for name in ClassifiedOptions.__dataclass_fields__:
        if name in found:
            wanted = changes.get(name, usual_value(name))
            if wanted is not any:
                found = found[found[name].eq(wanted).fillna(False).astype(bool)]
    return found


def _mean(values: NDArray[np.float64]) -> float:
    return float(np.exp(np.log(values).mean()))


def _each(rows: pd.DataFrame, column: str) -> str:
    return "; ".join(
        f"{row['scene']} {row['ray_kind']} {row[column]:.2f}" for _, row in rows.iterrows() if pd.notna(row[column])
    )


def _judged(holds: bool, value: str, why: str, interval: str | None = None) -> Judgement:
    return Judgement(HOLDS if holds else DOES_NOT_HOLD, value, interval, None if holds else why)


def _judge(check: Callable[[pd.DataFrame], Judgement | None], table: pd.DataFrame | None) -> Judgement:
    found = None if table is None or "steps_ratio" not in table else check(table)
    if found is None:
        raise NotMeasuredError("the sweep holds no such points")
    return found


def same_hits(table: pd.DataFrame) -> Judgement | None:
    """No ray of any point is wrong, and at most one in a million differs from the plain traversal."""
    rows = table[table["status"].eq("ok")]
    if not len(rows):
        return None
    counts = (int(np.nansum(numbers(rows, f"rays_{name}"))) for name in ("wrong", "different", "traced"))
    wrong, different, rays = counts
    value = f"{wrong} wrong, {different} different of {rays:,} rays"
    return _judged(wrong == 0 and different <= 1e-6 * rays, value, "hits differ")


def _mean_of_all(table: pd.DataFrame, name: str) -> tuple[pd.DataFrame, float, str] | None:
    """Usual rows, the geometric mean of a column and it in words; None unless all kinds of rays are there."""
    rows = usual(table)
    if rows["ray_kind"].nunique() < len(KINDS):
        return None
    mean = _mean(numbers(rows, name))
    return rows, mean, f"{mean:.2f} ({_each(rows, name)})"


def fewer_steps(table: pd.DataFrame) -> Judgement | None:
    """Geometric mean of steps_ratio."""
    if (found := _mean_of_all(table, "steps_ratio")) is None:
        return None
    _, mean, value = found
    return _judged(mean <= 0.58, value, f"{mean:.2f} of the steps. {_OTHER_SCENES}")


def less_time(table: pd.DataFrame) -> Judgement | None:
    """Geometric mean of speedup_vs_bvh, and its interval."""
    if (found := _mean_of_all(table, "speedup_vs_bvh")) is None:
        return None
    rows, _, value = found
    ends = [numbers(rows, f"speedup_vs_bvh_{end}") for end in ("low", "high")]
    if not np.isfinite(ends).all():
        return Judgement(UNDECIDED, value, None, "too few processes for an interval")
    low, high = (_mean(end) for end in ends)
    why = f"at most {high:.2f} times as fast. {_OTHER_SCENES}"
    return _judged(high >= 1.18, value, why, f"[{low:.2f}, {high:.2f}]")


def _on_every(rows: pd.DataFrame, values: Any, holds: Any, why: str) -> Judgement | None:
    """Whether a condition holds on every row, told with the values of all; None without rows."""
    if not len(rows):
        return None
    return _judged(bool(np.all(holds)), _each(rows.assign(value=values), "value"), why)


def less_traffic(table: pd.DataFrame) -> Judgement | None:
    """bytes_touched below those from the root."""
    rows = usual(table)
    ratio = numbers(rows, "bytes_touched") / numbers(rows, "plain_bytes_touched")
    return _on_every(rows, ratio, ratio < 1, "some rays read more")


def half_is_best(table: pd.DataFrame) -> Judgement | None:
    """Fewest steps at a probability of 0.5, within 2 %."""
    rows = usual(table, shaft_probability=any)
    values, found = [], []
    for (scene, kind), same in rows.groupby(["scene", "ray_kind"], observed=True):
        at_half = same[same["shaft_probability"].eq(0.5)]
        if len(same) < 3 or not len(at_half):
            continue
        least = same.loc[same["steps_ratio"].astype(float).idxmin()]
        found.append(float(at_half["steps_ratio"].iloc[0]) <= 1.02 * float(least["steps_ratio"]))
        values.append(f"{scene} {kind} {least['shaft_probability']:g}")
    return _judged(all(found), "; ".join(values), "another probability takes fewer steps") if found else None


def high_nears_root(table: pd.DataFrame) -> Judgement | None:
    """At the highest probability the ratio lies above that at 0.5, and nearer to 1."""
    rows = usual(table, shaft_probability=any)
    if rows.empty or rows["shaft_probability"].nunique() < 3:
        return None
    most = rows[rows["shaft_probability"].eq(rows["shaft_probability"].max())]
    least = rows[rows["shaft_probability"].eq(rows["shaft_probability"].min())]
    low, high = (numbers(part, "steps_ratio") for part in (least, most))
    value = f"lowest: up to {low.max():.2f}; highest: {high.min():.2f} to {high.max():.2f}"
    return _judged(bool(low.max() > 1) and bool(high.max() > 0.9), value, "not on these scenes")


def dedup_saves(table: pd.DataFrame) -> Judgement | None:
    """Bytes of lists saved by storing equal ones once, between 10 and 80 %."""
    rows = usual(table)
    whole = 4 * numbers(rows, "shafts_built") * (1 + numbers(rows, "list_length_mean"))
    saved = 1 - numbers(rows, "list_bytes") / whole
    return _on_every(rows, saved, (saved >= 0.1) & (saved <= 0.8), "outside on some scene")


def occupied_serves(table: pd.DataFrame) -> Judgement | None:
    """No secondary ray starts from the root with lists for occupied voxels alone."""
    rows = usual(table, shaft_subset="occupied")
    rows = rows[rows["ray_kind"].ne(KINDS[0])]
    count = rows["rays_from_root"]
    return _on_every(rows, count, count.eq(0).all(), "some start from the root")


def occlusion_helps(table: pd.DataFrame) -> Judgement | None:
    """Fewer entries and steps than with probabilities that no hit ends."""
    pairs = _pairs(usual(table), usual(table, shaft_occlusion=False))
    fewer = [pairs[name] <= pairs[f"{name}_other"] for name in ("list_length_mean", "steps_ratio")]
    gain = numbers(pairs, "steps_ratio_other") / numbers(pairs, "steps_ratio")
    return _on_every(pairs, gain, (fewer[0] & fewer[1]).all(), "not on every scene")


def subset_is_efficient(table: pd.DataFrame) -> Judgement | None:
    """Lists for the most used shafts: half the bytes, and at most 1.05 times the steps."""
    pairs = _pairs(usual(table, shaft_subset="sampled", shaft_cells=any), usual(table, shaft_cells=any))
    share = numbers(pairs, "list_bytes") / numbers(pairs, "list_bytes_other")
    steps = pairs["steps_ratio"] <= 1.05 * pairs["steps_ratio_other"]
    return _on_every(pairs, share, (steps & (share <= 0.5)).all(), "not on every scene")


def much_lower(table: pd.DataFrame) -> Judgement | None:
    """Height of the entries, at most half that of the root."""
    rows = usual(table)
    height = numbers(rows, "entry_height_mean") / numbers(rows, "root_height")
    return _on_every(rows, height, height <= 0.5, "higher on some scene")


def _bytes_of_lists(rows: pd.DataFrame) -> NDArray[np.float64]:
    """Look-up and lists, equal ones counted each."""
    entries = numbers(rows, "shafts_built") * numbers(rows, "list_length_mean")
    return np.asarray(numbers(rows, "lookup_bytes") + 4 * entries)


def _time_of_lists(rows: pd.DataFrame) -> NDArray[np.float64]:
    return np.asarray(numbers(rows, "shaft_build_time_s"))


def grows_with_resolution(table: pd.DataFrame, size: Callable[[pd.DataFrame], NDArray[np.float64]]) -> Judgement | None:
    """Exponent of a size over shafts, between 0.9 and 1.1."""
    rows = usual(table, shaft_cells=any, shaft_directions=any)
    rows = rows[rows["shaft_cells"].ne("by memory")]
    exponents, values = [], []
    for (scene, kind), same in rows.groupby(["scene", "ray_kind"], observed=True):
        if len(same) < 4:
            continue
        exponents.append(float(np.polyfit(np.log(numbers(same, "shafts")), np.log(size(same)), 1)[0]))
        values.append(f"{scene} {kind} {exponents[-1]:.2f}")
    if not exponents:
        return None
    return _judged(all(0.9 <= one <= 1.1 for one in exponents), "; ".join(values), "another exponent on some scene")


def occupied_as_fast(table: pd.DataFrame) -> Judgement | None:
    """Time with lists for occupied voxels alone, within 1.05 of all, secondary rays."""
    pairs = _pairs(usual(table, shaft_subset="occupied"), usual(table))
    pairs = pairs[pairs["ray_kind"].ne(KINDS[0])]
    time = numbers(pairs, "speedup_vs_bvh_other") / numbers(pairs, "speedup_vs_bvh")
    return _on_every(pairs, time, time <= 1.05, "slower on some scene")


def _pairs(rows: pd.DataFrame, others: pd.DataFrame) -> pd.DataFrame:
    """Rows beside those of the same scene, kind of rays and voxels among others; values of these end in _other."""
    keys = ["scene", "ray_kind", "shaft_cells"]
    return rows.drop_duplicates(keys).merge(others.drop_duplicates(keys), on=keys, suffixes=("", "_other"))


def _claim(id: str, section: str, text: str, paper: str, how: str, check: Callable[..., Judgement | None]) -> Claim:
    judges: Mapping[str, Judge] = {"": partial(_judge, check)}
    return Claim(id, _SECTIONS[section], text, paper, how, judges)


_USUAL = f"{_POP}; primary rays, occlusion and one diffuse bounce."

CLAIMS = (
    _claim(
        "same-hits", "lists", "Rays hit what they hit from the root.", "exact",
        "All points: none wrong, at most one in a million differs.", same_hits,
    ),
    _claim(
        "fewer-steps", "abstract", "On average 42 % fewer traversal steps.", "0.58",
        f"{_USUAL} Geometric mean of steps over those from the root, at most 0.58.", fewer_steps,
    ),
    _claim(
        "less-time", "abstract", "On average about 15 % less time.", "1.18",
        f"{_USUAL} Geometric mean of the time from the root over ours; the interval reaches 1.18.", less_time,
    ),
    _claim(
        "less-traffic", "lists", "Less memory is read.", "less",
        f"{_USUAL} Bytes of nodes, blocks and lists over those from the root, below 1 on every scene.", less_traffic,
    ),
    _claim(
        "half-is-best", "lists", "Nodes are best opened from a probability of one half on.", "0.5",
        f"{_USUAL} Fewest steps at 0.5, within 2 %, on every scene.", half_is_best,
    ),
    _claim(
        "extremes-lose", "lists", "Low probabilities may take more steps than the root; high ones come near it.",
        "more, and near 1", f"{_USUAL} The lowest exceeds 1 on some scene, the highest 0.9.", high_nears_root,
    ),
    _claim(
        "equal-lists", "memory", "Storing equal lists once saves 10 to 80 %.", "10 to 80 %",
        f"{_USUAL} Bytes saved, inside on every scene.", dedup_saves,
    ),
    _claim(
        "occupied-serves-secondary", "memory", "Voxels with triangles serve all rays that start on them.", "all",
        "Lists for occupied voxels alone: no secondary ray starts from the root.", occupied_serves,
    ),
    _claim(
        "occlusion-helps", "lists", "Probabilities should know what hides a node.", "fewer",
        "Sampled rays end at their hits or not: fewer entries and steps, on every scene.", occlusion_helps,
    ),
    _claim(
        "subset-is-efficient", "memory", "Lists for the most used shafts alone serve nearly as well.", "efficient",
        "Sampled shafts: half the bytes and at most 1.05 times the steps of all.", subset_is_efficient,
    ),
    _claim(
        "grows-with-shafts", "memory", "Memory grows as the number of shafts.", "O(s^3 d^2 k)",
        "Exponent of bytes, equal lists counted each, over shafts, 0.9 to 1.1.",
        partial(grows_with_resolution, size=_bytes_of_lists),
    ),
    _claim(
        "built-shaft-by-shaft", "memory", "The time to build lists grows as the number of shafts.",
        "O(s^3 d^2 k log n)", "Exponent of the time to build them over shafts, 0.9 to 1.1; n is not varied.",
        partial(grows_with_resolution, size=_time_of_lists),
    ),
    _claim(
        "lower-subtrees", "lists", "Entries are the roots of much lower subtrees.", "much lower",
        f"{_USUAL} Height of entries, at most half the root's (our reading).", much_lower,
    ),
    _claim(
        "occupied-as-fast", "memory", "Lists for occupied voxels alone are as fast.", "as fast",
        "Secondary rays: time within 1.05 of that with all lists (our reading).", occupied_as_fast,
    ),
)  # fmt: skip
"""Quaternary trees, which the paper has too, are not judged."""
