"""The planner: what it tries, what it chooses, what it spends, and that its plans survive a file."""

import json
import time
from dataclasses import replace
from itertools import count

import numba
import numpy as np
import pytest

import atra
from atra.embree.scene import EmbreeScene
from atra.errors import InputError, MemoryBudgetError
from atra.planner.choice import ALIGNED, PACKETS, RASTER, VISIBLE_FIRST, Choice, candidates
from atra.planner.measuring import HIGH_QUALITY_COST, Trial, clock_for, measure
from atra.planner.plan import Forecast, Plan
from atra.planner.planning import FEWEST_FRAMES, warm_up
from atra.raster.frames import Scratch
from tests.images import assert_no_pixel_wrong, trace_pixels
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads

PACKETS_CHOICE = Choice(PACKETS, (1, 1), 8, 2)


def wall(z, half):
    return [(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)]


def square_camera(width=64, height=64):
    """Half a scene unit to each side per unit of depth."""
    return atra.Camera(**EYE_AT_ORIGIN, fov_y_degrees=float(np.degrees(2 * np.arctan(0.5))), width=width, height=height)


# Candidates


def test_candidates_divide_the_image_and_begin_with_what_has_no_cells():
    for width in (1024, 1280, 1365, 1366, 1009):
        choices = candidates(square_camera(width, 32))
        assert [choice.method for choice in choices[:2]] == [RASTER, PACKETS]
        assert all(width % choice.split[0] == 0 for choice in choices)
    splits = [(choice.method, choice.split[0]) for choice in candidates(square_camera(1280, 720))]
    visible_first, aligned_ones = (80, 160, 320, 640), (160, 320, 640)
    assert splits == [
        (RASTER, 1), (PACKETS, 1), *((VISIBLE_FIRST, nx) for nx in visible_first),
        *((ALIGNED, nx) for nx in aligned_ones),
    ]  # fmt: skip


def test_parallel_rays_have_no_visible_first_candidate():
    camera = atra.OrthographicCamera(**EYE_AT_ORIGIN, width=64, height=64)
    assert {choice.method for choice in candidates(camera)} == {PACKETS, RASTER, ALIGNED}
    assert atra.plan(cornell_box(), camera, budget_s=0.05).method in (PACKETS, RASTER, ALIGNED)


