"""Mutations: small faults put into copies of the code, to see that the tests notice each of them.

    python -m tests.mutations [--all-tests] [--only NAME] [--list] [--jobs N] [--timeout S] [--table PATH]
                              [--folder PATH]

first runs the tests that the mutations name on an unchanged copy of the project; they must pass. Then it puts one fault
after another into a copy of that, runs the tests that must notice it, and says which failed. Only fast tests run unless
--all-tests adds the slow ones. The checkout is never changed. --table writes a Markdown table of what caught which
mutation; --folder keeps the unchanged copy with its compiled kernels for the next time. The exit code is 0 if every
mutation was caught, 1 if one was not, and 2 if nothing could be judged: an entry does not fit the code, or its tests
fail without it.

The entries stand in kernels.toml, library.toml and harness.toml. Who moves code moves them along: `old` is text that
occurs in its file exactly once (--list checks that), `caught_by` the tests. A mutation that no test catches any more is
a test that is missing.
"""

import tomllib
from pathlib import Path

from tests.mutations.mutation import Mutation


def _read(name):
    path = Path(__file__).with_name(f"{name}.toml")
    for one in tomllib.loads(path.read_text(encoding="utf-8"))["mutations"]:
        yield Mutation(**one | {"caught_by": tuple(one["caught_by"])})


MUTATIONS = tuple(mutation for name in ("kernels", "library", "harness") for mutation in _read(name))
