"""Claims that claims.toml says in full: ratios of a scene's aligned points, at one number of splits after another.

    judge = {numerator = {splits = "columns"}, denominator = {splits = "rows"}, at = [2, 4], shown = "mean", above = 1}

of: what is compared, one of `_KINDS`; speed where nothing is said. numerator, denominator: two points for each number
n in `at`. splits: a name of `_SPLITS`; where that is a choice, the best. culling (true) and geometry ("copied") of a
point. Instead of a point, "baseline" is that of the reading.
some_at: a number of splits at which nothing was measured is left out; lacking: what is said where none is left.
unless: where one was left out, which might have changed the outcome, this is not measured unless it is that, holds or
fails; so_far: what is said then, with {missing}.
shown: which ratio has the verdict and the interval, the mean of all, that at the last n, the largest, or over a
baseline the best, chosen on some processes and reported by others. above, within: bounds of that; above = "paper" is
the paper's best speed-up on its scene. each: bounds of every ratio (above, below, at_most, within), which fail where
one is outside.
value, fails, each_fails, open: texts with fields. {shown}, {n}: that ratio, and where it is. {limit}: what it is to be
above. {bad}, {n}: the first outside. {each}: all ratios. {last}: the last n. Other fields are `_MORE`.
cost: what instances cost in frame time is told with its interval.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from experiments.paper.evidence import Scene, measured_at, read_numbers
from experiments.paper.readings import Reading, baseline, best, best_gain
from experiments.results.queries import bounds_of
from experiments.results.statistics import Estimate, NotMeasuredError, geometric_mean
from experiments.results.verdicts import Known, Outcome
from experiments.workloads.build import BUILD
from experiments.workloads.frame import FRAME
from experiments.workloads.memory import MEMORY
from experiments.workloads.reported import BEST_SPEEDUPS

GRID_SPLITS = (2, 4, 8, 16)
"""Splits of one axis in the paper's figure 4, beside none."""

KEYS = (
    "of", "numerator", "denominator", "at", "some_at", "lacking", "unless", "so_far", "shown", "above", "within",
    "each", "cost", "value", "fails", "each_fails", "open",
)  # fmt: skip

TOO_WIDE = "the interval is wider than the difference"

