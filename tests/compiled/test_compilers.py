"""Compiling leaves out dead branches, and running what is kept loads nothing that only compiling needs."""

import subprocess
import sys

from atra.compiled.store import kernel, njit
from tests.compiled.test_kernel_cache import TWO_KINDS
from tests.folders import ROOT


def test_branches_that_known_arguments_decide_are_not_compiled():
    @njit
    def chosen(flag, number):
        if flag:
            return number.no_such_attribute
        return number

    @kernel
    def calls(number):
        return chosen(False, number)

    calls._cache.disable()
    assert calls(3) == 3


def test_code_that_is_kept_is_run_without_what_only_compiling_needs(tmp_path):
    (tmp_path / "two_kinds.py").write_text(TWO_KINDS)
    run = "import sys, two_kinds; print(two_kinds.answers(), 'numba.np.arraymath' in sys.modules)"
    told = [
        subprocess.run(
            [sys.executable, "-c", run], cwd=tmp_path, check=True, capture_output=True, text=True,
            env={"PYTHONPATH": f"{tmp_path}:{ROOT}", "NUMBA_CACHE_DIR": str(tmp_path / "kept")},
        ).stdout.split(") ")
        for _ in range(2)
    ]  # fmt: skip
    assert told == [["(21, 42", "True\n"], ["(21, 42", "False\n"]]
