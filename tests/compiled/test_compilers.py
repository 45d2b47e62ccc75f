"""Compiling asks Numba nothing twice, and running what is kept loads nothing that only compiling needs."""

import operator
import subprocess
import sys

import numba
from numba import types
from numba.core.registry import cpu_target

from atra.compiled.compilers import _Typing
from atra.compiled.store import kernel, njit
from tests.compiled.test_kernel_cache import TWO_KINDS
from tests.folders import ROOT


def test_numba_is_asked_once_what_an_operator_gives_and_each_time_what_a_compiled_function_does():
    asked = []

    class Context:
        def resolve_function_type(self, *call):
            asked.append(call)
            return cpu_target.typing_context.resolve_function_type(*call)

    cpu_target.typing_context.refresh()
    typing, adding = _Typing(Context()), cpu_target.typing_context.resolve_value_type(operator.add)
    assert typing.resolve_function_type(adding, (types.float32, types.float32), {}).return_type == types.float32
    assert typing.resolve_function_type(adding, [types.float32, types.float32], {}).return_type == types.float32
    assert len(asked) == 1
    assert typing.resolve_function_type(adding, (types.float32, types.float64), {}).return_type == types.float64
    assert len(asked) == 2
    same = numba.njit(lambda number: number)
    for _ in range(2):
        assert typing.resolve_function_type(types.Dispatcher(same), (types.float32,), {}).return_type == types.float32
    assert len(asked) == 4


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
