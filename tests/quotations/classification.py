"""What the pages quote of sweep=classification."""

from __future__ import annotations

import pandas as pd

from experiments.methods.bvh import BVH
from experiments.methods.classified import CLASSIFIED
from experiments.workloads.rays.claims import KINDS, usual
from tests.quotations.quotation import SCENES, Kept, Quoted, digits, interval, milliseconds, of, table_row

_SUBSETS = ("none", "complete", "sampled", "hits")


def own_bvh(kept: Kept) -> Quoted:
    """rtcIntersect1's time over that of our own BVH from its root, primary rays, scene by scene."""
    plain = of(kept.points, workload="rays", method=BVH.name, ray_kind=KINDS[0])
    speeds = ", ".join(digits(of(plain, scene=scene)["speedup"].iloc[0]) for scene in SCENES)
    return Quoted(phrases=(f"{speeds} times as fast as `rtcIntersect1`",))


def classified_rays(kept: Kept) -> Quoted:
    """Scene and kind, steps over those from the root, and the time from the root over ours: tested when popped, and
    when pushed; and rtcIntersect1 over ours."""
    rays, rows = of(kept.points, workload="rays"), []
    popped, pushed = usual(rays), usual(rays, traversal="push")
    for scene in SCENES:
        for kind in KINDS:
            pop, push = (of(one, scene=scene, ray_kind=kind).iloc[0] for one in (popped, pushed))
            rows.append(
                table_row(
                    f"`{scene}`, {kind}",
                    digits(pop["steps_ratio"]),
                    interval(pop, "speedup_vs_bvh"),
                    digits(push["speedup_vs_bvh"]),
                    digits(push["speedup"]),
                )
            )
    assert set(rays["rays_wrong"].dropna()) == {0}
    return Quoted(rows=tuple(rows))


def memory_of_shafts(kept: Kept) -> Quoted:
    """Scene, shafts, mean length of a list, look-up and lists over the BVH, seconds to build them, and how many batches
    of each kind pay for that."""
    rows, told = [], usual(of(kept.points, workload="rays"))
    for scene in SCENES:
        of_scene = of(told, scene=scene)
        first = of_scene.iloc[0]
        bytes_ = first["lookup_bytes"] + first["list_bytes"]
        batches = (_batches(of(of_scene, ray_kind=kind).iloc[0]) for kind in KINDS)
        rows.append(
            table_row(
                f"`{scene}`",
                f"{int(first['shafts']):,}",
                digits(first["list_length_mean"]),
                digits(bytes_ / first["bvh_bytes"]),
                digits(first["shaft_build_time_s"]),
                *batches,
            )
        )
    return Quoted(rows=tuple(rows))


def packets_from_lists(kept: Kept) -> Quoted:
    """Single rays and packets sorted by shaft, and what has lists; for each scene the time from the root over ours, and
    batches that pay for all preparation. Last, the packets whose lists are those of their rays over Embree's."""
    rays, rows = of(kept.points, workload="rays", method=CLASSIFIED.name, ray_order="shaft"), []
    for width in (1, 8):
        for subset in _SUBSETS:
            one = of(rays, packet_width=width, shaft_subset=subset)
            cells = (_gain(of(one, scene=scene).iloc[0]) for scene in SCENES)
            rows.append(table_row("single rays" if width == 1 else f"packets of {width}", subset, *cells))
    last = of(rays, packet_width=8, shaft_subset="hits")
    for name, column in (("`rtcIntersect1`, unsorted", "speedup"), ("packets of Embree, sorted", "speedup_vs_sorted")):
        cells = (digits(of(last, scene=scene)[column].iloc[0]) for scene in SCENES)
        rows.append(table_row(f"packets of 8, over {name}", "hits", *cells))
    return Quoted(rows=tuple(rows))


def _gain(row: pd.Series) -> str:
    return f"{digits(row['speedup_vs_bvh'])}, {_batches(row)}"


def _batches(row: pd.Series) -> str:
    """Until all preparation is paid back."""
    return "never" if pd.isna(row["break_even_batches"]) else f"{row['break_even_batches']:,.0f}"


def eyes_that_move(kept: Kept) -> Quoted:
    """What is traced; for each scene a frame from another eye in ms, and over that the packets that keep a BVH."""
    moving, rows = of(kept.points, workload="moving"), []
    for width in (1, 8):
        own = of(moving, method=CLASSIFIED.name, packet_width=width)
        rows.append(
            table_row(f"shafts of an eye, {'single rays' if width == 1 else f'packets of {width}'}", *_moved(own))
        )
    rows.append(table_row("culled tiles", *_moved(of(moving, method="tiles"))))
    return Quoted(rows=tuple(rows))


def _moved(rows: pd.DataFrame) -> list[str]:
    chosen = [of(rows, scene=scene).iloc[0] for scene in SCENES]
    return [f"{milliseconds(row['render_time_s'])}, {digits(row['speedup_vs_kept_packets'])}" for row in chosen]
