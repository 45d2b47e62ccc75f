"""What all tests rely on, and the line at the end that says what this machine could not test."""

import gc
import os
import signal
import sys
import time
from contextlib import suppress

import pytest

# A shell ignores the interrupt key for what it starts in the background, and children inherit that; the tests that
# interrupt a sweep would wait for ever.
signal.signal(signal.SIGINT, signal.default_int_handler)

KEPT_VARIABLES = {
    "ATRA_EMBREE", "ATRA_FUZZ", "ATRA_HYPOTHESIS", "ATRA_ISA", "ATRA_KILLS", "ATRA_SCENES", "ATRA_THREAD_SECONDS",
    "ATRA_THREE", "NUMBA_CACHE_DIR",
}  # fmt: skip
"""Variables that a person sets for a test run: what to test with, and where kernels are kept."""

CLEARED_VARIABLES = {
    "CI", "CLICOLOR", "CLICOLOR_FORCE", "COLUMNS", "FORCE_COLOR", "LANG", "LANGUAGE", "LINES", "MPLBACKEND", "NO_COLOR",
    "PYTHONDONTWRITEBYTECODE", "PYTHONIOENCODING", "PYTHONUTF8", "PYTHON_COLORS", "TERM", "TTY_COMPATIBLE",
    "TTY_INTERACTIVE",
}  # fmt: skip
CLEARED_GROUPS = ("ATRA_", "HYDRA_", "LC_", "MKL_", "NUMBA_", "OMP_", "OPENBLAS_", "SLURM_")
"""Beginnings of names. Containers, shells and clusters set these, each in its own way."""


def start_alike(variables):
    """Change environment variables to those that all tests start with. Tests of what one does set it themselves."""
    for name in set(variables) - KEPT_VARIABLES:
        if name in CLEARED_VARIABLES or name.startswith(CLEARED_GROUPS):
            del variables[name]
    variables["TZ"] = "UTC"
    variables["NO_PROXY"] = variables["no_proxy"] = "localhost,127.0.0.1"  # tests talk to servers of their own
    variables["ATRA_QUIET"] = "1"  # tests compile all the time, and read what programs write on standard error
    variables["ATRA_IDLE_LIMIT_S"] = "0"  # their sweeps measure nothing that anybody believes


start_alike(os.environ)
if hasattr(time, "tzset"):  # Windows has none
    time.tzset()
os.umask(0o022)
sys.dont_write_bytecode = False  # hundreds of processes read the same modules

# Numba compiles for minutes in all, a sixth of them spent on looking for garbage among what is needed anyway.
gc.freeze()
gc.set_threshold(100_000, 50, 50)


@pytest.fixture
def old_objects_set_aside():
    """The collector looks at what the test has made, and not at all else that this process holds, which takes long."""
    gc.freeze()
    yield
    gc.unfreeze()


def pytest_collection_finish():
    """Embree is loaded under the instruction set that was asked for, before a test asks for another. What collecting
    has made stays to the end; the collector need not look at it again and again."""
    from atra.embree.library import load_library
    from atra.errors import EmbreeError

    with suppress(EmbreeError):
        load_library()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish():
    """pytest looks for garbage five times before it ends; what is left by then need not be looked at."""
    gc.freeze()


@pytest.fixture
def methods_as_before(monkeypatch):
    """Methods of files are known until the test ends."""
    from experiments import methods

    before = methods.METHODS[:]
    monkeypatch.setenv(methods.METHOD_FILES, "")
    yield
    methods.METHODS[:] = before


@pytest.fixture
def figures_unsaved(monkeypatch):
    """Figures are drawn, and none is made a picture; what they look like is tested in tests/report."""
    from matplotlib.figure import Figure

    svg = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
    monkeypatch.setattr(Figure, "savefig", lambda figure, file, **options: file.write(svg))


UNCOVERED = {"documents", "harness", "methods", "paper", "report", "results", "scenes", "walls"}
"""Folders all of whose tests are `uncovered`: what they test stands on the library."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Tests in these folders or marked `uncovered` run without coverage's tracer, and so do the processes they start.
    pytest-cov's `no_cover` would not do: in a process of xdist it hands over to a second tracer, that of the patch of
    processes."""
    if UNCOVERED.isdisjoint(item.nodeid.split("/")) and item.get_closest_marker("uncovered") is None:
        return (yield)
    tracer, variables = sys.gettrace(), {name: os.environ[name] for name in os.environ if name.startswith("COVERAGE_")}
    sys.settrace(None)
    for name in variables:
        del os.environ[name]
    try:
        return (yield)
    finally:
        os.environ.update(variables)
        sys.settrace(tracer)


def pytest_collection_modifyitems(items):
    """Files that compile the most come first, in two groups that need different kernels. One group begins the list, the
    other one its second half: of two workers, each is given half of the list and compiles its own group."""
    groups = (
        ["raster", "test_gathering", "all_hits", "model", "test_seeing_through", "test_sweep_files"],
        ["shafts", "bvh", "test_properties", "packets", "rays", "test_hybrid", "test_light", "test_instruction_sets"],
    )
    marks = {mark: (half, k) for half, group in enumerate(groups) for k, mark in enumerate(group)}

    def place_of(item):
        """Group and place in it; group 2 holds all others."""
        return next((marks[mark] for mark in (item.path.stem, item.path.parent.name) if mark in marks), (2, 0))

    place = {item: place_of(item) for item in items}
    first, second = (sorted((one for one in items if place[one][0] == half), key=place.get) for half in (0, 1))
    others = [one for one in items if place[one][0] == 2]
    middle = max(0, len(items) // 2 - len(first))
    items[:] = [*first, *others[:middle], *second, *others[middle:]]


def pytest_terminal_summary(terminalreporter):
    reports = [report for kind in ("passed", "failed") for report in terminalreporter.stats.get(kind, [])]
    if any("test_instruction_sets.py" in report.nodeid for report in reports):
        from atra.compiled.instruction_sets import instruction_sets_here

        terminalreporter.write_line(said_of_instruction_sets(instruction_sets_here()))


def said_of_instruction_sets(here):
    """One line: the core's tests ran under the instruction sets `here`, and could not under the others."""
    from atra.compiled.instruction_sets import INSTRUCTION_SETS, PACKET_WIDTHS

    left_sets = [name for name in INSTRUCTION_SETS if name not in here]
    here_widths, all_widths = (
        {width for name in names for width in PACKET_WIDTHS[name]} for names in (here, INSTRUCTION_SETS)
    )
    left_widths = [str(width) for width in sorted(all_widths - here_widths)]
    tested = ", ".join(here) or "that of this machine only"
    if not left_sets:
        return f"instruction sets tested: {tested}; none is missing here"
    missing = ", ".join(left_sets) + (f", and with them packets of {', '.join(left_widths)}" if left_widths else "")
    return f"instruction sets tested: {tested}; this machine could not test {missing}"
