"""The program loads what the verb that is asked for needs, and no more."""

import base64
import json
import subprocess
import sys

import numpy as np
import pytest

from tests.folders import ROOT


def loaded_by(*words):
    """Exit code, modules that the program has loaded when it ends, and what it printed."""
    code = "import sys, atexit; atexit.register(lambda: print(*sys.modules, file=sys.stderr)); sys.argv[0] = 'atra'\n"
    code += "from atra.command.main import main; sys.exit(main())"
    done = subprocess.run([sys.executable, "-c", code, *words], cwd=ROOT, capture_output=True, text=True)
    return done.returncode, set(done.stderr.splitlines()[-1].split()), done.stdout


@pytest.mark.parametrize("word", ["--version", "--help"])
def test_what_is_answered_without_a_verb_loads_no_array_and_no_compiler(word):
    code, loaded, said = loaded_by(word)
    assert code == 0
    assert "atra" in said
    assert loaded.isdisjoint({"numpy", "numba", "trimesh"})


def test_a_verb_loads_its_own_module_alone():
    code, loaded, said = loaded_by("judge", "--help")
    assert code == 0
    assert "--depth-scale" in said
    assert "atra.command.judging" in loaded
    assert loaded.isdisjoint({"trimesh", "atra.command.render", "atra.command.compiling", "atra.command.planning"})


def test_a_warning_is_one_line_without_the_place_in_the_code(tmp_path):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32).tobytes()
    path = tmp_path / "leaf.gltf"
    path.write_text(json.dumps({
        "asset": {"version": "2.0"}, "animations": [{}], "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{
            "byteLength": 36,
            "uri": "data:application/octet-stream;base64," + base64.b64encode(corners).decode(),
        }],
    }))  # fmt: skip
    words = ["-m", "atra.command", "render", str(path), "--camera", "none", "--samples", "1"]  # ends before it draws
    done = subprocess.run([sys.executable, *words], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.splitlines()[0] == "atra: leaf.gltf: not used: animations"
    assert "UserWarning" not in done.stderr
