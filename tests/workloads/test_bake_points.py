"""Workload bake: what a point is held against, what its claims make of a table, and its figures."""

import importlib.util
import math
import sys
from io import BytesIO

import numpy as np
import pandas as pd
import pytest

from atra.errors import InputError
from experiments.drawing.figure import make_figures
from experiments.drawing.render import render
from experiments.harness.processes.worker import measure_point
from experiments.harness.records import Record
from experiments.light.bake import AGAINST, BAKE, STAGES, BakeSettings
from experiments.light.bake.claims import CLAIMS
from experiments.light.bake.measure import lamps
from experiments.light.bake.shown import CLAIMS_FILE, FIGURES
from experiments.light.bake_rays.shown import CLAIMS as PREDICTIONS
from experiments.light.mitsuba_light import load_mitsuba
from experiments.results.claims import (
    DOES_NOT_HOLD,
    HOLDS,
    NOT_MEASURED,
    UNDECIDED,
    claim_files,
    judge_all,
    judge_claim,
)
from experiments.results.table import frame_of
from scenes.built_in import make_scene
from scenes.directory import PAPER_SCENES
from tests.points import planned
from tests.three_processes import three_processes

xatlas = pytest.mark.skipif(importlib.util.find_spec("xatlas") is None, reason="xatlas is not installed (extra `bake`)")


def measured(**options):
    one = planned("raster", "bake", (32, 32), asked={"size": 32, "samples": 2} | options)
    assert one.problem is None
    return one.point, measure_point(one.point)


@xatlas
@pytest.mark.parametrize("against", [one for one in AGAINST if one != "mitsuba"])
def test_a_point_is_held_against_the_same_bake_without_one_of_its_means(against):
    asked = {
        "nothing": {"priority": True}, "expansion": {"priority": True, "batch_rays": 512},
        "occupancy": {"occupancy": 0.3}, "environment": {"panorama": True},
    }  # fmt: skip
    point, found = measured(against=against, **asked.get(against, {}))
    assert BAKE.samples is not None
    assert set(found.samples) == BAKE.samples(point)
    assert {len(values) for values in found.samples.values()} == {3}
    results = found.results
    assert set(BAKE.needs) <= set(results)
    if against == "nothing":
        assert set(found.samples) == {"own", "whole_map", "without_view"}
        assert 0.1 < results["visible_share"] < 0.9
        assert results["visible_time_to_rmse_5_s"] > 0
    else:
        assert set(found.samples) == {"own", "other"}
        assert results["other_rays_per_round"] > 0
    if against == "occupancy":
        assert results["map_occupancy"] == pytest.approx(0.3, abs=0.02)
    if against == "roulette":
        assert results["other_rays_per_round"] > 1.2 * results["rays_per_round"]
        assert results["variance_ratio"] < 1
    if against == "expansion":
        assert 0.5 < results["batch_fill"] <= 1


@xatlas
def test_a_lane_for_every_texel_is_held_against_nothing_and_uses_fewer_lanes():
    point, none = measured(against="compaction", compaction="none")
    assert set(none.samples) == {"own"}
    assert point.workload_options.other is None
    _, bounces = measured(against="compaction")
    assert none.results["lane_utilisation"] < 0.6 * bounces.results["lane_utilisation"]
    assert none.results["rays_per_round"] == bounces.results["rays_per_round"]


def test_lamps_are_as_bright_together_however_many_and_lie_inside_the_scene():
    mesh = make_scene("cornell_box").mesh
    one, many = lamps(mesh, 1), lamps(mesh, 256)
    assert (len(one), len(many), lamps(mesh, 0)) == (1, 256, ())
    assert sum(light.power for light in many) == pytest.approx(one[0].power)
    places = np.array([light.position for light in many])
    assert ((places > mesh.bounds[0]) & (places < mesh.bounds[1])).all()


@pytest.mark.parametrize(("options", "told"), [
    ({"lamps": -1}, "lamps is -1"),
    # Mitsuba is handed a scene in its own light alone, and bakes by the library have no view first.
    ({"against": "mitsuba", "albedo": 0.5}, "workload.albedo is .* with workload.against=mitsuba"),
    ({"against": "mitsuba", "lamps": 4}, "workload.lamps is .* with workload.against=mitsuba"),
    ({"against": "mitsuba", "panorama": True}, "workload.panorama is .* with workload.against=mitsuba"),
    ({"against": "mitsuba", "priority": True}, "priority is True for a bake"),
    ({"denoise": True, "priority": True}, "priority is True for a bake"),
    ({"denoise": True, "against": "compaction"}, "against is compaction for a bake"),
])  # fmt: skip
def test_settings_that_no_bake_can_have_are_refused(options, told):
    with pytest.raises(InputError, match=told):
        BakeSettings(**options)


