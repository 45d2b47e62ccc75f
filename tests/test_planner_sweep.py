"""The sweep of plans: views, what is compared, regret by hand, the figure, and the fit of the model."""

from __future__ import annotations

import time
from dataclasses import replace
from math import e
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import atra
from atra.errors import InputError
from atra.planner.choice import ALIGNED, PACKETS, VISIBLE_FIRST, Choice, choices_of_quality
from atra.planner.features import scene_statistics
from benchmarks.fit_planner import LAWS, Sample, fit_model, read_samples
from experiments.harness.configuration import (
    BuildQuality,
    Configuration,
    MeasureConfiguration,
    Method,
    Quantity,
    SceneConfiguration,
    SceneSource,
    Ties,
)
from experiments.harness.points import plan_points
from experiments.harness.records import Record, write_record
from experiments.harness.views import FITTING_VIEWS, HELD_OUT_VIEWS, VIEWS, view_fields
from experiments.results.table import COLUMNS
from experiments.workloads.planner.figures import SERIES, draw_planner_figure
from experiments.workloads.planner.measure import FRAMES, regrets, say_regrets
from experiments.workloads.quantities import measure_point
from scenes.cornell_box import CORNELL_BOX_CAMERA
from tests.meshes import cornell_box, cornell_camera

# Views


def test_no_view_is_both_fitted_on_and_judged_on() -> None:
    assert not set(FITTING_VIEWS) & set(HELD_OUT_VIEWS)
    assert "own" in FITTING_VIEWS


@pytest.mark.parametrize("view", VIEWS)
def test_every_view_shows_the_scene_from_a_place_of_its_own(view: str) -> None:
    mesh = cornell_box()
    fields = view_fields(mesh, CORNELL_BOX_CAMERA, view)
    camera = atra.Camera(**fields, width=16, height=16)
    assert fields == view_fields(mesh, CORNELL_BOX_CAMERA, view)
    with atra.PixelTracer(mesh, camera, packet_width=1) as tracer:
        assert np.isfinite(tracer.trace().depth).mean() > 0.2
    others = [view_fields(mesh, CORNELL_BOX_CAMERA, other) for other in VIEWS if other != view]
    assert fields not in others


def test_a_view_moved_in_stands_nearer_by_four_tenths_of_what_it_looked_at() -> None:
    eye = np.asarray(CORNELL_BOX_CAMERA["eye"])
    moved = np.asarray(view_fields(cornell_box(), CORNELL_BOX_CAMERA, "near")["eye"])
    with atra.PixelTracer(cornell_box(), cornell_camera(1, 1), packet_width=1) as tracer:
        assert np.linalg.norm(moved - eye) == pytest.approx(0.4 * float(tracer.trace().depth[0, 0]))


def test_an_unknown_view_is_refused() -> None:
    with pytest.raises(InputError, match=r"scene\.view is 'behind'"):
        view_fields(cornell_box(), CORNELL_BOX_CAMERA, "behind")


# Regret


def test_regret_is_the_choice_over_the_best_in_frames_and_in_all() -> None:
    first_s = {"packets": 4.0, "a": 65.0, "b": 18.0}
    frame_s = {"packets": 4.0, "a": 1.0, "b": 2.0}
    assert FRAMES == 64
    found = regrets(first_s, frame_s, "packets", {"estimate": "b", "measure": "a"})
    assert (found["best_plan"], found["best_frame_plan"]) == ("a", "a")
    assert found["packets_regret"] == 256 / 128
    assert (found["estimate_regret"], found["measure_regret"]) == (144 / 128, 1.0)
    assert (found["estimate_frame_regret"], found["measure_frame_regret"]) == (2.0, 1.0)
    assert (found["estimate_vs_packets"], found["measure_vs_packets"]) == (144 / 256, 128 / 256)


