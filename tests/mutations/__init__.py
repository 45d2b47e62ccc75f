"""Mutations: small faults put into a copy of the code, to see that the tests notice each of them.

    python -m tests.mutations [--list] [--all-tests] [--only NAME]

first runs the tests that the mutations name on an unchanged copy of the project; they must pass. Then it puts one fault
after another into the copy, runs the tests that must notice it, and says which failed. Only fast tests run unless
--all-tests adds the slow ones. The checkout is never changed. The exit code is 0 if every mutation was caught, 1 if one
was not, and 2 if nothing could be judged: an entry does not fit the code, or its tests fail without it.

The entries stand in kernels.toml, library.toml and harness.toml. Who moves code moves them along: `old` is text that
occurs in its file exactly once (--list checks that), `caught_by` the tests. A mutation that no test catches any more is
a test that is missing.
"""
