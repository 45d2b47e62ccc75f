"""Pixels of images compared with those of rtcIntersect1: counts of verdicts and errors of depths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import TYPE_CHECKING, Any

from experiments.harness.column import REAL, WHOLE, Column

if TYPE_CHECKING:
    from atra.hits import Hits
    from atra.judge.compare import Agreement

PIXELS = ("pixels_equal", "pixels_tied", "pixels_edge", "pixels_wrong")

WRONG_SHARE = 0.01
"""An image is wrong if more than this share of its pixels are. Rays that slip between triangles in Embree's fast
setting make up to 2 of 100,000 wrong, and a rasteriser whose depths have few bits up to 1 of 100."""

HOLES = {"pixels_hole": "pixels_hole", "baseline_pixels_hole": "reference_pixels_hole"}
"""Columns of holes, and what `Agreement` calls them; tables from before they were told apart lack them."""

IMAGE_COLUMNS = (
    Column("pixels_equal", WHOLE, "pixels with the triangle and the depth of rtcIntersect1"),
    Column("pixels_tied", WHOLE, "pixels with another triangle, equally deep"),
    Column("pixels_edge", WHOLE, "pixels whose ray passes within a thousandth of a pixel of a triangle's rim"),
    Column("pixels_wrong", WHOLE, "pixels without an excuse, holes of either image among them", over=max),
    Column("pixels_hole", WHOLE, "wrong pixels where the method's ray slips between triangles", over=max),
    Column("baseline_pixels_hole", WHOLE, "wrong pixels where an rtcIntersect1 ray slips through", over=max),
    Column("depth_error_max", REAL, "largest relative depth error against float64, worst image"),
    Column("depth_error_p999", REAL, "99.9th percentile of the relative depth errors, worst image"),
    Column("baseline_depth_error_max", REAL, "largest relative depth error of rtcIntersect1, worst image"),
    Column("baseline_depth_error_p999", REAL, "99.9th percentile of the depth errors of rtcIntersect1"),
)


def counts(agreements: Sequence[Agreement]) -> dict[str, int]:
    """Pixels of all images, by verdict, and holes."""
    names = {name: name for name in PIXELS} | HOLES
    return {name: sum(int(getattr(one, own)) for one in agreements) for name, own in names.items()}


def say_wrong_image(results: Mapping[str, Any]) -> str | None:
    """ "4,096 of 4,096 pixels wrong" of results whose image is wrong; None for others, and where none was compared."""
    compared, wrong = sum(results.get(name) or 0 for name in PIXELS), results.get("pixels_wrong") or 0
    return f"{wrong:,} of {compared:,} pixels wrong" if wrong > WRONG_SHARE * compared else None


def say_holes(row: Mapping[str, Any]) -> str:
    """ ", of them 2 holes and 1 of rtcIntersect1" of a row, or sums; "" without any."""
    known = [int(count) if isinstance(count := row.get(name), Integral) else 0 for name in HOLES]
    own, single = known
    holes = "hole" if (own or single) == 1 else "holes"
    words = [f"{own:,} {holes}"] if own else []
    if single:
        words.append(f"{single:,} of rtcIntersect1" if own else f"{single:,} {holes} of rtcIntersect1")
    return f", of them {' and '.join(words)}" if words else ""


def compared(own: Hits, single: Hits) -> dict[str, float]:
    """Verdicts on the pixels of an image beside that of single rays, and depth errors of both."""
    from atra.judge.compare import compare

    agreements = [compare(own, single)]
    return counts(agreements) | depth_errors(agreements)


def depth_errors(agreements: Sequence[Agreement]) -> dict[str, float]:
    """Depth errors of the worst image, the method's and those of rtcIntersect1."""
    own, single = zip(*((one.depth_errors, one.reference_depth_errors) for one in agreements), strict=True)
    return {
        "depth_error_max": max(one.largest for one in own),
        "depth_error_p999": max(one.p999 for one in own),
        "baseline_depth_error_max": max(one.largest for one in single),
        "baseline_depth_error_p999": max(one.p999 for one in single),
    }
