"""What the pages quote of sweep=paper."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from experiments.documents.quotation import SCENES, TIMES, Kept, digits, of, table_row
from experiments.paper.conclusion import scene_gains
from experiments.results.statistics import best_of
from experiments.studies.candidates import ASKED_FOR, Candidate, Gain, candidates


def measured_points(kept: Kept) -> Iterable[str]:
    table = kept.points
    measured, skipped = (int(table["status"].eq(status).sum()) for status in ("ok", "skipped"))
    yield f"{len(table)} points, {measured} measured, {skipped} skipped"
    yield f"{len(of(kept.processes)):,} processes"
    yield f"{int(table['processes_left_out'].sum())} of them left out"
    (cpu,) = table["cpu"].dropna().unique()
    yield str(cpu)


def _say(gain: Any) -> Any:
    return "none" if gain.best is None else f"{gain.best.gain} ({gain.best.splits:,} {TIMES} 1)"


def best_gains(kept: Kept) -> Iterable[str]:
    """Paper, both readings with single rays, packets over packets."""
    gains = list(scene_gains(kept.processes))
    assert len(gains) == len(SCENES)
    for one in gains:
        paper = "" if one.paper is None else f"{one.paper:.2f}"
        over_packets = _say(next(iter(one.packets.values()))) if one.packets else "none"
        yield table_row(f"`{one.scene}`", paper, *map(_say, one.single.values()), over_packets)


def candidates_for_the_gain(kept: Kept) -> Iterable[str]:
    """A candidate a row: gains over the nearest hit and over all hits, and whether one is as large as the paper's."""
    return map(_candidate_row, candidates(kept.processes))


def an_older_embree(kept: Kept) -> Iterable[str]:
    """The gains of the candidates by an older Embree, over both baselines."""
    assert not kept.points["pixels_wrong"].any()
    found = []
    for baseline in ("nearest", "all_hits"):
        ratios = {split_x: list(kept.points[f"{baseline}_over_{split_x}"]) for split_x in (64, 128, 256, 512)}
        split_x, gain = best_of(ratios)
        found.append(Gain(f"{split_x:,} {TIMES} 1", gain))
    yield _candidate_row(Candidate(f"Embree {kept.points['embree_version'].iloc[0]}", *found))


def _candidate_row(one: Any) -> Any:
    return table_row(one.name, *("" if gain is None else gain for gain in (one.nearest, one.all_hits)), one.reaches)


def candidates_in_short(kept: Kept) -> Iterable[str]:
    """The largest gain of an eye far away, and of all other candidates for single rays; whether packets reach 7.50."""
    largest = {
        one.name: max(gain.estimate.value for gain in (one.nearest, one.all_hits) if gain and gain.estimate)
        for one in candidates(kept.processes)
    }
    far = largest.pop("eye at 0, 0.8, 6")
    packets = largest.pop(next(name for name in largest if "packets" in name))
    yield f"reach {digits(max(largest.values()), 2)}, an eye far away {digits(far, 2)}"
    yield "Aligned packets reach it" if packets >= ASKED_FOR else "Nor do aligned packets reach it"


def claim_text(claim: Any) -> Any:
    return f"{claim['text']} (an inference of ours)" if claim["inferred"] else str(claim["text"])


def verdicts(kept: Kept) -> Iterable[str]:
    """A row a claim, with its verdicts under both readings where it has two."""
    rows: dict[tuple[str, str], list[str]] = {}
    for claim in kept.claims:
        if not claim["id"].startswith("best-speedup"):
            said = f"{claim['reading']}: {claim['verdict']}" if claim["reading"] else claim["verdict"]
            rows.setdefault((claim_text(claim), claim["section"]), []).append(said)
    return [table_row(*key, "; ".join(found)) for key, found in rows.items()]


def instances(kept: Kept) -> Iterable[str]:
    kinds = (("copies, culling off", "copied", False), ("copies", "copied", True), ("instances", "instanced", False))
    widest = kept.points["packet_width"].max()
    table = of(kept.points, workload="frame", method="aligned", split_y=1, packet_width=widest)
    for split_x in (64, 1024):
        for kind, geometry, culling in kinds:
            chosen = of(table, split_x=split_x, geometry=geometry, culling=culling).set_index("scene")
            if set(chosen.index) != set(SCENES):
                continue  # skipped on some scene, for the memory it would need
            chosen, label = chosen.loc[list(SCENES)], f"{split_x:,} {TIMES} 1, {kind}"
            yield table_row(f"{label}: Embree's bytes in MiB", *(f"{b / 2**20:,.1f}" for b in chosen["embree_bytes"]))
            yield table_row(f"{label}: {TIMES} packets", *map(digits, chosen["speedup_vs_packets"]))
