"""A worker imports its own method, its own workload and its own scene: what else there is does not slow its start."""

import sys
from dataclasses import replace

import pytest

from experiments import methods
from experiments.harness.processes.launching import run_worker
from tests.points import planned

pytestmark = pytest.mark.uncovered

ROOMS = {"all_hits", "compiled", "embree", "exact", "files", "geometry", "judge", "packets", "tracing"}
"""Rooms of the library that every point may use: packets are measured beside each method."""

SHARED = {
    "experiments.methods": {"options", "pixel"},
    "experiments.workloads": {"baselines", "images", "resources", "rounds", "typed"},
    "scenes": {"built_in", "cornell_box", "loading", "scene", "shapes"},
}
"""Modules that every point of the Cornell box may use."""

POINTS = [
    ("pixel", "frame", set(), set()),
    ("aligned", "frame", {"alignment"}, {"aligned"}),
    ("raster", "frame", {"raster"}, {"raster"}),
    ("tiles", "build", {"alignment"}, {"tiles", "tiles_kernels"}),
    ("visible_first", "memory", {"alignment"}, {"visible_first"}),
    ("bvh", "frame", {"rays", "trees"}, set()),
]
"""Method, workload, and the rooms of the library and the modules of methods that they may use beside those."""

WINGS = {"classification", "law", "light"}
"""No point of the paper imports any."""

PACKAGES = {"matplotlib", "pandas", "hydra", "omegaconf", "rich", "trimesh", "PIL", "open3d", "mitsuba", "embreex"}
"""Packages that no worker of these points needs; Numba itself imports SciPy where there is one."""


def modules_of_worker(point, folder):
    """Names of all modules that a worker has imported when its point is measured."""
    told = folder / "modules"
    code = (
        "import sys; from experiments.harness.processes.worker import run_job; from experiments.registry import KINDS; "
        f"run_job(KINDS); open({str(told)!r}, 'w').write(' '.join(sys.modules))"
    )
    outcome = run_worker(replace(point, memory_budget_gib=1.0), [sys.executable, "-c", code])
    assert (outcome.status, outcome.error) == ("ok", None)
    return set(told.read_text(encoding="utf-8").split())


def below(package, modules):
    """What a package has of these, without what lies in them."""
    return {name.removeprefix(f"{package}.").partition(".")[0] for name in modules if name.startswith(f"{package}.")}


@pytest.mark.parametrize(
    ("method", "workload", "rooms", "own"), POINTS, ids=lambda one: one if isinstance(one, str) else ""
)
def test_a_worker_imports_no_method_workload_scene_or_room_but_those_of_its_point(
    method, workload, rooms, own, tmp_path
):
    point = planned(method, workload, (32, 32), measure={"rounds": 3, "warmup": 1}).point
    modules = modules_of_worker(point, tmp_path)
    files = {"choices", "errors", "hits", "prim_ids", "whole_numbers"}
    assert below("atra", modules) - files <= ROOMS | rooms
    further = {"experiments.methods": own, "experiments.workloads": {workload}, "scenes": set()}
    for package, shared in SHARED.items():
        assert below(package, modules) <= shared | further[package]
    assert WINGS & below("experiments", modules) == ({"classification"} if method == "bvh" else set())
    assert {name.partition(".")[0] for name in modules} & PACKAGES == set()


def test_files_of_methods_are_not_run_for_a_method_of_ours(tmp_path, monkeypatch):
    path = tmp_path / "mine.py"
    path.write_text("raise RuntimeError('it was run')", encoding="utf-8")
    monkeypatch.setenv(methods.METHOD_FILES, str(path))
    point = planned("pixel", "frame", (32, 32), measure={"rounds": 3, "warmup": 1}).point
    assert "experiments.methods.outside.loading" not in modules_of_worker(point, tmp_path)
