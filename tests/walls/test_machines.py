"""No test names a packet width or a number of lanes as if all machines were alike; tests/machine.py asks the library.

Embree has packets of 8 and of 16 on some machines only. Read from the sources are the values of `packet_width` and
`lanes`, and of the variables that such values come from.
"""

from __future__ import annotations

import ast
import re

import pytest

from tests.conftest import start_alike
from tests.folders import ROOT

NAMED = {"packet_width", "lanes"}
ONLY_SOMEWHERE = {4, 8, 16}
IN_TEXT = re.compile(r"\b(?:packet_width|lanes)=[\d,]*\b(?:4|8|16)\b")
"""As overrides of the command line say it."""

MADE_BY_HAND = (
    "drawn.py", "sweeps.py", "law/test_law.py", "paper/", "paper_table.py", "report/",
    "report_samples.py", "results/", "studies/", "walls/test_machines.py",
    "workloads/test_agreement.py", "workloads/test_workloads.py",
)  # fmt: skip
"""Where widths stand in records and tables: measured once or made by hand, but not traced with."""


def pairs(node):
    """(name, value) of keyword arguments, entries of dicts, defaults, assignments and loops, anywhere below."""
    for one in ast.walk(node):
        match one:
            case ast.keyword(arg=str(name), value=value):
                yield name, value
            case ast.Dict(keys=keys, values=values):
                yield from ((key.value, value) for key, value in zip(keys, values, strict=True)
                            if isinstance(key, ast.Constant) and isinstance(key.value, str))  # fmt: skip
            case ast.arguments(args=given, defaults=defaults) if defaults:
                yield from zip((one.arg for one in given[-len(defaults) :]), defaults, strict=True)
            case ast.Assign(targets=[target], value=value) | (
                ast.For(target=target, iter=value) | ast.comprehension(target=target, iter=value)
            ):
                yield from ((name.id, value) for name in ast.walk(target) if isinstance(name, ast.Name))
            case ast.Call(func=ast.Attribute(attr="parametrize"), args=[names, values, *_]):
                names = re.findall(r"\w+", ast.unparse(names))
                rows = getattr(values, "elts", [])
                if len(names) > 1 and rows and all(isinstance(row, ast.Tuple) for row in rows):
                    columns = zip(*(row.elts for row in rows), strict=True)
                    yield from ((name, one) for name, column in zip(names, columns, strict=True) for one in column)
                else:
                    yield from ((name, values) for name in names)


def named_widths(source):
    """Lines on which a packet width or a number of lanes is a literal, and what stands there."""
    found, whole = set(), ast.parse(source)
    for part in whole.body:
        own = list(pairs(part))
        known = NAMED | {value.id for name, value in own if name in NAMED and isinstance(value, ast.Name)}
        for name, value in own:
            if name in known or re.search(r"(^|packet_)widths$|(^|_)lanes$", name, re.IGNORECASE):
                numbers = {one.value for one in ast.walk(value) if isinstance(one, ast.Constant)}
                if any(type(one) is int and one in ONLY_SOMEWHERE for one in numbers):
                    found.add((value.lineno, f"{name}: {ast.unparse(value)}"))
    for one in ast.walk(whole):
        if isinstance(one, ast.Constant) and isinstance(one.value, str):
            found |= {(one.lineno, text) for text in IN_TEXT.findall(one.value)}
    return sorted(found)


def test_no_test_names_a_packet_width_or_lanes_that_the_library_was_not_asked_for():
    files = {path.relative_to(ROOT / "tests").as_posix(): path for path in (ROOT / "tests").rglob("*.py")}
    found = {name: named_widths(path.read_text(encoding="utf-8")) for name, path in files.items()}
    for name in files:
        if not name.startswith(MADE_BY_HAND):
            assert not found[name], f"tests/{name}: ask tests/machine.py, {found[name]}"
    for allowed in MADE_BY_HAND:
        assert any(found[name] for name in files if name.startswith(allowed)), f"{allowed} names none: take it out"


@pytest.mark.parametrize("source", [
    "TRACERS = {f'{width}': (Tracer, {'packet_width': width}) for width in (1, 4, 8, 16)}",
    "def test():\n    trace(mesh, packet_width=8)",
    "OPTIONS = [{'lanes': 4}]",
    "LANES = (4, 8) if HELD else ALL_LANES",
    "WIDTHS = (1, 4)",
    "@pytest.mark.parametrize(('packet_width', 'order'), [(1, 'rows'), (8, 'rows')])\ndef test(packet_width): pass",
    "@pytest.mark.parametrize('w', [1, 16])\ndef test(w):\n    trace(mesh, packet_width=w)",
    "def trace(packet_width=8): pass",
    "def test():\n    for w in (1, 8):\n        trace(mesh, packet_width=w)",
    "run('method.packet_width=1,8')",
])  # fmt: skip
def test_a_named_width_is_found(source):
    assert named_widths(source)


@pytest.mark.parametrize("source", [
    "trace(mesh, packet_width=WIDEST, lanes=None)",
    "trace(mesh, packet_width=1)",
    "@pytest.mark.parametrize(('size', 'lanes'), [(8, None), (4, 1)])\ndef test(size, lanes): pass",
    "for width in WIDTHS: trace(mesh, packet_width=width)",
    "def test():\n    for width, height in ((4, 8), (8, 16)): Camera(width=width)",
    "match('packet_width is 8')",
])  # fmt: skip
def test_what_is_asked_of_the_library_or_no_width_is_not(source):
    assert not named_widths(source)


def test_all_tests_start_with_the_same_variables_whatever_the_shell_says():
    kept = {"PATH": "/bin", "HOME": "/home/a", "ATRA_ISA": "avx2", "NUMBA_CACHE_DIR": "kernels"}
    alike, strange = dict(kept), {
        **kept, "COLUMNS": "40", "LC_ALL": "de_DE", "TZ": "Pacific/Kiritimati", "FORCE_COLOR": "1", "CI": "1",
        "ATRA_QUIET": "0", "ATRA_METHOD_FILES": "mine.py", "NUMBA_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1",
        "no_proxy": "", "SLURM_JOB_ID": "7",
    }  # fmt: skip
    start_alike(alike)
    start_alike(strange)
    assert strange == alike
    assert kept.items() <= alike.items()