def test_without_its_package_a_point_says_what_to_install(monkeypatch):
    for package in ("mitsuba", "pyoidn"):
        monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=r"workload\.against=mitsuba needs mitsuba; run: pip install -e '\.\[peers\]'"):
        load_mitsuba("llvm_ad_rgb", "workload.against=mitsuba", 1)
    with pytest.raises(InputError, match="denoising needs the package pyoidn"):
        planned("raster", "bake", (32, 32), asked={"denoise": True})


@xatlas
def test_finishing_is_measured_against_a_map_of_other_random_numbers():
    pytest.importorskip("pyoidn", reason="pyoidn is not installed: pip install -e '.[denoise]'")
    _, found = measured(denoise=True, final_samples=8)
    assert 0 < found.results["denoised_ratio"] < 2  # of a map of 8 samples, over one of 32
    assert 0 < found.results["seam_step_ratio"] <= 0.25


@xatlas
def test_a_map_that_is_not_denoised_has_at_least_twice_the_error_of_four_times_the_samples(monkeypatch):
    monkeypatch.setattr("experiments.light.bake.check_denoiser", lambda: None)
    monkeypatch.setattr("experiments.light.bake.measure.denoised", lambda lightmap, threads: lightmap)
    _, found = measured(denoise=True, final_samples=16)
    assert 1.9 < found.results["denoised_ratio"] < 6.0  # 2 for independent samples, 4 for evenly spread ones


def value(samples, name, **results):
    record = Record("0", "ok", None, {"workload": BAKE.name}, {}, {}, samples, results)
    (column,) = (column for column in BAKE.columns if column.name == name)
    return column.value([record])


def test_ratios_are_of_rounds_of_rays_and_of_variance_times_time():
    samples = {"own": [1.0, 1.0, 2.0], "other": [2.0, 3.0, 4.0]}
    results = {"rays_per_round": 100, "other_rays_per_round": 150.0, "variance_ratio": 0.5, "tracing_ratio": 1.5}
    expected = {
        "speedup_vs_other": 2.0, "rays_speedup_vs_other": pytest.approx(2.0 * 100 / 150), "quality_vs_other": 1.0,
        "tracing_vs_other": 1.5, "shading_vs_other": None,
    }  # fmt: skip
    assert {name: value(samples, name, **results) for name in expected} == expected
    assert value({"own": [1.0] * 3}, "quality_vs_other", rays_per_round=100) is None


def table(*rows):
    """Rows of all scenes with these values, as a sweep's table holds them."""
    usual = {"workload": BAKE.name, "method": "raster", "status": "ok", "grids": "bake", "albedo": "own",
             "priority": False, "compaction": "bounces", "against": "compaction", "denoise": False,
             "occupancy": "0.44", "triangles": 10}  # fmt: skip
    every = [
        usual | {"scene": scene, "point_id": f"{place:03d}{number}"}
        | {name: one[number] if isinstance(one, tuple) else one for name, one in row.items()}
        for place, row in enumerate(rows) for number, scene in enumerate(PAPER_SCENES)
    ]  # fmt: skip
    return frame_of(every)


def ratio(name, *ends):
    """A column and its interval, of all four scenes."""
    low, high = zip(*ends, strict=True)
    middle = tuple(math.sqrt(a * b) for a, b in ends)
    return {name: middle, f"{name}_low": low, f"{name}_high": high}


def verdict(claim, rows):
    (found,) = (one for one in CLAIMS if one.id == claim)
    (judged,) = judge_claim(found, three_processes(rows))
    return judged.verdict


GOOD, BAD = (1.2, 1.3), (0.8, 0.9)