def test_for_few_frames_the_rasteriser_is_chosen_and_nothing_is_built(monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("no candidate may be built")

    monkeypatch.setattr(EmbreeScene, "__init__", refuse)
    monkeypatch.setattr(Scratch, "of", refuse)
    plan = atra.plan(cornell_box(), cornell_camera(64, 64), FEWEST_FRAMES - 1)
    assert (plan.method, plan.considered, plan.predicted_time_s) == (RASTER, (), None)
    with pytest.raises(AssertionError, match="no candidate"):
        atra.plan(cornell_box(), cornell_camera(64, 64), FEWEST_FRAMES)


def test_every_core_is_planned_for_unless_told_otherwise():
    mesh, camera = cornell_box(), cornell_camera(64, 64)
    assert atra.plan(mesh, camera, 1).threads == atra.PixelTracer(mesh, camera).threads
    assert atra.plan(mesh, camera, 1, threads=1).threads == 1


# Measuring


class FakeClock:
    def __init__(self):
        self.now_s = 0.0

    def __call__(self):
        return self.now_s


class FakeTracer:
    """Plan and build take first_s, every frame frame_time_s."""

    def __init__(self, clock, log, choice, first_s, frame_time_s):
        self.clock, self.log, self.choice = clock, log, choice
        self.first_s, self.frame_time_s = first_s, frame_time_s
        self.closed = False

    def build(self):
        self.log.append(self.choice)
        self.clock.now_s += self.first_s

    def trace(self, out=None):
        self.clock.now_s += self.frame_time_s

    def close(self):
        self.closed = True


def aligned(nx):
    return Choice(ALIGNED, (nx, 1), 8, 2)


def measured(true, budget_s, frames=64):
    """Measure tracers that take `true` (plan and build, frame); returns also who was tried, the seconds spent, and the
    tracers."""
    clock, log, tracers = FakeClock(), [], []

    def make(choice):
        clock.now_s += 100.0  # compiling is not on the budget
        tracers.append(FakeTracer(clock, log, choice, *true[choice]))
        return tracers[-1]

    choices = [choice for choice in true if choice.build_quality == "medium"]
    found = measure(choices, make, frames=frames, budget_s=budget_s, clock=clock)
    return found, log, clock.now_s - 100.0 * len(log), tracers


VISIBLE = Choice(VISIBLE_FIRST, (64, 1), 8, 2)
TRUE = {PACKETS_CHOICE: (0.1, 0.1), aligned(64): (0.2, 0.08), aligned(128): (0.2, 0.05), aligned(256): (0.3, 0.052)}


def test_the_fastest_of_all_is_found_when_the_budget_allows():
    found, tried, _, tracers = measured(TRUE, budget_s=10.0)
    assert found[0].choice == aligned(128)
    assert (found[0].first_s, found[0].frame_time_s) == pytest.approx((0.25, 0.05))
    assert tried == list(TRUE)
    assert all(tracer.closed for tracer in tracers)


@pytest.mark.parametrize("budget_s", [0.01, 0.5, 0.9, 1.0, 1.3, 2.0, 4.0])
def test_the_budget_is_kept_except_for_packets_which_come_first(budget_s):
    _, tried, spent_s, _ = measured(TRUE, budget_s)
    assert tried[0] == PACKETS_CHOICE
    assert spent_s <= max(budget_s, 0.3) + 1e-9


def test_cells_that_may_take_too_long_are_not_tried_and_the_next_method_is():
    true = {PACKETS_CHOICE: (0.1, 0.1), VISIBLE: (0.5, 0.1), replace(VISIBLE, split=(128, 1)): (0.5, 0.1)}
    _, tried, _, _ = measured({**true, aligned(64): (0.2, 0.08)}, budget_s=1.7)
    assert tried == [PACKETS_CHOICE, VISIBLE, aligned(64)]


def test_what_costs_more_to_try_than_it_may_save_is_not_tried():
    raster = Choice(RASTER, (1, 1), 1, 1)
    # A trial of the rasteriser takes 0.02 s and all its frames 0.64; of packets 1.2, and cells are likely to take more.
    true = {raster: (0.0, 0.01), PACKETS_CHOICE: (1.0, 0.1), VISIBLE: (0.1, 0.001)}
    found, tried, spent_s, _ = measured(true, budget_s=10.0)
    assert tried == [raster, PACKETS_CHOICE]
    assert found[0].choice == raster
    assert spent_s < 1.3
    assert VISIBLE in measured(true, budget_s=10.0, frames=999)[1]


def test_narrower_cells_are_left_out_once_they_are_surely_slower():
    slower = {**TRUE, aligned(128): (0.2, 0.09)}
    assert measured(slower, budget_s=10.0)[1] == [PACKETS_CHOICE, aligned(64), aligned(128)]
    about_equal = {**TRUE, aligned(128): (0.2, 0.085)}
    assert aligned(256) in measured(about_equal, budget_s=10.0)[1]


def test_a_slow_build_of_the_best_is_tried_for_many_frames_where_the_budget_allows():
    high = replace(aligned(128), build_quality="high")
    true = {**TRUE, high: (2.0, 0.04)}
    enough_s = 2.0 + HIGH_QUALITY_COST * 0.25
    assert measured(true, enough_s, frames=1000)[0][0].choice == high
    for budget_s, frames in ((enough_s, 999), (2.0, 1000)):
        assert high not in measured(true, budget_s, frames)[1]


def test_packets_are_kept_where_the_gain_is_within_the_noise():
    true = {PACKETS_CHOICE: (0.1, 0.1), aligned(128): (0.1, 0.099)}
    found, tried, _, _ = measured(true, budget_s=10.0)
    assert len(tried) == 2
    assert found[0].choice == PACKETS_CHOICE


@pytest.mark.usefixtures("wall_clock_alone")
def test_only_what_needs_no_copies_is_considered_for_a_memory_budget_that_holds_none():
    plan = atra.plan(cornell_box(), cornell_camera(64, 64), 100_000, budget_s=1.0, memory_budget_bytes=1)
    assert {one.choice.method for one in plan.considered} == {PACKETS, RASTER}


def test_where_cells_do_not_fit_into_memory_narrower_ones_are_not_tried(monkeypatch):
    build = FakeTracer.build

    def refuse(tracer):
        if tracer.choice == aligned(128):
            raise MemoryBudgetError("too many copies")
        build(tracer)

    monkeypatch.setattr(FakeTracer, "build", refuse)
    found, _, _, _ = measured(TRUE, budget_s=10.0)
    assert [one.choice for one in found] == [aligned(64), PACKETS_CHOICE]


@pytest.mark.parametrize(
    ("step_s", "threads", "clock"),
    [(1e-7, 1, "thread_time"), (0.015625, 1, "perf_counter"), (1e9, 1, "perf_counter"), (1e-7, 2, "perf_counter")],
)
def test_processor_time_is_the_clock_of_one_thread_unless_it_moves_in_long_steps(step_s, threads, clock, monkeypatch):
    readings = count()  # one every 50 microseconds: a few ticks of 15.6 ms go by meanwhile
    monkeypatch.setattr(time, "thread_time", lambda: next(readings) * 5e-5 // step_s * step_s)
    assert clock_for(threads) is getattr(time, clock)


@pytest.fixture
def wall_clock_alone(monkeypatch):
    """Processor time stands still; each reading of the wall clock is 10 microseconds after the one before."""
    readings = count(1)
    monkeypatch.setattr(time, "thread_time", lambda: 0.0)
    monkeypatch.setattr(time, "perf_counter", lambda: next(readings) * 1e-5)


@pytest.mark.usefixtures("wall_clock_alone")
@pytest.mark.parametrize("threads", [1, 2])
def test_frames_are_told_apart_by_the_wall_clock_where_processor_time_stands_still(threads):
    found = atra.plan(cornell_box(), cornell_camera(64, 64), 100_000, budget_s=0.1, threads=threads)
    assert found.threads == threads
    assert all(one.frame_time_s > 0 for one in found.considered)
    assert {PACKETS, RASTER} <= {one.choice.method for one in found.considered}


def test_no_trial_pays_for_what_is_kept_with_the_mesh(monkeypatch):
    mesh, kept = cornell_box(), []

    def note_what_is_kept(self, clock):
        kept.append(mesh in atra.exact.ties._found and "without_area" in vars(mesh))
        start(self, clock)

    start = Trial.start
    monkeypatch.setattr(Trial, "start", note_what_is_kept)
    atra.plan(mesh, cornell_camera(64, 64), budget_s=0.05)
    assert kept[0]


def test_overlaps_are_found_only_for_lowest_ties():
    for ties in ("any", "lowest"):
        mesh = cornell_box()
        atra.plan(mesh, cornell_camera(64, 64), budget_s=0.05, ties=ties)
        assert (mesh in atra.exact.ties._found) == (ties == "lowest")


@pytest.mark.parametrize("size", [(64, 64), (60, 45)], ids=str)  # the latter with rows longer in memory than the image
def test_the_kernel_of_ties_is_compiled_before_a_trial(size, monkeypatch):
    compiled = set()

    def note_types(*arguments):
        compiled.add(tuple(numba.typeof(one) for one in arguments))

    monkeypatch.setattr(atra.exact.ties, "settle_ties", note_types)
    mesh, camera = quads([wall(2, 1.0), wall(2, 1.5)]), square_camera(*size)
    for choice in candidates(camera):
        compiled.clear()
        warm_up(choice, camera, 1, "lowest")
        before = set(compiled)
        with choice.tracer(mesh, camera) as tracer:
            tracer.trace()
        assert compiled == before != set()


# Plans


def a_plan(choice=None, **fields):
    choice = choice or aligned(16)
    considered = (Forecast(choice, 0.25, 0.01), Forecast(PACKETS_CHOICE, 0.1, 0.02))
    return replace(Plan(64, 1, 64, 64, choice, considered), **fields)


def test_a_plan_says_what_was_chosen_and_what_it_will_take():
    plan = a_plan()
    assert (plan.method, plan.split, plan.packet_width, plan.packet_rows) == (ALIGNED, (16, 1), 8, 2)
    assert plan.build_quality == "medium"
    assert plan.predicted_time_s == pytest.approx(0.25 + 63 * 0.01)


@pytest.mark.parametrize("frames", [9, 99])
def test_a_plan_survives_its_file(frames, tmp_path):
    plan = atra.plan(cornell_box(), cornell_camera(64, 64), frames, budget_s=0.1)
    plan.save(tmp_path / "plan.json")
    assert Plan.load(tmp_path / "plan.json") == plan


UNUSUAL_PACKETS = Choice(ALIGNED, (16, 1), 8, 4)  # cells 4 pixels wide would take packets of 2 rows by themselves


@pytest.mark.parametrize("choice", [*candidates(square_camera()), UNUSUAL_PACKETS], ids=str)
def test_the_tracer_of_every_choice_traces_the_image_of_single_rays(choice):
    mesh, camera = cornell_box(), cornell_camera(64, 64)
    with a_plan(choice).tracer(mesh, camera, ties="any", memory_budget_bytes=2**30) as tracer:
        assert (tracer.packet_width, tracer.options.ties) == (choice.packet_width, "any")
        if choice.method not in (PACKETS, RASTER):
            assert tracer.options.memory_budget_bytes == 2**30
            assert tracer.packet_shape[1] == choice.packet_rows
            assert (tracer.split.nx, tracer.split.ny) == choice.split
        assert_no_pixel_wrong(mesh, camera, tracer.trace(), trace_pixels(mesh, camera))


def test_a_mesh_of_too_many_overlaps_is_planned_and_traced_with_any_ties(monkeypatch):
    monkeypatch.setattr(atra.exact.ties, "MOST_PAIRS", 2)
    mesh = quads([wall(2, half) for half in (1.0, 1.25, 1.5)])  # of which more pairs overlap
    with pytest.raises(MemoryBudgetError, match='ties "any"'):
        atra.plan(mesh, square_camera())
    plan = atra.plan(mesh, square_camera(), budget_s=0.05, ties="any")
    with plan.tracer(mesh, square_camera()) as tracer:
        assert tracer.trace().hit.all()


def test_a_plan_keeps_its_ties_and_its_tracer_takes_others(tmp_path):
    mesh = cornell_box()
    a_plan(ties="any").save(tmp_path / "plan.json")
    plan = Plan.load(tmp_path / "plan.json")
    for wanted, ties in ((None, "any"), ("any", "any"), ("lowest", "lowest")):
        tracer = plan.tracer(mesh, square_camera(), ties=wanted)
        assert tracer.options.ties == ties
        tracer.close()
    with pytest.raises(InputError, match="ties is 'first'"):
        plan.tracer(mesh, square_camera(), ties="first")


def test_a_plan_for_an_image_of_another_size_is_refused():
    with pytest.raises(InputError, match="64 x 64 pixels, the camera has 128 x 64"):
        a_plan().tracer(cornell_box(), cornell_camera(128, 64))


def edited(path, **fields):
    a_plan().save(path)
    path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), **fields}), encoding="utf-8")
    return path


