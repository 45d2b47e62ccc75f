"""Measures one point in a process of its own: `python -m experiments.worker`, a JSON job on standard input.

Of whatever it prints nothing is read as a result: the result goes to the path named in the job.
"""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from atra.camera import Camera
from atra.compare import compare
from atra.errors import AtraError, InputError, MemoryBudgetError
from atra.hits import Hits
from atra.measure.memory import peak_rss_bytes, rss_bytes
from atra.measure.rounds import measure_rounds
from atra.mesh import Mesh
from atra.records import write_atomically
from atra.tracers import AlignedTracer, PixelTracer, Tracer
from experiments.configuration import Method, SceneSource
from experiments.points import Point
from experiments.scene_loading import load_scene, mesh_sha256

OWN, SINGLE, PACKETS = "own", "rtcIntersect1", "packets"
"""Names of the three methods in a record's samples: the point's own, the paper's baseline, the expert's baseline."""

_EXPERT_WIDTH = 8


@dataclass(frozen=True)
class Job:
    """point: what to measure. result_path: where the outcome goes, whole or not at all."""

    point: Point
    result_path: str

    def to_json(self) -> str:
        return json.dumps({"point": self.point.configuration(), "result_path": self.result_path})

    @classmethod
    def from_json(cls, text: str) -> Job:
        fields = json.loads(text)
        return cls(Point.from_fields(fields["point"]), fields["result_path"])


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    status, error, samples, results: as in `atra.records.Record`.
    on_purpose: the error is one of `atra`'s own, meant for the person at the keyboard; otherwise it is a bug.
    """

    status: str
    error: str | None = None
    on_purpose: bool = False
    warmup_samples: dict[str, list[float]] = field(default_factory=dict)
    samples: dict[str, list[float]] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)


def measure_point(point: Point) -> Outcome:
    """Build and trace the point's own method, read the memory, then time it against both baselines round by round.

    Raises InputError and MemoryBudgetError as the tracers do.
    """
    results: dict[str, Any] = {"rss_start_bytes": rss_bytes()}
    mesh, _ = load_scene(SceneSource(point.scene_source), point.scene, point.scene_path)
    if mesh_sha256(mesh) != point.mesh_sha256:
        raise InputError(f"scene {point.scene} changed since this run began; start it again")
    camera = point.camera
    _warm_up(point)
    results["rss_mesh_bytes"] = rss_bytes()
    with ExitStack() as stack:
        own = stack.enter_context(_own_tracer(point, mesh, camera))
        own_frames = _Frames(own)
        own_frames.trace()
        # Read before the baselines exist: this is the memory of the one method.
        results |= {
            "rss_bytes": rss_bytes(),
            "peak_rss_bytes": peak_rss_bytes(),
            "embree_bytes": int(own.embree_bytes),
            "triangles_traced": int(own.triangle_count),
            "plan_time_s": float(own.plan_time_s),
            "build_time_s": float(own.build_time_s),
            "packet_width": int(own.packet_width),
            "threads": int(own.threads),
        }
        single = stack.enter_context(_pixel_tracer(point, mesh, camera, 1))
        packets = stack.enter_context(_packet_tracer(point, mesh, camera))
        results |= {
            "baseline_build_time_s": float(single.build_time_s),
            "packets_width": int(packets.packet_width),
        }
        single_frames = _Frames(single)
        timed = measure_rounds(
            {OWN: own_frames.trace, SINGLE: single_frames.trace, PACKETS: _Frames(packets).trace},
            rounds=point.rounds,
            warmup=point.warmup,
            budget_s=point.frame_budget_s,
        )
        agreement = compare(mesh, camera, own_frames.latest(), single_frames.latest())
    results |= {f"pixels_{kind}": int(getattr(agreement, f"pixels_{kind}")) for kind in _AGREEMENT}
    results["rounds"] = timed.rounds
    return Outcome(
        "ok",
        warmup_samples={name: list(values) for name, values in timed.warmup.items()},
        samples={name: list(values) for name, values in timed.samples.items()},
        results=results,
    )


class _Frames:
    """Traces frame after frame into one image, as a renderer would: no sample pays for fresh pages."""

    def __init__(self, tracer: Tracer) -> None:
        self._tracer = tracer
        self._hits: Hits | None = None

    def trace(self) -> None:
        self._hits = self._tracer.trace(out=self._hits)

    def latest(self) -> Hits:
        if self._hits is None:
            self.trace()
        assert self._hits is not None
        return self._hits


_AGREEMENT = ("equal", "tied", "edge", "wrong")


def _own_tracer(point: Point, mesh: Mesh, camera: Camera, split: tuple[int, int] | None = None) -> Tracer:
    if point.method == Method.pixel.value:
        return _pixel_tracer(point, mesh, camera, point.packet_width)
    return AlignedTracer(
        mesh,
        camera,
        split=split or (point.split_x, point.split_y),
        culling=point.culling,
        packet_width=point.packet_width,
        threads=point.threads,
        build_quality=point.build_quality,
        memory_budget_bytes=point.memory_budget_bytes,
    )


def _pixel_tracer(point: Point, mesh: Mesh, camera: Camera, packet_width: int | None) -> PixelTracer:
    return PixelTracer(
        mesh, camera, packet_width=packet_width, threads=point.threads, build_quality=point.build_quality
    )


def _packet_tracer(point: Point, mesh: Mesh, camera: Camera) -> PixelTracer:
    try:
        return _pixel_tracer(point, mesh, camera, _EXPERT_WIDTH)
    except InputError:  # not native here; the record tells the width that was
        return _pixel_tracer(point, mesh, camera, None)


def _warm_up(point: Point) -> None:
    """Trace two triangles with every kernel the point uses: compiles them and starts Embree's threads, so that
    neither falls into a build time or a sample."""
    vertices = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    mesh = Mesh(vertices, np.array([(0, 1, 2), (0, 2, 3)], np.uint32))
    # Two cells of the point's own size: how packets fit into a cell decides which kernel is compiled.
    split = (min(point.split_x, 2), min(point.split_y, 2))
    width = split[0] * (point.width // point.split_x)
    height = split[1] * (point.height // point.split_y)
    camera = Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 60.0, width, height)
    for tracer in (
        _own_tracer(point, mesh, camera, split),
        _pixel_tracer(point, mesh, camera, 1),
        _packet_tracer(point, mesh, camera),
    ):
        with tracer:
            tracer.trace()


@contextmanager
def _reporting(result_path: Path) -> Iterator[list[Outcome]]:
    """Whatever happens inside becomes an outcome in `result_path`."""
    outcomes: list[Outcome] = []
    try:
        yield outcomes
    except MemoryBudgetError as error:
        outcomes.append(Outcome("skipped", str(error), on_purpose=True))
    except AtraError as error:
        outcomes.append(Outcome("failed", str(error), on_purpose=True))
    except Exception as error:
        traceback.print_exc()
        outcomes.append(Outcome("failed", f"{type(error).__name__}: {error}"))
    write_atomically(result_path, json.dumps(asdict(outcomes[-1]), allow_nan=False).encode())


def main() -> None:
    job = Job.from_json(sys.stdin.read())
    with _reporting(Path(job.result_path)) as outcomes:
        outcomes.append(measure_point(job.point))


if __name__ == "__main__":
    main()