GAIN, LOSS = ratio("speedup_vs_other", *[GOOD] * 4), ratio("rays_speedup_vs_other", *[BAD] * 4)
SECONDS = [{"method": "pixel", "culling_map_s": 0.3}, {"method": "visible_first", "culling_map_s": 0.1}]
SHARE = {"method": "visible_first", "priority": True, "culling_map_s": 0.1, "visible_time_to_rmse_5_s": 4.0}
VIEW = {"priority": True, "against": "nothing", "visible_share": 0.4} | ratio("view_speedup", *[(1.7, 1.8)] * 4)
NO_STAGES = dict.fromkeys((f"{stage}_s" for stage in STAGES), 0.0) | {"trace_s": 0.96}
SIZES = [{"size": size, "batch_rays": 1 << 12, "buffer_bytes": 1000} for size in (256, 512)]
MITSUBA = {"against": "mitsuba", "threads": 1, "other_light_ratio": 1.01, "other_light_error": 0.003}
MITSUBA_GOOD, MITSUBA_SLOWER = (
    MITSUBA | ratio("speedup_vs_best_other", *[ends] * 4) for ends in ((1.02, 1.1), (0.95, 1.1))
)
MITSUBA_ERROR = MITSUBA_GOOD | {"robust_rays": False} | ratio("quality_vs_other", *[(2.1, 2.4)] * 4)


def occupied(*ends):
    return {"against": "occupancy"} | ratio("rays_speedup_vs_other", *[ends] * 4)


def opaque(*ends):
    return {"against": "translucency"} | ratio("speedup_vs_other", *[ends] * 4)


@pytest.mark.parametrize(("claim", "rows", "expected"), [
    # A bound has two ends, and a claim its own points.
    ("occupancy-no-matter", [occupied(0.97, 1.03)], HOLDS),
    ("occupancy-no-matter", [occupied(1.06, 1.1)], DOES_NOT_HOLD),
    ("occupancy-no-matter", [occupied(0.9, 0.94)], DOES_NOT_HOLD),
    ("target-view", [VIEW], HOLDS), ("target-view", [VIEW | {"visible_share": 0.6}], NOT_MEASURED),
    ("target-bounces", [GAIN | {"grids": "bake_dark"}], HOLDS), ("target-bounces", [GAIN], NOT_MEASURED),
    ("compaction-bounces", [GAIN | {"albedo": "0.5"}], NOT_MEASURED),
    # Of the emptiest maps alone.
    ("target-texels", [{"compaction": "texels"} | ratio("rays_speedup_vs_other", *[GOOD] * 4),
                       {"compaction": "texels", "occupancy": "0.7"} | LOSS], HOLDS),
    # Where every process finds the same, no interval is needed.
    ("occupancy", [{"occupancy": "any", "map_occupancy": (0.6, 0.55, 0.69, 0.5)}], HOLDS),
    ("occupancy", [{"occupancy": "any", "map_occupancy": (0.6, 0.55, 0.72, 0.5)}], DOES_NOT_HOLD),
    ("buffers", SIZES, HOLDS), ("buffers", [SIZES[0], SIZES[1] | {"buffer_bytes": 1030}], DOES_NOT_HOLD),
    ("buffers", SIZES[:1], NOT_MEASURED),
    ("rare-stages", [NO_STAGES | {"gather_s": 0.04}], HOLDS),
    ("rare-stages", [NO_STAGES | {"gather_s": 0.1}], DOES_NOT_HOLD),
    ("no-waiting", [NO_STAGES | {"other_s": 0.005}], HOLDS),
    ("no-waiting", [NO_STAGES | {"other_s": 0.02}], DOES_NOT_HOLD),
    # Opaque scenes pay no more than the bound that was set.
    ("opaque", [opaque(0.99, 1.02)], HOLDS), ("opaque", [opaque(1.04, 1.06)], DOES_NOT_HOLD),
    ("opaque", [opaque(1.0, 1.06)], UNDECIDED),
    # Beside Mitsuba one thread counts, where both find the same light, and all points of a scene.
    ("target-mitsuba", [MITSUBA_GOOD], HOLDS), ("target-mitsuba", [MITSUBA_GOOD, MITSUBA_SLOWER], UNDECIDED),
    ("target-mitsuba", [MITSUBA_GOOD | {"other_light_error": (0.003, 0.003, 0.003, 0.002)}], UNDECIDED),
    ("target-mitsuba", [MITSUBA_GOOD | {"threads": 2}], NOT_MEASURED),
    ("target-mitsuba-error", [MITSUBA_ERROR], HOLDS),
    ("target-mitsuba-error", [MITSUBA_ERROR | ratio("quality_vs_other", *[(1.8, 1.9)] * 4)], DOES_NOT_HOLD),
    ("target-mitsuba-error", [MITSUBA_ERROR | ratio("quality_vs_other", *[(1.9, 2.1)] * 4)], UNDECIDED),
    ("target-mitsuba-error", [MITSUBA_ERROR | {"robust_rays": True}], NOT_MEASURED),
    # What a view shows is searched for by both methods.
    ("culling-map", SECONDS, HOLDS), ("culling-map", SECONDS[:1], NOT_MEASURED),
    ("culling-map", [SECONDS[0], SECONDS[1] | {"culling_map_s": (0.1, 0.1, 0.1, 0.25)}], DOES_NOT_HOLD),
    ("culling-map-share", [SHARE], HOLDS),
    ("culling-map-share", [SHARE | {"visible_time_to_rmse_5_s": 1.0}], DOES_NOT_HOLD),
    ("culling-map-share", [SHARE | {"method": "raster"}], NOT_MEASURED),
])  # fmt: skip
def test_a_claim_is_judged_by_its_own_points_and_by_both_ends_of_its_bound(claim, rows, expected):
    assert verdict(claim, table(*rows)) == expected


