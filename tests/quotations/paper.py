"""What the pages quote of sweep=paper."""

from __future__ import annotations

from typing import Any

from experiments.paper.gains import Gain, scene_gains
from tests.quotations.quotation import SCENES, TIMES, Kept, Quoted, digits, of, table_row


def measured_points(kept: Kept) -> Quoted:
    table = kept.points
    measured, skipped = (int(table["status"].eq(status).sum()) for status in ("ok", "skipped"))
    (cpu,) = table["cpu"].dropna().unique()
    return Quoted(
        phrases=(
            f"{len(table)} points, {measured} measured, {skipped} skipped",
            f"{len(kept.processes):,} processes",
            f"{int(table['processes_left_out'].sum())} of them left out",
            str(cpu),
        )
    )


def _say(gain: Gain) -> str:
    if gain.best is None:
        return "none"
    return f"{gain.best.gain} ({gain.best.splits:,} {TIMES} 1)"


def best_gains(kept: Kept) -> Quoted:
    """Paper, both readings with single rays, packets over packets."""
    rows = []
    for one in scene_gains(kept.processes):
        paper = "" if one.paper is None else f"{one.paper:.2f}"
        over_packets = _say(next(iter(one.packets.values()))) if one.packets else "none"
        rows.append(table_row(f"`{one.scene}`", paper, *(_say(gain) for gain in one.single.values()), over_packets))
    assert len(rows) == len(SCENES)
    return Quoted(rows=tuple(rows))


def claim_text(claim: dict[str, Any]) -> str:
    return f"{claim['text']} (an inference of ours)" if claim["inferred"] else str(claim["text"])


def verdicts(kept: Kept) -> Quoted:
    """A row a claim, with its verdicts under both readings where it has two."""
    rows = {}
    for claim in kept.claims:
        if not claim["id"].startswith("best-speedup"):
            rows.setdefault((claim_text(claim), claim["section"]), []).append(
                f"{claim['reading']}: {claim['verdict']}" if claim["reading"] else claim["verdict"]
            )
    return Quoted(rows=tuple(table_row(*key, "; ".join(found)) for key, found in rows.items()))


def instances(kept: Kept) -> Quoted:
    kinds = (("copies, culling off", "copied", False), ("copies", "copied", True), ("instances", "instanced", False))
    table = kept.points
    widest = table["packet_width"].max()
    rows = []
    for split_x in (64, 1024):
        for kind, geometry, culling in kinds:
            chosen = of(
                table, workload="frame", method="aligned", split_x=split_x, split_y=1, packet_width=widest,
                geometry=geometry, culling=culling,
            ).set_index("scene")  # fmt: skip
            if set(chosen.index) != set(SCENES):
                continue  # skipped on some scene, for the memory it would need
            held = [f"{chosen.loc[scene, 'embree_bytes'] / 2**20:,.1f}" for scene in SCENES]
            rows.append(table_row(f"{split_x:,} {TIMES} 1, {kind}: Embree's bytes in MiB", *held))
            speedups = [digits(chosen.loc[scene, "speedup_vs_packets"]) for scene in SCENES]
            rows.append(table_row(f"{split_x:,} {TIMES} 1, {kind}: {TIMES} packets", *speedups))
    return Quoted(rows=tuple(rows))
