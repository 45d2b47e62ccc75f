"""Pixels of images compared with those of rtcIntersect1: counts of verdicts and errors of depths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import TYPE_CHECKING, Any, TypedDict, cast

from experiments.workloads.typed import Worst

if TYPE_CHECKING:
    from atra.judge.compare import Agreement

PIXELS = ("pixels_equal", "pixels_tied", "pixels_edge", "pixels_wrong")

WRONG_SHARE = 0.01
"""An image is wrong if more than this share of its pixels are. Rays that slip between triangles in Embree's fast
setting make up to 2 of 100,000 wrong, and a rasteriser whose depths have few bits up to 1 of 100."""

HOLES = {"pixels_hole": "pixels_hole", "baseline_pixels_hole": "reference_pixels_hole"}
"""Columns of holes, and what `Agreement` calls them; tables from before they were told apart lack them."""


class Images(TypedDict):
    """Verdicts on the pixels of all images, and depth errors of the worst one."""

    pixels_equal: int
    pixels_tied: int
    pixels_edge: int
    pixels_wrong: Worst
    pixels_hole: Worst
    baseline_pixels_hole: Worst
    depth_error_max: float
    depth_error_p999: float
    baseline_depth_error_max: float
    baseline_depth_error_p999: float


def summed(agreements: Sequence[Agreement]) -> Images:
    """What several comparisons come to."""
    own, single = zip(*((image.depth_errors, image.reference_depth_errors) for image in agreements), strict=True)
    names = {name: name for name in PIXELS} | HOLES
    counts = {name: sum(int(getattr(image, theirs)) for image in agreements) for name, theirs in names.items()}
    depths = {
        f"{prefix}depth_error_{end}": max(getattr(errors, name) for errors in images)
        for prefix, images in (("", own), ("baseline_", single))
        for end, name in (("max", "largest"), ("p999", "p999"))
    }
    return cast(Images, counts | depths)


def say_wrong_image(results: Mapping[str, Any]) -> str | None:
    """ "4,096 of 4,096 pixels wrong" of results whose image is wrong; None for others, and where none was compared."""
    compared, wrong = sum(results.get(name) or 0 for name in PIXELS), results.get("pixels_wrong") or 0
    return f"{wrong:,} of {compared:,} pixels wrong" if wrong > WRONG_SHARE * compared else None


def say_holes(row: Mapping[str, Any]) -> str:
    """ ", of them 2 holes and 1 of rtcIntersect1" of a row, or sums; "" without any."""
    own, single = (int(count) if isinstance(count := row.get(name), Integral) else 0 for name in HOLES)
    holes = "hole" if (own or single) == 1 else "holes"
    words = [f"{own:,} {holes}"] if own else []
    if single:
        words.append(f"{single:,} of rtcIntersect1" if own else f"{single:,} {holes} of rtcIntersect1")
    return f", of them {' and '.join(words)}" if words else ""
