"""Points of the Cornell box at toy size, written in short, and measured in this process."""

from experiments.harness.configuration import Chosen, Configuration, MeasureConfiguration, SceneConfiguration
from experiments.harness.options import NoOptions
from experiments.harness.point import Point
from experiments.harness.points import plan_points
from experiments.harness.processes.worker import measure_point
from experiments.methods import find_method
from experiments.methods.aligned import ALIGNED, AlignedOptions
from experiments.workloads import find_workload
from experiments.workloads.frame import FRAME
from scenes.loading import SceneSource

POINT = Point(
    scene="box", scene_source="procedural", scene_path=None, mesh_sha256="0", triangles=1, view="own",
    eye=(0.0, 0.0, 1.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov_y_degrees=60.0, width=8, height=8,
    method=ALIGNED, options=AlignedOptions(split_x=1, packet_width=1), workload=FRAME, workload_options=NoOptions(),
    threads=1, ties="lowest", build_quality="medium", rounds=4, warmup=1, frame_budget_s=1.0, time_limit_s=30.0,
    memory_budget_gib=1.0,
)  # fmt: skip


def configured(method, workload, size=(48, 32), scene=None, measure=None, options=None, asked=None, **fields):
    """A configuration. method, workload: their names. options, asked: of the method, by default 4 cells, and of the
    workload. scene, measure: fields of these parts. fields: others."""
    kind, job = find_method(method), find_workload(workload)
    return Configuration(
        scene=SceneConfiguration(**{"name": "cornell_box", "source": SceneSource.procedural} | (scene or {})),
        measure=MeasureConfiguration(**{"rounds": 3, "warmup": 1} | (measure or {})),
        method=Chosen(kind, kind.options(**({"split_x": 4} if kind.has_cells else {}) | (options or {}))),
        workload=Chosen(job, job.options(**(asked or {}))),
        width=size[0], height=size[1], **fields,
    )  # fmt: skip


def planned(*arguments, **fields):
    """The point of `configured` with these arguments, and what keeps it from being measured."""
    (one,) = plan_points([configured(*arguments, **fields)])
    return one


def measured(*arguments, **fields):
    """What is measured of it."""
    one = planned(*arguments, **fields)
    assert one.problem is None
    return measure_point(one.point)
