"""Instruction sets: which ones this machine has, and the one that `ATRA_ISA` limits Embree and Numba to."""

from __future__ import annotations

import os
from functools import cache

import llvmlite.binding
import numba

from atra.errors import InputError

VARIABLE = "ATRA_ISA"

_PROCESSORS = {
    "sse4.2": ("x86-64-v2", ("sse4.2", "popcnt")),
    "avx": ("sandybridge", ("avx",)),
    "avx2": ("x86-64-v3", ("avx2", "fma", "bmi", "bmi2", "lzcnt", "f16c")),
    "avx512": ("x86-64-v4", ("avx512f", "avx512cd", "avx512dq", "avx512bw", "avx512vl")),
}
"""Instruction sets by Embree's name, narrowest first: LLVM's name for such a processor, and the features it needs."""

INSTRUCTION_SETS = tuple(_PROCESSORS)

LANE_COUNTS = (4, 8, 16)
"""Numbers of float32 in a vector, and of rays in a packet, that there are kernels for."""

PACKET_WIDTHS = {"sse4.2": (4,), "avx": (4, 8), "avx2": (4, 8), "avx512": (4, 8, 16)}
"""Widths of Embree's native packets by instruction set."""


@cache
def cpu_features() -> frozenset[str]:
    """LLVM's names of this processor's features, such as "avx2" or "neon"; empty where LLVM does not know them."""
    try:
        return frozenset(name for name, present in llvmlite.binding.get_host_cpu_features().items() if present)
    except RuntimeError:
        return frozenset()


@cache
def cpu_design() -> str | None:
    """LLVM's name of this processor's design, such as "znver5"; None where LLVM does not know it."""
    name = llvmlite.binding.get_host_cpu_name()
    return None if name in ("", "generic") else str(name)


def instruction_sets_here() -> tuple[str, ...]:
    """The instruction sets of this machine, narrowest first; empty where they have other names, as on Arm."""
    return tuple(name for name, (_, needed) in _PROCESSORS.items() if cpu_features().issuperset(needed))


def chosen_instruction_set() -> str | None:
    """The instruction set that `ATRA_ISA` names, None = no limit. Raises InputError for one that this machine lacks."""
    name = os.environ.get(VARIABLE)
    if not name:
        return None
    if name not in instruction_sets_here():
        here = ", ".join(instruction_sets_here()) or "none, as its processor is no x86-64"
        raise InputError(f"{VARIABLE} is {name!r}, expected one of what this machine has: {here}; or unset it")
    return name


def native_lanes() -> int:
    """Float32 numbers in the widest vectors that kernels use: 16, 8 or 4."""
    here = instruction_sets_here()
    chosen = os.environ.get(VARIABLE)
    name = chosen if chosen in here else here[-1] if here else None
    return 4 if name is None else PACKET_WIDTHS[name][-1]


def limit_numba() -> None:
    """Let Numba compile for the chosen set, or for the widest set here; call it before the first kernel is compiled.

    A set, not this very processor: the code is as fast, and serves every processor that has the set. NUMBA_CPU_NAME is
    left as it is. It runs while modules are imported, so it leaves a bad choice to `check_instruction_set`.
    """
    here, name = instruction_sets_here(), os.environ.get(VARIABLE)
    if name not in here:
        name = None if numba.config.CPU_NAME or not here else here[-1]
    if name is not None:
        numba.config.CPU_NAME, numba.config.CPU_FEATURES = _PROCESSORS[name][0], ""


def processor_compiled_for() -> str:
    """LLVM's name of the processors that kernels are compiled for: "x86-64-v4" and the like, or this one's own."""
    limit_numba()
    return str(numba.config.CPU_NAME or llvmlite.binding.get_host_cpu_name())


def check_instruction_set() -> str | None:
    """The chosen instruction set (None = no limit), for which Numba is sure to compile.

    Raises InputError for a set that this machine lacks, and if Numba was used before `atra` was imported.
    """
    name = chosen_instruction_set()
    if name is not None:
        from numba.core.registry import cpu_target

        _, processor, features = cpu_target.target_context.codegen().magic_tuple()
        if (processor, features) != (_PROCESSORS[name][0], ""):
            raise InputError(
                f"{VARIABLE} is {name!r}, but Numba compiles for {processor!r}; import atra before anything else that "
                "compiles with Numba, and set the variable before that"
            )
    return name
