"""Methods and workloads are values: a new one is a line in a registry, and no other file knows it by name."""

from __future__ import annotations

import ast
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from importlib import import_module
from importlib.machinery import ModuleSpec
from pkgutil import walk_packages
from types import ModuleType

import pandas as pd
import pytest

import experiments
from atra.packets.pixel import Pixel, PreparedPixel
from atra.tracing.tracer import Tracer
from experiments.configure import configure
from experiments.drawing.figure import Axis, Figure, FigureKind, Line, Panel, of_table
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import Method, Style
from experiments.harness.options import option
from experiments.harness.point import Kind, Workload
from experiments.harness.points import GridPoint
from experiments.harness.processes.worker import measure_point, read_result
from experiments.harness.records import Record
from experiments.methods import METHODS
from experiments.registry import KINDS
from experiments.report.writing import rewrite_report
from experiments.results.statistics import statistics_columns
from experiments.results.table import read_tables, workload_rows
from experiments.results.terminal import print_point, results_console
from experiments.sweep import run_sweep
from experiments.workloads import WORKLOADS
from experiments.workloads.baselines import series
from experiments.workloads.rounds import build_own, measured, timed_rounds
from tests.command import read_again
from tests.folders import ROOT


@dataclass(frozen=True)
class ToyOptions:
    patience: int = option(1, "how long it waits")


@dataclass(frozen=True)
class Toy(Pixel):
    patience: int = 1

    def prepare(self, mesh, camera, pool):
        return PreparedToy(self, mesh, camera, pool)


class PreparedToy(PreparedPixel):
    @property
    def counters(self):
        return {**super().counters, "waited": 10 * self.method.patience}


def make_toy(mesh, view, options, tracing):
    method = Toy(packet_width=1, robust=False, patience=options.patience)
    return Tracer(mesh, view, method, threads=tracing.threads, ties=tracing.ties)


TOY = Method(
    "toy", "the toy", Style("#123456", "x"), ToyOptions, make_toy, __name__, is_ours=False,
    counters=(Column("waited", WHOLE, "how often"),),
)  # fmt: skip


@dataclass(frozen=True)
class GameOptions:
    players: int = option(2, "who play")


GAME = Workload(
    name="game",
    options=GameOptions,
    columns=(
        *statistics_columns("game_time{}_s", "one game", series("game")),
        Column("moves", WHOLE, "of all who play"),
    ),
    headline=lambda record: f"{record.results['moves']} moves",
    package="a_room",
    samples=lambda point: frozenset(("game",)),
    judged="game",
    needs=("moves",),
)


def measure_game(point):
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        timed = timed_rounds(point, {"game": own.trace})
    return measured(results | {"moves": 7 * point.workload_options.players}, timed)


def game_figure(rows):
    line = Line("games", rows["moves"].to_numpy(float), rows["game_time_s"].to_numpy(float), {"color": "#123456"})
    return Figure("lines", [Panel(lines=[line])], x=Axis("moves"), y=Axis("time of a game in s"))


ROOM = {
    "measure": {"measure": measure_game},
    "shown": {
        "FIGURES": (
            FigureKind("games", "Games played", lambda rows: workload_rows(rows, "game"), of_table(game_figure)),
        ),
        "sweep_lines": lambda rows: [f"{rows['moves'].sum()} moves in all"],
    },
}


@pytest.fixture
def toys(monkeypatch, tmp_path):
    """One more line in each registry, and the workload's room; all is undone."""
    for info in walk_packages(experiments.__path__, "experiments."):
        import_module(info.name)  # what is imported later would keep the toys
    for name, old, new in (("METHODS", METHODS, (*METHODS, TOY)), ("WORKLOADS", WORKLOADS, (*WORKLOADS, GAME))):
        for module in list(sys.modules.values()):
            if getattr(module, "__dict__", {}).get(name) is old:
                monkeypatch.setattr(module, name, new)
    room = ModuleType("a_room")
    room.__path__ = []
    (tmp_path / "source").mkdir()
    for name in ("__init__", *ROOM):  # a record's identity asks for the source of what measures
        (tmp_path / "source" / f"{name}.py").write_text("")
    room.__spec__ = ModuleSpec("a_room", None, origin=str(tmp_path / "source" / "__init__.py"))
    monkeypatch.setitem(sys.modules, "a_room", room)
    for name, contents in ROOM.items():
        part = ModuleType(f"a_room.{name}")
        part.__spec__ = ModuleSpec(part.__name__, None)
        vars(part).update(contents)
        monkeypatch.setitem(sys.modules, part.__name__, part)
    for group, one in (("method", TOY), ("workload", GAME)):
        names, find = KINDS[group]
        own = Kind(lambda names=names, one=one: [*names(), one.name], find)
        monkeypatch.setitem(KINDS, group, own)


def configuration(folder, *overrides):
    image = ["width=16", "height=16", "measure.rounds=3", "measure.warmup=1", "sweep.name=toys", "sweep.report=true"]
    return configure([*image, f"results_dir={folder}", *overrides])


def run_here(point):
    """As the worker does, in this process."""
    got = measure_point(read_again(point))
    record = Record("", "ok", **vars(got))
    return read_result(record.to_json(), point)


