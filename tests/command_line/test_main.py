"""The program loads what the verb that is asked for needs, and no more."""

import subprocess
import sys

import pytest

from tests.folders import ROOT


def loaded_by(*words):
    """Exit code, modules that the program has loaded when it ends, and what it printed."""
    code = "import sys, atexit; atexit.register(lambda: print(*sys.modules, file=sys.stderr)); sys.argv[0] = 'atra'\n"
    code += "from atra.command.main import main; sys.exit(main())"
    done = subprocess.run([sys.executable, "-c", code, *words], cwd=ROOT, capture_output=True, text=True)
    return done.returncode, set(done.stderr.splitlines()[-1].split()), done.stdout


@pytest.mark.parametrize("word", ["--version", "--help"])
def test_what_is_answered_without_a_verb_loads_no_array_and_no_compiler(word):
    code, loaded, said = loaded_by(word)
    assert code == 0
    assert "atra" in said
    assert loaded.isdisjoint({"numpy", "numba", "trimesh"})


def test_a_verb_loads_its_own_module_alone():
    code, loaded, said = loaded_by("judge", "--help")
    assert code == 0
    assert "--png-scale" in said
    assert "atra.command.judging" in loaded
    assert loaded.isdisjoint({"trimesh", "atra.command.render", "atra.command.compiling", "atra.command.planning"})
