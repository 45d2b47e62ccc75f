"""Seconds from an empty process to the first answer of each kind, cold and warm; writes a table.

    python -m experiments.first_image TABLE.csv --source clone --state cold --runs 5 --library .

Cold: no kernel is compiled. Warm: an earlier process has kept them. Every run is a process of its own with an empty
home; rows are added to the table. Wall time is from before `import atra`; CPU time is that of the process and of those
that it has started.
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments.harness.environment import read_environment

COLUMNS = (
    "source", "state", "instruction_set", "answer", "run", "wall_s", "cpu_s", "commit", "processor", "cores", "numba",
)  # fmt: skip

ANSWERS = (("import", "raster", "count", "layers"), ("import", "aligned"), ("import", "packets"), ("import", "rays"))
"""Kinds of answer, in the order in which one process gives them."""

_PROCESS = """
import json, sys
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from time import perf_counter
def now():
    used = getrusage(RUSAGE_SELF), getrusage(RUSAGE_CHILDREN)
    return perf_counter(), sum(one.ru_utime + one.ru_stime for one in used)
start = last = now()
told = {}
def answered(name):
    global last
    here = now()
    told[name] = here[0] - last[0], here[1] - last[1]
    last = here
def built(tracer):  # of itself a tracer of an older version does not
    tracer.build()
    return tracer
import atra
answered("import")
import numpy as np
corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))], np.uint32)
mesh = atra.Mesh(corners, faces)
camera = atra.Camera((2, 3, 4), (0, 0, 0), width=256, height=256)
tracer = None
for name in sys.argv[1].split(","):
    if name == "raster":
        tracer = built(atra.RasterTracer(mesh, camera))
        tracer.trace()
    elif name == "aligned":
        built(atra.AlignedTracer(mesh, camera, (4, 1))).trace()
    elif name == "packets":
        built(atra.PixelTracer(mesh, camera)).trace()
    elif name == "rays":
        built(atra.RayScene(mesh)).intersect(np.full((1000, 3), 3.0, np.float32), np.full((1000, 3), -1.0, np.float32))
    elif name == "count":
        tracer.gather(atra.Count())
    elif name == "layers":
        tracer.gather(atra.Layers(4))
    answered(name)
print(json.dumps(told))
"""


def main() -> None:
    """Measure what the arguments say, and add it to the table."""
    parser = ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("table", type=Path)
    parser.add_argument("--source", required=True, help="what is measured, such as clone, wheel, or clone of a commit")
    parser.add_argument("--state", choices=("cold", "warm"), required=True)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--library", type=Path, help="folder of a clone; without it what PYTHON has installed")
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--commit", default="", help="of the library")
    given = parser.parse_args()
    instruction_set = os.environ.get("ATRA_ISA", "native")
    same = {"source": given.source, "state": given.state, "instruction_set": instruction_set, "commit": given.commit}
    machine = read_environment()
    same |= {"processor": machine.cpu, "cores": machine.logical_cores, "numba": machine.numba_version}
    is_new = not given.table.exists()
    given.table.parent.mkdir(parents=True, exist_ok=True)
    with given.table.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if is_new:
            writer.writeheader()
        for answers in ANSWERS:
            measured = _measured(answers, given.library, given.python, given.state == "warm", given.runs)
            for run, seconds in enumerate(measured):
                for name, (wall_s, cpu_s) in seconds.items():
                    if name != "import" or answers == ANSWERS[0]:
                        row = {**same, "answer": name, "run": run, "wall_s": f"{wall_s:.3f}", "cpu_s": f"{cpu_s:.3f}"}
                        writer.writerow(row)
                file.flush()


def _measured(
    answers: tuple[str, ...], library: Path | None, python: str, warm: bool, runs: int
) -> Iterator[dict[str, list[float]]]:
    """Wall and CPU seconds to each answer, run by run."""
    with TemporaryDirectory() as kept:
        for run in range(-1 if warm else 0, runs):
            with TemporaryDirectory() as home:
                kernels = kept if warm else f"{home}/kernels"
                variables = {"HOME": home, "NUMBA_CACHE_DIR": kernels, "ATRA_QUIET": "1"}
                if library is not None:
                    variables["PYTHONPATH"] = str(library.resolve())
                told = subprocess.run(
                    [python, "-c", _PROCESS, ",".join(answers[1:])],
                    env=os.environ | variables, cwd=home, check=True, capture_output=True, text=True,
                ).stdout  # fmt: skip
            if run >= 0:
                yield dict(json.loads(told))


if __name__ == "__main__":
    main()
