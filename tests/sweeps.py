"""Sweeps of the Cornell box in a temporary folder, by a runner that measures nothing."""

from experiments.harness.configuration import (
    Chosen,
    Configuration,
    MeasureConfiguration,
    SceneConfiguration,
    SweepConfiguration,
)
from experiments.harness.options import NoOptions
from experiments.harness.points import GridPoint
from experiments.harness.records import Record
from experiments.methods.aligned import ALIGNED, AlignedOptions
from experiments.workloads import find_workload
from scenes.loading import SceneSource


class Runner:
    """Stands in for the worker: remembers the points it was given."""

    def __init__(self, status="ok"):
        self.status = status
        self.points = []

    def __call__(self, point):
        self.points.append(point)
        if self.status != "ok":
            return Record("", self.status, "on purpose")
        results = {
            "triangles_traced": 10, "packet_width": 8, "threads": 1, "plan_time_s": 0.1,
            "build_time_s": 0.1, "rss_bytes": 9, "peak_rss_bytes": 9, "embree_bytes": 9, "rounds": 3,
            "pixels_equal": 64, "pixels_tied": 0, "pixels_edge": 0, "pixels_wrong": 0,
        }  # fmt: skip
        names = ("own", "rtcIntersect1", "packets_8")
        return Record("", "ok", samples={name: [0.1, 0.1, 0.1] for name in names}, results=results)

    @property
    def measured(self):
        """Columns of cells and process of each point, in the order they came."""
        return [(point.options.split_x, point.process) for point in self.points]


def configuration(folder, sweep="one", split_x=1, workload="frame", **fields):
    """The configuration of a point of a sweep that draws nothing, as drawing takes time."""
    return Configuration(
        scene=SceneConfiguration(name="cornell_box", source=SceneSource.procedural),
        sweep=SweepConfiguration(name=sweep, figures={"figure5": []}),
        measure=MeasureConfiguration(processes=1),
        method=fields.pop("method", Chosen(ALIGNED, AlignedOptions(split_x))),
        workload=Chosen(find_workload(workload), NoOptions()),
        **{"width": 64, "height": 64, "results_dir": str(folder), **fields},
    )


def grid(folder, *splits, processes=1, name="one", workload="frame", **sweep):
    """A point of a grid for each number of columns. sweep: fields of the sweep."""
    found = []
    for split in splits:
        one = configuration(folder, split_x=split, workload=workload)
        one.measure.processes = processes
        for field, value in sweep.items():
            setattr(one.sweep, field, value)
        found.append(GridPoint(name, one, (f"method.split_x={split}",)))
    return found


def files(folder):
    """Paths of all files below a folder -> their content."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
