"""The passes of a sweep: a figure after the first process of every point, what is said meanwhile, and few repeats."""

from dataclasses import replace

import pandas as pd
import pytest

from experiments.harness.processes.idle import LIMIT_VARIABLE, Occupancy, Waiting
from experiments.harness.progress import say_roughly
from experiments.sweep import run_sweep
from tests.sweeps import Runner, grid

pytestmark = pytest.mark.usefixtures("figures_unsaved")

DRAWN = {"name": "horizontal", "figures": {"figure5": ["horizontal"]}}


class Unsteady(Runner):
    """Single rays of one process take twice as long, however often it is measured."""

    def __call__(self, point):
        outcome = super().__call__(point)
        slow = point.process == 1 and point.options.split_x == 2
        return replace(outcome, samples=outcome.samples | {"rtcIntersect1": [0.2] * 3}) if slow else outcome


def test_table_and_figure_are_there_before_any_point_has_its_second_process(tmp_path, capsys):
    seen = []

    class Watching(Runner):
        def __call__(self, point):
            seen.append({"figure5.png", "table.csv"} <= {path.name for path in (tmp_path / "one").glob("*")})
            return super().__call__(point)

    runner = Watching()
    table = run_sweep(grid(tmp_path, 1, 2, processes=3, **DRAWN), run=runner)
    assert [process for _, process in runner.measured] == [0, 0, 1, 1, 2, 2]
    assert {split for split, _ in runner.measured[:2]} == {1, 2}
    assert seen == [False] * 2 + [True] * 4
    assert list(table["processes"]) == [3, 3]
    assert len(pd.read_parquet(tmp_path / "one" / "processes.parquet")) == 6
    said = capsys.readouterr().err
    assert "figure so far, one process a point: Figure 5: render time" in said
    assert f"{tmp_path / 'one' / 'figure5.png'}\n" in said
    assert said.count("figure so far") == 2
    assert "figure so far, 2 processes a point" in said


def test_an_interrupt_after_the_first_pass_leaves_table_and_figure_of_every_process_measured(tmp_path):
    class Interrupted(Runner):
        def __call__(self, point):
            if point.process == 1 and len(self.points) == 3:
                raise KeyboardInterrupt
            return super().__call__(point)

    with pytest.raises(SystemExit) as stopped:
        run_sweep(grid(tmp_path, 1, 2, processes=3, **DRAWN), run=Interrupted())
    assert stopped.value.code == 130
    assert (tmp_path / "one" / "figure5.png").exists()
    assert len(list((tmp_path / "records").glob("*.json"))) == 3


def test_before_the_first_process_one_line_says_how_long_it_takes(tmp_path, capsys):
    run_sweep(grid(tmp_path, 1, 2, 4, 8, 16, 32, processes=6, repeats=1), run=Runner())
    first = capsys.readouterr().err.splitlines()[1]
    assert first == (
        "first look in about 20 s, all in about 2 min at 3 s a process; up to 1 repeat if disturbed; Ctrl-C keeps all"
    )
    said = {seconds: say_roughly(seconds) for seconds in (1, 36, 99, 108, 5000, 9000)}
    assert said == {1: "10 s", 36: "40 s", 99: "100 s", 108: "2 min", 5000: "83 min", 9000: "2.5 h"}


def test_the_first_look_names_who_disturbs_and_does_not_wait(tmp_path, monkeypatch, capsys):
    looks = []

    def look():
        looks.append(None)
        return Occupancy(0.9, 0.0, (("make", 0.9),)) if len(looks) < 3 else Occupancy(0.0, 0.0)

    def waiting(limit_s, tell):
        return Waiting(limit_s, tell, look, sleep=lambda seconds: None)

    monkeypatch.delenv(LIMIT_VARIABLE)
    monkeypatch.setattr("experiments.sweep.Waiting", waiting)
    run_sweep(grid(tmp_path, 1, 2, processes=3), run=Runner())
    said = capsys.readouterr().err
    assert said.index(
        "the machine is not idle: other processes use 90% of all cores (make 90%); measuring goes on"
    ) < said.index("[1/6]")
    assert said.index("[2/6]") < said.index("waiting for an idle machine") < said.index("[3/6]")


@pytest.mark.parametrize("repeats", [0, 1, 3])
def test_what_drifts_is_measured_again_as_often_as_is_allowed_and_what_remains_is_told(tmp_path, capsys, repeats):
    runner, again = Unsteady(), Unsteady()
    table = run_sweep(grid(tmp_path, 1, 2, processes=3, repeats=repeats), run=runner)
    assert runner.measured[6:] == [(2, 1)] * repeats
    assert list(table["processes_left_out"]) == [0, 1]
    assert table["processes_replaced"].fillna(0).tolist() == [0, min(repeats, 1)]
    said = capsys.readouterr().err
    for number in range(1, repeats + 1):
        assert f"1 process is measured again, repeat {number} of at most {repeats}: disturbed" in said
    assert "1 process remains disturbed, of these points: cornell_box, frame, aligned, 2 \u00d7 1" in said
    run_sweep(grid(tmp_path, 1, 2, processes=3, repeats=repeats), run=again)
    assert again.measured == []


class Disturbed(Runner):
    """One process scatters the first time it runs."""

    def __call__(self, point):
        outcome = super().__call__(point)
        unsteady = point not in self.points[:-1] and point.process == 1 and point.options.split_x == 2
        return replace(outcome, samples=outcome.samples | {"own": [0.05, 0.1, 0.2]}) if unsteady else outcome


def test_a_disturbed_process_is_replaced_until_one_is_steady_and_in_a_quick_look_keeps_its_warning(tmp_path):
    runner, quick = Disturbed(), Disturbed()
    table = run_sweep(grid(tmp_path, 1, 2, processes=5), run=runner)
    assert runner.measured[10:] == [(2, 1)]
    assert list(table["processes_replaced"]) == [0, 1]
    assert list(table["warnings"]) == ["3 of 5 rounds"] * 2  # of no disturbance
    table = run_sweep(grid(tmp_path / "quick", 1, 2, processes=4), run=quick)
    assert len(quick.points) == 8
    assert "spread is" in table["warnings"][1]


def test_more_processes_keep_those_that_were_measured_and_what_is_not_timed_has_one(tmp_path):
    run_sweep(grid(tmp_path, 1, processes=3), run=Runner())
    runner, counting = Runner(), Runner()
    assert run_sweep(grid(tmp_path, 1, processes=5), run=runner)["processes"][0] == 5
    assert runner.measured == [(1, 3), (1, 4)]
    run_sweep(grid(tmp_path, 1, processes=3, workload="memory"), run=counting)
    assert counting.measured == [(1, 0)]


@pytest.mark.parametrize(("others", "looks"), [(0.02, 1), (0.05, 1), (0.06, 3), (None, 3)])
def test_a_sweep_looks_for_an_idle_machine_at_first_and_after_a_process_that_was_not_idle(
    tmp_path, monkeypatch, others, looks
):
    """The same share of the cores is too much as makes a warning, however many cores there are."""

    class Shared(Runner):
        def __call__(self, point):
            outcome = super().__call__(point)
            return replace(outcome, results=outcome.results | {"others_share": others})

    seen = []
    monkeypatch.setattr("experiments.sweep.Waiting.for_idle", lambda self: seen.append(self))
    monkeypatch.setattr("experiments.results.time_warnings.cores_of", lambda record: 8)
    run_sweep(grid(tmp_path, 1, processes=3), run=Shared())
    assert len(seen) == looks
