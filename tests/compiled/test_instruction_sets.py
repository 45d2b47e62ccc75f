"""The core under every instruction set of this machine, each in a process of its own; and the switch that chooses."""

import os
import subprocess
import sys

import pytest

import atra
from atra.command.main import main
from atra.compiled import instruction_sets
from atra.compiled.instruction_sets import INSTRUCTION_SETS, PACKET_WIDTHS, VARIABLE, instruction_sets_here
from atra.embree.library import load_library
from experiments.harness.identity import current_environment
from tests.conftest import said_of_instruction_sets
from tests.folders import ROOT
from tests.meshes import cornell_box, cornell_camera

TESTS = ROOT / "tests"
CORE = sorted(
    path.relative_to(TESTS).as_posix()
    for path in TESTS.rglob("test_*.py")
    if "pytest.mark.core" in path.read_text(encoding="utf-8")
)
PARTS_OF_CORE = {
    "avx": [
        "embree/test_embree.py", "packets/test_axis_near_views.py", "raster/test_raster.py", "rays/test_ray_scene.py",
        "tracing/test_properties.py",
    ]
}  # fmt: skip
"""Files that do under a set. Embree has code of its own for AVX, and all that goes through it runs here; ours has the
lanes of AVX2 and the arithmetic of SSE4.2, under which the other files run. No kernels are shipped for AVX."""


def run(code_or_arguments, instruction_set, **variables):
    """A new interpreter with the instruction set; (exit code, what it printed). What it covers, others cover, too."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "COV"))}
    environment |= {VARIABLE: instruction_set, "PYTHONPATH": str(TESTS.parent), **variables}
    command = [sys.executable, *code_or_arguments]
    done = subprocess.run(
        command, env=environment, cwd=TESTS.parent, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    return done.returncode, done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", instruction_sets_here()[:-1])
def test_the_core_holds_under(name):
    """And under the last, as all other tests run under that. Vectors wider or narrower than are native under a set, and
    some pairs of choices, are tested under the last alone (tests/machine.py: HELD)."""
    assert len(CORE) >= 7
    assert set(PARTS_OF_CORE.get(name, CORE)) <= set(CORE)
    files = [str(TESTS / file) for file in PARTS_OF_CORE.get(name, CORE)]
    code, said = run(["-m", "pytest", "-m", "core and not slow", "-x", *files], name, ATRA_HYPOTHESIS="short")
    assert code == 0, said[-6000:]


@pytest.mark.slow
@pytest.mark.parametrize("name", instruction_sets_here())
def test_embree_and_numba_are_held_to(name):
    code, said = run(
        [
            "-c",
            "from atra.embree.library import load_library\n"
            "import numba\n"
            "import numpy as np\n"
            "print(load_library().native_packet_widths)\n"
            "@numba.njit\n"
            "def halve(x):\n"
            "    for i in range(len(x)):\n"
            "        x[i] = 0.5 * x[i] if x[i] > 1.0 else x[i] - 1.0\n"
            "halve(np.zeros(9))\n"
            "(assembly,) = halve.inspect_asm().values()\n"
            "print('%k1' in assembly, '%ymm' in assembly, '%xmm' in assembly)",
        ],
        name,
    )
    assert code == 0, said
    widths, registers = said.splitlines()
    assert widths == str((1, *PACKET_WIDTHS[name]))
    assert registers == f"{name == 'avx512'} {name != 'sse4.2'} True"


@pytest.mark.parametrize("name", ["avx1024", "AVX2"])
def test_a_set_that_this_machine_lacks_is_refused_with_those_it_has(name, monkeypatch):
    monkeypatch.setenv(VARIABLE, name)
    with pytest.raises(atra.InputError, match=rf"ATRA_ISA is '{name}', expected one of what this machine has: .*unset"):
        load_library.__wrapped__()
    with pytest.raises(atra.InputError, match=rf"ATRA_ISA is '{name}', expected one of"):
        atra.RasterTracer(cornell_box(), cornell_camera(8, 8))  # has no part in Embree
    monkeypatch.setattr(sys, "argv", ["atra", "compile", "--all"])
    assert main() == 2
    monkeypatch.setattr(instruction_sets, "cpu_features", lambda: frozenset({"neon"}))  # another architecture
    with pytest.raises(atra.InputError, match="has: none, as its processor is no x86-64"):
        instruction_sets.chosen_instruction_set()


def test_a_set_chosen_after_numba_was_at_work_is_refused(monkeypatch):
    monkeypatch.setattr(instruction_sets, "instruction_sets_here", lambda: ("sse4.2", "avx", "avx2", "avx512"))
    chosen = os.environ.get(VARIABLE)
    monkeypatch.setenv(VARIABLE, "avx" if chosen != "avx" else "avx2")
    with pytest.raises(atra.InputError, match="but Numba compiles for"):
        instruction_sets.check_instruction_set()


def test_the_chosen_set_is_recorded(monkeypatch):
    load_library()  # is loaded once, under the set of this process
    for name in instruction_sets_here():
        monkeypatch.setenv(VARIABLE, name)
        assert current_environment()["instruction_set"] == name


def test_the_last_line_names_what_could_not_be_tested():
    assert said_of_instruction_sets(INSTRUCTION_SETS).endswith("none is missing here")
    assert said_of_instruction_sets(INSTRUCTION_SETS[:-1]).endswith(
        "could not test avx512, and with them packets of 16"
    )
    assert "only; this machine could not test sse4.2, avx" in said_of_instruction_sets(())