def planner_table(rows: list[dict[str, object]]) -> pd.DataFrame:
    common = {"scene": "cornell_box", "triangles": 1112, "width": 64, "height": 64, "status": "ok", "threads": 1}
    common |= {"quantity": "planner", "grids": "planner", "packet_width": 8, "build_quality": "medium"}
    filled = [common | row for row in rows]
    return pd.DataFrame(
        {name: pd.array([row.get(name) for row in filled], dtype=kind) for name, kind in COLUMNS.items()}
    )


ROWS: list[dict[str, object]] = [
    {
        "view": view, "packets_regret": 2.0, "estimate_regret": 1.1 + 0.2 * k, "measure_regret": 1.0 + 0.1 * k,
        "estimate_frame_regret": 1.2, "measure_frame_regret": 1.0, "estimate_vs_packets": 0.6,
        "measure_vs_packets": 0.5,
    }
    for k, view in enumerate(("aside", "around", "wide"))
]  # fmt: skip


def test_the_terminal_says_median_and_worst_of_each_effort() -> None:
    estimated, measured = say_regrets(planner_table(ROWS))
    assert estimated.startswith("estimate: regret 1.30, at worst 1.50;")
    assert measured.startswith("measure: regret 1.10, at worst 1.20;")
    assert "over packets at worst 0.60" in estimated
    assert say_regrets(planner_table([])) == []


def test_the_figure_shows_every_view_of_both_efforts_where_it_belongs() -> None:
    figure = draw_planner_figure(planner_table(ROWS))
    (axis,) = [axis for axis in figure.axes if axis.get_visible()]
    drawn = {line.get_label(): list(line.get_xdata()) for line in axis.lines}
    for label, (name, _) in SERIES.items():
        expected = {row["view"]: row[name] for row in ROWS}
        ticks = [text.get_text().partition(",")[0] for text in axis.get_yticklabels()]
        assert drawn[label] == pytest.approx([expected[view] for view in ticks])


# A point, measured for real at toy size


def toy_configuration() -> Configuration:
    return Configuration(
        scene=SceneConfiguration(name="cornell_box", source=SceneSource.procedural, view="near"),
        measure=MeasureConfiguration(quantity=Quantity.planner, rounds=3, warmup=1),
        method=Method.pixel,
        width=32,
        height=32,
        build_quality=BuildQuality.low,
        threads=1,
    )


def test_a_measured_point_holds_every_candidate_in_the_same_rounds_and_can_be_fitted_to(tmp_path: Path) -> None:
    (planned,) = plan_points([toy_configuration()])
    point = planned.point
    measured = measure_point(point)
    camera = point.camera
    wanted = {str(one) for quality in ("medium", "low") for one in choices_of_quality(camera, quality)}
    assert set(measured.samples) == {one["name"] for one in measured.results["candidates"]} == wanted
    assert {len(values) for values in measured.samples.values()} == {3}
    for effort in ("estimate", "measure"):
        assert measured.results[f"{effort}_plan"] in wanted
        assert measured.results[f"{effort}_regret"] >= 1.0
        assert measured.results[f"{effort}_frame_regret"] >= 1.0

    record = replace(
        Record("toy", "ok", None, point.configuration(), {}),
        warmup_samples=measured.warmup_samples,
        samples=measured.samples,
        results=measured.results,
    )
    write_record(tmp_path, record)
    samples, records = read_samples(tmp_path)
    assert [one.point_id for one in records] == ["toy"]
    assert {str(sample.choice) for sample in samples} == wanted
    model = fit_model(samples, {})
    assert set(model.quality[PACKETS]) == {"low"}


def test_a_point_is_measured_where_processor_time_does_not_tell_frames_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "thread_time", lambda: 0.0)
    (planned,) = plan_points([toy_configuration()])
    measured = measure_point(planned.point)
    assert all(value > 0 for values in measured.samples.values() for value in values)


