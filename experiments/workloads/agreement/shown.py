"""What is shown of agreement: a line a scene, of who is wrong how often by float64."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from experiments.drawing.values import column
from experiments.methods.naming import say_kind
from experiments.workloads.images import HOLES, PIXELS, say_holes

TARGET = 2
"""A method may err this many times as often as rtcIntersect1 itself."""

_COUNTS = (*PIXELS, "images", "method_wrong", "baseline_wrong", "rays_sampled", "sampled_method_wrong",
           "sampled_baseline_wrong")  # fmt: skip


def errs_too_often(rows: pd.DataFrame) -> bool:
    """Whether the method is wrong more than TARGET times as often as rtcIntersect1, where the two differ."""
    return bool(rows["method_wrong"].sum() > TARGET * rows["baseline_wrong"].sum())


def sweep_lines(rows: pd.DataFrame) -> Iterator[str]:
    """One line a scene: the verdicts, who erred how often, and which methods miss the target. rows: those measured."""
    for scene, of_scene in rows.groupby("scene", sort=False):
        total = {name: int(of_scene[name].sum()) for name in _COUNTS}
        holes = say_holes({name: column(of_scene, name).sum() for name in HOLES})
        beyond = [
            f"{kind} {of_kind['method_wrong'].sum():,} against {of_kind['baseline_wrong'].sum():,}"
            for kind, of_kind in of_scene.groupby(of_scene.apply(say_kind, axis=1), sort=False)
            if errs_too_often(of_kind)
        ]
        often = (
            f"more than {TARGET} times as often: {'; '.join(beyond)}" if beyond else f"no method over {TARGET} times"
        )
        yield (
            f"{scene}: {sum(total[name] for name in PIXELS):,} pixels in {total['images']:,} images, "
            f"{total['pixels_wrong']:,} wrong{holes}, {total['pixels_edge']:,} edge, {total['pixels_tied']:,} tied; "
            f"by float64 methods err at {total['method_wrong']:,} of these, rtcIntersect1 at "
            f"{total['baseline_wrong']:,}, {often}; of {total['rays_sampled']:,} sampled rays at "
            f"{total['sampled_method_wrong']:,} and {total['sampled_baseline_wrong']:,}"
        )
