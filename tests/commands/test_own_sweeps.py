"""Sweeps of one's own: folders that keep earlier tables, lines of 80 columns, and names that nobody vouches for."""

import io
import subprocess
import sys

import pytest
from rich.console import Console

from atra.errors import InputError, printable
from experiments import cli
from experiments.drawing.style import TIMES
from experiments.harness.points import GridPoint
from experiments.harness.processes.launching import WORKER_COMMAND, project_environment
from experiments.harness.progress import SweepProgress, say
from experiments.report.page import render_report
from experiments.results.table import Tables, read_tables
from experiments.results.terminal import print_point, print_sweep
from experiments.sweep import run_sweep
from tests.drawn import make_rows, method_row
from tests.report_samples import contents_that_say
from tests.sweeps import Runner, configuration

pytestmark = [pytest.mark.uncovered, pytest.mark.usefixtures("figures_unsaved")]


def test_a_sweep_that_goes_on_or_grows_keeps_its_folder_and_another_of_its_name_has_its_own_and_says_so(
    tmp_path, capsys
):
    def sweep(*splits):
        """What a sweep says, and the splits in each folder after it."""
        command = f"run.py -m method.split_x={','.join(map(str, splits))}"
        run_sweep(
            [GridPoint("points", configuration(tmp_path, "point", split)) for split in splits],
            command=command,
            run=Runner(),
        )
        folders = sorted(path for path in tmp_path.iterdir() if path.name.startswith("point"))
        return capsys.readouterr().err, [sorted(read_tables(folder).points["split_x"]) for folder in folders]

    for splits in ((1, 2), (1, 2), (1, 2, 4)):
        told, found = sweep(*splits)
        assert ("which stays" in told, found) == (False, [list(splits)])
    told, found = sweep(8)
    assert found == [[1, 2, 4], [8]]
    assert f"{tmp_path / 'point'} holds the table of `run.py -m method.split_x=1,2,4`, which stays" in told
    assert f"this sweep goes to {tmp_path / 'point_2'}, unless sweep.name=... says otherwise" in told
    assert sweep(8)[1] == [[1, 2, 4], [8]]
    assert sweep(16)[1] == [[1, 2, 4], [8], [16]]


def test_a_grid_may_ask_for_a_setting_that_is_left_to_the_machine(monkeypatch):
    asked = []
    monkeypatch.setattr("experiments.sweep.run_sweep", lambda points, **_: asked.extend(points))
    monkeypatch.setattr(sys, "argv", ["run.py", "sweep=baselines", "scene=cornell_box", "method.packet_rows=1"])
    cli.main()
    widths = {(one.grid, one.configuration.method.options.packet_width) for one in asked if "shape" in one.grid}
    assert widths == {("baselines_shape", None), ("baselines_shape_of_8", 8)}


def test_tables_fit_80_columns_and_nothing_in_them_is_cut(tmp_path):
    shown = io.StringIO()
    console = Console(file=shown, width=80)
    rows = [
        method_row(name, 1024, 1.2345, scene="fireplace_room", speedup=10000 / 81, pixels_wrong=1048576, view=view)
        for name in ("aligned", "visible_first", "pixel")
        for view in ("own", "along_axis")
    ]
    table = make_rows(*rows)
    print_sweep(Tables(table, table.iloc[:0]), tmp_path, console)
    *lines, _, _ = shown.getvalue().splitlines()  # the last ones name files, and no terminal breaks them well
    assert max(map(len, lines)) <= 80
    assert "\N{HORIZONTAL ELLIPSIS}" not in shown.getvalue()
    for text in ("fireplace_room", "1,234.5 ms", f"1024 {TIMES} 1", "123.46", "1,048,576", "visible-first", "pixels"):
        assert any(text in line for line in lines), text
    shown.truncate(shown.seek(0))
    print_point(table.assign(warnings="x" * 100).iloc[0], console)
    assert max(map(len, shown.getvalue().splitlines())) <= 80
    assert "\N{HORIZONTAL ELLIPSIS}" not in shown.getvalue()


def test_points_that_may_have_waited_for_the_compiler_hardly_change_the_time_to_go():
    shown, now = io.StringIO(), [0.0]
    console = Console(file=shown, width=200)
    with SweepProgress(8, console, clock=lambda: now[0]) as progress:
        for taken in (60.0, 2.0, 2.0, 2.0, 30.0, 2.0):
            progress.begin("a point")
            now[0] += taken
            progress.end("a point", "done")
    lines = shown.getvalue().splitlines()
    assert [line.partition("(")[2] for line in lines] == [
        "7 left)", "6 left)", "5 left, about 10 s)", "4 left, about 8 s)", "3 left, about 6 s)", "2 left, about 4 s)",
    ]  # fmt: skip


CONTROLS = "\x1b]0;title\x07\x1b[2J\x9b31m\u202edesrever\u2028\x00"


def controls_in(text):
    return {sign for sign in text if not sign.isprintable() and sign not in "\n"}


def test_a_message_keeps_every_letter_escapes_what_has_no_picture_and_if_long_keeps_its_ends():
    assert printable("Größe “2 μ” 模型") == "Größe “2 μ” 模型"
    assert printable("a\x1b[31m\n\u202e\x9b") == r"a\x1b[31m\n\u202e\x9b"
    text = str(InputError("start" + "x" * 100_000 + "end"))
    assert (text[:5], text[-3:], len(text) <= 2000) == ("start", "end", True)


def test_no_control_character_of_a_name_or_an_error_reaches_the_page():
    page = render_report(contents_that_say(CONTROLS))
    assert controls_in(page) == set()
    assert r"\x1b[2J" in page


def test_no_control_character_reaches_the_terminal(tmp_path):
    written = io.StringIO()
    console = Console(file=written, width=200)
    table = contents_that_say(CONTROLS).table
    print_sweep(Tables(table, table), tmp_path, console)
    for _, row in table[table["status"] == "ok"].iterrows():
        print_point(row, console)
    with SweepProgress(1, console) as progress:
        progress.begin(CONTROLS)
        progress.end(CONTROLS, CONTROLS)
    say(console, CONTROLS)
    assert controls_in(written.getvalue()) == set()
    assert written.getvalue().count(r"\x1b[2J") > 5


def test_a_worker_imports_nothing_from_the_folder_it_is_started_in(tmp_path):
    for name in ("numpy", "json", "experiments", "atra"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'imported')!r}, 'a').write({name!r})")
    subprocess.run(
        list(WORKER_COMMAND), cwd=tmp_path, env=project_environment(), input=b"", capture_output=True, timeout=120
    )
    assert not (tmp_path / "imported").exists()
