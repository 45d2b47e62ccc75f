"""Names, folders and command lines nobody vouches for: nothing they hold is run, or reaches a terminal as it is."""

import io
import subprocess

from rich.console import Console

from atra.errors import InputError, printable
from experiments.harness.processes.launching import WORKER_COMMAND, project_environment
from experiments.harness.progress import SweepProgress, say
from experiments.report.page import render_report
from experiments.results.table import Tables
from experiments.results.terminal import print_point, print_sweep
from tests.report_samples import contents_that_say

CONTROLS = "\x1b]0;title\x07\x1b[2J\x9b31m\u202edesrever\u2028\x00"


def controls_in(text):
    return {sign for sign in text if not sign.isprintable() and sign not in "\n"}


def test_printable_keeps_every_letter_and_escapes_what_has_no_picture():
    assert printable("Größe “2 μ” 模型") == "Größe “2 μ” 模型"
    assert printable("a\x1b[31m\n\u202e\x9b") == r"a\x1b[31m\n\u202e\x9b"


def test_a_long_message_keeps_its_ends():
    text = str(InputError("start" + "x" * 100_000 + "end"))
    assert text.startswith("start")
    assert text.endswith("end")
    assert len(text) <= 2000


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
