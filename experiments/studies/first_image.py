"""Seconds from an empty process to the first answer of each kind, cold and warm; adds rows to a table.

    python -m experiments.studies first_image TABLE.csv source=clone state=cold runs=5 folder=.

Cold: no kernel is compiled. Warm: an earlier process has kept them. Every run is a process of its own with an empty
home. Wall time is from before `import atra`; CPU time is that of the process and of those that it has started.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from atra.errors import InputError
from experiments.harness.environment import package_version
from experiments.studies.processes import Row, Turn, add_rows, in_processes

ANSWERS = (("raster", "count", "layers"), ("aligned",), ("packets",), ("rays",))
"""Kinds of answer, in the order in which one process gives them."""


def first_answers(asked: list[str]) -> list[Row]:
    """Wall and CPU seconds to `import atra`, and from each answer to the next."""
    import os
    from time import perf_counter

    def now() -> tuple[float, float]:
        return perf_counter(), sum(os.times()[:4])

    last, told = now(), []

    def answered(name: str) -> None:
        nonlocal last
        here = now()
        told.append({"answer": name, "wall_s": round(here[0] - last[0], 3), "cpu_s": round(here[1] - last[1], 3)})
        last = here

    import atra

    answered("import")
    import numpy as np

    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = atra.Mesh(corners, np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))], np.uint32))
    camera = atra.Camera((2, 3, 4), (0, 0, 0), width=256, height=256)
    points = np.full((1000, 3), 3.0, np.float32)
    tracers: Any = {"raster": atra.RasterTracer, "packets": atra.PixelTracer, "aligned": atra.AlignedTracer}
    for name in asked:
        if name in tracers:
            tracer = tracers[name](mesh, camera, *([(4, 1)] if name == "aligned" else []))
            tracer.build()  # older versions do not build by themselves
            tracer.trace()
        elif name == "rays":
            scene = atra.RayScene(mesh)
            scene.build()
            scene.intersect(points, -points / 3.0)
        else:
            tracer.gather(atra.Count() if name == "count" else atra.Layers(4))
        answered(name)
    return told


def study(
    table: str, *, source: str, state: str, runs: int = 5, folder: str | None = None, python: str = sys.executable,
    commit: str = "",
) -> None:  # fmt: skip
    """Measure `runs` processes and add them to the table.

    source: what is measured, such as clone, wheel, or clone of a commit. state: cold or warm. folder: of a clone; None
    = what `python` has installed. commit: of the library. Raises InputError for another state.
    """
    if state not in ("cold", "warm"):
        raise InputError(f"state is {state!r}, expected cold or warm")
    columns: dict[str, Any] = {"source": source, "state": state, "commit": commit, "numba": package_version("numba")}
    columns["instruction_set"] = os.environ.get("ATRA_ISA", "native")
    for number, asked in enumerate(ANSWERS):
        with TemporaryDirectory() as kept:
            for run in range(-1 if state == "warm" else 0, runs):
                with TemporaryDirectory() as home:
                    places = {"HOME": home, "NUMBA_CACHE_DIR": kept if state == "warm" else f"{home}/kernels"}
                    library = None if folder is None else Path(folder)
                    turn = Turn({"asked": asked}, {**columns, "run": run}, python, library, places)
                    rows = in_processes(first_answers, 1, turn).drop(columns="process")
                if run >= 0:
                    add_rows(Path(table), rows if number == 0 else rows[rows["answer"] != "import"])
