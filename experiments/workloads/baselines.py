"""Baselines of every timed frame: rtcIntersect1 and packets per pixel, in the same rounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np

from experiments.drawing.style import BLACK, DASHED, DOTTED, GREEN
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.method import LANES
from experiments.harness.records import Record
from experiments.results.statistics import Series, choosing_column, reporting_columns, statistics_columns

OWN, SINGLE = "own", "rtcIntersect1"
"""Names in the samples of a time: the point's own method, the paper's baseline."""

PACKETS = {width: f"packets_{width}" for width in LANES}
"""Width of packets per pixel -> their name in the samples; the fastest ones are the expert's baseline."""

TIME_BASELINES: dict[str, tuple[str, dict[str, Any]]] = {
    "rtcIntersect1 per pixel": ("baseline_render_time_s", {"color": BLACK, "linestyle": DASHED}),
    "fastest packets per pixel": ("packets_render_time_s", {"color": GREEN, "linestyle": DOTTED}),
}
"""Label -> column and line of what every time row was measured against."""


def fastest_packets(samples: Mapping[str, Sequence[float]]) -> int:
    """The width of the packets with the shortest median among the samples of a time."""
    widths = [width for width, name in PACKETS.items() if name in samples]
    return min(widths, key=lambda width: median(samples[PACKETS[width]]))


def packets_width(record: Record) -> int | None:
    """That width, None where no packets were timed."""
    return fastest_packets(record.samples) if any(name in record.samples for name in PACKETS.values()) else None


def single_over_packets(record: Record) -> float | None:
    """Single rays over the widest packets; None where they were not timed together, or took less than a millisecond,
    where clocks and caches dominate."""
    widest = [record.samples[name] for name in PACKETS.values() if name in record.samples][-1:]
    if SINGLE not in record.samples or not widest or median(widest[0]) < 1e-3:
        return None
    return float(np.median(np.divide(record.samples[SINGLE], widest[0])))


def series(name: str) -> Series:
    """A record -> its samples of `name`, None where it has none."""

    def read(record: Record) -> Any:
        values = record.samples.get(name)
        return None if values is None else np.asarray(values, np.float64)

    return read


def fastest(record: Record) -> Any:
    """The samples of the fastest packets."""
    width = packets_width(record)
    return None if width is None else series(PACKETS[width])(record)


def over(upper: Series, lower: Series) -> Series:
    """A record -> the ratios of two series, round by round; None where it has not both."""

    def ratios(record: Record) -> Any:
        above, below = upper(record), lower(record)
        return None if above is None or below is None else above / below

    return ratios


def over_own(read: Series) -> Series:
    """The ratios of a series and the point's own."""
    return over(read, series(OWN))


BESIDE_BASELINES: dict[str, Any] = {
    "optional": frozenset(PACKETS.values()), "judged": OWN, "canary": single_over_packets,
}  # fmt: skip
"""Fields of a workload whose own method is timed beside single rays and packets."""


def _first_frame(record: Record) -> Any:
    return [*record.warmup_samples.get(OWN, []), *record.samples.get(OWN, [])][0] if OWN in record.samples else None


def _spread(record: Record) -> Any:
    own = series(OWN)(record)
    return None if own is None else float(np.quantile(own, 0.75) - np.quantile(own, 0.25))


TIME_COLUMNS: tuple[Column, ...] = (
    *statistics_columns("render_time{}_s", "one frame, or all frames together", series(OWN)),
    Column("first_frame_time_s", REAL, "the very first frame after the build", _first_frame),
    Column("render_time_spread_s", REAL, "distance between the quartiles", _spread),
    *statistics_columns("baseline_render_time{}_s", "rtcIntersect1 per pixel", series(SINGLE)),
    *statistics_columns("packets_render_time{}_s", "the fastest packets per pixel", fastest),
    *(
        column
        for name, help, ratios in (
            ("speedup", "rtcIntersect1 / this, in the same rounds", over_own(series(SINGLE))),
            ("speedup_vs_packets", "the fastest packets / this, in the same rounds", over_own(fastest)),
        )
        for column in (
            *statistics_columns(name + "{}", help, ratios),
            choosing_column(f"{name}_half", help, ratios),
            *reporting_columns(name, help, ratios),
        )
    ),
    Column("packets_width", WHOLE, "rays of the fastest packets per pixel", packets_width),
    *(
        column
        for width, name in PACKETS.items()
        for column in statistics_columns(name + "_render_time{}_s", f"packets of {width} per pixel", series(name))
    ),
)
"""Columns of a point whose own method is timed in rounds with its baselines."""
