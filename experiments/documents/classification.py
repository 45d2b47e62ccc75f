"""What the pages quote of sweep=classification."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd

from experiments.classification.classified import CLASSIFIED
from experiments.classification.own_bvh import BVH
from experiments.classification.workload.claims import KINDS, usual
from experiments.classification.workload.path_rays import PATH_KINDS
from experiments.documents.quotation import (
    SCENES,
    Kept,
    digits,
    each_scene,
    interval,
    line,
    milliseconds,
    number,
    of,
    table_row,
)

_WIDTHS = {1: "single rays", 8: "packets of 8"}


def own_bvh(kept: Kept) -> Iterable[str]:
    """rtcIntersect1's time over that of our own BVH from its root, primary rays, scene by scene."""
    plain = each_scene(kept.points, workload="classification", method=BVH.name, ray_kind=KINDS[0])
    yield f"{', '.join(number(row, 'speedup') for row in plain)} times as fast as `rtcIntersect1`"


def classified_rays(kept: Kept) -> Iterable[str]:
    """Scene and kind, steps over those from the root, and the time from the root over ours: tested when popped, and
    when pushed; and rtcIntersect1 over ours."""
    rays = of(kept.points, workload="classification")
    popped, pushed = usual(rays), usual(rays, traversal="push")
    for scene in SCENES:
        for kind in KINDS:
            pop, push = (of(one, scene=scene, ray_kind=kind).iloc[0] for one in (popped, pushed))
            of_pushed = (number(push, name) for name in ("speedup_vs_bvh", "speedup"))
            ratio = number(pop, "steps_ratio")
            yield table_row(f"`{scene}`, {kind}", ratio, interval(pop, "speedup_vs_bvh"), *of_pushed)
    assert set(rays["rays_wrong"].dropna()) == {0}


def rays_of_paths(kept: Kept) -> Iterable[str]:
    """Scene and kind, rays, steps over those from the root; memory read over that from the root; the time from the root
    over ours, and that of rtcIntersect1 or rtcOccluded1; lists over the BVH."""
    rays = of(kept.points, method=CLASSIFIED.name)
    for scene in SCENES:
        for kind in (KINDS[0], *PATH_KINDS):
            row = of(rays, scene=scene, ray_kind=kind).iloc[0]
            yield table_row(
                f"`{scene}`, {kind}",
                f"{int(row['rays_traced']):,}",
                number(row, "steps_ratio"),
                digits(row["bytes_touched"] / row["plain_bytes_touched"]),
                number(row, "speedup_vs_bvh"),
                number(row, "speedup"),
                digits((row["lookup_bytes"] + row["list_bytes"]) / row["bvh_bytes"]),
            )
    assert set(kept.points["rays_different"]) == {0}


def memory_of_shafts(kept: Kept) -> Iterable[str]:
    """Scene, shafts, mean length of a list, look-up and lists over the BVH, seconds to build them, and how many batches
    of each kind pay for that."""
    told = usual(of(kept.points, workload="classification"))
    for scene in SCENES:
        kinds = [of(told, scene=scene, ray_kind=kind).iloc[0] for kind in KINDS]
        first = of(told, scene=scene).iloc[0]
        yield table_row(
            f"`{scene}`",
            f"{int(first['shafts']):,}",
            number(first, "list_length_mean"),
            digits((first["lookup_bytes"] + first["list_bytes"]) / first["bvh_bytes"]),
            number(first, "shaft_build_time_s"),
            *map(_batches, kinds),
        )


def packets_from_lists(kept: Kept) -> Iterable[str]:
    """Single rays and packets sorted by shaft, and what has lists; for each scene the time from the root over ours, and
    batches that pay for all preparation. Last, the packets whose lists are those of their rays over Embree's."""
    rays = of(kept.points, workload="classification", method=CLASSIFIED.name, ray_order="shaft")
    for width, words in _WIDTHS.items():
        for subset in ("none", "complete", "hits"):
            rows = each_scene(rays, packet_width=width, shaft_subset=subset)
            cells = (f"{number(row, 'speedup_vs_bvh')}, {_batches(row)}" for row in rows)
            yield table_row(words, subset, *cells)
    last = each_scene(rays, packet_width=8, shaft_subset="hits")
    for name, column in (("`rtcIntersect1`, unsorted", "speedup"), ("packets of Embree, sorted", "speedup_vs_sorted")):
        yield table_row(f"packets of 8, over {name}", "hits", *(number(row, column) for row in last))


def _batches(row: Any) -> Any:
    """Until all preparation is paid back."""
    return "never" if pd.isna(row["break_even_batches"]) else f"{row['break_even_batches']:,.0f}"


def eyes_that_move(kept: Kept) -> Iterable[str]:
    """What is traced; for each scene a frame from another eye in ms, and over that the packets that keep a BVH."""

    def time_and_gain(row: Any, _: Any) -> Any:
        return f"{milliseconds(row['render_time_s'])}, {number(row, 'speedup_vs_kept_packets')}"

    moving = of(kept.points, workload="moving")
    for width, words in _WIDTHS.items():
        own = each_scene(moving, method=CLASSIFIED.name, packet_width=width)
        yield line(f"shafts of an eye, {words}", own, "", time_and_gain)
    yield line("culled tiles", each_scene(moving, method="tiles"), "", time_and_gain)


def verdicts_on_shafts(kept: Kept) -> Iterable[str]:
    """On what Hendrich et al. claim of ray classification."""
    for claim in kept.claims:
        yield table_row(claim["text"], claim["value"] or "-", claim["verdict"])
