"""run.py as a user meets it: bad input, a toy sweep, the same sweep again."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import matplotlib
import pandas as pd
import pytest
from PIL import Image

from experiments.workloads.rounds import expert_packet_widths
from tests.command import NO_SCENES, ROOT, run_here

pytestmark = pytest.mark.uncovered

TOY = ["width=64", "height=64", "measure.processes=1", "measure.rounds=3", "measure.warmup=1"]
TOY_SWEEP = ["sweep=horizontal", "method.split_x=1,2,3", *TOY]


def run(folder, *arguments):
    """`python run.py` with these arguments, in a process of its own."""
    environment = {name: value for name, value in os.environ.items() if name != "ATRA_SCENES"}
    environment |= {"XDG_CACHE_HOME": NO_SCENES.name, "LOCALAPPDATA": NO_SCENES.name}
    # Matplotlib would build its font cache in that new folder and, on a busy machine, say so.
    environment["MPLCONFIGDIR"] = matplotlib.get_cachedir()
    command = [sys.executable, str(ROOT / "run.py"), *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120)


@pytest.fixture(scope="module")
def toy_sweep(tmp_path_factory):
    """The folder in which the toy sweep was run, and what the command came to."""
    folder = tmp_path_factory.mktemp("toy")
    return folder, run_here(folder, *TOY_SWEEP)


@pytest.fixture
def swept(toy_sweep, tmp_path):
    """The same with a copy of the folder, `tmp_path`."""
    folder, done = toy_sweep
    assert done.returncode == 0, done.stderr
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    return done


@pytest.mark.parametrize(("arguments", "message"), [
    (["width=10", "method.split_x=3"], "split (3, 1) does not divide image 10 x 1024"),
    (["sweep=horizontal", "method.split_x=3,5"], "split (3, 1) does not divide image 1024 x 1024"),
    (["width=0"], "width is 0"),
    (["report", "sweep=paper"], "run sweep=paper first"),
    ([f"results_dir={ROOT / 'run.py'}"], "results cannot be written to"),
    (["scene.fov_y_degrees=180"], "fov_y_degrees is 180.0"),
    (["nonsense=1"], "unknown field 'nonsense', expected one of scene, sweep"),
    (["sweep=horizontal", "+nonsense=1"], "unknown field 'nonsense', expected one of scene, sweep"),
    (["+nonsense=1"], "unknown field 'nonsense', expected one of scene, sweep"),
    (["+scene.nonsense=1"], "unknown field 'nonsense' of scene, expected one of name, source, path"),
    (["+method.nonsense=1"], "unknown field 'nonsense' of method=aligned, expected one of split_x, split_y"),
    (["heigth=100"], "debug; did you mean height?"),
    (["packet_width=1"], "debug; did you mean method.packet_width?"),
    (["scene.eye=3,1,3"], "scene.eye is a list, which brackets hold together, and quotes the brackets: 'scene.eye=["),
    (["sweep=horizontal", "scene.up=0,1,0"], "scene.up is 0, expected a list, as in '[0,1,3]'"),
    (["method=nope"], "unknown method 'nope', expected one of aligned, bvh, classified, embreex, llvmpipe"),
    (["workload=nope"], "unknown workload 'nope', expected one of agreement, bake, bake_rays, build, classification"),
    (["method=pixel", "method.split_x=4"], "unknown field 'split_x' of method=pixel, expected one of packet_width"),
    (["sweep=horizontal", "method=pixel"], "unknown field 'split_x' of method=pixel, expected one of packet_width"),
    (["method=embreex", "method.split_x=4"], "unknown field 'split_x' of this method, which has none; it is an option"),
    (["method.packet_width=3"], "method.packet_width is 3, expected one of 1, 4, 8, 16, or null"),
    (["method.geometry=shared"], "method.geometry is 'shared', expected one of copied, instanced"),
    (["method.split_y=half"], "method.split_y is 'half', expected a whole number"),
    (["method.culling=5"], "method.culling is 5, expected true or false"),
    (["sweep.report=1"], "sweep.report is 1, expected true or false"),
    (["scene.source=tape"], "scene.source is 'tape', expected one of procedural, generated, package, directory, file"),
    (["sweep=horizontal", "method.split_x=0"], "method.split_x is 0, expected a whole number of at least 1"),
    (["workload=multiframe", "workload.frames=1"], "workload.frames is 1, expected at least 2"),
    (["workload=multiframe", "method=pixel"], "workload=multiframe with method=pixel, which traces one frame; use"),
    (["scene=nowhere"], "unknown scene 'nowhere', expected one of atrium, cornell_box, cornell_box_boxes,"),
    (["sweep=horizontal", "scene=cornell_box,nowhere"], "unknown scene 'nowhere', expected one of atrium, "),
    (["sweep=horizontal", "scene=cornell_box,sponza"], "ATRA_SCENES is not set"),
    (["scene=file", "scene.path=nothing.ply"], "nothing.ply does not exist"),
    (["method.split_x=1,2"], "several values make a sweep"),
    (["method.split_x=1024", "method.culling=false", "measure.memory_budget_gib=0.01"], "memory"),
    (["-m", "method=glob(xyz*)"], "no point is left by method=glob(xyz*)"),
    (["-m", "method.split_x=1,2", "--cfg", "job"], "Only one of --run, --multirun, --cfg"),
    (["-m", "width=interval(1,2)"], "width=interval(1,2) is an interval, expected values"),
    (["-m", "hydra/sweeper=basic", *TOY], "hydra/sweeper=basic makes no table; expected hydra/sweeper=points"),
    (["--config-dir", "nowhere.d"], "nowhere.d' not found"),
    (["model.glb"], "model.glb"),
    (["--config-dir", "own.d", "method=no_method"], "the file of method names none, expected one under defaults in it"),
    (["sweep=horizontal", "workload.frames=4"], "which has none; it is an option of workload=multiframe"),
    (["sweep=methods", "method.split_x=7", "scene=cornell_box"], "fits no point of the sweep: split (7, 1) does not"),
    (["report", "-m", "sweep=horizontal"], "report takes no -m"),
    (["measure", "sweep=horizontal"], "measure takes one point"),
    (["sweep=horizontal,vertical", "-m"], "sweep=horizontal,vertical names several sweeps, expected one"),
    (["report", "sweep=horizontal,vertical"], "sweep=horizontal,vertical names several sweeps, expected one"),
    (["scene=sponzaa"], "three_holes, weekend; did you mean sponza?"),
    (["method=rastr"], "visible_first; did you mean raster?"),
    (["-m", "method=pixel,rastr"], "visible_first; did you mean raster?"),
    (["mesure"], "tables; did you mean measure? (python run.py --help tells"),
    (["help"], "unknown verb 'help', expected one of board, doctor"),
    (["sweep=horizontal", "report"], "report stands behind sweep=horizontal, expected the verb first"),
], ids=lambda value: " ".join(value) if isinstance(value, list) else "")  # fmt: skip
def test_bad_input_gets_one_line_and_exit_code_2_before_any_work(tmp_path, arguments, message):
    method = tmp_path / "own.d" / "method"
    method.mkdir(parents=True)
    (method / "no_method.yaml").write_text("packet_rows: 1\n", encoding="utf-8")
    done = run_here(tmp_path, *arguments)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert message in line
    assert "Traceback" not in line
    assert [path.name for path in tmp_path.iterdir()] == ["own.d"]


def test_the_debug_switch_shows_the_traceback(tmp_path):
    assert "Traceback" in run_here(tmp_path, "width=0", "debug=true").stderr


def test_a_lone_point_prints_its_table_and_writes_its_record(tmp_path):
    done = run(tmp_path, *TOY, "method=pixel", "method.packet_width=1")
    assert done.returncode == 0, done.stderr
    assert "rtcIntersect1 / this" in done.stdout
    (path,) = (tmp_path / "results" / "records").glob("*.json")
    record = json.loads(path.read_text(encoding="utf-8"))
    assert record["status"] == "ok"
    assert set(record["samples"]) == {"own", "rtcIntersect1", *(f"packets_{width}" for width in expert_packet_widths())}
    assert {len(values) for values in record["samples"].values()} == {3}
    assert record["results"]["pixels_equal"] == 64 * 64
    assert record["environment"]["embree_version"]
    assert [entry.name for entry in tmp_path.iterdir()] == ["results"]


def test_measuring_a_picture_writes_it_and_says_where(tmp_path):
    done = run_here(tmp_path, *TOY, "workload=picture", "method=pixel")
    assert done.returncode == 0, done.stderr
    written = [Path(line[9:]) for line in done.stdout.splitlines() if line.startswith("written: ")]
    assert [path.name for path in written] == [
        "cornell_box_pixel.png", "cornell_box_rtcIntersect1.png", "cornell_box_difference.png"
    ]  # fmt: skip
    for path in written:
        assert Image.open(tmp_path / path).size == (64, 64)


def test_a_sweep_leaves_records_table_and_figure_and_goes_on_where_it_stopped(swept, tmp_path):
    folder = tmp_path / "results" / "horizontal"
    assert sorted(path.name for path in folder.iterdir()) == [
        "command.txt", "figure5.png", "figure5.svg", "figure5_speedup.png", "figure5_speedup.svg",
        "processes.parquet", "table.csv", "table.parquet",
    ]  # fmt: skip
    assert [entry.name for entry in tmp_path.iterdir()] == ["results"]
    table = pd.read_csv(folder / "table.csv")
    assert list(zip(table["split_x"], table["culling"], table["status"], strict=True)) == [
        (1, False, "ok"), (2, False, "ok"), (3, False, "skipped"),
        (1, True, "ok"), (2, True, "ok"), (3, True, "skipped"),
    ]  # fmt: skip
    assert table["error"][2] == table["error"][5]
    assert "does not divide" in table["error"][2]
    assert (table["pixels_wrong"].dropna() == 0).all()
    assert "does not divide" in swept.stdout
    told = swept.stdout.splitlines()[-1]
    assert told.startswith("Figure 5: render time over horizontal splits, culling off and on: ")
    assert Path(tmp_path, told.rpartition(": ")[2]) == folder / "figure5.png"

    # One record lost, one spoilt: these two are measured again, the others are not.
    records = tmp_path / "results" / "records"
    by_split = {path: json.loads(path.read_text(encoding="utf-8")) for path in records.glob("*.json")}
    lost, spoilt, *kept = [path for path, record in by_split.items() if record["status"] == "ok"]
    lost.unlink()
    spoilt.write_text("{")
    before = [path.read_bytes() for path in kept]
    again = run_here(tmp_path, *TOY_SWEEP)
    assert again.returncode == 0, again.stderr
    assert "6 points in 6 processes: 4 finished before, 0 cannot be measured, 2 to do" in again.stderr
    assert [path.read_bytes() for path in kept] == before
    assert "warning: record" in again.stderr
    assert spoilt.with_name(spoilt.name + ".corrupt").exists()
    assert len(pd.read_csv(folder / "table.csv")) == 6


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to one process")
def test_an_interrupt_keeps_what_is_done_and_exits_with_130(tmp_path):
    command = [sys.executable, str(ROOT / "run.py"), "sweep=horizontal", *TOY]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
    ) as running:
        for line in running.stderr:
            if " ms, " in line:  # the first point is done
                running.send_signal(signal.SIGINT)
                break
        rest = running.stderr.read()
        assert running.wait(timeout=60) == 130, rest
    assert "interrupted" in rest
    assert "Traceback" not in rest
    table = pd.read_csv(tmp_path / "results" / "horizontal" / "table.csv")
    assert (table["status"] == "ok").sum() >= 1
    assert (tmp_path / "results" / "horizontal" / "figure5.png").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to one process")
def test_an_interrupt_while_importing_is_one_line_and_130(tmp_path):
    slow = "print('importing', flush=True)\nimport time\ntry: time.sleep(60)\nexcept BaseException: pass  # as some do"
    (tmp_path / "hydra.py").write_text(slow)
    environment, pipe = {**os.environ, "PYTHONPATH": str(tmp_path)}, subprocess.PIPE
    command = [sys.executable, str(ROOT / "run.py")]
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=pipe, stderr=pipe, text=True) as running:
        assert running.stdout.readline() == "importing\n"
        running.send_signal(signal.SIGINT)
        _, told = running.communicate(timeout=50)
    assert (running.returncode, told) == (130, "run.py: interrupted\n")


def test_a_report_is_written_from_the_table_and_without_one_no_claim_holds(swept, tmp_path):
    folder = tmp_path / "results" / "horizontal"
    done = run_here(tmp_path, "report", "sweep=horizontal")
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"report: {Path('results', 'horizontal', 'report.html')}\n"
    assert "cornell_box" in (folder / "report.html").read_text(encoding="utf-8")
    claims = json.loads((folder / "claims.json").read_text(encoding="utf-8"))
    assert claims
    for name in ("table.parquet", "table.csv"):
        (folder / name).unlink()
    done = run_here(tmp_path, "report", "sweep=horizontal")
    assert done.returncode == 0, done.stderr
    text = (folder / "claims.json").read_text(encoding="utf-8")
    assert '"not measured"' in text
    assert '"holds"' not in text


def test_a_name_that_the_output_s_encoding_lacks_is_shown_escaped(tmp_path):
    folder = tmp_path / "\N{KATAKANA LETTER SI}"
    folder.mkdir()
    (folder / "sponza.ply").touch()
    done = run_here(tmp_path, "fetch", "scene=sponza", scenes=str(folder), encoding="cp1252")
    assert done.returncode == 0, done.stderr
    assert r"\u30b7" in done.stdout
