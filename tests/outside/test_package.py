"""A package in a folder of its own, installed by pip, adds a method, a workload and a scene without any edit here."""

import os
import subprocess
import sys

import pytest

from experiments.results.table import read_table
from tests.folders import ROOT

pytestmark = pytest.mark.slow

PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "their-tracing"
version = "1.2.3"

[project.entry-points."atra.methods"]
theirs = "their_tracing.method:Theirs"
broken = "their_tracing.missing:Nothing"

[project.entry-points."atra.workloads"]
their_time = "their_tracing.workload:THEIR_TIME"

[project.entry-points."atra.scenes"]
their_scene = "their_tracing.scene:make"
"""

METHOD = """
from dataclasses import dataclass
import atra

@dataclass(frozen=True)
class Theirs(atra.Method):
    label = "their method"
    breadth: str = "narrow"

    def prepare(self, mesh, camera, pool):
        return Prepared(atra.PixelTracer(mesh, camera, packet_width=1, threads=pool.threads))

class Prepared(atra.Prepared):
    def __init__(self, tracer):
        self.tracer = tracer
        tracer.build()

    def draw(self, offset, depth, prim_id):
        hits = self.tracer.trace(offset)
        depth[:], prim_id[:] = hits.depth, hits.prim_id

    def close(self):
        self.tracer.close()
"""

WORKLOAD = """
from contextlib import ExitStack

from experiments.harness.column import WHOLE, Column
from experiments.harness.options import NoOptions
from experiments.harness.point import Workload
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import series
from experiments.workloads.rounds import build_own, race

THEIR_TIME = Workload(
    "their_time", NoOptions,
    (*statistics_columns("their_time{}_s", "one frame", series("theirs")), Column("their_count", WHOLE, "of pixels")),
    lambda record: f"{record.results['their_count']} pixels", "their_tracing.workload",
    samples=lambda point: frozenset(("theirs",)), judged="theirs",
)

def measure(point):
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        count = {"their_count": point.width * point.height}
        return race(point, {"theirs": lambda: own.trace() and None}, lambda: count, results)
"""

SCENE = """
import atra

def make():
    mesh = atra.Mesh([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], [(0, 1, 2)], "their_scene")
    return mesh, {"eye": (0, 0, 3), "target": (0, 0, 0)}
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The folder that pip has installed the package into."""
    source, target = tmp_path_factory.mktemp("their"), tmp_path_factory.mktemp("site")
    (source / "their_tracing").mkdir()
    (source / "pyproject.toml").write_text(PROJECT, encoding="utf-8")
    for name, text in (("__init__", ""), ("method", METHOD), ("workload", WORKLOAD), ("scene", SCENE)):
        (source / "their_tracing" / f"{name}.py").write_text(text, encoding="utf-8")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-build-isolation"]
    done = subprocess.run([*pip, "--target", str(target), str(source)], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"pip cannot install a folder here: {done.stderr.strip()[-200:]}")
    return target


def run(installed, folder, *arguments):
    paths = [str(installed), str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    return subprocess.run(
        [sys.executable, str(ROOT / "run.py"), *arguments], cwd=folder, env=variables, capture_output=True, text=True
    )


TOY = ["width=16", "height=16", "measure.processes=1", "measure.rounds=3", "sweep.name=toys", "sweep.report=true"]


def test_its_method_workload_and_scene_go_from_the_command_line_to_table_figures_and_page(installed, tmp_path):
    kinds = ["scene=their_scene", "method=theirs,pixel,broken", "workload=frame,their_time"]
    done = run(installed, tmp_path, "-m", *kinds, *TOY)
    table = read_table(tmp_path / "results" / "toys" / "table.parquet")
    assert table is not None, done.stderr
    assert set(table[table["method"] != "broken"]["status"]) == {"ok"}, done.stderr
    assert set(table[table["method"] == "broken"]["status"]) == {"skipped"}
    assert table[table["method"] == "broken"]["error"].str.contains("ModuleNotFoundError").all()
    assert table[table["method"] == "theirs"].query("workload == 'frame'")["pixels_wrong"].eq(0).all()
    folder = tmp_path / "results" / "toys"
    assert any("their method" in path.read_text(encoding="utf-8") for path in folder.glob("*.svg"))
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "theirs" in page
    assert "their_count" in page


def test_changed_code_of_the_package_is_measured_anew(installed, tmp_path):
    asked = ["scene=their_scene", "method=theirs", *TOY[:-2]]
    assert run(installed, tmp_path, *asked).returncode == 0
    with (installed / "their_tracing" / "method.py").open("a", encoding="utf-8") as file:
        file.write("# changed\n")
    assert run(installed, tmp_path, *asked).returncode == 0
    assert len(list((tmp_path / "results" / "records").glob("*.json"))) == 2


def test_a_method_file_is_measured_beside_ours_and_in_sweeps(installed, tmp_path):
    (tmp_path / "mine.py").write_text(METHOD.replace("their method", "my method"), encoding="utf-8")
    sweep = ["sweep=horizontal", "method.split_x=4", "scene=cornell_box"]
    done = run(installed, tmp_path, "method_file=mine.py", *sweep, *TOY)
    table = read_table(tmp_path / "results" / "toys" / "table.parquet")
    assert table is not None, done.stderr
    assert {"aligned", "mine"} <= set(table["method"])
    assert list(table[table["method"] == "mine"]["status"]) == ["ok"]
    assert list(table[table["method"] == "mine"]["grids"]) == ["method_file"]
