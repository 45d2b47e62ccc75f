"""A record is as old as the files that its worker had loaded, and its identity is configuration, machine and method."""

import sys
from dataclasses import replace
from types import ModuleType

import pytest

from experiments.harness import identity as identities
from experiments.harness.identity import code_of_worker, code_sha256, current_environment, identity, is_current
from experiments.harness.identity import loaded_files as files_loaded_here
from experiments.harness.points import measure
from experiments.harness.processes.launching import run_worker
from experiments.harness.records import Record
from experiments.methods.pixel import PIXEL
from experiments.methods.raster import RASTER
from tests.harness.processes.test_outcome import POINT
from tests.points import planned

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
