"""A record is as old as the files that its worker had loaded, and a worker loads those of its own point alone."""

import sys
from dataclasses import replace
from types import ModuleType

import pytest

from experiments import methods
from experiments.harness import identity as identities
from experiments.harness.identity import code_of_worker, code_sha256, current_environment, identity, is_current
from experiments.harness.identity import loaded_files as files_loaded_here
from experiments.harness.points import measure
from experiments.harness.processes.launching import run_worker
from experiments.harness.records import Record
from experiments.methods.pixel import PIXEL
from experiments.methods.raster import RASTER
from tests.points import POINT, planned

SOURCE = "LIMIT = 3\ndef f(x):\n    return x"


def test_limits_are_no_part_of_a_point():
    environment = current_environment()
    others = [replace(POINT, time_limit_s=9.0), replace(POINT, memory_budget_gib=9.0)]
    others.append(replace(POINT, memory_budget_gib=None))
    assert {identity(one, environment) for one in others} == {identity(POINT, environment)}
    for name, value in (("rounds", 9), ("warmup", 9), ("frame_budget_s", 9.0), ("process", 9), ("width", 9)):
        assert identity(replace(POINT, **{name: value}), environment) != identity(POINT, environment)


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Writes a file of a project that is found before ours, as a run that begins then reads it."""
    monkeypatch.setattr(identities, "_ROOT", tmp_path)

    def write(text, file="atra/room.py"):
        path = tmp_path / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        identities._source.cache_clear()
        return [file]

    yield write
    identities._source.cache_clear()


@pytest.mark.parametrize(("other", "is_the_same"), [
    ("# why\n\nLIMIT = 3  # three\ndef f(x):\n\n    return x", True),
    ("LIMIT = 3\n'''Of x.'''\ndef f(x):\n    '''As it is.'''\n    return x", True),
    ("LIMIT = (\n    3\n)\ndef f(x): return x", True),
    ("LIMIT = 4\ndef f(x): return x", False),
    ("LIMIT = 3\ndef f(x): return -x", False),
    ("LIMIT = 3\ndef f(x): return 'x'", False),
    ("LIMIT = 3\ndef f(x=1): return x", False),
    ("LIMIT = 3.0\ndef f(x): return x", False),
    ("LIMIT = 3\n@cached\ndef f(x): return x", False),
])  # fmt: skip
def test_a_record_stays_current_while_what_its_files_run_is_the_same_however_it_is_written(other, is_the_same, project):
    files = project(SOURCE)
    record = replace(measure(planned("pixel", "frame"), no_worker), files=files)
    record.environment["code_sha256"] = code_sha256(files)
    assert is_current(record)
    project(other)
    assert is_current(record) is is_the_same


def no_worker(point):
    return Record("", "ok")


def test_a_record_one_of_whose_files_has_gone_is_not_current(project):
    files = project(SOURCE)
    before = code_sha256(files)
    identities._source.cache_clear()
    (identities._ROOT / files[0]).unlink()
    assert code_sha256(files) != before


def test_a_file_that_changed_between_this_run_s_reading_and_its_worker_s_leaves_a_record_that_is_not_current(project):
    files = project(SOURCE)
    read_here = identities._source(files[0])[0]
    assert code_of_worker({files[0]: read_here}) == code_sha256(files)
    assert code_of_worker({files[0]: "of another file"}) == ""


def test_of_a_package_that_is_not_ours_the_files_of_the_workload_in_use_count_alone(tmp_path, monkeypatch):
    for package in ("theirs", "stranger"):
        path = tmp_path / package / "measuring.py"
        path.parent.mkdir()
        path.write_text("A = 1\n")
        module = ModuleType(f"{package}.measuring")
        module.__file__ = str(path)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    files = files_loaded_here(replace(POINT, workload=replace(POINT.workload, package="theirs")))
    assert "theirs/measuring.py" in files
    assert "stranger/measuring.py" not in files
    assert identities._source("theirs/measuring.py")[0] == files["theirs/measuring.py"]


def of_worker(method, workload, **asked):
    point = planned(method, workload, (16, 16), measure={"rounds": 1, "warmup": 0}, asked=asked).point
    outcome = run_worker(point)
    assert outcome.status == "ok", outcome.error
    return set(outcome.files)


@pytest.mark.slow
def test_a_worker_tells_the_files_of_its_method_and_workload_and_no_others_that_decide_nothing():
    raster = of_worker("raster", "frame")
    pixel = of_worker("pixel", "frame")
    both = {
        "atra/raster/tracer.py", "atra/embree/scene.py", "experiments/harness/rounds.py",
        "experiments/harness/point.py", "experiments/harness/processes/worker.py",
        "experiments/workloads/frame/measure.py",
    }  # fmt: skip
    assert both <= raster
    assert both - {"atra/raster/tracer.py"} <= pixel
    for method, mine, other in ((RASTER, raster, pixel), (PIXEL, pixel, raster)):
        file = f"{method.module.replace('.', '/')}.py"
        assert file in mine
        assert method is PIXEL or file not in other  # every frame is measured beside rays per pixel
    for name in raster | pixel:
        assert not name.startswith(("experiments/report/", "experiments/paper/", "experiments/commands/", "scenes/"))
        assert name not in (
            "experiments/registry.py",
            "experiments/methods/__init__.py",
            "experiments/results/table.py",
        )


@pytest.mark.slow
def test_lights_of_a_scene_are_part_of_what_measured_a_point_that_uses_them():
    assert "scenes/lit/lighting.py" in of_worker("raster", "bake", size=32, samples=1)


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