def saved_forecasts(**fields):
    choice = {"method": ALIGNED, "split": (16, 1), "packet_width": 8, "packet_rows": 2}
    return [{"choice": choice, "first_s": 1.0, "frame_time_s": 1.0, **fields}]


@pytest.mark.parametrize(("fields", "message"), [
    ({"format": 1}, "not a plan of format 2"),
    ({"native_packet_widths": [1, 4]}, r"packets of \[1, 4\]"),
    ({"choice": None}, "not a plan"),
    ({"considered": [{"choice": {"split": [1]}}]}, "not a plan"),
    ({"effort": "measure"}, "effort"),
    ({"colour": "red"}, "colour"),
    ({"width": 72}, r"split \(16, 1\) does not divide image 72 x 64"),
    ({"considered": saved_forecasts(first_s=10**400)}, "first_s of aligned 16 x 1 is 1000"),
    ({"considered": saved_forecasts(frame_time_s=float("nan"))}, "frame_time_s of aligned 16 x 1 is nan"),
    ({"choice": {**saved_forecasts()[0]["choice"], "split": (8, 1)}}, "choice is aligned 8 x 1, expected"),
    ({"frames": 10**400}, "frames is 1000"),
    ({"ties": "first"}, "ties is 'first'"),
])  # fmt: skip
def test_a_file_that_is_no_plan_for_this_machine_is_refused(fields, message, tmp_path):
    with pytest.raises(InputError, match=rf"plan\.json .*{message}"):
        Plan.load(edited(tmp_path / "plan.json", **fields))


