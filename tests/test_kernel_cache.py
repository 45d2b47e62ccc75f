"""What Numba keeps on disk is run again only while nothing that it was made of has changed; it need not keep any."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from atra.embree import layout
from atra.kernels import brute_force, caching, planning, statistics, ties, tiles, tracing, visible

KERNELS = {
    **{
        f"{module.__name__}.{name}": value
        for module in (brute_force, planning, statistics, ties, tiles, tracing, visible)
        for name, value in vars(module).items()
        if getattr(value, "targetoptions", {}).get("nogil")
    },
    "pixel_kernel": tracing.pixel_kernel(4, 2),
    "aligned_kernel": tracing.aligned_kernel(4, 2),
    "tile_kernel": tiles.tile_kernel(4, 2),
    "verify_kernel": visible.verify_kernel(4, 2),
}


@pytest.mark.parametrize("name", KERNELS)
def test_a_kernel_is_kept_under_the_stamp_of_all_sources(name: str) -> None:
    assert KERNELS[name]._cache._cache_file._source_stamp == caching.SOURCE_STAMP


def test_the_sources_are_all_kernels_and_the_struct_layouts() -> None:
    folder = Path(str(caching.__file__)).parent
    assert set(folder.glob("*.py")) | {Path(str(layout.__file__))} < set(caching._SOURCES)
    assert len(KERNELS) > 15


def test_kept_code_is_run_again_until_another_file_that_it_is_made_of_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "made_of_two_files.py"
    path.write_text(
        "from numba import njit\n"
        "from atra.kernels.caching import kernel\n"
        "def make(constant):  # stands for what is inlined from another file\n"
        "    global helper\n"
        "    helper = njit(inline='always')(eval(f'lambda: {constant}'))\n"
        "@kernel\n"
        "def answer():\n"
        "    return helper()\n"
    )

    def answer(constant: int) -> int:
        spec = importlib.util.spec_from_file_location("made_of_two_files", path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        module.make(constant)
        return int(module.answer())

    assert answer(1) == 1
    assert answer(2) == 1  # Numba sees the same file: this is what the stamp is for
    monkeypatch.setattr(caching, "SOURCE_STAMP", caching.SOURCE_STAMP + 1)
    assert answer(2) == 2


def test_where_no_folder_can_be_written_kernels_are_compiled_and_not_kept() -> None:
    code = (
        "import numba.core.caching as caching\n"
        "caching.CacheImpl._locator_classes = []  # as if the folder of the sources and the user's were read-only\n"
        "import atra, atra.kernels.caching, atra.kernels.callbacks, experiments.peers.trimesh_ray\n"
        "assert atra.kernels.callbacks.nearest_hit_filter(1, 1)\n"
        "mesh = atra.Mesh([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], [(0, 1, 2)])\n"
        "camera = atra.Camera((0, 0, 3), (0, 0, 0), width=4, height=4)\n"
        "with atra.PixelTracer(mesh, camera, packet_width=1, ties='any') as tracer: hits = tracer.trace()\n"
        "print(int(hits.hit.sum()) > 0, atra.kernels.caching.CACHE_FOLDER)"
    )
    root = Path(__file__).resolve().parents[1]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True)
    assert done.stdout == "True None\n", done.stderr
