"""Errors of every method and of rtcIntersect1, as lines for people."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from atra.judge.compare import Verdict
from experiments.drawing.values import column
from experiments.methods.naming import say_kind
from experiments.workloads.agreement.results import TARGET, errs_too_often
from experiments.workloads.images import HOLES, say_holes

_COUNTS = (
    *(f"pixels_{kind.name.lower()}" for kind in Verdict), "images", "method_wrong", "baseline_wrong", "rays_sampled",
    "sampled_method_wrong", "sampled_baseline_wrong",
)  # fmt: skip


def sweep_lines(rows: pd.DataFrame) -> Iterator[str]:
    """One line a scene: the verdicts, who erred how often, and which methods miss the target. rows: those measured."""
    for scene, of_scene in rows.groupby("scene", sort=False):
        total = {name: int(of_scene[name].sum()) for name in _COUNTS}
        holes = say_holes({name: column(of_scene, name).sum() for name in HOLES})
        beyond = [
            f"{kind} {one['method_wrong'].sum():,} against {one['baseline_wrong'].sum():,}"
            for kind, one in of_scene.groupby(of_scene.apply(say_kind, axis=1), sort=False)
            if errs_too_often(one)
        ]
        often = (
            f"more than {TARGET} times as often: {'; '.join(beyond)}" if beyond else f"no method over {TARGET} times"
        )
        pixels = sum(total[f"pixels_{kind.name.lower()}"] for kind in Verdict)
        yield (
            f"{scene}: {pixels:,} pixels in {total['images']:,} images, {total['pixels_wrong']:,} wrong{holes}, "
            f"{total['pixels_edge']:,} edge, {total['pixels_tied']:,} tied; by float64 methods err at "
            f"{total['method_wrong']:,} of these, rtcIntersect1 at {total['baseline_wrong']:,}, {often}; "
            f"of {total['rays_sampled']:,} sampled rays at {total['sampled_method_wrong']:,} and "
            f"{total['sampled_baseline_wrong']:,}"
        )