def test_a_missing_or_unreadable_plan_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        Plan.load(tmp_path / "none.json")
    for text in ("[1]", "[" * 100_000, "{"):
        (tmp_path / "text.json").write_text(text)
        with pytest.raises(InputError, match=r"text\.json is not a plan"):
            Plan.load(tmp_path / "text.json")


@pytest.mark.parametrize(("arguments", "message"), [
    ({"frames": 0}, "frames is 0"), ({"frames": 1.5}, "frames is 1.5"), ({"frames": 10**400}, "frames is 1000"),
    ({"budget_s": 0.0}, "budget_s is 0.0"), ({"budget_s": "short"}, "budget_s is 'short'"),
    ({"budget_s": 10**400}, "budget_s is 1000"), ({"budget_s": float("nan")}, "budget_s is nan"),
    ({"threads": 0}, "threads is 0"), ({"ties": "first"}, "ties is 'first', expected one of lowest, any"),
])  # fmt: skip
def test_nonsense_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        atra.plan(cornell_box(), cornell_camera(64, 64), **arguments)


@pytest.mark.parametrize(("fields", "message"), [
    ({"method": "magic"}, "method is 'magic'"), ({"split": (2, 1)}, "packets have no cells"),
    ({"packet_rows": 0}, "packet_rows is 0"), ({"build_quality": "best"}, "build_quality is 'best'"),
])  # fmt: skip
def test_a_choice_that_cannot_be_is_refused(fields, message):
    with pytest.raises(InputError, match=message):
        replace(PACKETS_CHOICE, **fields)