@pytest.mark.slow
def test_a_new_method_and_a_new_workload_go_from_the_command_line_to_the_page(toys, tmp_path, capsys):
    points = [
        ["method=toy", "workload=game"],
        ["method=toy", "method.patience=4", "workload=game", "workload.players=3"],
        ["method=pixel", "workload=game"],
        ["method=toy", "workload=frame"],
        ["method=pixel", "workload=frame"],
    ]
    given = [GridPoint("toys", configuration(tmp_path, *overrides)) for overrides in points]
    table = run_sweep(given, run=run_here)
    told = capsys.readouterr()

    assert list(table["status"]) == ["ok"] * 5
    games, toy = table[table["workload"] == "game"], table[table["method"] == "toy"]
    columns = ["patience", "players", "waited", "moves", "game_time_high_s"]
    assert list(map(str, table[columns].dtypes)) == ["Int64"] * 4 + ["Float64"]
    assert sorted(zip(games["players"], games["moves"], strict=True)) == [(2, 14), (2, 14), (3, 21)]
    assert (games["game_time_s"] > 0).all()
    assert sorted(zip(toy["patience"], toy["waited"], strict=True)) == [(1, 10), (1, 10), (4, 40)]
    assert table[table["method"] == "pixel"][["patience", "waited"]].isna().all(axis=None)
    assert table[table["workload"] == "frame"][["players", "moves", "game_time_s"]].isna().all(axis=None)

    assert "cornell_box, game, players 3, the toy: 21 moves" in told.err
    assert "49 moves in all" in told.out
    print_point(games.iloc[-1], results_console())
    assert "of all who play" in capsys.readouterr().out

    folder = tmp_path / "toys"
    assert (folder / "games.png").exists()
    assert "<!-- the toy" in (folder / "methods.svg").read_text(encoding="utf-8")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Games played" in page
    assert all(f'title="{name}: ' in page for name in ("patience", "players", "waited", "moves", "game_time_s"))
    stored = read_tables(folder)
    pd.testing.assert_frame_equal(stored.points, table)
    assert rewrite_report(given[0].configuration).read_text(encoding="utf-8") == page


NAMES = {one.name for one in (*METHODS, *WORKLOADS)}
NO_NAME_OF_OURS = {
    ("drawing/missing.py", "memory"): "a word in the text of an error",
}
"""Constants that are spelled like one of `NAMES` and compared, and why they are something else."""

CALLS = {"eq", "ne", "isin", "get", "find_method", "find_workload", "workload_rows", "say_series"}
"""What compares its arguments with names, or looks up by them."""


def compared_names(source):
    """Names that `source` compares with or looks up by: operands, patterns, arguments, subscripts, and
    collections and tables of names alone, by which something is chosen elsewhere."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Compare():
                found = [node.left, *node.comparators]
            case ast.Call(func=ast.Attribute(attr=name) | ast.Name(id=name)) if name in CALLS:
                found = node.args
            case ast.MatchValue():
                found = [node.value]
            case ast.Subscript():
                found = [node.slice]
            case ast.Dict() if all(map(_names, node.keys)):
                found = [key for key in node.keys if key is not None]
            case ast.Tuple() | ast.List() | ast.Set() if all(map(_names, node.elts)):
                found = node.elts
            case _:
                continue
        for one in found:
            yield from _names(one)


def _names(node):
    """The constant, or those of a collection, if they are names of ours."""
    parts = node.elts if isinstance(node, ast.Tuple | ast.List | ast.Set) else [node]
    return [one.value for one in parts if isinstance(one, ast.Constant) and one.value in NAMES]


def own_places():
    """Where a name is at home: a method in its file, a workload in its folder."""
    rooms = {one.name: ROOT / one.package.replace(".", "/") for one in WORKLOADS}
    files = {one.name: ROOT / f"{one.module.replace('.', '/')}.py" for one in METHODS}
    return rooms | files


REGISTRIES = {ROOT / "experiments" / room / "__init__.py" for room in ("methods", "workloads")}
"""They list all names."""


def test_no_file_compares_with_the_name_of_a_method_or_workload_but_its_own():
    home = own_places()
    strangers = {
        (path.relative_to(ROOT / "experiments").as_posix(), name)
        for path in (ROOT / "experiments").rglob("*.py")
        if path not in REGISTRIES
        # which hold methods against each other by name
        and not any(path.is_relative_to(ROOT / "experiments" / wing) for wing in ("law", "studies", "documents"))
        for name in compared_names(path.read_text(encoding="utf-8"))
        if home[name] not in (path, *path.parents)
    }
    assert strangers == set(NO_NAME_OF_OURS)


@pytest.mark.parametrize("source", [
    "if row['method'] == 'pixel': pass",
    "'tiles' != name",
    "name in ('aligned', other)",
    "rows[rows['workload'].isin(['frame', 'build'])]",
    "rows['method'].eq('pixel')",
    "STYLES['embreex']",
    "STYLES.get('embreex')",
    "find_method('aligned')",
    "DRAW = {'frame': draw_frame, 'build': draw_build}",
    "OURS = ('aligned', 'tiles')",
    "match name:\n case 'gather': pass",
])  # fmt: skip
def test_a_comparison_with_a_name_is_found_and_a_word_that_only_looks_like_one_is_left_alone(source):
    assert list(compared_names(source))
    assert not list(compared_names("labels = {'memory': 1, 'cores': 2}\nsay('memory')\n'frame time' == text"))
