"""What a method from outside prints and raises reaches the person who wrote it; its warm-up asks for nothing odd."""

import numpy as np
import pytest

import atra
import tests.command
from atra.errors import InputError
from experiments.harness.processes.launching import run_worker
from experiments.methods.outside.guarded import Guarded
from experiments.workloads.rounds import warm_up
from tests.command import run_here
from tests.points import planned

TOY = ("scene=cornell_box", "width=16", "height=16", "measure.rounds=3", "measure.warmup=1", "measure.processes=1")

FAILS = """
import atra
class Mine(atra.Method):
    def prepare(self, mesh, camera, pool):
        print(f"building {mesh.triangle_count} triangles")
        return Prepared()

class Prepared(atra.Prepared):
    def draw(self, offset, depth, prim_id):
        self.helper(0)

    def helper(self, divisor):
        return WHAT
"""
RAISES = FAILS.replace("WHAT", "1 / divisor")
REFUSED = FAILS.replace("WHAT", "'no image at all'")


def test_other_peoples_methods_warm_up_with_no_triangle_that_the_eye_sees_edge_on_and_none_twice():
    meshes = []

    class Nothing(atra.Prepared):
        pass

    class Careful(atra.Method):
        def prepare(self, mesh, camera, pool):
            meshes.append((mesh, camera))
            return Nothing()

    def make(point, mesh, view):
        return atra.Tracer(mesh, view, Guarded(Careful()), threads=1)

    warm_up(planned("program", "frame").point, [make], use=lambda tracer: None)
    ((mesh, camera),) = meshes
    a, b, c = mesh.vertices.astype(np.float64)[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    assert np.abs(((np.array(camera.eye) - a) * normals).sum(-1)).min() > 0.1
    assert np.linalg.norm(normals, axis=-1).min() > 0.1
    assert len({tuple(sorted(face)) for face in mesh.faces.tolist()}) == mesh.triangle_count


def test_what_fails_in_the_warm_up_names_mesh_and_camera():
    point = planned("program", "frame").point

    def refuse(point, mesh, view):
        raise InputError("no")

    with pytest.raises(InputError) as caught:
        warm_up(point, [refuse])
    (note,) = caught.value.__notes__
    assert "while warming up" in note
    assert "faces [[0, 1, 2], [3, 2, 1]]" in note
    assert "Camera(eye=(0.0, 0.0, 2.0)" in note
    with pytest.raises(InputError) as of_ours:
        warm_up(planned("pixel", "frame").point, [refuse])
    assert not hasattr(of_ours.value, "__notes__")


@pytest.mark.parametrize(("text", "told", "code"), [
    (RAISES, "ZeroDivisionError: division by zero; while warming up", 1),
    (REFUSED, "draw left a depth of NaN at pixel (0, 0), expected inf for a miss; while warming up", 2),
])  # fmt: skip
def test_a_single_point_shows_what_the_method_printed_and_why_it_failed(tmp_path, monkeypatch, text, told, code):
    monkeypatch.setattr(tests.command, "measure_here", run_worker)
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    done = run_here(tmp_path, "method_file=mine.py", *TOY)
    assert done.returncode == code
    assert told in done.stderr
    assert "building 2 triangles" in done.stderr
    assert ("in helper" in done.stderr) == (text is RAISES)


def test_a_sweep_shows_the_methods_own_lines_and_the_path_of_the_record(tmp_path):
    (tmp_path / "mine.py").write_text(RAISES, encoding="utf-8")
    done = run_here(tmp_path, "-m", "method_file=mine.py", "method=mine", *TOY)
    assert done.returncode == 1
    (path,) = (tmp_path / "results" / "records").glob("*.json")
    lines = [line.strip() for line in done.stderr.splitlines()]
    assert f"{tmp_path / 'mine.py'}:10 in draw: self.helper(0)" in lines
    assert f"{tmp_path / 'mine.py'}:13 in helper: return 1 / divisor" in lines
    assert f"record: {path.relative_to(tmp_path)}" in lines
    assert not any("guarded.py:" in line for line in lines)
