"""What the library can do on this machine. Tests ask here for packet widths and lanes; tests/walls/test_machines.py
refuses those that name some."""

from atra.compiled.instruction_sets import LANE_COUNTS as ALL_LANES
from atra.compiled.instruction_sets import chosen_instruction_set, instruction_sets_here, native_lanes
from atra.embree.library import load_library

WIDTHS = load_library().native_packet_widths
"""Embree's native packet widths, narrowest first: 1 for single rays, 4 everywhere, 8 and 16 on some machines."""

NARROW, WIDEST = WIDTHS[1], WIDTHS[-1]
"""Rays in the narrowest and in the widest native packets."""

HELD = chosen_instruction_set() not in (None, *instruction_sets_here()[-1:])
"""Whether ATRA_ISA names another instruction set than this machine's last. If so, the core is tested with the vectors
that are native, and with each choice that is compiled, but not with each pair of them: the last is tested with all."""

NATIVE_LANES = native_lanes()
"""Float32 numbers in this machine's widest vectors."""

FEW_LANES, *_, MANY_LANES = ALL_LANES
"""The fewest and the most lanes that our own kernels can be compiled for on every machine, whatever is native."""

LANES = (NATIVE_LANES,) if HELD else ALL_LANES
"""Lanes that the core is tested with."""
