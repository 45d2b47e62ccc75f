"""Baselines of every timed frame: rtcIntersect1 and ray packets, in the same rounds."""

from __future__ import annotations

from statistics import median
from typing import Any

import numpy as np

from experiments.drawing.style import BLACK, DASHED, DOTTED, GREEN
from experiments.harness.method import LANES
from experiments.harness.records import Record
from experiments.results.statistics import Series
from experiments.workloads.typed import Times, over, series

OWN, SINGLE = "own", "rtcIntersect1"
"""Names in the samples of a time: the point's own method, the paper's baseline."""

PACKETS = {width: f"packets_{width}" for width in LANES}
"""Width of ray packets -> their name in the samples; the fastest ones are the expert's baseline."""

TIME_BASELINES: dict[str, tuple[str, dict[str, Any]]] = {
    "rtcIntersect1 per pixel": ("baseline_render_time_s", {"color": BLACK, "linestyle": DASHED}),
    "fastest ray packets": ("packets_render_time_s", {"color": GREEN, "linestyle": DOTTED}),
}
"""Label -> column and line of what every time row was measured against."""


LIBRARY = "library"
"""Name in the samples of the library's own answer, where other people's methods are timed beside it."""


def say_library(record: Record) -> str:
    """ "1.234 s; the library 0.617 s, 2.00x as fast"."""
    own, library = (np.asarray(record.samples[name]) for name in (OWN, LIBRARY))
    return f"{np.median(own):.3f} s; the library {np.median(library):.3f} s, {np.median(own / library):.2f}x as fast"


def packets_width(record: Record) -> int | None:
    """The width of the packets with the shortest median, None where no packets were timed."""
    widths = [width for width, name in PACKETS.items() if name in record.samples]
    return min(widths, key=lambda width: median(record.samples[PACKETS[width]]), default=None)


def single_over_packets(record: Record) -> float | None:
    """Single rays over the widest packets; None where they were not timed together, or took less than a millisecond,
    where clocks and caches dominate."""
    widest = [record.samples[name] for name in PACKETS.values() if name in record.samples][-1:]
    if SINGLE not in record.samples or not widest or median(widest[0]) < 1e-3:
        return None
    return float(np.median(np.divide(record.samples[SINGLE], widest[0])))


def fastest(record: Record) -> Any:
    """The samples of the fastest packets."""
    width = packets_width(record)
    return None if width is None else series(PACKETS[width])(record)


def over_own(read: Series) -> Series:
    """The ratios of a series and the point's own."""
    return over(read, series(OWN))


def first_frame(record: Record) -> float | None:
    """The seconds of the first frame, warm-up or not."""
    return [*record.warmup_samples.get(OWN, []), *record.samples[OWN]][0] if OWN in record.samples else None


def spread(record: Record) -> float | None:
    """The distance between the quartiles."""
    own = series(OWN)(record)
    return None if own is None else float(np.quantile(own, 0.75) - np.quantile(own, 0.25))


def say_gains(record: Record, **over: str) -> str:
    """ "20.0 ms, 7.50x rtcIntersect1": the point's own time, and ratios of others' times. over: their samples, by what
    they are called with _ for a space."""
    own = series(OWN)(record)
    gains = (f"{np.median(series(name)(record) / own):.2f}x {words.replace('_', ' ')}" for words, name in over.items())
    return ", ".join([f"{np.median(own) * 1e3:.1f} ms", *gains])


BESIDE_BASELINES = Times(
    {
        "render_time{}_s": OWN,
        "first_frame_time_s": first_frame,
        "render_time_spread_s": spread,
        "baseline_render_time{}_s": SINGLE,
        "packets_render_time{}_s": fastest,
        "speedup{}": (SINGLE, OWN),
        "speedup_vs_packets{}": over_own(fastest),
        "packets_width": packets_width,
        **{f"{name}_render_time{{}}_s": name for name in PACKETS.values()},
    },
    judged=OWN,
    optional=frozenset(PACKETS.values()),
    chosen=("speedup{}", "speedup_vs_packets{}"),
    canary=single_over_packets,
)
"""A point's own method, timed beside single rays and packets."""
