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

from experiments.paper.evidence import (
    NotMeasuredError,
    Row,
    SceneRows,
    best,
    estimate,
    measured_at,
    read_number,
    read_positive,
)
from experiments.paper.judging import TOO_WIDE
from experiments.paper.readings import Reading, best_gain, relative_to_baseline
from experiments.results.statistics import Estimate, geometric_mean
from experiments.results.verdicts import Bounds, Known, Outcome, decide_greater
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

BASELINE = "baseline"

_SPLITS: Mapping[str, Callable[[int], list[tuple[int, int]]]] = {
    "none": lambda n: [(1, 1)],
    "columns": lambda n: [(n, 1)],
    "rows": lambda n: [(1, n)],
    "one axis": lambda n: [(n, 1), (1, n)],
    "both axes": lambda n: [(x, n // x) for x in GRID_SPLITS if n // x >= 2],
    "any of one axis": lambda n: [split for count in GRID_SPLITS for split in ((count, 1), (1, count))],
    "any of both axes": lambda n: [(x, y) for x in GRID_SPLITS for y in GRID_SPLITS],
}

Point = Mapping[str, Any]


def judge_ratios(query: Mapping[str, Any], scene: SceneRows, reading: Reading) -> Outcome:
    """One scene's outcome. Raises NotMeasuredError."""
    over_baseline = BASELINE in (query["numerator"], query["denominator"])
    ratios, missing = (_over_baseline if over_baseline else _of_points)(query, scene, reading)
    if missing and not (query.get("some_at") and ratios):
        raise NotMeasuredError(query.get("lacking") or next(iter(missing.values())))
    shown, n = _shown(query["shown"], ratios)
    cost = _cost_of_instances(scene, query) if query.get("cost") else None
    limit = BEST_SPEEDUPS[scene.paper_scene] if query.get("above") == "paper" else query.get("above")
    why = next(iter(missing.values()), None)
    fields = _Fields(scene, ratios, shown=shown, n=n, cost=cost, limit=limit, missing=why)
    outcome = _outcome({**query, "above": limit}, fields)
    if missing and "unless" in query and outcome.holds is not {"holds": True, "fails": False}[query["unless"]]:
        raise NotMeasuredError(query.get("so_far", "{missing}").format_map(fields))
    return outcome


def _of_points(query: Mapping[str, Any], scene: SceneRows, reading: Reading) -> tuple[dict[int, Known], dict[int, str]]:
    """The ratios, by number of splits, and why others were not measured."""
    read = _KINDS[query.get("of", "speed")]

    def ratio(n: int) -> Known:
        usual = {"splits": "columns", "workload": reading.workload}
        numerator, denominator = (read(scene, n, usual | query[end]) for end in ("numerator", "denominator"))
        return numerator.over(denominator) if isinstance(numerator, Estimate) else numerator / denominator

    return measured_at(query["at"], ratio)


def _over_baseline(
    query: Mapping[str, Any], scene: SceneRows, reading: Reading
) -> tuple[dict[int, Known], dict[int, str]]:
    """The same, of the one ratio that is shown."""
    is_over = query["denominator"] == BASELINE
    culling = query["numerator" if is_over else "denominator"].get("culling", True)
    if query["shown"] == "best":
        top = best_gain(scene, reading, splits=query["at"], culling=culling)
        n, gain, missing = top.splits, top.gain, {} if top.missing is None else {0: top.missing}
    else:
        speedups, missing = measured_at(
            query["at"], lambda n: scene.speedups((n, 1), culling=culling, workload=reading.workload)
        )
        if not speedups:
            return {}, missing
        n = max(speedups)
        gain = relative_to_baseline(estimate(speedups[n]), scene, reading)
    return {n: gain if is_over else gain.inverse()}, missing


def _outcome(query: Mapping[str, Any], fields: _Fields) -> Outcome:
    """What the ratios say by the query's bounds, in its words."""
    shown, ratios = fields["shown"], fields.ratios
    interval = fields["cost"] if query.get("cost") else shown if isinstance(shown, Estimate) else None
    tell = partial(Outcome, value=query["value"].format_map(fields), estimate=interval)
    states = {at: _decide(known, query["each"]) for at, known in ratios.items()} if "each" in query else {}
    for at, state in states.items():
        if state is False:
            return tell(False, why=query["each_fails"].format_map(_Fields(fields.scene, ratios, bad=ratios[at], n=at)))
    is_bound = query["above"] is not None or "within" in query
    holds = _decide(shown, query) if is_bound else None if None in states.values() else True
    if holds is False and "fails" in query:
        return tell(False, why=query["fails"].format_map(fields))
    return tell(True) if holds else tell(None, why=query.get("open", TOO_WIDE))


def _shown(which: str, ratios: Mapping[int, Known]) -> tuple[Known, int]:
    """The ratio that is told, and at which number of splits it is, 0 for the mean of all."""
    if which == "mean":
        return geometric_mean([known for known in ratios.values() if isinstance(known, Estimate)]), 0
    n = max(ratios) if which != "largest" else max(ratios, key=lambda at: _number(ratios[at]))
    return ratios[n], n


def _decide(known: Known, bounds: Mapping[str, Any]) -> bool | None:
    """True inside, False outside, None = the interval leaves it open; what is counted leaves nothing open."""
    if isinstance(known, float):
        if "at_most" in bounds:
            return known <= float(bounds["at_most"])
        return known > bounds["above"] if bounds.get("above") is not None else known < float(bounds["below"])
    if bounds.get("above") is not None:
        return decide_greater(known, bounds["above"])
    if "within" in bounds:
        return Bounds(1 / bounds["within"], bounds["within"]).decide(known)
    return Bounds(high=bounds["at_most"]).decide(known)


def _number(known: Known) -> float:
    return known if isinstance(known, float) else known.value


class _Fields(dict[str, Any]):
    """Fields of a claim's texts; those that must be measured are read when a text has them."""

    def __init__(self, scene: SceneRows, ratios: Mapping[int, Known], **known: Any) -> None:
        super().__init__(known)
        self.scene, self.ratios = scene, ratios

    def __missing__(self, name: str) -> Any:
        return _MORE[name](self, self.scene, self.ratios)


def _point(scene: SceneRows, workload: str, split: tuple[int, int], point: Point, **more: Any) -> list[Row]:
    options = {"culling": point.get("culling", True), "geometry": point.get("geometry", "copied")}
    return scene.processes(workload, split, **options, **more)


def _speed(scene: SceneRows, n: int, point: Point) -> Estimate:
    """Speed-up of single rays over rtcIntersect1; of a choice of splits that of the best."""
    samples = {
        split: scene.sample(_point(scene, point["workload"], split, point, packet_width=1), "speedup")
        for split in _SPLITS[point["splits"]](n)
    }
    is_choice = point["splits"] not in ("columns", "rows", "none")  # even where a choice has one alone
    return best(samples)[1] if is_choice else estimate(next(iter(samples.values())))


def _build(scene: SceneRows, n: int, point: Point, column: str = "build_over_plain") -> Estimate:
    """Over the build of the plain mesh in the same rounds."""
    (split,) = _SPLITS[point["splits"]](n)
    return estimate(scene.sample(_point(scene, BUILD.name, split, point), column))


def _boxes(scene: SceneRows, n: int, point: Point) -> float:
    """Boxes that a random ray enters, over the cells that it serves."""
    (split,) = _SPLITS[point["splits"]](n)
    for row in _point(scene, BUILD.name, split, point):
        if row["boxes_entered"]:
            return float(row["boxes_entered"]) / split[0]
    raise NotMeasuredError("boxes_entered was not counted")


def _bytes(workload: str, scene: SceneRows, n: int, point: Point, **more: Any) -> float:
    """Embree's bytes."""
    (split,) = _SPLITS[point["splits"]](n)
    return read_positive(_point(scene, workload, split, point, **more)[0], "embree_bytes")


_KINDS: Mapping[str, Callable[..., Any]] = {
    "speed": _speed,
    "build": _build,
    "boxes": _boxes,
    "memory": partial(_bytes, MEMORY.name),
    "frame bytes": partial(_bytes, FRAME.name, packet_width=1),
}
"""What is compared."""


def _growth(scene: SceneRows, splits: int) -> str:
    """What a process grew by from the loaded mesh to the built BVH, or that it was not measured."""
    row = _point(scene, MEMORY.name, (splits, 1), {})[0]
    try:
        growth = read_number(row, "rss_bytes") - read_number(row, "rss_mesh_bytes")
    except NotMeasuredError:
        return "not measured"
    return f"{growth / 2**20:+,.1f} MiB"


def _with_plan(scene: SceneRows, splits: int) -> float:
    """Plan and build together, over those at one split."""
    column = "plan_and_build_over_plain"
    columns, whole = (_build(scene, splits, {"splits": name}, column) for name in ("columns", "none"))
    return columns.over(whole).value


def _cost_of_instances(scene: SceneRows, query: Mapping[str, Any]) -> Estimate | None:
    """Frame time of the widest packets over that of the other point, mean over splits; None where not measured."""

    def ratio(n: int) -> Estimate:
        width = scene.widest_packets(FRAME.name)
        baseline, instances = (
            estimate(scene.sample(_point(scene, FRAME.name, (n, 1), query[end], packet_width=width), "speedup"))
            for end in ("denominator", "numerator")
        )
        return baseline.over(instances)

    ratios, _ = measured_at(query["at"], ratio)
    return geometric_mean(list(ratios.values())) if ratios else None


def _say_price(cost: Estimate | None) -> str:
    return "frame time not measured" if cost is None else f"frame time x {cost.value:.2f}, mean over splits"


_MORE: Mapping[str, Callable[..., Any]] = {
    "inverse": lambda fields, scene, ratios: fields["shown"].inverse(),
    "last": lambda fields, scene, ratios: max(ratios),
    "each": lambda fields, scene, ratios: ", ".join(f"{n}: {_number(ratio):.2f}" for n, ratio in ratios.items()),
    "growth_at_one": lambda fields, scene, ratios: _growth(scene, 1),
    "growth_at_last": lambda fields, scene, ratios: _growth(scene, max(ratios)),
    "with_plan": lambda fields, scene, ratios: _with_plan(scene, max(ratios)),
    "price": lambda fields, scene, ratios: _say_price(fields["cost"]),
}
"""with_plan: plan and build together at the last n. growth_at_one, growth_at_last: of the process. price: frame time of
instances."""
