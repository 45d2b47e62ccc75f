"""`atra doctor`: what this machine has and what it lacks, on one screen, for bug reports."""

from __future__ import annotations

import os
import platform
import textwrap
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import atra
from atra.compiled.instruction_sets import VARIABLE, instruction_sets_here, processor_compiled_for
from atra.compiled.store import SHIPPED, cache_folder
from atra.compiled.threads import resolve_threads
from atra.embree.library import OVERRIDE_VARIABLE, Library, embree_version, load_library
from atra.errors import AtraError, printable

_COLUMNS, _NAME_COLUMNS = 80, 14


@dataclass(frozen=True)
class Diagnosis:
    """facts: (name, text), in the order shown. warnings: what may spoil results. obstacles: why none can be traced."""

    facts: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]
    obstacles: tuple[str, ...]


def run_doctor(given: Namespace) -> int:
    """Print the diagnosis; returns 1 if nothing can be traced, which the last line explains, else 0."""
    diagnosis = diagnose()
    print(render(diagnosis, "trace images"))
    return 1 if diagnosis.obstacles else 0


def diagnose() -> Diagnosis:
    """Examine all that the library relies on. Nothing is traced or written, and nothing missing is an error."""
    library, obstacles = load_embree()
    facts = [
        ("atra", atra.__version__),
        ("Python", f"{platform.python_version()}, NumPy {version('numpy')}, Numba {version('numba')}"),
        ("system", f"{platform.system()} {platform.release()}, {platform.machine()}"),
        ("instructions", say_instructions()),
        ("cores", f"{resolve_threads(None)} for this process"),
        *embree_facts(library),
        ("kernels", say_kernels()),
    ]
    return Diagnosis(tuple(facts), tuple(kernel_warnings()), tuple(obstacles))


def render(diagnosis: Diagnosis, job: str) -> str:
    """The diagnosis in lines of 80 columns; a last line of any length: ready to do the job, or why not."""
    lines = [
        textwrap.fill(
            printable(text),
            _COLUMNS,
            initial_indent=name.ljust(_NAME_COLUMNS),
            subsequent_indent=" " * _NAME_COLUMNS,
            break_on_hyphens=False,
        )
        for name, text in [*diagnosis.facts, ("warnings", "; ".join(diagnosis.warnings) or "none")]
    ]
    why_not = printable("; and ".join(diagnosis.obstacles))
    last = f"cannot {job}: {why_not}" if why_not else f"ready to {job}"
    return "\n".join([*lines, last])


def load_embree() -> tuple[Library | None, list[str]]:
    """Embree, or None and the reason why it cannot be used."""
    try:
        return load_library(), []
    except AtraError as error:
        return None, [str(error)]


def embree_facts(library: Library | None) -> Iterator[tuple[str, str]]:
    """Embree's version, packets and file."""
    if library is None:
        yield "Embree", "cannot be used, see the last line"
    else:
        widths = ", ".join(map(str, library.native_packet_widths))
        by = f"; named by {OVERRIDE_VARIABLE}" if os.environ.get(OVERRIDE_VARIABLE) else ""
        yield "Embree", f"{embree_version()}, native packets of {widths}{by}"
        yield "libembree4", str(library.path)


def say_instructions(extensions: Sequence[str] = ()) -> str:
    """The machine's instruction sets and which are used; extensions: features of processors other than x86-64."""
    here = ", ".join(instruction_sets_here() or extensions) or "none that is known"
    held = os.environ.get(VARIABLE)
    used = f"held to {held} ({VARIABLE})" if held else f"all are used ({VARIABLE} is not set)"
    return f"{here}; {used}"


def say_kernels() -> str:
    """Where compiled kernels are, how large they are, and the processors they serve."""
    kept = kept_in()
    places = ({"shipped in": SHIPPED} if SHIPPED.is_dir() else {}) | ({} if kept is None else {"kept in": kept})
    said = [f"{_size_mb(place):.1f} MB {how} {place}" for how, place in places.items()]
    return f"{' and '.join(said) or 'not kept'}, compiled for {processor_compiled_for()}"


def kept_in() -> Path | None:
    """The folder that holds the kernels of all rooms; None where nothing can be written."""
    folder = cache_folder()
    if folder is None:
        return None
    is_beside_the_source = Path(folder).name == "__pycache__"
    return Path(folder).parents[1] if is_beside_the_source else Path(folder).parent


def _size_mb(folder: Path) -> float:
    own = (file for file in folder.rglob("*.nb[ic]") if folder == SHIPPED or SHIPPED not in file.parents)
    return sum(file.stat().st_size for file in own) / 1e6


def kernel_warnings() -> Iterator[str]:
    """The warning that kernels are kept nowhere."""
    if cache_folder() is None:
        yield "every process compiles its kernels, as Numba may write nowhere; NUMBA_CACHE_DIR can name a folder"
