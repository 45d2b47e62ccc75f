"""The passes of a sweep: a figure after the first process of every point, what is said meanwhile, and few repeats."""

from dataclasses import replace

import pytest

from experiments.harness.configuration import SweepConfiguration
from experiments.harness.points import GridPoint
from experiments.harness.processes.idle import LIMIT_VARIABLE, Occupancy, Waiting
from experiments.harness.progress import say_roughly
from experiments.sweep import run_sweep
from tests.harness.test_sweep import Runner, configuration

pytestmark = pytest.mark.usefixtures("figures_unsaved")


def grid(folder, splits=(1, 2), processes=3, **fields):
    """Points of one grid, which figure 5 draws."""
    found = []
    for split in splits:
        one = configuration(folder, split_x=split)
        one.sweep = SweepConfiguration(name="one", figures={"figure5": ["horizontal"]}, **fields)
        one.measure.processes = processes
        found.append(GridPoint("horizontal", one))
    return found


class Watching(Runner):
    """Notes, as each process begins, which files the sweep has written."""

    def __init__(self, folder):
        super().__init__()
        self.folder, self.seen = folder, []

    def __call__(self, point):
        self.seen.append({path.name for path in self.folder.glob("*")})
        return super().__call__(point)


class Unsteady(Runner):
    """Single rays of one process take twice as long, however often it is measured."""

    def __call__(self, point):
        outcome = super().__call__(point)
        slow = point.process == 1 and point.options.split_x == 2
        return replace(outcome, samples=outcome.samples | {"rtcIntersect1": [0.2] * 3}) if slow else outcome


def test_table_and_figure_are_there_before_any_point_has_its_second_process(tmp_path, capsys):
    runner = Watching(tmp_path / "one")
    run_sweep(grid(tmp_path), run=runner)
    assert [point.process for point in runner.points] == [0, 0, 1, 1, 2, 2]
    assert [{"figure5.png", "table.csv"} <= seen for seen in runner.seen] == [False] * 2 + [True] * 4
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
        run_sweep(grid(tmp_path), run=Interrupted())
    assert stopped.value.code == 130
    assert (tmp_path / "one" / "figure5.png").exists()
    assert len(list((tmp_path / "records").glob("*.json"))) == 3


def test_before_the_first_process_one_line_says_how_long_it_takes(tmp_path, capsys):
    run_sweep(grid(tmp_path, (1, 2, 4, 8, 16, 32), processes=6, repeats=1), run=Runner())
    first = capsys.readouterr().err.splitlines()[1]
    assert first == (
        "first look in about 20 s, all in about 2 min at 3 s a process; up to 1 repeat if disturbed; Ctrl-C keeps all"
    )


@pytest.mark.parametrize(
    ("seconds", "said"), [(1, "10 s"), (36, "40 s"), (99, "100 s"), (108, "2 min"), (5000, "83 min"), (9000, "2.5 h")]
)
def test_a_rough_duration_has_one_or_two_figures(seconds, said):
    assert say_roughly(seconds) == said


def test_the_first_look_names_who_disturbs_and_does_not_wait(tmp_path, monkeypatch, capsys):
    looks = []

    def look():
        looks.append(None)
        return Occupancy(0.9, 0.0, (("make", 0.9),)) if len(looks) < 3 else Occupancy(0.0, 0.0)

    def waiting(limit_s, tell, needed):
        return Waiting(limit_s, tell, needed, look, sleep=lambda seconds: None)

    monkeypatch.delenv(LIMIT_VARIABLE)
    monkeypatch.setattr("experiments.sweep.Waiting", waiting)
    run_sweep(grid(tmp_path), run=Runner())
    said = capsys.readouterr().err
    assert said.index(
        "the machine is not idle: other processes use 90% of all cores (make 90%); measuring goes on"
    ) < said.index("[1/6]")
    assert said.index("[2/6]") < said.index("waiting for an idle machine") < said.index("[3/6]")


def test_repeats_are_announced_with_their_bound_and_what_remains_is_told(tmp_path, capsys):
    runner = Unsteady()
    run_sweep(grid(tmp_path, repeats=1), run=runner)
    assert [(point.options.split_x, point.process) for point in runner.points[6:]] == [(2, 1)]
    said = capsys.readouterr().err
    assert "1 process is measured again, repeat 1 of at most 1: disturbed" in said
    assert "; Ctrl-C keeps all" in said.partition("repeat 1 of at most 1")[2]
    assert "1 process remains disturbed, of these points: cornell_box, frame, aligned, 2 \u00d7 1" in said


def test_a_sweep_without_repeats_measures_nothing_again(tmp_path):
    runner = Unsteady()
    run_sweep(grid(tmp_path, repeats=0), run=runner)
    assert len(runner.points) == 6


def test_a_launcher_gets_every_process_in_one_pass(tmp_path):
    batches = []

    def launch(jobs):
        batches.append(list(jobs))
        for place in range(len(jobs)):
            yield place, "no queue"

    with pytest.raises(SystemExit):
        run_sweep(grid(tmp_path), launch=launch, at_once=6)
    assert [len(batch) for batch in batches] == [6]
