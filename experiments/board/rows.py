"""Rows of a board: the best of every method at a scene and kind of ray, as a ratio to the widest packets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from math import isfinite
from typing import Any

import pandas as pd

from atra.errors import InputError, printable
from experiments.drawing.style import TIMES
from experiments.methods import find_method
from experiments.methods.naming import best_of, is_missing, say_point
from experiments.results.settings import settings
from experiments.workloads import find_workload, workload_names
from experiments.workloads.baselines import PACKETS
from experiments.workloads.series import OVER_PACKETS, OVER_SINGLE, POINTS, best_rows

_TIME = "render_time_s"
_FASTEST_PACKETS = "packets_render_time_s"
_WRONG = ("pixels_wrong", "rays_wrong")
_LONGEST_TEXT = 300


@dataclass(frozen=True)
class BoardRow:
    """A method at its best options, on one scene and kind of ray.

    rays: their kind. name: method and options in words. ratio: time of the widest packets per ray over this, in the
    same rounds, with its 95 % interval; None where there are no packets. It is that of tables and figures, which is
    over the fastest packets, times what the widest take longer. frame_s: one image or batch. build_s: plan
    and build. wrong: pixels or rays. error: why it was not measured.
    """

    scene: str
    triangles: int | None
    rays: str
    size: str
    threads: int | None
    method: str
    name: str
    is_ours: bool
    ratio: float | None
    low: float | None
    high: float | None
    frame_s: float | None
    build_s: float | None
    wrong: int | None
    warnings: str | None
    status: str
    error: str | None


def board_rows(table: pd.DataFrame) -> list[BoardRow]:
    """The rows of a sweep's table, of workloads that time frames or batches beside packets; a stored table may have
    rows of a workload that has left since."""
    timed = table[table["workload"].isin(table["workload"][table[_TIME].notna()])] if _TIME in table else table[:0]
    varying = [name for name in settings() if name in timed and name not in best_of() and name != "mesh_sha256"]
    keys = ["scene", "triangles", "workload", "method", "packet_width", "robust", *varying]
    keys = [name for name in dict.fromkeys(keys) if name in timed and timed[name].notna().any()]
    return [_row(best) for best in _best_of_each(timed, keys)] if len(timed) else []


def _best_of_each(table: pd.DataFrame, keys: list[str]) -> Iterator[Mapping[str, Any]]:
    """The best split in each group of rows alike in `keys`, as tables and figures choose and report it; of a group
    without a ratio, a row that was measured, or else its first."""
    whole = table.to_dict("records")
    # Groups of few columns: pandas would take seconds to copy all of them for every group.
    ratios = [name for name in table if name.startswith((OVER_SINGLE, OVER_PACKETS))]
    few = table[[name for name in dict.fromkeys([*keys, *POINTS, "status", *ratios]) if name in table]]
    for _, rows in few.reset_index(drop=True).groupby(keys, dropna=False, sort=False):
        best = best_rows(rows)
        measured = rows[rows["status"].eq("ok").fillna(False).astype(bool)]
        chosen = next(some for some in (best, measured[:1], rows[:1]) if len(some))
        for place, reported in zip(chosen.index, chosen[ratios].to_dict("records"), strict=True):
            yield whole[place] | reported


def _row(row: Mapping[str, Any]) -> BoardRow:
    known = {name: value for name, value in row.items() if not is_missing(value)}
    measured = known if row["status"] == "ok" else {}
    frame_s = measured.get(_TIME)
    widest = [measured[name] for name in (f"{series}_{_TIME}" for series in PACKETS.values()) if name in measured][-1:]
    slower = widest[0] / measured[_FASTEST_PACKETS] if widest and _FASTEST_PACKETS in measured else 1.0
    over = [measured.get(f"{OVER_PACKETS}{end}") for end in ("", "_low", "_high")]
    ratio, low, high = (None if number is None else float(number * slower) for number in over)
    parts = [measured[name] for name in ("plan_time_s", "build_time_s") if name in measured]
    wrong = [int(measured[name]) for name in _WRONG if name in measured]
    method, workload = find_method(str(row["method"])), str(row["workload"])
    rays = find_workload(workload).rays_of(known) if workload in workload_names() else workload
    return BoardRow(
        scene=str(row["scene"]), triangles=_whole(known.get("triangles")), rays=rays,
        size=f"{known.get('width')} {TIMES} {known.get('height')}", threads=_whole(known.get("threads")),
        method=method.label,
        name=say_point(row), is_ours=method.is_ours, ratio=ratio, low=low, high=high, frame_s=frame_s,
        build_s=float(sum(parts)) if parts else None, wrong=sum(wrong) if wrong else None,
        warnings=measured.get("warnings", measured.get("doubts")), status=str(row["status"]), error=known.get("error"),
    )  # fmt: skip


def _whole(value: Any) -> int | None:
    return None if value is None else int(value)


def plain_rows(rows: list[BoardRow]) -> list[dict[str, Any]]:
    """Rows as JSON has them."""
    return [asdict(row) for row in rows]


_KINDS = {"str": (str,), "int": (int,), "float": (int, float), "bool": (bool,)}


def read_row(given: Any) -> BoardRow:
    """The reverse of `plain_rows`, for a row of a stranger's file. Raises InputError for other fields and types, and
    for numbers that are not finite; texts are made printable and cut."""
    names = [spec.name for spec in fields(BoardRow)]
    if not isinstance(given, dict) or sorted(given) != sorted(names):
        raise InputError(f"a row has the fields {sorted(given) if isinstance(given, dict) else given!r:.100}")
    values = {}
    for spec in fields(BoardRow):
        value, kind = given[spec.name], str(spec.type)
        allowed = _KINDS[kind.partition(" ")[0]]
        fits = isinstance(value, allowed) and (bool in allowed or not isinstance(value, bool))
        if not (fits or (value is None and "None" in kind)):
            raise InputError(f"field {spec.name} of a row is {value!r:.100}, expected {kind}")
        if isinstance(value, int | float) and not isfinite(value):
            raise InputError(f"field {spec.name} of a row is {value}, expected a finite number")
        values[spec.name] = printable(value)[:_LONGEST_TEXT] if isinstance(value, str) else value
    return BoardRow(**values)  # type: ignore[arg-type]  # each was checked above
