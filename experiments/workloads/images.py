"""Pixels of images compared with those of rtcIntersect1: counts of verdicts and errors of depths."""

from __future__ import annotations

from collections.abc import Sequence

from atra.judge.compare import Agreement
from experiments.harness.column import REAL, WHOLE, Column

PIXELS = ("pixels_equal", "pixels_tied", "pixels_edge", "pixels_wrong")

IMAGE_COLUMNS = (
    Column("pixels_equal", WHOLE, "pixels with the triangle and the depth of rtcIntersect1"),
    Column("pixels_tied", WHOLE, "pixels with another triangle, equally deep"),
    Column("pixels_edge", WHOLE, "pixels whose ray passes within a thousandth of a pixel of a triangle's rim"),
    Column("pixels_wrong", WHOLE, "pixels without an excuse", over=max),
    Column("depth_error_max", REAL, "largest relative error of a depth against float64, of the worst image"),
    Column("depth_error_p999", REAL, "what 99.9 % of the relative errors stay below, of the worst image"),
    Column("baseline_depth_error_max", REAL, "the same of rtcIntersect1"),
    Column("baseline_depth_error_p999", REAL, "the same of rtcIntersect1"),
)


def counts(agreements: Sequence[Agreement]) -> dict[str, int]:
    """Pixels of all images, by verdict."""
    return {name: sum(int(getattr(agreement, name)) for agreement in agreements) for name in PIXELS}


def depth_errors(agreements: Sequence[Agreement]) -> dict[str, float]:
    """The worst of all images, the method's and beside them those of rtcIntersect1."""
    own, single = zip(*((one.depth_errors, one.reference_depth_errors) for one in agreements), strict=True)
    return {
        "depth_error_max": max(one.largest for one in own),
        "depth_error_p999": max(one.p999 for one in own),
        "baseline_depth_error_max": max(one.largest for one in single),
        "baseline_depth_error_p999": max(one.p999 for one in single),
    }
