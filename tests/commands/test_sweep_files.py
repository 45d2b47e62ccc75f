"""Every sweep of conf/sweep runs at toy size and leaves its figures."""

import pandas as pd
import pytest

from experiments.methods.peers.llvmpipe import LLVMPIPE
from tests.command import ROOT, run_here
from tests.machine import NARROW, WIDEST

pytestmark = [pytest.mark.uncovered, pytest.mark.usefixtures("figures_unsaved")]

TOY = ["scene=cornell_box", "width=32", "height=32", "measure.processes=1", "measure.rounds=3", "measure.warmup=1"]
FIGURE5 = [
    f"{name}_{rays}" for name in ("figure5", "figure5_speedup") for rays in ("single_rays", f"packets_of_{WIDEST}")
]
OVER_SPLITS = {"figure4", "figure4_speedup", *FIGURE5, "figure5_vertical", "figure5_vertical_speedup"}
OTHER_PICTURES = ("split", "still")
NEEDLESS = ("others", "aligned_others", "solid", "solid_others", "solid_aligned")  # as all reductions are asked for
IN_PROCESS = ("occupancy", "dark", "expansion", "roulette", "environment", "translucency")
# An image of 32 pixels takes no split of 64: such points are skipped.
SWEEPS = {
    "smoke": ([], {"figure3", *OVER_SPLITS, "figure6", "figure7", "figure7_instancing"}),
    "build": (["method.split_x=4"], {"figure6"}),
    "memory": (["method.split_x=4"], {"figure7", "figure7_instancing"}),
    "scenes": (["scene=cornell_box"], {"figure3"}),
    "methods": (["method.split_x=4", "method.split_y=1"], {"methods"}),
    "instruction_sets": (["method.split_x=4", "method.split_y=1"], {"methods"}),
    "methods_families": (["method.split_x=4", "method.split_y=1"], {"methods"}),
    "baselines": ([f"method.packet_width={NARROW}", "method.packet_rows=null"], set()),
    "reference_rays": (["method.split_x=4", "method.culling=true"], set(FIGURE5)),
    "ablations": (
        ["method.split_x=4", "method.split_y=1", "method.reference=off_axis", "~sweep.grids.ablations_sun"],
        {"methods"},
    ),
    "cornell_candidates": (
        ["method.split_x=1,4"]
        + [f"~sweep.grids.{name}{hits}" for name in ("threads", "inside", "farther") for hits in ("", "_all_hits")],
        {"figure5_speedup"},
    ),
    "threads": ([], {"methods"}),
    "peers": ([], {"methods"}),
    "agreement": (
        ["method=aligned", "method.split_x=4", "method.split_y=1", "scene=cornell_box", "scene.fov_y_degrees=45"],
        set(),
    ),
    "stereo": (["method.split_x=4", "measure.processes=3"], set()),
    "multiframe": (["workload.frames=2", "method.split_x=4"], set()),
    "gather": (
        [
            "method.split_x=4",
            "method.packet_width=null",
            "workload.what=count,layers",
            *(f"~sweep.grids.gather_{name}" for name in NEEDLESS),
        ],
        {"gather", "figure5_gather"},
    ),
    "gather-whole": (
        ["method.split_x=4", "method.packet_width=null", "workload.what=count,layers"],
        {"gather", "figure5_gather"},
    ),
    "frame": (
        [
            *(f"~sweep.grids.frame_{name}" for name in OTHER_PICTURES),
            "sweep.figures.stages=[frame_plain,frame_paths]",
            *(f"sweep.grids.frame_paths.{side}=32" for side in ("width", "height")),
            "workload.samples=2",
        ],
        {"stages"},
    ),
    "rays": (
        [
            "scene=cornell_box",
            "workload.ray_batch=incoherent",
            "workload.judged_rays=50",
            "threads=1",
            *(f"~sweep.grids.rays_{name}" for name in ("contains", "contains_threads", "numbers")),
        ],
        set(),
    ),
    "rays-batches": (
        ["scene=cornell_box", "workload.judged_rays=50", "threads=1"]
        + [f"~sweep.grids.rays_{name}" for name in ("contains", "contains_threads", "numbers")],
        set(),
    ),
    "rays-closed": (
        ["scene=three_holes", "workload.judged_rays=5", "threads=1"]
        + [f"~sweep.grids.rays_{name}" for name in ("questions", "questions_threads", "numbers")],
        set(),
    ),
    "law": (["method.split_x=4", "method.split_y=4"], {"methods", "gather"}),
    "views": (["scene.copies=1", "workload.views=2", "width=32", "height=32"], set()),
    "classification_smoke": ([], {"classification_probability", "classification_shafts"}),
    "bake_smoke": (
        [f"~sweep.grids.bake_{name}" for name in IN_PROCESS],
        {"bake_convergence", "bake_stages", "bake_rays"},
    ),
    "bake_rays_smoke": (["method=raster"], {"bake_alignment"}),
    "bake_buffers": (["workload.size=16,32"], set()),
    "bake_culling_map": (["workload.size=16", "method=raster"], {"bake_convergence"}),
}
WITH_A_TWIN = {"bake", "bake_denoise", "bake_mitsuba", "bake_rays", "classification"}
PARTS_OF_SMOKE = {"horizontal", "vertical", "grid", "paper"}
SLOW = {
    "smoke", "methods", "methods_families", "peers", "baselines", "reference_rays", "threads",
    "bake_buffers", "bake_culling_map", "classification_smoke", "gather-whole",
    "rays-batches", "ablations", "cornell_candidates", "law",
}  # fmt: skip
"""Sweeps of workloads that a quick one has, too."""


def sweep_of(name):
    """The sweep of a case; behind a hyphen its name says which part of the sweep runs."""
    return name.partition("-")[0]


def test_no_sweep_is_left_out_here():
    names = {path.stem for path in (ROOT / "conf" / "sweep").glob("*.yaml")}
    assert names - {"point"} == {sweep_of(name) for name in SWEEPS} | PARTS_OF_SMOKE | WITH_A_TWIN


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in SWEEPS]
)
def test_a_sweep_runs_and_leaves_its_figures(name, tmp_path):
    overrides, figures = SWEEPS[name]
    done = run_here(tmp_path, f"sweep={sweep_of(name)}", *TOY, *overrides)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "results" / sweep_of(name)
    assert {path.stem for path in folder.glob("*.png")} == figures
    table = pd.read_parquet(folder / "table.parquet")
    assert (table["status"] != "failed").all()
    for wrong in {"pixels_wrong", "rays_wrong", "rays_different"} & set(table):
        assert (table[table["method"] != LLVMPIPE.name][wrong].dropna() == 0).all()
    assert (folder / "report.html").exists() == (sweep_of(name) in {"smoke", "gather"})
