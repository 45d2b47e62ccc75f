"""Coverage is that of our own lines, before and after Numba has compiled something in between, and of no test marked
`uncovered`."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

PROGRAM = """\
import sys
from numba import njit
from numba.core.compiler import CompilerBase
seen, compile_ir = [], CompilerBase.compile_extra
def spied(*given):
    seen.append(sys.gettrace())
    return compile_ir(*given)
CompilerBase.compile_extra = spied
@njit
def double(x):
    return 2 * x
def called(x):
    if x > 2:
        x = -x
    return double(x)
import colorsys  # as a file of ours that is run after Numba was imported
print([called(x) for x in (1, 2, 3)], seen == [None], sys.gettrace() is not None)
"""


def test_lines_after_numba_has_compiled_are_counted_as_those_before(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM, encoding="utf-8")
    (tmp_path / ".coveragerc").write_text("[run]\nbranch = true\nplugins = tests.untraced\n", encoding="utf-8")
    variables = {name: value for name, value in os.environ.items() if not name.startswith("COV")}

    def coverage(*arguments):
        command = [sys.executable, "-m", "coverage", *arguments]
        variables["PYTHONPATH"] = str(ROOT)
        return subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True, check=True).stdout

    assert coverage("run", "--include=program.py", "program.py") == "[2, 4, -6] True True\n"
    coverage("json", "-q", "-o", "found.json")
    found = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))["files"]["program.py"]
    missing = [PROGRAM.splitlines()[number - 1].strip() for number in found["missing_lines"]]
    assert missing == ["seen.append(sys.gettrace())", "return compile_ir(*given)", "return 2 * x"]
    assert found["missing_branches"] == []


@pytest.mark.uncovered
def test_what_is_marked_uncovered_runs_without_a_tracer_and_so_do_its_processes():
    assert sys.gettrace() is None
    code = "import sys; print(sys.gettrace(), 'coverage' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "None False\n"
