"""Rows of a table for the tests of figures, and what a figure shows of them."""

import io

import pytest

from experiments.drawing.render import draw
from tests.report_samples import table_of

MIB = 2**20
COMMON = {
    "scene": "box", "triangles": 10, "width": 1000, "height": 1000, "split_x": 1, "split_y": 1, "culling": True,
    "method": "aligned", "geometry": "copied", "packet_width": 8, "threads": 1, "build_quality": "medium",
    "status": "ok", "pixels_wrong": 0,
}  # fmt: skip


def make_rows(*rows):
    return table_of([COMMON | {"point_id": f"{place:020x}"} | row for place, row in enumerate(rows)])


def method_row(method, split_x=1, time_s=0.02, ratio=2.0, **fields):
    """A timed frame; intervals of times are half and double."""
    return COMMON | {
        "workload": "frame", "rounds": 9, "method": method, "split_x": split_x, "render_time_s": time_s,
        "render_time_low_s": 0.5 * time_s, "render_time_high_s": 2 * time_s, "baseline_render_time_s": 0.1,
        "packets_render_time_s": 0.05, "packets_width": 8, "speedup": 0.1 / time_s, "speedup_vs_packets": ratio,
        "speedup_vs_packets_low": 1.75, "speedup_vs_packets_high": 2.25, "plan_time_s": 0.001, "build_time_s": 0.002,
        "first_frame_time_s": 0.03, "embree_bytes": 3000,
    } | fields  # fmt: skip


def time_row(split_x, time_s, **fields):
    return method_row(**{"method": "aligned", "split_x": split_x, "time_s": time_s} | fields)


def build_row(split_x, plan_s, build_s, **fields):
    return {
        "workload": "build", "split_x": split_x, "plan_time_s": plan_s, "build_time_s": build_s,
        "build_time_low_s": build_s, "build_time_high_s": 2 * build_s, "baseline_build_time_s": 0.004,
    } | fields  # fmt: skip


def memory_row(split_x, mesh_mib, after_mib, peak_mib, **fields):
    return {
        "workload": "memory", "split_x": split_x, "rss_mesh_bytes": mesh_mib * MIB, "rss_bytes": after_mib * MIB,
        "peak_rss_bytes": peak_mib * MIB, "embree_bytes": 3 * split_x * MIB,
    } | fields  # fmt: skip


def skipped(row, error="needs 9 GiB, more than the memory budget of 4 GiB"):
    """The row as it is when its point could not be measured."""
    measured = [name for name in row if name.endswith(("_s", "_bytes", "_wrong")) or name.startswith("speedup")]
    return row | dict.fromkeys(measured) | {"status": "skipped", "error": error}


def line(panel, label):
    """Abscissa -> ordinate of what can be drawn of the line with this label."""
    (one,) = [one for one in panel.lines if one.label == label]
    return {float(x): pytest.approx(float(y)) for x, y in zip(one.x, one.y, strict=True) if y > 0}


def interval_of(panel, label):
    """Both ends of the first interval of the line with this label."""
    (one,) = [one for one in panel.lines if one.label == label]
    return [pytest.approx(float(end[0])) for end in one.interval]


def level(panel, label):
    """Where the level line with this label lies."""
    (one,) = [one for one in panel.levels if one.label == label]
    return pytest.approx(one.value)


def crosses(panel):
    return {split for one in panel.crosses for split in one.splits}


def bars(panel):
    """Label -> length of each bar that has one, in units of the axis, from the top down."""
    return {one.label: pytest.approx(one.value) for one in panel.bars if one.value > 0}


def whiskers(panel):
    return [pytest.approx([one.low, one.high]) for one in panel.bars]


def words(figure):
    return figure.words


def unfolded(figure):
    """The same in one line."""
    return " ".join(words(figure).split())


def save(figure):
    draw(figure).savefig(io.BytesIO(), format="png", dpi=30)