def test_claims_are_written_and_nothing_is_claimed_of_no_table():
    assert {judge_claim(claim, table({})[:0])[0].verdict for claim in CLAIMS} == {NOT_MEASURED}
    judged = judge_all(CLAIMS, three_processes(table(GAIN)))
    written = pd.read_csv(BytesIO(claim_files(judged, CLAIMS_FILE)[f"{CLAIMS_FILE}.csv"]))
    assert list(written["id"]) == [claim.id for claim in CLAIMS]
    assert len({claim.id for claim in CLAIMS}) == len(CLAIMS)


def drawn_rows():
    """Made-up rows of a whole sweep=bake, of which all figures draw something."""
    rng = np.random.default_rng(1)
    rows = []
    for occupancy in ("0.44", "0.7"):
        for compaction, rate in (("none", 3.0e6), ("texels", 3.6e6), ("bounces", 4.2e6)):
            parts = {f"{stage}_s": float(rng.uniform(0, 0.02)) for stage in STAGES}
            rates = tuple((rate * f * 0.97, rate * f * 1.03) for f in (1.0, 0.7, 0.5, 0.4))
            rows.append({
                "compaction": compaction, "occupancy": occupancy, "map_occupancy": float(occupancy),
                "lane_utilisation": 0.5, **parts, **ratio("rays_per_s", *rates),
            })  # fmt: skip
    times = {f"time_to_rmse_{limit}_s": 40.0 / limit**2 for limit in (10, 5, 2)}
    seen = {f"visible_{name}": 0.4 * one for name, one in times.items()}
    ratios = ratio("view_speedup", *[(1.9, 2.1)] * 4) | ratio("whole_map_cost", *[(0.99, 1.05)] * 4)
    rows.append({"against": "nothing", "priority": True} | times | seen | ratios)
    return table(*rows)


def test_figures_show_errors_over_time_stages_and_rays(tmp_path):
    rows = drawn_rows()
    rows = rows[rows["scene"].isin(PAPER_SCENES[:2])]
    for kind in FIGURES:
        chosen = kind.rows(rows)
        (figure,) = make_figures(kind, chosen, tmp_path)
        assert set(figure.point_ids) == set(chosen["point_id"])
        assert len(chosen) == (2 if kind.name == "bake_convergence" else 12)
        assert len(kind.rows(rows[:0])) == 0
        assert not any(panel.is_empty for panel in figure.figure.panels)
        assert b"<svg" in render(figure.figure, "svg")


def test_rays_to_the_sun_without_their_shortcut_are_no_part_of_a_claim():
    one = {"workload": "bake_rays", "method": "raster", "scene": "cornell_box", "use": "sun", "positions": 16}
    rows = [
        one | {"status": "ok", "point_id": str(how), "shortcut": how, "packets_over_aligned": ratio * by}
        for how, ratio in ((True, 2.0), (False, 0.5))
        for by in (0.99, 1.0, 1.01)
    ]
    verdicts = {claim.id: claim.verdict for claim in judge_all(PREDICTIONS, frame_of(rows))}
    assert verdicts["sun-gains-in-the-box"] == HOLDS


def test_of_several_points_of_a_scene_a_claim_says_from_where_to_where():
    (claim,) = (one for one in CLAIMS if one.id == "compaction-bounces")
    slower, faster = ratio("speedup_vs_other", *[GOOD] * 4), ratio("speedup_vs_other", *[(1.4, 1.5)] * 4)
    (judged,) = judge_claim(claim, three_processes(table({"occupancy": "0.7"} | slower, faster)))
    assert judged.value.startswith("cornell_box: 1.25 to 1.45 (holds); mitsuba: 1.25 to 1.45 (holds); ")