_SPLITS: Mapping[str, Callable[[int], list[tuple[int, int]]]] = {
    "none": lambda n: [(1, 1)],
    "columns": lambda n: [(n, 1)],
    "rows": lambda n: [(1, n)],
    "one axis": lambda n: [(n, 1), (1, n)],
    "both axes": lambda n: [(x, n // x) for x in GRID_SPLITS if n // x >= 2],
    "any of one axis": lambda n: [split for count in GRID_SPLITS for split in ((count, 1), (1, count))],
    "any of both axes": lambda n: [(x, y) for x in GRID_SPLITS for y in GRID_SPLITS],
}
_NO_CHOICE = ("none", "columns", "rows")

_KINDS: Mapping[str, Mapping[str, Any]] = {
    "speed": {"column": "speedup", "packet_width": 1},
    "build": {"column": "build_over_plain", "workload": BUILD.name},
    "boxes": {"column": "boxes_entered", "workload": BUILD.name},
    "memory": {"column": "embree_bytes", "workload": MEMORY.name},
    "frame bytes": {"column": "embree_bytes", "workload": FRAME.name, "packet_width": 1},
}
"""What is compared. speed: over rtcIntersect1 in the same rounds; workload: of the reading where none is said. build:
over the build of the plain mesh in the same rounds. boxes: those that a random ray enters, over the cells it serves."""

_COUNTED = ("boxes_entered", "embree_bytes")


def judge_ratios(query: Mapping[str, Any], scene: Scene, reading: Reading) -> Outcome:
    """One scene's outcome. Raises NotMeasuredError."""
    ratios, missing = (_best if query["shown"] == "best" else _of_points)(query, scene, reading)
    if missing and not (query.get("some_at") and ratios):
        raise NotMeasuredError(query.get("lacking") or next(iter(missing.values())))
    shown, n = _shown(query["shown"], ratios)
    limit = BEST_SPEEDUPS[scene.name] if query.get("above") == "paper" else query.get("above")
    fields = _Fields(query, scene, reading, ratios, shown=shown, n=n, limit=limit)
    fields["missing"] = next(iter(missing.values()), None)
    outcome = _outcome({**query, "above": limit} if limit else query, fields)
    if missing and "unless" in query and outcome.holds is not {"holds": True, "fails": False}[query["unless"]]:
        raise NotMeasuredError(query.get("so_far", "{missing}").format_map(fields))
    return outcome


def _best(query: Mapping[str, Any], scene: Scene, reading: Reading) -> tuple[dict[int, Known], dict[int, str]]:
    """The best ratio alone, by its number of splits, and why another was not measured."""
    is_over = query["denominator"] == "baseline"
    point = query["numerator" if is_over else "denominator"]
    gain = best_gain(scene, reading, splits=query["at"], culling=point["culling"])
    ratio = gain.estimate if is_over else gain.estimate.inverse()
    return {gain.splits: ratio}, {} if gain.missing is None else {0: gain.missing}


def _of_points(query: Mapping[str, Any], scene: Scene, reading: Reading) -> tuple[dict[int, Known], dict[int, str]]:
    """The ratios, by number of splits, and why others were not measured."""

    def ratio(n: int) -> Known:
        kind = {"workload": reading.workload, **_KINDS[query.get("of", "speed")]}
        numerator, denominator = (
            baseline(scene, reading) if query[end] == "baseline" else _read(scene, n, query[end], **kind)
            for end in ("numerator", "denominator")
        )
        return numerator.over(denominator) if isinstance(numerator, Estimate) else numerator / denominator

    return measured_at(query["at"], ratio)


def _read(scene: Scene, n: int, point: Mapping[str, Any], column: str, workload: str, **more: Any) -> Any:
    """A number of a point, of a choice of splits that of the best. Raises NotMeasuredError."""
    choice = point.get("splits", "columns")
    options = {"culling": point.get("culling", True), "geometry": point.get("geometry", "copied"), **more}
    samples = {split: scene.sample(column, workload, split, **options) for split in _SPLITS[choice](n)}
    first = next(iter(samples.values()))
    if column in _COUNTED:
        return first.values[0] / (n if column == "boxes_entered" and choice != "none" else 1)
    return first.estimate() if choice in _NO_CHOICE else best(samples)[1]


def _outcome(query: Mapping[str, Any], fields: _Fields) -> Outcome:
    """What the ratios say by the query's bounds, in its words."""
    shown = fields["shown"]
    interval = fields["cost"] if query.get("cost") else shown if isinstance(shown, Estimate) else None
    tell = partial(Outcome, value=query["value"].format_map(fields), estimate=interval)
    states = {n: bounds_of(query["each"]).decide(ratio) for n, ratio in fields.ratios.items() if "each" in query}
    for n, state in states.items():
        if state is False:
            return tell(False, why=query["each_fails"].format_map({"bad": fields.ratios[n], "n": n}))
    is_bound = "above" in query or "within" in query
    holds = bounds_of(query).decide(shown) if is_bound else None if None in states.values() else True
    if holds is False and "fails" in query:
        return tell(False, why=query["fails"].format_map(fields))
    return tell(True) if holds else tell(None, why=query.get("open", TOO_WIDE))


def _shown(which: str, ratios: Mapping[int, Known]) -> tuple[Known, int]:
    """The ratio that is told, and at which number of splits it is, 0 for the mean of all."""
    if which == "mean":
        return geometric_mean([known for known in ratios.values() if isinstance(known, Estimate)]), 0
    n = max(ratios) if which != "largest" else max(ratios, key=lambda at: _number(ratios[at]))
    return ratios[n], n


def _number(known: Known) -> float:
    return known if isinstance(known, float) else known.value


class _Fields(dict[str, Any]):
    """Fields of a claim's texts; those that must be measured are read when a text has them."""

    def __init__(
        self, query: Mapping[str, Any], scene: Scene, reading: Reading, ratios: Mapping[int, Known], **known: Any
    ) -> None:
        super().__init__(known)
        self.query, self.scene, self.reading, self.ratios = query, scene, reading, ratios

    def __missing__(self, name: str) -> Any:
        return self.setdefault(name, _MORE[name](self))


def _growth(fields: _Fields, splits: int) -> str:
    """What a process grew by from the loaded mesh to the built BVH, or that it was not measured."""
    rows = fields.scene.processes(MEMORY.name, (splits, 1), culling=True)[:1]
    try:
        growth = read_numbers(rows, "rss_bytes") - read_numbers(rows, "rss_mesh_bytes")
    except NotMeasuredError:
        return "not measured"
    return f"{growth[0] / 2**20:+,.1f} MiB"


def _with_plan(fields: _Fields) -> float:
    """Plan and build together at the last n, over those at one split."""
    kind = {"column": "plan_and_build_over_plain", "workload": BUILD.name}
    columns, whole = (_read(fields.scene, n, {}, **kind) for n in (max(fields.ratios), 1))
    return float(columns.over(whole).value)


def _cost(fields: _Fields) -> Estimate | None:
    """Frame time of the widest packets over that of the other point, mean over splits; None where not measured."""
    kind = {**_KINDS["speed"], "workload": FRAME.name, "packet_width": fields.scene.widest_packets(FRAME.name)}
    ends = [fields.query[end] for end in ("denominator", "numerator")]

    def ratio(n: int) -> Estimate:
        other, instances = (_read(fields.scene, n, point, **kind) for point in ends)
        return other.over(instances)

    ratios, _ = measured_at(fields.query["at"], ratio)
    return geometric_mean(list(ratios.values())) if ratios else None


def _price(fields: _Fields) -> str:
    cost = fields["cost"]
    return "frame time not measured" if cost is None else f"frame time x {cost.value:.2f}, mean over splits"


_MORE: Mapping[str, Callable[[_Fields], Any]] = {
    "inverse": lambda fields: fields["shown"].inverse(),
    "last": lambda fields: max(fields.ratios),
    "each": lambda fields: ", ".join(f"{n}: {_number(ratio):.2f}" for n, ratio in fields.ratios.items()),
    "growth_at_one": lambda fields: _growth(fields, 1),
    "growth_at_last": lambda fields: _growth(fields, max(fields.ratios)),
    "with_plan": _with_plan,
    "cost": _cost,
    "price": _price,
}
"""growth_at_one, growth_at_last: of the process. cost, price: frame time of instances."""
