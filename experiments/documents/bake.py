"""What pages quote of sweep=bake and of the other sweeps of lightmaps."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from experiments.documents.quotation import SCENES, Kept, interval, line, of, table_row
from experiments.light.bake import RARE, STAGES
from experiments.light.bake.claims import CLAIMS
from experiments.light.bake_rays.shown import CLAIMS as PREDICTIONS
from experiments.results.claims import judge_claim

_OF_OTHERS = {
    "finishing": ("target-denoised", "target-seams"), "buffers": ("buffers",),
    "mitsuba": ("target-mitsuba", "target-mitsuba-error"), "views": ("culling-map", "culling-map-share"),
}  # fmt: skip
"""Claims that a sweep of their own decides."""


def _row(kept: Kept, label: Any, column: Any, say: Any = interval, **values: Any) -> Any:
    """A line with the ratio of each scene and its interval; of several points of a scene, of the emptiest map."""
    cells = []
    for scene in SCENES:
        rows = of(kept.points, scene=scene, **values)
        rows = rows[rows[column].notna()].sort_values("map_occupancy", kind="stable")
        cells.append("not measured" if rows.empty else say(rows.iloc[0], column))
    return table_row(label, *cells)


def _shares(kept: Kept, label: Any, **values: Any) -> Any:
    """A line with what part of a round rare stages take."""
    cells = []
    for scene in SCENES:
        rows = of(kept.points, scene=scene, **values)
        rare, whole = (sum(rows[f"{stage}_s"].median() for stage in stages) for stages in (RARE, STAGES))
        cells.append("not measured" if rows.empty else f"{100 * rare / whole:.1f} %")
    return table_row(label, *cells)


_RAYS, _SPEED, _QUALITY = "rays_speedup_vs_other", "speedup_vs_other", "quality_vs_other"
_TEXELS = {"against": "compaction", "compaction": "texels"}
_ALONE = {"against": "compaction", "compaction": "bounces"}
_DARK = {"against": "compaction", "albedo": "0.5"}
_EXPANSION = {"against": "expansion", "expansion": 16}
_PANORAMA = {"against": "environment", "environment": "mis"}
_LIGHTS = {"against": "lights", "lamps": 256}


def means_of_a_bake(kept: Kept) -> Iterable[str]:
    """Each means of a bake over a bake without it; above 1 is a gain, but where a label says what is over what."""
    share = "expansion and gathering of 16 samples side by side: of a round"
    for label, column, values in (
        ("lanes for lit texels, near ones side by side: rays/s", _RAYS, _TEXELS),
        ("lanes that go on alone: speed", _SPEED, _ALONE | {"albedo": "own"}),
        ("lanes that go on alone, albedo 0.5: speed", _SPEED, _DARK | {"packets": "1"}),
        ("the same in the widest packets: speed", _SPEED, _DARK | {"packets": "widest"}),
        ("the emptiest map over the fullest: rays/s", _RAYS, {"against": "occupancy", "compaction": "bounces"}),
        ("16 samples side by side: rays/s", _RAYS, _EXPANSION),
        (share, None, _EXPANSION),
        ("what the view shows, first: speed", "view_speedup", {"compaction": "bounces"}),
        ("the whole map, the view first over by place: time", "whole_map_cost", {"compaction": "bounces"}),
        ("roulette: speed to an error", _QUALITY, {"against": "roulette"}),
        ("a panorama found both ways: speed to an error", _QUALITY, _PANORAMA),
        ("a grid of 256 lights: speed to an error", _QUALITY, _LIGHTS),
        ("code for faces that let light on over code without: time", _SPEED, {"against": "translucency"}),
    ):
        yield _row(kept, label, column, **values) if column else _shares(kept, label, **values)


def finished_maps(kept: Kept) -> Iterable[str]:
    """Error denoised over raw of four times the samples, and what is left of the steps at seams."""
    for label, column in (
        ("denoised at 64 samples over raw at 256: error", "denoised_ratio"),
        ("after stitching over before: step at seams", "seam_step_ratio"),
    ):
        found = [of(kept.points, scene=scene)[column].dropna() for scene in SCENES]
        yield table_row(label, *("not measured" if one.empty else f"{one.iloc[0]:.2f}" for one in found))


def paths_beside_mitsuba(kept: Kept) -> Iterable[str]:
    """Paths a second over Mitsuba's, and its time to an error over ours, with robust rays and with its own settings."""
    for ours, settings in (
        ("robust rays", {"robust_rays": True}),
        ("Mitsuba's settings", {"robust_rays": False, "packets": "1"}),
        ("Mitsuba's settings, packets of 8", {"robust_rays": False, "packets": "8"}),
    ):
        for label, column in (
            ("paths/s over Mitsuba's", _SPEED),
            ("paths/s over its best", "speedup_vs_best_other"),
            ("its time to an error over ours", "quality_vs_other"),
        ):
            yield _row(kept, f"{ours}: {label}", column, against="mitsuba", **settings)


def bias_of_adaptive(kept: Kept) -> Iterable[str]:
    """How far the mean light of adaptive maps is off, with its standard error, and what they leave out and save."""
    found = [of(kept.points, scene=scene, adaptive=True).iloc[0] for scene in SCENES]
    biases = (f"{100 * row['adaptive_bias']:+.2f} ± {100 * row['adaptive_bias_error']:.2f} %" for row in found)
    yield table_row("mean light, adaptive over full, less 1", *biases)
    yield table_row("samples left out", *(f"{100 * row['adaptive_left_out']:.1f} %" for row in found))
    yield line("full over adaptive: time", found, "adaptive_speedup")


def _verdicts(kept: Kept, claims: Any) -> Any:
    """A row a claim."""
    judged = (one for claim in claims for one in judge_claim(claim, kept.processes))
    return (table_row(one.text, one.value or "-", one.verdict) for one in judged)


def _verdicts_on(kept: Kept, sweep: Any) -> Any:
    return _verdicts(kept, [claim for claim in CLAIMS if claim.id in _OF_OTHERS[sweep]])


def verdicts_on_lightmaps(kept: Kept) -> Iterable[str]:
    """On all claims that no other sweep decides."""
    others = {name for names in _OF_OTHERS.values() for name in names}
    return _verdicts(kept, [claim for claim in CLAIMS if claim.id not in others])


def verdicts_on_finishing(kept: Kept) -> Iterable[str]:
    return _verdicts_on(kept, "finishing")


def verdicts_on_buffers(kept: Kept) -> Iterable[str]:
    return _verdicts_on(kept, "buffers")


def verdicts_on_mitsuba(kept: Kept) -> Iterable[str]:
    return _verdicts_on(kept, "mitsuba")


def verdicts_on_views(kept: Kept) -> Iterable[str]:
    return _verdicts_on(kept, "views")


def verdicts_on_alignment(kept: Kept) -> Iterable[str]:
    """On the predictions of what alignment gains."""
    return _verdicts(kept, PREDICTIONS)
