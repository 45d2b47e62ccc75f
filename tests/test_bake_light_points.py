"""Bundles that carry light as a point of sweep=bake_rays: what is timed, and what is made of how soon they arrive."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
import pandas as pd
import pytest

from experiments.harness.configuration import Chosen, Configuration, MeasureConfiguration, SceneConfiguration
from experiments.harness.points import plan_points
from experiments.harness.processes.worker import measure_point
from experiments.harness.records import Record
from experiments.methods import find_method
from experiments.methods.raster import RASTER
from experiments.results.claims import DOES_NOT_HOLD, HOLDS, NOT_MEASURED, UNDECIDED
from experiments.workloads.bake_rays import BAKE_RAYS, DIRECT, PATHS, RASTERED, BakeRaysSettings, Use
from experiments.workloads.bake_rays.claims import judge_light
from experiments.workloads.bake_rays.light import _directions_to
from scenes.loading import SceneSource

xatlas = pytest.mark.skipif(importlib.util.find_spec("xatlas") is None, reason="xatlas is not installed (extra `bake`)")


@xatlas
def test_a_point_times_bundles_by_every_tracer_beside_paths_and_finds_how_many_directions_an_error_takes() -> None:
    settings = BakeRaysSettings(use=Use.light, map_size=48, directions=2)
    configuration = Configuration(
        scene=SceneConfiguration(name="cornell_box", source=SceneSource.procedural),
        measure=MeasureConfiguration(rounds=3, warmup=1),
        method=Chosen(RASTER, find_method("raster").options()),
        workload=Chosen(BAKE_RAYS, settings),
        width=32,
        height=32,
    )
    (planned,) = plan_points([configuration])
    found = measure_point(planned.point)
    assert BAKE_RAYS.samples is not None
    assert set(found.samples) == BAKE_RAYS.samples(planned.point) >= {RASTERED, PATHS, DIRECT}
    assert {len(values) for values in found.samples.values()} == {3}
    results = found.results
    assert set(BAKE_RAYS.needs) <= set(results)
    assert results["rays_compared"] == 48 * 48
    assert results["rays_different"] == 0
    assert 0 < results["bundle_error"] < 0.15
    assert results["bundle_error_within_charts"] < results["bundle_error"]
    assert 0.5 < results["texels_within_charts"] < 1.0
    assert 20 < results["bundle_directions_tried"] <= 512
    assert 100 < results["paths_samples_to_rmse_5"] < 500
    assert results["bundle_rays_cut"] == 0


class Guided:
    """Bundles whose error is the inverse of the root of their number."""

    directions = 0
    light = np.zeros(0)

    def add(self, tracer: None, count: int) -> None:
        self.directions += count


def test_the_number_of_directions_lies_between_two_looks_and_nothing_is_made_up_where_none_is_enough() -> None:
    def directions(error: float) -> tuple[float | None, float]:
        one = Guided()
        return _directions_to(error, one, None, lambda _: one.directions**-0.5)  # type: ignore[arg-type]

    assert directions(0.05)[0] == pytest.approx(400.0)
    assert directions(0.1)[0] == pytest.approx(100.0)
    assert directions(0.01) == (None, pytest.approx(512**-0.5))


def value(one: Record, name: str) -> Any:
    (column,) = (found for found in BAKE_RAYS.columns if found.name == name)
    return column.value([one])


def test_times_to_an_error_are_passes_times_seconds_of_the_fastest_tracer_and_light_that_comes_straight() -> None:
    samples = {"own": [3.0] * 3, "single_rays": [2.0] * 3, "coherent_packets": [1.0] * 3, "rasterised": [0.5] * 3,
               "paths": [8.0] * 3, "direct_light": [4.0] * 3}  # fmt: skip
    results = {"paths_samples_to_rmse_5": 50.0, "direct_samples": 16, "bundle_directions_to_rmse_5": 40.0}
    configuration = {"workload_options": {"directions": 2}}
    one = Record("0", "ok", None, configuration, {}, {}, samples, results)
    assert value(one, "paths_time_to_rmse_5_s") == 100.0
    assert value(one, "bundles_time_to_rmse_5_s") == 16.0 + 10.0
    assert value(one, "paths_over_bundles") == pytest.approx(100.0 / 26.0)
    never = Record("0", "ok", None, configuration, {}, {}, samples, results | {"bundle_directions_to_rmse_5": None})
    assert value(never, "bundles_time_to_rmse_5_s") is value(never, "paths_over_bundles") is None
    bundle = Record("0", "ok", None, configuration, {}, {}, {"own": [1.0], "coherent_packets": [2.0]}, {})
    assert value(bundle, "packets_over_aligned") == 2.0
    assert value(bundle, "paths_over_bundles") is value(bundle, "aligned_over_raster") is None


def rows(*points: tuple[float, float, float]) -> pd.DataFrame:
    """Of (lowest ratio, highest, directions); no directions: never."""
    return pd.DataFrame(
        [
            {
                "workload": BAKE_RAYS.name, "status": "ok", "use": "light", "scene": f"scene_{place}",
                "paths_over_bundles": (low * high) ** 0.5, "paths_over_bundles_low": low,
                "paths_over_bundles_high": high, "bundle_directions_to_rmse_5": count, "bundle_error": 0.3,
            }
            for place, (low, high, count) in enumerate(points)
        ]
    )  # fmt: skip


def test_bundles_are_sooner_only_if_they_are_on_every_scene() -> None:
    nan = float("nan")
    assert judge_light(None).verdict == judge_light(rows((1.1, 1.2, 90)).assign(use="sun")).verdict == NOT_MEASURED
    assert judge_light(rows((nan, nan, 90.0))).verdict == NOT_MEASURED
    assert judge_light(rows((1.1, 1.2, 90.0), (2.0, 3.0, 40.0))).verdict == HOLDS
    assert judge_light(rows((1.1, 1.2, 90.0), (0.9, 3.0, 40.0))).verdict == UNDECIDED
    assert judge_light(rows((1.1, 1.2, 90.0), (0.8, 0.9, 40.0))).verdict == DOES_NOT_HOLD
    never = judge_light(rows((2.0, 2.0, 90.0), (nan, nan, nan)))
    assert never.verdict == DOES_NOT_HOLD
    assert never.value == "scene_0 2; scene_1 not reached, 30% left"
