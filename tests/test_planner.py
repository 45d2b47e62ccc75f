"""The planner: what it knows of a view, what it chooses, what it spends, and that its plans survive a file."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import psutil
import pytest

import atra
from atra.alignment.culling import EMBREE_BYTES_PER_COPY, PLAN_BYTES_PER_COPY
from atra.embree.scene import EmbreeScene
from atra.errors import InputError, MemoryBudgetError
from atra.geometry.ray_space import NARROWEST_WORLD_PITCH
from atra.planner import estimate as estimating
from atra.planner import features as featuring
from atra.planner.choice import ALIGNED, PACKETS, VISIBLE_FIRST, Choice, candidates, choices_of_quality
from atra.planner.estimate import Law, Model, load_model
from atra.planner.features import scene_statistics
from atra.planner.measuring import Trial, clock_for, measure
from atra.planner.plan import Forecast, Plan
from atra.planner.planning import warm_up
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads, random_triangles

PACKETS_CHOICE = Choice(PACKETS, (1, 1), 8, 2)


def wall(z: float, half: float) -> list[tuple[float, float, float]]:
    return [(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)]


def square_camera(width: int = 64, height: int = 64) -> atra.Camera:
    """Half a scene unit to each side per unit of depth."""
    return atra.Camera(**EYE_AT_ORIGIN, fov_y_degrees=float(np.degrees(2 * np.arctan(0.5))), width=width, height=height)


# Statistics


def test_a_ray_meets_every_wall_and_sees_the_nearest() -> None:
    mesh = quads([wall(2, 10), wall(3, 10), wall(4, 10)])
    statistics = scene_statistics(mesh, square_camera(), (4,))
    assert statistics.hit_share == 1.0
    # Of 8 x 8 rays, the 8 on the diagonal meet both triangles of every wall.
    assert statistics.hits_per_ray == 3 * (64 + 8) / 64
    assert (statistics.triangles, statistics.in_view, statistics.visible) == (6, 6, 2)


def test_a_wall_over_a_quarter_of_the_image_is_hit_by_a_quarter_of_the_rays() -> None:
    half = 2 * 0.5 / 2  # at depth 2 the image is 2 wide
    statistics = scene_statistics(quads([wall(2, half)]), square_camera(), (4,))
    assert statistics.hit_share == 0.25


def test_nothing_is_counted_behind_the_eye_or_beside_the_image() -> None:
    beside = [(x + 100, y, z) for x, y, z in wall(2, 1)]
    statistics = scene_statistics(quads([wall(-2, 10), beside]), square_camera(), (4,))
    assert (statistics.in_view, statistics.visible, statistics.hit_share, statistics.hits_per_ray) == (0, 0, 0.0, 0.0)


def test_a_wall_through_the_plane_of_the_eye_is_hit_in_front_of_it_only() -> None:
    floor = [(-50.0, -1.0, -50.0), (50.0, -1.0, -50.0), (50.0, -1.0, 50.0), (-50.0, -1.0, 50.0)]
    statistics = scene_statistics(quads([floor]), square_camera(), (4,))
    assert statistics.hit_share == 0.5
    assert (statistics.in_view, statistics.visible) == (1, 1)  # the other half lies to one side


def test_boxes_are_the_share_of_the_image_that_bounding_rectangles_cover() -> None:
    # Each of a wall's two triangles has all of the wall as its box; the near wall covers a quarter of the image.
    statistics = scene_statistics(quads([wall(2, 0.5), wall(3, 10)]), square_camera(), (4,))
    assert statistics.boxes == pytest.approx(2 * 0.25 + 2)
    hidden = scene_statistics(quads([wall(2, 10), wall(3, 10)]), square_camera(), (4,))
    assert (hidden.boxes, hidden.visible_boxes) == pytest.approx((4, 2))


def test_copies_are_those_that_culling_keeps() -> None:
    mesh, camera = random_triangles(300, seed=3), square_camera()
    statistics = scene_statistics(mesh, camera, (4, 16))
    for nx in (4, 16):
        with atra.AlignedTracer(mesh, camera, (nx, 1)) as tracer:
            assert statistics.copies[nx] == tracer.triangle_count
        assert 0 < statistics.visible_copies[nx] <= statistics.copies[nx]


def test_a_view_so_narrow_that_ray_space_has_the_cameras_axes_is_counted_like_any_other() -> None:
    mesh = quads([wall(0, 10), wall(-1, 10)])
    camera = atra.Camera((60, 50, 62), (0, 0, 0), fov_y_degrees=0.5, width=64, height=64)
    assert camera.pixel_pitch < NARROWEST_WORLD_PITCH
    statistics = scene_statistics(mesh, camera, (4,))
    assert statistics.hit_share == 1.0
    assert (statistics.in_view, statistics.visible) == (4, 2)


def test_parallel_rays_meet_the_walls_before_them() -> None:
    mesh = quads([wall(2, 0.5), wall(3, 10), wall(-2, 10)])
    camera = atra.OrthographicCamera(**EYE_AT_ORIGIN, view_height=2.0, width=64, height=64)
    statistics = scene_statistics(mesh, camera, (4,))
    assert statistics.hit_share == 1.0
    # Of 8 x 8 rays, 16 meet the near wall too, and the 8 + 4 on the diagonals meet two triangles of a wall.
    assert statistics.hits_per_ray == (64 + 16 + 8 + 4) / 64
    assert statistics.visible == statistics.in_view


# Estimates


def test_an_estimate_builds_nothing_and_passes_once_over_the_triangles_for_each_split(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("an estimate must not build a BVH")

    passes = []
    count = featuring.count_kept

    def count_pass(pool, points_pixels, mesh, culling, cell):  # type: ignore[no-untyped-def]
        passes.append(cell[0])
        return count(pool, points_pixels, mesh, culling, cell)

    monkeypatch.setattr(EmbreeScene, "__init__", refuse)
    monkeypatch.setattr(featuring, "count_kept", count_pass)
    camera = cornell_camera(256, 256)
    atra.plan(cornell_box(), camera)
    assert sorted(passes) == [1, 16, 32, 64, 128]


def test_estimates_are_the_same_every_time() -> None:
    mesh, camera = random_triangles(500, seed=1), square_camera()
    assert atra.plan(mesh, camera) == atra.plan(mesh, camera)


def test_packets_are_chosen_for_a_single_frame_of_a_large_scene() -> None:
    mesh = random_triangles(60_000, seed=5, size=0.02)  # of which every one is in view
    camera = atra.Camera((0, 0, -12), (0, 0, 0), width=128, height=128)
    assert atra.plan(mesh, camera, frames=1).method == PACKETS


def test_alignment_is_chosen_for_many_frames_of_the_cornell_box() -> None:
    assert atra.plan(cornell_box(), cornell_camera(1024, 1024), frames=1000).method in (ALIGNED, VISIBLE_FIRST)


def flat_model(error: float, aligned_frame_s: float) -> Model:
    """A second to the first frame, whatever it is, and a second for every other of packets."""
    first = {method: Law({"view": 1.0}, 0.0) for method in (PACKETS, ALIGNED, VISIBLE_FIRST)}
    frame = {
        PACKETS: Law({"view": 1.0}, 0.0),
        ALIGNED: Law({"view": aligned_frame_s}, error),
        VISIBLE_FIRST: Law({"view": 2.0}, error),
    }
    return Model(first, frame, {method: {} for method in first}, {})


@pytest.mark.parametrize(("error", "chosen"), [(0.01, ALIGNED), (0.5, PACKETS)])
def test_a_gain_within_the_models_uncertainty_is_not_taken(
    error: float, chosen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(estimating, "load_model", lambda: flat_model(error, aligned_frame_s=0.8))
    assert atra.plan(cornell_box(), cornell_camera(64, 64), frames=1000).method == chosen


def test_a_forecast_adds_up_counts_at_their_prices() -> None:
    camera = square_camera()
    statistics = scene_statistics(cornell_box(), camera, (16,))
    laws = {ALIGNED: Law({"pixels": 2.0, "copies": 3.0}, 0.1)}
    model = Model(laws, {ALIGNED: Law({"triangles": 1.0}, 0.3)}, {ALIGNED: {"low": (0.25, 2.0)}}, {})
    forecast = model.forecast(statistics, Choice(ALIGNED, (16, 1), 8, 2), 9)
    first_s, frame_s = 2.0 * 64 * 64 + 3.0 * statistics.copies[16], float(statistics.triangles)
    assert (forecast.first_s, forecast.frame_time_s) == pytest.approx((first_s, frame_s))
    assert forecast.total_s(9) == pytest.approx(first_s + 8 * frame_s)
    assert forecast.error == pytest.approx((0.1 * first_s + 0.3 * 8 * frame_s) / (first_s + 8 * frame_s))
    quick = model.forecast(statistics, Choice(ALIGNED, (16, 1), 8, 2, "low"), 9)
    assert (quick.first_s, quick.frame_time_s) == pytest.approx((0.25 * first_s, 2.0 * frame_s))


def test_the_shipped_model_knows_all_methods_and_says_what_it_was_fitted_on() -> None:
    model = load_model()
    assert set(model.first) == set(model.frame) == {PACKETS, ALIGNED, VISIBLE_FIRST}
    assert {"cpu", "scenes", "views", "date", "points"} <= set(model.fitted_on)
    assert all(
        price_s > 0 for laws in (model.first, model.frame) for law in laws.values() for price_s in law.prices_s.values()
    )
    assert Model.from_json(model.to_json()) == model


def test_copies_that_do_not_fit_into_memory_are_not_considered(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = cornell_camera(256, 256)
    copies = scene_statistics(cornell_box(), camera, (128,)).copies[128]
    free_bytes = copies * (PLAN_BYTES_PER_COPY + EMBREE_BYTES_PER_COPY["medium"]) - 1
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=free_bytes))
    considered = {(one.choice.method, one.choice.split[0]) for one in atra.plan(cornell_box(), camera).considered}
    assert (ALIGNED, 128) not in considered
    assert {(PACKETS, 1), (ALIGNED, 64)} <= considered


# Candidates


def test_candidates_divide_the_image_and_begin_with_packets() -> None:
    for width in (1024, 1280, 1365, 1366, 1009):
        camera = square_camera(width, 32)
        choices = candidates(camera, 64)
        assert choices[0].method == PACKETS
        assert all(width % choice.split[0] == 0 for choice in choices)
    assert {choice.split[0] for choice in candidates(square_camera(1280, 720), 64)} == {1, 80, 160, 320, 640}


def test_build_quality_follows_the_number_of_frames() -> None:
    camera = square_camera()
    qualities = {frames: {choice.build_quality for choice in candidates(camera, frames)} for frames in (1, 64, 5000)}
    assert qualities == {1: {"medium", "low"}, 64: {"medium"}, 5000: {"medium", "high"}}


def test_parallel_rays_have_no_visible_first_candidate() -> None:
    camera = atra.OrthographicCamera(**EYE_AT_ORIGIN, width=64, height=64)
    assert {choice.method for choice in choices_of_quality(camera, "medium")} == {PACKETS, ALIGNED}
    assert atra.plan(cornell_box(), camera, effort="measure", budget_s=0.05).method in (PACKETS, ALIGNED)


# Measuring


class FakeClock:
    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


class FakeTracer:
    """Plan and build take first_s, every frame frame_time_s."""

    def __init__(
        self, clock: FakeClock, log: list[Choice], choice: Choice, first_s: float, frame_time_s: float
    ) -> None:
        self.clock, self.log, self.choice = clock, log, choice
        self.first_s, self.frame_time_s = first_s, frame_time_s
        self.closed = False

    def plan(self) -> None:
        self.log.append(self.choice)

    def build(self) -> None:
        self.clock.now_s += self.first_s

    def trace(self, out: object = None) -> None:
        self.clock.now_s += self.frame_time_s

    def close(self) -> None:
        self.closed = True


def aligned(nx: int) -> Choice:
    return Choice(ALIGNED, (nx, 1), 8, 2)


def measured(
    true: dict[Choice, tuple[float, float]], guessed: dict[Choice, tuple[float, float]], budget_s: float, error: float
) -> tuple[list[Forecast], list[Choice], float, list[FakeTracer]]:
    """Measure tracers that take `true` (plan and build, frame) after estimates of `guessed`; returns also who was
    tried, the seconds spent, and the tracers."""
    clock, log, tracers = FakeClock(), [], []

    def make(choice: Choice) -> FakeTracer:
        clock.now_s += 100.0  # compiling is not on the budget
        tracers.append(FakeTracer(clock, log, choice, *true[choice]))
        return tracers[-1]

    estimates = [Forecast(choice, *times, error, measured=False) for choice, times in guessed.items()]
    found = measure(estimates, PACKETS_CHOICE, make, frames=64, budget_s=budget_s, clock=clock)  # type: ignore[arg-type]
    return found, log, clock.now_s - 100.0 * len(log), tracers


TRUE = {PACKETS_CHOICE: (0.1, 0.1), aligned(64): (0.2, 0.08), aligned(128): (0.2, 0.05), aligned(256): (0.3, 0.06)}


def test_the_fastest_of_all_is_found_when_the_budget_allows() -> None:
    found, tried, _, tracers = measured(TRUE, TRUE, budget_s=10.0, error=1.0)
    assert found[0].choice == aligned(128)
    assert (found[0].first_s, found[0].frame_time_s) == pytest.approx((0.25, 0.05))
    assert set(tried) == set(TRUE)
    assert all(tracer.closed for tracer in tracers)


@pytest.mark.parametrize("budget_s", [0.01, 0.35, 0.7, 1.0, 2.0])
def test_the_budget_is_kept_except_for_packets_which_come_first(budget_s: float) -> None:
    _, tried, spent_s, _ = measured(TRUE, TRUE, budget_s, error=1.0)
    assert tried[0] == PACKETS_CHOICE
    assert spent_s <= max(budget_s, 0.3) + 1e-9


def test_the_most_promising_is_tried_first() -> None:
    _, tried, _, _ = measured(TRUE, TRUE, budget_s=0.75, error=1.0)  # enough for any one beside packets
    assert tried == [PACKETS_CHOICE, aligned(128)]


def test_on_a_machine_twice_as_slow_as_the_models_the_budget_is_kept_all_the_same() -> None:
    guessed = {choice: (first_s / 2, frame_s / 2) for choice, (first_s, frame_s) in TRUE.items()}
    _, tried, spent_s, _ = measured(TRUE, guessed, budget_s=0.59, error=1.0)
    assert tried == [PACKETS_CHOICE]
    assert spent_s <= 0.59


def test_a_hopeless_estimate_is_not_tried() -> None:
    guessed = {**TRUE, aligned(64): (0.2, 0.5)}
    _, tried, _, _ = measured(TRUE, guessed, budget_s=10.0, error=0.1)
    assert aligned(64) not in tried


def test_an_estimate_is_judged_by_how_the_last_of_its_method_did() -> None:
    """Aligned tracing takes a tenth of what was estimated, packets what was: by those, 256 would have been hopeless."""
    guessed = {choice: TRUE[choice] for choice in (PACKETS_CHOICE, aligned(128), aligned(256))}
    true = {**TRUE, aligned(128): (0.02, 0.005), aligned(256): (0.02, 0.004)}
    found, tried, _, _ = measured(true, guessed, budget_s=10.0, error=0.1)
    assert tried == [PACKETS_CHOICE, aligned(128), aligned(256)]
    assert found[0].choice == aligned(256)


def test_packets_are_kept_where_the_gain_is_within_the_noise() -> None:
    true = {PACKETS_CHOICE: (0.1, 0.1), aligned(128): (0.1, 0.099)}
    found, tried, _, _ = measured(true, true, budget_s=10.0, error=1.0)
    assert len(tried) == 2
    assert found[0].choice == PACKETS_CHOICE


@pytest.mark.parametrize("effort", ["estimate", "measure"])
def test_only_packets_are_considered_for_a_memory_budget_that_holds_no_copies(effort: str) -> None:
    plan = atra.plan(cornell_box(), cornell_camera(64, 64), effort=effort, budget_s=0.1, memory_budget_bytes=1)
    assert [one.choice.method for one in plan.considered] == [PACKETS]


def test_a_candidate_that_does_not_fit_into_memory_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    build = FakeTracer.build

    def refuse(tracer: FakeTracer) -> None:
        if tracer.choice == aligned(128):
            raise MemoryBudgetError("too many copies")
        build(tracer)

    monkeypatch.setattr(FakeTracer, "build", refuse)
    found, _, _, _ = measured(TRUE, TRUE, budget_s=10.0, error=1.0)
    assert found[0].choice == aligned(256)
    assert aligned(128) not in [one.choice for one in found]


@pytest.mark.parametrize(
    ("step_s", "threads", "clock"),
    [(1e-7, 1, "thread_time"), (0.015625, 1, "perf_counter"), (1e9, 1, "perf_counter"), (1e-7, 2, "perf_counter")],
)
def test_processor_time_is_the_clock_of_one_thread_unless_it_moves_in_long_steps(
    step_s: float, threads: int, clock: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    readings = count()  # one every 50 microseconds: a few ticks of 15.6 ms go by meanwhile
    monkeypatch.setattr(time, "thread_time", lambda: next(readings) * 5e-5 // step_s * step_s)
    assert clock_for(threads) is getattr(time, clock)


def test_measuring_tells_frames_apart_where_processor_time_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "thread_time", lambda: 0.0)
    found = atra.plan(cornell_box(), cornell_camera(64, 64), effort="measure", budget_s=0.1, threads=1)
    assert all(one.frame_time_s > 0 for one in found.considered)


def test_no_trial_pays_for_what_is_kept_with_the_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh, kept = cornell_box(), []

    def note_what_is_kept(self: Trial, clock: object) -> None:
        kept.append(mesh in atra.judge.ties._found and "without_area" in vars(mesh))
        start(self, clock)  # type: ignore[arg-type]

    start = Trial.start
    monkeypatch.setattr(Trial, "start", note_what_is_kept)
    atra.plan(mesh, cornell_camera(64, 64), effort="measure", budget_s=0.05)
    assert kept[0]


@pytest.mark.parametrize("effort", ["estimate", "measure"])
def test_overlaps_are_found_only_to_measure_lowest_ties(effort: str) -> None:
    for ties in ("any", "lowest"):
        mesh = cornell_box()
        atra.plan(mesh, cornell_camera(64, 64), effort=effort, budget_s=0.05, ties=ties)
        assert (mesh in atra.judge.ties._found) == (effort == "measure" and ties == "lowest")


@pytest.mark.parametrize("size", [(64, 64), (60, 45)], ids=str)  # the latter with rows longer in memory than the image
def test_the_kernel_of_ties_is_compiled_before_a_trial(size: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    compiled = set()

    def note_types(*arguments: object) -> None:
        compiled.add(tuple(numba.typeof(one) for one in arguments))

    monkeypatch.setattr(atra.judge.ties, "settle_ties", note_types)
    mesh, camera = quads([wall(2, 1.0), wall(2, 1.5)]), square_camera(*size)
    for choice in candidates(camera, 64):
        compiled.clear()
        warm_up(choice, camera, 1, "lowest")
        before = set(compiled)
        with choice.tracer(mesh, camera) as tracer:
            tracer.trace()
        assert compiled == before != set()


@pytest.mark.parametrize("threads", [1, 2])
def test_measuring_for_real_tells_times_of_what_it_tried(threads: int) -> None:
    found = atra.plan(cornell_box(), cornell_camera(64, 64), effort="measure", budget_s=0.2, threads=threads)
    assert found.threads == threads
    assert all(one.measured and one.frame_time_s > 0 for one in found.considered)
    assert PACKETS in {one.choice.method for one in found.considered}


# Plans


def a_plan(**fields: object) -> Plan:
    considered = (
        Forecast(aligned(16), 0.25, 0.01, 0.1, measured=False),
        Forecast(PACKETS_CHOICE, 0.1, 0.02, 0.0, measured=False),
    )
    return replace(Plan(64, "estimate", 1, 64, 64, considered), **fields)  # type: ignore[arg-type]


def test_a_plan_says_what_was_chosen_and_what_it_will_take() -> None:
    plan = a_plan()
    assert (plan.method, plan.split, plan.packet_width, plan.packet_rows) == (ALIGNED, (16, 1), 8, 2)
    assert plan.build_quality == "medium"
    assert plan.predicted_time_s == pytest.approx(0.25 + 63 * 0.01)


@pytest.mark.parametrize("effort", ["estimate", "measure"])
def test_a_plan_survives_its_file(effort: str, tmp_path: Path) -> None:
    plan = atra.plan(cornell_box(), cornell_camera(64, 64), frames=9, effort=effort, budget_s=0.1)
    plan.save(tmp_path / "plan.json")
    assert Plan.load(tmp_path / "plan.json") == plan


UNUSUAL_PACKETS = Choice(ALIGNED, (16, 1), 8, 4)  # cells 4 pixels wide would take packets of 2 rows by themselves


@pytest.mark.parametrize("choice", [*candidates(square_camera(), 64), UNUSUAL_PACKETS], ids=str)
def test_the_tracer_of_every_choice_traces_the_image_of_single_rays(choice: Choice) -> None:
    mesh, camera = cornell_box(), cornell_camera(64, 64)
    plan = a_plan(considered=(Forecast(choice, 0.1, 0.1, 0.0, measured=False),))
    with plan.tracer(mesh, camera) as tracer, atra.PixelTracer(mesh, camera, packet_width=1) as single:
        assert tracer.packet_width == choice.packet_width
        if choice.method != PACKETS:
            assert tracer.packet_shape[1] == choice.packet_rows  # type: ignore[attr-defined]
            assert (tracer.split.nx, tracer.split.ny) == choice.split  # type: ignore[attr-defined]
        assert atra.compare(mesh, camera, tracer.trace(), single.trace()).pixels_wrong == 0


@pytest.mark.parametrize("choice", candidates(square_camera(), 64), ids=str)
def test_every_choice_takes_ties_and_memory_budget(choice: Choice) -> None:
    tracer = choice.tracer(cornell_box(), square_camera(), 1, "any", 12345)
    assert tracer.options.ties == "any"  # type: ignore[attr-defined]
    assert choice.method == PACKETS or tracer.options.memory_budget_bytes == 12345  # type: ignore[attr-defined]
    tracer.close()


@pytest.mark.parametrize("effort", ["estimate", "measure"])
def test_a_mesh_of_too_many_overlaps_is_planned_and_traced_with_any_ties(
    effort: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(atra.judge.ties, "MOST_PAIRS", 2)
    mesh = quads([wall(2, half) for half in (1.0, 1.25, 1.5)])  # of which more pairs overlap
    options = {"effort": effort, "budget_s": 0.05}
    with pytest.raises(MemoryBudgetError, match='ties "any"'):
        atra.plan(mesh, square_camera(), **options).tracer(mesh, square_camera()).plan()  # type: ignore[arg-type]
    plan = atra.plan(mesh, square_camera(), ties="any", **options)  # type: ignore[arg-type]
    with plan.tracer(mesh, square_camera()) as tracer:
        assert tracer.trace().hit.all()


def test_a_plan_keeps_its_ties_and_its_tracer_takes_others(tmp_path: Path) -> None:
    mesh = cornell_box()
    a_plan(ties="any").save(tmp_path / "plan.json")
    plan = Plan.load(tmp_path / "plan.json")
    for wanted, ties in ((None, "any"), ("any", "any"), ("lowest", "lowest")):
        tracer = plan.tracer(mesh, square_camera(), ties=wanted)
        assert tracer.options.ties == ties  # type: ignore[attr-defined]
        tracer.close()
    with pytest.raises(InputError, match="ties is 'first'"):
        plan.tracer(mesh, square_camera(), ties="first")


def test_a_plans_tracer_keeps_to_its_memory_budget() -> None:
    with pytest.raises(MemoryBudgetError, match="memory budget"):
        a_plan().tracer(cornell_box(), square_camera(), memory_budget_bytes=1).plan()


def test_a_plan_for_an_image_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match="64 x 64 pixels, the camera has 128 x 64"):
        a_plan().tracer(cornell_box(), cornell_camera(128, 64))


def edited(path: Path, **fields: object) -> Path:
    a_plan().save(path)
    path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), **fields}), encoding="utf-8")
    return path


def saved_forecasts(**fields: object) -> list[dict[str, object]]:
    choice = {"method": ALIGNED, "split": (16, 1), "packet_width": 8, "packet_rows": 2}
    return [{"choice": choice, "first_s": 1.0, "frame_time_s": 1.0, "error": 0.0, "measured": False, **fields}]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"format": 2}, "not a plan of format 1"),
        ({"native_packet_widths": [1, 4]}, r"packets of \[1, 4\]"),
        ({"considered": []}, "considered is empty"),
        ({"considered": [{"choice": {"split": [1]}}]}, "not a plan"),
        ({"effort": "guess"}, "effort is 'guess'"),
        ({"colour": "red"}, "colour"),
        ({"width": 72, "considered": saved_forecasts()}, r"split \(16, 1\) does not divide image 72 x 64"),
        ({"considered": saved_forecasts(first_s=10**400)}, "first_s of aligned 16 x 1 is 1000"),
        ({"considered": saved_forecasts(frame_time_s=float("nan"))}, "frame_time_s of aligned 16 x 1 is nan"),
        ({"considered": saved_forecasts(error=float("inf"))}, "error of aligned 16 x 1 is inf"),
        ({"frames": 10**400}, "frames is 1000"),
        ({"ties": "first"}, "ties is 'first'"),
    ],
)
def test_a_file_that_is_no_plan_for_this_machine_is_refused(
    fields: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=rf"plan\.json .*{message}"):
        Plan.load(edited(tmp_path / "plan.json", **fields))


def test_a_missing_or_unreadable_plan_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        Plan.load(tmp_path / "none.json")
    (tmp_path / "list.json").write_text("[1]")
    with pytest.raises(InputError, match="not a plan"):
        Plan.load(tmp_path / "list.json")
    (tmp_path / "deep.json").write_text("[" * 100_000)
    with pytest.raises(InputError, match=r"deep\.json is not a plan"):
        Plan.load(tmp_path / "deep.json")
    (tmp_path / "text.json").write_text("{")
    with pytest.raises(InputError, match="not a plan"):
        Plan.load(tmp_path / "text.json")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"frames": 0}, "frames is 0"),
        ({"frames": 1.5}, "frames is 1.5"),
        ({"frames": 10**400}, "frames is 1000"),
        ({"effort": "guess"}, "effort is 'guess'"),
        ({"budget_s": 0.0}, "budget_s is 0.0"),
        ({"budget_s": "short"}, "budget_s is 'short'"),
        ({"budget_s": 10**400}, "budget_s is 1000"),
        ({"budget_s": float("nan")}, "budget_s is nan"),
        ({"threads": 0}, "threads is 0"),
        ({"ties": "first"}, "ties is 'first', expected one of lowest, any"),
    ],
)
def test_nonsense_is_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        atra.plan(cornell_box(), cornell_camera(64, 64), **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"method": "magic"}, "method is 'magic'"),
        ({"split": (2, 1)}, "packets have no cells"),
        ({"packet_rows": 0}, "packet_rows is 0"),
        ({"build_quality": "best"}, "build_quality is 'best'"),
    ],
)
def test_a_choice_that_cannot_be_is_refused(fields: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(PACKETS_CHOICE, **fields)  # type: ignore[arg-type]