def test_a_point_passes_its_ties_on_to_plans_and_tracers(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> None:
        raise AssertionError("nobody may ask for ties")

    for module in ("atra.judge.ties", "atra.tracers.base"):
        monkeypatch.setattr(f"{module}.coplanar_overlaps", refuse)
    (planned,) = plan_points([replace(toy_configuration(), ties=Ties.any)])
    measured = measure_point(planned.point)
    assert {one["ties"] for one in measured.results["plans"].values()} == {"any"}


def test_a_point_leaves_out_what_does_not_fit_into_its_memory_budget() -> None:
    (planned,) = plan_points([toy_configuration()])
    measured = measure_point(replace(planned.point, memory_budget_gib=1e-9))
    assert {one["method"] for one in measured.results["candidates"]} == {PACKETS}
    assert measured.results["estimate_plan"] == measured.results["measure_plan"] == "packets"


def test_points_of_held_out_views_and_unknown_scenes_are_not_fitted_to(tmp_path: Path) -> None:
    fields = {"quantity": "planner", "scene": "cornell_box", "view": "near"}
    others = {"view": "wide", "scene": "fireplace_room", "quantity": "time"}
    for name, other in others.items():
        write_record(tmp_path, Record(name, "ok", None, fields | {name: other}, {}))
    with pytest.raises(InputError, match="no points to fit to"):
        read_samples(tmp_path)


# The fit


def made_up_samples(scenes: int = 6) -> list[Sample]:
    """Times that are sums of counts at prices, as the model has it."""
    samples = []
    for scene in range(scenes):
        camera = cornell_camera(64 << (scene % 3), 64 << (scene // 3))
        statistics = scene_statistics(cornell_box(), camera, (8, 16, 32))
        pixels = camera.width * camera.height

        def sample(choice: Choice, first_s: float, frame_s: float, scene=scene, statistics=statistics) -> Sample:  # type: ignore[no-untyped-def]
            return Sample(str(scene), statistics, choice, first_s, frame_s)

        samples += [
            sample(Choice(PACKETS, (1, 1), 8, 2), 2e-6 * pixels, 1e-6 * pixels),
            sample(Choice(PACKETS, (1, 1), 8, 2, "low"), 1e-6 * pixels, 1.2e-6 * pixels),
        ]
        for method in (ALIGNED, VISIBLE_FIRST):
            for nx in (8, 16, 32):
                kept = (statistics.copies if method == ALIGNED else statistics.visible_copies)[nx]
                choice = Choice(method, (nx, 1), 8, 1)
                samples.append(sample(choice, 1e-3 + 3e-6 * kept, 4e-7 * statistics.hits_per_ray * pixels))
    return samples


def test_the_fit_finds_the_prices_behind_the_times_and_what_build_quality_changes() -> None:
    samples = made_up_samples()
    model = fit_model(samples, {})
    assert {f"first {name}" for name in model.first} | {f"frame {name}" for name in model.frame} == set(LAWS)
    assert model.quality[PACKETS]["low"] == pytest.approx((0.5, 1.2))
    assert all(price_s > 0 for law in model.frame.values() for price_s in law.prices_s.values())
    for sample in samples:
        found = model.forecast(sample.statistics, sample.choice, FRAMES)
        assert found.frame_time_s == pytest.approx(sample.frame_time_s, rel=1e-2)
        assert found.first_s == pytest.approx(sample.first_s, rel=1e-2)


def test_the_error_of_a_law_is_that_of_forecasts_from_other_scenes() -> None:
    """Of two scenes that differ in nothing but that one takes e times as long, each is misjudged by e."""
    samples = made_up_samples(scenes=1)
    samples += [replace(one, scene="slow", first_s=one.first_s * e) for one in samples]
    assert fit_model(samples, {}).first[PACKETS].error == pytest.approx(1.0, abs=1e-3)
    assert fit_model(made_up_samples(), {}).first[PACKETS].error < 1e-2


def test_what_packets_miss_by_too_is_no_error_of_another_method() -> None:
    samples = made_up_samples()
    odd = [replace(one, frame_time_s=one.frame_time_s * (e if int(one.scene) % 2 else 1.0)) for one in samples]
    model = fit_model(odd, {})
    assert model.frame[PACKETS].error > 0.4
    assert model.frame[ALIGNED].error < 0.8 * model.frame[PACKETS].error
